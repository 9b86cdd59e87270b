// The best hypotheses of a cluster of trees, none of which uses a detection twice.
#pragma once

#include <algorithm>
#include <cstdint>
#include <functional>
#include <numeric>
#include <span>
#include <vector>

#include "solve/set_packing.hpp"
#include "trees/tree_stats.hpp"

namespace asterism {

// The option of each tree in the first hypothesis, then in the second and so on, and the log ratio
// of each hypothesis. The best is first, and none is more than `drop` below it.
struct BestHypotheses {
  std::vector<std::int32_t> chosen;
  std::vector<double> totals;
};

// Those of a tree that shares no detection with another: its options.
inline BestHypotheses best_options(std::span<const PackingOption> options, std::int64_t n_max,
                                   double drop) {
  BestHypotheses out;
  out.chosen.resize(options.size());
  std::iota(out.chosen.begin(), out.chosen.end(), 0);
  const auto weight = [&](std::int32_t o) { return options[o].log_weight; };
  std::ranges::stable_sort(out.chosen, std::greater{}, weight);
  for (const std::int32_t o : out.chosen) {
    const bool is_full = static_cast<std::int64_t>(out.totals.size()) == n_max;
    if (is_full || weight(o) < weight(out.chosen.front()) - drop) break;
    out.totals.push_back(weight(o));
  }
  out.chosen.resize(out.totals.size());
  return out;
}

// Those of several trees. The search ends after `max_nodes` nodes, with one hypothesis.
inline BestHypotheses best_packings(std::span<const std::vector<PackingOption>> trees,
                                    std::int64_t n_max, double drop, std::int64_t max_nodes,
                                    TreeStats& stats) {
  BestHypotheses out;
  const PackingSummary summary = SetPacking(trees).solve(
      n_max, drop, max_nodes, [&](std::span<const std::int32_t> own, double log_ratio) {
        out.chosen.insert(out.chosen.end(), own.begin(), own.end());
        out.totals.push_back(log_ratio);
      });
  stats.n_nodes += summary.n_nodes;
  if (!summary.is_exact && out.totals.size() == 1) {
    ++stats.n_beams;
    stats.gap = std::max(stats.gap, summary.bound - out.totals.front());
  }
  return out;
}

}  // namespace asterism
