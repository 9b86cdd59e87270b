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

  // Adds the information on a frame that follows `n_open` undecided ones.
  void advise(const LiveTracks<Tree>& live, std::int64_t n_open, WindowFrame& frame,
              FrameStats& stats) {
    auto& [rows, carried] = all_.own();
    list_rows(live, rows);
    // Gain of a confirmed track from a detection over missing it and leaving it unassigned.
    const double over = rows.leftover_gain();
    const auto base = [&](std::size_t i) {
      return rows.hit_gain(rows[i].gap) - rows.miss_gain(rows[i].gap) - over;
    };
    carried.list(
        rows, frame.time, frame.step, frame.points, 0.0,
        [&](std::size_t i, double gain) { return gain - base(i); },
        [&](std::size_t i, double log_likelihood) { return base(i) + log_likelihood; },
        s_.candidates, stats, n_open);
    for (std::size_t i = 0; i < rows.size(); ++i) {
      NeighbourAdvice& own = s_.advice[s_.place[i]];
      const std::int32_t replaced_by = carried.replaced_by(i);
      own.is_reappearance = own.is_reappearance || (replaced_by >= 0 && is_best(replaced_by));
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
    std::vector<std::size_t> place;  // index in `advice` of each row's track
    std::vector<NeighbourAdvice> advice;
    std::vector<Candidate> candidates;
  };

  // Lists the best branch of every confirmed track. If that branch has a detection in the last
  // frame, its best occluded branch is listed too; otherwise the detection of the best branch could
  // never be identified as a ghost.
  void list_rows(const LiveTracks<Tree>& live, LiveTracks<>& rows) {
    rows.tracks.clear();
    s_.place.clear();
    s_.advice.clear();
    for (const LiveTrack<Tree>& track : live.tracks) {
      const Branch& best = track.more.best();
      if (!track.is_confirmed() || best.has_ended) continue;
      s_.advice.emplace_back().track = track.more.key;
      add_row(track, best, rows);
      if (best.gap > 0) continue;
      const auto occluded = std::ranges::find_if(
          track.more.branches, [](const Branch& b) { return b.gap > 0 && !b.has_ended; });
      if (occluded != track.more.branches.end()) add_row(track, *occluded, rows);
    }
  }
  void add_row(const LiveTrack<Tree>& track, const Branch& b, LiveTracks<>& rows) {
    LiveTrack<>& row = rows.tracks.emplace_back();
    row.id = track.id;
    row.gap = b.gap;
    row.carried = b.carried;
    row.first_time = track.first_time;
    row.last_time = b.last_time;
    row.last = b.last;
    row.state = track.more.state_of(rows.m, b);
    s_.place.push_back(s_.advice.size() - 1);
  }
  bool is_best(std::size_t row) const { return row == 0 || s_.place[row] != s_.place[row - 1]; }

  SharedCopy<All> all_;
  Scratch<Memory> s_;
};

}  // namespace asterism
