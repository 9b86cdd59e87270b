// A tracker with delayed decisions that also reports provisional labels.
//
// The forest decides a frame when the window has passed it. Until then, its detections have
// provisional labels: those that the forest would assign if no further frame came. Provisional
// labels may change with every frame; decided labels never change.
#pragma once

#include <cmath>
#include <cstdint>
#include <map>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "tracks/live_tracks.hpp"
#include "trees/branches.hpp"

namespace asterism {

template <typename Forest>
class TreeTracker {
 public:
  explicit TreeTracker(const Forest& forest)
      : forest_(forest), present_(forest.live()), has_confidence_(forest.has_confidence()) {}

  // Processes a frame as FrameTracker::step does. Also calls label for earlier detections whose
  // label changes.
  template <typename Label>
  TreeStats step(double time, const MotionStep& step, std::span<const Point> points, Label&& label) {
    std::map<std::int64_t, Reported> decided;
    TreeStats stats = add(time, step, points, decided);
    look_ahead(decided, label);
    // The provisional labels are reported in this step, so their work counts here.
    stats.add_work(ahead_);
    return stats;
  }

  // Processes one of many frames whose labels are needed only at the end, without provisional
  // labels in between.
  template <typename Label>
  TreeStats pass(double time, const MotionStep& step, std::span<const Point> points, Label&& label) {
    std::map<std::int64_t, Reported> decided;
    const TreeStats stats = add(time, step, points, decided);
    for (const auto& [detection, reported] : decided) {
      reported_.erase(detection);
      label(detection, reported.id, reported.confidence);
    }
    return stats;
  }
  template <typename Label>
  void end_pass(Label&& label) {
    look_ahead({}, label);
  }

  bool has_confidence() const { return has_confidence_; }
  const Forest& forest() const { return forest_; }
  // The tracks as they would be if all frames were decided now.
  const LiveTracks<Tree>& live() const { return present_; }
  const MotionModel& motion() const { return present_.m; }
  std::int64_t n_ids() const { return present_.next_id; }
  // Statistics of the decided frames and of the provisional decisions.
  TreeStats total() const {
    TreeStats all = total_;
    all.add_work(ahead_);
    return all;
  }
  const Progress& so_far() const { return so_far_; }

 private:
  struct Reported {
    std::int64_t id = -1;
    double confidence = 0;
    bool operator==(const Reported&) const = default;
  };

  TreeStats add(double time, const MotionStep& step, std::span<const Point> points,
                std::map<std::int64_t, Reported>& decided) {
    auto frame = std::make_shared<WindowFrame>();
    frame->number = so_far_.n_frames;
    frame->first = so_far_.n_seen;
    frame->time = time;
    frame->step = step;
    frame->points.assign(points.begin(), points.end());
    frame->claimed.assign(points.size(), 0);
    // Cells have the width of the largest displacement of a track in one frame.
    const LiveTracks<Tree>& live = forest_.live();
    const double dt = so_far_.n_frames == 0 ? 0 : time - so_far_.last_time;
    frame->grid.build(frame->points, live.m.axis.D, live.sm.max_speed * dt + live.sm.speed_margin);
    TreeStats stats;
    forest_.add(std::move(frame), stats, [&](std::int64_t detection, std::int64_t id, double p) {
      decided[detection] = {id, has_confidence_ ? p : 0};
    });
    forget_old(decided);
    so_far_.add(time, points.size());
    forest_.count(stats);
    total_.add(stats);
    return stats;
  }

  // A detection decided as unassigned may still get a label while a tentative track contains it. If
  // it had a provisional label, that label may have to be withdrawn.
  void forget_old(const std::map<std::int64_t, Reported>& decided) {
    for (const auto& [detection, reported] : decided)
      if (reported.id < 0) unlabelled_[detection] = reported.confidence;
    std::int64_t oldest = reported_.empty() ? so_far_.n_seen : reported_.begin()->first;
    for (const LiveTrack<Tree>& track : forest_.live().tracks)
      if (!track.pending.empty()) oldest = std::min(oldest, track.pending.front().detection);
    unlabelled_.erase(unlabelled_.begin(), unlabelled_.lower_bound(oldest));
  }

  // Computes provisional labels of all open detections, and reports those that changed.
  template <typename Label>
  void look_ahead(const std::map<std::int64_t, Reported>& decided, Label&& label) {
    Forest ahead(forest_);
    ahead_ = {};
    std::map<std::int64_t, Reported> now;
    ahead.decide_all(ahead_, [&](std::int64_t detection, std::int64_t id, double p) {
      now[detection] = {id, has_confidence_ ? p : 0};
    });
    // Withdraws labels of detections that are neither decided nor open to a label any more.
    for (const auto& [detection, reported] : reported_)
      if (!now.contains(detection) && !decided.contains(detection))
        label(detection, -1, unlabelled_.at(detection));
    for (const auto* labels : {&decided, &std::as_const(now)})
      for (const auto& [detection, reported] : *labels) {
        if (labels == &decided && now.contains(detection)) continue;
        const auto before = reported_.find(detection);
        if (before == reported_.end() || !(before->second == reported))
          label(detection, reported.id, reported.confidence);
      }
    reported_ = std::move(now);
    present_ = ahead.live();
  }

  Forest forest_;
  LiveTracks<Tree> present_;
  bool has_confidence_;
  std::map<std::int64_t, Reported> reported_;  // labels reported for undecided detections
  std::map<std::int64_t, double> unlabelled_;
  TreeStats total_, ahead_;
  Progress so_far_;
};

}  // namespace asterism
