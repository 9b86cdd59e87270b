// The kinds of moves, and what one of them changes in a partition.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "partition.hpp"

namespace asterism {

enum class Move : std::int32_t {
  birth = 0,      // a free detection and what grows from it become a track
  death,          // a track's detections become free
  split,          // a track becomes two
  merge,          // two tracks become one, the second after the first
  extension,      // a track grows
  reduction,      // a track ends earlier
  update,         // a track ends earlier and grows anew
  switch_tails,   // two tracks change tails
  insertion,      // a free detection goes into, before or after a track
  deletion,       // a detection of a track becomes free
  transfer,       // the tail of a track goes to the end of another
  replacement,    // a free detection stands in for one of a track in the same frame
  exchange,       // two tracks change one detection of the same frame
};
inline constexpr int kMoves = 13;

inline constexpr Move inverse(Move move) {
  switch (move) {
    case Move::birth: return Move::death;
    case Move::death: return Move::birth;
    case Move::split: return Move::merge;
    case Move::merge: return Move::split;
    case Move::extension: return Move::reduction;
    case Move::reduction: return Move::extension;
    case Move::insertion: return Move::deletion;
    case Move::deletion: return Move::insertion;
    default: return move;
  }
}

template <typename Filter>
struct Change {
  Move move = Move::birth;
  std::array<Edit<Filter>, 2> edits;
  std::int32_t n_edits = 0;
  double gain = 0;  // of the log posterior
  double log_forward = 0, log_reverse = 0;
  double log_ratio = 0;  // of Metropolis and Hastings: it is taken with so much probability, at most 1
  std::int32_t with = -1;  // what was drawn on the way: detections kept, or the detection at hand

  std::span<Edit<Filter>> all() { return {edits.data(), static_cast<std::size_t>(n_edits)}; }
  Edit<Filter>& edit(std::int32_t track, std::int32_t keep) {
    Edit<Filter>& e = edits[n_edits++];
    e.track = track;
    e.keep = keep;
    e.tail.clear();
    return e;
  }
};

}  // namespace asterism
