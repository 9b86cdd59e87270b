// Finds the points of one frame that lie within a ball, by a uniform grid.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "math/point.hpp"

namespace asterism {

class PointGrid {
 public:
  // With fewer points, a linear scan is faster than a grid.
  static constexpr std::size_t kScanBelow = 64;

  // `cell` is the requested edge of a cell. The edge is enlarged if there would be more than a few
  // cells for each point.
  void build(std::span<const Point> points, int D, double cell) {
    points_ = points;
    D_ = D;
    max_r_ = 0;
    for (const Point& p : points) max_r_ = std::max(max_r_, p.r);
    is_grid_ = points.size() >= kScanBelow;
    if (!is_grid_) return;
    Point high{};
    for (int d = 0; d < D; ++d) {
      low_[d] = std::numeric_limits<double>::infinity();
      high[d] = -std::numeric_limits<double>::infinity();
      for (const Point& p : points) {
        low_[d] = std::min(low_[d], p[d]);
        high[d] = std::max(high[d], p[d]);
      }
    }
    const double per_axis = std::pow(2.0 * static_cast<double>(points.size()), 1.0 / D);
    std::int64_t n_cells = 1;
    for (int d = 0; d < kMaxAxes; ++d) {
      size_[d] = 1;
      inverse_[d] = 0;
      if (d >= D || !(high[d] > low_[d])) continue;
      const double fitting = (high[d] - low_[d]) / (2 * per_axis);
      const double edge = cell > fitting ? cell : fitting;  // also if `cell` is NaN
      if (!std::isfinite(edge) || !std::isfinite(1 / edge)) continue;
      inverse_[d] = 1 / edge;
      size_[d] = static_cast<std::int64_t>((high[d] - low_[d]) * inverse_[d]) + 1;
      n_cells *= size_[d];
    }
    starts_.assign(n_cells + 1, 0);
    cell_of_.resize(points.size());
    for (std::size_t i = 0; i < points.size(); ++i) {
      cell_of_[i] = cell_index(points[i]);
      ++starts_[cell_of_[i] + 1];
    }
    for (std::int64_t c = 0; c < n_cells; ++c) starts_[c + 1] += starts_[c];
    fill_.assign(starts_.begin(), starts_.end() - 1);
    order_.resize(points.size());
    sorted_.resize(points.size());
    for (std::size_t i = 0; i < points.size(); ++i) {
      const std::int32_t slot = fill_[cell_of_[i]]++;
      order_[slot] = static_cast<std::int32_t>(i);
      sorted_[slot] = points[i];
    }
  }

  // The largest measurement variance of a point in addition to that of the sensor.
  double max_r() const { return max_r_; }

  // Calls visit(index, squared distance) once for every point within `radius` of `center`. The
  // order depends on the points alone.
  template <typename Visit>
  void within(const Point& center, double radius, Visit&& visit) const {
    const double radius2 = radius * radius;
    if (!is_grid_) {
      for (std::size_t i = 0; i < points_.size(); ++i) {
        const double d2 = squared_distance(points_[i], center);
        if (d2 <= radius2) visit(static_cast<std::int32_t>(i), d2);
      }
      return;
    }
    std::array<std::int64_t, kMaxAxes> from{}, to{};
    for (int d = 0; d < D_; ++d) {
      from[d] = axis_cell(center[d] - radius, d);
      to[d] = axis_cell(center[d] + radius, d);
    }
    for (std::int64_t a = from[0]; a <= to[0]; ++a)
      for (std::int64_t b = from[1]; b <= to[1]; ++b) {
        // Cells along the last axis are contiguous in memory.
        const std::int64_t row = (a * size_[1] + b) * size_[2];
        for (std::int32_t k = starts_[row + from[2]]; k < starts_[row + to[2] + 1]; ++k) {
          const double d2 = squared_distance(sorted_[k], center);
          if (d2 <= radius2) visit(order_[k], d2);
        }
      }
  }

 private:
  std::int64_t axis_cell(double x, int d) const {
    const double c = (x - low_[d]) * inverse_[d];
    if (!(c > 0)) return 0;  // also if c is NaN
    return static_cast<std::int64_t>(std::min(c, static_cast<double>(size_[d] - 1)));
  }
  std::int64_t cell_index(const Point& p) const {
    std::int64_t c = 0;
    for (int d = 0; d < kMaxAxes; ++d) c = c * size_[d] + (d < D_ ? axis_cell(p[d], d) : 0);
    return c;
  }

  std::span<const Point> points_;
  int D_ = 0;
  double max_r_ = 0;
  bool is_grid_ = false;
  Point low_{}, inverse_{};
  std::array<std::int64_t, kMaxAxes> size_{1, 1, 1};
  std::vector<std::int32_t> starts_, fill_, order_;
  std::vector<Point> sorted_;  // by cell, as `order_`
  std::vector<std::int64_t> cell_of_;
};

}  // namespace asterism
