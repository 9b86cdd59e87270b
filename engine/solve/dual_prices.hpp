// Dual prices of the best joint event of a group: the smallest prices p ≥ 0 of the detections at
// which every track prefers its detection in that event, and the remaining gain q of each track.
//
// Any other event is worse by Σ_i (q_i - chosen gain + price) + Σ p_j over the detections that it
// leaves, and no term is negative once the prices have converged.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "solve/group_numbering.hpp"

namespace asterism {

// Lists the best event by vertices: of track i its detection j as n + j, of vertex n + j its track;
// -1 if there is none. `match` has the column of each row.
inline void list_partners(std::span<const Candidate> group, const GroupNumbering& by,
                          std::span<const std::int32_t> match, std::vector<std::int32_t>& partner) {
  const std::int32_t n = by.n_rows();
  partner.assign(n + by.n_columns(), -1);
  for (std::size_t e = 0; e < group.size(); ++e)
    if (match[group[e].row] == group[e].column) {
      partner[by.row_of[e]] = n + by.column_of[e];
      partner[n + by.column_of[e]] = by.row_of[e];
    }
}

// Prices rise from 0 and converge because the event is optimal.
inline void find_prices(std::span<const Candidate> group, const GroupNumbering& by,
                 std::span<const std::int32_t> partner, std::span<double> left,
                 std::span<double> p) {
  const std::int32_t n = by.n_rows();
  std::vector<std::size_t> own(n, 0);
  for (std::size_t e = 0; e < group.size(); ++e)
    if (partner[by.row_of[e]] == n + by.column_of[e]) own[by.row_of[e]] = e;
  const auto content = [&](std::int32_t i) {
    left[i] = partner[i] < 0 ? 0 : group[own[i]].gain - p[partner[i] - n];
  };
  for (std::int32_t i = 0; i < n; ++i) content(i);
  // Rounding may let ties rise for ever, so the rounds are limited. Any prices give correct
  // results.
  bool is_rising = true;
  for (std::int32_t round = 0; round <= n && is_rising; ++round) {
    is_rising = false;
    for (std::size_t e = 0; e < group.size(); ++e) {
      const std::int32_t i = by.row_of[e], j = by.column_of[e], holder = partner[n + j];
      if (holder < 0 || holder == i || group[e].gain - left[i] <= p[j]) continue;
      p[j] = group[e].gain - left[i];
      content(holder);
      is_rising = true;
    }
  }
}

}  // namespace asterism
