// Track splitting: the trees of all tracks over a window of frames. When the window is full, the
// oldest frame is decided from the branches of all tracks.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <vector>

#include "frame/frame_pairing.hpp"
#include "math/log_sums.hpp"
#include "solve/joint_events.hpp"
#include "trees/open_window.hpp"

namespace asterism {

struct ForestOptions {
  // With stable marriage, tracks rank detections by the likelihood over the window, and detections
  // rank tracks by the distances in it.
  Pairing pairing = Pairing::assignment;
  // Whether every tree keeps its best branch even if another tree takes the same detection. Only
  // the labels are then exclusive.
  bool is_independent = false;
};

class Forest {
 public:
  Forest(const OpenWindow& open, const ForestOptions& options) : open_(open), opt_(options) {}

  // Processes a frame; decides the oldest one if the window is now full.
  template <typename Label>
  void add(std::shared_ptr<WindowFrame> frame, TreeStats& stats, Label&& label) {
    open_.advise(*frame, stats);
    open_.advance(frame->step);
    if (!opt_.is_independent) open_.claim(*frame);
    open_.push(std::move(frame), stats);
    if (!open_.is_full()) return;
    decide(stats, label);
    open_.learn();
  }

  // Decides all remaining frames from the data available.
  template <typename Label>
  void decide_all(TreeStats& stats, Label&& label) {
    while (open_.n_open() > 0) decide(stats, label);
  }

  bool has_confidence() const { return opt_.pairing == Pairing::assignment; }
  bool has_test() const { return open_.branches.has_test(); }
  const LiveTracks<Tree>& live() const { return open_.live; }
  void count(TreeStats& stats) const { open_.count(stats); }

 private:
  // The best branch of a tree with one detection of the oldest frame, or with a missed detection.
  struct Way {
    std::int32_t column = -1;  // -1: missed
    double log_ratio = 0, crowding = 0;
    // Log-likelihood ratio if the detection initiates a new track instead.
    double new_track = -std::numeric_limits<double>::infinity();
    double log_weight = 0;   // of all its branches
    double probability = 0;  // marginal probability over all joint events of the frame
    std::int32_t branch = -1;  // -1: no branch with a missed detection is left
  };

  // Data of one decision.
  struct Memory {
    FramePairing pairs;
    std::vector<std::int32_t> claims;
    std::vector<std::vector<Way>> ways;
    std::vector<double> free;
    std::vector<Candidate> candidates, pairings;
    std::vector<double> gains, marginals, missed, log_miss;
    std::vector<std::int32_t> best;
  };

  template <typename Label>
  void decide(TreeStats& stats, Label&& label) {
    const std::shared_ptr<const WindowFrame> frame = open_.pop();
    s_.pairs.begin(open_.live.size(), frame->points.size());
    s_.ways.resize(open_.live.size());
    count_shared(*frame, stats);
    for (std::size_t i = 0; i < open_.live.size(); ++i) list_ways(*frame, i);
    for (const bool confirmed : {true, false}) {
      if (opt_.pairing == Pairing::assignment) weigh_ways(*frame, confirmed, stats);
      match_all(*frame, confirmed, stats);
    }
    label_free(*frame, label);
    for (std::size_t i = 0; i < open_.live.size(); ++i) follow(*frame, i, stats, label);
    open_.live.end_tracks();
    for (std::size_t j = 0; j < frame->points.size(); ++j) {
      if (s_.pairs.is_taken[j]) continue;
      LiveTrack<Tree>& track = open_.live.begin(j, frame->points[j], frame->time, open_.live.birth_gain());
      track.more.key = open_.n_trees++;
      open_.regrow(track, stats);
    }
    open_.live.so_far.add(frame->time, frame->points.size());
  }

  void list_ways(const WindowFrame& frame, std::size_t i) {
    const BranchGrower grower(open_.live, open_.branches);
    const LiveTrack<Tree>& track = open_.live[i];
    std::vector<Way>& ways = s_.ways[i];
    // Branches are sorted, the best first.
    const double max_log_ratio = grower.log_ratio(track.more.branches.front());
    // If all branches with a missed detection were pruned, this is an upper bound for them.
    const double pruned = max_log_ratio - open_.branches.prune_drop;
    ways.assign(1, Way{.log_ratio = pruned, .log_weight = std::exp(pruned - max_log_ratio)});
    for (std::size_t k = 0; k < track.more.branches.size(); ++k) {
      const Branch& b = track.more.branches[k];
      const std::int32_t column = b.taken(frame.number);
      const double log_ratio = grower.log_ratio(b);
      auto way = std::find_if(ways.begin(), ways.end(), [&](const Way& w) { return w.column == column; });
      if (way == ways.end()) way = ways.insert(ways.end(), Way{.column = column});
      if (way->branch < 0) {
        // The frame is decided now, so the claims of other tracks are replaced by their own
        // alternatives.
        way->branch = static_cast<std::int32_t>(k);
        way->crowding = column < 0 ? 0 : frame.crowding(track.more.key, column);
        way->log_ratio = log_ratio + way->crowding;
        way->log_weight = 0;
      }
      way->log_weight += std::exp(log_ratio - max_log_ratio);
    }
    for (Way& way : ways) way.log_weight = max_log_ratio + std::log(way.log_weight) + way.crowding;
    if (track.is_confirmed() && ways.size() > 1) weigh_new_tracks(frame, track, ways);
    std::sort(ways.begin() + 1, ways.end(),
              [](const Way& a, const Way& b) { return a.column < b.column; });
  }

  // Alternative to a confirmed track that takes a detection and its continuation: the track may
  // have ended, and the detection may be the first of a new marker. The gain of initiation at a
  // single detection is already part of leaving it unassigned. This function adds the gain of the
  // continuation.
  void weigh_new_tracks(const WindowFrame& frame, const LiveTrack<Tree>& track,
                     std::vector<Way>& ways) const {
    MotionState state = track.state;
    predict(open_.live.m, frame.step, state);
    const BranchGrower grower(open_.live, open_.branches);
    const NeighbourAdvice* advice = frame.advice_to(track.more.key);
    const Expected expected = grower.expected(state, track.gap, advice);
    const std::int32_t n_missed =
        std::min(open_.n_open() + 1, open_.live.sm.max_gap - track.unpredicted());
    const double gone = track.score + open_.live.misses_gain(track.gap, n_missed);
    const double over = open_.live.leftover_gain();
    std::array<double, kMaxModes> each{};
    for (std::size_t k = 1; k < ways.size(); ++k) {
      const Branch& b = track.more.branches[ways[k].branch];
      const Point& y = frame.points[ways[k].column];
      double hit = open_.live.hit_gain(track.gap) + expected.of(y).log_likelihood(y, each);
      if (advice != nullptr) hit += advice->of(ways[k].column);
      const double future = b.score + ways[k].crowding - track.score - hit - over * (b.n_taken - 1);
      if (future > 0)
        ways[k].new_track =
            gone + open_.live.birth_gain() - over + future + std::log1p(-std::exp(-future));
    }
  }

  // The marginal probability of every alternative of the confirmed tracks, or of the tentative
  // tracks given that they are markers. Each alternative has the total weight of its branches.
  void weigh_ways(const WindowFrame& frame, bool confirmed, TreeStats& stats) {
    s_.pairings.clear();
    s_.gains.clear();
    for (std::size_t i = 0; i < open_.live.size(); ++i) {
      if (open_.live[i].is_confirmed() != confirmed) continue;
      for (std::size_t k = 1; k < s_.ways[i].size(); ++k) {
        const Way& way = s_.ways[i][k];
        const double gain = way.log_weight - log_sum(s_.ways[i][0].log_weight, way.new_track);
        if (s_.pairs.is_taken[way.column] || !(gain > kNegligible) || !std::isfinite(gain)) continue;
        s_.pairings.push_back({static_cast<std::int32_t>(i), way.column, gain, 0});
        s_.gains.push_back(gain);
      }
    }
    s_.marginals.resize(s_.pairings.size());
    s_.missed.resize(open_.live.size());
    s_.best.resize(open_.live.size());
    s_.log_miss.assign(open_.live.size(), 0);
    JointEvents events(s_.pairings, s_.gains, s_.log_miss,
                       static_cast<std::int32_t>(frame.points.size()), kMaxStates);
    const JointSummary summary = events.solve(s_.marginals, s_.missed, s_.best);
    stats.n_beams += summary.n_beams;
    stats.bound = std::max(stats.bound, summary.bound);
    for (std::size_t e = 0; e < s_.pairings.size(); ++e)
      for (Way& way : s_.ways[s_.pairings[e].row])
        if (way.column == s_.pairings[e].column) way.probability = s_.marginals[e];
  }

  // For a tentative track, the gain is weighted with the odds that the track is a marker.
  double odds(const LiveTrack<Tree>& track, const Way& way) const {
    if (track.is_confirmed()) return way.log_ratio;
    if (way.branch < 0) return softplus(way.log_ratio);
    const Branch& b = track.more.branches[way.branch];
    return softplus(b.score + way.crowding) - b.n_taken * open_.live.leftover_gain();
  }

  // Assigns the remaining detections to the confirmed or to the tentative tracks.
  void match_all(const WindowFrame& frame, bool confirmed, TreeStats& stats) {
    s_.candidates.clear();
    for (std::size_t i = 0; i < open_.live.size(); ++i) {
      const LiveTrack<Tree>& track = open_.live[i];
      if (track.is_confirmed() != confirmed) continue;
      const double missed = odds(track, s_.ways[i][0]);
      for (std::size_t k = 1; k < s_.ways[i].size(); ++k) {
        const Way& way = s_.ways[i][k];
        const double gain = odds(track, way) - log_sum(missed, way.new_track);
        if (s_.pairs.is_taken[way.column] || !(gain > 0) || !std::isfinite(gain)) continue;
        s_.candidates.push_back({static_cast<std::int32_t>(i), way.column, gain,
                               mean_distance2(track.more.branches[way.branch])});
      }
    }
    s_.pairs.pair(s_.candidates, frame.points, open_.live.m.axis.D, {opt_.pairing}, stats);
  }

  // Mean squared distance of a branch's detections in the window from their predictions.
  static double mean_distance2(const Branch& b) {
    double sum = 0;
    for (const double d2 : b.distance2) sum += d2;
    return sum / b.n_taken;
  }

  void count_shared(const WindowFrame& frame, TreeStats& stats) {
    s_.claims.assign(frame.points.size(), 0);
    for (const LiveTrack<Tree>& track : open_.live.tracks) {
      const std::int32_t j = track.more.branches.front().taken(frame.number);
      if (j >= 0 && track.is_confirmed() && ++s_.claims[j] == 2) ++stats.n_shared;
    }
  }

  const Way* way_to(std::size_t i, std::int32_t column) const {
    for (const Way& way : s_.ways[i])
      if (way.column == column) return &way;
    return nullptr;
  }

  // Labels unassigned detections -1, with the probability that they belong to no confirmed track.
  template <typename Label>
  void label_free(const WindowFrame& frame, Label&& label) {
    s_.free.assign(frame.points.size(), 1);
    for (std::size_t i = 0; i < open_.live.size(); ++i)
      for (const Way& way : s_.ways[i])
        if (way.column >= 0 && open_.live[i].is_confirmed()) s_.free[way.column] -= way.probability;
    for (std::size_t j = 0; j < frame.points.size(); ++j)
      label(frame.first + static_cast<std::int64_t>(j), -1, std::clamp(s_.free[j], 0.0, 1.0));
  }

  // Updates a track with the decision, and keeps the branches that agree with it.
  template <typename Label>
  void follow(const WindowFrame& frame, std::size_t i, TreeStats& stats, Label&& label) {
    LiveTrack<Tree>& track = open_.live[i];
    const std::int32_t j = s_.pairs.match[i];
    const std::int32_t own = opt_.is_independent ? track.more.branches.front().taken(frame.number) : j;
    open_.carry(frame, i, own, stats);
    if (own >= 0) s_.pairs.is_taken[own] = 1;
    if (j >= 0) {
      const Point last = track.last;
      open_.live.take(i, j, last, frame.time, way_to(i, j)->probability, label);
    } else {
      open_.miss(frame, i);
    }
    open_.keep(frame, i, own, stats);
  }

  // Log weight relative to a miss below which a pairing is ignored.
  static constexpr double kNegligible = -20.7;
  static constexpr std::int64_t kMaxStates = 4096;  // of the sum over joint events

  OpenWindow open_;
  ForestOptions opt_;

  Scratch<Memory> s_;
};

}  // namespace asterism
