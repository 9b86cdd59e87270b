// Assignment of the open detections of one frame after the other to the tracks.
//
// All other detections stay on their tracks. In each frame the assignment with the largest sum of
// gains is found exactly, given the labels of the other frames.
//
//   s_ik     score of open detection i in track k instead of an unknown marker; where it has no
//            distances, a detection stays where it is
//   gain_ik  s_ik, with `change` in favour of what i has now, a track or none
#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>
#include <vector>

#include "confidence/assignment_score.hpp"
#include "solve/assignment.hpp"

namespace asterism {

class FrameAssignment {
 public:
  explicit FrameAssignment(AssignmentScore& score) : score_(score), motion_(score.n_tracks()), range2_(score.n_tracks()) {}

  void run() {
    const auto offsets = score_.all().offsets;
    const auto is_open = score_.all().is_open;
    for (std::int64_t t = 0; t < score_.n_frames(); ++t) {
      const auto end = is_open.begin() + offsets[t + 1];
      if (std::find(is_open.begin() + offsets[t], end, 1) != end) assign(t);
    }
  }
  // Log odds of a detection of a track being of it, by distances where they are known, and motion.
  double support(std::int64_t t, std::int64_t i) {
    const std::int64_t k = score_.label(i);
    const double distances = score_.own_distances(t, i, k);
    const double motion = score_.motion(i, score_.between(k, around(t, k)));
    return motion + (distances == kNone ? 0 : distances);
  }

 private:
  static constexpr double kNone = -std::numeric_limits<double>::infinity();

  void assign(std::int64_t t) {
    const OpenFrames& all = score_.all();
    for (std::int64_t k = 0; k < score_.n_tracks(); ++k) {
      motion_[k] = score_.between(k, around(t, k));
      range2_[k] = score_.range2(motion_[k], score_.max_distances(k));
    }
    const std::int64_t first = all.offsets[t], end = all.offsets[t + 1];
    candidates_.clear();
    match_.assign(end - first, -1);
    for (std::int64_t i = first; i < end; ++i)
      if (all.is_open[i]) offer(t, i, static_cast<std::int32_t>(i - first));
    assignment_.solve_groups(candidates_, static_cast<std::int32_t>(score_.n_tracks()), match_);
    for (std::int64_t i = first; i < end; ++i)
      if (all.is_open[i]) score_.clear(t, i);
    for (std::int64_t i = first; i < end; ++i)
      if (const std::int32_t k = match_[i - first]; k >= 0)
        score_.put(t, k, static_cast<std::int32_t>(i));
  }

  void offer(std::int64_t t, std::int64_t i, std::int32_t row) {
    const OpenFrames& all = score_.all();
    const std::int64_t now = score_.label(i);
    for (std::int32_t k = 0; k < static_cast<std::int32_t>(score_.n_tracks()); ++k) {
      const std::int32_t held = score_.at(t, k);
      if ((held >= 0 && !all.is_open[held]) || !score_.is_near(t, k)) continue;
      double gain = k == now ? all.change : 0;
      if (now < 0) gain -= all.change + all.ghost[i];
      if (k != now && gain <= 0 &&
          squared_distance(all.points[i], motion_[k].mean, all.D) > range2_[k])
        continue;
      gain += score_.motion(i, motion_[k]);
      if (k != now && gain + score_.max_distances(k) <= 0) continue;
      const double distances =
          k == now ? score_.own_distances(t, i, k) : score_.distances(t, i, k, now, -gain);
      gain += distances;
      // Without distances, a detection stays where it is.
      if (distances == kNone) gain = k == now ? all.change : kNone;
      if (gain > 0) candidates_.push_back({row, k, gain});
    }
  }

  // The nearest two detections of a track before and after a frame.
  NearDetections around(std::int64_t t, std::int64_t k) const {
    NearDetections found;
    for (const std::int64_t way : {-1, 1}) {
      const std::size_t most = found.n + 2;
      for (std::int64_t n = 1; n <= score_.all().max_gap && found.n < most; ++n) {
        const std::int64_t there = t + way * n;
        if (there < 0 || there >= score_.n_frames()) break;
        if (const std::int32_t i = score_.at(there, k); i >= 0) found.add(i, way * n);
      }
    }
    return found;
  }

  AssignmentScore& score_;
  // Of the frame that is assigned.
  std::vector<SmoothMotion> motion_;  // of each track
  std::vector<double> range2_;        // beyond which it gains nothing
  std::vector<Candidate> candidates_;
  std::vector<std::int32_t> match_;
  Assignment assignment_;
};

}  // namespace asterism
