// Log odds of each marker for each track in a few frames, from the distances to the tracks that hold
// the steadiest neighbours of the marker.
//
//   score(k, m) = Σ_r w_mr log(R t₄(d_kr; D_mr, v_mr) + ε)
//
//   r        neighbour of marker m, held by another track
//   d_kr     mean distance of track k to that track in the frames
//   D, v, w  usual distance, its variance and its weight
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

namespace asterism {

struct NeighbourTables {
  std::int32_t M = 0, R = 0;
  std::span<const std::int64_t> neighbour;                // (M, R)
  std::span<const double> distance, variance, weight;     // (M, R); an infinite variance is unused
};

inline constexpr double kExpected = 1.0;    // R, range of the distances of wrong pairs, metres
inline constexpr double kStray = 0.05;      // ε: a single wrong distance costs log ε at most
inline constexpr double kMaxScore = 5.0;    // largest log odds of one distance
inline constexpr int kTried = 4;            // neighbours after which a hopeless pair is left
inline constexpr double kHopelessSum = -8;  // sum of their log odds below which it is
inline constexpr double kNoScore = -50;

// points: (F, A, 3), NaN without a detection; rows: the tracks that are scored; holder: track of
// each marker, -1 for none. Writes (rows, M).
inline void window_scores(std::span<const double> points, std::int32_t F, std::int32_t A,
                          std::span<const std::int32_t> rows, std::span<const std::int32_t> holder,
                          const NeighbourTables& tables, std::span<double> out) {
  std::vector<double> distance(A);
  for (std::size_t row = 0; row < rows.size(); ++row) {
    const std::int32_t a = rows[row];
    for (std::int32_t b = 0; b < A; ++b) {
      double sum = 0;
      int n = 0;
      for (std::int32_t f = 0; f < F; ++f) {
        const double* p = points.data() + 3 * (static_cast<std::size_t>(f) * A + a);
        const double* q = points.data() + 3 * (static_cast<std::size_t>(f) * A + b);
        const double x = p[0] - q[0], y = p[1] - q[1], z = p[2] - q[2];
        const double d = std::sqrt(x * x + y * y + z * z);
        if (std::isnan(d)) continue;
        sum += d;
        ++n;
      }
      distance[b] = n > 0 ? sum / n : NAN;
    }
    for (std::int32_t m = 0; m < tables.M; ++m) {
      double sum = 0;
      int n = 0;
      for (std::int32_t r = 0; r < tables.R; ++r) {
        const std::size_t at = static_cast<std::size_t>(m) * tables.R + r;
        const std::int32_t other = holder[tables.neighbour[at]];
        const double v = tables.variance[at];
        if (other < 0 || other == a || !std::isfinite(v)) continue;
        const double d = distance[other];
        if (std::isnan(d)) continue;
        const double off = d - tables.distance[at], y = 1 + off * off / (4 * v);
        const double density = 0.375 * kExpected / (std::sqrt(v * y) * y * y);
        sum += tables.weight[at] * std::min(std::log(density + kStray), kMaxScore);
        if (++n == kTried && sum < kHopelessSum) {
          sum = kNoScore;
          break;
        }
      }
      out[row * tables.M + m] = sum;
    }
  }
}

}  // namespace asterism
