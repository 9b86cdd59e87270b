// Prediction and update of all modes of a track at once, with a mode in each lane. Every number is
// computed as it would be for a mode alone. The legend of filter/kalman.hpp and filter/imm.hpp
// holds here.
#pragma once

#include <array>

#include "filter/imm.hpp"
#include "math/lanes.hpp"

namespace asterism {

static_assert(kMaxModes <= kLanes);

// The numbers of(b) of the modes b.
template <int M, typename Of>
ASTERISM_INLINED Lanes lanes_by_mode(Of&& of) {
  Lanes out;
  for (int b = 0; b < M; ++b) out.at[b] = of(b);
  return out;
}

template <int n, int M>
struct ModeLanes {
  std::array<std::array<Lanes, n>, kMaxAxes> x;
  std::array<std::array<Lanes, n>, n> P;

  ASTERISM_INLINED void read(const MotionState& s) {
    for (int d = 0; d < kMaxAxes; ++d)
      for (int i = 0; i < n; ++i)
        x[d][i] = lanes_by_mode<M>([&](int b) { return s.mode[b].x[d][i]; });
    for (int i = 0; i < n; ++i)
      for (int j = 0; j < n; ++j)
        P[i][j] = lanes_by_mode<M>([&](int b) { return s.mode[b].P[i * n + j]; });
  }
  ASTERISM_INLINED void write(MotionState& s) const {
    for (int b = 0; b < M; ++b) {
      for (int d = 0; d < kMaxAxes; ++d)
        for (int i = 0; i < n; ++i) s.mode[b].x[d][i] = x[d][i].at[b];
      for (int i = 0; i < n; ++i)
        for (int j = 0; j < n; ++j) s.mode[b].P[i * n + j] = P[i][j].at[b];
    }
  }
  ASTERISM_INLINED void predict(const MotionStep& step) {
    std::array<std::array<Lanes, n>, n> F, FP;
    for (int i = 0; i < n; ++i)
      for (int j = 0; j < n; ++j)
        F[i][j] = lanes_by_mode<M>([&](int b) { return step.mode[b].F[i * n + j]; });
    for (int i = 0; i < n; ++i)
      for (int j = 0; j < n; ++j) {
        FP[i][j] = F[i][0] * P[0][j];
        for (int k = 1; k < n; ++k) FP[i][j] = FP[i][j] + F[i][k] * P[k][j];
      }
    for (int i = 0; i < n; ++i)
      for (int j = 0; j < n; ++j) {
        P[i][j] = lanes_by_mode<M>([&](int b) { return step.mode[b].Q[i * n + j]; });
        for (int k = 0; k < n; ++k) P[i][j] = P[i][j] + FP[i][k] * F[j][k];
      }
    for (int d = 0; d < kMaxAxes; ++d) {
      const std::array<Lanes, n> before = x[d];
      for (int i = 0; i < n; ++i) {
        x[d][i] = before[0] * F[i][0];
        for (int j = 1; j < n; ++j) x[d][i] = x[d][i] + before[j] * F[i][j];
      }
    }
  }
  ASTERISM_INLINED void update(const AxisModel& m, const Point& y) {
    std::array<Lanes, n> K;
    Lanes S = m.r;
    for (int i = 0; i < n; ++i)
      for (int j = 0; j < n; ++j) S = S + m.H[i] * P[i][j] * m.H[j];
    for (int i = 0; i < n; ++i) {
      for (int j = 0; j < n; ++j) K[i] = K[i] + P[i][j] * m.H[j];
      K[i] = K[i] / S;
    }
    std::array<std::array<Lanes, n>, n> A, AP;
    for (int i = 0; i < n; ++i)
      for (int j = 0; j < n; ++j) A[i][j] = Lanes(i == j ? 1.0 : 0.0) - K[i] * m.H[j];
    for (int i = 0; i < n; ++i)
      for (int k = 0; k < n; ++k)
        for (int j = 0; j < n; ++j) AP[i][j] = AP[i][j] + A[i][k] * P[k][j];
    for (int i = 0; i < n; ++i)
      for (int j = i; j < n; ++j) {
        Lanes sum = K[i] * m.r * K[j];
        for (int k = 0; k < n; ++k) sum = sum + AP[i][k] * A[j][k];
        P[i][j] = P[j][i] = sum;
      }
    const Lanes share = y.r == 0 ? Lanes(1.0) : S / (S + y.r);
    for (int d = 0; d < kMaxAxes; ++d) {
      Lanes predicted;
      for (int i = 0; i < n; ++i) predicted = predicted + m.H[i] * x[d][i];
      for (int i = 0; i < n; ++i) x[d][i] = x[d][i] + share * K[i] * (Lanes(y[d]) - predicted);
    }
    if (y.r == 0) return;
    for (int i = 0; i < n; ++i)
      for (int j = 0; j < n; ++j) P[i][j] = P[i][j] + K[i] * K[j] * S * (Lanes(1.0) - share);
  }
};

}  // namespace asterism
