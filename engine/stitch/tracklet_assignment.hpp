// Assigns tracklets to occluded markers: scores each pair, solves the assignment, and computes the
// probability of the result.
#pragma once

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

#include "base/flat_map.hpp"
#include "base/scratch.hpp"
#include "math/log_sums.hpp"
#include "rigid/tracklets.hpp"
#include "solve/assignment.hpp"
#include "stitch/background_density.hpp"
#include "stitch/rigid_neighbours.hpp"

namespace asterism {

// Advice that a tracklet continues the marker with a label. The log odds of that marker rise by
// `weight`, those of all others fall by half of it.
struct JoinAdvice {
  std::int64_t continues = 0;
  double weight = 0;
};

class TrackletAssignment {
 public:
  static constexpr double kOddsFactor = 0.25;  // factor of log odds in a probability

  // Supplies advice on the tracklets that begin with a label.
  void advise(std::int64_t label, const JoinAdvice& advice) { advice_[label] = advice; }

  // The marker of a tracklet, kOpen if it is none of the occluded ones, and the probability.
  // `is_short` identifies tracklets that were over before their decision.
  template <typename IsShort>
  std::pair<std::int32_t, double> best(const StitchMemory& s, const Markers& markers,
                                       RigidNeighbours& neighbours, std::int32_t id,
                                       IsShort&& is_short) {
    const Tracklet& f = s.tracklets.at(id);
    double max_gain = kNever;
    w_.scored.clear();
    for (const auto& [k, marker] : markers) {
      const double gain = score(s, neighbours, id, f, k, marker, is_short(f));
      max_gain = std::max(max_gain, gain);
      if (gain > 0) w_.scored.emplace_back(k, gain);
    }
    const auto n = static_cast<std::int32_t>(w_.scored.size());
    const std::pair none(Decision::kOpen, 1 / (1 + odds(max_gain)));
    if (n == 0) return none;
    w_.candidates.clear();
    w_.rivals.assign(n, 1);  // Σ of the odds of all candidates of this marker, and of none
    double all = 1;
    for (std::int32_t c = 0; c < n; ++c) {
      w_.candidates.push_back({0, c, w_.scored[c].second, 0});
      all += odds(w_.scored[c].second);
    }
    std::int32_t row = 0;
    for (const auto& [other, g] : s.tracklets) {
      if (other == id || g.marker != Decision::kOpen || g.n == 0) continue;
      if (g.last < f.first || g.first > f.last) continue;  // both may be the same marker
      ++row;
      for (std::int32_t c = 0; c < n; ++c) {
        const std::int32_t k = w_.scored[c].first;
        const double gain = score(s, neighbours, other, g, k, markers.at(k), is_short(g));
        if (!(gain > 0)) continue;
        w_.candidates.push_back({row, c, gain, 0});
        w_.rivals[c] += odds(gain);
      }
    }
    w_.match.assign(row + 1, -1);
    w_.assignment.solve(w_.candidates, w_.match);
    const std::int32_t own = w_.match[0];
    if (own < 0) return none;
    const auto& [marker, gain] = w_.scored[own];
    return {marker, odds(gain) / (all + w_.rivals[own] - 1)};
  }

  // Computes the best candidates of the undecided tracklets. A tracklet is compared again whenever
  // its number of detections has doubled.
  template <typename IsShort>
  void guess(StitchMemory& s, const Markers& markers, RigidNeighbours& neighbours,
             IsShort&& is_short) {
    w_.open.clear();
    w_.candidates.clear();
    for (auto& [id, f] : s.tracklets) {
      f.guess = -1;
      if (f.marker != Decision::kOpen || f.n == 0) continue;
      if (std::has_single_bit(static_cast<std::uint32_t>(f.n)) && f.last == s.frames.now()) {
        auto& guesses = f.open.own().guesses;
        guesses.clear();
        for (const auto& [k, marker] : markers)
          if (const double gain = score(s, neighbours, id, f, k, marker, is_short(f)); gain > 0)
            guesses.emplace_back(k, gain);
      } else if (f.last == s.frames.now()) {
        for (const auto& [k, marker] : markers)
          if (may_be(f, marker)) neighbours.prepare(s, k, marker);
      }
      const auto row = static_cast<std::int32_t>(w_.open.size());
      w_.open.push_back(id);
      for (const auto& [k, gain] : f.open->guesses)
        if (const Marker* marker = markers.find(k); marker != nullptr && marker->is_occluded)
          w_.candidates.push_back({row, k, gain, 0});
    }
    if (w_.candidates.empty()) return;
    w_.match.assign(w_.open.size(), -1);
    w_.assignment.solve(w_.candidates, w_.match);
    for (std::size_t row = 0; row < w_.open.size(); ++row)
      s.tracklets.at(w_.open[row]).guess = w_.match[row];
  }

 private:
  static constexpr double kNever = -std::numeric_limits<double>::infinity();
  // Prior log odds that a tracklet is a reappearing marker: of a short one, and of others.
  static constexpr double kShort = -8, kLong = 2;
  // Smallest weight of the motion if rigid prediction is trusted.
  static constexpr double kMinMotion = 0.005;

  // Errors of neighbours are correlated, and so are those of successive detections, so the sum of
  // their log-likelihood ratios overstates the evidence. The factor was measured on captures with
  // known truth.
  static double odds(double gain) { return std::exp(std::min(kOddsFactor * gain, 500.0)); }

  static bool may_be(const Tracklet& f, const Marker& marker) {
    return marker.is_occluded && marker.last < f.first;
  }
  // Log odds that a tracklet is the reappearing marker k.
  double score(const StitchMemory& s, RigidNeighbours& neighbours, std::int32_t id,
               const Tracklet& f, std::int32_t k, const Marker& marker, bool is_short) const {
    if (!may_be(f, marker)) return kNever;
    const double body = neighbours.log_odds(s, f, id, k, marker), motion = by_motion(s, f, k);
    const double at_rest = std::clamp(1 / (1 + std::exp(marker.mean_gain)), kMinMotion, 0.5);
    const double a = body + std::log1p(-at_rest), b = motion + std::log(at_rest);
    const double both = log_sum(a, b);
    return both == kNever ? kNever : both + (is_short ? kShort : kLong) + advised(f, marker);
  }
  static double by_motion(const StitchMemory& s, const Tracklet& f, std::int32_t k) {
    for (const Continuation& c : f.open->continuations)
      if (c.marker == k)
        if (const Frame* at = s.frames.find(f.first); at != nullptr)
          return c.log_likelihood - f.open->alone -
                 s.background.log_density(f.open->detections.front().peaks, *at);
    return kNever;
  }
  double advised(const Tracklet& f, const Marker& marker) const {
    const JoinAdvice* advice = advice_.find(f.label);
    if (advice == nullptr) return 0;
    return marker.label == advice->continues ? advice->weight : -0.5 * advice->weight;
  }

  struct Memory {
    std::vector<std::int32_t> open, match;
    std::vector<std::pair<std::int32_t, double>> scored;
    std::vector<double> rivals;
    std::vector<Candidate> candidates;
    Assignment assignment;
  };

  FlatMap<std::int64_t, JoinAdvice> advice_;
  Scratch<Memory> w_;  // scratch of one comparison
};

}  // namespace asterism
