// Median and spread of the distances between all tracks over some frames.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

namespace asterism {

struct DistanceTables {
  std::span<double> middle, spread;  // (K, K), metres, NaN without a common frame
  std::span<std::int64_t> n_frames;  // (K, K)
};

// positions: (F, K, D), NaN without a detection. The spread is half the width of the central 68 %.
inline void measure_distances(std::span<const double> positions, std::int32_t F, std::int32_t K,
                              std::int32_t D, const DistanceTables& out) {
  std::vector<double> found;
  for (std::int32_t i = 0; i < K; ++i)
    for (std::int32_t j = i; j < K; ++j) {
      found.clear();
      for (std::int32_t f = 0; f < F; ++f) {
        const double* row = positions.data() + static_cast<std::size_t>(f) * K * D;
        double squared = 0;
        for (std::int32_t x = 0; x < D; ++x) {
          const double off = row[i * D + x] - row[j * D + x];
          squared += off * off;
        }
        if (!std::isnan(squared)) found.push_back(std::sqrt(squared));
      }
      const auto n = static_cast<double>(found.size());
      double low = NAN, middle = NAN, high = NAN;
      if (!found.empty()) {
        const auto begin = found.begin();
        const auto last = static_cast<std::ptrdiff_t>(found.size()) - 1;
        const auto at = [&](double share) {
          return begin + std::min(static_cast<std::ptrdiff_t>(share * n), last);
        };
        const auto half = at(0.5), first = at(0.16), end = at(0.84);
        std::nth_element(begin, half, found.end());
        middle = *half;
        std::nth_element(begin, first, half);
        low = *first;
        std::nth_element(half, end, found.end());
        high = *end;
      }
      for (const std::size_t at : {static_cast<std::size_t>(i) * K + j,
                                   static_cast<std::size_t>(j) * K + i}) {
        out.middle[at] = middle;
        out.spread[at] = (high - low) / 2;
        out.n_frames[at] = static_cast<std::int64_t>(found.size());
      }
    }
}

}  // namespace asterism
