// Bonds as settled frames teach them: which tracks of a stream keep their distances, and how steadily.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <tuple>
#include <utility>
#include <vector>

#include "bond_term.hpp"
#include "neighbours.hpp"
#include "partition.hpp"

namespace asterism {

template <typename Filter>
class SettledBonds {
 public:
  // What bonds say of a marker in a frame is within ± `weight` nats; none are learnt where that is 0.
  SettledBonds(const MotionModel& m, double weight)
      : weight_(weight), neighbours_(m.axis.D, std::sqrt(m.axis.r)) {}

  bool is_on() const { return weight_ > 0; }

  // A frame that has just been settled, its tracks with the numbers that are theirs.
  void learn(const Partition<Filter>& p, std::int64_t frame) {
    if (!is_on()) return;
    seen_.clear();
    for (const std::int32_t i : p.window().frame(frame).ids)
      if (const std::int32_t k = p.track_of(i); k >= 0)
        seen_.push_back({static_cast<std::int32_t>(p.track(k).id), p.window()[i].y});
    neighbours_.add(seen_);
  }
  // A track that is about to be forgotten.
  void forget(std::int64_t id) {
    if (is_on()) neighbours_.forget(static_cast<std::int32_t>(id));
  }

  // What they say of the open frames.
  BondTerm<Filter> term(const Partition<Filter>& p) const {
    if (!is_on()) return {};
    std::vector<std::int32_t> known(p.window().n_ids(), -1);
    std::vector<std::pair<std::int32_t, std::int32_t>> tracks;  // number, detection known for it
    for (const std::int32_t k : p.tracks().items())
      if (const auto& t = p.track(k); t.n_frozen > 0)
        tracks.emplace_back(static_cast<std::int32_t>(t.id), t.nodes[t.first_open()]);
    return make_term(p, std::move(tracks), std::move(known));
  }
  // What they say of a whole take, of which nothing is settled any more: tracks are known for their
  // first detections.
  BondTerm<Filter> whole_term(const Partition<Filter>& p) const {
    if (!is_on()) return {};
    std::vector<std::int32_t> known(p.window().n_ids(), -1);
    std::vector<std::pair<std::int32_t, std::int32_t>> tracks;
    for (const std::int32_t k : p.tracks().items())
      tracks.emplace_back(static_cast<std::int32_t>(p.track(k).id), p.track(k).nodes.front());
    return make_term(p, std::move(tracks), std::move(known));
  }

 private:
  static constexpr std::size_t kSteadiest = 6;  // bonds of a marker
  static constexpr std::int64_t kLeast = 30;    // frames until a bond is one
  // A distance that is known no better than by this share of itself is none that is kept.
  static constexpr double kLoose = 0.2;

  struct Found {
    BondGraph::Pair pair;
    std::int64_t n = 0;
  };

  BondTerm<Filter> make_term(const Partition<Filter>& p,
                             std::vector<std::pair<std::int32_t, std::int32_t>> tracks,
                             std::vector<std::int32_t> known) const {
    std::sort(tracks.begin(), tracks.end());
    const auto n = static_cast<std::int32_t>(tracks.size());
    std::vector<Found> found;
    std::vector<std::pair<double, Found>> own;
    for (std::int32_t a = 0; a < n; ++a) {
      known[tracks[a].second] = a;
      own.clear();
      for (const Bond& bond : neighbours_.of(tracks[a].first)) {
        const double scale = neighbours_.unsteadiness(bond);
        if (bond.n < kLeast || scale > kLoose * bond.mean) continue;
        const auto at = std::lower_bound(tracks.begin(), tracks.end(), std::pair(bond.other, -1));
        if (at == tracks.end() || at->first != bond.other) continue;
        const auto b = static_cast<std::int32_t>(at - tracks.begin());
        own.push_back({scale, {{std::min(a, b), std::max(a, b), bond.mean, scale}, bond.n}});
      }
      const std::size_t most = std::min(kSteadiest, own.size());
      std::partial_sort(own.begin(), own.begin() + static_cast<std::ptrdiff_t>(most), own.end(),
                        [](const auto& x, const auto& y) {
                          return std::tuple(x.first, x.second.pair.a, x.second.pair.b) <
                                 std::tuple(y.first, y.second.pair.a, y.second.pair.b);
                        });
      for (std::size_t r = 0; r < most; ++r) found.push_back(own[r].second);
    }
    // Of two that know each other, what was learnt longer.
    std::stable_sort(found.begin(), found.end(), [](const Found& x, const Found& y) {
      return std::tuple(x.pair.a, x.pair.b, -x.n) < std::tuple(y.pair.a, y.pair.b, -y.n);
    });
    std::vector<BondGraph::Pair> pairs;
    for (const Found& one : found)
      if (pairs.empty() || pairs.back().a != one.pair.a || pairs.back().b != one.pair.b)
        pairs.push_back(one.pair);
    BondTerm<Filter> out(BondGraph(n, pairs, weight_), std::move(known));
    out.read(p);
    return out;
  }

  double weight_;
  Neighbours neighbours_;
  std::vector<Seen> seen_;
};

}  // namespace asterism
