// Assigns the detections of a frame to tracks, group by group.
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include "frame/marriage_market.hpp"
#include "solve/assignment.hpp"
#include "tracks/live_tracks.hpp"

namespace asterism {

struct PairingOptions {
  Pairing pairing = Pairing::assignment;
  // The method of the 2010 report: the points of the first frame initiate the tracks, every pair is
  // a candidate, and tracks are never initiated, coasted or deleted later. Every frame must have as
  // many points as the first.
  bool is_strict = false;
  // Hospitals–residents matching: the number of detections that one track may take. Those beyond
  // its best must lie within `merged_within` of it. They are merged with likelihood weights.
  std::int32_t capacity = 1;
  double merged_within = 0;
};

struct FramePairing {
  std::vector<std::int32_t> match;  // by track, -1 for none
  std::vector<Pair> extras;         // further detections of a track
  std::vector<char> is_taken;       // by detection

  void begin(std::size_t n_tracks, std::size_t n_points) {
    match.assign(n_tracks, -1);
    is_taken.assign(n_points, 0);
    extras.clear();
  }

  void pair(std::span<const Candidate> candidates, std::span<const Point> points, int D,
            const PairingOptions& options, FrameStats& stats) {
    const Groups groups = connected_groups(candidates, static_cast<std::int32_t>(match.size()),
                                           static_cast<std::int32_t>(points.size()));
    const MarriageMarket market{options.pairing == Pairing::detections_propose, options.capacity,
                                options.merged_within};
    for (std::size_t g = 0; g < groups.size(); ++g) {
      const bool is_alone = groups[g].size() == 1 && !options.is_strict;
      if (is_alone || options.pairing == Pairing::assignment)
        assignment_.solve(groups[g], match);
      else
        market.marry(groups[g], points, D, match, extras);
    }
    count(groups, stats);
    take(candidates);
  }

  static void count(const Groups& groups, FrameStats& stats) {
    for (std::size_t g = 0; g < groups.size(); ++g)
      stats.largest_group = std::max<std::int64_t>(stats.largest_group, groups[g].size());
    stats.n_groups += static_cast<std::int64_t>(groups.size());
  }
  // Marks the assigned detections as taken.
  void take(std::span<const Candidate> candidates) {
    for (const Candidate& c : candidates)
      if (match[c.row] == c.column) is_taken[c.column] = 1;
    for (const auto& [row, column] : extras) is_taken[column] = 1;
  }

 private:
  Assignment assignment_;
};

}  // namespace asterism
