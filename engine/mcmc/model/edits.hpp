// The tracks of a partition, and the edits that change one.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

namespace asterism {

// In the place of a track's number.
inline constexpr std::int32_t kFree = -1;     // in no track
inline constexpr std::int32_t kClutter = -2;  // in none, and settled

struct PartitionTrack {
  std::vector<std::int32_t> nodes;
  std::int32_t n_frozen = 0;
  std::int32_t n_gone = 0;  // detections before the first, which have left the window
  std::int64_t id = -1;     // by which the outside knows it, once something of it is settled

  std::int32_t size() const { return static_cast<std::int32_t>(nodes.size()); }
  std::int32_t whole_size() const { return n_gone + size(); }
  // Place of the last that is settled, from which the rest goes on; 0 where nothing is.
  std::int32_t first_open() const { return std::max(n_frozen - 1, 0); }
};

// What follows in a track after some of its detections are kept.
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

// A track that keeps its first detections and goes on with a tail; a new one has no number.
template <typename Filter>
struct Edit {
  std::int32_t track = -1;
  std::int32_t keep = 0;
  Tail<Filter> tail;
};

}  // namespace asterism
