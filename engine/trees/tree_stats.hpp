// Statistics of the trackers whose tracks are trees of branches.
#pragma once

#include <algorithm>
#include <cstdint>

#include "tracks/live_tracks.hpp"

namespace asterism {

struct TreeStats : FrameStats {
  // Branches at the end; largest number in a tree; cut by the χ² test; dropped by the limit on
  // their number.
  std::int64_t n_branches = 0, peak_branches = 0, n_cut = 0, n_limited = 0;
  std::int64_t n_shared = 0;  // detections that are the best choice of several trees
  std::int64_t n_beams = 0;   // groups that were not solved exactly
  double bound = 0, gap = 0;  // bounds of the error of their marginals and of their log posterior
  // Joint hypotheses: largest number of a cluster, merged into a similar one, nodes of the search.
  std::int64_t n_hypotheses = 0, n_merged = 0, n_nodes = 0;

  void add(const TreeStats& next) {
    FrameStats::add(next);
    add_tree_work(next);
    n_branches = next.n_branches;
  }
  void add_work(const TreeStats& next) {
    FrameStats::add_work(next);
    add_tree_work(next);
  }

 private:
  void add_tree_work(const TreeStats& next) {
    peak_branches = std::max(peak_branches, next.peak_branches);
    n_cut += next.n_cut;
    n_limited += next.n_limited;
    n_shared += next.n_shared;
    n_beams += next.n_beams;
    bound = std::max(bound, next.bound);
    gap = std::max(gap, next.gap);
    n_hypotheses = std::max(n_hypotheses, next.n_hypotheses);
    n_merged += next.n_merged;
    n_nodes += next.n_nodes;
  }
};

}  // namespace asterism
