// The steps of the Kalman filter of one axis model with the number of states n known at compile
// time, so that every loop unrolls. The functions of filter/kalman.hpp and filter/imm.hpp, whose
// legend holds here, choose n once and call these.
#pragma once

#include <array>
#include <cassert>

#include "filter/kalman.hpp"
#include "math/row.hpp"

namespace asterism {

// Mean and covariance of an axis model, by rows.
template <int n>
struct AxisRows {
  std::array<Row<n>, kMaxAxes> x;
  std::array<Row<n>, n> P;

  static AxisRows of(const AxisState& s) {
    AxisRows out;
    for (int d = 0; d < kMaxAxes; ++d) out.x[d] = Row<n>::of(s.x[d].data());
    for (int i = 0; i < n; ++i) out.P[i] = Row<n>::of(s.P.data() + i * n);
    return out;
  }
  void write(AxisState& s) const {
    for (int d = 0; d < kMaxAxes; ++d) x[d].write(s.x[d].data());
    for (int i = 0; i < n; ++i) P[i].write(s.P.data() + i * n);
  }
};

template <int n>
inline void predict_axis(const AxisStep& step, const AxisRows<n>& s, AxisState& out) {
  std::array<Row<n>, n> F_column, FP;
  for (int j = 0; j < n; ++j) {
    std::array<double, n> column;
    for (int i = 0; i < n; ++i) column[i] = step.F[i * n + j];
    F_column[j] = Row<n>::of(column.data());
  }
  for (int i = 0; i < n; ++i) {
    FP[i] = step.F[i * n] * s.P[0];
    for (int k = 1; k < n; ++k) FP[i] = FP[i] + step.F[i * n + k] * s.P[k];
  }
  AxisRows<n> next;
  for (int i = 0; i < n; ++i) {
    next.P[i] = Row<n>::of(step.Q.data() + i * n);
    for (int k = 0; k < n; ++k) next.P[i] = next.P[i] + FP[i][k] * F_column[k];
  }
  for (int d = 0; d < kMaxAxes; ++d) {
    next.x[d] = s.x[d][0] * F_column[0];
    for (int j = 1; j < n; ++j) next.x[d] = next.x[d] + s.x[d][j] * F_column[j];
  }
  next.write(out);
}

template <int n>
inline Point observed_axis(const AxisModel& m, const AxisState& s) {
  Point y{};
  for (int d = 0; d < kMaxAxes; ++d)
    for (int i = 0; i < n; ++i) y[d] += m.H[i] * s.x[d][i];
  return y;
}

template <int n>
inline double innovation_variance_axis(const AxisModel& m, const AxisState& s) {
  double S = m.r;
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j) S += m.H[i] * s.P[i * n + j] * m.H[j];
  return S;
}

template <int n>
inline void gain_axis(const AxisModel& m, const AxisState& s, KalmanGain& out) {
  const double S = innovation_variance_axis<n>(m, s);
  assert(S > 0);
  AxisVector K{};
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) K[i] += s.P[i * n + j] * m.H[j];
    K[i] /= S;
  }
  AxisMatrix A{}, AP{};
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j) A[i * n + j] = (i == j ? 1.0 : 0.0) - K[i] * m.H[j];
  for (int i = 0; i < n; ++i)
    for (int k = 0; k < n; ++k)
      for (int j = 0; j < n; ++j) AP[i * n + j] += A[i * n + k] * s.P[k * n + j];
  for (int i = 0; i < n; ++i)
    for (int j = i; j < n; ++j) {
      double sum = K[i] * m.r * K[j];
      for (int k = 0; k < n; ++k) sum += AP[i * n + k] * A[j * n + k];
      out.P[i * n + j] = out.P[j * n + i] = sum;
    }
  out.K = K;
  out.S = S;
}

template <int n>
inline void update_axis_with(const AxisModel& m, const Point& y, AxisState& s) {
  KalmanGain gain;
  gain_axis<n>(m, s, gain);
  const Point predicted = observed_axis<n>(m, s);
  const double share = gain.share(y);
  for (int d = 0; d < kMaxAxes; ++d)
    for (int i = 0; i < n; ++i) s.x[d][i] += share * gain.K[i] * (y[d] - predicted[d]);
  for (int k = 0; k < n * n; ++k) s.P[k] = gain.P[k];
  if (share < 1)
    for (int i = 0; i < n; ++i)
      for (int j = 0; j < n; ++j) s.P[i * n + j] += gain.K[i] * gain.K[j] * gain.S * (1 - share);
}

}  // namespace asterism
