// Stable marriage of tracks and detections, including the hospitals–residents variant.
//
// Tracks rank detections by predictive density, and detections rank tracks by distance. A track
// that may take several detections enters with as many ordered copies. Copies beyond the first only
// propose to detections within `merged_within` of the track's best one.
#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>
#include <span>
#include <utility>
#include <vector>

#include "filter/kalman.hpp"
#include "solve/connected_components.hpp"
#include "solve/deferred_acceptance.hpp"

namespace asterism {

using Pair = std::pair<std::int32_t, std::int32_t>;  // track, detection

// How the candidates of a frame are assigned.
enum class Pairing {
  assignment,           // the most likely joint assignment
  tracks_propose,       // the stable matching that is optimal for the tracks
  detections_propose,   // the stable matching that is optimal for the detections
};

struct MarriageMarket {
  bool points_propose = false;
  std::int32_t capacity = 1;  // number of detections that one track may take
  double merged_within = 0;

  // Sets match[row] to the most likely detection of each matched track. `extras` receives its
  // further detections.
  void marry(std::span<const Candidate> group, std::span<const Point> points, int D,
             std::span<std::int32_t> match, std::vector<Pair>& extras) const {
    std::vector<Wish> wishes;
    for (const Candidate& c : group) wishes.push_back(wish(c, 0));
    if (capacity > 1) wish_for_more(group, points, D, match.size(), wishes);
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
    const std::size_t n_receivers =
        points_propose ? match.size() * static_cast<std::size_t>(capacity) : points.size();
    deferred_acceptance(lists, first, static_cast<std::int32_t>(n_receivers), partner);
    std::vector<Pair> pairs;
    for (std::size_t p = 0; p < proposers.size(); ++p) {
      if (partner[p] < 0) continue;
      points_propose ? pairs.emplace_back(partner[p] / capacity, proposers[p])
                     : pairs.emplace_back(proposers[p] / capacity, partner[p]);
    }
    keep(group, pairs, match, extras);
  }

 private:
  struct Wish {
    std::int32_t proposer, receiver;
    double rank, cost;
  };

  Wish wish(const Candidate& c, std::int32_t copy) const {
    const std::int32_t track = c.row * capacity + copy;
    return points_propose ? Wish{c.column, track, c.distance2, -c.gain}
                          : Wish{track, c.column, -c.gain, c.distance2};
  }

  void wish_for_more(std::span<const Candidate> group, std::span<const Point> points, int D,
                     std::size_t n_tracks, std::vector<Wish>& wishes) const {
    std::vector<std::int32_t> favourite(n_tracks, -1);
    for (std::size_t e = 0; e < group.size(); ++e) {
      std::int32_t& best = favourite[group[e].row];
      if (best < 0 || group[e].gain > group[best].gain) best = static_cast<std::int32_t>(e);
    }
    for (const Candidate& c : group) {
      const Point& first = points[group[favourite[c.row]].column];
      if (squared_distance(points[c.column], first, D) <= merged_within * merged_within)
        for (std::int32_t copy = 1; copy < capacity; ++copy) wishes.push_back(wish(c, copy));
    }
  }

  void keep(std::span<const Candidate> group, std::vector<Pair>& pairs,
            std::span<std::int32_t> match, std::vector<Pair>& extras) const {
    if (capacity == 1) {
      for (const auto& [row, column] : pairs) match[row] = column;
      return;
    }
    const auto gain = [&](const Pair& pair) {
      for (const Candidate& c : group)
        if (c.row == pair.first && c.column == pair.second) return c.gain;
      return -std::numeric_limits<double>::infinity();
    };
    std::sort(pairs.begin(), pairs.end(), [&](const Pair& a, const Pair& b) {
      if (a.first != b.first) return a.first < b.first;
      const double ga = gain(a), gb = gain(b);
      return ga != gb ? ga > gb : a.second < b.second;
    });
    for (const Pair& pair : pairs) {
      if (match[pair.first] < 0)
        match[pair.first] = pair.second;
      else
        extras.push_back(pair);
    }
  }
};

}  // namespace asterism
