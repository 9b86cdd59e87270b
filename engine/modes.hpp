// Several motion models at once: an interacting-multiple-model filter (Blom & Bar-Shalom 1988).
//
// A marker rests, walks and is thrown; one process noise fits none of these. Each mode keeps its
// own Kalman state; before a prediction the modes are mixed by how likely each leads to which, and
// a detection is weighed against the mixture of their predictions. With one mode this is the plain
// Kalman filter, to the last bit.
//
//   w_m  probability of mode m      T_lm  probability of going from mode l to m in a step
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "kalman.hpp"

namespace asterism {

inline constexpr int kMaxModes = 3;

struct MotionModel {
  AxisModel axis;
  int M = 1;
  std::array<double, kMaxModes * kMaxModes> T{1.0};  // row stride M
};

struct MotionStep {
  std::array<AxisStep, kMaxModes> mode{};
};

struct MotionState {
  std::array<AxisState, kMaxModes> mode{};
  std::array<double, kMaxModes> w{};
};

// Every mode begins alike; their first weights are the stationary ones, found by squaring T. Its
// rows are brought back to sum 1 each time: squaring doubles what rounding has added.
inline MotionState begin_state(const MotionModel& m, const Point& y) {
  MotionState s;
  const AxisState first = begin_state(m.axis, y);
  std::array<double, kMaxModes> w{};
  std::fill_n(w.begin(), m.M, 1.0 / m.M);
  auto T = m.T;
  for (int i = 0; i < 40 && m.M > 1; ++i) {
    std::array<double, kMaxModes * kMaxModes> next{};
    for (int a = 0; a < m.M; ++a)
      for (int c = 0; c < m.M; ++c)
        for (int b = 0; b < m.M; ++b) next[a * m.M + b] += T[a * m.M + c] * T[c * m.M + b];
    for (int a = 0; a < m.M; ++a) {
      double sum = 0;
      for (int b = 0; b < m.M; ++b) sum += next[a * m.M + b];
      for (int b = 0; b < m.M; ++b) T[a * m.M + b] = next[a * m.M + b] / sum;
    }
  }
  for (int b = 0; b < m.M; ++b) {
    s.mode[b] = first;
    for (int a = 0; a < m.M; ++a) s.w[b] += w[a] * T[a * m.M + b];
  }
  return s;
}

// Mean and covariance of a mixture of states.
inline AxisState collapse(const AxisModel& m, const AxisState* states, const double* weights,
                          int M) {
  return with_states(m.n, [&](auto n_states) {
    constexpr int n = n_states;
    AxisState s;
    for (int a = 0; a < M; ++a)
      for (int d = 0; d < m.D; ++d)
        for (int i = 0; i < n; ++i) s.x[d][i] += weights[a] * states[a].x[d][i];
    for (int a = 0; a < M; ++a)
      for (int i = 0; i < n; ++i)
        for (int j = 0; j < n; ++j) {
          // The axes share one covariance, so what their means differ by is shared out evenly.
          double spread = 0;
          for (int d = 0; d < m.D; ++d)
            spread += (states[a].x[d][i] - s.x[d][i]) * (states[a].x[d][j] - s.x[d][j]);
          s.P[i * n + j] += weights[a] * (states[a].P[i * n + j] + spread / m.D);
        }
    return s;
  });
}

inline AxisState collapse(const MotionModel& m, const MotionState& s) {
  return m.M == 1 ? s.mode[0] : collapse(m.axis, s.mode.data(), s.w.data(), m.M);
}

inline void predict(const MotionModel& m, const MotionStep& step, MotionState& s) {
  if (m.M > 1) {
    const MotionState before = s;
    for (int b = 0; b < m.M; ++b) {
      std::array<double, kMaxModes> share{};
      double total = 0;
      for (int a = 0; a < m.M; ++a) total += share[a] = before.w[a] * m.T[a * m.M + b];
      for (int a = 0; a < m.M; ++a) share[a] /= total;
      s.w[b] = total;
      s.mode[b] = collapse(m.axis, before.mode.data(), share.data(), m.M);
    }
  }
  for (int b = 0; b < m.M; ++b) predict(m.axis, step.mode[b], s.mode[b]);
}

// What a prediction says of the next detection: a Gaussian for each mode.
struct Prediction {
  std::array<Point, kMaxModes> y{};
  std::array<double, kMaxModes> S{}, log_peak{};  // log_peak: log w_m N(ŷ_m; ŷ_m, S_m)
  int M = 1, D = 3;

  Prediction() = default;
  Prediction(const MotionModel& m, const MotionState& s) : M(m.M), D(m.axis.D) {
    for (int b = 0; b < M; ++b) {
      y[b] = observed(m.axis, s.mode[b]);
      S[b] = innovation_variance(m.axis, s.mode[b]);
      log_peak[b] = log_density(D, S[b], 0) + (M > 1 ? std::log(s.w[b]) : 0.0);
    }
  }

  // Fills the log of w_m N(y; ŷ_m, S_m) of every mode; returns the log of their sum.
  double log_likelihood(const Point& point, std::array<double, kMaxModes>& each) const {
    double best = -std::numeric_limits<double>::infinity();
    for (int b = 0; b < M; ++b) {
      each[b] = log_peak[b] - 0.5 * squared_distance(point, y[b], D) / S[b];
      best = std::max(best, each[b]);
    }
    if (M == 1) return best;
    double sum = 0;
    for (int b = 0; b < M; ++b) sum += std::exp(each[b] - best);
    return best + std::log(sum);
  }

  // A ball that holds every point whose χ² is at most `gate` in some mode and whose log likelihood
  // may exceed `least`: centre and radius, negative where there is none.
  double ball(double gate, double least, Point& center) const {
    int widest = 0;
    for (int b = 1; b < M; ++b)
      if (S[b] > S[widest]) widest = b;
    center = y[widest];
    double radius = -1;
    for (int b = 0; b < M; ++b) {
      // Of M summands the largest is at least the sum over M.
      const double worth = 2 * (log_peak[b] + std::log(static_cast<double>(M)) - least);
      const double chi2 = std::min(gate, worth);
      if (chi2 <= 0) continue;
      radius = std::max(radius, std::sqrt(chi2 * S[b]) +
                                    std::sqrt(squared_distance(y[b], center, D)));
    }
    return radius;
  }

  bool is_gated(const Point& point, double gate) const {
    for (int b = 0; b < M; ++b)
      if (squared_distance(point, y[b], D) <= gate * S[b]) return true;
    return false;
  }
};

// Takes a detection; `p` is the prediction from this very state. Returns log p(y | past).
inline double update(const MotionModel& m, const Prediction& p, const Point& y, MotionState& s) {
  std::array<double, kMaxModes> each{};
  const double total = p.log_likelihood(y, each);
  for (int b = 0; b < m.M; ++b) {
    update(m.axis, y, s.mode[b]);
    if (m.M > 1) s.w[b] = std::max(std::exp(each[b] - total), 1e-300);
  }
  return total;
}

}  // namespace asterism
