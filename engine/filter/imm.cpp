// Mixing, prediction and update of the interacting-multiple-model filter. They are compiled once.
#include "filter/imm.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace asterism {

std::array<double, kMaxModes> stationary(std::array<double, kMaxModes * kMaxModes> T,
                                         int M) {
  std::array<double, kMaxModes> w{};
  for (int i = 0; i < 40; ++i) {
    std::array<double, kMaxModes * kMaxModes> next{};
    for (int a = 0; a < M; ++a)
      for (int c = 0; c < M; ++c)
        for (int b = 0; b < M; ++b) next[a * M + b] += T[a * M + c] * T[c * M + b];
    for (int a = 0; a < M; ++a) {
      double sum = 0;
      for (int b = 0; b < M; ++b) sum += next[a * M + b];
      for (int b = 0; b < M; ++b) T[a * M + b] = next[a * M + b] / sum;
    }
  }
  for (int a = 0; a < M; ++a)
    for (int b = 0; b < M; ++b) w[b] += T[a * M + b] / M;
  return w;
}

MotionState begin_state(const MotionModel& m, const Point& y) {
  MotionState s;
  std::fill_n(s.mode.begin(), m.M, begin_state(m.axis, y));
  s.w = m.w0;
  return s;
}

namespace {

// Deviations of the modes of a state from mode 0, from which the spread of a mixture follows.
//
//   e_a  mean of mode a minus that of mode 0       E_a  e_a e_aᵀ, averaged over the axes
//
// The axes share one covariance, so the spread of the means is averaged over the axes.

// Mean over the axes of e eᵀ.
template <int n>
AxisMatrix mean_square(const std::array<AxisVector, kMaxAxes>& e, int D) {
  AxisMatrix E{};
  for (int i = 0; i < n; ++i)
    for (int j = i; j < n; ++j) {
      double sum = 0;
      for (int d = 0; d < kMaxAxes; ++d) sum += e[d][i] * e[d][j];
      E[i * n + j] = E[j * n + i] = sum / D;
    }
  return E;
}

struct ModeSpread {
  std::array<std::array<AxisVector, kMaxAxes>, kMaxModes> e{};
  std::array<AxisMatrix, kMaxModes> E{};

  ModeSpread(const MotionModel& m, const MotionState& s) {
    with_states(m.axis.n, [&](auto n_states) {
      constexpr int n = n_states;
      for (int a = 1; a < m.M; ++a) {
        for (int d = 0; d < kMaxAxes; ++d)
          for (int i = 0; i < n; ++i) e[a][d][i] = s.mode[a].x[d][i] - s.mode[0].x[d][i];
        E[a] = mean_square<n>(e[a], m.axis.D);
      }
    });
  }
};

// Mean and covariance of a mixture of the modes of a state, with weights that sum to 1.
AxisState mix(const MotionModel& m, const MotionState& s, const ModeSpread& spread,
              const std::array<double, kMaxModes>& weights) {
  return with_states(m.axis.n, [&](auto n_states) {
    constexpr int n = n_states;
    AxisState mixed = s.mode[0];
    std::array<AxisVector, kMaxAxes> shift{};
    for (int k = 0; k < n * n; ++k) mixed.P[k] *= weights[0];
    for (int a = 1; a < m.M; ++a) {
      for (int d = 0; d < kMaxAxes; ++d)
        for (int i = 0; i < n; ++i) shift[d][i] += weights[a] * spread.e[a][d][i];
      for (int k = 0; k < n * n; ++k)
        mixed.P[k] += weights[a] * (s.mode[a].P[k] + spread.E[a][k]);
    }
    for (int d = 0; d < kMaxAxes; ++d)
      for (int i = 0; i < n; ++i) mixed.x[d][i] += shift[d][i];
    const AxisMatrix moved = mean_square<n>(shift, m.axis.D);
    for (int k = 0; k < n * n; ++k) mixed.P[k] -= moved[k];
    return mixed;
  });
}

}  // namespace

AxisState collapse(const MotionModel& m, const MotionState& s) {
  return m.M == 1 ? s.mode[0] : mix(m, s, ModeSpread(m, s), s.w);
}

void predict(const MotionModel& m, const MotionStep& step, MotionState& s) {
  if (m.M > 1) {
    const MotionState before = s;
    const ModeSpread spread(m, before);
    for (int b = 0; b < m.M; ++b) {
      std::array<double, kMaxModes> share{};
      double total = 0;
      for (int a = 0; a < m.M; ++a) total += share[a] = before.w[a] * m.T[a * m.M + b];
      for (int a = 0; a < m.M; ++a) share[a] /= total;
      s.w[b] = total;
      s.mode[b] = mix(m, before, spread, share);
    }
  }
  for (int b = 0; b < m.M; ++b) predict(m.axis, step.mode[b], s.mode[b]);
}

Prediction::Prediction(const MotionModel& m, const MotionState& s) : M(m.M), D(m.axis.D) {
  for (int b = 0; b < M; ++b) {
    if (M > 1) w[b] = s.w[b];
    y[b] = observed(m.axis, s.mode[b]);
    S[b] = innovation_variance(m.axis, s.mode[b]);
    log_peak[b] = log_density(D, S[b], 0) + (M > 1 ? std::log(w[b]) : 0.0);
    if (std::isfinite(log_peak[b])) continue;
    // The filter has over- or underflowed. The density of this mode is set to zero everywhere.
    log_peak[b] = -std::numeric_limits<double>::infinity();
    S[b] = 1;
    y[b] = {};
  }
  for (int b = 0; b < M; ++b)
    for (int d = 0; d < D; ++d) center[d] += w[b] * y[b][d];
}

double Prediction::log_likelihood(const Point& point, std::array<double, kMaxModes>& each) const {
  double best = -std::numeric_limits<double>::infinity();
  for (int b = 0; b < M; ++b) {
    const double d2 = squared_distance(point, y[b], D);
    each[b] = log_peak[b] - 0.5 * d2 / S[b];
    if (point.r > 0)
      each[b] = log_peak[b] - 0.5 * (D * std::log1p(point.r / S[b]) + d2 / (S[b] + point.r));
    best = std::max(best, each[b]);
  }
  if (M == 1 || std::isinf(best)) return best;
  double sum = 0;
  for (int b = 0; b < M; ++b) sum += std::exp(each[b] - best);
  return best + std::log(sum);
}

double Prediction::radius(double gate, double min_log_likelihood, double max_r) const {
  // The mode that gates a point and the mode that makes it likely may differ.
  double gated = -1, likely = -1;
  for (int b = 0; b < M; ++b) {
    const double offset = std::sqrt(squared_distance(y[b], center, D));
    const auto reach = [&](double x2) { return offset + std::sqrt(x2 * (S[b] + max_r)); };
    gated = std::max(gated, reach(gate));
    // The largest of M summands is at least their sum divided by M.
    const double chi2 = 2 * (log_peak[b] + std::log(static_cast<double>(M)) - min_log_likelihood);
    if (chi2 > 0) likely = std::max(likely, reach(chi2));
  }
  return std::min(gated, likely);
}

double update(const MotionModel& m, const Prediction& p, const Point& y, MotionState& s) {
  std::array<double, kMaxModes> each{};
  const double total = p.log_likelihood(y, each);
  for (int b = 0; b < m.M; ++b) {
    update(m.axis, y, s.mode[b]);
    const double w = std::exp(each[b] - total);
    if (m.M > 1) s.w[b] = w > 1e-300 ? w : 1e-300;
  }
  return total;
}

}  // namespace asterism
