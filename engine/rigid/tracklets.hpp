// Fragments of tracks, the markers that are made of them, and the frames in which they were seen lately.
#pragma once

#include <algorithm>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <utility>
#include <vector>

#include "filter/imm.hpp"
#include "rigid/carrier.hpp"

namespace asterism {

// What was decided of a fragment.
struct Decision {
  static constexpr std::int32_t kOpen = -1, kGhost = -2;
  std::int32_t fragment = 0;
  std::int32_t marker = kOpen;
  std::int32_t after = -1;      // the fragment that it goes on with, -1 of a new marker
  double probability = 1;       // that it does
};

struct FragmentPoint {
  std::int64_t frame = 0;
  Point at{};
};
// A hidden marker's own motion, gone on with by a fragment.
struct Continuation {
  std::int32_t marker = 0;
  MotionState state;
  double log_likelihood = 0;
};
struct Fragment {
  std::int64_t label = -1;
  std::int32_t marker = Decision::kOpen;
  std::int64_t first = 0, last = 0;
  std::int32_t n = 0;
  std::vector<FragmentPoint> sights;  // until it is decided upon
  MotionState state;         // while its motion is compared
  double alone = 0;  // log likelihood of its second detection and those after
  std::vector<Continuation> continuations;
  double known = 0;  // how well its neighbours knew its links, on average
  std::int32_t guess = -1;  // the hidden marker that it may be, while nothing is decided
  std::vector<std::pair<std::int32_t, double>> guesses;  // all that it may be, and what speaks for it
};
struct Marker {
  std::int32_t fragment = -1;
  std::int64_t label = -1;  // of that
  std::int64_t last = 0;
  MotionState state;            // now, while it is hidden
  std::vector<Anchor> anchors;  // as well
  bool is_hidden = false;
  double trust = 3;  // how well its neighbours carried it lately, while it was seen
};
using Fragments = std::map<std::int32_t, Fragment>;
using Markers = std::map<std::int32_t, Marker>;

struct Frame {
  struct One {
    std::int32_t fragment = 0;
    Point at{};
    std::int32_t point = 0;  // its number in the frame
  };
  MotionStep step;        // to it
  std::vector<One> seen;  // in order of fragments

  const Point* find(std::int32_t fragment) const {
    const auto at = std::lower_bound(seen.begin(), seen.end(), fragment,
                                     [](const One& one, std::int32_t id) { return one.fragment < id; });
    return at != seen.end() && at->fragment == fragment ? &at->at : nullptr;
  }
  void sort() {
    std::sort(seen.begin(), seen.end(),
              [](const One& a, const One& b) { return a.fragment < b.fragment; });
  }
};

// Copies share their frames: only the newest is worked on, by the copy that has added it.
class RecentFrames {
 public:
  std::int64_t now() const { return now_; }
  Frame& newest() { return *frames_.back(); }
  const Frame& newest() const { return *frames_.back(); }
  // None where it is too long ago.
  const Frame* find(std::int64_t t) const {
    const std::int64_t back = now_ - t;
    return back >= 0 && back < static_cast<std::int64_t>(frames_.size())
               ? frames_[frames_.size() - 1 - static_cast<std::size_t>(back)].get()
               : nullptr;
  }
  // How a fragment moves now, by all that is remembered of it.
  MotionState motion(const MotionModel& m, std::int32_t fragment) const {
    MotionState state;
    bool has_begun = false;
    for (const std::shared_ptr<Frame>& frame : frames_) {
      if (has_begun) predict(m, frame->step, state);
      const Point* y = frame->find(fragment);
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
