// The life of a track, frame by frame: predicted, gated, updated or missed; born, believed, ended.
//
// How the points of a frame are shared out among the tracks is each method's own; all the rest is
// here once. Everything is a plain value: copying it forks the run.
//
// The score of a track is the log odds of “these detections are one marker” against “they are
// clutter”: log λ_b - log λ_f + log P_d at birth, then per frame log(1 - p_z) and either
// log P_d N(y; ŷ, S) / λ_f or log(1 - P_d), with P_r for P_d after a miss.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <span>
#include <stdexcept>
#include <utility>
#include <vector>

#include "base/scratch.hpp"
#include "filter/gating.hpp"
#include "filter/imm.hpp"
#include "filter/track_filter.hpp"
#include "math/log_sums.hpp"
#include "solve/connected_components.hpp"

namespace asterism {

struct LifeOptions {
  double gate = 0;           // χ² bound on a pairing
  double confirm_score = 0;  // log odds at which a tentative track is believed
  double delete_drop = 0;    // a tentative track ends when its score falls so far below its best
  std::int64_t max_candidates = 0;
};

// A detection of a tentative track, and how sure it is that it belongs to it, if it is a marker's.
struct Pending {
  std::int64_t detection = 0;
  double confidence = 1;
};

// What a tracker keeps beside a track, where it keeps nothing.
struct NoMore {};

template <typename More = NoMore>
struct LiveTrack {
  std::int64_t id = -1;  // -1 while tentative
  std::int32_t gap = 0;  // frames since the last detection
  std::int32_t carried = 0;  // of these, in which its neighbours told where it is
  double score = 0, best_score = 0;
  double p_missed = 0;  // in the last frame, if it exists: where pairings are weighed, not decided
  double first_time = 0, last_time = 0;
  Point last{};
  MotionState state;
  std::vector<Pending> pending;
  [[no_unique_address]] More more;

  bool is_confirmed() const { return id >= 0; }
  std::int32_t untold() const { return gap - carried; }  // frames in which nobody told where it is
};

// Of one frame, or of many: sums of what is counted, the greatest of what is a size. Trackers that
// count more derive from it.
struct FrameStats {
  std::int64_t n_candidates = 0, n_groups = 0, largest_group = 0;
  std::int64_t n_confirmed = 0, n_tentative = 0;  // at the end
  std::int64_t n_pending = 0;  // detections that tentative tracks hold at the end
  std::int64_t n_bonds = 0;    // of markers, at the end
  // Occluded tracks that were carried, by frames; those that were seen again; points that neighbours
  // refused.
  std::int64_t n_carried = 0, n_returned = 0, n_refused = 0;

  void add(const FrameStats& next) {
    add_work(next);
    n_confirmed = next.n_confirmed;
    n_tentative = next.n_tentative;
    n_pending = next.n_pending;
    n_bonds = next.n_bonds;
  }

  // What it took, without what there is at the end.
  void add_work(const FrameStats& next) {
    n_candidates += next.n_candidates;
    n_groups += next.n_groups;
    largest_group = std::max(largest_group, next.largest_group);
    n_carried += next.n_carried;
    n_returned += next.n_returned;
    n_refused += next.n_refused;
  }
};

// Thrown when a frame has more candidates than allowed.
struct CandidateLimit : std::runtime_error {
  using std::runtime_error::runtime_error;
};

// What a tracker has taken.
struct Progress {
  std::int64_t n_frames = 0, n_seen = 0;  // frames, detections
  double last_time = -std::numeric_limits<double>::infinity();

  void add(double time, std::size_t n_points) {
    n_seen += static_cast<std::int64_t>(n_points);
    last_time = time;
    ++n_frames;
  }
};

// Working memory of one step.
struct GateMemory {
  std::vector<Prediction> predictions;
  std::vector<std::size_t> asked;
  std::vector<double> radii;  // of these
  PointGrid grid;
};

template <typename More = NoMore>
class LiveTracks {
 public:
  using Track = LiveTrack<More>;

  MotionModel m;
  ScoreModel sm;
  LifeOptions opt;
  std::vector<Track> tracks;
  std::int64_t next_id = 0;
  Progress so_far;

  LiveTracks(const MotionModel& motion, const ScoreModel& score, const LifeOptions& options)
      : m(motion), sm(score), opt(options) {}

  Track& operator[](std::size_t i) { return tracks[i]; }
  const Track& operator[](std::size_t i) const { return tracks[i]; }
  std::size_t size() const { return tracks.size(); }
  const Prediction& prediction(std::size_t i) const { return s_.predictions[i]; }

  double birth_gain() const { return sm.log_birth + sm.log_detect - sm.log_clutter; }
  // Of a track that was missed in the last `missed` frames; less the likelihood of what it takes.
  double hit_gain(std::int64_t missed) const {
    return sm.log_survive + sm.log_seen(missed) - sm.log_clutter;
  }
  double miss_gain(std::int64_t missed) const { return sm.log_survive + sm.log_missed(missed); }
  double misses_gain(std::int64_t missed, std::int64_t n) const {
    return static_cast<double>(n) * sm.log_survive + sm.log_misses(missed, n);
  }
  // A point that no track takes is clutter or a new marker, not clutter alone.
  double leftover_gain() const { return softplus(birth_gain()); }

  // Adds the pairings within the gates of the tracks for which is_asked(i) holds, by track, by their
  // predictions as they are.
  //
  //   gain(i, log likelihood)  of a pairing; it is listed where this is above `least_gain`
  //   least(i, least_gain)     no point of less log likelihood gives track i as much
  template <typename Asked, typename Least, typename Gain>
  void list(double time, std::span<const Point> points, double least_gain, Asked&& is_asked,
            Least&& least, Gain&& gain, std::vector<Candidate>& out) {
    s_.asked.clear();
    s_.radii.clear();
    double sum_radii = 0;
    double r_most = 0;
    for (const Point& y : points) r_most = std::max(r_most, y.r);
    for (std::size_t i = 0; i < tracks.size(); ++i) {
      if (!is_asked(i)) continue;
      s_.asked.push_back(i);
      s_.radii.push_back(s_.predictions[i].radius(opt.gate, least(i, least_gain), r_most));
      sum_radii += std::max(s_.radii.back(), 0.0);
    }
    if (s_.asked.empty() || points.empty()) return;
    s_.grid.build(points, m.axis.D, 2 * sum_radii / static_cast<double>(s_.asked.size()));
    std::array<double, kMaxModes> each{};
    for (std::size_t a = 0; a < s_.asked.size(); ++a) {
      const std::size_t i = s_.asked[a];
      const Prediction& prediction = s_.predictions[i];
      const auto add = [&](std::int32_t j, double distance2) {
        const double won = gain(i, prediction.log_likelihood(points[j], each));
        if (won > least_gain && std::isfinite(won))
          out.push_back({static_cast<std::int32_t>(i), j, won, distance2});
      };
      within_gate(s_.grid, points, prediction, s_.radii[a], tracks[i].last,
                  time - tracks[i].last_time, add);
      if (static_cast<std::int64_t>(out.size()) > opt.max_candidates) throw CandidateLimit("too many candidates in a frame");
    }
  }
  // Track i is expected elsewhere than by its own state.
  void expect(std::size_t i, const Prediction& prediction) { s_.predictions[i] = prediction; }

  // Calls visit(point, squared distance from the prediction) for every point within `radius` that is
  // in the gate and that the marker, `dt` ago at `last`, can have come to.
  template <typename Visit>
  void within_gate(const PointGrid& grid, std::span<const Point> points,
                   const Prediction& prediction, double radius, const Point& last, double dt,
                   Visit&& visit) const {
    if (radius < 0) return;
    grid.within(prediction.center, radius, [&](std::int32_t j, double distance2) {
      if (is_reachable(sm, last, points[j], dt, m.axis.D) &&
          prediction.is_gated(points[j], opt.gate))
        visit(j, distance2);
    });
  }

  void predict_all(const MotionStep& step) {
    s_.predictions.resize(tracks.size());
    for (std::size_t i = 0; i < tracks.size(); ++i) {
      predict(m, step, tracks[i].state);
      s_.predictions[i] = Prediction(m, tracks[i].state);
    }
  }

  // Track i has detection j of this frame, measured at y. Its state and score are the caller's.
  // Calls label(detection, id, confidence) for every detection whose label is decided now: this one
  // of a believed track, and all so far of a track that is believed from now on.
  template <typename Label>
  void take(std::size_t i, std::int32_t j, const Point& y, double time, double confidence,
            Label&& label) {
    Track& track = tracks[i];
    track.last = y;
    track.last_time = time;
    track.gap = track.carried = 0;
    if (track.is_confirmed()) {
      label(so_far.n_seen + j, track.id, confidence);
      return;
    }
    track.pending.push_back({so_far.n_seen + j, confidence});
    if (track.score < opt.confirm_score) return;
    track.id = next_id++;
    for (const Pending& p : track.pending) label(p.detection, track.id, p.confidence);
    track.pending = {};
  }

  // After every track was updated or missed: a link spans at most max_gap frames in which nobody told
  // where the marker is, and a tentative track also ends by its score.
  void end_tracks() {
    std::erase_if(tracks, [&](Track& track) {
      track.best_score = std::max(track.best_score, track.score);
      const bool is_doubted =
          !track.is_confirmed() && track.best_score - track.score > opt.delete_drop;
      return track.untold() >= sm.max_gap || is_doubted;
    });
  }

  // A track begins at detection j of this frame.
  Track& begin(std::size_t j, const Point& y, double time, double score) {
    Track& track = tracks.emplace_back();
    track.score = track.best_score = score;
    track.first_time = track.last_time = time;
    track.last = y;
    track.state = begin_state(m, y);
    track.pending.push_back({so_far.n_seen + static_cast<std::int64_t>(j), 1.0});
    return track;
  }

  void count(FrameStats& stats) const {
    for (const Track& track : tracks) {
      ++(track.is_confirmed() ? stats.n_confirmed : stats.n_tentative);
      stats.n_pending += static_cast<std::int64_t>(track.pending.size());
    }
  }

 private:
  Fresh<GateMemory> s_;
};

}  // namespace asterism
