// The distance between two markers: its estimate, its predictive variance, and whether it is a bond.
//
//   V = max(s², 2 r) + (m (kBend + 1/n))²
//
//   m, s²  mean and variance over the n frames in which both markers were seen
//   r      variance of a measured coordinate
//
// V is the variance of the distance when it is measured next. The first term is what was seen, and no
// less than the noise of both ends. The second is bending that was not seen yet. Every ranking of
// neighbours, every weight of a rigid fit and every threshold of a distance uses V.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>

namespace asterism {

inline constexpr std::int64_t kMemory = 400;    // frames that a mean remembers
inline constexpr double kBend = 0.01;           // share of a distance
inline constexpr std::int64_t kMinTogether = 20;  // frames until a distance may be a bond
inline constexpr double kSteady = 0.1;          // share of its length that √V of a bond may be
inline constexpr std::size_t kSteadiest = 6;    // bonds that carry a marker or speak for it
inline constexpr double kFar = 2;               // √V from which on a distance speaks against a bond

struct Bond {
  std::int32_t other = 0;
  std::int64_t n = 0;
  double mean = 0, variance = 0;

  void add(double distance) {
    const double share = 1 / static_cast<double>(std::min(++n, kMemory));
    const double off = distance - mean;
    mean += share * off;
    variance += share * (off * (distance - mean) - variance);
  }
};

inline double predictive_variance(const Bond& bond, double r) {
  const double unseen =
      bond.mean * (kBend + 1 / static_cast<double>(std::max<std::int64_t>(bond.n, 1)));
  return std::max(bond.variance, 2 * r) + unseen * unseen;
}

inline bool is_bond(const Bond& bond, double r) {
  const double most = kSteady * bond.mean;
  return bond.n >= kMinTogether && predictive_variance(bond, r) <= most * most;
}

// What a distance says of the bond's two markers, from 1 for a distance as it was to -1 for one that is
// far off: bounded, however wrong.
inline double agreement(const Bond& bond, double r, double distance) {
  const double off = distance - bond.mean;
  const double z2 = off * off / (kFar * kFar * predictive_variance(bond, r));
  return (1 - z2) / (1 + z2);
}

}  // namespace asterism
