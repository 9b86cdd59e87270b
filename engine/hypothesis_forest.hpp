// Track-oriented multiple hypotheses: trees of track hypotheses over a window of frames, of which the
// best compatible set explains all detections at once; the oldest frame is decided by it (N-scan).
//
// A hypothesis is one branch of every tree, no detection in two. It is worth the sum of their parts of
// the log posterior, s(τ) up to now; a detection in none is clutter and worth nothing. Any detection
// may begin a tree, which is worth something from its second detection on.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <numeric>
#include <span>
#include <vector>

#include "open_window.hpp"
#include "set_packing.hpp"

namespace asterism {

// Chooses an option of each tree, no resource twice: given the options of all trees and the first
// resource of every open frame. Adds to the stats by how much its choice may be below the best.
using Packer = std::function<std::vector<std::int32_t>(
    std::span<const std::vector<PackingOption>>, std::span<const std::int32_t>, FrameStats&)>;

struct HypothesisOptions {
  std::int64_t max_hypotheses = 1;  // of a cluster, for the probabilities
  std::int64_t max_nodes = 1;       // of the search for them
  double new_track_claim = 0;       // a detection that is expected by more begins no tree
  double least_new_worth = 0;       // a branch of a new tree that is worth less is no option
  double drop = 0;                  // a hypothesis so many nats below the best does not count
  Packer packer;                    // who chooses in place of the search below, where there is one
};

class HypothesisForest {
 public:
  HypothesisForest(const MotionModel& model, const ScoreModel& score, const LifeOptions& life,
                   const BranchOptions& branches, const HypothesisOptions& options)
      : open_{{model, score, life}, branches, {}}, opt_(options) {}

  template <typename Label>
  void add(std::shared_ptr<WindowFrame> frame, FrameStats& stats, Label&& label) {
    frame->claimed.assign(frame->points.size(), 0);
    open_.claim(*frame);
    open_.push(frame, stats);
    BranchGrower grower(open_.live, open_.branches);
    for (LiveTrack<Tree>& seed : seeds_) grower.grow(*frame, seed, open_.n_open(), stats);
    for (std::size_t j = 0; j < frame->points.size(); ++j)
      if (frame->claimed[j] <= opt_.new_track_claim) sow(*frame, static_cast<std::int32_t>(j));
    if (open_.is_full()) decide(stats, label);
  }

  template <typename Label>
  void decide_all(FrameStats& stats, Label&& label) {
    while (open_.n_open() > 0) decide(stats, label);
  }

  bool has_confidence() const { return !opt_.packer; }
  const LiveTracks<Tree>& live() const { return open_.live; }
  // What may begin in an open frame is tentative as well.
  void count(FrameStats& stats) const {
    open_.count(stats);
    stats.n_tentative += static_cast<std::int64_t>(seeds_.size());
    stats.n_pending += static_cast<std::int64_t>(seeds_.size());
  }

 private:
  // What a tree does in a hypothesis.
  struct Choice {
    std::int32_t branch = kNothing;
    std::int32_t column = -1;  // its detection in the frame that is decided
  };
  static constexpr std::int32_t kNothing = -1;  // there is no such marker
  static constexpr std::int32_t kLost = -2;     // missed in all open frames, and no branch says so

  struct TreeOptions {
    std::vector<PackingOption> options;
    std::vector<Choice> choices;
    double probability_of_own = 0;  // of the best hypothesis' choice in the frame that is decided
    Choice best;
  };

  // A tree that begins at a detection of a frame not decided yet.
  void sow(const WindowFrame& frame, std::int32_t j) {
    LiveTrack<Tree> seed;
    seed.score = seed.best_score = open_.live.birth_gain();
    seed.last = frame.points[j];
    seed.last_time = frame.time;
    seed.state = begin_state(open_.live.m, seed.last);
    seed.more.key = frame.number;
    Branch b = BranchGrower(open_.live, open_.branches).root(seed);
    b.path[frame.number % kMaxWindow] = j;
    b.n_taken = 1;
    seed.more.branches.push_back(std::move(b));
    seeds_.push_back(std::move(seed));
  }

  template <typename Label>
  void decide(FrameStats& stats, Label&& label) {
    list_options();
    choose(stats);
    const std::shared_ptr<const WindowFrame> frame = open_.pop();
    LiveTracks<Tree>& live = open_.live;
    for (std::size_t j = 0; j < frame->points.size(); ++j)
      label(frame->first + static_cast<std::int64_t>(j), -1, std::clamp(free_[j], 0.0, 1.0));
    for (std::size_t i = 0; i < live.size(); ++i) {
      const Choice& choice = trees_[i].best;
      const bool is_nothing = choice.branch == kNothing;
      open_.carry(*frame, i, is_nothing ? -1 : choice.column);
      if (!is_nothing && choice.column >= 0) {
        const Point last = live[i].last;
        live.take(i, choice.column, last, frame->time, trees_[i].probability_of_own, label);
      } else {
        ++live[i].gap;
      }
      if (is_nothing) live[i].gap = live.sm.max_gap;
      open_.keep(*frame, i, choice.column, stats);
    }
    const std::size_t n_live = live.size();
    for (std::size_t k = 0; k < seeds_.size(); ++k)
      if (seeds_[k].more.key == frame->number && trees_[n_live + k].best.branch >= 0)
        begin(*frame, seeds_[k], trees_[n_live + k], stats);
    std::erase_if(seeds_, [&](const LiveTrack<Tree>& s) { return s.more.key == frame->number; });
    live.end_tracks();
    FrameStats ignored;
    live.end_frame(frame->time, frame->points.size(), ignored);
  }

  // A seed becomes a track, with those of its branches that have a second detection.
  void begin(const WindowFrame& frame, LiveTrack<Tree>& seed, const TreeOptions& tree,
             FrameStats& stats) {
    const std::int32_t j = seed.more.branches.front().taken(frame.number);
    LiveTrack<Tree>& track =
        open_.live.begin(j, frame.points[j], frame.time, open_.live.birth_gain());
    track.pending.back().confidence = tree.probability_of_own;
    track.more.key = open_.n_trees++;
    track.more.branches = std::move(seed.more.branches);
    if (open_.n_open() == 0)
      open_.regrow(track, stats);
    else
      open_.settle(frame, j, track);
  }

  // Every tree's branches as options, over the detections of all open frames as resources.
  void list_options() {
    const BranchGrower grower(open_.live, open_.branches);
    std::int32_t n_resources = 0;
    first_resource_.clear();
    for (const auto& frame : open_.frames) {
      first_resource_.push_back(n_resources);
      n_resources += static_cast<std::int32_t>(frame->points.size());
    }
    n_resources_ = n_resources;
    const std::size_t n_live = open_.live.size();
    trees_.assign(n_live + seeds_.size(), {});
    for (std::size_t i = 0; i < trees_.size(); ++i) {
      const bool is_seed = i >= n_live;
      const LiveTrack<Tree>& track = is_seed ? seeds_[i - n_live] : open_.live[i];
      TreeOptions& tree = trees_[i];
      const std::int64_t first = is_seed ? track.more.key : open_.frames.front()->number;
      bool has_free = false;
      for (std::size_t k = 0; k < track.more.branches.size(); ++k) {
        const Branch& b = track.more.branches[k];
        if (is_seed && (b.n_taken < 2 || grower.worth(b) < opt_.least_new_worth)) continue;
        PackingOption option{grower.worth(b), {}};
        for (std::size_t f = 0; f < open_.frames.size(); ++f) {
          const std::int64_t number = open_.frames[f]->number;
          if (number >= first && b.taken(number) >= 0)
            option.uses.push_back(first_resource_[f] + b.taken(number));
        }
        has_free = has_free || option.uses.empty();
        const std::int32_t column = is_seed && first != open_.frames.front()->number
                                        ? -1
                                        : b.taken(open_.frames.front()->number);
        tree.options.push_back(std::move(option));
        tree.choices.push_back({static_cast<std::int32_t>(k), column});
      }
      if (!track.is_confirmed()) {
        tree.options.push_back({0, {}});
        tree.choices.push_back({kNothing, -1});
      } else if (!has_free) {
        const double lost = track.score - track.gap * open_.live.miss_gain() +
                            open_.branches.log_end[track.gap + open_.n_open()];
        tree.options.push_back({lost, {}});
        tree.choices.push_back({kLost, -1});
      }
    }
  }

  // The best hypothesis of every cluster of trees, and the probabilities over its best ones.
  void choose(FrameStats& stats) {
    free_.assign(open_.frames.front()->points.size(), 1);
    std::vector<std::int32_t> owner(n_resources_, -1), parent(trees_.size());
    std::iota(parent.begin(), parent.end(), 0);
    const auto find = [&](std::int32_t i) {
      while (parent[i] != i) i = parent[i] = parent[parent[i]];
      return i;
    };
    for (std::size_t i = 0; i < trees_.size(); ++i)
      for (const PackingOption& option : trees_[i].options)
        for (const std::int32_t r : option.uses) {
          const auto own = static_cast<std::int32_t>(i);
          if (owner[r] < 0) owner[r] = own;
          const std::int32_t a = find(owner[r]), b = find(own);
          parent[std::max(a, b)] = std::min(a, b);
        }
    std::vector<std::vector<std::int32_t>> clusters(trees_.size());
    for (std::size_t i = 0; i < trees_.size(); ++i)
      clusters[find(static_cast<std::int32_t>(i))].push_back(static_cast<std::int32_t>(i));
    std::vector<std::int32_t> entangled;
    for (const std::vector<std::int32_t>& cluster : clusters) {
      if (cluster.empty()) continue;
      if (opt_.packer && cluster.size() > 1)
        entangled.insert(entangled.end(), cluster.begin(), cluster.end());
      else
        choose_in(cluster, stats);
    }
    if (!entangled.empty()) choose_by_packer(entangled, stats);
  }

  void choose_by_packer(const std::vector<std::int32_t>& entangled, FrameStats& stats) {
    std::vector<std::vector<PackingOption>> options;
    for (const std::int32_t i : entangled) options.push_back(std::move(trees_[i].options));
    const std::vector<std::int32_t> own = opt_.packer(options, first_resource_, stats);
    ++stats.n_groups;
    stats.largest_group = std::max<std::int64_t>(stats.largest_group, entangled.size());
    for (std::size_t c = 0; c < entangled.size(); ++c) {
      TreeOptions& tree = trees_[entangled[c]];
      tree.best = tree.choices[own[c]];
    }
  }

  void choose_in(const std::vector<std::int32_t>& cluster, FrameStats& stats) {
    std::vector<std::vector<PackingOption>> options;
    for (const std::int32_t i : cluster) options.push_back(std::move(trees_[i].options));
    std::vector<std::int32_t> chosen;
    std::vector<double> totals;
    const PackingSummary summary = SetPacking(options).solve(
        opt_.max_hypotheses, opt_.drop, opt_.max_nodes,
        [&](std::span<const std::int32_t> own, double worth) {
          chosen.insert(chosen.end(), own.begin(), own.end());
          totals.push_back(worth);
        });
    ++stats.n_groups;
    stats.largest_group = std::max<std::int64_t>(stats.largest_group, cluster.size());
    stats.n_hypotheses = std::max<std::int64_t>(stats.n_hypotheses, totals.size());
    stats.n_nodes += summary.n_nodes;
    if (!summary.is_exact && totals.size() == 1) {
      ++stats.n_beams;
      stats.gap = std::max(stats.gap, summary.bound - totals.front());
    }
    double sum = 0;
    for (const double total : totals) sum += std::exp(total - totals.front());
    for (std::size_t c = 0; c < cluster.size(); ++c) {
      TreeOptions& tree = trees_[cluster[c]];
      tree.best = tree.choices[chosen[c]];
      for (std::size_t h = 0; h < totals.size(); ++h) {
        const double p = std::exp(totals[h] - totals.front()) / sum;
        const Choice& choice = tree.choices[chosen[h * cluster.size() + c]];
        const bool is_own = choice.branch != kNothing && choice.column == tree.best.column;
        if (is_own) tree.probability_of_own = std::min(tree.probability_of_own + p, 1.0);
        if (choice.branch != kNothing && choice.column >= 0) free_[choice.column] -= p;
      }
    }
  }

  OpenWindow open_;
  HypothesisOptions opt_;
  std::vector<LiveTrack<Tree>> seeds_;  // their key is the number of the frame that they begin in

  // Working memory of one decision: live tracks first, then seeds.
  std::vector<TreeOptions> trees_;
  std::vector<std::int32_t> first_resource_;
  std::int32_t n_resources_ = 0;
  std::vector<double> free_;
};

}  // namespace asterism
