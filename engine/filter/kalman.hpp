// One Kalman filter for a point whose axes share their covariance.
//
// Loops over axes run over all that there may be, where those beyond D are zeros: the compiler then
// knows how many there are.
//
// With isotropic noise the D axes of a point do not mix and have the same covariance, which depends
// on the pattern of detections alone. So a track needs one n × n matrix and D means of n states.
//
//   x  state of one axis (n)         F  transition over a step (n × n, row-major)
//   P  covariance of one axis        Q  process noise over a step
//   H  observation (n)               r  variance of a measured coordinate, σ²; a point may bring
//                                       more of its own, y.r
//   S  innovation variance = H P Hᵀ + r, the same on every axis; S + y.r of a point
#pragma once

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <numbers>
#include <type_traits>

#include "math/point.hpp"

namespace asterism {

inline constexpr int kMaxStates = 3;  // per axis: position, velocity, acceleration
using AxisMatrix = std::array<double, kMaxStates * kMaxStates>;  // row stride is n, not kMaxStates
using AxisVector = std::array<double, kMaxStates>;

struct AxisModel {
  int n = 0;  // states per axis
  int D = 0;  // axes
  AxisVector H{};
  AxisMatrix P0{};  // covariance right after the first detection
  double r = 0;
};

struct AxisStep {
  AxisMatrix F{}, Q{};
};

struct AxisState {
  std::array<AxisVector, kMaxAxes> x{};
  AxisMatrix P{};
};

// Calls f with the number of states as a constant, so that its loops unroll.
template <typename F>
decltype(auto) with_states(int n, F&& f) {
  assert(n >= 1 && n <= kMaxStates);
  if (n == 2) return f(std::integral_constant<int, 2>{});
  if (n == 1) return f(std::integral_constant<int, 1>{});
  return f(std::integral_constant<int, 3>{});
}

// The state after a track's first detection: at the point, at rest, as uncertain as P0 says.
inline AxisState begin_state(const AxisModel& m, const Point& y) {
  AxisState s;
  double hh = 0;
  for (int i = 0; i < m.n; ++i) hh += m.H[i] * m.H[i];
  for (int d = 0; d < m.D; ++d)
    for (int i = 0; i < m.n; ++i) s.x[d][i] = m.H[i] / hh * y[d];
  s.P = m.P0;
  for (int i = 0; i < m.n; ++i)
    for (int j = 0; j < m.n; ++j) s.P[i * m.n + j] += m.H[i] * m.H[j] / (hh * hh) * y.r;
  return s;
}

// The mean alone; `out` may be `s`.
inline void predict_mean(const AxisModel& m, const AxisStep& step, const AxisState& s,
                         AxisState& out) {
  with_states(m.n, [&](auto n_states) {
    constexpr int n = n_states;
    for (int d = 0; d < kMaxAxes; ++d) {
      AxisVector x{};
      for (int i = 0; i < n; ++i)
        for (int j = 0; j < n; ++j) x[i] += step.F[i * n + j] * s.x[d][j];
      out.x[d] = x;
    }
  });
}

void predict(const AxisModel& m, const AxisStep& step, AxisState& s);

inline Point observed(const AxisModel& m, const AxisState& s) {
  return with_states(m.n, [&](auto n_states) {
    constexpr int n = n_states;
    Point y{};
    for (int d = 0; d < kMaxAxes; ++d)
      for (int i = 0; i < n; ++i) y[d] += m.H[i] * s.x[d][i];
    return y;
  });
}

inline double innovation_variance(const AxisModel& m, const AxisState& s) {
  return with_states(m.n, [&](auto n_states) {
    constexpr int n = n_states;
    double S = m.r;
    for (int i = 0; i < n; ++i)
      for (int j = 0; j < n; ++j) S += m.H[i] * s.P[i * n + j] * m.H[j];
    return S;
  });
}

// log N(y; ŷ, S I) from the squared distance of y and ŷ.
inline double log_density(int D, double S, double distance2) {
  return -0.5 * (D * std::log(2 * std::numbers::pi * S) + distance2 / S);
}

// What a detection does to a state: the mean moves by K times the innovation, the covariance becomes
// P wherever the detection is. Joseph form: P stays symmetric and positive over runs of any length.
struct KalmanGain {
  AxisVector K{};
  AxisMatrix P{};
  double S = 0;

  // What is left of K for a point with noise of its own: the whole for one without.
  double share(const Point& y) const { return y.r == 0 ? 1 : S / (S + y.r); }
  // P for such a point, P + K Kᵀ S (1 - share).
  AxisMatrix covariance(int n, double share) const {
    AxisMatrix out = P;
    if (share < 1)
      for (int i = 0; i < n; ++i)
        for (int j = 0; j < n; ++j) out[i * n + j] += K[i] * K[j] * S * (1 - share);
    return out;
  }

  KalmanGain() = default;
  KalmanGain(const AxisModel& m, const AxisState& s);
};

void update(const AxisModel& m, const Point& y, AxisState& s);

// Rauch–Tung–Striebel: carry what the future knows (next, smoothed) back to a filtered state.
// `predicted` is what `filtered` led to: mean F x, covariance F P Fᵀ + Q. Solves P' Cᵀ = F P by
// Cholesky with a floor, so that a singular Q does no harm.
AxisState smooth_back(const AxisModel& m, const AxisMatrix& F, const AxisState& filtered,
                             const AxisState& predicted, const AxisState& next);

}  // namespace asterism
