// The background density of a detection that is no reappearing marker: uniform for new markers,
// with a peak beside each detected marker for ghosts.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <vector>

#include "rigid/tracklets.hpp"

namespace asterism {

class BackgroundDensity {
 public:
  BackgroundDensity(int D, double noise, double ghost_radius)
      : D_(D),
        noise_(noise),
        radius2_(ghost_radius * ghost_radius),
        peak_(std::pow(2 * std::numbers::pi * radius2_, -0.5 * D)) {}

  // Extends the volume of the uniform density to all positions seen so far.
  void add(const Point& y) {
    if (!has_box_) low_ = high_ = y;
    has_box_ = true;
    volume_ = 1;
    for (int d = 0; d < D_; ++d) {
      low_[d] = std::min(low_[d], y[d]);
      high_[d] = std::max(high_[d], y[d]);
      volume_ *= std::max(high_[d] - low_[d], 100 * noise_);
    }
  }
  // The sum of the peaks of all others at each detection of a frame. Each pair is computed once.
  void sum_peaks(const Frame& at, std::vector<double>& sums) const {
    sums.assign(at.seen.size(), 0);
    for (std::size_t i = 0; i < sums.size(); ++i)
      for (std::size_t j = i + 1; j < sums.size(); ++j) {
        const double distance2 = squared_distance(at.seen[i].at, at.seen[j].at);
        if (distance2 > kSurelyNoPeak * radius2_) continue;  // saves the division for most pairs
        const double peak = peak_at(distance2);
        sums[i] += peak;
        sums[j] += peak;
      }
  }
  double log_density(double sum_of_peaks, const Frame& at) const {
    const double n = std::max<double>(static_cast<double>(at.seen.size()), 1);
    return std::log(1 / volume_ + sum_of_peaks / n * peak_);
  }
  // Whether a ghost of another tracklet may be at this position.
  bool is_near_another(const Point& y, const Frame& at, std::int32_t own) const {
    return std::any_of(at.seen.begin(), at.seen.end(), [&](const Frame::One& other) {
      return other.tracklet != own && squared_distance(other.at, y, D_) < 9 * radius2_;
    });
  }

 private:
  static constexpr double kNoPeak = 40;  // squared radii from which a peak counts as 0
  static constexpr double kSurelyNoPeak = 41;  // beyond any rounding

  // A peak relative to its height, by the squared distance from the marker.
  double peak_at(double distance2) const {
    const double far = distance2 / radius2_;
    return far < kNoPeak ? std::exp(-0.5 * far) : 0;
  }

  int D_;
  double noise_, radius2_, peak_;
  bool has_box_ = false;
  Point low_{}, high_{};
  double volume_ = 1;
};

// The tracklets and frames detected so far, as far as they are kept.
struct StitchMemory {
  Tracklets tracklets;
  RecentFrames frames;
  BackgroundDensity background;
};

}  // namespace asterism
