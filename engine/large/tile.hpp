// One frame of one tile of a large scene: the candidates of the tile's tracks, and the exact
// assignment of every group that no other tile can reach.
//
// A tile has the tracks whose predictions lie in it and every point that one of them may take. A
// point that several tiles have is shared. A group of candidates without a shared point is complete
// in this tile, so its best assignment is final. The candidates of the other groups are returned;
// the caller joins those of all tiles and solves them (solve_joined). A group is therefore always
// solved as a whole, from the same candidates in the same order, however the scene is cut.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "filter/gating.hpp"
#include "filter/imm.hpp"
#include "filter/track_filter.hpp"
#include "large/spatial_order.hpp"
#include "math/log_sums.hpp"
#include "solve/assignment.hpp"
#include "solve/connected_components.hpp"
#include "tracks/live_tracks.hpp"

namespace asterism {

// The gains of a pairing in a large scene, as in frame/frame_tracker.hpp: a tentative track is
// weighted with the odds that it is a marker, so that all tracks compete in one assignment.
struct PairingGains {
  ScoreModel sm;
  double over = softplus(sm.log_birth + sm.log_detect - sm.log_clutter);

  double hit(std::int32_t gap) const { return sm.log_survive + sm.log_hit(gap) - sm.log_clutter; }
  double miss(std::int32_t gap) const { return sm.log_survive + sm.log_missed(gap); }

  // Gain of a pairing from the log likelihoods with it and without it.
  double gain(bool is_confirmed, double score, double with, double without) const {
    if (is_confirmed) return with - without - over;
    return softplus(score + with) - softplus(score + without) - over;
  }
};

// What the assignment reads of a track. The state is predicted to the first frame.
struct TileTrack {
  MotionState state;
  Point last{};
  double last_time = 0, score = 0;
  std::int32_t gap = 0;
  bool is_confirmed = false;
};

// The region in which a track may take a detection of one frame: the gate of the prediction from
// the decided frames. It bounds which points of later frames a tile needs.
struct Region {
  Point center{};
  double radius = -1;
};

// A frame, and for later frames the step that leads to it from the one before.
struct TileFrame {
  double time = 0;
  MotionStep step;
  std::vector<Point> points;
};

struct TileResult {
  std::vector<std::int32_t> match;   // by track of the tile: its point, or -1
  std::vector<Candidate> candidates; // of the groups with a shared point, by row and column
  std::int64_t n_candidates = 0, n_groups = 0, largest_group = 0;  // groups that were solved
};

// The order in which they are solved, which does not depend on the tiling.
inline void order_candidates(std::vector<Candidate>& candidates) {
  std::sort(candidates.begin(), candidates.end(), [](const Candidate& a, const Candidate& b) {
    return std::pair(a.row, a.column) < std::pair(b.row, b.column);
  });
}

// Solves group by group. A group with a row for which is_left(group) holds is left out.
template <typename Left>
void solve_groups_but(std::span<const Candidate> candidates, std::int32_t n_columns, Left&& is_left,
                      TileResult& out) {
  Assignment assignment;
  const auto n_rows = static_cast<std::int32_t>(out.match.size());
  const Groups groups = connected_groups(candidates, n_rows, n_columns);
  for (std::size_t g = 0; g < groups.size(); ++g) {
    if (is_left(groups[g])) {
      out.candidates.insert(out.candidates.end(), groups[g].begin(), groups[g].end());
      continue;
    }
    assignment.solve(groups[g], out.match);
    ++out.n_groups;
    out.largest_group = std::max<std::int64_t>(out.largest_group, groups[g].size());
  }
}

// Copies the modes that the model has, a third of the state for one mode.
inline void copy_state(const MotionModel& m, const MotionState& from, MotionState& to) {
  for (int b = 0; b < m.M; ++b) to.mode[b] = from.mode[b];
  to.w = from.w;
}

// The gains of the candidates of the first of several frames. The later ones are the look-ahead: the
// value of a choice includes the best continuation of the track through them,
//
//   V_f(track) = max( miss + V_f+1,  max_j  hit_j - leftover + V_f+1 )    V_F = 0
//
// so a track does not take a detection after which it would be lost. A wrong exchange of two tracks
// that cross agrees with their predictions at the crossing, and not with the frames after it.
class LookAhead {
 public:
  LookAhead(const MotionModel& m, const PairingGains& gains, double gate,
            std::vector<TileFrame> frames, std::span<const Region> regions)
      : m_(m), gains_(gains), gate_(gate), frames_(std::move(frames)), regions_(regions),
        grids_(frames_.size()), predicted_(frames_.size()), updated_(frames_.size()) {
    const std::size_t F = frames_.size();
    const double cell = cell_of(frames_[0].points, m.axis.D);
    for (std::size_t f = 0; f < F; ++f) {
      std::vector<std::int32_t> order = sort_in_space(frames_[f].points, m.axis.D, cell);
      if (f == 0) number_ = std::move(order);
      double sum = 0;
      for (std::size_t k = f; k < regions.size(); k += F) sum += std::max(regions[k].radius, 0.0);
      grids_[f].build(frames_[f].points, m.axis.D,
                      sum * static_cast<double>(F) / static_cast<double>(regions.size()));
    }
  }

  // Adds the candidates of track i with a positive gain.
  void list(std::size_t i, const TileTrack& track, std::vector<Candidate>& out) {
    own_ = regions_.subspan(i * frames_.size(), frames_.size());
    const std::size_t first = out.size();
    const Prediction prediction(m_, track.state);
    each_hit(0, prediction, track.last, track.last_time, track.gap, kDrop,
             [&](std::int32_t j, double distance2, double log_likelihood, const auto& each) {
      const Point& y = frames_[0].points[j];
      double with = gains_.hit(track.gap) + log_likelihood;
      if (frames_.size() > 1) {
        copy_state(m_, track.state, updated_[0]);
        update(m_, each, log_likelihood, y, updated_[0]);
        with += value(1, updated_[0], y, frames_[0].time, 0);
      }
      out.push_back({static_cast<std::int32_t>(i), number_[j], with, distance2});
    });
    if (out.size() == first) return;
    const double without = gains_.miss(track.gap) +
        value(1, track.state, track.last, track.last_time, track.gap + 1);
    std::size_t n = first;
    for (std::size_t e = first; e < out.size(); ++e) {
      const double gain = gains_.gain(track.is_confirmed, track.score, out[e].gain, without);
      if (!(gain > 0) || !std::isfinite(gain)) continue;
      out[n] = out[e];
      out[n++].gain = gain;
    }
    out.resize(n);
  }

 private:
  // A detection whose own gain is this far below zero is no candidate, whatever follows. Later
  // detections must have a gain of their own.
  static constexpr double kDrop = 4;

  // Calls visit(point, squared distance, log likelihood, that of each mode).
  template <typename Visit>
  void each_hit(std::size_t f, const Prediction& prediction, const Point& last, double last_time,
                std::int32_t gap, double drop, Visit&& visit) const {
    const double least = gains_.miss(gap) + gains_.over - gains_.hit(gap) - drop;
    const double radius = prediction.radius(gate_, least, 0);
    if (!(radius >= 0)) return;
    const Region& region = own_[f];
    const double dt = frames_[f].time - last_time, radius2 = region.radius * region.radius;
    std::array<double, kMaxModes> each{};
    grids_[f].within(prediction.center, radius, [&](std::int32_t j, double distance2) {
      const Point& y = frames_[f].points[j];
      if (squared_distance(region.center, y, m_.axis.D) > radius2) return;
      if (!is_reachable(gains_.sm, last, y, dt)) return;
      if (!prediction.is_gated(y, gate_)) return;
      const double log_likelihood = prediction.log_likelihood(y, each);
      if (log_likelihood >= least) visit(j, distance2, log_likelihood, each);
    });
  }

  // `before` is the state in the frame before. The states of each depth have their own memory.
  double value(std::size_t f, const MotionState& before, const Point& last, double last_time,
               std::int32_t gap) {
    if (f >= frames_.size() || gap >= gains_.sm.max_gap) return 0;
    MotionState& state = predicted_[f];
    copy_state(m_, before, state);
    predict(m_, frames_[f].step, state);
    const Prediction prediction(m_, state);
    double best = gains_.miss(gap) + value(f + 1, state, last, last_time, gap + 1);
    each_hit(f, prediction, last, last_time, gap, 0,
             [&](std::int32_t j, double, double log_likelihood, const auto& each) {
      const Point& y = frames_[f].points[j];
      double own = gains_.hit(gap) + log_likelihood - gains_.over;
      if (f + 1 < frames_.size()) {
        copy_state(m_, state, updated_[f]);
        update(m_, each, log_likelihood, y, updated_[f]);
        own += value(f + 1, updated_[f], y, frames_[f].time, 0);
      }
      best = std::max(best, own);
    });
    return best;
  }

  const MotionModel& m_;
  const PairingGains& gains_;
  double gate_;
  std::vector<TileFrame> frames_;     // their points in spatial order
  std::vector<std::int32_t> number_;  // of each point of the first frame, in the caller's order
  std::span<const Region> regions_, own_;
  std::vector<PointGrid> grids_;
  std::vector<MotionState> predicted_, updated_;  // by frame
};

inline TileResult solve_tile(const MotionModel& m, const PairingGains& gains, double gate,
                             std::int64_t max_candidates, std::span<const TileTrack> tracks,
                             std::span<const Region> regions, std::vector<TileFrame> frames,
                             std::span<const std::uint8_t> is_shared) {
  TileResult out;
  out.match.assign(tracks.size(), -1);
  if (tracks.empty() || frames[0].points.empty()) return out;
  const auto n_points = static_cast<std::int32_t>(frames[0].points.size());
  std::vector<Point> centers;
  for (std::size_t i = 0; i < tracks.size(); ++i)
    centers.push_back(regions[i * frames.size()].center);
  const double cell = cell_of(frames[0].points, m.axis.D);
  LookAhead ahead(m, gains, gate, std::move(frames), regions);
  std::vector<Candidate> candidates;
  for (const std::int32_t i : spatial_order(centers, m.axis.D, cell)) {
    ahead.list(i, tracks[i], candidates);
    if (static_cast<std::int64_t>(candidates.size()) > max_candidates)
      throw CandidateLimit("too many candidates in a frame");
  }
  order_candidates(candidates);
  out.n_candidates = static_cast<std::int64_t>(candidates.size());
  solve_groups_but(
      candidates, n_points,
      [&](std::span<const Candidate> group) {
        return std::ranges::any_of(group, [&](const Candidate& c) { return is_shared[c.column]; });
      },
      out);
  return out;
}

// Solves the groups that the tiles have left. The candidates of all tiles may stand in any order.
inline TileResult solve_joined(std::vector<Candidate>& candidates, std::size_t n_tracks,
                               std::size_t n_points) {
  TileResult out;
  out.match.assign(n_tracks, -1);
  order_candidates(candidates);
  out.n_candidates = static_cast<std::int64_t>(candidates.size());
  solve_groups_but(candidates, static_cast<std::int32_t>(n_points),
                   [](std::span<const Candidate>) { return false; }, out);
  return out;
}

}  // namespace asterism
