// The markers of a stream: what is known of a frame now, and what of earlier frames changes.
//
// A tracker may change its mind about the last frames, so that those wait until their labels are
// settled. Meanwhile their detections have the marker of the fragment that they would go on with.
#pragma once

#include <algorithm>
#include <cstdint>
#include <deque>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "stitcher.hpp"

namespace asterism {

class LiveStitcher {
 public:
  // A frame waits until `lag` more have come.
  LiveStitcher(const MotionModel& m, const StitchOptions& options, std::int64_t lag)
      : stitcher_(m, options),
        n_waiting_(static_cast<std::size_t>(lag)),
        // A fragment is decided upon before its first frame is forgotten.
        n_kept_(static_cast<std::size_t>(options.confirm + options.max_gap + 2)) {}

  const Stitcher& stitcher() const { return stitcher_; }
  const MotionModel& motion() const { return stitcher_.motion(); }
  std::int64_t n_seen() const { return n_seen_; }
  std::int64_t n_joins() const { return n_joins_; }
  std::int64_t n_ghosts() const { return n_ghosts_; }

  // `labels` are the tracker's of this frame, `revised` those that it changes of earlier ones, as
  // pairs of a detection and its label. Calls tell(detection, marker) for all that is new or changes.
  template <typename Tell>
  void step(const MotionStep& step, std::span<const Point> points,
            std::span<const std::int64_t> labels,
            std::span<const std::pair<std::int64_t, std::int64_t>> revised, Tell&& tell) {
    for (const auto& [detection, label] : revised) revise(detection, label);
    Recent& now = *recent_.emplace_back(std::make_shared<Recent>());
    now.step = step;
    now.first = n_seen_;
    now.points.assign(points.begin(), points.end());
    now.labels.assign(labels.begin(), labels.end());
    now.known.resize(points.size());
    n_seen_ += static_cast<std::int64_t>(points.size());
    if (recent_.size() > n_waiting_) take(own(recent_[recent_.size() - 1 - n_waiting_]));
    stitcher_.guess();
    for (std::shared_ptr<Recent>& frame : recent_)
      if (!frame->is_taken)
        tell_of_waiting(own(frame), tell);
      else if (!frame->is_settled)
        tell_of_taken(own(frame), tell);
    if (recent_.size() > n_waiting_ + n_kept_) recent_.pop_front();
  }

 private:
  struct Known {
    std::int32_t fragment = -1, told = -2;
    bool is_settled = false;
  };
  struct Recent {
    std::int64_t first = 0;  // of its detections
    bool is_taken = false, is_settled = false;
    std::vector<Known> known;
    // While it waits.
    MotionStep step;
    std::vector<Point> points;
    std::vector<std::int64_t> labels;
  };

  // Copies of the whole share their frames until one of them changes a frame.
  static Recent& own(std::shared_ptr<Recent>& frame) {
    if (frame.use_count() > 1) frame = std::make_shared<Recent>(*frame);
    return *frame;
  }
  // What has been taken is settled.
  void revise(std::int64_t detection, std::int64_t label) {
    for (auto frame = recent_.rbegin(); frame != recent_.rend() && !(*frame)->is_taken; ++frame) {
      if (detection < (*frame)->first) continue;
      own(*frame).labels[static_cast<std::size_t>(detection - (*frame)->first)] = label;
      return;
    }
  }
  void take(Recent& frame) {
    fragments_.assign(frame.points.size(), -1);
    stitcher_.step(frame.step, frame.points, frame.labels, fragments_, [&](const Decision& d) {
      n_joins_ += d.marker >= 0 && d.after >= 0;
      n_ghosts_ += d.marker == Decision::kGhost;
    });
    for (std::size_t i = 0; i < frame.known.size(); ++i) frame.known[i].fragment = fragments_[i];
    frame.is_taken = true;
    std::vector<Point>().swap(frame.points);
    std::vector<std::int64_t>().swap(frame.labels);
  }
  template <typename Tell>
  void tell_of_taken(Recent& frame, Tell&& tell) {
    frame.is_settled = true;
    for (std::size_t i = 0; i < frame.known.size(); ++i) {
      Known& known = frame.known[i];
      if (known.is_settled) continue;
      const bool is_free = known.fragment < 0;
      known.is_settled = is_free || !stitcher_.is_open(known.fragment);
      frame.is_settled &= known.is_settled;
      tell_of(frame, i, is_free ? -1 : stitcher_.marker_of(known.fragment), tell);
    }
  }
  // A guess gives way to what is known.
  template <typename Tell>
  void tell_of_waiting(Recent& frame, Tell&& tell) {
    fragments_.clear();
    markers_.clear();
    for (const std::int64_t label : frame.labels) {
      const std::int32_t f = label < 0 ? -1 : stitcher_.fragment_with(label);
      fragments_.push_back(f);
      markers_.push_back(f < 0 ? -1 : stitcher_.marker_of(f));
    }
    for (std::size_t i = 0; i < markers_.size(); ++i)
      if (fragments_[i] >= 0 && stitcher_.is_open(fragments_[i]) &&
          std::count(markers_.begin(), markers_.end(), markers_[i]) > 1)
        markers_[i] = -1;
    for (std::size_t i = 0; i < markers_.size(); ++i) tell_of(frame, i, markers_[i], tell);
  }
  template <typename Tell>
  void tell_of(Recent& frame, std::size_t i, std::int32_t marker, Tell&& tell) {
    std::int32_t& told = frame.known[i].told;
    marker = std::max(marker, -1);
    if (told != marker) tell(frame.first + static_cast<std::int64_t>(i), told = marker);
  }

  Stitcher stitcher_;
  std::size_t n_waiting_, n_kept_;
  std::int64_t n_seen_ = 0, n_joins_ = 0, n_ghosts_ = 0;
  std::deque<std::shared_ptr<Recent>> recent_;
  std::vector<std::int32_t> fragments_, markers_;  // while a frame is worked on
};

}  // namespace asterism
