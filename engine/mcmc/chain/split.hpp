// Divides a partition into groups of tracks and free detections, in each of which a chain can run
// independently.
//
//   whole       one group
//   likelihood  joined by ambiguous links, and then by the plausible moves at these links alone;
//               tracks without any need no chain
//   cells       by spatial cells (§4.2 of the report), which are shifted by half in every other
//               frame so that the borders move
//   clusters    joined if they are closer than some distance (ibid.)
//
// A track belongs to the group or cell of its last detection, so no track is divided.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <span>
#include <vector>

#include "filter/gating.hpp"
#include "math/union_find.hpp"
#include "mcmc/chain/ambiguous_links.hpp"
#include "mcmc/model/partition.hpp"
#include "mcmc/moves/involutive_moves.hpp"

namespace asterism {

enum class SplitBy { whole, likelihood, cells, clusters };

struct SplitOptions {
  SplitBy by = SplitBy::likelihood;
  // Nats; a link is ambiguous if its log likelihood is within this of the best alternative.
  double ambiguous_within = 10;
  double distance = 0;   // edge of a cell, or distance within a cluster
};

// A move at an ambiguous link, and an estimate of its gain of the log posterior.
struct HotMove {
  Toggle toggle;
  double gain = 0;
};

struct Group {
  std::vector<std::int32_t> tracks, free;
  std::vector<AmbiguousLinks::Link> ambiguous;
  std::vector<HotMove> moves;  // the plausible moves at the ambiguous links
  bool is_listed = false;      // whether `moves` are those of the present partition
  std::int64_t n_new = 0;   // tracks and free detections with a detection in the newest frame
  std::int64_t n_open = 0;  // detections that are not settled
};

struct Split {
  std::vector<Group> groups;  // those in which something may change
  std::int64_t n_all = 0;
  std::int64_t n_cut = 0;  // ambiguous links between groups
};

template <typename Filter>
class Splitter {
 public:
  Splitter(const Partition<Filter>& partition, const SplitOptions& options)
      : p_(partition), opt_(options) {}

  // Tracks marked in `is_sure` are left out.
  Split split(const AmbiguousLinks& ambiguous, const std::vector<char>& is_sure) {
    list(is_sure);
    UnionFind sets(items_.size());
    switch (opt_.by) {
      case SplitBy::whole:
        for (std::size_t n = 1; n < items_.size(); ++n) sets.join(0, static_cast<std::int32_t>(n));
        break;
      case SplitBy::likelihood:
        ambiguous.each([&](std::int32_t i, std::int32_t j) { join(sets, i, j); });
        break;
      case SplitBy::cells: join_cells(sets); break;
      case SplitBy::clusters: join_clusters(sets); break;
    }
    std::vector<char> is_open(items_.size(), opt_.by != SplitBy::likelihood);
    ambiguous.each([&](std::int32_t, std::int32_t j) {
      if (item(j) >= 0) is_open[sets.find(item(j))] = true;
    });
    Split out = collect(sets, is_open);
    ambiguous.each([&](std::int32_t i, std::int32_t j) {
      const std::int32_t a = item(i), b = item(j);
      if (a < 0 || b < 0) return;
      if (sets.find(a) == sets.find(b))
        out.groups[group_of_[a]].ambiguous.push_back({i, j});
      else
        ++out.n_cut;
    });
    return out;
  }

  // Divides the groups of a split by likelihood further if their moves are listed. Many links are
  // ambiguous by the likelihood of the link alone, but have no plausible move, because the tracks
  // and detections concerned have much better links. They need no chain and join no groups.
  Split divide(Split wide) {
    const auto is_listed = [](const Group& group) { return group.is_listed; };
    if (opt_.by != SplitBy::likelihood || !std::ranges::all_of(wide.groups, is_listed)) return wide;
    UnionFind sets(items_.size());
    for (const Group& group : wide.groups)
      for (const auto& [toggle, gain] : group.moves) {
        join(sets, toggle.y, toggle.a);
        if (toggle.c >= 0) join(sets, toggle.y, toggle.c);
      }
    std::vector<char> is_open(items_.size(), false);
    for (const Group& group : wide.groups)
      for (const HotMove& move : group.moves) is_open[sets.find(item(move.toggle.y))] = true;
    Split out = collect(sets, is_open);
    for (Group& group : out.groups) group.is_listed = true;
    for (const Group& group : wide.groups) {
      for (const auto& [i, j] : group.ambiguous) {
        const std::int32_t n = group_of_[item(i)];
        if (n >= 0 && n == group_of_[item(j)]) out.groups[n].ambiguous.push_back({i, j});
      }
      for (const HotMove& move : group.moves)
        out.groups[group_of_[item(move.toggle.y)]].moves.push_back(move);
    }
    return out;
  }

 private:
  struct Item {
    std::int32_t track = -1, detection = -1;  // the last of the track, or a free one
  };

  void list(const std::vector<char>& is_sure) {
    const DetectionWindow& window = p_.window();
    items_.clear();
    item_of_.assign(window.n_ids(), -1);
    item_of_track_.clear();
    for (const std::int32_t k : p_.tracks().items()) {
      if (static_cast<std::int32_t>(item_of_track_.size()) <= k) item_of_track_.resize(k + 1, -1);
      if (k < static_cast<std::int32_t>(is_sure.size()) && is_sure[k]) continue;
      item_of_track_[k] = static_cast<std::int32_t>(items_.size());
      items_.push_back({k, p_.last(k)});
    }
    for (const std::int32_t i : p_.free().items()) {
      item_of_[i] = static_cast<std::int32_t>(items_.size());
      items_.push_back({-1, i});
    }
  }
  // The item of a detection; -1 if it is settled clutter or in an excluded track.
  std::int32_t item(std::int32_t i) const {
    const std::int32_t k = p_.track_of(i);
    return k >= 0 ? item_of_track_[k] : k == kFree ? item_of_[i] : -1;
  }
  void join(UnionFind& sets, std::int32_t i, std::int32_t j) const {
    const std::int32_t a = item(i), b = item(j);
    if (a >= 0 && b >= 0) sets.join(a, b);
  }

  void join_cells(UnionFind& sets) const {
    const double shift = p_.window().now() % 2 == 0 ? 0 : 0.5;
    std::map<std::array<double, kMaxAxes>, std::int32_t> first;
    for (std::int32_t n = 0; n < static_cast<std::int32_t>(items_.size()); ++n) {
      std::array<double, kMaxAxes> cell{};
      const Point& y = p_.window()[items_[n].detection].y;
      for (int d = 0; d < p_.motion().axis.D; ++d)
        cell[d] = std::floor(y[d] / opt_.distance + shift);
      sets.join(first.try_emplace(cell, n).first->second, n);
    }
  }
  void join_clusters(UnionFind& sets) const {
    std::vector<Point> places;
    for (const Item& item : items_) places.push_back(p_.window()[item.detection].y);
    PointGrid grid;
    grid.build(places, p_.motion().axis.D, opt_.distance);
    for (std::int32_t n = 0; n < static_cast<std::int32_t>(items_.size()); ++n)
      grid.within(places[n], opt_.distance, [&](std::int32_t other, double) { sets.join(n, other); });
  }

  // Makes groups of the sets whose root is open, and stores the group of each item, -1 for none.
  Split collect(UnionFind& sets, const std::vector<char>& is_open) {
    Split out;
    group_of_.assign(items_.size(), -1);
    for (std::int32_t n = 0; n < static_cast<std::int32_t>(items_.size()); ++n) {
      const std::int32_t root = sets.find(n);
      out.n_all += root == n;
      if (!is_open[root]) continue;
      if (group_of_[root] < 0) {
        group_of_[root] = static_cast<std::int32_t>(out.groups.size());
        out.groups.emplace_back();
      }
      group_of_[n] = group_of_[root];
      Group& group = out.groups[group_of_[root]];
      const Item& item = items_[n];
      if (item.track >= 0) {
        group.tracks.push_back(item.track);
        group.n_open += p_.track(item.track).size() - p_.track(item.track).n_frozen;
      } else {
        group.free.push_back(item.detection);
        ++group.n_open;
      }
      group.n_new += p_.window()[item.detection].frame == p_.window().now();
    }
    return out;
  }

  const Partition<Filter>& p_;
  SplitOptions opt_;
  std::vector<Item> items_;
  std::vector<std::int32_t> item_of_, item_of_track_, group_of_;
};

}  // namespace asterism
