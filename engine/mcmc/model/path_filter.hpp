// The state of a track after each of its detections, and what the next one adds to its score.
//
// A filter has a State, what it has Expected of a later frame, and
//
//   begin       the state after a track's first detection
//   expect      what a state leads to after a gap
//   center, radius, log_likelihood   of what is expected: where, how far around it the log
//               likelihood is above some value, and the log likelihood of a point
//   take        the state after a point that was expected
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "filter/imm.hpp"
#include "mcmc/model/detection_window.hpp"

namespace asterism {

// One motion: the steps of a gap are taken at once.
//
// Covariances depend on the pattern of detections alone, and a chain tries the same patterns again and
// again. In a part they are remembered: a node is a pattern, and knows those that it leads to. Where
// points have noise of their own, nothing is.
class OneMotion {
 public:
  struct State : AxisState {
    std::int32_t node = -1;  // of what is remembered
  };
  // What does not depend on where a track is: how sharply it is expected, and what a detection does.
  struct Pattern {
    KalmanGain gain;
    double log_peak = 0;
  };
  struct Expected {
    AxisState state;
    Point center{};
    double S = 0, log_peak = 0;
    std::int32_t node = -1;
    Pattern own;  // where none is remembered
  };

  // Forgets what was remembered, and remembers from now on, for frames from this one on.
  void remember(const DetectionWindow& window) {
    is_remembered_ = true;
    first_ = window.first();
    max_gap_ = window.max_gap();
    roots_.assign(window.now() - first_ + 1, -1);
    nodes_.clear();
    next_.clear();
  }
  // A state that comes from elsewhere.
  void adopt(State& state) { state.node = is_remembered_ ? add({}) : -1; }

  State begin(const MotionModel& m, const Point& y, std::int64_t frame) {
    State state;
    static_cast<AxisState&>(state) = begin_state(m.axis, y);
    if (!is_remembered_ || y.r > 0) return state;
    std::int32_t& root = roots_[frame - first_];
    if (root < 0) root = add({});
    state.node = root;
    return state;
  }

  void expect(const MotionModel& m, const DetectionWindow& window, const State& from,
              std::int64_t frame, int gap, Expected& out, int = 0) {
    const AxisStep& step = window.frame(frame + gap).steps->single[gap - 1];
    out.node = -1;
    if (from.node >= 0) {
      const std::size_t at = static_cast<std::size_t>(from.node) * max_gap_ + (gap - 1);
      if (next_[at] < 0 && nodes_.size() < kMost) {
        const std::int32_t node = add(pattern(m, step, from));
        next_[at] = node;
      }
      out.node = next_[at];
    }
    if (out.node < 0) out.own = pattern(m, step, from);
    const Pattern& known = pattern_of(out);
    out.S = known.gain.S;
    out.log_peak = known.log_peak;
    predict_mean(m.axis, step, from, out.state);
    out.center = observed(m.axis, out.state);
  }

  static const Point& center(const Expected& e) { return e.center; }
  static double radius(const Expected& e, double log_likelihood, double r_most) {
    const double half = e.log_peak - log_likelihood;
    return half < 0 ? -1 : std::sqrt(2 * (e.S + r_most) * half);
  }
  static double log_likelihood(const MotionModel& m, const Expected& e, const Point& y) {
    const double d2 = squared_distance(y, e.center, m.axis.D);
    if (y.r > 0)
      return e.log_peak - 0.5 * (m.axis.D * std::log1p(y.r / e.S) + d2 / (e.S + y.r));
    return e.log_peak - 0.5 * d2 / e.S;
  }
  double take(const MotionModel& m, const Expected& e, const Point& y, State& out) const {
    const KalmanGain& gain = pattern_of(e).gain;
    const double share = gain.share(y);
    static_cast<AxisState&>(out) = e.state;
    for (int d = 0; d < m.axis.D; ++d)
      for (int i = 0; i < m.axis.n; ++i) out.x[d][i] += share * gain.K[i] * (y[d] - e.center[d]);
    out.P = gain.covariance(m.axis.n, share);
    out.node = y.r > 0 ? -1 : e.node;
    return log_likelihood(m, e, y);
  }

 private:
  static constexpr std::size_t kMost = 1 << 16;

  std::int32_t add(const Pattern& pattern) {
    if (nodes_.size() >= kMost) return -1;
    nodes_.push_back(pattern);
    next_.resize(next_.size() + max_gap_, -1);
    return static_cast<std::int32_t>(nodes_.size()) - 1;
  }
  const Pattern& pattern_of(const Expected& e) const {
    return e.node >= 0 ? nodes_[e.node] : e.own;
  }
  static Pattern pattern(const MotionModel& m, const AxisStep& step, const AxisState& from) {
    AxisState s = from;
    predict(m.axis, step, s);
    const KalmanGain gain(m.axis, s);
    return {gain, log_density(m.axis.D, gain.S, 0)};
  }

  bool is_remembered_ = false;
  std::int64_t first_ = 0;
  int max_gap_ = 0;
  std::vector<std::int32_t> roots_, next_;
  std::vector<Pattern> nodes_;
};

// Several interacting motions, frame by frame. What is expected after a gap may go on from what was
// expected `before`, after a shorter one.
class SeveralMotions {
 public:
  using State = MotionState;
  struct Expected {
    State state;
    Prediction prediction;
  };

  void remember(const DetectionWindow&) {}
  void adopt(State&) {}

  static State begin(const MotionModel& m, const Point& y, std::int64_t) {
    return begin_state(m, y);
  }
  static void expect(const MotionModel& m, const DetectionWindow& window, const State& from,
                     std::int64_t frame, int gap, Expected& out, int before = 0) {
    if (before == 0) out.state = from;
    for (int d = before + 1; d <= gap; ++d) predict(m, window.frame(frame + d).steps->step, out.state);
    out.prediction = Prediction(m, out.state);
  }
  static const Point& center(const Expected& e) { return e.prediction.center; }
  static double radius(const Expected& e, double log_likelihood, double r_most) {
    return e.prediction.radius(std::numeric_limits<double>::infinity(), log_likelihood, r_most);
  }
  static double log_likelihood(const MotionModel&, const Expected& e, const Point& y) {
    std::array<double, kMaxModes> each{};
    return e.prediction.log_likelihood(y, each);
  }
  static double take(const MotionModel& m, const Expected& e, const Point& y, State& out) {
    out = e.state;
    return update(m, e.prediction, y, out);
  }
};

}  // namespace asterism
