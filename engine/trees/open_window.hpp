// The window of undecided frames, and the branches of every track over them.
//
// The decided part of a track is kept in tracks/live_tracks.hpp; its branches (trees/branches.hpp)
// are hypotheses about the continuation. The trackers decide the assignment of the oldest frame;
// this class applies it.
#pragma once

#include <cstdint>
#include <limits>
#include <memory>
#include <vector>

#include "tracks/live_tracks.hpp"
#include "trees/branches.hpp"
#include "trees/window_carrier.hpp"

namespace asterism {

struct OpenWindow {
  LiveTracks<Tree> live;
  BranchOptions branches;
  WindowCarrier carrier;
  std::vector<std::shared_ptr<const WindowFrame>> frames;
  std::int64_t n_trees = 0;
  // Largest number of branches of a track right after a further frame. In joint evaluation there is
  // no limit per track.
  std::int32_t max_grown = branches.is_joint ? BranchGrower::kAll
                                             : branches.max_branches;

  OpenWindow(const MotionModel& model, const ScoreModel& score, const LifeOptions& life,
             const BranchOptions& options, const CarryOptions& carry)
      : live(model, score, life), branches(options), carrier(model, score, life, carry) {
    branches.max_carried = carry.max_carried;
  }

  std::int32_t n_open() const { return static_cast<std::int32_t>(frames.size()); }
  bool is_full() const { return n_open() == branches.window; }

  void count(TreeStats& stats) const {
    live.count(stats);
    for (const LiveTrack<Tree>& track : live.tracks)
      stats.n_branches += static_cast<std::int64_t>(track.more.branches.size());
  }

  // Collects the information of rigid neighbours for an arriving frame.
  void advise(WindowFrame& frame, TreeStats& stats) {
    if (carrier.is_on()) carrier.advise(live, n_open(), frame, stats);
  }
  // Predicts all branches for an arriving frame.
  void advance(const MotionStep& step) {
    for (LiveTrack<Tree>& track : live.tracks) track.more.advance(live.m, step);
  }
  // Collects the claims of the confirmed tracks on its detections.
  void claim(WindowFrame& frame) const {
    BranchGrower grower(live, branches);
    for (const LiveTrack<Tree>& track : live.tracks)
      if (track.is_confirmed()) grower.claim(track, frame);
  }

  void push(std::shared_ptr<const WindowFrame> frame, TreeStats& stats) {
    frames.push_back(std::move(frame));
    BranchGrower grower(live, branches);
    for (LiveTrack<Tree>& track : live.tracks)
      grower.grow(*frames.back(), track, n_open(), max_grown, stats);
  }

  std::shared_ptr<const WindowFrame> pop() {
    std::shared_ptr<const WindowFrame> oldest = frames.front();
    frames.erase(frames.begin());
    return oldest;
  }

  // Updates the bonds after a decision.
  void learn() {
    if (carrier.is_on()) carrier.learn(live);
  }

  // Updates the decided part of track i over the frame just popped, with detection `own` or, if
  // that is -1, without. The caller updates the gap.
  void carry(const WindowFrame& frame, std::size_t i, std::int32_t own, TreeStats& stats) {
    LiveTrack<Tree>& track = live[i];
    const BranchGrower grower(live, branches);
    predict(live.m, frame.step, track.state);
    const NeighbourAdvice* advice = frame.advice_to(track.more.key);
    const Expected expected = grower.expected(track.state, track.gap, advice);
    track.place = own < 0 && expected.is_carried() ? advice->place : Carried{};
    if (own >= 0) {
      const Point& y = frame.points[own];
      const Prediction& prediction = expected.of(y);
      expected.choose(y, track.state);
      stats.n_returned += expected.is_carried();
      track.more.lambda = grower.next_lambda(track.more.lambda, prediction, y);
      ++track.more.n_updates;
      track.score += live.hit_gain(track.gap) + update(live.m, prediction, y, track.state);
      track.last = y;
      track.last_time = frame.time;
    } else if (grower.lives_on(expected, track.gap, advice)) {
      ++track.carried;
      ++stats.n_carried;
    } else {
      track.score += live.miss_gain(track.gap);
    }
  }

  // Records a missed detection of track i in that frame.
  void miss(const WindowFrame& frame, std::size_t i) {
    const NeighbourAdvice* advice = frame.advice_to(live[i].more.key);
    if (advice != nullptr && advice->is_reappearance)
      end(i);
    else
      ++live[i].gap;
  }
  void end(std::size_t i) { live[i].gap = live.sm.max_gap + live[i].carried; }

  // Keeps the branches that agree with the decision, and grows new ones if there are none.
  void keep(const WindowFrame& frame, std::size_t i, std::int32_t own, TreeStats& stats) {
    LiveTrack<Tree>& track = live[i];
    std::erase_if(track.more.branches,
                  [&](const Branch& b) { return b.taken(frame.number) != own; });
    if (track.more.branches.empty() || frames.empty())
      regrow(track, stats);
    else if (own >= 0)
      settle(frame, own, track);
  }

  // Moves `own` from the branches of a track into its decided part.
  void settle(const WindowFrame& frame, std::int32_t own, LiveTrack<Tree>& track) const {
    for (Branch& b : track.more.branches) {
      --b.n_taken;
      if (!branches.is_joint) {
        b.distance2[frame.number % kMaxWindow] = 0;
        b.score += frame.crowding(track.more.key, own);
      }
      b.score -= frame.bond_gains(track.more.key, own);
    }
  }

  void regrow(LiveTrack<Tree>& track, TreeStats& stats) {
    BranchGrower grower(live, branches);
    grower.plant(track);
    std::int32_t n = 0;
    for (const auto& frame : frames) {
      track.more.advance(live.m, frame->step);
      grower.grow(*frame, track, ++n, branches.max_branches, stats);
    }
  }
};

}  // namespace asterism
