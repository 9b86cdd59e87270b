// Tracks confirmed by rigid distances (§4.2 of the report): cliques of tracks that were detected in
// every frame of a window and kept their mutual distances.
//
// The criterion is that of the report: the range of a distance over one window. The criterion of
// rigid/bond.hpp needs more frames than a window has.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <iterator>
#include <vector>

#include "mcmc/model/partition.hpp"

namespace asterism {

struct BondOptions {
  std::int32_t size = 0;      // size of a clique: 2, 3 or 4; 0: none
  std::int32_t n_frames = 0;  // of the window
  double tolerance = 0;       // largest range of a distance, m
};

struct Bonds {
  std::vector<char> is_sure;  // by track
  std::int64_t n_sure = 0;
};

template <typename Filter>
class BondFinder {
 public:
  BondFinder(const Partition<Filter>& partition, const BondOptions& options)
      : p_(partition), opt_(options) {}

  Bonds find() const {
    Bonds out;
    if (opt_.size == 0) return out;
    const std::vector<std::int32_t> tracks = whole_tracks();
    const auto n = static_cast<std::int32_t>(tracks.size());
    std::vector<std::vector<std::int32_t>> bonded(n);  // of each track, those after it, increasing
    for (std::int32_t a = 0; a < n; ++a)
      for (std::int32_t b = a + 1; b < n; ++b)
        if (keep_distance(tracks[a], tracks[b])) bonded[a].push_back(b);
    std::vector<std::int32_t> members;
    for (std::int32_t a = 0; a < n; ++a) {
      members.assign(1, a);
      mark(bonded, bonded[a], members, tracks, out);
    }
    out.n_sure = std::count(out.is_sure.begin(), out.is_sure.end(), 1);
    return out;
  }

 private:
  // Tracks with a detection in every frame of the window.
  std::vector<std::int32_t> whole_tracks() const {
    std::vector<std::int32_t> out;
    const std::int64_t first = p_.window().now() - opt_.n_frames + 1;
    for (const std::int32_t k : p_.tracks().items()) {
      const auto& t = p_.track(k);
      if (t.size() < opt_.n_frames) continue;
      const std::int32_t i = t.nodes[t.size() - opt_.n_frames];
      if (p_.window()[i].frame == first) out.push_back(k);
    }
    std::sort(out.begin(), out.end());
    return out;
  }

  bool keep_distance(std::int32_t a, std::int32_t b) const {
    const auto &s = p_.track(a).nodes, &t = p_.track(b).nodes;
    double min_distance = 0, max_distance = 0;
    for (std::int32_t n = 1; n <= opt_.n_frames; ++n) {
      const Point &x = p_.window()[s[s.size() - n]].y, &y = p_.window()[t[t.size() - n]].y;
      const double distance = std::sqrt(squared_distance(x, y, p_.motion().axis.D));
      min_distance = n == 1 ? distance : std::min(min_distance, distance);
      max_distance = n == 1 ? distance : std::max(max_distance, distance);
      if (max_distance - min_distance > opt_.tolerance) return false;
    }
    return true;
  }

  // Extends the clique `members` by one of `next`, which are bonded to all members.
  void mark(const std::vector<std::vector<std::int32_t>>& bonded,
            const std::vector<std::int32_t>& next, std::vector<std::int32_t>& members,
            const std::vector<std::int32_t>& tracks, Bonds& out) const {
    if (static_cast<std::int32_t>(members.size()) == opt_.size) {
      for (const std::int32_t a : members) {
        if (static_cast<std::int32_t>(out.is_sure.size()) <= tracks[a])
          out.is_sure.resize(tracks[a] + 1, 0);
        out.is_sure[tracks[a]] = 1;
      }
      return;
    }
    std::vector<std::int32_t> common;
    for (const std::int32_t b : next) {
      common.clear();
      std::set_intersection(next.begin(), next.end(), bonded[b].begin(), bonded[b].end(),
                            std::back_inserter(common));
      members.push_back(b);
      mark(bonded, common, members, tracks, out);
      members.pop_back();
    }
  }

  const Partition<Filter>& p_;
  BondOptions opt_;
};

}  // namespace asterism
