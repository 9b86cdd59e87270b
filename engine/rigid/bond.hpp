// The distance between two markers: its estimate, its predictive variance, and the criterion of a
// bond.
//
//   V = max(s², 2 r) + (m (kBend + 1/n))²
//
//   m, s²  mean and variance over the n frames in which both markers were detected
//   r      variance of a measured coordinate
//
// V is the variance of the next measured distance. The first term is the observed variance, but at
// least the measurement noise of both markers. The second term allows for deformation that has not
// been observed yet. V is used to rank neighbours, to weight rigid fits and to set every threshold
// on a distance.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>

namespace asterism {

inline constexpr std::int64_t kMemory = 400;    // effective number of frames in a mean
inline constexpr double kBend = 0.01;  // expected deformation as a fraction of the distance
inline constexpr std::int64_t kMinTogether = 20;  // frames until a distance may be a bond
inline constexpr double kSteady = 0.1;          // largest √V of a bond as a fraction of its length
inline constexpr std::size_t kSteadiest = 6;    // number of bonds used for a marker

// 1/n for the first kMemory numbers, because a division for each bond and frame takes long.
inline constexpr auto kShares = [] {
  std::array<double, kMemory + 1> shares{};
  for (std::size_t n = 1; n < shares.size(); ++n) shares[n] = 1 / static_cast<double>(n);
  return shares;
}();

inline double inverse(std::int64_t n) {
  return n <= kMemory ? kShares[static_cast<std::size_t>(n)] : 1 / static_cast<double>(n);
}

struct Bond {
  std::int32_t other = 0;
  std::int64_t n = 0;
  double mean = 0, variance = 0;

  void add(double distance) {
    const double share = kShares[static_cast<std::size_t>(std::min(++n, kMemory))];
    const double off = distance - mean;
    mean += share * off;
    variance += share * (off * (distance - mean) - variance);
  }
};

inline double predictive_variance(const Bond& bond, double r) {
  const double unobserved = bond.mean * (kBend + inverse(std::max<std::int64_t>(bond.n, 1)));
  return std::max(bond.variance, 2 * r) + unobserved * unobserved;
}

inline bool is_bond(const Bond& bond, double r) {
  const double max_deviation = kSteady * bond.mean;
  return bond.n >= kMinTogether && predictive_variance(bond, r) <= max_deviation * max_deviation;
}

}  // namespace asterism
