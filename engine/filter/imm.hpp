// Interacting-multiple-model filter (Blom & Bar-Shalom 1988).
//
// A marker rests, walks and is thrown, and no single process noise fits all of these. Each mode has
// its own Kalman state. Before a prediction, the filter mixes the states by the transition
// probabilities. The likelihood of a detection is that of the mixture of the predictions. With one
// mode this is the plain Kalman filter, to the last bit.
//
//   w_m  probability of mode m      T_lm  probability of a transition from mode l to m in one step
#pragma once

#include <array>

#include "filter/kalman.hpp"

namespace asterism {

inline constexpr int kMaxModes = 3;

struct MotionModel {
  AxisModel axis;
  int M = 1;
  std::array<double, kMaxModes * kMaxModes> T{1.0};  // row stride M
  std::array<double, kMaxModes> w0{1.0};             // of a new track: the stationary probabilities
};

struct MotionStep {
  std::array<AxisStep, kMaxModes> mode{};
};

struct MotionState {
  std::array<AxisState, kMaxModes> mode{};
  std::array<double, kMaxModes> w{};
};

// Stationary mode probabilities, by repeated squaring of T. The rows are normalised each time,
// because squaring doubles the rounding error of their sums.
std::array<double, kMaxModes> stationary(std::array<double, kMaxModes * kMaxModes> T, int M);

// All modes start in the same state.
MotionState begin_state(const MotionModel& m, const Point& y);

// Mean and covariance of the mixture of the modes.
AxisState collapse(const MotionModel& m, const MotionState& s);

void predict(const MotionModel& m, const MotionStep& step, MotionState& s);

// The predicted distribution of the next detection: one Gaussian for each mode.
struct Prediction {
  Point center{};  // ŷ of the mixture
  std::array<Point, kMaxModes> y{};
  std::array<double, kMaxModes> w{1.0}, S{}, log_peak{};  // log_peak: log w_m N(ŷ_m; ŷ_m, S_m)
  int M = 1, D = 3;

  Prediction() = default;
  Prediction(const MotionModel& m, const MotionState& s);

  // Writes log(w_m N(y; ŷ_m, S_m)) of every mode to `each` and returns the log of their sum.
  double log_likelihood(const Point& point, std::array<double, kMaxModes>& each) const;

  // Variance of a coordinate, the mean over the axes.
  double variance() const {
    double sum = 0;
    for (int b = 0; b < M; ++b) sum += w[b] * (S[b] + squared_distance(y[b], center, D) / D);
    return sum;
  }

  // Radius of a ball about `center` that contains every point whose χ² is at most `gate` in some
  // mode and whose log likelihood can exceed `min_log_likelihood`; negative if there are none.
  // Points may have additional measurement variance up to `max_r`.
  double radius(double gate, double min_log_likelihood, double max_r) const;

  bool is_gated(const Point& point, double gate) const {
    for (int b = 0; b < M; ++b)
      if (squared_distance(point, y[b]) <= gate * (S[b] + point.r)) return true;
    return false;
  }
};

// Updates the state with a detection. `p` must be the prediction from this state. Returns log p(y |
// past).
double update(const MotionModel& m, const Prediction& p, const Point& y, MotionState& s);
// The same with the known results of p.log_likelihood(y, each).
void update(const MotionModel& m, const std::array<double, kMaxModes>& each,
            double log_likelihood, const Point& y, MotionState& s);

}  // namespace asterism
