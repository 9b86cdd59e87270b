// What a walk over partitions did, and whether it agrees with itself.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>

#include "mcmc/moves/move_kinds.hpp"
#include "tracks/live_tracks.hpp"

namespace asterism {

struct ChainStats {
  std::array<MoveCounts, kMoves> moves{};
  std::int64_t n_search = 0, n_sampled = 0;  // moves for the best partition, and for confidence
  std::int64_t n_walked = 0;    // groups that were walked over, of all that were looked at
  std::int64_t n_sure = 0;      // tracks that distance bonds kept out
  std::int64_t n_cut = 0;       // plausible links between different groups, which none could take
  std::int64_t n_given = 0, n_refused = 0;  // links to start from; that the model or others forbade
  std::int64_t n_doubtful = 0;  // detections of whose label halves or chains differ by over 0.1
  std::int64_t n_unmoved = 0;   // groups whose chains never moved, so that their mixing is not known
  // Of the log posterior: the largest R̂ and the smallest effective sample size of the groups for which
  // they are known. NaN where they are known for none.
  double rhat = std::numeric_limits<double>::quiet_NaN();
  double ess = std::numeric_limits<double>::quiet_NaN();

  void add(const ChainStats& next) {
    add_moves(next.moves);
    n_search += next.n_search;
    n_sampled += next.n_sampled;
    n_walked += next.n_walked;
    n_sure += next.n_sure;
    n_cut += next.n_cut;
    n_given += next.n_given;
    n_refused += next.n_refused;
    n_doubtful += next.n_doubtful;
    n_unmoved += next.n_unmoved;
    add_mixing(next.rhat, next.ess);
  }
  void add_moves(const std::array<MoveCounts, kMoves>& next) {
    for (int k = 0; k < kMoves; ++k) moves[k].add(next[k]);
  }
  void add_mixing(double next_rhat, double next_ess) {
    rhat = std::fmax(rhat, next_rhat);  // the other where one is NaN
    ess = std::fmin(ess, next_ess);
  }
};

// What a frame, or a run of them, took in all.
struct SampledStats : FrameStats {
  ChainStats chain;

  void add(const SampledStats& next) {
    FrameStats::add(next);
    chain.add(next.chain);
  }
};

}  // namespace asterism
