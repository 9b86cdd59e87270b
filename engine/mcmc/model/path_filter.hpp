// The filters of tracks: the state after each detection, and the score of the next one.
//
// A filter has the types State and Expected (a prediction), and these functions:
//
//   begin       state after the first detection of a track
//   expect      prediction from a state after a gap
//   center, radius, log_likelihood   of a prediction: its position, the radius within which the log
//               likelihood exceeds a value, and the log likelihood of a point
//   own_prediction  the same as Gaussians
//   weigh       the log likelihood of the point with which `take` will update
//   take        state after the update with this point
//   is_close    whether two states differ by less than 10⁻⁴ standard deviations
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "filter/imm.hpp"
#include "mcmc/model/detection_window.hpp"
#include "rigid/shared_acceleration.hpp"

namespace asterism {

inline constexpr double kClose = 1e-4;  // standard deviations

inline bool is_close(const AxisModel& m, const AxisState& a, const AxisState& b) {
  for (int i = 0; i < m.n; ++i) {
    const double variance = a.P[i * m.n + i];
    if (std::abs(b.P[i * m.n + i] - variance) > kClose * variance) return false;
    for (int d = 0; d < m.D; ++d) {
      const double off = b.x[d][i] - a.x[d][i];
      if (off * off > kClose * kClose * variance) return false;
    }
  }
  return true;
}

// The filter of a single motion model. The steps of a gap are composed into one.
//
// The covariance of a track depends only on the frames of its detections, and a chain tries the
// same sequences of gaps repeatedly. A filter of a part therefore caches gains in a tree, where a
// node stands for a sequence of gaps. Points with their own variance are not cached.
class OneMotion {
 public:
  struct State : AxisState {
    std::int32_t node = -1;  // in the cache
  };
  // The part of a prediction that does not depend on position: the gain, and the log density at the
  // mode.
  struct Pattern {
    KalmanGain gain;
    double log_peak = 0;
  };
  struct Expected {
    AxisState state;
    Point center{};
    double S = 0, log_peak = 0;
    std::int32_t node = -1;
    Pattern own;  // if it is not cached
  };

  // Clears the cache and enables it for the frames of this window.
  void remember(const DetectionWindow& window) {
    is_remembered_ = true;
    first_ = window.first();
    max_gap_ = window.max_gap();
    roots_.assign(window.now() - first_ + 1, -1);
    nodes_.clear();
    next_.clear();
  }
  // Registers a state that was computed outside the cache.
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
      if (next_[at] < 0 && nodes_.size() < kMaxNodes) {
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
  static PredictionByMode own_prediction(const MotionModel& m, const Expected& e) {
    return {e.center, e.S, m.axis.r};
  }
  static double radius(const Expected& e, double log_likelihood, double max_r) {
    const double half = e.log_peak - log_likelihood;
    return half < 0 ? -1 : std::sqrt(2 * (e.S + max_r) * half);
  }
  static double log_likelihood(const MotionModel& m, const Expected& e, const Point& y) {
    const double d2 = squared_distance(y, e.center);
    if (y.r > 0)
      return e.log_peak - 0.5 * (m.axis.D * std::log1p(y.r / e.S) + d2 / (e.S + y.r));
    return e.log_peak - 0.5 * d2 / e.S;
  }
  static double weigh(const MotionModel& m, Expected& e, const Point& y) {
    return log_likelihood(m, e, y);
  }
  void take(const MotionModel& m, const Expected& e, const Point& y, State& out) const {
    const KalmanGain& gain = pattern_of(e).gain;
    const double share = gain.share(y);
    static_cast<AxisState&>(out) = e.state;
    for (int d = 0; d < m.axis.D; ++d)
      for (int i = 0; i < m.axis.n; ++i) out.x[d][i] += share * gain.K[i] * (y[d] - e.center[d]);
    out.P = gain.covariance(m.axis.n, share);
    out.node = y.r > 0 ? -1 : e.node;
  }
  static bool is_close(const MotionModel& m, const State& a, const State& b) {
    return asterism::is_close(m.axis, a, b);
  }

 private:
  static constexpr std::size_t kMaxNodes = 1 << 16;

  std::int32_t add(const Pattern& pattern) {
    if (nodes_.size() >= kMaxNodes) return -1;
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

// The filter of several interacting motion models, frame by frame. The prediction after a gap can
// continue from that after a shorter gap `before`.
class SeveralMotions {
 public:
  using State = MotionState;
  struct Expected {
    State state;
    Prediction prediction;
    std::array<double, kMaxModes> each{};  // of the point of `weigh`
    double log_likelihood = 0;
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
  static PredictionByMode own_prediction(const MotionModel& m, const Expected& e) {
    return {e.prediction, m.axis.r};
  }
  static double radius(const Expected& e, double log_likelihood, double max_r) {
    return e.prediction.radius(std::numeric_limits<double>::infinity(), log_likelihood, max_r);
  }
  static double log_likelihood(const MotionModel&, const Expected& e, const Point& y) {
    std::array<double, kMaxModes> each{};
    return e.prediction.log_likelihood(y, each);
  }
  static double weigh(const MotionModel&, Expected& e, const Point& y) {
    return e.log_likelihood = e.prediction.log_likelihood(y, e.each);
  }
  static void take(const MotionModel& m, const Expected& e, const Point& y, State& out) {
    out = e.state;
    update(m, e.each, e.log_likelihood, y, out);
  }
  static bool is_close(const MotionModel& m, const State& a, const State& b) {
    for (int k = 0; k < m.M; ++k)
      if (std::abs(b.w[k] - a.w[k]) > kClose || !asterism::is_close(m.axis, a.mode[k], b.mode[k]))
        return false;
    return true;
  }
};

}  // namespace asterism
