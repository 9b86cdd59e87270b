// A proposed change of a partition.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>
#include <span>

#include "mcmc/model/partition.hpp"
#include "mcmc/moves/move_kinds.hpp"

namespace asterism {

template <typename Filter>
struct Change {
  Move move = Move::birth;
  std::array<Edit<Filter>, 2> edits;
  std::int32_t n_edits = 0;
  double gain = 0;  // of the log posterior
  // A change whose gain does not exceed this has no effect, and need not be evaluated completely.
  double min_gain = -std::numeric_limits<double>::infinity();
  double log_forward = 0, log_reverse = 0;
  double log_ratio = 0;  // Metropolis–Hastings
  // Acceptance probability. If the reverse move was not evaluated, it is 1 or 0 as the move was
  // accepted or not, which is unbiased.
  double p_taken = 0;
  std::int32_t with = -1;  // auxiliary draw: number of detections kept, or the detection concerned

  bool is_filtered() const {
    return std::all_of(edits.begin(), edits.begin() + n_edits, [](const Edit<Filter>& e) {
      return e.tail.states.size() == e.tail.nodes.size();
    });
  }
  std::span<Edit<Filter>> all() { return {edits.data(), static_cast<std::size_t>(n_edits)}; }
  Edit<Filter>& edit(std::int32_t track, std::int32_t keep) {
    Edit<Filter>& e = edits[n_edits++];
    e.track = track;
    e.keep = keep;
    e.tail.clear();
    return e;
  }
};

}  // namespace asterism
