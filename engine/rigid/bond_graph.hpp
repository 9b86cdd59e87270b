// Which markers are bonded: how far apart they are, and what it says that they are as far or not.
//
//   b(d) = w / n · (1 − z²) / (1 + z²)      z = (d − μ) / s
//
// A distance d as it should be says w/n nats for the two, one that is off by s nothing, and one that
// is far off −w/n: bounded, however wrong. n is the number of bonds of that marker of the two which
// has more, so that all that bonds say of a marker in a frame lies within ±w.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

namespace asterism {

class BondGraph {
 public:
  // Markers a < b.
  struct Pair {
    std::int32_t a = 0, b = 0;
    double mean = 0, scale = 1;  // μ and s
  };
  struct Bond {
    std::int32_t other = 0;
    double mean = 0, scale = 1, weight = 0;  // μ, s and w / n

    double says(double distance) const {
      const double z = (distance - mean) / scale;
      return weight * (1 - z * z) / (1 + z * z);
    }
  };
  // What few bonds say counts as if there were so many.
  static constexpr std::int32_t kFew = 3;

  BondGraph() = default;
  // Each pair once.
  BondGraph(std::int32_t n_markers, std::span<const Pair> pairs, double weight)
      : first_(n_markers + 1, 0), reach_(n_markers, 0), bonds_(2 * pairs.size()) {
    for (const Pair& p : pairs)
      for (const std::int32_t a : {p.a, p.b}) ++first_[a + 1];
    for (std::int32_t a = 0; a < n_markers; ++a) first_[a + 1] += first_[a];
    std::vector<std::int32_t> next(first_.begin(), first_.end() - 1);
    for (const Pair& p : pairs) {
      const double own = weight / std::max({kFew, n_bonds(p.a), n_bonds(p.b)});
      for (const auto& [a, b] : {std::pair{p.a, p.b}, std::pair{p.b, p.a}}) {
        bonds_[next[a]++] = {b, p.mean, p.scale, own};
        reach_[a] += own;
      }
    }
  }

  std::int32_t n_markers() const { return static_cast<std::int32_t>(reach_.size()); }
  std::int64_t n_pairs() const { return static_cast<std::int64_t>(bonds_.size() / 2); }
  std::span<const Bond> of(std::int32_t marker) const {
    return {bonds_.data() + first_[marker], bonds_.data() + first_[marker + 1]};
  }
  // The most that bonds say of a marker in a frame.
  double reach(std::int32_t marker) const { return reach_[marker]; }

 private:
  std::int32_t n_bonds(std::int32_t marker) const { return first_[marker + 1] - first_[marker]; }

  std::vector<std::int32_t> first_;  // bond of each marker, by marker
  std::vector<double> reach_;
  std::vector<Bond> bonds_;
};

}  // namespace asterism
