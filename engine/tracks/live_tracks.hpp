// The life cycle of a track: prediction, gating, update or missed detection, initiation,
// confirmation and deletion.
//
// How detections are assigned to tracks is specific to each method; everything else is implemented
// here once. All state has value semantics: copying it forks the tracker.
//
// The score of a track is the log odds of “these detections are one marker” against “they are
// clutter”. It is log λ_b - log λ_f + log P_d at initiation. Each frame adds log(1 - p_z) and
// either log(P_d N(y; ŷ, S) / λ_f) or log(1 - P_d), with P_r for P_d after a missed detection.
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
#include "rigid/carried.hpp"
#include "solve/connected_components.hpp"

namespace asterism {

struct LifeOptions {
  double gate = 0;           // χ² gate of a pairing
  double confirm_score = 0;  // log odds at which a tentative track is confirmed
  // A tentative track is deleted when its score falls this far below its maximum.
  double delete_drop = 0;
  std::int64_t max_candidates = 0;
};

// A detection of a tentative track, and the probability that it belongs to the track if the track
// is a marker.
struct Pending {
  std::int64_t detection = 0;
  double confidence = 1;
};

// The additional data of a track for trackers that need none.
struct NoMore {};

template <typename More = NoMore>
struct LiveTrack {
  std::int64_t id = -1;  // -1 while tentative
  std::int32_t gap = 0;  // frames since the last detection
  std::int32_t carried = 0;  // of these, frames in which neighbours predicted its position
  double score = 0, best_score = 0;
  // Probability of a missed detection in the last frame if the track exists, for soft association.
  double p_missed = 0;
  double first_time = 0, last_time = 0;
  Point last{};
  MotionState state;
  // Where neighbours predict the occluded marker in the last frame, if the variance is finite. It is
  // no part of `state`.
  Carried place;
  std::vector<Pending> pending;
  [[no_unique_address]] More more;

  bool is_confirmed() const { return id >= 0; }
  // Missed frames without a prediction from neighbours.
  std::int32_t unpredicted() const { return gap - carried; }
};

// Statistics of one frame or of many: counts are summed, sizes are maxima. Trackers with further
// statistics derive from it.
struct FrameStats {
  std::int64_t n_candidates = 0, n_groups = 0, largest_group = 0;
  std::int64_t n_confirmed = 0, n_tentative = 0;  // at the end
  std::int64_t n_pending = 0;  // detections of tentative tracks at the end
  // Occluded tracks predicted from neighbours, counted per frame; occluded tracks detected again;
  // detections refused because of neighbours.
  std::int64_t n_carried = 0, n_returned = 0, n_refused = 0;

  void add(const FrameStats& next) {
    add_work(next);
    n_confirmed = next.n_confirmed;
    n_tentative = next.n_tentative;
    n_pending = next.n_pending;
  }

  // Adds the work done, without the state at the end.
  void add_work(const FrameStats& next) {
    n_candidates += next.n_candidates;
    n_groups += next.n_groups;
    largest_group = std::max(largest_group, next.largest_group);
    n_carried += next.n_carried;
    n_returned += next.n_returned;
    n_refused += next.n_refused;
  }
};

// Thrown if a frame has more candidates than allowed.
struct CandidateLimit : std::runtime_error {
  using std::runtime_error::runtime_error;
};

// The frames and detections that a tracker has processed.
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
  std::vector<std::size_t> selected;
  std::vector<double> radii;  // of these tracks
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
  // Gain of a detection without its likelihood, after `missed` missed frames.
  double hit_gain(std::int64_t missed) const {
    return sm.log_survive + sm.log_hit(missed) - sm.log_clutter;
  }
  double miss_gain(std::int64_t missed) const { return sm.log_survive + sm.log_missed(missed); }
  double misses_gain(std::int64_t missed, std::int64_t n) const {
    return static_cast<double>(n) * sm.log_survive + sm.log_misses(missed, n);
  }
  // A detection that no track takes is clutter or a new marker.
  double leftover_gain() const { return softplus(birth_gain()); }

  // Adds the candidates within the gates of the tracks for which is_selected(i) holds, ordered by
  // track. The predictions must be up to date.
  //
  //   gain(i, log likelihood)           gain of a pairing; it is listed if above `min_gain`
  //   min_log_likelihood(i, min_gain)   smallest log likelihood of a detection with that gain
  template <typename Selected, typename MinLogLikelihood, typename Gain>
  void list(double time, std::span<const Point> points, double min_gain, Selected&& is_selected,
            MinLogLikelihood&& min_log_likelihood, Gain&& gain, std::vector<Candidate>& out) {
    s_.selected.clear();
    s_.radii.clear();
    double sum_radii = 0;
    double max_r = 0;
    for (const Point& y : points) max_r = std::max(max_r, y.r);
    for (std::size_t i = 0; i < tracks.size(); ++i) {
      if (!is_selected(i)) continue;
      s_.selected.push_back(i);
      s_.radii.push_back(
          s_.predictions[i].radius(opt.gate, min_log_likelihood(i, min_gain), max_r));
      sum_radii += std::max(s_.radii.back(), 0.0);
    }
    if (s_.selected.empty() || points.empty()) return;
    s_.grid.build(points, m.axis.D, 2 * sum_radii / static_cast<double>(s_.selected.size()));
    std::array<double, kMaxModes> each{};
    for (std::size_t a = 0; a < s_.selected.size(); ++a) {
      const std::size_t i = s_.selected[a];
      const Prediction& prediction = s_.predictions[i];
      const auto add = [&](std::int32_t j, double distance2) {
        const double pairing_gain = gain(i, prediction.log_likelihood(points[j], each));
        if (pairing_gain > min_gain && std::isfinite(pairing_gain))
          out.push_back({static_cast<std::int32_t>(i), j, pairing_gain, distance2});
      };
      within_gate(s_.grid, points, prediction, s_.radii[a], tracks[i].last,
                  time - tracks[i].last_time, add);
      if (static_cast<std::int64_t>(out.size()) > opt.max_candidates) throw CandidateLimit("too many candidates in a frame");
    }
  }
  // Replaces the prediction of track i, for instance by one from its neighbours.
  void expect(std::size_t i, const Prediction& prediction) { s_.predictions[i] = prediction; }

  // Calls visit(point, squared distance from the prediction) for every point within `radius` that
  // is in the gate and that the marker can have reached from `last` within `dt`.
  template <typename Visit>
  void within_gate(const PointGrid& grid, std::span<const Point> points,
                   const Prediction& prediction, double radius, const Point& last, double dt,
                   Visit&& visit) const {
    if (radius < 0) return;
    grid.within(prediction.center, radius, [&](std::int32_t j, double distance2) {
      if (is_reachable(sm, last, points[j], dt) &&
          prediction.is_gated(points[j], opt.gate))
        visit(j, distance2);
    });
  }

  // Predicts the tracks from number `first` on; those before are predicted already.
  void predict_all(const MotionStep& step, std::size_t first = 0) {
    s_.predictions.resize(first);
    for (std::size_t i = first; i < tracks.size(); ++i) {
      predict(m, step, tracks[i].state);
      s_.predictions.emplace_back(m, tracks[i].state);
    }
  }

  // Assigns detection j of this frame, measured at y, to track i. The caller updates state and
  // score. Calls label(detection, id, confidence) for every detection whose label is now decided:
  // this one for a confirmed track, and all so far when the track is confirmed now.
  template <typename Label>
  void take(std::size_t i, std::int32_t j, const Point& y, double time, double confidence,
            Label&& label) {
    Track& track = tracks[i];
    track.last = y;
    track.last_time = time;
    track.gap = track.carried = 0;
    track.place = {};
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

  // Deletes tracks after every track was updated or missed. A link spans at most max_gap frames
  // without a position from neighbours. A tentative track is also deleted if its score has fallen
  // too far.
  void end_tracks() {
    std::erase_if(tracks, [&](Track& track) {
      track.best_score = std::max(track.best_score, track.score);
      const bool has_fallen =
          !track.is_confirmed() && track.best_score - track.score > opt.delete_drop;
      return track.unpredicted() >= sm.max_gap || has_fallen;
    });
  }

  // Initiates a track at detection j of this frame.
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
  Scratch<GateMemory> s_;
};

}  // namespace asterism
