// The tracks of a partition, and the edits that change a track.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

namespace asterism {

// Special values of the track of a detection.
inline constexpr std::int32_t kFree = -1;     // in no track
inline constexpr std::int32_t kClutter = -2;  // in no track, and settled

struct PartitionTrack {
  std::vector<std::int32_t> nodes;
  std::int32_t n_frozen = 0;
  std::int32_t n_gone = 0;  // detections before the first that have left the window
  std::int32_t marker = -1;  // of which it is, once its first detection is settled
  std::int64_t id = -1;     // public label, once part of the track is settled
  std::int64_t stamp = 0;   // changes with the track; see Partition::clock

  std::int32_t size() const { return static_cast<std::int32_t>(nodes.size()); }
  std::int32_t whole_size() const { return n_gone + size(); }
  // Index of the last settled detection, after which the track may change; 0 if none is settled.
  std::int32_t first_open() const { return std::max(n_frozen - 1, 0); }
};

// The part of a track after the detections that an edit keeps. The first of its detections have
// filter states and scores, in order; those after them are planned.
template <typename Filter>
struct Tail {
  std::vector<std::int32_t> nodes;
  std::vector<typename Filter::State> states;
  std::vector<double> scores;

  void clear() {
    nodes.clear();
    states.clear();
    scores.clear();
  }
};

// An edit: a track keeps its first detections and continues with a tail. A new track has the number
// -1.
template <typename Filter>
struct Edit {
  std::int32_t track = -1;
  std::int32_t keep = 0;
  Tail<Filter> tail;

  // Empties the edit and keeps its memory.
  void clear() {
    track = -1;
    keep = 0;
    tail.clear();
  }
};

}  // namespace asterism
