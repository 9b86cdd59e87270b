// Tracking with one hard decision per frame: predict, gate, group, assign, update. The life cycle
// of a track is that of tracks/live_tracks.hpp.
//
// The methods differ only in how the candidates of a frame are assigned (`Pairing`).
#pragma once

#include <cmath>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "frame/frame_pairing.hpp"
#include "tracks/carried_tracks.hpp"
#include "tracks/live_tracks.hpp"

namespace asterism {

class FrameTracker {
 public:
  FrameTracker(const MotionModel& model, const ScoreModel& score, const LifeOptions& life,
               const PairingOptions& options, const CarryOptions& carry)
      : live_(model, score, life), opt_(options), carried_(model, score, carry) {}

  // Processes the points of the next frame. Calls label(detection, track id, confidence) for every
  // detection whose label is now decided: those of this frame in confirmed tracks and, when a track
  // is confirmed, its earlier ones. Detections are numbered from 0 in order of arrival.
  template <typename Label>
  FrameStats step(double time, const MotionStep& step, std::span<const Point> points, Label&& label) {
    FrameStats stats;
    find_candidates(time, step, points, stats);
    stats.n_candidates = static_cast<std::int64_t>(s_.candidates.size());
    s_.pairs.begin(live_.size(), points.size());
    // Confirmed tracks are assigned first. The prediction of a tentative track is so uncertain that
    // it fits almost any detection. A single frame cannot account for the disappearance of the
    // marker whose detection it would take.
    match_all(true, points, stats);
    match_all(false, points, stats);
    update_tracks(time, points, stats, label);
    if (!opt_.is_strict)
      begin_tracks(time, points);
    else if (live_.so_far.n_frames == 0)
      begin_strictly(time, points, label);
    carried_.learn(live_);
    live_.count(stats);
    live_.so_far.add(time, points.size());
    total_.add(stats);
    return stats;
  }

  bool has_confidence() const { return false; }
  const MotionModel& motion() const { return live_.m; }
  std::int64_t n_ids() const { return live_.next_id; }
  const LiveTracks<>& live() const { return live_; }
  const Progress& so_far() const { return live_.so_far; }
  const FrameStats& total() const { return total_; }

 private:
  struct Memory {
    std::vector<Candidate> candidates, eligible;
    FramePairing pairs;
  };

  // Gain of the log likelihood of the frame from a track's `gain`. For a tentative track, the gain
  // is weighted with the odds that the track is a marker.
  double odds(std::size_t i, double gain) {
    return live_[i].is_confirmed() ? gain : softplus(live_[i].score + gain);
  }

  void find_candidates(double time, const MotionStep& step, std::span<const Point> points,
                       FrameStats& stats) {
    if (opt_.is_strict) {
      live_.predict_all(step);
      return pair_all(points);
    }
    const double over = live_.leftover_gain();
    // A confirmed track takes a detection only if that is more likely than missing it and leaving
    // the detection unassigned.
    const auto min_log_likelihood_of = [&](std::size_t i, double gain) {
      const std::int32_t gap = live_[i].gap;
      return live_[i].is_confirmed() ? live_.miss_gain(gap) + over - live_.hit_gain(gap) + gain
                                     : -std::numeric_limits<double>::infinity();
    };
    const auto gain_of = [&](std::size_t i, double log_likelihood) {
      const std::int32_t gap = live_[i].gap;
      return odds(i, live_.hit_gain(gap) + log_likelihood) - odds(i, live_.miss_gain(gap)) - over;
    };
    carried_.list(live_, time, step, points, 0.0, min_log_likelihood_of, gain_of, s_.candidates,
                  stats);
  }

  void pair_all(std::span<const Point> points) {
    std::array<double, kMaxModes> each{};
    s_.candidates.clear();
    for (std::size_t i = 0; i < live_.size(); ++i)
      for (std::size_t j = 0; j < points.size(); ++j) {
        const Prediction& prediction = live_.prediction(i);
        const double gain = prediction.log_likelihood(points[j], each);
        const double distance2 = squared_distance(points[j], prediction.center, live_.m.axis.D);
        s_.candidates.push_back(
            {static_cast<std::int32_t>(i), static_cast<std::int32_t>(j), gain, distance2});
      }
  }

  // Assigns unassigned detections to the confirmed or to the tentative tracks.
  void match_all(bool confirmed, std::span<const Point> points, FrameStats& stats) {
    s_.eligible.clear();
    for (const Candidate& c : s_.candidates)
      if (live_[c.row].is_confirmed() == confirmed && !s_.pairs.is_taken[c.column])
        s_.eligible.push_back(c);
    s_.pairs.pair(s_.eligible, points, live_.m.axis.D, opt_, stats);
  }

  // The measurement of a track: its detection, or the likelihood-weighted mean of several.
  Point measured(std::size_t i, std::span<const Point> points) const {
    const Point& own = points[s_.pairs.match[i]];
    std::array<double, kMaxModes> each{};
    const Prediction& prediction = live_.prediction(i);
    const int D = live_.m.axis.D;
    double total = 1;
    Point sum = own;
    const double log_own = s_.pairs.extras.empty() ? 0 : prediction.log_likelihood(own, each);
    for (const auto& [row, column] : s_.pairs.extras) {
      if (row != static_cast<std::int32_t>(i)) continue;
      const double weight = std::exp(prediction.log_likelihood(points[column], each) - log_own);
      total += weight;
      for (int d = 0; d < D; ++d) sum[d] += weight * points[column][d];
    }
    if (total == 1) return own;
    for (int d = 0; d < D; ++d) sum[d] /= total;
    return sum;
  }

  template <typename Label>
  void begin_strictly(double time, std::span<const Point> points, Label&& label) {
    for (std::size_t j = 0; j < points.size(); ++j) {
      // Without a model of clutter the odds that the track is a marker are unknown.
      LiveTrack<NoMore>& track =
          live_.begin(j, points[j], time, std::numeric_limits<double>::quiet_NaN());
      track.pending = {};
      track.id = live_.next_id++;
      label(live_.so_far.n_seen + static_cast<std::int64_t>(j), track.id, 1.0);
    }
  }

  template <typename Label>
  void update_tracks(double time, std::span<const Point> points, FrameStats& stats,
                     Label&& label) {
    for (std::size_t i = 0; i < live_.size(); ++i) {
      LiveTrack<NoMore>& track = live_[i];
      const std::int32_t j = s_.pairs.match[i];
      if (j < 0) {
        track.score += live_.miss_gain(track.gap);
        ++track.gap;
        carried_.miss(track, i, stats);
        continue;
      }
      carried_.take(live_, i, points[j], stats);
      const Point y = measured(i, points);
      track.score += live_.hit_gain(track.gap) + update(live_.m, live_.prediction(i), y, track.state);
      live_.take(i, j, y, time, 1.0, label);
    }
    live_.end_tracks();
  }

  void begin_tracks(double time, std::span<const Point> points) {
    for (std::size_t j = 0; j < points.size(); ++j)
      if (!s_.pairs.is_taken[j]) live_.begin(j, points[j], time, live_.birth_gain());
  }

  LiveTracks<> live_;
  PairingOptions opt_;
  CarriedTracks carried_;
  FrameStats total_;
  Scratch<Memory> s_;
};

}  // namespace asterism
