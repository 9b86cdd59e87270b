// What makes a bond of a distance between two markers: it was seen for a while, and it is kept.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>

#include "rigid/neighbours.hpp"

namespace asterism {

inline constexpr std::size_t kSteadiest = 6;  // bonds of a marker that are asked
inline constexpr std::int64_t kLeastSeen = 30;  // frames until a bond is one
// A distance that is known no better than by this share of itself is none that is kept.
inline constexpr double kLoose = 0.3;

// s of a bond: three times what its distance varied by, and what bodies bend by that was not seen
// yet. Where it is ranked its unsteadiness asks whom to trust; here it is how far off is too far.
// `r`: variance of a measured coordinate.
inline double spread(const Bond& bond, double r) {
  const double unseen = bond.mean * (0.02 + 1 / static_cast<double>(bond.n));
  return std::sqrt(9 * (bond.variance + r) + unseen * unseen);
}

inline bool is_steady(const Bond& bond, double r) {
  return bond.n >= kLeastSeen && spread(bond, r) <= kLoose * bond.mean;
}

}  // namespace asterism
