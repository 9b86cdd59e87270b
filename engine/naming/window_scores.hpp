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
#include <numeric>
#include <span>
#include <vector>

#include "math/lanes.hpp"
#include "math/logarithm.hpp"

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

// Mean distances of all A tracks to those of `rows`, (A, rows), NaN without a common frame and of a
// track to itself. points: (F, A, 3), NaN without a detection.
ASTERISM_INLINED std::vector<double> mean_distances(std::span<const double> points, std::int32_t F,
                                                    std::int32_t A,
                                                    std::span<const std::int32_t> rows) {
  const std::size_t n = rows.size();
  std::vector<double> sums(A * n), counts(A * n), own(3 * n);
  for (std::int32_t f = 0; f < F; ++f) {
    const double* frame = points.data() + 3 * static_cast<std::size_t>(f) * A;
    for (std::size_t i = 0; i < n; ++i)
      for (int x = 0; x < 3; ++x) own[x * n + i] = frame[3 * rows[i] + x];
    for (std::int32_t b = 0; b < A; ++b) {
      const double *q = frame + 3 * b, *at = own.data();
      double *sum = sums.data() + b * n, *count = counts.data() + b * n;
      if (std::isnan(q[0])) continue;
      for (std::size_t i = 0; i < n; ++i) {
        const double x = at[i] - q[0], y = at[n + i] - q[1], z = at[2 * n + i] - q[2];
        const double d = std::sqrt(x * x + y * y + z * z);
        sum[i] += d == d ? d : 0.0;
        count[i] += d == d ? 1.0 : 0.0;
      }
    }
  }
  for (std::size_t i = 0; i < A * n; ++i) sums[i] /= counts[i];  // 0 / 0 is NaN
  for (std::size_t i = 0; i < n; ++i) sums[rows[i] * n + i] = NAN;
  return sums;
}

// Replaces distances by their bounded log odds against one of a marker set; NaN stays NaN.
ASTERISM_INLINED void log_odds_of_distances(std::span<double> distances, double usual,
                                            double variance) {
  const double peak = 0.375 * kExpected / std::sqrt(variance), inverse = 1 / (4 * variance);
  for (double& d : distances) {
    const double off = d - usual, y = 1 + off * off * inverse;
    const double odds = logarithm(peak / (std::sqrt(y) * y * y) + kStray);
    d = std::isnan(d) ? d : odds < kMaxScore ? odds : kMaxScore;
  }
}

ASTERISM_INLINED void compute_window_scores(
    std::span<const double> points, std::int32_t F, std::int32_t A,
    std::span<const std::int32_t> rows, std::span<const std::int32_t> holder,
    const NeighbourTables& tables, std::span<double> out) {
  const std::size_t n = rows.size();
  const std::vector<double> distances = mean_distances(points, F, A, rows);
  std::vector<std::int32_t> open(n), tried(n);  // rows that are not hopeless
  std::vector<double> sums(n), odds(n);
  for (std::int32_t m = 0; m < tables.M; ++m) {
    std::size_t n_open = n;
    std::iota(open.begin(), open.end(), 0);
    std::ranges::fill(tried, 0);
    std::ranges::fill(sums, 0.0);
    for (std::int32_t r = 0; r < tables.R && n_open > 0; ++r) {
      const std::size_t at = static_cast<std::size_t>(m) * tables.R + r;
      const std::int32_t other = holder[tables.neighbour[at]];
      if (other < 0 || !std::isfinite(tables.variance[at])) continue;
      const double* distance = distances.data() + other * n;
      for (std::size_t i = 0; i < n_open; ++i) odds[i] = distance[open[i]];
      log_odds_of_distances({odds.data(), n_open}, tables.distance[at], tables.variance[at]);
      std::size_t kept = 0;
      for (std::size_t i = 0; i < n_open; ++i) {
        const std::int32_t row = open[i];
        if (!std::isnan(odds[i])) {
          sums[row] += tables.weight[at] * odds[i];
          if (++tried[row] == kTried && sums[row] < kHopelessSum) {
            sums[row] = kNoScore;
            continue;
          }
        }
        open[kept++] = row;
      }
      n_open = kept;
    }
    for (std::size_t i = 0; i < n; ++i) out[i * tables.M + m] = sums[i];
  }
}

#if defined(__GNUC__) && defined(__x86_64__)
// The same for processors with registers of four doubles, with the same result.
[[gnu::target("avx2")]] inline void compute_window_scores_by_four(
    std::span<const double> points, std::int32_t F, std::int32_t A,
    std::span<const std::int32_t> rows, std::span<const std::int32_t> holder,
    const NeighbourTables& tables, std::span<double> out) {
  compute_window_scores(points, F, A, rows, holder, tables, out);
}
#endif

// points: (F, A, 3), NaN without a detection; rows: the tracks that are scored; holder: track of
// each marker, -1 for none. Writes (rows, M).
inline void window_scores(std::span<const double> points, std::int32_t F, std::int32_t A,
                          std::span<const std::int32_t> rows, std::span<const std::int32_t> holder,
                          const NeighbourTables& tables, std::span<double> out) {
#if defined(__GNUC__) && defined(__x86_64__)
  if (__builtin_cpu_supports("avx2"))
    return compute_window_scores_by_four(points, F, A, rows, holder, tables, out);
#endif
  compute_window_scores(points, F, A, rows, holder, tables, out);
}

}  // namespace asterism
