// The longer steps of the Kalman filter, compiled once.
#include "filter/kalman.hpp"

#include <algorithm>

#include "filter/axis_kernels.hpp"

namespace asterism {

void predict(const AxisModel& m, const AxisStep& step, AxisState& s) {
  with_states(m.n, [&](auto n) { predict_axis<n>(step, AxisRows<n>::of(s), s); });
}

KalmanGain::KalmanGain(const AxisModel& m, const AxisState& s) {
  with_states(m.n, [&](auto n) { gain_axis<n>(m, s, *this); });
}

void update(const AxisModel& m, const Point& y, AxisState& s) {
  with_states(m.n, [&](auto n) { update_axis_with<n>(m, y, s); });
}

AxisState smooth_back(const AxisModel& m, const AxisMatrix& F, const AxisState& filtered,
                      const AxisState& predicted, const AxisState& next) {
  const int n = m.n;
  AxisMatrix L{}, C{};
  for (int i = 0; i < n; ++i)
    for (int j = 0; j <= i; ++j) {
      double sum = predicted.P[i * n + j];
      for (int k = 0; k < j; ++k) sum -= L[i * n + k] * L[j * n + k];
      if (i == j) {
        const double floor = 1e-14 * predicted.P[i * n + i];
        L[i * n + i] = std::sqrt(std::max(sum, floor));
      } else {
        L[i * n + j] = L[j * n + j] > 0 ? sum / L[j * n + j] : 0;
      }
    }
  AxisMatrix FP{};
  for (int i = 0; i < n; ++i)
    for (int k = 0; k < n; ++k)
      for (int j = 0; j < n; ++j) FP[i * n + j] += F[i * n + k] * filtered.P[k * n + j];
  for (int c = 0; c < n; ++c) {  // column c of F P gives row c of C
    AxisVector z{};
    for (int i = 0; i < n; ++i) {
      double sum = FP[i * n + c];
      for (int k = 0; k < i; ++k) sum -= L[i * n + k] * z[k];
      z[i] = L[i * n + i] > 0 ? sum / L[i * n + i] : 0;
    }
    for (int i = n - 1; i >= 0; --i) {
      double sum = z[i];
      for (int k = i + 1; k < n; ++k) sum -= L[k * n + i] * C[c * n + k];
      C[c * n + i] = L[i * n + i] > 0 ? sum / L[i * n + i] : 0;
    }
  }
  AxisState s = filtered;
  for (int d = 0; d < m.D; ++d)
    for (int i = 0; i < n; ++i)
      for (int j = 0; j < n; ++j) s.x[d][i] += C[i * n + j] * (next.x[d][j] - predicted.x[d][j]);
  AxisMatrix CD{};
  for (int i = 0; i < n; ++i)
    for (int k = 0; k < n; ++k)
      for (int j = 0; j < n; ++j)
        CD[i * n + j] += C[i * n + k] * (next.P[k * n + j] - predicted.P[k * n + j]);
  for (int i = 0; i < n; ++i)
    for (int j = i; j < n; ++j) {
      double sum = filtered.P[i * n + j];
      for (int k = 0; k < n; ++k) sum += CD[i * n + k] * C[j * n + k];
      s.P[i * n + j] = s.P[j * n + i] = sum;
    }
  return s;
}

}  // namespace asterism
