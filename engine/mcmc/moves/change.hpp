// What a move changes in a partition.
#pragma once

#include <array>
#include <cstdint>
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
  double log_forward = 0, log_reverse = 0;
  double log_ratio = 0;  // of Metropolis and Hastings
  // How probably it is taken; of what was hardly weighed whether it was, which is right on average.
  double p_taken = 0;
  std::int32_t with = -1;  // what was drawn on the way: detections kept, or the detection at hand

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
