// Multiple hypothesis tracking after Reid (1979): complete hypotheses are propagated from frame to
// frame, in clusters.
//
//   CLUSTER  joins clusters that may take the same detection into a super-cluster
//   HYPGEN   generates the best hypotheses about the new frame from those so far
//   REDUCE   keeps few, likely and distinct hypotheses; decides frames older than the window by the
//            best one (N-scan pruning); separates trees that share no detection any more
//   MASH     removes detections on which all hypotheses agree: their tracks keep them, and
//            tentative tracks are confirmed
//
// An unassigned detection initiates a tree at once, which contributes nothing while it has no
// second detection. “Clutter so far” and “possibly the first of a marker” are therefore one
// hypothesis, not two.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>
#include <memory>
#include <utility>
#include <vector>

#include "base/scratch.hpp"
#include "math/log_sums.hpp"
#include "mht/clustering.hpp"
#include "mht/clusters.hpp"
#include "mht/hypothesis_generation.hpp"
#include "trees/hypothesis_window.hpp"

namespace asterism {

class HypothesisMatrix {
 public:
  HypothesisMatrix(const HypothesisWindow& open, const MatrixOptions& options)
      : open_(open), opt_(options) {}

  template <typename Label>
  void add(std::shared_ptr<WindowFrame> frame, TreeStats& stats, Label&& label) {
    open_.advise(*frame, stats);
    open_.advance(frame->step);
    open_.claim(*frame);
    open_.frames.push_back(frame);
    s_.ways.grow(open_, stats);
    std::vector<Cluster> clusters;
    Clustering clustering(s_.ways, opt_);
    const HypothesisGeneration generation(open_, s_.ways, opt_);
    for (SuperCluster& super :
         clustering.join(std::move(clusters_), *frame, open_.n_all(), stats)) {
      generation.explain(*frame, super, stats);
      merge_similar(super.cluster, stats);
      clusters.push_back(std::move(super.cluster));
    }
    clusters_ = std::move(clusters);
    for (std::size_t i = 0; i < open_.n_all(); ++i)
      open_.tree(i).more.branches = std::move(s_.ways[i].branches);
    keep_used_branches();
    open_.count_branches(stats);
    if (open_.is_full()) {
      weigh(1);
      prune_by_oldest();
      mash(stats, label);
      open_.learn();
    }
    split();
  }

  // Decides all remaining frames by the best hypothesis of every cluster. All probabilities are
  // taken over the present hypotheses.
  template <typename Label>
  void decide_all(TreeStats& stats, Label&& label) {
    s_.ways.list_keys(open_);
    weigh(open_.frames.size());
    while (open_.n_open() > 0) mash(stats, label);
  }

  bool has_confidence() const { return true; }
  const LiveTracks<Tree>& live() const { return open_.live; }
  const HypothesisWindow& window() const { return open_; }
  const std::vector<Cluster>& clusters() const { return clusters_; }
  void count(TreeStats& stats) const { open_.count(stats); }

 private:
  struct Memory {
    FrameWays ways;
    // By open frame and tree: the decision of the best hypothesis. By frame and detection: the
    // probability that it belongs to no tree.
    std::vector<std::map<std::int64_t, TreeDecision>> decisions;
    std::vector<std::vector<double>> free;
  };

  // REDUCE, merging: a hypothesis with the same tracks is merged into a more likely one if all its
  // estimates are close to those.
  void merge_similar(Cluster& cluster, TreeStats& stats) const {
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
      same->merged += softplus(h.log_weight() - same->log_weight());
      ++stats.n_merged;
    }
    sort_by_weight(kept);
    cluster.hypotheses = std::move(kept);
  }

  bool is_similar(const Cluster& cluster, const Hypothesis& a, const Hypothesis& b) const {
    for (std::size_t k = 0; k < cluster.keys.size(); ++k) {
      if (a.branches[k] == b.branches[k]) continue;
      const std::size_t i = s_.ways.index_of(cluster.keys[k]);
      const auto branch_of = [&](const Hypothesis& h) -> const Branch* {
        if (h.branches[k] < 0) return nullptr;
        const Branch& branch = s_.ways[i].branches[h.branches[k]];
        return open_.is_lone(i, branch) ? nullptr : &branch;
      };
      const Branch *one = branch_of(a), *other = branch_of(b);
      if (!one && !other) continue;
      if (!one || !other || one->gap != other->gap || !is_near(open_.tree(i).more, *one, *other)) return false;
    }
    return true;
  }

  // Whether means and standard deviations differ by at most `merged_within` standard deviations of
  // the first.
  bool is_near(const Tree& tree, const Branch& a, const Branch& b) const {
    const MotionModel& m = open_.live.m;
    const AxisState one = collapse(m, tree.state_of(m, a)),
                    other = collapse(m, tree.state_of(m, b));
    const int n = m.axis.n;
    for (int s = 0; s < n; ++s) {
      const double sigma = std::sqrt(one.P[s * n + s]);
      const double bound = opt_.merged_within * sigma;
      if (!(std::abs(std::sqrt(other.P[s * n + s]) - sigma) <= bound)) return false;
      for (int d = 0; d < open_.live.m.axis.D; ++d)
        if (!(std::abs(other.x[d][s] - one.x[d][s]) <= bound)) return false;
    }
    return true;
  }

  // Keeps the branches of every tree that some hypothesis contains, those of the most likely first.
  void keep_used_branches() {
    for (Cluster& cluster : clusters_)
      for (std::size_t k = 0; k < cluster.keys.size(); ++k) {
        std::vector<Branch>& all = open_.tree(s_.ways.index_of(cluster.keys[k])).more.branches;
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

  // Computes decisions and probabilities for the first open frames.
  void weigh(std::size_t n_frames) {
    s_.decisions.assign(n_frames, {});
    s_.free.assign(n_frames, {});
    for (std::size_t f = 0; f < n_frames; ++f) {
      const WindowFrame& frame = *open_.frames[f];
      s_.free[f].assign(frame.points.size(), 1);
      for (const Cluster& cluster : clusters_) {
        const std::vector<double> p = probabilities(cluster);
        for (std::size_t k = 0; k < cluster.keys.size(); ++k) {
          const std::size_t i = s_.ways.index_of(cluster.keys[k]);
          TreeDecision decision = decision_of(i, cluster.hypotheses.front().branches[k], frame);
          for (std::size_t h = 0; h < p.size(); ++h) {
            const TreeDecision other = decision_of(i, cluster.hypotheses[h].branches[k], frame);
            if (!other.exists) continue;
            if (decision.column == other.column) decision.probability += p[h];
            if (other.column >= 0) s_.free[f][other.column] -= p[h];
          }
          decision.probability = std::min(decision.probability, 1.0);
          s_.decisions[f].emplace(cluster.keys[k], decision);
        }
      }
    }
  }

  TreeDecision decision_of(std::size_t tree, std::int32_t branch, const WindowFrame& frame) const {
    if (branch < 0) return {};
    const Branch& b = open_.tree(tree).more.branches[branch];
    if (open_.is_lone(tree, b) || frame.number < open_.first_frame(tree)) return {};
    return {true, b.taken(frame.number), 0};
  }

  // REDUCE, N-scan pruning: removes hypotheses that disagree with the best one in the oldest frame.
  void prune_by_oldest() {
    const WindowFrame& frame = *open_.frames.front();
    for (Cluster& cluster : clusters_)
      std::erase_if(cluster.hypotheses, [&](const Hypothesis& h) {
        for (std::size_t k = 0; k < cluster.keys.size(); ++k) {
          const std::size_t i = s_.ways.index_of(cluster.keys[k]);
          const TreeDecision best = s_.decisions[0].at(cluster.keys[k]);
          const TreeDecision own = decision_of(i, h.branches[k], frame);
          if (own.column != best.column) return true;
        }
        return false;
      });
    keep_used_branches();
  }

  // MASH: applies the decisions to the oldest frame.
  template <typename Label>
  void mash(TreeStats& stats, Label&& label) {
    std::vector<TreeDecision> decisions;
    for (std::size_t i = 0; i < open_.n_all(); ++i) {
      const auto at = s_.decisions.front().find(open_.tree(i).more.key);
      decisions.push_back(at == s_.decisions.front().end() ? TreeDecision{} : at->second);
    }
    open_.carry_out(decisions, s_.free.front(), stats, label);
    s_.decisions.erase(s_.decisions.begin());
    s_.free.erase(s_.free.begin());
    s_.ways.list_keys(open_);
  }

  // REDUCE, splitting: trees that share no detection in any hypothesis become separate clusters.
  void split() {
    const BranchGrower grower(open_.live, open_.branches);
    std::vector<Cluster> clusters;
    for (const Cluster& cluster : clusters_) {
      std::vector<std::size_t> alive;  // indices of the trees that are left
      for (std::size_t k = 0; k < cluster.keys.size(); ++k) {
        const std::size_t i = s_.ways.index_of(cluster.keys[k]);
        if (s_.ways.has(cluster.keys[k]) && !open_.tree(i).more.branches.empty())
          alive.push_back(k);
      }
      const auto parts =
          connected_sets(alive.size(), open_.n_detections(), [&](std::int32_t a, auto&& visit) {
            const std::size_t i = s_.ways.index_of(cluster.keys[alive[a]]);
            for (const Branch& b : open_.tree(i).more.branches) open_.each_detection(i, b, visit);
          });
      for (const std::vector<std::int32_t>& part : parts) {
        std::vector<std::size_t> places;
        for (const std::int32_t a : part) places.push_back(alive[a]);
        clusters.push_back(part_of(cluster, places, grower));
      }
    }
    clusters_ = std::move(clusters);
    // A seed whose detection belongs to others in every remaining hypothesis has no branch.
    std::erase_if(open_.seeds, [](const LiveTrack<Tree>& s) { return s.more.branches.empty(); });
    s_.ways.list_keys(open_);
  }

  // The hypotheses of a cluster restricted to some of its trees.
  Cluster part_of(const Cluster& cluster, const std::vector<std::size_t>& places,
                  const BranchGrower& grower) const {
    Cluster part;
    for (const std::size_t k : places) part.keys.push_back(cluster.keys[k]);
    struct Sums {
      std::size_t place = 0;
      double with = 0, without = 0;  // weights with and without merged hypotheses
    } all;
    std::map<std::vector<std::int32_t>, Sums> seen;
    const double max_weight = cluster.hypotheses.front().log_weight();
    for (const Hypothesis& h : cluster.hypotheses) {
      std::vector<std::int32_t> branches;
      for (const std::size_t k : places) branches.push_back(h.branches[k]);
      const auto [at, is_new] = seen.try_emplace(branches, Sums{part.hypotheses.size(), 0, 0});
      for (Sums* sums : {&at->second, &all}) {
        sums->with += std::exp(h.log_weight() - max_weight);
        sums->without += std::exp(h.log_ratio - max_weight);
      }
      if (is_new) part.hypotheses.push_back({log_ratio_of(part, branches, grower), 0, branches});
    }
    // Each part keeps its own share of the probability gained by merging.
    for (const auto& [branches, sums] : seen)
      part.hypotheses[sums.place].merged =
          sums.with == sums.without && all.with == all.without
              ? 0
              : std::log(sums.with / all.with) - std::log(sums.without / all.without);
    sort_by_weight(part.hypotheses);
    return part;
  }

  double log_ratio_of(const Cluster& cluster, const std::vector<std::int32_t>& branches,
                  const BranchGrower& grower) const {
    double sum = 0;
    for (std::size_t k = 0; k < branches.size(); ++k) {
      if (branches[k] < 0) continue;
      const std::size_t i = s_.ways.index_of(cluster.keys[k]);
      const Branch& b = open_.tree(i).more.branches[branches[k]];
      if (!open_.is_lone(i, b)) sum += grower.log_ratio(b);
    }
    return sum;
  }

  HypothesisWindow open_;
  MatrixOptions opt_;
  std::vector<Cluster> clusters_;
  Scratch<Memory> s_;
};

}  // namespace asterism
