// The distance between two tracks, learnt from the frames with both.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <span>
#include <vector>

namespace asterism {

struct LearntDistance {
  // Medians of a distance that is not known, of one that has not been computed, and of one of which
  // only is known that it is not steady.
  static constexpr double kNone = -1, kLater = -2, kLoose = -3;
  static constexpr double kSteady = 0.1;  // spread of a steady distance at most, metres

  double median = kNone;
  double spread = 0;  // from the median deviation
  double range = 0;   // from the deviation that 80 % do not exceed

  bool is_known() const { return median >= 0; }
};

namespace learnt_distance {

inline constexpr std::size_t kLeastFrames = 6;
inline constexpr double kBendShare = 0.02;        // spread of a distance as a share of it
inline constexpr double kOfNormal = 1.4826;  // standard deviation per median deviation
inline constexpr double kMost = 0.8, kOfMost = 0.7803;  // and per deviation of that rank

inline double median_of(std::vector<double>& values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::ranges::nth_element(values, middle);
  return *middle;
}

// Whether too few of the squared distances are near their median for a steady distance. `least` is
// the part of the squared spread that does not depend on them.
inline bool is_surely_loose(std::span<const double> squares, double median, double least) {
  constexpr double kBeyondRounding = 1 + 1e-9;
  const double left = LearntDistance::kSteady * LearntDistance::kSteady - least;
  if (left <= 0) return true;
  const double far = kBeyondRounding * std::sqrt(left) / kOfNormal;
  const double low = std::max(median - far, 0.0), high = median + far;
  std::size_t n_near = 0;
  for (const double square : squares) n_near += square >= low * low && square <= high * high;
  return n_near <= squares.size() / 2;
}

}  // namespace learnt_distance

// Learns a distance from its squares, which are overwritten. `floor2` is the least squared spread,
// by the noise of both markers. With `only_steady`, a distance may be found to be loose before its
// spread is computed, which saves time, because most distances between segments are.
inline LearntDistance learn_distance(std::vector<double>& squares, double floor2, bool only_steady) {
  using namespace learnt_distance;
  if (squares.size() < kLeastFrames) return {};
  // The root of the median is the median of the roots, which most of the time are not needed.
  LearntDistance found{std::sqrt(median_of(squares))};
  const double bend = kBendShare * found.median, least = floor2 + bend * bend;
  if (only_steady && is_surely_loose(squares, found.median, least)) return {LearntDistance::kLoose};
  std::vector<double>& deviations = squares;
  for (double& value : deviations) value = std::abs(std::sqrt(value) - found.median);
  const double spread = kOfNormal * median_of(deviations);
  found.spread = std::sqrt(spread * spread + least);
  // The values beyond the median are behind it.
  const auto middle = deviations.begin() + static_cast<std::ptrdiff_t>(deviations.size() / 2);
  const auto most = deviations.begin() + static_cast<std::ptrdiff_t>(
                                             kMost * static_cast<double>(deviations.size() - 1));
  std::nth_element(middle, most, deviations.end());
  const double range = kOfMost * *most;
  found.range = std::sqrt(range * range + least);
  return found;
}

}  // namespace asterism
