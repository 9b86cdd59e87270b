// The growth of a track in a move: detections are drawn one after the other among the free ones
// that may follow, until the track stops. Also computes the probability of a given growth.
//
//   uniform   stop with probability γ, else draw a gap d in 1 … d̄ and a free detection at that
//             gap, both uniformly; the track also stops if there is none
//   informed  a detection j has weight exp(its gain of the score) + ε, the stop exp(its end term)
//
// Forced growth does not stop before the first step.
#pragma once

#include <algorithm>
#include <cmath>
#include <compare>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

#include "math/random.hpp"
#include "mcmc/model/edit_filter.hpp"
#include "mcmc/model/partition.hpp"

namespace asterism {

struct GrowthOptions {
  bool is_informed = true;
  double stop = 0.01;    // γ
  double floor = 1e-4;   // ε
};

template <typename Filter>
class Growth {
 public:
  using State = typename Filter::State;
  static constexpr double kNever = -std::numeric_limits<double>::infinity();

  Growth(const Partition<Filter>& partition, const GrowthOptions& options)
      : p_(partition), opt_(options) {}

  // Extends the tail of an edit. Free are detections in no track and those of the edited track that
  // it does not keep. Returns the log probability, -inf if a forced step is impossible.
  double grow(Edit<Filter>& edit, bool is_forced, Random& random) {
    own_ = edit.track;
    keep_ = edit.keep;
    double log_p = 0;
    std::int32_t n_same = keep_;  // number of leading detections that are unchanged
    for (;; is_forced = false) {
      const bool is_first = edit.tail.nodes.empty();
      const std::int32_t i =
          is_first ? p_.track(own_).nodes[keep_ - 1] : edit.tail.nodes.back();
      // For unchanged detections the state of the partition, from which gains are remembered.
      const bool is_present = n_same == keep_ + static_cast<std::int32_t>(edit.tail.nodes.size());
      const State& state = is_present ? p_.state(i) : edit.tail.states.back();
      const std::int32_t j = opt_.is_informed ? draw_informed(i, state, is_forced, random, log_p)
                                              : draw_uniform(i, is_forced, random, log_p);
      if (j < 0) return log_p;
      const auto place = keep_ + static_cast<std::int32_t>(edit.tail.nodes.size());
      if (n_same == place && own_ >= 0 && place < p_.track(own_).size() &&
          p_.track(own_).nodes[place] == j) {
        append_same(p_, edit, j);
        ++n_same;
      } else {
        append(p_, edit, j);
      }
    }
  }

  // Log probability that a track that keeps its first detections grows into its present form.
  double log_probability(std::int32_t track, std::int32_t keep, bool is_forced) {
    own_ = track;
    keep_ = keep;
    const auto& nodes = p_.track(track).nodes;
    double log_p = 0;
    for (std::size_t n = keep; n <= nodes.size(); ++n, is_forced = false) {
      const std::int32_t i = nodes[n - 1], j = n < nodes.size() ? nodes[n] : -1;
      log_p += opt_.is_informed ? log_informed(i, p_.state(i), j, is_forced)
                                : log_uniform(i, j, is_forced);
    }
    return log_p;
  }

 private:
  struct Follower {
    std::int32_t gap = 0, detection = 0;
    auto operator<=>(const Follower&) const = default;
  };

  // Lists the free detections that may follow i, ordered by gap and number.
  void list_free(std::int32_t i) {
    const DetectionWindow& window = p_.window();
    free_.clear();
    const auto offer = [&](std::int32_t j) {
      if (window.is_linkable(i, j))
        free_.push_back({static_cast<std::int32_t>(window[j].frame - window[i].frame), j});
    };
    for (const std::int32_t j : p_.free().items()) offer(j);
    if (own_ >= 0) {
      const auto& nodes = p_.track(own_).nodes;
      for (std::size_t n = keep_; n < nodes.size(); ++n)
        if (!p_.is_continuation(nodes[n])) offer(nodes[n]);
    }
    std::sort(free_.begin(), free_.end());
  }
  double log_stop() const {
    const int max_gap = p_.window().max_gap();
    int n_gaps = 0;
    for (std::size_t k = 0; k < free_.size(); ++k)
      n_gaps += k == 0 || free_[k].gap != free_[k - 1].gap;
    return std::log(opt_.stop + (1 - opt_.stop) * (max_gap - n_gaps) / max_gap);
  }

  std::int32_t draw_uniform(std::int32_t i, bool is_forced, Random& random, double& log_p) {
    const int max_gap = p_.window().max_gap();
    if (!is_forced && random.uniform() < opt_.stop) {
      list_free(i);
      log_p += log_stop();
      return -1;
    }
    list_free(i);
    const int d = 1 + random.below(max_gap);
    const auto [first, last] = with_gap(d);
    if (first == last) {
      log_p += is_forced ? kNever : log_stop();
      return -1;
    }
    const auto n = static_cast<std::int32_t>(last - first);
    log_p += (is_forced ? 0 : std::log1p(-opt_.stop)) - std::log(static_cast<double>(max_gap) * n);
    return first[random.below(n)].detection;
  }

  double log_uniform(std::int32_t i, std::int32_t j, bool is_forced) {
    list_free(i);
    if (j < 0) return log_stop();
    const int max_gap = p_.window().max_gap();
    const auto [first, last] =
        with_gap(static_cast<int>(p_.window()[j].frame - p_.window()[i].frame));
    return (is_forced ? 0 : std::log1p(-opt_.stop)) -
           std::log(static_cast<double>(max_gap) * static_cast<double>(last - first));
  }
  std::pair<const Follower*, const Follower*> with_gap(int d) const {
    const Follower* first = free_.data();
    const Follower* const end = first + free_.size();
    while (first != end && first->gap < d) ++first;
    const Follower* last = first;
    while (last != end && last->gap == d) ++last;
    return {first, last};
  }

  // Lists the possible successors of i and their weights. Returns the total weight, including that
  // of stopping.
  double weigh(std::int32_t i, const State& state, bool is_forced) {
    const bool is_present = &state == &p_.state(i);
    choices_.clear();
    weights_.clear();
    list_free(i);
    double sum = 0;
    int expected_gap = 0;
    for (const Follower& f : free_) {
      double unknown = std::numeric_limits<double>::quiet_NaN();
      double& gain = is_present ? p_.known_gain(i, f.detection) : unknown;
      if (std::isnan(gain)) gain = gain_of(i, state, f, std::exchange(expected_gap, f.gap));
      choices_.push_back(f.detection);
      weights_.push_back(std::exp(std::min(gain, 500.0)) + opt_.floor);
      sum += weights_.back();
    }
    if (is_forced) return sum;
    choices_.push_back(-1);
    weights_.push_back(std::exp(p_.end_score(i)));
    return sum + weights_.back();
  }
  // The gain by one successor. `expected_gap` is the gap of the present prediction, 0 for none.
  double gain_of(std::int32_t i, const State& state, const Follower& f, int expected_gap) {
    const DetectionWindow& window = p_.window();
    if (f.gap != expected_gap)
      p_.filter().expect(p_.motion(), window, state, window[i].frame, f.gap, expected_, expected_gap);
    return p_.gap_score(f.gap) +
           Filter::log_likelihood(p_.motion(), expected_, window[f.detection].y);
  }

  std::int32_t draw_informed(std::int32_t i, const State& state, bool is_forced, Random& random,
                             double& log_p) {
    const double total = weigh(i, state, is_forced);
    if (choices_.empty()) {
      log_p = kNever;
      return -1;
    }
    double left = random.uniform() * total;
    std::size_t c = 0;
    while (c + 1 < choices_.size() && left >= weights_[c]) left -= weights_[c++];
    log_p += std::log(weights_[c] / total);
    return choices_[c];
  }

  double log_informed(std::int32_t i, const State& state, std::int32_t j, bool is_forced) {
    const double total = weigh(i, state, is_forced);
    for (std::size_t c = 0; c < choices_.size(); ++c)
      if (choices_[c] == j) return std::log(weights_[c] / total);
    return kNever;
  }

  const Partition<Filter>& p_;
  GrowthOptions opt_;
  std::int32_t own_ = -1, keep_ = 0;
  typename Filter::Expected expected_;
  std::vector<Follower> free_;
  std::vector<std::int32_t> choices_;
  std::vector<double> weights_;
};

}  // namespace asterism
