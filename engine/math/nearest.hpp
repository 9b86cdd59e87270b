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
        axis_(offsets.size() - 1, kUnsorted) {
    for (std::vector<double>& x : sorted_) x.resize(points.size() + kBlock);
  }

  Two of(const Point& q, std::int64_t frame) {
    if (axis_[frame] == kUnsorted) sort(frame);  // often few of the frames are asked for
    const int d = axis_[frame];
    const double* along = sorted_[d].data();
    const std::int64_t first = offsets_[frame], last = offsets_[frame + 1];
    std::int64_t right = std::lower_bound(along + first, along + last, q[d]) - along, left = right;
    Two found;
    while (left != first || right != last) {
      // The side whose next point is nearer along the axis.
      const double low = left == first ? kFar : q[d] - along[left - 1];
      const double high = right == last ? kFar : along[right] - q[d];
      const double nearest = std::min(low, high);
      if (nearest * nearest > found.distance2[1]) break;
      if (low < high) {
        const std::int64_t n = std::min(kBlock, left - first);
        left -= n;
        consider(left, n, q, found);
      } else {
        const std::int64_t n = std::min(kBlock, last - right);
        consider(right, n, q, found);
        right += n;
      }
    }
    return found;
  }

 private:
  static constexpr std::int64_t kBlock = 4;  // points whose distances are computed together
  static constexpr double kFar = std::numeric_limits<double>::infinity();
  static constexpr std::int8_t kUnsorted = -1;

  void sort(std::int64_t frame) {
    const auto first = order_.begin() + offsets_[frame], last = order_.begin() + offsets_[frame + 1];
    std::iota(first, last, offsets_[frame]);
    const int d = widest_axis(frame);
    std::sort(first, last, [&](std::int64_t a, std::int64_t b) {
      return points_[a][d] != points_[b][d] ? points_[a][d] < points_[b][d] : a < b;
    });
    for (std::int64_t k = offsets_[frame]; k < offsets_[frame + 1]; ++k)
      for (int e = 0; e < kMaxAxes; ++e) sorted_[e][k] = points_[order_[k]][e];
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

  // Considers n sorted points, at most kBlock. Of equally near points the first in the frame counts
  // as nearer.
  void consider(std::int64_t begin, std::int64_t n, const Point& q, Two& found) const {
    std::array<double, kBlock> distance2;  // also of the points after the n, which are not used
    for (std::int64_t k = 0; k < kBlock; ++k) {
      const double x = sorted_[0][begin + k] - q[0], y = sorted_[1][begin + k] - q[1],
                   z = sorted_[2][begin + k] - q[2];
      distance2[k] = x * x + y * y + z * z;
    }
    // Most blocks contain no nearer point, so one branch for a block is predicted well.
    if (std::ranges::min(distance2) > found.distance2[1]) return;
    for (std::int64_t k = 0; k < n; ++k) {
      const std::int64_t i = order_[begin + k];
      const auto is_nearer = [&](int rank) {
        return distance2[k] < found.distance2[rank] ||
               (distance2[k] == found.distance2[rank] && i < found.index[rank]);
      };
      if (is_nearer(0)) {
        found = {{i, found.index[0]}, {distance2[k], found.distance2[0]}};
      } else if (is_nearer(1)) {
        found.index[1] = i;
        found.distance2[1] = distance2[k];
      }
    }
  }

  std::span<const Point> points_;
  std::span<const std::int64_t> offsets_;
  int D_;
  std::vector<std::int64_t> order_;  // the points of each sorted frame along its axis
  std::array<std::vector<double>, kMaxAxes> sorted_;  // their coordinates, by axis, and a block more
  std::vector<std::int8_t> axis_;
};

}  // namespace asterism
