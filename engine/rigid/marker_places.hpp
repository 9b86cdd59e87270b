// Where the markers are detected in the frames of a part of a capture. A marker with several
// detections in a frame has no place there.
#pragma once

#include <algorithm>
#include <cassert>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "math/point.hpp"

namespace asterism {

class MarkerPlaces {
 public:
  // Begins without detections, in `n_frames` frames from the first on.
  void begin(std::size_t n_markers, std::int64_t first, std::int64_t n_frames) {
    first_ = first;
    n_frames_ = n_frames;
    slots_.resize(std::max(slots_.size(), n_markers * static_cast<std::size_t>(n_frames)));
    for (Slot& slot : slots_) {
      slot.n = 0;
      slot.more.clear();
    }
  }
  void add(std::int32_t marker, std::int64_t frame, const Point& y) {
    Slot& slot = slots_[index(marker, frame)];
    if (slot.n++ == 0)
      slot.at = y;
    else
      slot.more.push_back(y);
  }
  void remove(std::int32_t marker, std::int64_t frame, const Point& y) {
    Slot& slot = slots_[index(marker, frame)];
    assert(slot.n > 0);
    if (--slot.n == 0) return;
    Point* found = &slot.at;
    if (*found != y) found = &*std::ranges::find(slot.more, y);
    *found = slot.more.back();
    slot.more.pop_back();
  }
  // The place of a marker, or null. There is none in frames before the first.
  const Point* operator()(std::int32_t marker, std::int64_t frame) const {
    if (frame < first_) return nullptr;
    const Slot& slot = slots_[index(marker, frame)];
    return slot.n == 1 ? &slot.at : nullptr;
  }

 private:
  struct Slot {
    Point at{};
    std::vector<Point> more;  // the other detections
    std::int32_t n = 0;
  };
  std::size_t index(std::int32_t marker, std::int64_t frame) const {
    return static_cast<std::size_t>(marker) * static_cast<std::size_t>(n_frames_) +
           static_cast<std::size_t>(frame - first_);
  }

  std::int64_t first_ = 0, n_frames_ = 0;
  std::vector<Slot> slots_;
};

}  // namespace asterism
