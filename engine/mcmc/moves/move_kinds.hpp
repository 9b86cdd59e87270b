// The kinds of moves of a Markov chain over partitions.
#pragma once

#include <cstdint>

namespace asterism {

enum class Move : std::int32_t {
  birth = 0,      // a free detection and its growth become a track
  death,          // all detections of a track become free
  split,          // a track becomes two
  merge,          // a track is appended to another
  extension,      // a track grows
  reduction,      // a track is shortened
  update,         // a track is shortened and grows again
  switch_tails,   // two tracks exchange their tails
  insertion,      // a free detection is inserted into, before or after a track
  deletion,       // a detection of a track becomes free
  transfer,       // the tail of a track moves to the end of another
  replacement,    // a free detection replaces a detection of a track in the same frame
  exchange,       // two tracks exchange one detection of the same frame
  relocation,     // a detection of a track moves into, before or after another
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
