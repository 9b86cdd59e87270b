// Clusters of trees that compete for detections, and their hypotheses.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <queue>
#include <utility>
#include <vector>

#include "trees/branches.hpp"

namespace asterism {

struct MatrixOptions {
  std::int64_t max_hypotheses = 1;  // of a cluster
  double drop = 0;  // hypotheses this many nats below the best of their cluster are dropped
  // Hypotheses are merged if their estimates differ by at most this many standard deviations.
  double merged_within = 0;
};

struct Hypothesis {
  double log_ratio = 0;   // of its branches
  double merged = 0;  // log factor of the probability gained from merged hypotheses
  // Of each tree of the cluster; -1: its detections belong to others.
  std::vector<std::int32_t> branches;

  double log_weight() const { return log_ratio + merged; }
};

struct Cluster {
  std::vector<std::int64_t> keys;      // of its trees, increasing
  std::vector<Hypothesis> hypotheses;  // the most likely first
};

// A cluster, and the detections of the new frame that it may explain.
struct SuperCluster {
  Cluster cluster;
  std::vector<std::int32_t> columns;  // increasing

  // Index of a detection in `columns`, -1 if it certainly belongs to another cluster.
  std::int32_t place(std::int32_t column) const {
    const auto at = std::ranges::lower_bound(columns, column);
    return at == columns.end() || *at != column ? -1 : static_cast<std::int32_t>(at - columns.begin());
  }
};

inline void sort_by_weight(std::vector<Hypothesis>& hypotheses) {
  std::stable_sort(
      hypotheses.begin(), hypotheses.end(),
      [](const Hypothesis& a, const Hypothesis& b) { return a.log_weight() > b.log_weight(); });
}

inline std::vector<double> probabilities(const Cluster& cluster) {
  std::vector<double> p;
  double sum = 0;
  for (const Hypothesis& h : cluster.hypotheses) {
    p.push_back(std::exp(h.log_weight() - cluster.hypotheses.front().log_weight()));
    sum += p.back();
  }
  for (double& x : p) x /= sum;
  return p;
}

// Whether enough hypotheses were found, if the next one has this weight.
inline bool is_enough(const std::vector<Hypothesis>& found, double next, const MatrixOptions& options,
                      TreeStats& stats) {
  if (found.empty()) return false;
  if (next < found.front().log_weight() - options.drop) return true;
  if (static_cast<std::int64_t>(found.size()) < options.max_hypotheses) return false;
  ++stats.n_limited;
  stats.bound = std::max(stats.bound, std::exp(next - found.front().log_weight()));
  return true;
}

// The best combinations of the hypotheses of two clusters.
inline Cluster combined(const Cluster& a, const Cluster& b, const MatrixOptions& options,
                        TreeStats& stats) {
  Cluster out;
  std::vector<std::pair<std::int64_t, std::int32_t>> order;  // key, index in a then b
  for (const auto* part : {&a, &b})
    for (const std::int64_t key : part->keys)
      order.emplace_back(key, static_cast<std::int32_t>(order.size()));
  std::sort(order.begin(), order.end());
  for (const auto& [key, place] : order) out.keys.push_back(key);
  struct Pairing {
    double log_weight;
    std::size_t first, second;
    bool operator<(const Pairing& o) const {
      return log_weight != o.log_weight ? log_weight < o.log_weight
                                        : std::pair(first, second) > std::pair(o.first, o.second);
    }
  };
  std::priority_queue<Pairing> queue;
  const auto offer = [&](std::size_t g, std::size_t h) {
    if (g < a.hypotheses.size() && h < b.hypotheses.size())
      queue.push({a.hypotheses[g].log_weight() + b.hypotheses[h].log_weight(), g, h});
  };
  offer(0, 0);
  while (!queue.empty() && !is_enough(out.hypotheses, queue.top().log_weight, options, stats)) {
    const auto [log_weight, g, h] = queue.top();
    queue.pop();
    offer(g, h + 1);
    if (h == 0) offer(g + 1, 0);
    const Hypothesis &one = a.hypotheses[g], &other = b.hypotheses[h];
    Hypothesis both{one.log_ratio + other.log_ratio, one.merged + other.merged, {}};
    for (const auto& [key, place] : order)
      both.branches.push_back(static_cast<std::size_t>(place) < a.keys.size()
                                  ? one.branches[place]
                                  : other.branches[place - a.keys.size()]);
    out.hypotheses.push_back(std::move(both));
  }
  return out;
}

}  // namespace asterism
