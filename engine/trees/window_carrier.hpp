// Rigid neighbours in trackers with a window: information on an arriving frame is computed from the
// best branches of all confirmed tracks (tracks/carried_tracks.hpp) and used by each of their
// branches.
//
// Bonds are estimated from decided frames only. The information on a frame is computed once, on
// arrival, and stored with the frame, so that branches grown over it later use the same values.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <utility>
#include <vector>

#include "base/scratch.hpp"
#include "base/shared_copy.hpp"
#include "tracks/carried_tracks.hpp"
#include "tracks/live_tracks.hpp"
#include "trees/branches.hpp"

namespace asterism {

class WindowCarrier {
 public:
  WindowCarrier(const MotionModel& m, const ScoreModel& score, const LifeOptions& life,
               const CarryOptions& carry) {
    if (carry.is_on) all_ = SharedCopy(All{{m, score, life}, {m, score, carry}});
  }

  bool is_on() const { return all_.has_value(); }

  // Adds the information on a frame that follows `n_open` undecided ones. Rows are the best
  // branches and, for tracks without a clear candidate, an occluded one.
  void advise(const LiveTracks<Tree>& live, std::int64_t n_open, WindowFrame& frame,
              FrameStats& stats) {
    auto& [rows, carried] = all_.own();
    list_best(live, rows);
    const std::size_t n_best = rows.size();
    // Gain of a confirmed track from a detection over missing it and leaving it unassigned.
    const double over = rows.leftover_gain();
    const auto base = [&](std::size_t i) {
      return rows.hit_gain(rows[i].gap) - rows.miss_gain(rows[i].gap) - over;
    };
    carried.list(
        rows, frame.time, frame.step, frame.points, 0.0,
        [&](std::size_t i, double gain) { return gain - base(i); },
        [&](std::size_t i, double log_likelihood) { return base(i) + log_likelihood; },
        s_.candidates, stats, n_open,
        [&](std::size_t i) { add_occluded(i, rows); });
    for (std::size_t i = 0; i < rows.size(); ++i) {
      NeighbourAdvice& own = s_.advice[s_.place[i]];
      const std::int32_t replaced_by = carried.replaced_by(i);
      if (replaced_by >= 0 && std::cmp_less(replaced_by, n_best)) own.is_reappearance = true;
      if (!carried.is_carried(i)) continue;
      own.is_carried = true;
      own.is_uncertain = carried.is_uncertain(i);
      own.place = carried.place(i);
    }
    for (const Candidate& c : s_.candidates)
      if (carried.is_carried(c.row)) s_.advice[s_.place[c.row]].may_take.push_back(c.column);
    for (const CarriedTracks::BondGain& gain : carried.bond_gains())
      s_.advice[s_.place[gain.row]].bond_gains.emplace_back(gain.column, gain.nats);
    for (NeighbourAdvice& own : s_.advice)
      if (own.is_carried || own.is_reappearance || !own.bond_gains.empty())
        frame.advice.push_back(std::move(own));
  }

  // Updates the bonds after a decision.
  void learn(const LiveTracks<Tree>& live) { all_.own().carried.learn(live); }

 private:
  struct All {
    LiveTracks<> rows;
    CarriedTracks carried;
  };
  struct Memory {
    std::vector<const LiveTrack<Tree>*> trees;  // the listed tracks
    std::vector<NeighbourAdvice> advice;        // for each of them
    std::vector<std::size_t> place;             // of each row's track in these lists
    std::vector<Candidate> candidates;
  };

  // Lists the best branch of every confirmed track.
  void list_best(const LiveTracks<Tree>& live, LiveTracks<>& rows) {
    rows.tracks.clear();
    s_.place.clear();
    s_.trees.clear();
    s_.advice.clear();
    for (const LiveTrack<Tree>& track : live.tracks) {
      const Branch& best = track.more.best();
      if (!track.is_confirmed() || best.has_ended) continue;
      s_.trees.push_back(&track);
      s_.advice.emplace_back().track = track.more.key;
      add_row(s_.trees.size() - 1, best, rows);
    }
  }
  // Adds the best branch of a listed track that misses the last frame: what it was given there may
  // be a ghost.
  void add_occluded(std::size_t i, LiveTracks<>& rows) {
    const LiveTrack<Tree>& track = *s_.trees[i];
    const auto occluded = std::ranges::find_if(
        track.more.branches, [](const Branch& b) { return b.gap > 0 && !b.has_ended; });
    if (occluded != track.more.branches.end()) add_row(i, *occluded, rows);
  }
  void add_row(std::size_t i, const Branch& b, LiveTracks<>& rows) {
    const LiveTrack<Tree>& track = *s_.trees[i];
    LiveTrack<>& row = rows.tracks.emplace_back();
    row.id = track.id;
    row.gap = b.gap;
    row.carried = b.carried;
    row.first_time = track.first_time;
    row.last_time = b.last_time;
    row.last = b.last;
    row.state = track.more.state_of(rows.m, b);
    s_.place.push_back(i);
  }

  SharedCopy<All> all_;
  Scratch<Memory> s_;
};

}  // namespace asterism
