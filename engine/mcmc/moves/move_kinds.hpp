// The kinds of moves of a chain over partitions.
#pragma once

#include <cstdint>

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
  relocation,     // a detection of a track goes into, before or after another
};
inline constexpr int kMoves = 14;

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

struct MoveCounts {
  std::int64_t n_drawn = 0, n_possible = 0, n_taken = 0;

  void add(const MoveCounts& next) {
    n_drawn += next.n_drawn;
    n_possible += next.n_possible;
    n_taken += next.n_taken;
  }
};

}  // namespace asterism
