#include "rigid/carrier.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace asterism {

namespace {

// The element with the smallest sum of distances to the others, the first of equals.
const Carriage& middle(std::span<const Carriage> ways, int D) {
  std::size_t best = 0;
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t a = 0; a < ways.size(); ++a) {
    double sum = 0;
    for (const Carriage& other : ways)
      sum += std::sqrt(squared_distance(ways[a].place.at, other.place.at, D));
    if (sum < least) {
      least = sum;
      best = a;
    }
  }
  return ways[best];
}

}  // namespace

Carried Carrier::place(const RigidPrediction& found, const Trust& trust, std::int64_t frames,
                       double r) const {
  const double bent = static_cast<double>(frames) / kLag;
  return found.place(r, std::max(bent * trust.kappa(r_), Trust::kLeast));
}

bool Carrier::carry(std::int32_t marker, const Anchor& from, const Places& now, std::int64_t frames,
                    double r, Carriage& out) {
  s_.pairs.clear();
  for (std::size_t k = 0; k < from.around.size() && s_.pairs.size() < kSteadiest; ++k)
    if (const Point* at = now.find(from.around[k].marker); at != nullptr)
      s_.pairs.push_back({from.around[k].at, *at, from.weight[k]});
  if (s_.pairs.empty()) return false;
  const RigidPrediction found(s_.pairs, from.at, D_, r_);
  const auto at = trust_.find(marker);
  out.place = place(found, at == trust_.end() ? Trust{} : at->second, frames, r);
  out.n_neighbours = static_cast<std::int32_t>(s_.pairs.size());
  out.nearest = std::sqrt(found.nearest2());
  return true;
}

void BodyCarrier::see(std::span<const Seen> seen) {
  frames_.push_back({{seen.begin(), seen.end()}});
  if (static_cast<std::int64_t>(frames_.size()) > Carrier::kLag + 1) frames_.pop_front();
  ++n_frames_;
  for (const Seen& one : seen) welcome(one.marker);
  carrier_.learn(seen);
  if (frames_.size() > 1)
    for (const Seen& one : frames_[frames_.size() - 2].seen)
      if (frames_.back().find(one.marker) == nullptr) hide(one.marker);
  if (static_cast<std::int64_t>(frames_.size()) <= Carrier::kLag) return;
  carrier_.judge(seen, frames_.front(), frames_.back(), [](const Seen&, const RigidPrediction&, const Trust&) {});
}

void BodyCarrier::forget(std::int32_t marker) {
  carrier_.forget(marker);
  hidden_.erase(marker);
}

bool BodyCarrier::carry(std::int32_t marker, const Places& now, Carriage& out, std::int64_t n_open) {
  if (!carrier_.is_judged(marker)) return false;
  const auto hidden = hidden_.find(marker);
  if (hidden == hidden_.end()) {
    s_.anchors.clear();
    if (n_open > 0) remember(marker, 0, s_.anchors);
  }
  s_.ways.clear();
  Carriage way;
  for (const Anchor& anchor : hidden == hidden_.end() ? s_.anchors : hidden->second.anchors)
    if (carrier_.carry(marker, anchor, now, n_frames_ + n_open + 1 - anchor.frame, noise(), way))
      s_.ways.push_back(way);
  if (s_.ways.empty()) return false;
  out = middle(s_.ways, n_axes());
  return true;
}

std::span<const Bond> BodyCarrier::bonds(std::int32_t marker) {
  s_.bonds.clear();
  for (const Bond& bond : carrier_.neighbours(marker))
    if (is_bond(bond, noise())) s_.bonds.push_back(bond);
  std::ranges::sort(s_.bonds, {}, [&](const Bond& bond) {
    return std::pair(predictive_variance(bond, noise()), bond.other);
  });
  return s_.bonds;
}

std::int64_t BodyCarrier::n_bonds(std::int32_t marker) const {
  return std::ranges::count_if(carrier_.neighbours(marker), [&](const Bond& bond) {
    return bond.other > marker && is_bond(bond, noise());
  });
}

void BodyCarrier::welcome(std::int32_t marker) {
  const auto hidden = hidden_.find(marker);
  if (hidden == hidden_.end()) return;
  if (++hidden->second.n_back > Carrier::kAnchors.back()) hidden_.erase(hidden);
}

void BodyCarrier::hide(std::int32_t marker) {
  if (const auto hidden = hidden_.find(marker); hidden != hidden_.end()) {
    hidden->second.n_back = 0;
    return;
  }
  std::vector<Anchor>& anchors = hidden_[marker].anchors;
  remember(marker, 1, anchors);
  if (anchors.empty()) hidden_.erase(marker);
}

void BodyCarrier::remember(std::int32_t marker, std::int64_t back, std::vector<Anchor>& anchors) {
  const auto n = static_cast<std::int64_t>(frames_.size());
  for (const std::int64_t before : Carrier::kAnchors) {
    const std::int64_t ago = back + before;
    if (ago < n)
      carrier_.remember(marker, frames_[static_cast<std::size_t>(n - 1 - ago)], n_frames_ - ago, anchors);
  }
}

}  // namespace asterism
