// Stitches tracklets in a stream: reports the marker of each detection at once, and corrections of
// earlier frames later.
//
// A tracker may revise the labels of the last frames, so these wait until their labels are settled.
// Meanwhile their detections have the marker of the tracklet that they would continue.
#pragma once

#include <algorithm>
#include <cstdint>
#include <deque>
#include <span>
#include <utility>
#include <vector>

#include "base/shared_copy.hpp"
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
    for (const auto& [detection, label] : revised) revise(detection, label);
    Recent& now = recent_.emplace_back(Recent{}).own();
    now.step = step;
    now.first = n_seen_;
    now.points.assign(points.begin(), points.end());
    now.labels.assign(labels.begin(), labels.end());
    now.known.resize(points.size());
    n_seen_ += static_cast<std::int64_t>(points.size());
    if (recent_.size() > n_waiting_) take(recent_[recent_.size() - 1 - n_waiting_].own());
    stitcher_.guess();
    for (SharedCopy<Recent>& frame : recent_)
      if (!frame->is_taken)
        report_waiting(frame.own(), report);
      else if (may_change(*frame))
        report_taken(frame.own(), report);
    if (recent_.size() > n_waiting_ + n_kept_) recent_.pop_front();
  }

 private:
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
  // If several detections of a frame have the same marker, those of undecided tracklets lose it.
  template <typename Report>
  void report_waiting(Recent& frame, Report&& report) {
    markers_.clear();
    is_open_.clear();
    for (const std::int64_t label : frame.labels) {
      const Stitcher::Continued found = stitcher_.continued_by(label);
      markers_.push_back(found.marker);
      is_open_.push_back(found.is_open);
    }
    for (std::size_t i = 0; i < markers_.size(); ++i)
      if (is_open_[i] && std::count(markers_.begin(), markers_.end(), markers_[i]) > 1)
        markers_[i] = -1;
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
  std::deque<SharedCopy<Recent>> recent_;
  // Scratch of one frame.
  std::vector<std::int32_t> tracklets_, markers_;
  std::vector<char> is_open_;
};

}  // namespace asterism
