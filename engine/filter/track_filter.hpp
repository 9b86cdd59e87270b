// Kalman filter, smoother and score s(τ) of whole tracks.
//
// A track is an increasing sequence of frames with one point each. The filter steps through missed
// frames one by one with their true time step, because the process noise of several steps is not
// that of one long step.
#pragma once

#include <cmath>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "filter/imm.hpp"

namespace asterism {

// The steps of a capture: step(t) leads from frame t - 1 to frame t.
struct Timeline {
  std::span<const double> times;       // (T)
  std::span<const std::int32_t> kind;  // (T) index into steps; kind[0] is not used
  std::vector<MotionStep> steps;

  const MotionStep& step(std::int64_t t) const { return steps[kind[t]]; }
};

// The parameters of s(τ) apart from those of the filter, as logarithms.
//
// The detection probability depends on the frame before (Gilbert 1960): P_d after a detection, P_r
// after a missed detection. If P_r = P_d, missed detections are independent.
struct ScoreModel {
  double log_birth = 0, log_clutter = 0, log_survive = 0;
  double p_disappear = 0, p_detection = 0, p_redetection = 0;
  double max_speed = 0, speed_margin = 0;
  int max_gap = 1;
  bool last_termination = false;  // as in the report: the track ends right after its last detection
  double log_detect = std::log(p_detection), log_miss = std::log1p(-p_detection);
  double log_redetect = std::log(p_redetection), log_remiss = std::log1p(-p_redetection);

  // Log probabilities for a marker that was missed in the last `missed` frames: that it is
  // detected, that it is missed again, and that it is missed in the next n frames.
  double log_hit(std::int64_t missed) const { return missed > 0 ? log_redetect : log_detect; }
  double log_missed(std::int64_t missed) const { return missed > 0 ? log_remiss : log_miss; }
  double log_misses(std::int64_t missed, std::int64_t n) const {
    return n > 0 ? log_missed(missed) + static_cast<double>(n - 1) * log_remiss : 0.0;
  }
};

// log E_r: log probability of no further detection in the remaining r frames, summed over the time
// of death.
inline std::vector<double> log_end_table(const ScoreModel& m, std::int64_t n_frames) {
  std::vector<double> table(n_frames + 1, 0.0);
  double E = 1;  // for r further frames, after a missed detection
  for (std::int64_t r = 1; r <= n_frames; ++r) {
    const double alive = (1 - m.p_disappear) * E;
    table[r] = std::log(m.p_disappear + (m.last_termination ? 0 : alive * (1 - m.p_detection)));
    E = m.p_disappear + alive * (1 - m.p_redetection);
  }
  return table;
}

inline bool is_reachable(const ScoreModel& m, const Point& a, const Point& b, double dt) {
  const double reach = m.max_speed * dt + m.speed_margin;
  return squared_distance(a, b) <= reach * reach;
}

// s(τ) of a track, or -inf for a track outside the space Ω. `points` and `frames` are those of the
// track.
inline double score_track(const MotionModel& m, const ScoreModel& sm, const Timeline& line,
                          std::span<const Point> points, std::span<const std::int64_t> frames,
                          const std::vector<double>& log_end) {
  constexpr double impossible = -std::numeric_limits<double>::infinity();
  const auto n = static_cast<std::int64_t>(points.size());
  if (n < 2) return impossible;
  double s = sm.log_birth + sm.log_detect - n * sm.log_clutter;
  MotionState state = begin_state(m, points[0]);
  for (std::int64_t i = 1; i < n; ++i) {
    const std::int64_t gap = frames[i] - frames[i - 1];
    const double dt = line.times[frames[i]] - line.times[frames[i - 1]];
    if (gap > sm.max_gap || !is_reachable(sm, points[i - 1], points[i], dt)) return impossible;
    for (std::int64_t t = frames[i - 1] + 1; t <= frames[i]; ++t) predict(m, line.step(t), state);
    s += sm.log_misses(0, gap - 1) + sm.log_hit(gap - 1) + gap * sm.log_survive +
         update(m, Prediction(m, state), points[i], state);
  }
  const auto left = static_cast<std::int64_t>(line.times.size()) - 1 - frames[n - 1];
  return s + log_end[left];
}

// Filters a track. Writes the states of every frame from the first to the last detection, with the
// modes collapsed, and the log density of each detection (0 for the first). `predicted` receives
// the states before the update of each frame, for the smoother.
inline void filter_track(const MotionModel& m, const Timeline& line, std::span<const Point> points,
                         std::span<const std::int64_t> frames, std::span<AxisState> states,
                         std::span<AxisState> predicted, std::span<double> log_densities) {
  MotionState state = begin_state(m, points[0]);
  states[0] = predicted[0] = collapse(m, state);
  log_densities[0] = 0;
  std::size_t next = 1;
  for (std::int64_t t = frames[0] + 1; t <= frames[frames.size() - 1]; ++t) {
    predict(m, line.step(t), state);
    predicted[t - frames[0]] = collapse(m, state);
    if (frames[next] == t) {
      log_densities[next] = update(m, Prediction(m, state), points[next], state);
      ++next;
    }
    states[t - frames[0]] = collapse(m, state);
  }
}

// Rauch–Tung–Striebel smoother, in place. It is exact with one mode. With several it smooths the
// collapsed moments, which is valid because the modes share one F.
inline void smooth_track(const MotionModel& m, const Timeline& line, std::int64_t first_frame,
                         std::span<const AxisState> predicted, std::span<AxisState> states) {
  for (auto i = static_cast<std::int64_t>(states.size()) - 2; i >= 0; --i)
    states[i] = smooth_back(m.axis, line.step(first_frame + i + 1).mode[0].F, states[i],
                            predicted[i + 1], states[i + 1]);
}

}  // namespace asterism
