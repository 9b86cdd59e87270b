// Stitches tracklets in a stream: reports the marker of each detection at once, and corrections of
// earlier frames later.
//
// A tracker may revise the labels of the last frames, so these wait until their labels are settled.
// Meanwhile their detections have the marker of the tracklet that they would continue.
#pragma once

#include <algorithm>
#include <cassert>
#include <cstdint>
#include <deque>
#include <limits>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "base/scratch.hpp"
#include "base/shared_copy.hpp"
#include "rigid/carried_state.hpp"
#include "stitch/stitcher.hpp"

namespace asterism {

class LiveStitcher {
 public:
  // A frame waits until `lag` further frames have arrived.
  LiveStitcher(const MotionModel& m, const StitchOptions& options, std::int64_t lag)
      : stitcher_(m, options),
        n_waiting_(static_cast<std::size_t>(lag)),
        // A tracklet is decided before its first frame is removed.
        n_kept_(static_cast<std::size_t>(options.confirm + options.max_gap + 2)) {}

  const Stitcher& stitcher() const { return stitcher_; }
  const MotionModel& motion() const { return stitcher_.motion(); }
  std::int64_t n_seen() const { return n_seen_; }
  std::int64_t n_joins() const { return n_joins_; }
  std::int64_t n_ghosts() const { return n_ghosts_; }

  // `labels` are the tracker's labels of this frame. `revised` are its corrections of earlier ones,
  // as pairs of a detection and a label. Calls tell(detection, marker) for every new or changed
  // marker.
  template <typename Report>
  void step(const MotionStep& step, std::span<const Point> points,
            std::span<const std::int64_t> labels,
            std::span<const std::pair<std::int64_t, std::int64_t>> revised, Report&& report) {
    assert(!contradicts(revised));
    for (const auto& [detection, label] : revised) revise(detection, label);
    Recent& now = recent_.emplace_back(Recent{}).own();
    now.step = step;
    now.first = n_seen_;
    now.points.assign(points.begin(), points.end());
    now.labels.assign(labels.begin(), labels.end());
    now.known.resize(points.size());
    n_seen_ += static_cast<std::int64_t>(points.size());
    if (recent_.size() > n_waiting_ && !is_ahead_) take(recent_[recent_.size() - 1 - n_waiting_].own());
    is_ahead_ = false;
    stitcher_.guess();
    waiting_.clear();
    markers_.clear();
    for (SharedCopy<Recent>& frame : recent_)
      if (!frame->is_taken)
        report_waiting(frame.own(), report);
      else if (may_change(*frame))
        report_taken(frame.own(), report);
    if (recent_.size() > n_waiting_ + n_kept_) recent_.pop_front();
  }

  // Processes the frame that the next step processes first, which is most of its work. The result is
  // that of the next step alone unless that contradicts.
  void look_ahead() {
    if (n_waiting_ == 0 || recent_.size() < n_waiting_ || is_ahead_) return;
    take(recent_[recent_.size() - n_waiting_].own());
    is_ahead_ = true;
  }
  // Whether corrections change the frame that was processed ahead.
  bool contradicts(std::span<const std::pair<std::int64_t, std::int64_t>> revised) const {
    if (!is_ahead_) return false;
    const Recent& frame = *recent_[recent_.size() - n_waiting_];
    const std::int64_t end = frame.first + static_cast<std::int64_t>(frame.known.size());
    return std::ranges::any_of(revised, [&](const auto& one) {
      return one.first >= frame.first && one.first < end;
    });
  }

  // The present marker of each tracker's label, -1 for none. If several labels have the same marker,
  // those of undecided tracklets lose it.
  std::vector<std::int32_t> markers_of(std::span<const std::int64_t> labels) const {
    std::vector<std::int32_t> markers;
    std::vector<char> is_open;
    for (const std::int64_t label : labels) {
      const Stitcher::Continued found = stitcher_.continued_by(label);
      markers.push_back(std::max(found.marker, -1));
      is_open.push_back(found.is_open);
    }
    std::vector<std::int32_t> out = markers;
    for (std::size_t i = 0; i < out.size(); ++i)
      if (is_open[i] && std::count(markers.begin(), markers.end(), markers[i]) > 1) out[i] = -1;
    return out;
  }

  // A marker without a living track, and its present state. Values that are unknown are NaN: the
  // velocity, if neighbours alone predict the position, and everything without neighbours and
  // without a motion.
  struct UnseenMarker {
    std::int32_t marker = 0;
    std::int64_t gap = 0;
    AxisState state;
  };
  // Returns the markers that are not among `known`, which are sorted. `present` holds the detected
  // ones.
  std::vector<UnseenMarker> unseen(const Places& present, std::span<const std::int32_t> known) {
    const MotionModel& m = motion();
    std::vector<UnseenMarker> out;
    stitcher_.each_unseen(
        present,
        [&](std::int32_t k) { return !std::binary_search(known.begin(), known.end(), k); },
        [&](const Stitcher::Unseen& unseen) {
          UnseenMarker& to = out.emplace_back();
          to.marker = unseen.marker;
          to.gap = unseen.gap;
          std::optional<MotionState> state = unseen.motion;
          for (const SharedCopy<Recent>& frame : recent_) {
            if (frame->is_taken) continue;
            ++to.gap;
            if (state) predict(m, frame->step, *state);
          }
          if (state && unseen.place)
            if (const auto fused = fuse(m, *state, Prediction(m, *state), *unseen.place); fused)
              state = *fused;
          to.state = state ? collapse(m, *state) : at_place(unseen.place);
        });
    return out;
  }

 private:
  AxisState at_place(const std::optional<Carried>& place) const {
    constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();
    AxisState out;
    for (AxisVector& x : out.x) x.fill(kUnknown);
    out.P.fill(kUnknown);
    if (!place) return out;
    for (int d = 0; d < kMaxAxes; ++d) out.x[d][0] = place->at[d];
    out.P[0] = place->variance;
    return out;
  }

  struct Known {
    std::int32_t tracklet = -1, reported = -2;
  };
  struct Recent {
    std::int64_t first = 0;  // number of its first detection
    bool is_taken = false;
    std::vector<Known> known;
    // Detections whose marker may change, once the frame is processed.
    std::vector<std::int32_t> open;
    // While the frame waits.
    MotionStep step;
    std::vector<Point> points;
    std::vector<std::int64_t> labels;
  };

  // Labels of processed frames are settled and ignored.
  void revise(std::int64_t detection, std::int64_t label) {
    for (auto frame = recent_.rbegin(); frame != recent_.rend() && !(*frame)->is_taken; ++frame) {
      if (detection < (*frame)->first) continue;
      frame->own().labels[static_cast<std::size_t>(detection - (*frame)->first)] = label;
      return;
    }
  }
  void take(Recent& frame) {
    tracklets_.assign(frame.points.size(), -1);
    stitcher_.step(frame.step, frame.points, frame.labels, tracklets_, [&](const Decision& d) {
      n_joins_ += d.marker >= 0 && d.after >= 0;
      n_ghosts_ += d.marker == Decision::kGhost;
    });
    for (std::size_t i = 0; i < frame.known.size(); ++i) {
      frame.known[i].tracklet = tracklets_[i];
      frame.open.push_back(static_cast<std::int32_t>(i));
    }
    frame.is_taken = true;
    std::vector<Point>().swap(frame.points);
    std::vector<std::int64_t>().swap(frame.labels);
  }
  // Whether the marker of a detection has changed or is final. Otherwise copies share the frame.
  bool may_change(const Recent& frame) const {
    return std::ranges::any_of(frame.open, [&](std::int32_t i) {
      const Known& known = frame.known[i];
      return known.tracklet < 0 || !stitcher_.is_open(known.tracklet) ||
             std::max(stitcher_.marker_of(known.tracklet), -1) != known.reported;
    });
  }
  template <typename Report>
  void report_taken(Recent& frame, Report&& report) {
    std::erase_if(frame.open, [&](std::int32_t i) {
      const std::int32_t f = frame.known[i].tracklet;
      report_one(frame, i, f < 0 ? -1 : stitcher_.marker_of(f), report);
      return f < 0 || !stitcher_.is_open(f);
    });
  }
  template <typename Report>
  void report_waiting(Recent& frame, Report&& report) {
    if (markers_.empty() || !std::ranges::equal(waiting_, frame.labels)) {  // often they are the same
      waiting_.assign(frame.labels.begin(), frame.labels.end());
      markers_of(waiting_).swap(markers_);
    }
    for (std::size_t i = 0; i < markers_.size(); ++i) report_one(frame, i, markers_[i], report);
  }
  template <typename Report>
  void report_one(Recent& frame, std::size_t i, std::int32_t marker, Report&& report) {
    std::int32_t& reported = frame.known[i].reported;
    marker = std::max(marker, -1);
    if (reported != marker) report(frame.first + static_cast<std::int64_t>(i), reported = marker);
  }

  Stitcher stitcher_;
  std::size_t n_waiting_, n_kept_;
  std::int64_t n_seen_ = 0, n_joins_ = 0, n_ghosts_ = 0;
  bool is_ahead_ = false;
  std::deque<SharedCopy<Recent>> recent_;
  // Scratch of one frame.
  Scratch<std::vector<std::int32_t>> tracklets_;
  Scratch<std::vector<std::int64_t>> waiting_;  // labels of the last waiting frame
  Scratch<std::vector<std::int32_t>> markers_;  // and their markers
};

}  // namespace asterism
