// Sums of numbers that are given by their logarithms, without overflow.
#pragma once

#include <algorithm>
#include <cmath>

namespace asterism {

// log(1 + eˣ)
inline double softplus(double x) { return x > 30 ? x : std::log1p(std::exp(x)); }

// log(eᵃ + eᵇ)
inline double log_sum(double a, double b) {
  const double high = std::max(a, b);
  return std::isinf(high) ? high : high + std::log1p(std::exp(-std::abs(a - b)));
}

}  // namespace asterism
