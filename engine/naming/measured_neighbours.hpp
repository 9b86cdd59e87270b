// The steadiest neighbours of markers as measured on a subject, from the names found so far. What a
// marker set knows fills in where there are too few frames.
//
//   v = (n s² + n₀ W²) / (n + n₀)   measured: n frames with spread s, W the set's movement
//   v = W² + e² + B²                of the set: e error, B variation between subjects
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numeric>
#include <span>
#include <vector>

namespace asterism {

// Distances from n markers to all M: those of the set, and as measured.
struct NeighbourEvidence {
  std::span<const double> distance, movement, variation;  // (M, M), NaN where unknown
  std::span<const double> middle, spread, n_frames;       // (n, M)
};

struct MeasuredNeighbours {
  std::span<std::int64_t> neighbour;             // (n, R)
  std::span<double> distance, variance, weight;  // (n, R); an infinite variance is unused
};

inline constexpr std::int32_t kNamedBy = 14;  // neighbours of a marker by which it is named
inline constexpr double kMinMeasured = 8;     // frames from which on a distance is measured
inline constexpr double kMaxMeasured = 60;    // frames above which more of them count no more
inline constexpr double kPriorFrames = 8;     // frames that the movement in the set counts as
inline constexpr double kUnknownMovement = 0.005, kUnknownShare = 0.1;  // metres, share of distance
// Error of a distance of the set on the same and on another subject: metres, and share.
inline constexpr double kKept = 0.004, kKeptShare = 0.01;
inline constexpr double kAttached = 0.008, kAttachedShare = 0.05;
inline constexpr double kWindowNoise = 0.003;  // error of a distance in a few frames, metres
// Movement, metres, at which a distance counts half as much, and the least weight: distances of a
// loose pair vary together with those of their neighbours.
inline constexpr double kLooseMovement = 0.015, kLooseWeight = 0.2;

inline void measure_neighbours(const NeighbourEvidence& in, std::span<const std::int64_t> markers,
                               std::int32_t M, double size, bool is_kept,
                               const MeasuredNeighbours& out) {
  constexpr double kNone = std::numeric_limits<double>::infinity();
  const double fixed = is_kept ? kKept : kAttached, share = is_kept ? kKeptShare : kAttachedShare;
  const std::int32_t R = std::min(kNamedBy, M);
  std::vector<double> distance(M), variance(M), cost(M);
  std::vector<std::int32_t> order(M);
  for (std::size_t i = 0; i < markers.size(); ++i) {
    for (std::int32_t m = 0; m < M; ++m) {
      const std::size_t own = static_cast<std::size_t>(markers[i]) * M + m, at = i * M + m;
      const double before = size * in.distance[own];
      const double movement = std::isfinite(in.movement[own])
                                  ? in.movement[own]
                                  : kUnknownMovement + kUnknownShare * before;
      const double n = std::min(in.n_frames[at], kMaxMeasured), s = in.spread[at];
      if (in.n_frames[at] >= kMinMeasured && std::isfinite(in.middle[at])) {
        distance[m] = in.middle[at];
        variance[m] = (n * (s * s) + kPriorFrames * (movement * movement)) / (n + kPriorFrames);
      } else {
        const double e = fixed + share * before;
        const double B = std::isnan(in.variation[own]) ? 0 : in.variation[own];
        distance[m] = before;
        variance[m] = movement * movement + (e * e + B * B);
      }
      const bool is_used =
          m != markers[i] && std::isfinite(distance[m]) && std::isfinite(variance[m]);
      if (!is_used) distance[m] = 0, variance[m] = kNone;
      cost[m] = is_used ? std::sqrt(variance[m]) + 0.02 * distance[m] : kNone;
    }
    std::iota(order.begin(), order.end(), 0);
    std::partial_sort(order.begin(), order.begin() + R, order.end(),
                      [&](std::int32_t a, std::int32_t b) {
                        return cost[a] != cost[b] ? cost[a] < cost[b] : a < b;
                      });
    for (std::int32_t r = 0; r < R; ++r) {
      const std::size_t to = i * R + r;
      const double v = variance[order[r]];
      out.neighbour[to] = order[r];
      out.distance[to] = distance[order[r]];
      out.variance[to] = v + kWindowNoise * kWindowNoise;
      out.weight[to] =
          kLooseWeight + (1 - kLooseWeight) / (1 + v / (kLooseMovement * kLooseMovement));
    }
  }
}

}  // namespace asterism
