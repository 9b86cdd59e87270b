// HYPGEN step of Reid's algorithm: generates the best hypotheses about a new frame from those so
// far.
#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>
#include <queue>
#include <span>
#include <utility>
#include <vector>

#include "mht/clusters.hpp"
#include "mht/frame_ways.hpp"
#include "solve/k_best.hpp"

namespace asterism {

class HypothesisGeneration {
 public:
  HypothesisGeneration(const HypothesisWindow& open, const FrameWays& ways,
                       const MatrixOptions& options)
      : open_(open), ways_(ways), opt_(options) {}

  // Replaces the hypotheses of a cluster by their best successors.
  void explain(const WindowFrame& frame, SuperCluster& super, TreeStats& stats) const {
    Cluster& cluster = super.cluster;
    const std::size_t n_old = cluster.keys.size(), n_points = super.columns.size();
    const Cluster before = std::move(cluster);
    cluster = {before.keys, {}};
    // Index of the tree that begins at each detection; -1 if none may.
    std::vector<std::int32_t> seeds(n_points, -1);
    for (std::size_t i = open_.live.size(); i < open_.n_all(); ++i) {
      const LiveTrack<Tree>& tree = open_.tree(i);
      if (tree.more.first != frame.number) continue;
      const std::int32_t j = super.place(ways_[i].branches.front().taken(frame.number));
      if (j < 0) continue;
      seeds[j] = static_cast<std::int32_t>(cluster.keys.size());
      cluster.keys.push_back(tree.more.key);
    }
    std::vector<Parent> parents(before.hypotheses.size());
    // A queue by the weight of each parent's next successor: first an upper bound, then the exact
    // value.
    using Turn = std::pair<double, std::int32_t>;
    const auto later = [](const Turn& a, const Turn& b) {
      return a.first != b.first ? a.first < b.first : a.second > b.second;
    };
    std::priority_queue<Turn, std::vector<Turn>, decltype(later)> turns(later);
    for (std::size_t h = 0; h < parents.size(); ++h) {
      parents[h].hypothesis = &before.hypotheses[h];
      const double max_gain = prepare(frame, super, before, parents[h]);
      turns.emplace(max_gain, static_cast<std::int32_t>(h));
    }
    while (!turns.empty()) {
      const auto [log_weight, h] = turns.top();
      Parent& parent = parents[h];
      if (is_enough(cluster.hypotheses, log_weight, opt_, stats)) break;
      turns.pop();
      if (!parent.best) {
        parent.best.emplace(parent.cost, static_cast<std::int32_t>(n_points),
                            static_cast<std::int32_t>(n_old + n_points));
        if (parent.best->next()) turns.emplace(parent.log_weight(), h);
        continue;
      }
      cluster.hypotheses.push_back(follow(before, parent, seeds, cluster.keys.size()));
      if (parent.best->next()) turns.emplace(parent.log_weight(), h);
    }
    stats.n_groups += 1;
    stats.largest_group = std::max<std::int64_t>(stats.largest_group, cluster.keys.size());
    stats.n_hypotheses = std::max<std::int64_t>(stats.n_hypotheses, cluster.hypotheses.size());
  }

 private:
  // A hypothesis about the past, and its successors in order. In the assignment problem, rows are
  // detections; columns are the trees and, for each detection, the option that no tree takes it.
  struct Parent {
    const Hypothesis* hypothesis = nullptr;
    std::vector<double> cost;
    std::vector<std::int32_t> ways;  // by tree and detection, the continuation that takes it
    double missed = 0;               // its weight if all detections were missed
    std::optional<KBest> best;

    double log_weight() const { return hypothesis->merged + missed - best->current_cost(); }
  };

  // Fills the cost matrix. Returns an upper bound of the weight of the best successor.
  double prepare(const WindowFrame& frame, const SuperCluster& super, const Cluster& before,
                 Parent& parent) const {
    const std::size_t n_old = before.keys.size(), n_points = super.columns.size();
    const std::size_t N = n_old + n_points;
    parent.cost.assign(n_points * N, KBest::kForbidden);
    parent.ways.assign(n_old * n_points, -1);
    std::vector<double> max_gain(n_points, 0);
    for (std::size_t j = 0; j < n_points; ++j) parent.cost[j * N + n_old + j] = 0;
    for (std::size_t k = 0; k < n_old; ++k) {
      const std::int32_t branch = parent.hypothesis->branches[k];
      if (branch < 0) continue;
      const std::size_t i = ways_.index_of(before.keys[k]);
      parent.missed += ways_[i].log_ratio[ways_[i].miss(branch)];
      ways_.each_hit(i, branch, [&](std::int32_t w, double gain) {
        const std::int32_t j = super.place(ways_[i].branches[w].taken(frame.number));
        if (j < 0) return;
        parent.cost[j * N + k] = -gain;
        parent.ways[k * n_points + j] = w;
        max_gain[j] = std::max(max_gain[j], gain);
      });
    }
    double sum = parent.hypothesis->merged + parent.missed;
    for (const double gain : max_gain) sum += gain;
    return sum;
  }

  Hypothesis follow(const Cluster& before, const Parent& parent,
                    std::span<const std::int32_t> seeds, std::size_t n_trees) const {
    const std::size_t n_old = before.keys.size(), n_points = seeds.size();
    Hypothesis child{0, parent.hypothesis->merged, std::vector<std::int32_t>(n_trees, -1)};
    const std::span<const std::int32_t> columns = parent.best->columns();
    for (std::size_t k = 0; k < n_old; ++k) {
      const std::int32_t branch = parent.hypothesis->branches[k];
      if (branch >= 0) child.branches[k] = ways_[ways_.index_of(before.keys[k])].miss(branch);
    }
    for (std::size_t j = 0; j < n_points; ++j) {
      const auto k = static_cast<std::size_t>(columns[j]);
      if (k < n_old)
        child.branches[k] = parent.ways[k * n_points + j];
      else if (seeds[j] >= 0)
        child.branches[seeds[j]] = 0;
    }
    for (std::size_t k = 0; k < n_old; ++k)
      if (child.branches[k] >= 0)
        child.log_ratio += ways_[ways_.index_of(before.keys[k])].log_ratio[child.branches[k]];
    return child;
  }

  const HypothesisWindow& open_;
  const FrameWays& ways_;
  const MatrixOptions& opt_;
};

}  // namespace asterism
