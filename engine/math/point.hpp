// A measured point in the plane or in space.
#pragma once

#include <array>

namespace asterism {

inline constexpr int kMaxAxes = 3;

// Coordinates of a detection. `r` is the variance of each coordinate in addition to that of the
// sensor.
struct Point : std::array<double, kMaxAxes> {
  double r = 0;
};

inline double squared_distance(const Point& a, const Point& b, int D) {
  double sum = 0;
  for (int d = 0; d < D; ++d) sum += (a[d] - b[d]) * (a[d] - b[d]);
  return sum;
}
// The same, without a loop of unknown length: the coordinates beyond the axes are 0.
inline double squared_distance(const Point& a, const Point& b) {
  const double x = a[0] - b[0], y = a[1] - b[1], z = a[2] - b[2];
  return x * x + y * y + z * z;
}

}  // namespace asterism
