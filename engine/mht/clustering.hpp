// CLUSTER step of Reid's algorithm: determines which clusters compete for the same detections of a
// new frame.
//
// Every detection gets a dual price. At these prices, the hypotheses of a cluster have one upper
// bound with a given detection and one without it. If the total loss over all clusters is too large
// when a cluster takes the detection, that cluster stays separate.
#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>
#include <map>
#include <utility>
#include <vector>

#include "mht/clusters.hpp"
#include "mht/frame_ways.hpp"
#include "solve/assignment.hpp"

namespace asterism {

class Clustering {
 public:
  Clustering(const FrameWays& ways, const MatrixOptions& options) : ways_(ways), opt_(options) {}

  // Joins clusters that may take the same detection.
  std::vector<SuperCluster> join(std::vector<Cluster> clusters, const WindowFrame& frame,
                                 std::size_t n_trees, TreeStats& stats) {
    const auto n_clusters = static_cast<std::int32_t>(clusters.size());
    const auto n_points = static_cast<std::int32_t>(frame.points.size());
    likeliest_.assign(n_trees, -1);
    for (const Cluster& one : clusters)
      for (std::size_t k = 0; k < one.keys.size(); ++k)
        likeliest_[ways_.index_of(one.keys[k])] = one.hypotheses.front().branches[k];
    set_prices(frame);
    // Smallest loss if a cluster takes a detection: that of its own hypotheses with the detection,
    // plus that of the other clusters without it.
    std::vector<Bounds> bounds;
    std::vector<double> kept_from_others(n_points, 0);
    for (const Cluster& one : clusters) {
      bounds.push_back(bounds_of(one, frame));
      for (const auto& [j, bound] : bounds.back().by_detection)
        kept_from_others[j] += bounds.back().all - bound.without;
    }
    // Items are the clusters first, then the detections.
    const auto sets = connected_sets(n_clusters + n_points, n_points, [&](std::int32_t c, auto&& visit) {
      if (c >= n_clusters) return visit(c - n_clusters);
      for (const auto& [j, bound] : bounds[c].by_detection) {
        const double others = kept_from_others[j] - (bounds[c].all - bound.without);
        if (bounds[c].all - bound.with + others <= opt_.drop) visit(j);
      }
    });
    std::vector<SuperCluster> out;
    for (const std::vector<std::int32_t>& set : sets) {
      SuperCluster& super = out.emplace_back();
      if (set.front() < n_clusters)
        super.cluster = std::move(clusters[set.front()]);
      else
        super.cluster.hypotheses.resize(1);  // the empty hypothesis
      for (const std::int32_t c : set)
        if (c >= n_clusters)
          super.columns.push_back(c - n_clusters);
        else if (c != set.front())
          super.cluster = combined(super.cluster, clusters[c], opt_, stats);
    }
    return out;
  }

 private:
  // Dual prices of the detections of the new frame, given the most likely hypothesis of every
  // cluster.
  void set_prices(const WindowFrame& frame) {
    std::vector<Candidate> wanted;
    for (std::size_t i = 0; i < likeliest_.size(); ++i) {
      if (likeliest_[i] < 0) continue;
      ways_.each_hit(i, likeliest_[i], [&](std::int32_t w, double gain) {
        if (gain > 0)
          wanted.push_back({static_cast<std::int32_t>(i), ways_[i].branches[w].taken(frame.number),
                            gain, 0});
      });
    }
    price_.assign(frame.points.size(), 0);
    std::vector<std::int32_t> match(likeliest_.size(), -1);
    const Groups groups = connected_groups(wanted, static_cast<std::int32_t>(match.size()),
                                           static_cast<std::int32_t>(frame.points.size()));
    for (std::size_t g = 0; g < groups.size(); ++g)
      assignment_.solve(groups[g], match, price_);
  }

  // Upper bounds of the weight of a cluster's hypotheses at these prices: without restriction,
  // without detection j, and with detection j.
  static constexpr double kNever = -std::numeric_limits<double>::infinity();
  struct Bounds {
    struct Either {
      double without = kNever, with = kNever;
    };
    double all = kNever;
    std::map<std::int32_t, Either> by_detection;
  };
  Bounds bounds_of(const Cluster& cluster, const WindowFrame& frame) const {
    // The best and second-best surplus of a tree in a hypothesis.
    struct Surplus {
      double best = 0, next = 0;
      std::int32_t column = -1;
    };
    Bounds bounds;
    for (const std::int64_t key : cluster.keys)
      for (const Branch& b : ways_[ways_.index_of(key)].branches)
        if (b.taken(frame.number) >= 0) bounds.by_detection[b.taken(frame.number)];
    std::vector<Surplus> surplus(cluster.keys.size());
    for (const Hypothesis& h : cluster.hypotheses) {
      double total = h.merged;
      for (std::size_t k = 0; k < cluster.keys.size(); ++k) {
        surplus[k] = {};
        if (h.branches[k] < 0) continue;
        const std::size_t i = ways_.index_of(cluster.keys[k]);
        total += ways_[i].log_ratio[ways_[i].first[h.branches[k] + 1] - 1];
        ways_.each_hit(i, h.branches[k], [&](std::int32_t w, double gain) {
          const std::int32_t j = ways_[i].branches[w].taken(frame.number);
          const double left = gain - price_[j];
          if (left > surplus[k].best)
            surplus[k] = {left, surplus[k].best, j};
          else
            surplus[k].next = std::max(surplus[k].next, left);
        });
        total += surplus[k].best;
      }
      bounds.all = std::max(bounds.all, total);
      // Loss of the other trees if one of them takes detection j.
      std::map<std::int32_t, double> lost;
      for (const Surplus& s : surplus)
        if (s.column >= 0) lost[s.column] += s.best - s.next;
      for (std::size_t k = 0; k < cluster.keys.size(); ++k) {
        if (h.branches[k] < 0) continue;
        const std::size_t i = ways_.index_of(cluster.keys[k]);
        ways_.each_hit(i, h.branches[k], [&](std::int32_t w, double gain) {
          const std::int32_t j = ways_[i].branches[w].taken(frame.number);
          const auto at = lost.find(j);
          const double others = at == lost.end() ? 0 : at->second;
          const double own = surplus[k].column == j ? surplus[k].best - surplus[k].next : 0;
          double& with = bounds.by_detection.at(j).with;
          with = std::max(with, total - surplus[k].best - (others - own) + gain - price_[j]);
        });
      }
      for (auto& [j, bound] : bounds.by_detection) {
        const auto at = lost.find(j);
        bound.without = std::max(bound.without, total - (at == lost.end() ? 0 : at->second));
      }
    }
    return bounds;
  }

  const FrameWays& ways_;
  const MatrixOptions& opt_;
  std::vector<std::int32_t> likeliest_;  // branch of each tree in the most likely hypothesis
  std::vector<double> price_;            // of each detection of the new frame
  Assignment assignment_;
};

}  // namespace asterism
