// Normalised innovation squared (NIS): the distance of a detection from its prediction as a χ²
// value.
#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>

#include "filter/imm.hpp"

namespace asterism {

// P[χ²_D > x] for D = 2 or 3.
inline double chi2_tail(int D, double x) {
  const double tail = std::exp(-x / 2);
  return D == 2 ? tail
                : std::erfc(std::sqrt(x / 2)) + std::sqrt(2 * x / std::numbers::pi) * tail;
}

// νᵀ S⁻¹ ν with one mode. For a mixture, the χ² value that has the same tail probability as the
// mixture has beyond this point.
inline double nis(const Prediction& p, const Point& y) {
  if (p.M == 1) return squared_distance(y, p.y[0], p.D) / (p.S[0] + y.r);
  double beyond = 0;
  for (int b = 0; b < p.M; ++b)
    beyond += p.w[b] * chi2_tail(p.D, squared_distance(y, p.y[b], p.D) / (p.S[b] + y.r));
  beyond = std::clamp(beyond, 1e-300, 1.0);
  if (p.D == 2) return -2 * std::log(beyond);
  // Newton's method on the log of the tail probability. It starts from above, where the function is
  // concave.
  double x = 3 - 2 * std::log(beyond) + 2 * std::log1p(-2 * std::log(beyond));
  for (int k = 0; k < 60; ++k) {
    const double tail = chi2_tail(3, x);
    const double slope = -std::sqrt(x / (2 * std::numbers::pi)) * std::exp(-x / 2);
    if (!(slope < 0) || !(tail > 0)) break;
    const double next = x - tail * (std::log(tail) - std::log(beyond)) / slope;
    const double moved = std::abs(next - x);
    x = std::max(next, x / 16);
    if (moved <= 1e-13 * x) break;
  }
  return x;
}

}  // namespace asterism
