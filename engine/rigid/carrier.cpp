// A marker is remembered among its steadiest neighbours when it hides, and judged by them while seen.
#include "rigid/carrier.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace asterism {

namespace {

const Point* find(std::span<const Seen> frame, std::int32_t marker) {
  const auto at = std::lower_bound(frame.begin(), frame.end(), marker,
                                   [](const Seen& one, std::int32_t id) { return one.marker < id; });
  return at != frame.end() && at->marker == marker ? &at->at : nullptr;
}

}  // namespace

void BodyCarrier::see(std::span<const Seen> seen) {
  frames_.emplace_back(seen.begin(), seen.end());
  if (frames_.size() > kKept) frames_.pop_front();
  ++n_frames_;
  for (const Seen& one : seen) welcome(one.marker);
  neighbours_.add(seen);
  if (frames_.size() > 1)
    for (const Seen& one : frames_[frames_.size() - 2])
      if (find(frames_.back(), one.marker) == nullptr) hide(one.marker);
  judge();
}

void BodyCarrier::forget(std::int32_t marker) {
  neighbours_.forget_everywhere(marker);
  hidden_.erase(marker);
  trust_.erase(marker);
}

bool BodyCarrier::carry(std::int32_t marker, const Places& now, Carriage& out,
                        std::int64_t n_open) {
  const auto hidden = hidden_.find(marker);
  const auto trust = trust_.find(marker);
  if (trust == trust_.end() || trust->second.shifted.n < kLeastJudged) return false;
  if (hidden == hidden_.end()) {
    s_.anchors.clear();
    if (n_open > 0 && !frames_.empty()) remember(marker, frames_.size() - 1, s_.anchors);
  }
  s_.ways.clear();
  for (const Remembered& anchor : hidden == hidden_.end() ? s_.anchors : hidden->second.anchors) {
    s_.pairs.clear();
    for (std::size_t k = 0; k < anchor.around.size() && s_.pairs.size() < kSteadiest; ++k)
      if (const Point* at = now.find(anchor.around[k].marker); at != nullptr)
        s_.pairs.push_back({anchor.around[k].at, *at, anchor.weight[k]});
    if (s_.pairs.empty()) continue;
    // Bodies bend on, as if at random.
    const double frames = static_cast<double>(n_frames_ + n_open + 1 - anchor.frame);
    s_.ways.push_back(way(anchor.at, trust->second, frames / kLag));
  }
  if (s_.ways.empty()) return false;
  out = middle();
  return true;
}

std::span<const Bond> BodyCarrier::bonds(std::int32_t marker) {
  s_.steady.clear();
  for (const Bond& bond : neighbours_.of(marker))
    if (is_steady(bond, r_)) s_.steady.push_back(bond);
  std::sort(s_.steady.begin(), s_.steady.end(), [&](const Bond& a, const Bond& b) {
    return std::pair(variance(a), a.other) < std::pair(variance(b), b.other);
  });
  return s_.steady;
}

std::int64_t BodyCarrier::n_bonds(std::int32_t marker) const {
  return std::ranges::count_if(neighbours_.of(marker), [&](const Bond& bond) {
    return bond.other > marker && is_steady(bond, r_);
  });
}

double BodyCarrier::variance(const Bond& bond) const {
  const double unseen = bond.mean * (0.01 + 1 / static_cast<double>(bond.n));
  return std::max(bond.variance, 2 * r_) + unseen * unseen;
}

void BodyCarrier::welcome(std::int32_t marker) {
  const auto hidden = hidden_.find(marker);
  if (hidden == hidden_.end()) return;
  if (++hidden->second.n_back > kAnchors.back()) hidden_.erase(hidden);
}

void BodyCarrier::hide(std::int32_t marker) {
  if (const auto hidden = hidden_.find(marker); hidden != hidden_.end()) {
    hidden->second.n_back = 0;
    return;
  }
  std::vector<Remembered>& anchors = hidden_[marker].anchors;
  remember(marker, frames_.size() - 2, anchors);
  if (anchors.empty()) hidden_.erase(marker);
}

void BodyCarrier::remember(std::int32_t marker, std::size_t last, std::vector<Remembered>& anchors) {
  const std::span<const Bond> steady = bonds(marker);
  const auto since = static_cast<std::int64_t>(frames_.size() - 1 - last);
  for (const std::size_t back : kAnchors) {
    if (back > last) continue;
    const Point* own = find(frames_[last - back], marker);
    if (own == nullptr) continue;
    Remembered& anchor = anchors.emplace_back();
    anchor.at = *own;
    anchor.frame = n_frames_ - since - static_cast<std::int64_t>(back);
    for (const Bond& bond : steady)
      if (const Point* at = find(frames_[last - back], bond.other);
          at != nullptr && anchor.around.size() < kRemembered) {
        anchor.around.push_back({bond.other, *at});
        anchor.weight.push_back(1 / variance(bond));
      }
    if (anchor.around.empty()) anchors.pop_back();
  }
}

Carriage BodyCarrier::way(const Point& then, const Trust& trust, double bent) const {
  Carriage out;
  // Measured then and now, the noise of both is in what was off.
  const double off =
      trust.expected.n == 0 ? 1 : (trust.error.value - 2 * r_) / trust.expected.value;
  out.place = carried_place(s_.pairs, then, D_, r_, std::max(off * bent, kLeastOff),
                            4 * r_ + bent * trust.shifted.value);
  // Whoever moves as never before may bend as never before.
  const double moved = std::sqrt(squared_distance(out.place.at, then, D_)) -
                       kUsual * bent * std::sqrt(trust.moved.value);
  if (moved > 0) out.place.variance += kUnknown * kUnknown * moved * moved;
  out.n_neighbours = static_cast<std::int32_t>(s_.pairs.size());
  double nearest2 = std::numeric_limits<double>::infinity();
  for (const RigidPair& p : s_.pairs)
    nearest2 = std::min(nearest2, squared_distance(p.a, then, D_));
  out.nearest = std::sqrt(nearest2);
  return out;
}

const Carriage& BodyCarrier::middle() const {
  std::size_t best = 0;
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t a = 0; a < s_.ways.size(); ++a) {
    double sum = 0;
    for (const Carriage& other : s_.ways)
      sum += std::sqrt(squared_distance(s_.ways[a].place.at, other.place.at, D_));
    if (sum < least) {
      least = sum;
      best = a;
    }
  }
  return s_.ways[best];
}

void BodyCarrier::judge() {
  if (frames_.size() < kKept) return;
  const Sighting &then = frames_.front(), &now = frames_.back();
  for (const Seen& one : now) {
    if ((n_frames_ + one.marker) % kJudgeEvery != 0) continue;
    const Point* before = find(then, one.marker);
    if (before == nullptr) continue;
    s_.pairs.clear();
    double nearest = std::numeric_limits<double>::infinity();
    for (const Bond& bond : bonds(one.marker)) {
      const Point *a = find(then, bond.other), *b = find(now, bond.other);
      if (a == nullptr || b == nullptr) continue;
      nearest = std::min(nearest, bond.mean);
      s_.pairs.push_back({*a, *b, 1 / variance(bond)});
      if (s_.pairs.size() == kSteadiest) break;
    }
    if (s_.pairs.empty()) continue;
    Trust& trust = trust_[one.marker];
    const double most = nearest * nearest;  // what is farther off was not carried at all
    const RigidPair& first = s_.pairs.front();
    double shift2 = 0;
    for (int d = 0; d < D_; ++d) {
      const double off = (one.at[d] - (*before)[d]) - (first.b[d] - first.a[d]);
      shift2 += off * off;
    }
    trust.shifted.add(std::min(shift2, most) / D_);
    trust.moved.add(squared_distance(one.at, *before, D_));
    const CarriedPlace place = carried_place(s_.pairs, *before, D_, 0, 1,
                                             std::numeric_limits<double>::infinity());
    if (!std::isfinite(place.variance)) continue;
    trust.error.add(std::min(squared_distance(place.at, one.at, D_), most) / D_);
    trust.expected.add(place.variance);
  }
}

}  // namespace asterism
