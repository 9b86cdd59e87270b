// Estimates the probability that each detection has its reference predecessor: the fraction of the
// chain's states in which it has.
//
// Every evaluated proposal counts with its acceptance probability, whether it is accepted or not.
// This expectation over the last draw reduces the variance without bias.
#pragma once

#include <cstdint>
#include <vector>

#include "mcmc/model/partition.hpp"
#include "mcmc/moves/change.hpp"

namespace asterism {

template <typename Filter>
class Marginals {
 public:
  explicit Marginals(const Partition<Filter>& p) : p_(p) {}

  // Makes the present partition the reference.
  void begin() {
    const std::int32_t n = p_.window().n_ids();
    reference_.resize(n);
    is_so_.assign(n, true);
    since_.assign(n, 0);
    sum_.assign(n, 0);
    to_.assign(n, kUntouched);
    for (std::int32_t i = 0; i < n; ++i) reference_[i] = where(i);
    n_steps_ = 0;
  }

  // Adds a proposed change. It must be called before the change is applied.
  void weigh(const Change<Filter>& change, bool is_taken) {
    touched_.clear();
    for (std::int32_t e = 0; e < change.n_edits; ++e) {
      const Edit<Filter>& edit = change.edits[e];
      if (edit.track < 0) continue;
      const auto& nodes = p_.track(edit.track).nodes;
      for (std::int32_t n = edit.keep; n < static_cast<std::int32_t>(nodes.size()); ++n) go(nodes[n], kNowhere);
    }
    for (std::int32_t e = 0; e < change.n_edits; ++e) {
      const Edit<Filter>& edit = change.edits[e];
      std::int32_t before = edit.keep > 0 ? p_.track(edit.track).nodes[edit.keep - 1] : kFirst;
      for (const std::int32_t i : edit.tail.nodes) {
        go(i, before);
        before = i;
      }
    }
    for (const std::int32_t i : touched_) {
      const bool will_be = to_[i] == reference_[i];
      to_[i] = kUntouched;
      if (will_be == is_so_[i]) continue;
      sum_[i] += will_be ? change.p_taken : -change.p_taken;
      if (!is_taken) continue;
      if (is_so_[i]) sum_[i] += static_cast<double>(n_steps_ + 1 - since_[i]);
      since_[i] = n_steps_ + 1;
      is_so_[i] = will_be;
    }
  }
  // Counts a move. It must be called after every move, possible or not.
  void count() { ++n_steps_; }

  double share(std::int32_t i) const {
    const double sum = sum_[i] + (is_so_[i] ? static_cast<double>(n_steps_ - since_[i]) : 0);
    return sum / static_cast<double>(n_steps_);
  }
  // Keeps the reference and clears the counts.
  void forget() {
    std::fill(sum_.begin(), sum_.end(), 0.0);
    std::fill(since_.begin(), since_.end(), 0);
    n_steps_ = 0;
  }

 private:
  // Predecessor of a detection: another detection, none in its track, or no track.
  static constexpr std::int32_t kFirst = -1, kNowhere = -2, kUntouched = -3;
  std::int32_t where(std::int32_t i) const { return p_.track_of(i) < 0 ? kNowhere : p_.before(i); }
  void go(std::int32_t i, std::int32_t before) {
    if (to_[i] == kUntouched) touched_.push_back(i);
    to_[i] = before;
  }

  const Partition<Filter>& p_;
  std::vector<std::int32_t> reference_, to_, touched_;
  std::vector<char> is_so_;
  std::vector<std::int64_t> since_;
  std::vector<double> sum_;
  std::int64_t n_steps_ = 0;
};

}  // namespace asterism
