// Mixing, prediction and update of the interacting-multiple-model filter. They are compiled once.
#include "filter/imm.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <type_traits>

#include "filter/axis_kernels.hpp"
#include "filter/mode_lanes.hpp"
#include "math/logarithm.hpp"

namespace asterism {

std::array<double, kMaxModes> stationary(std::array<double, kMaxModes * kMaxModes> T,
                                         int M) {
  std::array<double, kMaxModes> w{};
  for (int i = 0; i < 40; ++i) {
    std::array<double, kMaxModes * kMaxModes> next{};
    const auto before = T;
    for (int a = 0; a < M; ++a)
      for (int c = 0; c < M; ++c)
        for (int b = 0; b < M; ++b) next[a * M + b] += T[a * M + c] * T[c * M + b];
    for (int a = 0; a < M; ++a) {
      double sum = 0;
      for (int b = 0; b < M; ++b) sum += next[a * M + b];
      for (int b = 0; b < M; ++b) T[a * M + b] = next[a * M + b] / sum;
    }
    if (T == before) break;  // further squaring would change nothing
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

template <int n>
using Deviation = std::array<Row<n>, kMaxAxes>;

// Mean over the axes of e eᵀ.
template <int n>
ASTERISM_INLINED std::array<Row<n>, n> mean_square(const Deviation<n>& e, int D) {
  std::array<Row<n>, n> E;
  for (int i = 0; i < n; ++i) {
    E[i] = e[0][i] * e[0];
    for (int d = 1; d < kMaxAxes; ++d) E[i] = E[i] + e[d][i] * e[d];
    E[i] = E[i] / D;
  }
  return E;
}

template <int n, int M>
struct ModeSpread {
  Deviation<n> first;  // mean of mode 0
  std::array<Deviation<n>, M> e;
  std::array<std::array<Row<n>, n>, M> PE;  // P_a + E_a; of mode 0, P_0

  ASTERISM_INLINED ModeSpread(const MotionState& s, int D) {
    const AxisRows<n> own = AxisRows<n>::of(s.mode[0]);
    first = own.x;
    PE[0] = own.P;
    for (int a = 1; a < M; ++a) {
      const AxisRows<n> other = AxisRows<n>::of(s.mode[a]);
      for (int d = 0; d < kMaxAxes; ++d) e[a][d] = other.x[d] - first[d];
      PE[a] = mean_square<n>(e[a], D);
      for (int i = 0; i < n; ++i) PE[a][i] = other.P[i] + PE[a][i];
    }
  }

  // Mean and covariance of mixtures of the modes, one in each lane. The weights of each sum to 1.
  ASTERISM_INLINED ModeLanes<n, M> mix(const std::array<Lanes, M>& weights, int D) const {
    ModeLanes<n, M> out;
    std::array<std::array<Lanes, n>, kMaxAxes> shift;
    for (int d = 0; d < kMaxAxes; ++d)
      for (int i = 0; i < n; ++i) {
        shift[d][i] = weights[1] * e[1][d][i];
        for (int a = 2; a < M; ++a) shift[d][i] = shift[d][i] + weights[a] * e[a][d][i];
        out.x[d][i] = Lanes(first[d][i]) + shift[d][i];
      }
    for (int i = 0; i < n; ++i)
      for (int j = 0; j < n; ++j) {
        Lanes P = weights[0] * PE[0][i][j], moved = shift[0][i] * shift[0][j];
        for (int a = 1; a < M; ++a) P = P + weights[a] * PE[a][i][j];
        for (int d = 1; d < kMaxAxes; ++d) moved = moved + shift[d][i] * shift[d][j];
        out.P[i][j] = P - moved / Lanes(D);
      }
    return out;
  }
};

template <int n, int M>
ASTERISM_INLINED void predict_modes(const MotionModel& m, const MotionStep& step, MotionState& s) {
  std::array<Lanes, M> share;  // of mode a in each new mode
  Lanes total;
  for (int a = 0; a < M; ++a) {
    share[a] = s.w[a] * lanes_by_mode<M>([&](int b) { return m.T[a * M + b]; });
    total = total + share[a];
  }
  for (int a = 0; a < M; ++a) share[a] = share[a] / total;
  ModeLanes<n, M> next = ModeSpread<n, M>(s, m.axis.D).mix(share, m.axis.D);
  next.predict(step);
  next.write(s);
  for (int b = 0; b < M; ++b) s.w[b] = total.at[b];
}
template <int n, int M>
ASTERISM_INLINED void update_modes(const AxisModel& m, const Point& y, MotionState& s) {
  ModeLanes<n, M> modes;
  modes.read(s);
  modes.update(m, y);
  modes.write(s);
}
template <int n, int M>
ASTERISM_INLINED void expect_modes(const AxisModel& m, const MotionState& s, Prediction& out) {
  ModeLanes<n, M> modes;
  modes.read(s);
  Lanes S = m.r, weight = 1.0;
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j) S = S + m.H[i] * modes.P[i][j] * m.H[j];
  for (int b = 0; b < M; ++b) weight.at[b] = s.w[b];
  const Lanes log_peak =
      logarithm(weight) - 0.5 * m.D * logarithm(2 * std::numbers::pi * S);
  for (int d = 0; d < kMaxAxes; ++d) {
    Lanes y;
    for (int i = 0; i < n; ++i) y = y + m.H[i] * modes.x[d][i];
    for (int b = 0; b < M; ++b) out.y[b][d] = y.at[b];
    y = weight * y;
    out.center[d] = y.at[0];
    for (int b = 1; b < M; ++b) out.center[d] += y.at[b];
  }
  for (int b = 0; b < M; ++b) {
    out.w[b] = s.w[b];
    out.S[b] = S.at[b];
    out.log_peak[b] = log_peak.at[b];
  }
}
#if defined(__GNUC__) && defined(__x86_64__)
// The same for processors with registers of four doubles, with the same result.
template <int n, int M>
[[gnu::target("avx2")]] void predict_by_four(const MotionModel& m, const MotionStep& step,
                                             MotionState& s) {
  predict_modes<n, M>(m, step, s);
}
template <int n, int M>
[[gnu::target("avx2")]] void update_by_four(const AxisModel& m, const Point& y, MotionState& s) {
  update_modes<n, M>(m, y, s);
}
template <int n, int M>
[[gnu::target("avx2")]] void expect_by_four(const AxisModel& m, const MotionState& s, Prediction& out) {
  expect_modes<n, M>(m, s, out);
}
#endif

// Calls f with the number of states and of modes as compile-time constants.
template <typename F>
inline void with_modes(const MotionModel& m, F&& f) {
  with_states(m.axis.n, [&](auto n) {
    if (m.M == 1) return f(n, std::integral_constant<int, 1>{});
    if (m.M == 2) return f(n, std::integral_constant<int, 2>{});
    f(n, std::integral_constant<int, 3>{});
  });
}

}  // namespace

AxisState collapse(const MotionModel& m, const MotionState& s) {
  AxisState out = s.mode[0];
  with_modes(m, [&](auto n, auto M) {
    if constexpr (M > 1) {
      std::array<Lanes, M> weights;
      for (int a = 0; a < M; ++a) weights[a] = s.w[a];
      MotionState mixed;
      ModeSpread<n, M>(s, m.axis.D).mix(weights, m.axis.D).write(mixed);
      out = mixed.mode[0];
    }
  });
  return out;
}

void predict(const MotionModel& m, const MotionStep& step, MotionState& s) {
  with_modes(m, [&](auto n, auto M) {
    if constexpr (M == 1) {
      predict_axis<n>(step.mode[0], AxisRows<n>::of(s.mode[0]), s.mode[0]);
    } else {
#if defined(__GNUC__) && defined(__x86_64__)
      if (__builtin_cpu_supports("avx2")) return predict_by_four<n, M>(m, step, s);
#endif
      predict_modes<n, M>(m, step, s);
    }
  });
}

Prediction::Prediction(const MotionModel& m, const MotionState& s) : M(m.M), D(m.axis.D) {
  with_modes(m, [&](auto n, auto n_modes) {
    if constexpr (n_modes == 1) {
      y[0] = observed_axis<n>(m.axis, s.mode[0]);
      S[0] = innovation_variance_axis<n>(m.axis, s.mode[0]);
      log_peak[0] = log_density(D, S[0], 0);
    } else {
#if defined(__GNUC__) && defined(__x86_64__)
      if (__builtin_cpu_supports("avx2")) return expect_by_four<n, n_modes>(m.axis, s, *this);
#endif
      expect_modes<n, n_modes>(m.axis, s, *this);
    }
  });
  bool is_sound = true;
  constexpr double kLeast = 1e-300, kMost = 1e300;
  for (int b = 0; b < M; ++b) {
    if (S[b] > kLeast && S[b] < kMost && w[b] > 0) continue;
    // The filter has over- or underflowed. The density of this mode is set to zero everywhere.
    log_peak[b] = -std::numeric_limits<double>::infinity();
    S[b] = 1;
    y[b] = {};
    is_sound = false;
  }
  if (M == 1) {
    center = y[0];
  } else if (!is_sound) {
    center = {};
    for (int b = 0; b < M; ++b)
      for (int d = 0; d < D; ++d) center[d] += w[b] * y[b][d];
  }
}

double Prediction::log_likelihood(const Point& point, std::array<double, kMaxModes>& each) const {
  double best = -std::numeric_limits<double>::infinity();
  for (int b = 0; b < M; ++b) {
    const double d2 = squared_distance(point, y[b]);
    each[b] = log_peak[b] - 0.5 * d2 / S[b];
    if (point.r > 0)
      each[b] = log_peak[b] - 0.5 * (D * std::log1p(point.r / S[b]) + d2 / (S[b] + point.r));
    best = std::max(best, each[b]);
  }
  if (M == 1 || std::isinf(best)) return best;
  // Terms below half of the last digit of the sum, which is at least 1, do not change it. The best
  // mode contributes exactly 1.
  constexpr double kNegligible = -37.5;
  double sum = 0;
  for (int b = 0; b < M; ++b) {
    const double below = each[b] - best;
    if (below > kNegligible) sum += below == 0 ? 1.0 : std::exp(below);
  }
  return sum == 1 ? best : best + std::log(sum);
}

double Prediction::radius(double gate, double min_log_likelihood, double max_r) const {
  // The mode that gates a point and the mode that makes it likely may differ.
  double gated = -1, likely = -1;
  const double log_modes = std::log(static_cast<double>(M));
  for (int b = 0; b < M; ++b) {
    const double offset = std::sqrt(squared_distance(y[b], center));
    const auto reach = [&](double x2) { return offset + std::sqrt(x2 * (S[b] + max_r)); };
    gated = std::max(gated, reach(gate));
    // The largest of M summands is at least their sum divided by M.
    const double chi2 = 2 * (log_peak[b] + log_modes - min_log_likelihood);
    if (chi2 > 0) likely = std::max(likely, reach(chi2));
  }
  return std::min(gated, likely);
}

double update(const MotionModel& m, const Prediction& p, const Point& y, MotionState& s) {
  std::array<double, kMaxModes> each{};
  const double total = p.log_likelihood(y, each);
  update(m, each, total, y, s);
  return total;
}

void update(const MotionModel& m, const std::array<double, kMaxModes>& each,
            double log_likelihood, const Point& y, MotionState& s) {
  with_modes(m, [&](auto n, auto M) {
    if constexpr (M == 1) {
      update_axis_with<n>(m.axis, y, s.mode[0]);
    } else {
#if defined(__GNUC__) && defined(__x86_64__)
      if (__builtin_cpu_supports("avx2")) return update_by_four<n, M>(m.axis, y, s);
#endif
      update_modes<n, M>(m.axis, y, s);
    }
  });
  if (m.M == 1) return;
  for (int b = 0; b < m.M; ++b) {
    const double w = std::exp(each[b] - log_likelihood);
    s.w[b] = w > 1e-300 ? w : 1e-300;
  }
}

}  // namespace asterism
