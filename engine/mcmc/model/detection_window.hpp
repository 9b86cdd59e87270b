// The detections of a window of frames, and the links that are possible between them.
//
// A detection has a number below `n_ids` while it is in the window; the number is then reused.
// Links are tested on demand, because lists of all pairs would be long: across a gap of many frames
// a marker may reach almost any detection.
#pragma once

#include <algorithm>
#include <cassert>
#include <cstdint>
#include <deque>
#include <limits>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "filter/gating.hpp"
#include "filter/track_filter.hpp"

namespace asterism {

class DetectionWindow {
 public:
  struct Detection {
    Point y{};
    double time = 0;
    std::int64_t frame = 0, number = 0;  // number: in order of arrival
  };
  // Positions of the detections of a frame. They are immutable, so that copies of a window share
  // them.
  struct Places {
    std::vector<Point> points;
    PointGrid grid;
  };
  // The motion model of the steps to a frame; shared as well.
  struct Steps {
    MotionStep step;               // from the frame before
    std::vector<AxisStep> single;  // with one motion model: from d frames before, at index d - 1
    // Upper bounds of the log density of a detection of the frame: right after the first detection
    // of its track, and later.
    double log_peak = 0, log_later_peak = 0;
  };
  struct Frame {
    double time = 0;
    std::shared_ptr<const Places> places;  // null in a part of a window
    std::shared_ptr<const Steps> steps;
    std::vector<std::int32_t> ids;
  };

  DetectionWindow(const MotionModel& m, const ScoreModel& sm) : m_(m), sm_(sm) {}

  const Detection& operator[](std::int32_t i) const { return detections_[i]; }
  std::int32_t n_ids() const { return static_cast<std::int32_t>(detections_.size()); }
  const Frame& frame(std::int64_t number) const { return frames_[number - first_]; }
  std::int64_t first() const { return first_; }
  // Number of the newest frame; that of the first is 0.
  std::int64_t now() const { return first_ + static_cast<std::int64_t>(frames_.size()) - 1; }
  int max_gap() const { return sm_.max_gap; }
  // Changes whenever the window changes.
  std::int64_t version() const { return version_; }
  // Last frame whose detections may have successors. Detections of later frames represent the
  // continuation of a track after a block (see Partition::continue_with).
  std::int64_t last_open() const { return last_open_; }
  void close_after(std::int64_t frame) { last_open_ = frame; }

  bool is_linkable(std::int32_t i, std::int32_t j) const {
    const Detection &a = detections_[i], &b = detections_[j];
    const std::int64_t gap = b.frame - a.frame;
    return gap >= 1 && gap <= sm_.max_gap && a.frame <= last_open_ && is_reachable(sm_, a.y, b.y, b.time - a.time);
  }

  // Calls visit(j) for every detection of a frame that may follow i.
  template <typename Visit>
  void each_after(std::int32_t i, std::int64_t frame_number, Visit&& visit) const {
    const Detection& a = detections_[i];
    if (a.frame > last_open_) return;
    const Frame& later = frame(frame_number);
    const double reach = sm_.max_speed * (later.time - a.time) + sm_.speed_margin;
    if (later.places) {
      later.places->grid.within(a.y, reach, [&](std::int32_t k, double) { visit(later.ids[k]); });
      return;
    }
    for (const std::int32_t j : later.ids)
      if (squared_distance(a.y, detections_[j].y) <= reach * reach) visit(j);
  }

  // Adds the next frame. Returns the numbers of its detections in order of arrival.
  std::span<const std::int32_t> add(double time, const MotionStep& step,
                                    std::span<const Point> points, std::int64_t first_number) {
    ++version_;
    Frame& frame = frames_.emplace_back();
    frame.time = time;
    const std::int64_t t = now();
    auto places = std::make_shared<Places>();
    places->points.assign(points.begin(), points.end());
    const double dt = frames_.size() < 2 ? 0 : time - frames_[frames_.size() - 2].time;
    places->grid.build(places->points, m_.axis.D, sm_.max_speed * dt + sm_.speed_margin);
    frame.places = std::move(places);
    for (std::size_t k = 0; k < points.size(); ++k) {
      std::int32_t id = n_ids();
      if (unused_.empty()) {
        detections_.emplace_back();
      } else {
        id = unused_.back();
        unused_.pop_back();
      }
      Detection& d = detections_[id];
      d.y = points[k];
      d.time = time;
      d.frame = t;
      d.number = first_number + static_cast<std::int64_t>(k);
      frame.ids.push_back(id);
    }
    auto steps = std::make_shared<Steps>();
    steps->step = step;
    bound_peaks(*steps, t);
    if (m_.M == 1) compose(*steps, t);
    frame.steps = std::move(steps);
    return frame.ids;
  }

  // Becomes the part of a window that contains the given detections, numbered in the given order.
  void take_part(const DetectionWindow& whole, std::span<const std::int32_t> ids) {
    ++version_;
    first_ = whole.first_;
    last_open_ = whole.last_open_;
    frames_.resize(whole.frames_.size());
    for (std::size_t t = 0; t < frames_.size(); ++t) {
      frames_[t].time = whole.frames_[t].time;
      frames_[t].steps = whole.frames_[t].steps;
      frames_[t].ids.clear();
    }
    detections_.clear();
    unused_.clear();
    for (const std::int32_t i : ids) {
      frames_[whole.detections_[i].frame - first_].ids.push_back(n_ids());
      detections_.push_back(whole.detections_[i]);
    }
  }

  // Removes the oldest frame. Its detections must not be referenced any more.
  void drop() {
    ++version_;
    for (const std::int32_t id : frames_.front().ids) unused_.push_back(id);
    frames_.pop_front();
    ++first_;
  }

 private:
  // A covariance is at least that of a state which was known exactly before the last step, or before
  // the last two with a detection between them. It is at least the smallest of the modes if they
  // are mixed.
  void bound_peaks(Steps& steps, std::int64_t t) const {
    const double never = -std::numeric_limits<double>::infinity();
    steps.log_peak = steps.log_later_peak = never;
    for (int b = 0; b < m_.M; ++b) {
      AxisState exact;
      exact.P = steps.step.mode[b].Q;
      const double S = innovation_variance(m_.axis, exact);
      steps.log_peak = std::max(steps.log_peak, log_density(m_.axis.D, S, 0));
      if (t == first_) continue;
      const MotionStep& before = frames_[t - 1 - first_].steps->step;
      for (int a = 0; a < m_.M; ++a) {
        AxisState s;
        s.P = before.mode[a].Q;
        s.P = KalmanGain(m_.axis, s).P;
        predict(m_.axis, steps.step.mode[b], s);
        const double later_S = innovation_variance(m_.axis, s);
        steps.log_later_peak = std::max(steps.log_later_peak, log_density(m_.axis.D, later_S, 0));
      }
    }
    if (t == first_) steps.log_later_peak = steps.log_peak;
  }
  // F and Q over d frames: x ↦ F₂ F₁ x, Q = F₂ Q₁ F₂ᵀ + Q₂. The process noise of separate steps is
  // accumulated; that of one long step would differ.
  void compose(Steps& steps, std::int64_t t) const {
    const int n = m_.axis.n;
    const AxisStep& last = steps.step.mode[0];
    steps.single.push_back(last);
    for (int d = 2; d <= sm_.max_gap && t - d >= first_; ++d) {
      const AxisStep& before = frames_[t - 1 - first_].steps->single[d - 2];
      AxisStep all;
      AxisMatrix FQ{};
      all.Q = last.Q;
      for (int i = 0; i < n; ++i)
        for (int k = 0; k < n; ++k)
          for (int j = 0; j < n; ++j) {
            all.F[i * n + j] += last.F[i * n + k] * before.F[k * n + j];
            FQ[i * n + j] += last.F[i * n + k] * before.Q[k * n + j];
          }
      for (int i = 0; i < n; ++i)
        for (int j = 0; j < n; ++j)
          for (int k = 0; k < n; ++k) all.Q[i * n + j] += FQ[i * n + k] * last.F[j * n + k];
      steps.single.push_back(all);
    }
  }

  MotionModel m_;
  ScoreModel sm_;
  std::vector<Detection> detections_;
  std::vector<std::int32_t> unused_;
  std::deque<Frame> frames_;
  std::int64_t first_ = 0, version_ = 0;
  std::int64_t last_open_ = std::numeric_limits<std::int64_t>::max();
};

}  // namespace asterism
