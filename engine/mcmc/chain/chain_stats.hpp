// Statistics of the chains, and diagnostics of their convergence.
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
  // Moves to find the best partition, and to estimate confidence.
  std::int64_t n_search = 0, n_sampled = 0;
  std::int64_t n_walked = 0;    // groups in which chains ran
  std::int64_t n_sure = 0;      // tracks excluded by distance bonds
  std::int64_t n_cut = 0;  // plausible links between different groups, which no chain could use
  // Initial links given by the caller; those that were impossible.
  std::int64_t n_given = 0, n_refused = 0;
  // Detections whose confidence differs by over 0.1 between halves or chains.
  std::int64_t n_disagreements = 0;
  std::int64_t n_unmoved = 0;   // groups whose chains never moved, so that their mixing is unknown
  // Of the log posterior: the largest R̂ and the smallest effective sample size over the groups for
  // which they are defined. NaN if there is no such group.
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
    n_disagreements += next.n_disagreements;
    n_unmoved += next.n_unmoved;
    add_mixing(next.rhat, next.ess);
  }
  void add_moves(const std::array<MoveCounts, kMoves>& next) {
    for (int k = 0; k < kMoves; ++k) moves[k].add(next[k]);
  }
  void add_mixing(double next_rhat, double next_ess) {
    rhat = std::fmax(rhat, next_rhat);  // the other value if one is NaN
    ess = std::fmin(ess, next_ess);
  }
};

// Statistics of a frame, or of many.
struct SampledStats : FrameStats {
  ChainStats chain;

  void add(const SampledStats& next) {
    FrameStats::add(next);
    chain.add(next.chain);
  }
};

}  // namespace asterism
