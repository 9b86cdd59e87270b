// Hidden markers carried by those that keep their distance from them: who these are, where the marker
// was among them when it was seen last, and how well they carried it lately while it was seen.
//
// The variance of a carried place (carried_place.hpp) is what bonds and geometry say, times how far off
// it was in the past: while a marker is seen, its neighbours are asked now and then to carry it here
// from kLag frames ago. It grows with the frames since the marker was seen. What bodies do that were
// never seen to move so far is not known: then it is wider by a share of how far they have moved.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <deque>
#include <limits>
#include <map>
#include <span>
#include <utility>
#include <vector>

#include "carried_place.hpp"
#include "fragments.hpp"
#include "fresh.hpp"
#include "steady_bonds.hpp"

namespace asterism {

// How a marker is carried now.
struct Carriage {
  CarriedPlace place;
  double nearest = 0;  // distance of the nearest neighbour
  std::int32_t n_neighbours = 0;
};

class BodyCarrier {
 public:
  // `r`: variance of a measured coordinate.
  BodyCarrier(int D, double r) : D_(D), r_(r), neighbours_(D, std::sqrt(r)) {}

  int n_axes() const { return D_; }
  double noise() const { return r_; }

  // The markers that are seen in the next frame, in order of their numbers.
  void see(std::span<const Seen> seen) {
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
  // A marker that will not be seen again.
  void forget(std::int32_t marker) {
    neighbours_.forget_everywhere(marker);
    hidden_.erase(marker);
    trust_.erase(marker);
  }

  // Where a marker is that was not seen in the frames before, by where others are. False where none of
  // its neighbours is among them, or too little is known of it. Of the frames before this one, `n_open`
  // were not told to `see`: a marker that was there in the last that was may have gone since.
  bool carry(std::int32_t marker, const Places& now, Carriage& out, std::int64_t n_open = 0) {
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

  // The steadiest bonds of a marker.
  std::span<const Bond> bonds(std::int32_t marker) {
    s_.steady.clear();
    for (const Bond& bond : neighbours_.of(marker))
      if (is_steady(bond, r_)) s_.steady.push_back(bond);
    std::sort(s_.steady.begin(), s_.steady.end(), [&](const Bond& a, const Bond& b) {
      return std::pair(variance(a), a.other) < std::pair(variance(b), b.other);
    });
    return s_.steady;
  }
  // Pairs of markers that are bonded, each for one of them.
  std::int64_t n_bonds(std::int32_t marker) const {
    return std::ranges::count_if(neighbours_.of(marker), [&](const Bond& bond) {
      return bond.other > marker && is_steady(bond, r_);
    });
  }

 private:
  using Sighting = std::vector<Seen>;

  static constexpr std::size_t kRemembered = 16;  // neighbours of a hidden marker
  // Frames before the one in which a marker was seen last, which may show a ghost beside it.
  static constexpr std::array<std::size_t, 3> kAnchors{0, 4, 10};
  static constexpr std::size_t kLag = 12, kKept = kLag + 1;  // frames
  // A marker is asked about every so many frames; so many answers are remembered, and so many needed.
  static constexpr std::int64_t kJudgeEvery = 4, kMemory = 50, kLeastJudged = 3;
  static constexpr double kLeastOff = 0.02;  // κ is no less
  // Bodies that move more than so many times what they used to bend by a share of what is beyond that.
  static constexpr double kUsual = 2, kUnknown = 0.05;

  // Of the last kMemory values.
  struct RecentMean {
    std::int64_t n = 0;
    double value = 0;
    void add(double x) { value += (x - value) / static_cast<double>(std::min(++n, kMemory)); }
  };
  // Of a marker that was carried kLag frames to where it was seen: how far off that was along an axis,
  // squared; the part of this that bonds and geometry expected; how far off it would have been at its
  // offset from the steadiest neighbour; and how far it had moved, squared.
  struct Trust {
    RecentMean error, expected, shifted, moved;
  };

  // From the frame with that number, counted from 1.
  struct Remembered : Anchor {
    std::int64_t frame = 0;
  };
  struct Hidden {
    std::vector<Remembered> anchors;
    std::size_t n_back = 0;  // frames in which it was seen again
  };

  static const Point* find(const Sighting& frame, std::int32_t marker) {
    const auto at = std::lower_bound(frame.begin(), frame.end(), marker,
                                     [](const Seen& one, std::int32_t id) { return one.marker < id; });
    return at != frame.end() && at->marker == marker ? &at->at : nullptr;
  }
  // Of a neighbour about where the body takes it: both were measured then and now, and bodies bend by
  // what the distance varied, and by what was not seen yet.
  double variance(const Bond& bond) const {
    const double unseen = bond.mean * (0.01 + 1 / static_cast<double>(bond.n));
    return std::max(bond.variance, 2 * r_) + unseen * unseen;
  }

  // Whoever is back for a while is not hidden any more. Until then it may have been a ghost that came, so
  // that what was remembered of the marker is kept.
  void welcome(std::int32_t marker) {
    const auto hidden = hidden_.find(marker);
    if (hidden == hidden_.end()) return;
    if (++hidden->second.n_back > kAnchors.back()) hidden_.erase(hidden);
  }
  void hide(std::int32_t marker) {
    if (const auto hidden = hidden_.find(marker); hidden != hidden_.end()) {
      hidden->second.n_back = 0;
      return;
    }
    std::vector<Remembered>& anchors = hidden_[marker].anchors;
    remember(marker, frames_.size() - 2, anchors);
    if (anchors.empty()) hidden_.erase(marker);
  }
  // Where a marker was among others in frames_[last], in which it was seen last, and before.
  void remember(std::int32_t marker, std::size_t last, std::vector<Remembered>& anchors) {
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

  // Carries a marker from where it was by `s_.pairs`.
  Carriage way(const Point& then, const Trust& trust, double bent) const {
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
  // The way that is nearest to the others; of two, from where the marker was last.
  const Carriage& middle() const {
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

  void judge() {
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

  struct Memory {
    std::vector<Bond> steady;
    std::vector<RigidPair> pairs;
    std::vector<Carriage> ways;
    std::vector<Remembered> anchors;
  };

  int D_;
  double r_;
  std::int64_t n_frames_ = 0;
  Neighbours neighbours_;
  std::deque<Sighting> frames_;
  std::map<std::int32_t, Hidden> hidden_;
  std::map<std::int32_t, Trust> trust_;
  Fresh<Memory> s_;
};

}  // namespace asterism
