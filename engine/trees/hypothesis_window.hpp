// An undecided window for joint hypotheses: every detection may initiate a tree, and a hypothesis
// explains all detections at once.
//
// A hypothesis selects one branch of every tree, or none if the detections of the tree are clutter.
// No detection is in two branches. Its log-likelihood ratio is the sum of the terms s(τ) of its
// branches up to now; clutter contributes 0, and so does a tree with a single detection. The
// tracker selects the hypothesis; this class applies it to the oldest frame.
#pragma once

#include <algorithm>
#include <cstdint>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "trees/open_window.hpp"

namespace asterism {

// The decision on a tree in the oldest frame.
struct TreeDecision {
  bool exists = false;       // the tree is a marker
  std::int32_t column = -1;  // its detection in that frame, -1 for a missed detection
  double probability = 0;    // of that decision
};

struct HypothesisWindow : OpenWindow {
  double new_track_claim;  // a detection with a larger total claim initiates no tree
  std::vector<LiveTrack<Tree>> seeds;  // trees that begin in an undecided frame

  HypothesisWindow(const OpenWindow& window, double claim)
      : OpenWindow(window), new_track_claim(claim) {}

  std::size_t n_all() const { return live.size() + seeds.size(); }
  bool is_seed(std::size_t i) const { return i >= live.size(); }
  LiveTrack<Tree>& tree(std::size_t i) { return is_seed(i) ? seeds[i - live.size()] : live[i]; }
  const LiveTrack<Tree>& tree(std::size_t i) const {
    return is_seed(i) ? seeds[i - live.size()] : live[i];
  }
  // The first frame in which the branches of a tree may differ.
  std::int64_t first_frame(std::size_t i) const {
    return is_seed(i) ? tree(i).more.first : frames.front()->number;
  }

  // Whether a branch has a single detection, so that it contributes nothing yet.
  bool is_lone(std::size_t i, const Branch& b) const { return is_seed(i) && b.n_taken < 2; }
  // Detection of a branch of tree i in an open frame, -1 for none.
  std::int32_t taken(std::size_t i, const Branch& b, const WindowFrame& frame) const {
    return frame.number < first_frame(i) ? -1 : b.taken(frame.number);
  }
  // Calls visit(detection) for the detections of a branch of tree i, numbered from the first open
  // frame.
  template <typename Visit>
  void each_detection(std::size_t i, const Branch& b, Visit&& visit) const {
    for (const auto& frame : frames)
      if (const std::int32_t j = taken(i, b, *frame); j >= 0) visit(first_open(*frame) + j);
  }
  std::int32_t first_open(const WindowFrame& frame) const {
    return static_cast<std::int32_t>(frame.first - frames.front()->first);
  }
  std::size_t n_detections() const {
    return frames.empty() ? 0 : first_open(*frames.back()) + frames.back()->points.size();
  }

  // Trees that begin in an open frame count as tentative.
  void count(TreeStats& stats) const {
    OpenWindow::count(stats);
    stats.n_tentative += static_cast<std::int64_t>(seeds.size());
    stats.n_pending += static_cast<std::int64_t>(seeds.size());
  }
  void count_branches(TreeStats& stats) const {
    for (std::size_t i = 0; i < n_all(); ++i)
      stats.peak_branches = std::max<std::int64_t>(stats.peak_branches, tree(i).more.branches.size());
  }

  void advance(const MotionStep& step) {
    OpenWindow::advance(step);
    for (LiveTrack<Tree>& seed : seeds) seed.more.advance(live.m, step);
  }

  // Initiates a tree at each detection of the newest frame.
  void begin_trees() {
    const WindowFrame& frame = *frames.back();
    for (std::size_t j = 0; j < frame.points.size(); ++j) {
      if (frame.claimed[j] > new_track_claim) continue;
      LiveTrack<Tree> seed;
      seed.score = seed.best_score = live.birth_gain();
      seed.last = frame.points[j];
      seed.last_time = frame.time;
      seed.state = begin_state(live.m, seed.last);
      seed.more.key = n_trees++;
      seed.more.first = frame.number;
      BranchGrower(live, branches).plant(seed);
      Branch& b = seed.more.branches.front();
      b.path[frame.number % kMaxWindow] = static_cast<std::int32_t>(j);
      b.n_taken = 1;
      seeds.push_back(std::move(seed));
    }
  }

  // Decides the oldest frame, given the decision on every tree and, for each detection, the
  // probability that it belongs to none.
  template <typename Label>
  void carry_out(std::span<const TreeDecision> decisions, std::span<const double> free,
                 TreeStats& stats, Label&& label) {
    const std::shared_ptr<const WindowFrame> frame = pop();
    for (std::size_t j = 0; j < frame->points.size(); ++j)
      label(frame->first + static_cast<std::int64_t>(j), -1, std::clamp(free[j], 0.0, 1.0));
    const std::size_t n_live = live.size();
    for (std::size_t i = 0; i < n_live; ++i) {
      const TreeDecision& decision = decisions[i];
      const std::int32_t own = decision.exists ? decision.column : -1;
      carry(*frame, i, own, stats);
      if (own >= 0) {
        const Point last = live[i].last;
        live.take(i, own, last, frame->time, decision.probability, label);
      } else if (decision.exists) {
        miss(*frame, i);
      } else {
        end(i);
      }
      keep(*frame, i, decision.column, stats);
    }
    for (std::size_t k = 0; k < seeds.size(); ++k)
      if (seeds[k].more.first == frame->number && decisions[n_live + k].exists)
        begin(*frame, seeds[k], decisions[n_live + k].probability, stats);
    std::erase_if(seeds, [&](const LiveTrack<Tree>& s) { return s.more.first == frame->number; });
    live.end_tracks();
    live.so_far.add(frame->time, frame->points.size());
  }

 private:
  // Turns a seed into a track, with its branches that have a second detection.
  void begin(const WindowFrame& frame, LiveTrack<Tree>& seed, double probability,
             TreeStats& stats) {
    const std::int32_t j = seed.more.branches.front().taken(frame.number);
    LiveTrack<Tree>& track = live.begin(j, frame.points[j], frame.time, live.birth_gain());
    track.pending.back().confidence = probability;
    track.more.key = seed.more.key;
    track.more.branches = std::move(seed.more.branches);
    track.more.predicted = std::move(seed.more.predicted);
    if (n_open() == 0)
      regrow(track, stats);
    else
      settle(frame, j, track);
  }
};

}  // namespace asterism
