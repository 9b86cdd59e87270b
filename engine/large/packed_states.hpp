// Track states as rows of numbers, so that Python holds those of a large scene as one plain array
// and can send a part of them to another process.
//
// A row has, for each mode, the D means of n states and the n × n covariance; then, with several
// modes, their probabilities. With one mode in 3-D and n = 2 it has 10 numbers.
#pragma once

#include <algorithm>
#include <cstddef>

#include "filter/imm.hpp"

namespace asterism {

inline std::size_t packed_width(const MotionModel& m) {
  const std::size_t per_mode = m.axis.n * (m.axis.D + m.axis.n);
  return m.M * per_mode + (m.M > 1 ? m.M : 0);
}

inline void pack(const MotionModel& m, const MotionState& s, double* row) {
  const int n = m.axis.n;
  for (int b = 0; b < m.M; ++b) {
    for (int d = 0; d < m.axis.D; ++d) row = std::copy_n(s.mode[b].x[d].begin(), n, row);
    row = std::copy_n(s.mode[b].P.begin(), n * n, row);
  }
  if (m.M > 1) std::copy_n(s.w.begin(), m.M, row);
}

// The values beyond n, D and M stay zero, as in begin_state.
inline MotionState unpack(const MotionModel& m, const double* row) {
  MotionState s;
  const int n = m.axis.n;
  for (int b = 0; b < m.M; ++b) {
    for (int d = 0; d < m.axis.D; ++d, row += n) std::copy_n(row, n, s.mode[b].x[d].begin());
    std::copy_n(row, n * n, s.mode[b].P.begin());
    row += n * n;
  }
  if (m.M > 1)
    std::copy_n(row, m.M, s.w.begin());
  else
    s.w[0] = 1;
  return s;
}

}  // namespace asterism
