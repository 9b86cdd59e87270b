// Frame by frame: predict, gate, group, match, update; tracks are born, confirmed, coast and end.
//
// What differs between methods is how the candidates of a frame are matched (`Matcher`); all the
// rest, the life of a track, is here once. The state is a plain value: copying it forks the run.
//
// The score of a track is the log odds of “these detections are one marker” against “they are
// clutter”: log λ_b - log λ_f + log P_d at birth, then per frame log(1 - p_z) and either
// log P_d N(y; ŷ, S) / λ_f or log(1 - P_d).
#pragma once

#include <cmath>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "assignment.hpp"
#include "deferred_acceptance.hpp"
#include "filter_tracks.hpp"
#include "gating.hpp"
#include "groups.hpp"
#include "modes.hpp"

namespace asterism {

enum class Matcher : std::int32_t {
  assignment = 0,           // most likely joint pairing
  marriage_by_tracks = 1,   // stable; best for the tracks
  marriage_by_points = 2,   // stable; best for the detections
};

struct TrackerOptions {
  Matcher matcher = Matcher::assignment;
  double gate = 0;             // χ² bound on a pairing
  double confirm_score = 0;    // log odds at which a tentative track is believed
  double delete_drop = 0;      // a tentative track ends when its score falls so far below its best
  std::int64_t max_candidates = 0;
  // The 2010 report's own method: the points of the first frame are the tracks, every pair is a
  // candidate, and no track begins, coasts or ends. Every frame has as many points as the first.
  bool is_strict = false;
  // Hospitals and residents: so many detections may marry one track, those beyond its favourite
  // within a distance of it; they are merged by their likelihood.
  std::int32_t capacity = 1;
  double merged_within = 0;
};

struct LiveTrack {
  std::int64_t id = -1;  // -1 while tentative
  std::int32_t gap = 0;  // frames since the last detection
  double score = 0, best_score = 0;
  double last_time = 0;
  Point last{};
  MotionState state;
  std::vector<std::int64_t> pending;  // detections of a tentative track

  bool is_confirmed() const { return id >= 0; }
};

struct FrameStats {
  std::int64_t n_candidates = 0, n_groups = 0, largest_group = 0;
  std::int64_t n_confirmed = 0, n_tentative = 0;
  std::int64_t n_pending = 0;  // detections that tentative tracks still hold
};

class CandidateLimit {};  // thrown when a frame has more candidates than allowed

// Working memory of one step, kept from step to step. A copied tracker starts with its own.
struct FrameScratch {
  FrameScratch() = default;
  FrameScratch(const FrameScratch&) : FrameScratch() {}
  FrameScratch& operator=(const FrameScratch&) { return *this; }

  std::vector<Candidate> candidates, eligible;
  std::vector<Prediction> predictions;
  std::vector<double> radii;
  std::vector<std::int32_t> match;
  std::vector<std::pair<std::int32_t, std::int32_t>> extras;  // further detections of a track
  std::vector<char> is_taken;
  PointGrid grid;
  Assignment assignment;
};

class FrameTracker {
 public:
  FrameTracker(const MotionModel& model, const ScoreModel& score, const TrackerOptions& options)
      : m_(model), sm_(score), opt_(options) {}

  // Take the points of the next frame. Calls label(detection, track id) for every detection whose
  // label is decided now: those of this frame in confirmed tracks and, when a track is confirmed,
  // its earlier ones. Detections are numbered from 0 in order of arrival.
  template <typename Label>
  FrameStats step(double time, const MotionStep& step, std::span<const Point> points, Label&& label) {
    FrameStats stats;
    find_candidates(time, step, points);
    stats.n_candidates = static_cast<std::int64_t>(s_.candidates.size());
    s_.match.assign(tracks_.size(), -1);
    s_.is_taken.assign(points.size(), 0);
    s_.extras.clear();
    // Believed tracks first. A tentative one knows so little that it fits almost anything, and a
    // single frame cannot see that the marker which it takes over would have to vanish for good.
    match_all(true, points, stats);
    match_all(false, points, stats);
    update_tracks(time, points, label);
    if (!opt_.is_strict)
      begin_tracks(time, points);
    else if (n_frames_ == 0)
      begin_strictly(time, points, label);
    for (const LiveTrack& track : tracks_) {
      ++(track.is_confirmed() ? stats.n_confirmed : stats.n_tentative);
      stats.n_pending += static_cast<std::int64_t>(track.pending.size());
    }
    n_seen_ += static_cast<std::int64_t>(points.size());
    last_time_ = time;
    ++n_frames_;
    return stats;
  }

  std::int64_t n_frames() const { return n_frames_; }
  std::int64_t n_seen() const { return n_seen_; }
  std::int64_t n_ids() const { return next_id_; }
  double last_time() const { return last_time_; }
  const MotionModel& model() const { return m_; }
  const std::vector<LiveTrack>& tracks() const { return tracks_; }

 private:
  // log(1 + eˣ)
  static double softplus(double x) { return x > 30 ? x : std::log1p(std::exp(x)); }

  // How much likelier a frame becomes by a track's `gain`: by all of it for a believed track, and
  // for a tentative one weighed with the odds that it is a marker at all.
  double odds(const LiveTrack& track, double gain) const {
    return track.is_confirmed() ? gain : softplus(track.score + gain);
  }

  double miss_gain() const { return sm_.log_survive + sm_.log_miss; }
  // A point that no track takes is clutter or a new marker, not clutter alone.
  double leftover_gain() const {
    return softplus(sm_.log_birth + sm_.log_detect - sm_.log_clutter);
  }
  double hit_gain() const { return sm_.log_survive + sm_.log_detect - sm_.log_clutter; }

  void find_candidates(double time, const MotionStep& step, std::span<const Point> points) {
    const int D = m_.axis.D;
    s_.candidates.clear();
    s_.predictions.resize(tracks_.size());
    s_.radii.resize(tracks_.size());
    double sum_radii = 0;
    // A believed track takes a point only if that beats missing it and leaving the point over.
    const double least = sm_.log_miss + sm_.log_clutter + leftover_gain() - sm_.log_detect;
    for (std::size_t i = 0; i < tracks_.size(); ++i) {
      LiveTrack& track = tracks_[i];
      predict(m_, step, track.state);
      s_.predictions[i] = Prediction(m_, track.state);
      s_.radii[i] = s_.predictions[i].radius(
          opt_.gate, track.is_confirmed() ? least : -std::numeric_limits<double>::infinity());
      sum_radii += std::max(s_.radii[i], 0.0);
    }
    if (tracks_.empty() || points.empty()) return;
    if (opt_.is_strict) return pair_all(points);
    s_.grid.build(points, D, 2 * sum_radii / static_cast<double>(tracks_.size()));
    for (std::size_t i = 0; i < tracks_.size(); ++i) {
      if (s_.radii[i] < 0) continue;
      const LiveTrack& track = tracks_[i];
      const Prediction& prediction = s_.predictions[i];
      const double reach = sm_.max_speed * (time - track.last_time) + sm_.speed_margin;
      const double if_missed = odds(track, miss_gain()) + leftover_gain();
      std::array<double, kMaxModes> each{};
      s_.grid.within(prediction.center, s_.radii[i], [&](std::int32_t j, double distance2) {
        if (squared_distance(points[j], track.last, D) > reach * reach) return;
        if (!prediction.is_gated(points[j], opt_.gate)) return;
        const double hit = hit_gain() + prediction.log_likelihood(points[j], each);
        const double gain = odds(track, hit) - if_missed;
        if (gain > 0 && std::isfinite(gain)) s_.candidates.push_back({static_cast<std::int32_t>(i), j, gain, distance2});
      });
      if (static_cast<std::int64_t>(s_.candidates.size()) > opt_.max_candidates)
        throw CandidateLimit{};
    }
  }

  void pair_all(std::span<const Point> points) {
    std::array<double, kMaxModes> each{};
    for (std::size_t i = 0; i < tracks_.size(); ++i)
      for (std::size_t j = 0; j < points.size(); ++j) {
        const Prediction& prediction = s_.predictions[i];
        const double gain = prediction.log_likelihood(points[j], each);
        const double distance2 = squared_distance(points[j], prediction.center, m_.axis.D);
        s_.candidates.push_back(
            {static_cast<std::int32_t>(i), static_cast<std::int32_t>(j), gain, distance2});
      }
  }

  // Pairs the believed tracks, or the tentative ones, with points that are still free.
  void match_all(bool confirmed, std::span<const Point> points, FrameStats& stats) {
    s_.eligible.clear();
    for (const Candidate& c : s_.candidates)
      if (tracks_[c.row].is_confirmed() == confirmed && !s_.is_taken[c.column])
        s_.eligible.push_back(c);
    const Groups groups =
        connected_groups(s_.eligible, static_cast<std::int32_t>(tracks_.size()),
                         static_cast<std::int32_t>(points.size()));
    for (std::size_t g = 0; g < groups.size(); ++g) {
      const bool is_alone = groups[g].size() == 1 && !opt_.is_strict;
      if (is_alone || opt_.matcher == Matcher::assignment)
        s_.assignment.solve(groups[g], s_.match);
      else
        marry(groups[g], points, opt_.matcher == Matcher::marriage_by_points);
      stats.largest_group = std::max<std::int64_t>(stats.largest_group, groups[g].size());
    }
    stats.n_groups += static_cast<std::int64_t>(groups.size());
    for (const Candidate& c : s_.eligible)
      if (s_.match[c.row] == c.column) s_.is_taken[c.column] = 1;
    for (const auto& [row, column] : s_.extras) s_.is_taken[column] = 1;
  }

  // Tracks rank detections by predictive density; detections rank tracks by distance. A track that
  // may have several detections stands in the market as often, its copies in their order.
  void marry(std::span<const Candidate> group, std::span<const Point> points, bool by_points) {
    struct Wish {
      std::int32_t proposer, receiver;
      double rank, cost;
    };
    const std::int32_t q = opt_.capacity;
    std::vector<Wish> wishes;
    auto wish = [&](const Candidate& c, std::int32_t copy) {
      const std::int32_t track = c.row * q + copy;
      wishes.push_back(by_points ? Wish{c.column, track, c.distance2, -c.gain}
                                 : Wish{track, c.column, -c.gain, c.distance2});
    };
    for (const Candidate& c : group) wish(c, 0);
    if (q > 1) {
      const double within2 = opt_.merged_within * opt_.merged_within;
      std::vector<std::int32_t> favourite(tracks_.size(), -1);
      for (std::size_t e = 0; e < group.size(); ++e) {
        std::int32_t& best = favourite[group[e].row];
        if (best < 0 || group[e].gain > group[best].gain) best = static_cast<std::int32_t>(e);
      }
      for (const Candidate& c : group) {
        const Point& first = points[group[favourite[c.row]].column];
        if (squared_distance(points[c.column], first, m_.axis.D) <= within2)
          for (std::int32_t copy = 1; copy < q; ++copy) wish(c, copy);
      }
    }
    std::sort(wishes.begin(), wishes.end(), [](const Wish& a, const Wish& b) {
      if (a.proposer != b.proposer) return a.proposer < b.proposer;
      if (a.rank != b.rank) return a.rank < b.rank;
      return a.receiver < b.receiver;
    });
    std::vector<std::int32_t> proposers;
    std::vector<std::int64_t> first;
    std::vector<Proposal> lists;
    for (const Wish& w : wishes) {
      if (proposers.empty() || proposers.back() != w.proposer) {
        proposers.push_back(w.proposer);
        first.push_back(static_cast<std::int64_t>(lists.size()));
      }
      lists.push_back({w.receiver, w.cost});
    }
    first.push_back(static_cast<std::int64_t>(lists.size()));
    std::vector<std::int32_t> partner(proposers.size());
    const std::size_t n_receivers = by_points ? tracks_.size() * static_cast<std::size_t>(q) : points.size();
    deferred_acceptance(lists, first, static_cast<std::int32_t>(n_receivers), partner);
    std::vector<std::pair<std::int32_t, std::int32_t>> pairs;  // track, detection
    for (std::size_t p = 0; p < proposers.size(); ++p) {
      if (partner[p] < 0) continue;
      by_points ? pairs.emplace_back(partner[p] / q, proposers[p])
                : pairs.emplace_back(proposers[p] / q, partner[p]);
    }
    keep_pairs(group, pairs);
  }

  // The likeliest detection of a track is its own, the others are extras.
  void keep_pairs(std::span<const Candidate> group,
                  std::vector<std::pair<std::int32_t, std::int32_t>>& pairs) {
    if (opt_.capacity == 1) {
      for (const auto& [row, column] : pairs) s_.match[row] = column;
      return;
    }
    auto gain = [&](const std::pair<std::int32_t, std::int32_t>& pair) {
      for (const Candidate& c : group)
        if (c.row == pair.first && c.column == pair.second) return c.gain;
      return -std::numeric_limits<double>::infinity();
    };
    std::sort(pairs.begin(), pairs.end(), [&](const auto& a, const auto& b) {
      if (a.first != b.first) return a.first < b.first;
      const double ga = gain(a), gb = gain(b);
      return ga != gb ? ga > gb : a.second < b.second;
    });
    for (const auto& pair : pairs) {
      if (s_.match[pair.first] < 0)
        s_.match[pair.first] = pair.second;
      else
        s_.extras.push_back(pair);
    }
  }

  // What a track takes for its measurement: its detection, or the mean of several by likelihood.
  Point measured(std::size_t i, std::span<const Point> points) const {
    const Point& own = points[s_.match[i]];
    std::array<double, kMaxModes> each{};
    const Prediction& prediction = s_.predictions[i];
    double total = 1;
    Point sum = own;
    const double log_own = s_.extras.empty() ? 0 : prediction.log_likelihood(own, each);
    for (const auto& [row, column] : s_.extras) {
      if (row != static_cast<std::int32_t>(i)) continue;
      const double weight = std::exp(prediction.log_likelihood(points[column], each) - log_own);
      total += weight;
      for (int d = 0; d < m_.axis.D; ++d) sum[d] += weight * points[column][d];
    }
    if (total == 1) return own;
    for (int d = 0; d < m_.axis.D; ++d) sum[d] /= total;
    return sum;
  }

  template <typename Label>
  void begin_strictly(double time, std::span<const Point> points, Label&& label) {
    for (std::size_t j = 0; j < points.size(); ++j) {
      LiveTrack track;
      track.id = next_id_++;
      track.last_time = time;
      track.last = points[j];
      track.state = begin_state(m_, points[j]);
      label(n_seen_ + static_cast<std::int64_t>(j), track.id);
      tracks_.push_back(std::move(track));
    }
  }

  template <typename Label>
  void update_tracks(double time, std::span<const Point> points, Label&& label) {
    std::size_t kept = 0;
    for (std::size_t i = 0; i < tracks_.size(); ++i) {
      LiveTrack& track = tracks_[i];
      const std::int32_t j = s_.match[i];
      if (j >= 0) {
        const Point y = measured(i, points);
        track.score += hit_gain() + update(m_, s_.predictions[i], y, track.state);
        track.last = y;
        track.last_time = time;
        track.gap = 0;
        if (track.is_confirmed()) {
          label(n_seen_ + j, track.id);
        } else {
          track.pending.push_back(n_seen_ + j);
          if (track.score >= opt_.confirm_score) {
            track.id = next_id_++;
            for (const std::int64_t detection : track.pending) label(detection, track.id);
            track.pending = {};
          }
        }
      } else {
        track.score += miss_gain();
        ++track.gap;
      }
      track.best_score = std::max(track.best_score, track.score);
      // A link spans at most max_gap frames; a tentative track also ends by its score.
      const bool may_link = track.gap < sm_.max_gap;
      const bool is_doubted =
          !track.is_confirmed() && track.best_score - track.score > opt_.delete_drop;
      if (!may_link || is_doubted) continue;
      if (kept != i) tracks_[kept] = std::move(track);
      ++kept;
    }
    tracks_.resize(kept);
  }

  void begin_tracks(double time, std::span<const Point> points) {
    for (std::size_t j = 0; j < points.size(); ++j) {
      if (s_.is_taken[j]) continue;
      LiveTrack track;
      track.score = track.best_score = sm_.log_birth + sm_.log_detect - sm_.log_clutter;
      track.last_time = time;
      track.last = points[j];
      track.state = begin_state(m_, points[j]);
      track.pending.push_back(n_seen_ + static_cast<std::int64_t>(j));
      tracks_.push_back(std::move(track));
    }
  }

  MotionModel m_;
  ScoreModel sm_;
  TrackerOptions opt_;
  std::vector<LiveTrack> tracks_;
  std::int64_t next_id_ = 0, n_seen_ = 0, n_frames_ = 0;
  double last_time_ = -std::numeric_limits<double>::infinity();

  FrameScratch s_;
};

}  // namespace asterism
