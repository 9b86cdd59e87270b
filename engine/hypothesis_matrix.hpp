// Reid's multiple hypotheses (1979): whole hypotheses carried from frame to frame, by cluster.
//
//   CLUSTER  which clusters may have one and the same detection; these become one (a super-cluster)
//   HYPGEN   the best hypotheses about the new frame, of all that follow from those so far
//   REDUCE   few, likely and different ones are kept; what is older than the window is decided by the
//            best (N-scan); what shares no detection any more goes into clusters of its own
//   MASH     detections of which all hypotheses say the same leave the matrix: their targets have them
//            for good, and tentative targets are confirmed by them
//
// A detection that is nobody's begins a tree at once, worth nothing as long as it has no other
// detection: “clutter so far” and “may be the first of a marker” are one hypothesis, not two.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <queue>
#include <span>
#include <utility>
#include <vector>

#include "assignment.hpp"
#include "fresh.hpp"
#include "hypothesis_window.hpp"
#include "k_best.hpp"
#include "union_find.hpp"

namespace asterism {

struct MatrixOptions {
  std::int64_t max_hypotheses = 1;  // of a cluster
  double drop = 0;                  // one so many nats below its cluster's best is not kept
  double merged_within = 0;         // estimates so few standard deviations apart are as good as one
};

struct Hypothesis {
  double worth = 0;   // of its branches
  double merged = 0;  // log of how much likelier it is by those that were merged into it
  std::vector<std::int32_t> branches;  // of each tree of the cluster; -1: its detections are others'

  double log_weight() const { return worth + merged; }
};

struct Cluster {
  std::vector<std::int64_t> keys;      // of its trees, rising
  std::vector<Hypothesis> hypotheses;  // the likeliest first
};

class HypothesisMatrix {
 public:
  HypothesisMatrix(const MotionModel& model, const ScoreModel& score, const LifeOptions& life,
                   const BranchOptions& branches, double new_track_claim,
                   const MatrixOptions& options)
      : open_{{{model, score, life}, branches, {}}, new_track_claim, {}}, opt_(options) {}

  template <typename Label>
  void add(std::shared_ptr<WindowFrame> frame, FrameStats& stats, Label&& label) {
    frame->claimed.assign(frame->points.size(), 0);
    open_.claim(*frame);
    open_.frames.push_back(frame);
    grow(*frame, stats);
    std::vector<Cluster> clusters;
    for (SuperCluster& super : cluster(*frame, stats)) {
      hypgen(*frame, super, stats);
      merge_similar(super.cluster, stats);
      clusters.push_back(std::move(super.cluster));
    }
    clusters_ = std::move(clusters);
    for (std::size_t i = 0; i < open_.n_all(); ++i)
      open_.tree(i).more.branches = std::move(s_.ways[i].branches);
    keep_used_branches();
    for (std::size_t i = 0; i < open_.n_all(); ++i)
      stats.most_branches = std::max<std::int64_t>(
          stats.most_branches, static_cast<std::int64_t>(open_.tree(i).more.branches.size()));
    if (open_.is_full()) {
      weigh(1);
      prune_by_oldest();
      mash(stats, label);
    }
    split();
  }

  // Decides all frames that are left by the best hypothesis of every cluster; all probabilities are
  // those over the hypotheses as they are now.
  template <typename Label>
  void decide_all(FrameStats& stats, Label&& label) {
    list_keys();
    weigh(open_.frames.size());
    while (open_.n_open() > 0) mash(stats, label);
  }

  bool has_confidence() const { return true; }
  const LiveTracks<Tree>& live() const { return open_.live; }
  const HypothesisWindow& window() const { return open_; }
  const std::vector<Cluster>& clusters() const { return clusters_; }
  void count(FrameStats& stats) const { open_.count(stats); }

 private:
  struct SuperCluster {
    Cluster cluster;
    std::vector<std::int32_t> columns;  // the detections of the frame that it explains
  };

  // The ways of a tree's branches over the new frame: of branch b, from first[b] to first[b + 1], the
  // miss last.
  struct Ways {
    std::vector<Branch> branches;
    std::vector<std::int32_t> first;
    std::vector<double> worth;  // of each way; 0 of a single detection
  };

  struct Memory {
    std::vector<std::int64_t> keys;  // of all trees
    std::vector<Ways> ways;
    std::vector<std::int32_t> likeliest;  // branch of each tree in the likeliest hypothesis
    std::vector<double> price;            // of each detection of the new frame
    Assignment assignment;
    // By open frame and tree: what the best hypothesis says, and the probability of each detection
    // to be nobody's.
    std::vector<std::map<std::int64_t, Fate>> fates;
    std::vector<std::vector<double>> free;
  };

  void list_keys() {
    s_.keys.clear();
    for (std::size_t i = 0; i < open_.n_all(); ++i) s_.keys.push_back(open_.tree(i).more.key);
  }
  std::size_t index_of(std::int64_t key) const {
    return std::lower_bound(s_.keys.begin(), s_.keys.end(), key) - s_.keys.begin();
  }

  // A tree is something to explain from its second detection on.
  static bool is_lone(const Branch& b, bool is_seed) { return is_seed && b.n_taken < 2; }

  void grow(const WindowFrame& frame, FrameStats& stats) {
    const BranchGrower grower(open_.live, open_.branches);
    s_.ways.assign(open_.n_all(), {});
    for (std::size_t i = 0; i < open_.n_all(); ++i) {
      LiveTrack<Tree>& tree = open_.tree(i);
      Ways& ways = s_.ways[i];
      ways.first.push_back(0);
      for (Branch& parent : tree.more.branches) {
        grower.split(frame, tree, std::move(parent), ways.branches, stats);
        ways.first.push_back(static_cast<std::int32_t>(ways.branches.size()));
      }
      for (const Branch& b : ways.branches)
        ways.worth.push_back(is_lone(b, open_.is_seed(i)) ? 0 : grower.worth(b));
    }
    open_.sow();
    for (std::size_t i = s_.ways.size(); i < open_.n_all(); ++i)
      s_.ways.push_back({open_.tree(i).more.branches, {0, 1}, {0}});
    list_keys();
  }

  // Calls visit(way, gain over the miss) for what a branch may take.
  template <typename Visit>
  void each_hit(std::size_t tree, std::int32_t branch, Visit&& visit) const {
    const Ways& ways = s_.ways[tree];
    const std::int32_t miss = ways.first[branch + 1] - 1;
    for (std::int32_t w = ways.first[branch]; w < miss; ++w)
      visit(w, ways.worth[w] - ways.worth[miss]);
  }

  // Prices of the new frame's detections, were the likeliest hypothesis of every cluster right.
  void set_prices(const WindowFrame& frame) {
    std::vector<Candidate> wanted;
    for (std::size_t i = 0; i < s_.likeliest.size(); ++i) {
      if (s_.likeliest[i] < 0) continue;
      each_hit(i, s_.likeliest[i], [&](std::int32_t w, double gain) {
        if (gain > 0)
          wanted.push_back({static_cast<std::int32_t>(i), s_.ways[i].branches[w].taken(frame.number),
                            gain, 0});
      });
    }
    s_.price.assign(frame.points.size(), 0);
    std::vector<std::int32_t> match(s_.likeliest.size(), -1);
    const Groups groups = connected_groups(wanted, static_cast<std::int32_t>(match.size()),
                                           static_cast<std::int32_t>(frame.points.size()));
    for (std::size_t g = 0; g < groups.size(); ++g)
      s_.assignment.solve(groups[g], match, s_.price);
  }

  // What a cluster's hypotheses are worth at most at these prices, by what they may take of the frame:
  // all of it, not detection j, or surely detection j.
  static constexpr double kNever = -std::numeric_limits<double>::infinity();
  struct Bounds {
    struct Either {
      double without = kNever, with = kNever;
    };
    double all = kNever;
    std::map<std::int32_t, Either> by_detection;
  };
  Bounds bounds_of(const Cluster& cluster, const WindowFrame& frame) const {
    // Of a tree in a hypothesis, the best and the next best that it may take.
    struct Surplus {
      double best = 0, next = 0;
      std::int32_t column = -1;
    };
    Bounds bounds;
    for (const std::int64_t key : cluster.keys)
      for (const Branch& b : s_.ways[index_of(key)].branches)
        if (b.taken(frame.number) >= 0) bounds.by_detection[b.taken(frame.number)];
    std::vector<Surplus> surplus(cluster.keys.size());
    for (const Hypothesis& h : cluster.hypotheses) {
      double total = h.merged;
      for (std::size_t k = 0; k < cluster.keys.size(); ++k) {
        surplus[k] = {};
        if (h.branches[k] < 0) continue;
        const std::size_t i = index_of(cluster.keys[k]);
        total += s_.ways[i].worth[s_.ways[i].first[h.branches[k] + 1] - 1];
        each_hit(i, h.branches[k], [&](std::int32_t w, double gain) {
          const std::int32_t j = s_.ways[i].branches[w].taken(frame.number);
          const double left = gain - s_.price[j];
          if (left > surplus[k].best)
            surplus[k] = {left, surplus[k].best, j};
          else
            surplus[k].next = std::max(surplus[k].next, left);
        });
        total += surplus[k].best;
      }
      bounds.all = std::max(bounds.all, total);
      // What the others lose where one takes detection j.
      std::map<std::int32_t, double> lost;
      for (const Surplus& s : surplus)
        if (s.column >= 0) lost[s.column] += s.best - s.next;
      for (std::size_t k = 0; k < cluster.keys.size(); ++k) {
        if (h.branches[k] < 0) continue;
        const std::size_t i = index_of(cluster.keys[k]);
        each_hit(i, h.branches[k], [&](std::int32_t w, double gain) {
          const std::int32_t j = s_.ways[i].branches[w].taken(frame.number);
          const auto at = lost.find(j);
          const double others = at == lost.end() ? 0 : at->second;
          const double own = surplus[k].column == j ? surplus[k].best - surplus[k].next : 0;
          double& with = bounds.by_detection.at(j).with;
          with = std::max(with, total - surplus[k].best - (others - own) + gain - s_.price[j]);
        });
      }
      for (auto& [j, bound] : bounds.by_detection) {
        const auto at = lost.find(j);
        bound.without = std::max(bound.without, total - (at == lost.end() ? 0 : at->second));
      }
    }
    return bounds;
  }

  // CLUSTER
  std::vector<SuperCluster> cluster(const WindowFrame& frame, FrameStats& stats) {
    const auto n_clusters = static_cast<std::int32_t>(clusters_.size());
    const auto n_points = static_cast<std::int32_t>(frame.points.size());
    s_.likeliest.assign(open_.n_all(), -1);
    for (const Cluster& one : clusters_)
      for (std::size_t k = 0; k < one.keys.size(); ++k)
        s_.likeliest[index_of(one.keys[k])] = one.hypotheses.front().branches[k];
    set_prices(frame);
    // What it costs at least that a cluster has a detection: its own hypotheses with it are worth so
    // much less, and so are those of the others without.
    std::vector<Bounds> bounds;
    std::vector<double> kept_from_others(n_points, 0);
    for (const Cluster& one : clusters_) {
      bounds.push_back(bounds_of(one, frame));
      for (const auto& [j, bound] : bounds.back().by_detection)
        kept_from_others[j] += bounds.back().all - bound.without;
    }
    UnionFind sets(static_cast<std::size_t>(n_clusters) + n_points);
    for (std::int32_t c = 0; c < n_clusters; ++c)
      for (const auto& [j, bound] : bounds[c].by_detection) {
        const double others = kept_from_others[j] - (bounds[c].all - bound.without);
        if (bounds[c].all - bound.with + others <= opt_.drop) sets.join(c, n_clusters + j);
      }
    std::map<std::int32_t, SuperCluster> super;
    for (std::int32_t c = 0; c < n_clusters; ++c) {
      const auto [at, is_new] = super.try_emplace(sets.find(c));
      at->second.cluster =
          is_new ? std::move(clusters_[c]) : combined(at->second.cluster, clusters_[c], stats);
    }
    for (std::int32_t j = 0; j < n_points; ++j) {
      const auto [at, is_new] = super.try_emplace(sets.find(n_clusters + j));
      if (is_new) at->second.cluster.hypotheses.resize(1);  // that there is nothing so far
      at->second.columns.push_back(j);
    }
    std::vector<SuperCluster> out;
    for (auto& [root, one] : super) out.push_back(std::move(one));
    return out;
  }

  bool is_enough(const std::vector<Hypothesis>& found, double next, FrameStats& stats) const {
    if (found.empty()) return false;
    if (next < found.front().log_weight() - opt_.drop) return true;
    if (static_cast<std::int64_t>(found.size()) < opt_.max_hypotheses) return false;
    ++stats.n_limited;
    stats.bound = std::max(stats.bound, std::exp(next - found.front().log_weight()));
    return true;
  }

  // The best of all pairs of hypotheses of two clusters.
  Cluster combined(const Cluster& a, const Cluster& b, FrameStats& stats) const {
    Cluster out;
    std::vector<std::pair<std::int64_t, std::int32_t>> order;  // key, place in a then b
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
    while (!queue.empty() && !is_enough(out.hypotheses, queue.top().log_weight, stats)) {
      const auto [log_weight, g, h] = queue.top();
      queue.pop();
      offer(g, h + 1);
      if (h == 0) offer(g + 1, 0);
      const Hypothesis &one = a.hypotheses[g], &other = b.hypotheses[h];
      Hypothesis both{one.worth + other.worth, one.merged + other.merged, {}};
      for (const auto& [key, place] : order)
        both.branches.push_back(static_cast<std::size_t>(place) < a.keys.size()
                                    ? one.branches[place]
                                    : other.branches[place - a.keys.size()]);
      out.hypotheses.push_back(std::move(both));
    }
    return out;
  }

  // A hypothesis about what was, and the best ones in turn about who has what in the new frame: rows
  // are the detections, columns its trees and for each detection that nobody has it.
  struct Parent {
    const Hypothesis* hypothesis = nullptr;
    std::vector<double> cost;
    std::vector<std::int32_t> ways;  // by tree and detection, the way that takes it
    double missed = 0;               // its worth were all missed
    std::optional<KBest> best;

    double log_weight() const { return hypothesis->merged + missed - best->least_cost(); }
  };

  // HYPGEN
  void hypgen(const WindowFrame& frame, SuperCluster& super, FrameStats& stats) const {
    Cluster& cluster = super.cluster;
    const std::size_t n_old = cluster.keys.size(), n_points = super.columns.size();
    const Cluster before = std::move(cluster);
    cluster = {before.keys, {}};
    // The place of the tree that begins at each detection; -1 where none may.
    std::vector<std::int32_t> seeds(n_points, -1);
    for (std::size_t i = open_.live.size(); i < open_.n_all(); ++i) {
      const LiveTrack<Tree>& tree = open_.tree(i);
      if (tree.more.first != frame.number) continue;
      const std::int32_t j = s_.ways[i].branches.front().taken(frame.number);
      const auto at = std::lower_bound(super.columns.begin(), super.columns.end(), j);
      if (at == super.columns.end() || *at != j) continue;
      seeds[at - super.columns.begin()] = static_cast<std::int32_t>(cluster.keys.size());
      cluster.keys.push_back(tree.more.key);
    }
    std::vector<Parent> parents(before.hypotheses.size());
    // Sorted by what the next hypothesis of each would be worth, first at most, then exactly.
    using Turn = std::pair<double, std::int32_t>;
    const auto later = [](const Turn& a, const Turn& b) {
      return a.first != b.first ? a.first < b.first : a.second > b.second;
    };
    std::priority_queue<Turn, std::vector<Turn>, decltype(later)> turns(later);
    for (std::size_t h = 0; h < parents.size(); ++h) {
      parents[h].hypothesis = &before.hypotheses[h];
      const double most = prepare(frame, super, before, parents[h]);
      turns.emplace(most, static_cast<std::int32_t>(h));
    }
    while (!turns.empty()) {
      const auto [log_weight, h] = turns.top();
      Parent& parent = parents[h];
      if (is_enough(cluster.hypotheses, log_weight, stats)) break;
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

  // Fills in the costs; returns what the hypothesis' best successor is worth at most.
  double prepare(const WindowFrame& frame, const SuperCluster& super, const Cluster& before,
                 Parent& parent) const {
    const std::size_t n_old = before.keys.size(), n_points = super.columns.size();
    const std::size_t N = n_old + n_points;
    parent.cost.assign(n_points * N, KBest::kForbidden);
    parent.ways.assign(n_old * n_points, -1);
    std::vector<double> most(n_points, 0);
    for (std::size_t j = 0; j < n_points; ++j) parent.cost[j * N + n_old + j] = 0;
    for (std::size_t k = 0; k < n_old; ++k) {
      const std::int32_t branch = parent.hypothesis->branches[k];
      if (branch < 0) continue;
      const std::size_t i = index_of(before.keys[k]);
      parent.missed += s_.ways[i].worth[s_.ways[i].first[branch + 1] - 1];
      each_hit(i, branch, [&](std::int32_t w, double gain) {
        const std::int32_t column = s_.ways[i].branches[w].taken(frame.number);
        const auto at = std::lower_bound(super.columns.begin(), super.columns.end(), column);
        if (at == super.columns.end() || *at != column) return;  // surely another cluster's
        const auto j = static_cast<std::size_t>(at - super.columns.begin());
        parent.cost[j * N + k] = -gain;
        parent.ways[k * n_points + j] = w;
        most[j] = std::max(most[j], gain);
      });
    }
    double sum = parent.hypothesis->merged + parent.missed;
    for (const double gain : most) sum += gain;
    return sum;
  }

  Hypothesis follow(const Cluster& before, const Parent& parent,
                    std::span<const std::int32_t> seeds, std::size_t n_trees) const {
    const std::size_t n_old = before.keys.size(), n_points = seeds.size();
    Hypothesis child{0, parent.hypothesis->merged, std::vector<std::int32_t>(n_trees, -1)};
    const std::span<const std::int32_t> columns = parent.best->columns();
    for (std::size_t k = 0; k < n_old; ++k) {
      const std::int32_t branch = parent.hypothesis->branches[k];
      if (branch >= 0) child.branches[k] = s_.ways[index_of(before.keys[k])].first[branch + 1] - 1;
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
        child.worth += s_.ways[index_of(before.keys[k])].worth[child.branches[k]];
    return child;
  }

  // REDUCE, the similar: a hypothesis of the same targets, each nearly where a likelier one has it,
  // is part of that one from now on.
  void merge_similar(Cluster& cluster, FrameStats& stats) const {
    if (!(opt_.merged_within > 0)) return;
    std::vector<Hypothesis> kept;
    for (Hypothesis& h : cluster.hypotheses) {
      const auto same = std::find_if(kept.begin(), kept.end(), [&](const Hypothesis& likelier) {
        return is_similar(cluster, likelier, h);
      });
      if (same == kept.end()) {
        kept.push_back(std::move(h));
        continue;
      }
      same->merged += std::log1p(std::exp(h.log_weight() - same->log_weight()));
      ++stats.n_merged;
    }
    sort(kept);
    cluster.hypotheses = std::move(kept);
  }

  bool is_similar(const Cluster& cluster, const Hypothesis& a, const Hypothesis& b) const {
    for (std::size_t k = 0; k < cluster.keys.size(); ++k) {
      if (a.branches[k] == b.branches[k]) continue;
      const std::size_t i = index_of(cluster.keys[k]);
      const auto branch_of = [&](const Hypothesis& h) -> const Branch* {
        if (h.branches[k] < 0) return nullptr;
        const Branch& branch = s_.ways[i].branches[h.branches[k]];
        return is_lone(branch, open_.is_seed(i)) ? nullptr : &branch;
      };
      const Branch *one = branch_of(a), *other = branch_of(b);
      if (!one && !other) continue;
      if (!one || !other || one->gap != other->gap || !is_near(*one, *other)) return false;
    }
    return true;
  }

  // Means within so many standard deviations of the first, and deviations as much alike.
  bool is_near(const Branch& a, const Branch& b) const {
    const AxisState one = collapse(open_.live.m, a.state), other = collapse(open_.live.m, b.state);
    const int n = open_.live.m.axis.n;
    for (int s = 0; s < n; ++s) {
      const double sigma = std::sqrt(one.P[s * n + s]);
      const double bound = opt_.merged_within * sigma;
      if (!(std::abs(std::sqrt(other.P[s * n + s]) - sigma) <= bound)) return false;
      for (int d = 0; d < open_.live.m.axis.D; ++d)
        if (!(std::abs(other.x[d][s] - one.x[d][s]) <= bound)) return false;
    }
    return true;
  }

  static void sort(std::vector<Hypothesis>& hypotheses) {
    std::stable_sort(
        hypotheses.begin(), hypotheses.end(),
        [](const Hypothesis& a, const Hypothesis& b) { return a.log_weight() > b.log_weight(); });
  }

  // Every tree keeps the branches that some hypothesis takes, those of the likeliest first.
  void keep_used_branches() {
    for (Cluster& cluster : clusters_)
      for (std::size_t k = 0; k < cluster.keys.size(); ++k) {
        std::vector<Branch>& all = open_.tree(index_of(cluster.keys[k])).more.branches;
        std::vector<std::int32_t> place(all.size(), -1);
        std::vector<Branch> kept;
        for (Hypothesis& h : cluster.hypotheses) {
          std::int32_t& b = h.branches[k];
          if (b < 0) continue;
          if (place[b] < 0) {
            place[b] = static_cast<std::int32_t>(kept.size());
            kept.push_back(std::move(all[b]));
          }
          b = place[b];
        }
        all = std::move(kept);
      }
  }

  // What the hypotheses say of the first open frames.
  void weigh(std::size_t n_frames) {
    s_.fates.assign(n_frames, {});
    s_.free.assign(n_frames, {});
    for (std::size_t f = 0; f < n_frames; ++f) {
      const WindowFrame& frame = *open_.frames[f];
      s_.free[f].assign(frame.points.size(), 1);
      for (const Cluster& cluster : clusters_) {
        const std::vector<double> p = probabilities(cluster);
        for (std::size_t k = 0; k < cluster.keys.size(); ++k) {
          const std::size_t i = index_of(cluster.keys[k]);
          Fate fate = fate_of(i, cluster.hypotheses.front().branches[k], frame);
          for (std::size_t h = 0; h < p.size(); ++h) {
            const Fate other = fate_of(i, cluster.hypotheses[h].branches[k], frame);
            if (!other.exists) continue;
            if (fate.column == other.column) fate.probability += p[h];
            if (other.column >= 0) s_.free[f][other.column] -= p[h];
          }
          fate.probability = std::min(fate.probability, 1.0);
          s_.fates[f].emplace(cluster.keys[k], fate);
        }
      }
    }
  }

  Fate fate_of(std::size_t tree, std::int32_t branch, const WindowFrame& frame) const {
    if (branch < 0) return {};
    const Branch& b = open_.tree(tree).more.branches[branch];
    if (is_lone(b, open_.is_seed(tree)) || frame.number < open_.first_frame(tree)) return {};
    return {true, b.taken(frame.number), 0};
  }

  static std::vector<double> probabilities(const Cluster& cluster) {
    std::vector<double> p;
    double sum = 0;
    for (const Hypothesis& h : cluster.hypotheses) {
      p.push_back(std::exp(h.log_weight() - cluster.hypotheses.front().log_weight()));
      sum += p.back();
    }
    for (double& x : p) x /= sum;
    return p;
  }

  // REDUCE, N-scan: who says otherwise of the oldest frame than the likeliest is given up.
  void prune_by_oldest() {
    const WindowFrame& frame = *open_.frames.front();
    for (Cluster& cluster : clusters_)
      std::erase_if(cluster.hypotheses, [&](const Hypothesis& h) {
        for (std::size_t k = 0; k < cluster.keys.size(); ++k) {
          const std::size_t i = index_of(cluster.keys[k]);
          const Fate best = s_.fates[0].at(cluster.keys[k]);
          const Fate own = fate_of(i, h.branches[k], frame);
          if (own.column != best.column) return true;
        }
        return false;
      });
    keep_used_branches();
  }

  // MASH
  template <typename Label>
  void mash(FrameStats& stats, Label&& label) {
    std::vector<Fate> fates;
    for (std::size_t i = 0; i < open_.n_all(); ++i) {
      const auto at = s_.fates.front().find(open_.tree(i).more.key);
      fates.push_back(at == s_.fates.front().end() ? Fate{} : at->second);
    }
    open_.carry_out(fates, s_.free.front(), stats, label);
    s_.fates.erase(s_.fates.begin());
    s_.free.erase(s_.free.begin());
    list_keys();
  }

  // REDUCE, apart: trees that share no detection in any hypothesis are clusters of their own.
  void split() {
    const BranchGrower grower(open_.live, open_.branches);
    std::vector<Cluster> clusters;
    for (const Cluster& cluster : clusters_) {
      std::vector<std::size_t> alive;  // places of the trees that are left
      for (std::size_t k = 0; k < cluster.keys.size(); ++k) {
        const std::size_t i = index_of(cluster.keys[k]);
        if (i < s_.keys.size() && s_.keys[i] == cluster.keys[k] &&
            !open_.tree(i).more.branches.empty())
          alive.push_back(k);
      }
      UnionFind sets(alive.size());
      std::map<std::pair<std::int64_t, std::int32_t>, std::int32_t> owner;
      for (std::size_t a = 0; a < alive.size(); ++a) {
        const std::size_t i = index_of(cluster.keys[alive[a]]);
        for (const Branch& b : open_.tree(i).more.branches)
          for (const auto& frame : open_.frames) {
            const std::int32_t j = b.taken(frame->number);
            if (frame->number < open_.first_frame(i) || j < 0) continue;
            const auto own = static_cast<std::int32_t>(a);
            sets.join(owner.try_emplace({frame->number, j}, own).first->second, own);
          }
      }
      std::map<std::int32_t, std::vector<std::size_t>> parts;
      for (std::size_t a = 0; a < alive.size(); ++a)
        parts[sets.find(static_cast<std::int32_t>(a))].push_back(alive[a]);
      for (const auto& [root, places] : parts) clusters.push_back(part_of(cluster, places, grower));
    }
    clusters_ = std::move(clusters);
    // Whose detections are all others' in every hypothesis that is left has no branch.
    std::erase_if(open_.seeds, [](const LiveTrack<Tree>& s) { return s.more.branches.empty(); });
    list_keys();
  }

  // The hypotheses as far as some of the trees go.
  Cluster part_of(const Cluster& cluster, const std::vector<std::size_t>& places,
                  const BranchGrower& grower) const {
    Cluster part;
    for (const std::size_t k : places) part.keys.push_back(cluster.keys[k]);
    struct Sums {
      std::size_t place = 0;
      double with = 0, without = 0;  // weights with and without what was merged
    } all;
    std::map<std::vector<std::int32_t>, Sums> seen;
    const double most = cluster.hypotheses.front().log_weight();
    for (const Hypothesis& h : cluster.hypotheses) {
      std::vector<std::int32_t> branches;
      for (const std::size_t k : places) branches.push_back(h.branches[k]);
      const auto [at, is_new] = seen.try_emplace(branches, Sums{part.hypotheses.size(), 0, 0});
      for (Sums* sums : {&at->second, &all}) {
        sums->with += std::exp(h.log_weight() - most);
        sums->without += std::exp(h.worth - most);
      }
      if (is_new) part.hypotheses.push_back({worth_of(part, branches, grower), 0, branches});
    }
    // How much more probable the part is by what was merged; in each part just its own share.
    for (const auto& [branches, sums] : seen)
      part.hypotheses[sums.place].merged =
          sums.with == sums.without && all.with == all.without
              ? 0
              : std::log(sums.with / all.with) - std::log(sums.without / all.without);
    sort(part.hypotheses);
    return part;
  }

  double worth_of(const Cluster& cluster, const std::vector<std::int32_t>& branches,
                  const BranchGrower& grower) const {
    double sum = 0;
    for (std::size_t k = 0; k < branches.size(); ++k) {
      if (branches[k] < 0) continue;
      const std::size_t i = index_of(cluster.keys[k]);
      const Branch& b = open_.tree(i).more.branches[branches[k]];
      if (!is_lone(b, open_.is_seed(i))) sum += grower.worth(b);
    }
    return sum;
  }

  HypothesisWindow open_;
  MatrixOptions opt_;
  std::vector<Cluster> clusters_;
  Fresh<Memory> s_;
};

}  // namespace asterism
