// The two nearest points of a frame, found by a sweep along the first axis.
#pragma once

#include <algorithm>
#include <array>
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
      : points_(points), offsets_(offsets), D_(D), order_(points.size()) {
    std::iota(order_.begin(), order_.end(), std::int64_t{0});
    for (std::size_t t = 0; t + 1 < offsets.size(); ++t)
      std::sort(order_.begin() + offsets[t], order_.begin() + offsets[t + 1],
                [&](std::int64_t a, std::int64_t b) {
                  return points[a][0] != points[b][0] ? points[a][0] < points[b][0] : a < b;
                });
  }

  Two of(const Point& q, std::int64_t frame) const {
    const auto first = order_.begin() + offsets_[frame], last = order_.begin() + offsets_[frame + 1];
    auto right = std::partition_point(first, last,
                                      [&](std::int64_t i) { return points_[i][0] < q[0]; });
    auto left = right;
    Two found;
    while (left != first || right != last) {
      // The side whose next point is nearer along the axis.
      const double low = left == first ? kFar : q[0] - points_[left[-1]][0];
      const double high = right == last ? kFar : points_[*right][0] - q[0];
      const double along = std::min(low, high);
      if (along * along > found.distance2[1]) break;
      consider(low < high ? *--left : *right++, q, found);
    }
    return found;
  }

 private:
  static constexpr double kFar = std::numeric_limits<double>::infinity();

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
  std::vector<std::int64_t> order_;  // the points of each frame by their first coordinate
};

}  // namespace asterism
