// The two nearest points of a frame, found by a sweep along the axis on which they differ most.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numeric>
#include <span>
#include <vector>

#include "math/point.hpp"

namespace asterism {

class NearestInFrame {
 public:
  struct Two {
    std::array<std::int64_t, 2> index{-1, -1};  // into all points; the nearest first
    std::array<double, 2> distance2{std::numeric_limits<double>::infinity(),
                                    std::numeric_limits<double>::infinity()};
  };

  // Frame t has the points from offsets[t] to offsets[t + 1]. Both spans must outlive the object.
  NearestInFrame(std::span<const Point> points, std::span<const std::int64_t> offsets, int D)
      : points_(points), offsets_(offsets), D_(D), order_(points.size()),
        axis_(offsets.size() - 1, kUnsorted) {}

  Two of(const Point& q, std::int64_t frame) {
    if (axis_[frame] == kUnsorted) sort(frame);  // often few of the frames are asked for
    const int d = axis_[frame];
    const auto first = order_.begin() + offsets_[frame], last = order_.begin() + offsets_[frame + 1];
    auto right = std::partition_point(first, last,
                                      [&](std::int64_t i) { return points_[i][d] < q[d]; });
    auto left = right;
    Two found;
    while (left != first || right != last) {
      // The side whose next point is nearer along the axis.
      const double low = left == first ? kFar : q[d] - points_[left[-1]][d];
      const double high = right == last ? kFar : points_[*right][d] - q[d];
      const double along = std::min(low, high);
      if (along * along > found.distance2[1]) break;
      consider(low < high ? *--left : *right++, q, found);
    }
    return found;
  }

 private:
  static constexpr double kFar = std::numeric_limits<double>::infinity();
  static constexpr std::int8_t kUnsorted = -1;

  void sort(std::int64_t frame) {
    const auto first = order_.begin() + offsets_[frame], last = order_.begin() + offsets_[frame + 1];
    std::iota(first, last, offsets_[frame]);
    const int d = widest_axis(frame);
    std::sort(first, last, [&](std::int64_t a, std::int64_t b) {
      return points_[a][d] != points_[b][d] ? points_[a][d] < points_[b][d] : a < b;
    });
    axis_[frame] = static_cast<std::int8_t>(d);
  }
  // The axis with the largest mean deviation from the mean, which few false alarms hardly change.
  int widest_axis(std::int64_t frame) const {
    const std::span own = points_.subspan(offsets_[frame], offsets_[frame + 1] - offsets_[frame]);
    int widest = 0;
    double max_spread = 0;
    for (int d = 0; d < D_; ++d) {
      double mean = 0, spread = 0;
      for (const Point& y : own) mean += y[d] / static_cast<double>(own.size());
      for (const Point& y : own) spread += std::abs(y[d] - mean);
      if (spread <= max_spread) continue;
      max_spread = spread;
      widest = d;
    }
    return widest;
  }

  // Of equally near points the first in the frame counts as nearer.
  void consider(std::int64_t i, const Point& q, Two& found) const {
    const double d2 = squared_distance(points_[i], q, D_);
    const auto is_nearer = [&](int k) {
      return d2 < found.distance2[k] || (d2 == found.distance2[k] && i < found.index[k]);
    };
    if (is_nearer(0)) {
      found = {{i, found.index[0]}, {d2, found.distance2[0]}};
    } else if (is_nearer(1)) {
      found.index[1] = i;
      found.distance2[1] = d2;
    }
  }

  std::span<const Point> points_;
  std::span<const std::int64_t> offsets_;
  int D_;
  std::vector<std::int64_t> order_;  // the points of each sorted frame along its axis
  std::vector<std::int8_t> axis_;
};

}  // namespace asterism
