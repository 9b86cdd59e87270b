// An order of points in which neighbours are near in memory. In a large scene most of the time of a
// search among points in random order is spent on waiting for memory.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <span>
#include <utility>
#include <vector>

#include "math/point.hpp"

namespace asterism {

// The edge of a cell that has eight points in the mean.
inline double cell_of(std::span<const Point> points, int D) {
  double volume = 8 / static_cast<double>(std::max<std::size_t>(points.size(), 1));
  for (int d = 0; d < D; ++d) {
    double low = std::numeric_limits<double>::infinity(), high = -low;
    for (const Point& p : points) {
      low = std::min(low, p[d]);
      high = std::max(high, p[d]);
    }
    volume *= std::max(high - low, 1e-9);
  }
  return std::pow(volume, 1.0 / D);
}

// Indices of the points, cell by cell.
inline std::vector<std::int32_t> spatial_order(std::span<const Point> points, int D, double cell) {
  std::vector<std::array<std::int64_t, kMaxAxes>> cells(points.size());
  std::vector<std::int32_t> order(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    order[i] = static_cast<std::int32_t>(i);
    cells[i] = {};
    for (int d = 0; d < D; ++d)
      cells[i][d] = static_cast<std::int64_t>(std::clamp(std::floor(points[i][d] / cell), -1e9, 1e9));
  }
  std::sort(order.begin(), order.end(), [&](std::int32_t a, std::int32_t b) {
    return cells[a] != cells[b] ? cells[a] < cells[b] : a < b;
  });
  return order;
}

// Sorts the points of a frame cell by cell, and returns the number that each had.
inline std::vector<std::int32_t> sort_in_space(std::vector<Point>& points, int D, double cell) {
  std::vector<std::int32_t> order = spatial_order(points, D, cell);
  std::vector<Point> sorted;
  sorted.reserve(points.size());
  for (const std::int32_t i : order) sorted.push_back(points[i]);
  points = std::move(sorted);
  return order;
}

}  // namespace asterism
