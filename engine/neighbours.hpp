// Which markers keep their distances: for each marker a few others, how far they are, and how steady
// that is.
//
// What was long ago is forgotten: a mean over the last frames has no less than 1/kMemory of each.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "kalman.hpp"

namespace asterism {

// A marker in a frame.
struct Seen {
  std::int32_t marker = 0;
  Point at{};
};

struct Bond {
  std::int32_t other = 0;
  std::int64_t n = 0;  // frames in which both were seen
  double mean = 0, variance = 0;
};

class Neighbours {
 public:
  static constexpr std::int64_t kMemory = 400;

  // `noise`: of a detection, along an axis.
  Neighbours(int D, double noise) : D_(D), noise_(noise) {}

  // The markers that are seen in a frame.
  void add(std::span<const Seen> seen) {
    ++n_frames_;
    for (std::int32_t s = 0; s < static_cast<std::int32_t>(seen.size()); ++s) {
      if (static_cast<std::int32_t>(bonds_.size()) <= seen[s].marker) {
        bonds_.resize(seen[s].marker + 1);
        place_.resize(seen[s].marker + 1, -1);
      }
      place_[seen[s].marker] = s;
    }
    for (const Seen& one : seen) {
      std::vector<Bond>& bonds = bonds_[one.marker];
      if (bonds.empty() || (n_frames_ + one.marker) % kLookEvery == 0) look_around(seen, one);
      for (Bond& bond : bonds)
        if (const std::int32_t s = place_[bond.other]; s >= 0) measure(one.at, seen[s].at, bond);
    }
    for (const Seen& one : seen) place_[one.marker] = -1;
  }

  // A marker that will not be asked for again.
  void forget(std::int32_t marker) {
    if (marker < static_cast<std::int32_t>(bonds_.size())) std::vector<Bond>().swap(bonds_[marker]);
  }

  std::span<const Bond> of(std::int32_t marker) const {
    if (marker >= static_cast<std::int32_t>(bonds_.size())) return {};
    return bonds_[marker];
  }
  // How far the other may be off after a while, roughly: what was seen of it, and what was not yet.
  double unsteadiness(const Bond& bond) const {
    return std::sqrt(bond.variance) + 4 * noise_ +
           bond.mean * (0.02 + 1 / static_cast<double>(std::max<std::int64_t>(bond.n, 1)));
  }

 private:
  static constexpr std::int64_t kLookEvery = 32;  // frames
  static constexpr std::size_t kMost = 24, kNearest = 12;
  static constexpr std::int64_t kTrial = 60;  // frames until one may be given up for another

  void measure(const Point& a, const Point& b, Bond& bond) const {
    const double distance = std::sqrt(squared_distance(a, b, D_));
    const double share = 1 / static_cast<double>(std::min(++bond.n, kMemory));
    const double off = distance - bond.mean;
    bond.mean += share * off;
    bond.variance += share * (off * (distance - bond.mean) - bond.variance);
  }

  // The nearest others are tried; where there is no room, instead of the least steady.
  void look_around(std::span<const Seen> seen, const Seen& one) {
    near_.clear();
    for (const Seen& other : seen)
      if (other.marker != one.marker)
        near_.push_back({squared_distance(one.at, other.at, D_), other.marker});
    const std::size_t n = std::min(bonds_[one.marker].empty() ? kMost : kNearest, near_.size());
    std::partial_sort(near_.begin(), near_.begin() + static_cast<std::ptrdiff_t>(n), near_.end());
    std::vector<Bond>& bonds = bonds_[one.marker];
    for (std::size_t k = 0; k < n; ++k) {
      const std::int32_t other = near_[k].second;
      if (std::any_of(bonds.begin(), bonds.end(), [&](const Bond& b) { return b.other == other; }))
        continue;
      if (bonds.size() < kMost) {
        bonds.push_back({other});
        continue;
      }
      const auto worst = std::max_element(bonds.begin(), bonds.end(), [&](const Bond& a, const Bond& b) {
        return unsteadiness(a) < unsteadiness(b);
      });
      if (worst->n >= kTrial && worst->mean * worst->mean > near_[k].first) *worst = {other};
    }
  }

  int D_;
  double noise_;
  std::int64_t n_frames_ = 0;
  std::vector<std::vector<Bond>> bonds_;
  std::vector<std::int32_t> place_;  // of a marker in the frame
  std::vector<std::pair<double, std::int32_t>> near_;
};

}  // namespace asterism
