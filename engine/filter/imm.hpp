// Several motion models at once: an interacting-multiple-model filter (Blom & Bar-Shalom 1988).
//
// A marker rests, walks and is thrown; one process noise fits none of these. Each mode keeps its
// own Kalman state; before a prediction the modes are mixed by how likely each leads to which, and
// a detection is weighed against the mixture of their predictions. With one mode this is the plain
// Kalman filter, to the last bit.
//
//   w_m  probability of mode m      T_lm  probability of going from mode l to m in a step
#pragma once

#include <array>

#include "filter/kalman.hpp"

namespace asterism {

inline constexpr int kMaxModes = 3;

struct MotionModel {
  AxisModel axis;
  int M = 1;
  std::array<double, kMaxModes * kMaxModes> T{1.0};  // row stride M
  std::array<double, kMaxModes> w0{1.0};             // of a new track: the stationary ones
};

struct MotionStep {
  std::array<AxisStep, kMaxModes> mode{};
};

struct MotionState {
  std::array<AxisState, kMaxModes> mode{};
  std::array<double, kMaxModes> w{};
};

// Stationary mode probabilities, by squaring T. Its rows are brought back to sum 1 each time, as
// squaring doubles what rounding has added.
std::array<double, kMaxModes> stationary(std::array<double, kMaxModes * kMaxModes> T, int M);

// Every mode begins alike.
MotionState begin_state(const MotionModel& m, const Point& y);

// Mean and covariance of the mixture of the modes.
AxisState collapse(const MotionModel& m, const MotionState& s);

void predict(const MotionModel& m, const MotionStep& step, MotionState& s);

// What a prediction says of the next detection: a Gaussian for each mode.
struct Prediction {
  Point center{};  // ŷ of the mixture
  std::array<Point, kMaxModes> y{};
  std::array<double, kMaxModes> w{1.0}, S{}, log_peak{};  // log_peak: log w_m N(ŷ_m; ŷ_m, S_m)
  int M = 1, D = 3;

  Prediction() = default;
  Prediction(const MotionModel& m, const MotionState& s);

  // Fills the log of w_m N(y; ŷ_m, S_m) of every mode; returns the log of their sum.
  double log_likelihood(const Point& point, std::array<double, kMaxModes>& each) const;

  // A ball about `center` that holds every point whose χ² is at most `gate` in some mode and whose
  // log likelihood may exceed `least`: its radius, negative where there is none. Points may have noise
  // of their own up to `r_most`.
  double radius(double gate, double least, double r_most) const;

  bool is_gated(const Point& point, double gate) const {
    for (int b = 0; b < M; ++b)
      if (squared_distance(point, y[b], D) <= gate * (S[b] + point.r)) return true;
    return false;
  }
};

// Takes a detection; `p` is the prediction from this very state. Returns log p(y | past).
double update(const MotionModel& m, const Prediction& p, const Point& y, MotionState& s);

}  // namespace asterism
