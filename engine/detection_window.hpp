// The detections of a window of frames, and which of them may follow which.
//
// Detections have numbers below `n_ids` that are theirs as long as they are in the window, and are
// used again for others later.
#pragma once

#include <cassert>
#include <cstdint>
#include <deque>
#include <span>
#include <utility>
#include <vector>

#include "filter_tracks.hpp"
#include "gating.hpp"

namespace asterism {

class DetectionWindow {
 public:
  struct Detection {
    Point y{};
    double time = 0;
    std::int64_t frame = 0, number = 0;  // number: in order of arrival
    // What may come next and what before, by gap: those of gap d from from[d - 1] to from[d].
    std::vector<std::int32_t> next, next_from, prev, prev_from;
  };
  struct Frame {
    double time = 0;
    MotionStep step;               // from the frame before
    std::vector<AxisStep> single;  // with one motion: from d frames before, at d - 1
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

  // The detections of a later frame that may follow i with gap d, in order; and those before it.
  std::span<const std::int32_t> next(std::int32_t i, int d) const {
    const Detection& a = detections_[i];
    return {a.next.data() + a.next_from[d - 1], a.next.data() + a.next_from[d]};
  }
  std::span<const std::int32_t> next(std::int32_t i) const { return detections_[i].next; }
  std::span<const std::int32_t> prev(std::int32_t i) const { return detections_[i].prev; }

  bool is_linkable(std::int32_t i, std::int32_t j) const {
    const Detection &a = detections_[i], &b = detections_[j];
    const std::int64_t gap = b.frame - a.frame;
    if (gap < 1 || gap > sm_.max_gap) return false;
    return is_reachable(sm_, a.y, b.y, b.time - a.time, m_.axis.D);
  }

  // The next frame, and the numbers of its detections in order of arrival.
  std::span<const std::int32_t> add(double time, const MotionStep& step,
                                    std::span<const Point> points, std::int64_t first_number) {
    Frame& frame = frames_.emplace_back();
    frame.time = time;
    frame.step = step;
    const std::int64_t t = now();
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
      d.next.clear();
      d.prev.clear();
      d.next_from.assign(sm_.max_gap + 1, 0);
      d.prev_from.assign(sm_.max_gap + 1, 0);
      frame.ids.push_back(id);
    }
    if (m_.M == 1) compose(frame, t);
    link(frame, points);
    return frame.ids;
  }

  // Forgets the oldest frame. Nothing may refer to its detections any more.
  void drop() {
    for (const std::int32_t id : frames_.front().ids) unused_.push_back(id);
    // Among what may be before a detection, those of the greatest gap come last.
    for (int d = 1; d <= sm_.max_gap && d < static_cast<int>(frames_.size()); ++d)
      for (const std::int32_t j : frames_[d].ids) {
        Detection& b = detections_[j];
        b.prev.resize(b.prev_from[d - 1]);
        for (int e = d; e <= sm_.max_gap; ++e) b.prev_from[e] = b.prev_from[d - 1];
      }
    frames_.pop_front();
    ++first_;
  }

 private:
  // F and Q over d frames: x ↦ F₂ F₁ x, Q = F₂ Q₁ F₂ᵀ + Q₂. Noise of separate steps adds up; that of
  // one step over the whole time would not be the same.
  void compose(Frame& frame, std::int64_t t) {
    const int n = m_.axis.n;
    const AxisStep& last = frame.step.mode[0];
    frame.single.push_back(last);
    for (int d = 2; d <= sm_.max_gap && t - d >= first_; ++d) {
      const AxisStep& before = frames_[t - 1 - first_].single[d - 2];
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
      frame.single.push_back(all);
    }
  }

  void link(const Frame& frame, std::span<const Point> points) {
    const auto n_before = static_cast<std::int64_t>(frames_.size()) - 1;
    if (n_before == 0) return;
    const double dt = frame.time - frames_[n_before - 1].time;
    grid_.build(points, m_.axis.D, sm_.max_speed * dt + sm_.speed_margin);
    for (int d = 1; d <= sm_.max_gap; ++d) {
      if (d <= n_before) {
        const Frame& before = frames_[n_before - d];
        const double reach = sm_.max_speed * (frame.time - before.time) + sm_.speed_margin;
        for (const std::int32_t i : before.ids) {
          Detection& a = detections_[i];
          found_.clear();
          grid_.within(a.y, reach, [&](std::int32_t k, double) { found_.push_back(frame.ids[k]); });
          for (const std::int32_t j : found_) {
            a.next.push_back(j);
            detections_[j].prev.push_back(i);
          }
          for (int e = d; e <= sm_.max_gap; ++e)
            a.next_from[e] = static_cast<std::int32_t>(a.next.size());
        }
      }
      for (const std::int32_t j : frame.ids)
        detections_[j].prev_from[d] = static_cast<std::int32_t>(detections_[j].prev.size());
    }
  }

  MotionModel m_;
  ScoreModel sm_;
  std::vector<Detection> detections_;
  std::vector<std::int32_t> unused_;
  std::deque<Frame> frames_;
  std::int64_t first_ = 0;
  PointGrid grid_;
  std::vector<std::int32_t> found_;
};

}  // namespace asterism
