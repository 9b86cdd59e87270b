// Track-oriented multiple hypothesis tracking (TOMHT). Every track has a tree of hypotheses over a
// window of frames. The best compatible set of hypotheses explains all detections and decides the
// oldest frame (N-scan pruning).
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <span>
#include <tuple>
#include <utility>
#include <vector>

#include "solve/connected_components.hpp"
#include "solve/set_packing.hpp"
#include "trees/best_hypotheses.hpp"
#include "trees/hypothesis_window.hpp"

namespace asterism {

// Selects an option of each tree such that no resource is used twice. Receives the options of all
// trees and the first resource of every open frame. Adds a bound of its optimality gap to the
// stats.
using Packer = std::function<std::vector<std::int32_t>(
    std::span<const std::vector<PackingOption>>, std::span<const std::int32_t>, TreeStats&)>;

struct HypothesisOptions {
  std::int64_t max_hypotheses = 1;  // of a cluster, for the probabilities
  std::int64_t max_nodes = 1;       // of the search for them
  double min_new_log_ratio = 0;       // smallest log-likelihood ratio of a branch of a new tree
  // A tentative track is deleted if all its branches are this far below its best score.
  double delete_drop = 0;
  double drop = 0;                  // hypotheses this many nats below the best are ignored
  // Options with a larger loss enter the probabilities by their loss alone.
  double ambiguous_drop = 0;
  Packer packer;                    // replaces the search below, if set
};

class HypothesisForest {
 public:
  HypothesisForest(const HypothesisWindow& open, const HypothesisOptions& options)
      : open_(open), opt_(options) {}

  template <typename Label>
  void add(std::shared_ptr<WindowFrame> frame, TreeStats& stats, Label&& label) {
    open_.advise(*frame, stats);
    open_.advance(frame->step);
    open_.claim(*frame);
    open_.push(frame, stats);
    BranchGrower grower(open_.live, open_.branches);
    for (LiveTrack<Tree>& seed : open_.seeds) grower.grow(*frame, seed, open_.n_open(), open_.max_grown, stats);
    open_.begin_trees();
    limit(stats);
    if (!open_.is_full()) return;
    decide(stats, label);
    open_.learn();
  }

  template <typename Label>
  void decide_all(TreeStats& stats, Label&& label) {
    while (open_.n_open() > 0) {
      limit(stats);
      decide(stats, label);
    }
  }

  bool has_confidence() const { return !opt_.packer; }
  const LiveTracks<Tree>& live() const { return open_.live; }
  void count(TreeStats& stats) const { open_.count(stats); }

 private:
  // The option that a tree takes in a hypothesis.
  struct Choice {
    std::int32_t branch = kNothing;
    std::int32_t column = -1;  // its detection in the frame that is decided
    double loss = 0;  // lower bound of the loss by this option; kBest in the best hypothesis
  };
  static constexpr double kBest = -1;  // sorts before options with a loss of zero
  static constexpr std::int32_t kNothing = -1;  // the tree is no marker
  static constexpr std::int32_t kLost = -2;  // missed in all open frames, without a branch for it

  // A branch, and the loss of the best hypothesis of its cluster that contains it.
  struct Ranked {
    double loss = 0;
    std::int32_t tree = 0, branch = 0;
  };
  struct TreeOptions {
    std::vector<PackingOption> options;
    std::vector<Choice> choices;
    std::vector<Choice> improbable;  // pruned options

    void clear() {
      options.clear();
      choices.clear();
      improbable.clear();
    }
  };

  // Decides the oldest frame, with the options and losses that `limit` has computed.
  template <typename Label>
  void decide(TreeStats& stats, Label&& label) {
    leave_out_improbable();
    choose(stats);
    open_.carry_out(s_.decisions, s_.free, stats, label);
  }

  // Lists the branches of every tree as options, with the detections of all open frames as
  // resources.
  void list_options() {
    const BranchGrower grower(open_.live, open_.branches);
    s_.trees.resize(open_.n_all());
    for (TreeOptions& tree : s_.trees) tree.clear();
    s_.decisions.assign(open_.n_all(), {});
    std::size_t n_branches = 0;
    for (std::size_t i = 0; i < open_.n_all(); ++i) n_branches += branches(i).size();
    s_.uses.clear();
    s_.uses.reserve(n_branches * open_.frames.size());  // so that the spans stay valid
    for (std::size_t i = 0; i < s_.trees.size(); ++i) {
      const bool is_seed = open_.is_seed(i);
      const LiveTrack<Tree>& track = open_.tree(i);
      TreeOptions& tree = s_.trees[i];
      bool has_free = false;
      for (std::size_t k = 0; k < track.more.branches.size(); ++k) {
        const Branch& b = track.more.branches[k];
        if (is_seed && (open_.is_lone(i, b) || grower.log_ratio(b) < opt_.min_new_log_ratio))
          continue;
        if (!is_seed && !track.is_confirmed() && track.best_score - b.score > opt_.delete_drop)
          continue;
        const std::size_t begin = s_.uses.size();
        open_.each_detection(i, b, [&](std::int32_t r) { s_.uses.push_back(r); });
        const PackingOption option{grower.log_ratio(b),
                                   std::span<const std::int32_t>(s_.uses).subspan(begin)};
        has_free = has_free || option.uses.empty();
        const std::int32_t column = open_.taken(i, b, *open_.frames.front());
        tree.options.push_back(option);
        tree.choices.push_back({static_cast<std::int32_t>(k), column, 0});
      }
      if (!track.is_confirmed()) {
        tree.options.push_back({0, {}});
        tree.choices.push_back({kNothing, -1, 0});
      } else if (!has_free) {
        const double lost = track.score - open_.live.misses_gain(0, track.unpredicted()) +
                            open_.branches.log_end[track.unpredicted() + open_.n_open()];
        tree.options.push_back({lost, {}});
        tree.choices.push_back({kLost, -1, 0});
      }
    }
  }

  // Clusters of trees that share detections.
  std::vector<std::vector<std::int32_t>> clusters() const {
    return connected_sets(s_.trees.size(), open_.n_detections(), [&](std::int32_t i, auto&& visit) {
      for (const PackingOption& option : s_.trees[i].options)
        for (const std::int32_t r : option.uses) visit(r);
    });
  }

  // Prunes branches that no probable hypothesis contains. The best branch of a tree may conflict
  // with another tree, increasingly so in longer windows. A branch is therefore judged by the loss
  // of the best hypothesis of its cluster that contains it, and the branches of a cluster share a
  // limit.
  void limit(TreeStats& stats) {
    list_options();
    for (const std::vector<std::int32_t>& cluster : clusters()) limit(cluster, stats);
    open_.count_branches(stats);
  }
  void limit(const std::vector<std::int32_t>& cluster, TreeStats& stats) {
    stats.largest_group = std::max<std::int64_t>(stats.largest_group, cluster.size());
    const std::int64_t n_tracks = weigh(cluster);
    rank(cluster);
    // New trees have a share of their own: their first detections gain little, so that in a long
    // window the many similar branches of old tracks would crowd them out.
    const auto n_max =
        static_cast<std::ptrdiff_t>(cluster.size()) + open_.branches.max_branches * n_tracks;
    std::array<std::ptrdiff_t, 2> n_left{n_max, n_max};
    const auto n_ranked = s_.ranked.size();
    std::erase_if(s_.ranked, [&](const Ranked& r) {
      const bool is_pruned = r.loss > open_.branches.prune_drop;
      n_left[open_.is_seed(r.tree)] -= !is_pruned;
      return is_pruned;
    });
    if (n_left[0] < 0 || n_left[1] < 0) limit_number(n_max, stats);
    if (s_.ranked.size() == n_ranked) return;
    auto next = s_.ranked.begin();
    for (const std::int32_t i : cluster) {
      std::vector<std::int32_t>& now = s_.now;
      now.assign(branches(i).size(), kNothing);
      std::int32_t n_kept = 0;
      for (; next != s_.ranked.end() && next->tree == i; ++next) {
        now[next->branch] = n_kept;
        if (next->branch != n_kept) branches(i)[n_kept] = std::move(branches(i)[next->branch]);
        ++n_kept;
      }
      branches(i).resize(n_kept);
      keep_options(s_.trees[i], [&](const PackingOption& option, Choice& choice) {
        if (choice.branch < 0) return true;
        const bool is_kept = now[choice.branch] != kNothing;
        choice.branch = is_kept ? now[choice.branch] : kLost;
        return is_kept || option.uses.empty();
      });
    }
  }
  // Keeps the n ranked branches with the smallest losses of the old trees and of the new ones.
  void limit_number(std::ptrdiff_t n, TreeStats& stats) {
    std::ranges::sort(s_.ranked, {}, [](const Ranked& r) { return std::tuple(r.loss, r.tree, r.branch); });
    std::array<std::ptrdiff_t, 2> n_left{n, n};
    stats.n_limited += static_cast<std::int64_t>(std::erase_if(
        s_.ranked, [&](const Ranked& r) { return n_left[open_.is_seed(r.tree)]-- <= 0; }));
    std::ranges::sort(s_.ranked, {}, [](const Ranked& r) { return std::pair(r.tree, r.branch); });
  }
  template <typename Keep>
  static void keep_options(TreeOptions& tree, Keep&& keep) {
    std::size_t n = 0;
    for (std::size_t o = 0; o < tree.choices.size(); ++o) {
      if (!keep(tree.options[o], tree.choices[o])) {
        tree.improbable.push_back(tree.choices[o]);
        continue;
      }
      if (n != o) {
        tree.choices[n] = tree.choices[o];
        tree.options[n] = tree.options[o];
      }
      ++n;
    }
    tree.choices.resize(n);
    tree.options.resize(n);
  }
  // Computes the loss of every option of a cluster. Returns the number of tracks in the best
  // hypothesis, at least one.
  std::int64_t weigh(const std::vector<std::int32_t>& cluster) {
    if (cluster.size() == 1) return weigh_alone(s_.trees[cluster.front()]);
    std::vector<std::vector<PackingOption>> options;
    for (const std::int32_t i : cluster) options.push_back(std::move(s_.trees[i].options));
    const SetPacking::Losses losses = SetPacking(options).losses();
    std::int64_t n_tracks = 0;
    for (std::size_t c = 0; c < cluster.size(); ++c) {
      TreeOptions& tree = s_.trees[cluster[c]];
      tree.options = std::move(options[c]);
      for (std::size_t o = 0; o < tree.choices.size(); ++o) tree.choices[o].loss = losses.of[c][o];
      Choice& best = tree.choices[losses.best[c]];
      best.loss = kBest;
      n_tracks += best.branch != kNothing;
    }
    return std::max<std::int64_t>(n_tracks, 1);
  }
  // The same for a tree that shares no detection with another.
  static std::int64_t weigh_alone(TreeOptions& tree) {
    const auto best = std::ranges::max_element(tree.options, {}, &PackingOption::log_weight);
    for (std::size_t o = 0; o < tree.choices.size(); ++o)
      tree.choices[o].loss = std::max(0.0, best->log_weight - tree.options[o].log_weight);
    tree.choices[best - tree.options.begin()].loss = kBest;
    return 1;
  }
  // Lists the branches of a cluster with their losses.
  void rank(const std::vector<std::int32_t>& cluster) {
    const BranchGrower grower(open_.live, open_.branches);
    s_.ranked.clear();
    for (const std::int32_t i : cluster) {
      const std::size_t first = s_.ranked.size();
      // A branch that is no option yet, such as a new track, is compared with its absence.
      for (std::size_t b = 0; b < branches(i).size(); ++b) {
        const Branch& branch = branches(i)[b];
        const double loss = branch.n_taken < 2 ? 0 : std::max(0.0, -grower.log_ratio(branch));
        s_.ranked.push_back({loss, i, static_cast<std::int32_t>(b)});
      }
      for (const Choice& choice : s_.trees[i].choices)
        if (choice.branch >= 0) s_.ranked[first + choice.branch].loss = choice.loss;
      // Every tree keeps at least one branch.
      std::min_element(s_.ranked.begin() + static_cast<std::ptrdiff_t>(first), s_.ranked.end(),
                       [](const Ranked& x, const Ranked& y) { return x.loss < y.loss; })
          ->loss = kBest;
    }
  }

  // Removes improbable options, so that clusters joined only by these separate again. Ambiguities
  // of separate clusters are independent, and the best few hypotheses of a large cluster would
  // cover little of the probability. An option is improbable if its loss is large or if it uses a
  // detection of a tree with a single probable option.
  void leave_out_improbable() {
    std::vector<char> is_owned(open_.n_detections(), 0), is_sure(s_.trees.size(), 0);
    for (bool is_new = true; is_new;) {
      is_new = false;
      for (std::size_t i = 0; i < s_.trees.size(); ++i) {
        if (is_sure[i]) continue;
        TreeOptions& tree = s_.trees[i];
        std::int64_t n_probable = 0;
        keep_options(tree, [&](const PackingOption& option, const Choice& choice) {
          const bool is_probable =
              choice.loss <= opt_.ambiguous_drop &&
              std::ranges::none_of(option.uses, [&](std::int32_t r) { return is_owned[r]; });
          n_probable += is_probable;
          return is_probable || option.uses.empty();
        });
        if (n_probable > 1) continue;
        is_sure[i] = is_new = true;
        keep_options(tree, [&](const PackingOption&, const Choice& choice) { return choice.loss == kBest; });
        for (const std::int32_t r : tree.options.front().uses) is_owned[r] = 1;
      }
    }
  }
  std::vector<Branch>& branches(std::size_t tree) { return open_.tree(tree).more.branches; }

  // Selects the best hypothesis of every cluster, and computes probabilities from its best
  // hypotheses.
  void choose(TreeStats& stats) {
    s_.free.assign(open_.frames.front()->points.size(), 1);
    s_.taken.assign(open_.frames.front()->points.size(), 0);
    std::vector<std::int32_t> entangled;
    for (const std::vector<std::int32_t>& cluster : clusters()) {
      if (opt_.packer && cluster.size() > 1)
        entangled.insert(entangled.end(), cluster.begin(), cluster.end());
      else
        choose_in(cluster, stats);
    }
    if (!entangled.empty()) choose_by_packer(entangled, stats);
    for (std::size_t j = 0; j < s_.free.size(); ++j) s_.free[j] /= 1 + s_.taken[j];
  }

  void mark(std::int32_t i, const Choice& best) {
    for (Branch& b : branches(i)) b.is_chosen = false;
    if (best.branch >= 0) branches(i)[best.branch].is_chosen = true;
  }

  void choose_by_packer(const std::vector<std::int32_t>& entangled, TreeStats& stats) {
    std::vector<std::vector<PackingOption>> options;
    for (const std::int32_t i : entangled) options.push_back(std::move(s_.trees[i].options));
    std::vector<std::int32_t> first_resource;
    for (const auto& frame : open_.frames) first_resource.push_back(open_.first_open(*frame));
    const std::vector<std::int32_t> own = opt_.packer(options, first_resource, stats);
    ++stats.n_groups;
    for (std::size_t c = 0; c < entangled.size(); ++c) {
      const Choice& best = s_.trees[entangled[c]].choices[own[c]];
      mark(entangled[c], best);
      s_.decisions[entangled[c]] = {best.branch != kNothing, best.column, 0};
    }
  }

  BestHypotheses hypotheses_of(const std::vector<std::int32_t>& cluster, TreeStats& stats) {
    if (cluster.size() == 1)
      return best_options(s_.trees[cluster.front()].options, opt_.max_hypotheses, opt_.drop);
    std::vector<std::vector<PackingOption>> options;
    for (const std::int32_t i : cluster) options.push_back(std::move(s_.trees[i].options));
    return best_packings(options, opt_.max_hypotheses, opt_.drop, opt_.max_nodes, stats);
  }

  void choose_in(const std::vector<std::int32_t>& cluster, TreeStats& stats) {
    const auto [chosen, totals] = hypotheses_of(cluster, stats);
    ++stats.n_groups;
    stats.n_hypotheses = std::max<std::int64_t>(stats.n_hypotheses, totals.size());
    double sum = 0;
    for (const double total : totals) sum += std::exp(total - totals.front());
    for (std::size_t c = 0; c < cluster.size(); ++c) {
      const TreeOptions& tree = s_.trees[cluster[c]];
      const Choice& best = tree.choices[chosen[c]];
      mark(cluster[c], best);
      double own = 0;
      for (std::size_t h = 0; h < totals.size(); ++h) {
        const double p = std::exp(totals[h] - totals.front()) / sum;
        const Choice& choice = tree.choices[chosen[h * cluster.size() + c]];
        if (choice.branch == kNothing) continue;
        if (choice.column == best.column) own += p;
        if (choice.column >= 0) s_.free[choice.column] -= p;
      }
      // A removed option is weighted by the bound of the best hypothesis that contains it.
      double left_out = 0;
      for (const Choice& choice : tree.improbable) {
        if ((choice.branch == kNothing) != (best.branch == kNothing) || choice.column != best.column)
          left_out += std::exp(-choice.loss);
        if (choice.branch != kNothing && choice.column >= 0)
          s_.taken[choice.column] += std::exp(-choice.loss);
      }
      s_.decisions[cluster[c]] = {best.branch != kNothing, best.column,
                                  std::min(own, 1.0) / (1 + left_out)};
    }
  }

  // Data of one decision: live tracks first, then seeds.
  struct Memory {
    std::vector<TreeOptions> trees;
    std::vector<std::int32_t> uses;  // of all options
    std::vector<Ranked> ranked;
    std::vector<std::int32_t> now;  // of each branch of a tree: its number among those kept
    std::vector<TreeDecision> decisions;
    std::vector<double> free, taken;
  };

  HypothesisWindow open_;
  HypothesisOptions opt_;
  Scratch<Memory> s_;
};

}  // namespace asterism
