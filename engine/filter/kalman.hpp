// Kalman filter of a point whose axes share one covariance.
//
// With isotropic noise the D axes of a point are independent and have the same covariance, which
// depends only on the frames of the detections. A track therefore needs one n × n matrix and D
// means of n states.
//
// Loops over axes always run to kMaxAxes, with zeros beyond D, so that the compiler knows their
// length.
//
//   x  state of one axis (n)         F  transition over a step (n × n, row-major)
//   P  covariance of one axis        Q  process noise over a step
//   H  observation (n)               r  variance of a measured coordinate, σ²; a point may add
//                                       its own variance y.r
//   S  innovation variance = H P Hᵀ + r, the same on every axis; S + y.r for such a point
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

// Calls f with the number of states as a compile-time constant, so that its loops unroll.
template <typename F>
decltype(auto) with_states(int n, F&& f) {
  assert(n >= 1 && n <= kMaxStates);
  if (n == 2) return f(std::integral_constant<int, 2>{});
  if (n == 1) return f(std::integral_constant<int, 1>{});
  return f(std::integral_constant<int, 3>{});
}

// The state after the first detection of a track: at that point, at rest, with covariance P0.
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

// Predicts the mean alone. `out` may be `s`.
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

// The effect of a detection on a state: the mean moves by K times the innovation, and the
// covariance becomes P, which does not depend on the position of the detection. The Joseph form
// keeps P symmetric and positive definite over sequences of any length.
struct KalmanGain {
  AxisVector K{};
  AxisMatrix P{};
  double S = 0;

  // The factor of the gain for a point with its own variance: S / (S + y.r), which is 1 without.
  double share(const Point& y) const { return y.r == 0 ? 1 : S / (S + y.r); }
  // The covariance after such a point: P + K Kᵀ S (1 - share).
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

// Rauch–Tung–Striebel step: combines a filtered state with the smoothed state of the next frame.
// `predicted` is the prediction from `filtered`: mean F x, covariance F P Fᵀ + Q. The smoother gain
// solves P' Cᵀ = F P by a Cholesky factorisation with a floor on the pivots, which tolerates a
// singular Q.
AxisState smooth_back(const AxisModel& m, const AxisMatrix& F, const AxisState& filtered,
                             const AxisState& predicted, const AxisState& next);

}  // namespace asterism
