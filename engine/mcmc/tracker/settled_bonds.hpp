// Bonds as settled frames teach them: which tracks of a stream keep their distances, and how steadily.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <tuple>
#include <utility>
#include <vector>

#include "mcmc/model/bond_term.hpp"
#include "mcmc/model/partition.hpp"
#include "rigid/neighbours.hpp"
#include "rigid/steady_bonds.hpp"

namespace asterism {

template <typename Filter>
class SettledBonds {
 public:
  // What bonds say of a marker in a frame is within ± `weight` nats; none are learnt where that is 0.
  SettledBonds(const MotionModel& m, double weight)
      : weight_(weight), r_(m.axis.r), neighbours_(m.axis.D, std::sqrt(m.axis.r)) {}

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

  // What they say of a partition. A track is known for the last of it that is settled; in a whole
  // take, of which nothing is settled any more, for its first.
  BondTerm<Filter> term(const Partition<Filter>& p) const {
    if (!is_on()) return {};
    const bool is_open = p.frozen() < p.window().first();
    std::vector<std::pair<std::int32_t, std::int32_t>> tracks;  // number, detection known for it
    for (const std::int32_t k : p.tracks().items())
      if (const auto& t = p.track(k); t.id >= 0 && (is_open || t.n_frozen > 0))
        tracks.emplace_back(static_cast<std::int32_t>(t.id), t.nodes[t.first_open()]);
    std::sort(tracks.begin(), tracks.end());
    std::vector<std::int32_t> known(p.window().n_ids(), -1);
    for (std::size_t a = 0; a < tracks.size(); ++a)
      known[tracks[a].second] = static_cast<std::int32_t>(a);
    BondTerm<Filter> out(
        BondGraph(static_cast<std::int32_t>(tracks.size()), pairs_of(tracks), weight_),
        std::move(known));
    out.read(p);
    return out;
  }

 private:
  struct Found {
    BondGraph::Pair pair;
    std::int64_t n = 0;
  };

  // The steadiest bonds of each of these tracks with others of them.
  std::vector<BondGraph::Pair> pairs_of(
      std::span<const std::pair<std::int32_t, std::int32_t>> tracks) const {
    std::vector<Found> found, own;
    for (std::int32_t a = 0; a < static_cast<std::int32_t>(tracks.size()); ++a) {
      own.clear();
      for (const Bond& bond : neighbours_.of(tracks[a].first)) {
        if (!is_steady(bond, r_)) continue;
        const auto at = std::lower_bound(tracks.begin(), tracks.end(), std::pair(bond.other, -1));
        if (at == tracks.end() || at->first != bond.other) continue;
        const auto b = static_cast<std::int32_t>(at - tracks.begin());
        own.push_back({{std::min(a, b), std::max(a, b), bond.mean, spread(bond, r_)},
                       bond.n});
      }
      std::sort(own.begin(), own.end(), [](const Found& x, const Found& y) {
        return std::tuple(x.pair.scale, x.pair.a, x.pair.b) <
               std::tuple(y.pair.scale, y.pair.a, y.pair.b);
      });
      own.resize(std::min(kSteadiest, own.size()));
      found.insert(found.end(), own.begin(), own.end());
    }
    // Of two that know each other, what was learnt longer.
    std::stable_sort(found.begin(), found.end(), [](const Found& x, const Found& y) {
      return std::tuple(x.pair.a, x.pair.b, -x.n) < std::tuple(y.pair.a, y.pair.b, -y.n);
    });
    std::vector<BondGraph::Pair> pairs;
    for (const Found& one : found)
      if (pairs.empty() || pairs.back().a != one.pair.a || pairs.back().b != one.pair.b)
        pairs.push_back(one.pair);
    return pairs;
  }

  double weight_, r_;
  Neighbours neighbours_;
  std::vector<Seen> seen_;
};

}  // namespace asterism
