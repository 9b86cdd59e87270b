// The state of a track after each of its detections, and what the next one adds to its score.
#pragma once

#include <cmath>
#include <cstdint>

#include "detection_window.hpp"
#include "modes.hpp"

namespace asterism {

// What a track expects after a gap: where, how sharply, and the state it would have there.
template <typename State>
struct Expected {
  State state;
  Prediction prediction;
};

// `expect` may go on from what was expected after a shorter gap, `before`, of the same track.

// One motion: the steps of a gap are taken at once.
struct OneMotion {
  using State = AxisState;
  static State begin(const MotionModel& m, const Point& y) { return begin_state(m.axis, y); }

  static void expect(const MotionModel& m, const DetectionWindow& window, const State& from,
                     std::int64_t frame, int gap, Expected<State>& out, int = 0) {
    out.state = from;
    predict(m.axis, window.frame(frame + gap).single[gap - 1], out.state);
    out.prediction.M = 1;
    out.prediction.D = m.axis.D;
    out.prediction.center = out.prediction.y[0] = observed(m.axis, out.state);
    out.prediction.S[0] = innovation_variance(m.axis, out.state);
    out.prediction.log_peak[0] = log_density(m.axis.D, out.prediction.S[0], 0);
  }
  static double log_likelihood(const Prediction& p, const Point& y) {
    return p.log_peak[0] - 0.5 * squared_distance(y, p.y[0], p.D) / p.S[0];
  }
  static double take(const MotionModel& m, const Expected<State>& e, const Point& y, State& out) {
    out = e.state;
    update(m.axis, y, out);
    return log_likelihood(e.prediction, y);
  }
};

// Several interacting motions, frame by frame.
struct SeveralMotions {
  using State = MotionState;
  static State begin(const MotionModel& m, const Point& y) { return begin_state(m, y); }

  static void expect(const MotionModel& m, const DetectionWindow& window, const State& from,
                     std::int64_t frame, int gap, Expected<State>& out, int before = 0) {
    if (before == 0) out.state = from;
    for (int d = before + 1; d <= gap; ++d) predict(m, window.frame(frame + d).step, out.state);
    out.prediction = Prediction(m, out.state);
  }
  static double log_likelihood(const Prediction& p, const Point& y) {
    std::array<double, kMaxModes> each{};
    return p.log_likelihood(y, each);
  }
  static double take(const MotionModel& m, const Expected<State>& e, const Point& y, State& out) {
    out = e.state;
    return update(m, e.prediction, y, out);
  }
};

}  // namespace asterism
