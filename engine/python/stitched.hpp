// A stitcher behind a tracker, for the trackers' bindings: both process a frame in one call.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "python/motion_arrays.hpp"
#include "stitch/live_stitcher.hpp"

namespace asterism {

// A detection, the id of its track or -1, and the confidence.
struct Decided {
  std::int64_t detection = 0, id = -1;
  double confidence = 0;
};

// Replaces a tracker's decisions on a frame, `now`, and on earlier detections, `revised`, by those
// of the stitcher. If it has looked ahead and these contradict, it starts from `before`.
void stitch(LiveStitcher& stitcher, const LiveStitcher& before, const MotionStep& step,
            std::span<const Point> frame, std::vector<Decided>& now,
            std::vector<Decided>& revised);

// A track after a frame.
struct TrackNow {
  std::int64_t id = -1, gap = 0;
  double log_odds = 0;
  AxisState state;
};

// The states of the markers (see TrackArrays): those of the tracklets, and of the markers without
// one, whose log odds are unknown.
nb::tuple marker_states(LiveStitcher& stitcher, std::span<const TrackNow> tracklets);

}  // namespace asterism
