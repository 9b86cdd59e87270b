// Tracklets, the markers composed of them, and the latest frames in which they were detected.
#pragma once

#include <algorithm>
#include <cstdint>
#include <deque>
#include <memory>
#include <utility>
#include <vector>

#include "base/flat_map.hpp"
#include "base/shared_copy.hpp"
#include "filter/imm.hpp"
#include "rigid/carrier.hpp"

namespace asterism {

// The decision on a tracklet: to which marker it belongs.
struct Decision {
  static constexpr std::int32_t kOpen = -1, kGhost = -2;
  std::int32_t tracklet = 0;
  std::int32_t marker = kOpen;
  std::int32_t after = -1;      // the tracklet that it continues, -1 for a new marker
  double probability = 1;       // of that decision
};

struct TrackletPoint {
  std::int64_t frame = 0;
  Point at{};
  double peaks = 0;  // sum of the peaks of the background density beside all others of the frame
};
// Hypothesis that a tracklet continues an occluded marker, with the filter state under it.
struct Continuation {
  std::int32_t marker = 0;
  MotionState state;
  double log_likelihood = 0;
};
// What is needed until a tracklet is decided. The filter states are those of its last detection.
struct Comparison {
  std::vector<TrackletPoint> detections;
  MotionState state;
  double alone = 0;  // log likelihood of its second and later detections as a new marker
  std::vector<Continuation> continuations;
  // All candidates with their log-likelihood ratios.
  std::vector<std::pair<std::int32_t, double>> guesses;
};
struct Tracklet {
  std::int64_t label = -1;
  std::int32_t marker = Decision::kOpen;
  std::int32_t n = 0;
  std::int64_t first = 0, last = 0;
  double link_gain = 0;  // mean log-likelihood ratio of its links by neighbours
  std::int32_t guess = -1;  // best candidate among the occluded markers, while undecided
  SharedCopy<Comparison> open;
};
struct Marker {
  std::int32_t tracklet = -1;
  bool is_occluded = false;
  std::int64_t label = -1;  // of that tracklet
  std::int64_t last = 0;
  double mean_gain = 3;  // mean log-likelihood ratio of its detections by neighbours
  // While it is occluded, from the first comparison with a tracklet. Most occlusions end before.
  SharedCopy<std::vector<Anchor>> anchors;
  SharedCopy<MotionState> state;  // predicted to the newest frame

  bool is_prepared() const { return state.has_value(); }
  void release() {
    anchors = {};
    state = {};
  }
};
using Tracklets = FlatMap<std::int32_t, Tracklet>;
using Markers = FlatMap<std::int32_t, Marker>;

struct Frame {
  struct One {
    std::int32_t tracklet = 0;
    Point at{};
    std::int32_t point = 0;  // index in the frame
  };
  MotionStep step;        // the step that leads to the frame
  std::vector<One> seen;  // by increasing tracklet

  const One* one(std::int32_t tracklet) const {
    const auto at = std::ranges::lower_bound(seen, tracklet, {}, &One::tracklet);
    return at != seen.end() && at->tracklet == tracklet ? &*at : nullptr;
  }
  const Point* find(std::int32_t tracklet) const {
    const One* found = one(tracklet);
    return found == nullptr ? nullptr : &found->at;
  }
  void sort() {
    std::sort(seen.begin(), seen.end(),
              [](const One& a, const One& b) { return a.tracklet < b.tracklet; });
  }
};

// The latest frames. Copies share them: only the newest frame is modified, and only by the copy
// that added it.
class RecentFrames {
 public:
  std::int64_t now() const { return now_; }
  Frame& newest() { return *frames_.back(); }
  const Frame& newest() const { return *frames_.back(); }
  // Null if the frame is no longer kept.
  const Frame* find(std::int64_t t) const {
    const std::int64_t back = now_ - t;
    return back >= 0 && back < static_cast<std::int64_t>(frames_.size())
               ? frames_[frames_.size() - 1 - static_cast<std::size_t>(back)].get()
               : nullptr;
  }
  // The present motion state of a tracklet, filtered over the kept frames.
  MotionState motion(const MotionModel& m, std::int32_t tracklet) const {
    MotionState state;
    bool has_begun = false;
    for (const std::shared_ptr<Frame>& frame : frames_) {
      if (has_begun) predict(m, frame->step, state);
      const Point* y = frame->find(tracklet);
      if (y == nullptr) continue;
      if (has_begun)
        update(m, Prediction(m, state), *y, state);
      else
        state = begin_state(m, *y);
      has_begun = true;
    }
    return state;
  }
  void add(const MotionStep& step, std::size_t n_kept) {
    ++now_;
    frames_.push_back(std::make_shared<Frame>());
    frames_.back()->step = step;
    while (frames_.size() > n_kept) frames_.pop_front();
  }

 private:
  std::int64_t now_ = -1;
  std::deque<std::shared_ptr<Frame>> frames_;
};

}  // namespace asterism
