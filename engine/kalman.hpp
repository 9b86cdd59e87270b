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

namespace asterism {

inline constexpr int kMaxStates = 3;  // per axis: position, velocity, acceleration
inline constexpr int kMaxAxes = 3;

// A place, and what the variance of its coordinates is beyond the sensor's.
struct Point : std::array<double, kMaxAxes> {
  double r = 0;
};
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

inline double squared_distance(const Point& a, const Point& b, int D) {
  double sum = 0;
  for (int d = 0; d < D; ++d) sum += (a[d] - b[d]) * (a[d] - b[d]);
  return sum;
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

inline void predict(const AxisModel& m, const AxisStep& step, AxisState& s) {
  predict_mean(m, step, s, s);
  with_states(m.n, [&](auto n_states) {
    constexpr int n = n_states;
    AxisMatrix FP{}, P = step.Q;
    for (int i = 0; i < n; ++i)
      for (int k = 0; k < n; ++k) {
        const double f = step.F[i * n + k];
        for (int j = 0; j < n; ++j) FP[i * n + j] += f * s.P[k * n + j];
      }
    for (int i = 0; i < n; ++i)
      for (int j = 0; j < n; ++j)
        for (int k = 0; k < n; ++k) P[i * n + j] += FP[i * n + k] * step.F[j * n + k];
    s.P = P;
  });
}

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
  KalmanGain(const AxisModel& m, const AxisState& s) {
    with_states(m.n, [&](auto n_states) {
      constexpr int n = n_states;
      S = innovation_variance(m, s);
      assert(S > 0);
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
          P[i * n + j] = P[j * n + i] = sum;
        }
    });
  }
};

inline void update(const AxisModel& m, const Point& y, AxisState& s) {
  const KalmanGain gain(m, s);
  const Point predicted = observed(m, s);
  const double share = gain.share(y);
  for (int d = 0; d < m.D; ++d)
    for (int i = 0; i < m.n; ++i) s.x[d][i] += share * gain.K[i] * (y[d] - predicted[d]);
  s.P = gain.covariance(m.n, share);
}

// Rauch–Tung–Striebel: carry what the future knows (next, smoothed) back to a filtered state.
// `predicted` is what `filtered` led to: mean F x, covariance F P Fᵀ + Q. Solves P' Cᵀ = F P by
// Cholesky with a floor, so that a singular Q does no harm.
inline AxisState smooth_back(const AxisModel& m, const AxisMatrix& F, const AxisState& filtered,
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
