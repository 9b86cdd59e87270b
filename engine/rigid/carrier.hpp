// The carrier of occluded markers: which neighbours carry a marker, where it was among them when it was
// seen last, and how far off they carried it while it was seen.
//
// While a marker is seen, its neighbours carry it now and then to the present frame from kLag frames ago.
// The errors of these places scale the variance of later ones (rigid/carried.hpp), which grows with the
// frames for which the marker is occluded.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <deque>
#include <map>
#include <span>
#include <utility>
#include <vector>

#include "base/scratch.hpp"
#include "rigid/carried.hpp"
#include "rigid/neighbours.hpp"

namespace asterism {

// Where a marker was in a frame, and its neighbours there, the steadiest first.
struct Anchor {
  std::int64_t frame = 0;
  Point at{};
  std::vector<Seen> around;
  std::vector<double> weight;  // of these
};

struct Carriage {
  Carried place;
  double nearest = 0;  // distance of the nearest neighbour
  std::int32_t n_neighbours = 0;
};

// Squared errors along an axis of the places to which a rotation carried a marker over kLag frames, and
// what was expected of them: means over the last kRecent.
struct Trust {
  static constexpr std::int64_t kRecent = 50;
  static constexpr double kLeast = 0.02;  // κ is no less

  std::int64_t n_judged = 0, n = 0;
  double error = 0, expected = 0;

  void add(double error2, double variance) {
    const double share = 1 / static_cast<double>(std::min(++n, kRecent));
    error += share * (error2 - error);
    expected += share * (variance - expected);
  }
  // Both ends were measured, so that the noise of both is in the error.
  double kappa(double r) const { return n == 0 ? 1 : (error - 2 * r) / expected; }
};

class Carrier {
 public:
  static constexpr std::int64_t kLag = 12;  // frames
  // Frames before the one in which a marker was seen last, which may show a ghost beside it.
  static constexpr std::array<std::int64_t, 3> kAnchors{0, 4, 10};

  // `r`: variance of a measured coordinate. Neighbours that are no bonds carry a marker too where they
  // steadily do, unless `bonds_only`.
  Carrier(int D, double r, bool bonds_only)
      : D_(D), r_(r), bonds_only_(bonds_only), neighbours_(D, r) {}

  int n_axes() const { return D_; }
  double noise() const { return r_; }

  // The markers of the next frame.
  void learn(std::span<const Seen> seen) {
    ++n_frames_;
    neighbours_.add(seen);
  }
  // A marker that will not be seen again.
  void forget(std::int32_t marker) {
    neighbours_.forget(marker);
    trust_.erase(marker);
  }

  std::span<const Bond> neighbours(std::int32_t marker) const { return neighbours_.of(marker); }
  // The steadiest neighbours of a marker that are seen in both frames.
  template <typename Then, typename Now>
  std::span<const RigidPair> pair(std::int32_t marker, const Then& then, const Now& now) {
    list_steadiest(marker, kSteadiest, [&](std::int32_t other) {
      return then.find(other) != nullptr && now.find(other) != nullptr;
    });
    s_.pairs.clear();
    for (const auto& [variance, other] : s_.steadiest)
      s_.pairs.push_back({*then.find(other), *now.find(other), 1 / variance});
    return s_.pairs;
  }

  // Where some of the markers of the newest frame would have been carried from `then`, kLag frames ago.
  // Calls tell(marker, prediction, trust so far).
  template <typename Then, typename Now, typename Tell>
  void judge(std::span<const Seen> seen, const Then& then, const Now& now, Tell&& tell) {
    for (const Seen& one : seen) {
      if ((n_frames_ + one.marker) % kJudgeEvery != 0) continue;
      const Point* before = then.find(one.marker);
      if (before == nullptr) continue;
      const std::span<const RigidPair> pairs = pair(one.marker, then, now);
      if (pairs.empty()) continue;
      const RigidPrediction found(pairs, *before, D_, r_);
      Trust& trust = trust_[one.marker];
      tell(one, found, std::as_const(trust));
      ++trust.n_judged;
      if (!found.may_turn()) continue;
      // What is farther off than the nearest neighbour was not carried at all.
      const double error2 = std::min(squared_distance(one.at, found.turned(), D_), found.nearest2());
      trust.add(error2 / D_, found.turned_variance(0, 1));
    }
  }
  // Too little is known of a marker that was hardly ever judged.
  bool is_judged(std::int32_t marker) const {
    const auto at = trust_.find(marker);
    return at != trust_.end() && at->second.n_judged >= kMinJudged;
  }

  // Adds where a marker is in `then`, a frame with this number; nothing where no neighbour is seen.
  template <typename Then>
  void remember(std::int32_t marker, const Then& then, std::int64_t frame,
                std::vector<Anchor>& anchors) {
    const Point* own = then.find(marker);
    if (own == nullptr) return;
    list_steadiest(marker, kRemembered,
                   [&](std::int32_t other) { return then.find(other) != nullptr; });
    if (s_.steadiest.empty()) return;
    Anchor& anchor = anchors.emplace_back(Anchor{frame, *own, {}, {}});
    for (const auto& [variance, other] : s_.steadiest) {
      anchor.around.push_back({other, *then.find(other)});
      anchor.weight.push_back(1 / variance);
    }
  }
  // The place of a marker that was carried over so many frames. `r`: variance beside what is carried.
  Carried place(const RigidPrediction& found, const Trust& trust, std::int64_t frames, double r) const;
  // Carries a marker from an anchor over so many frames. False where none of its neighbours is seen.
  bool carry(std::int32_t marker, const Anchor& from, const Places& now, std::int64_t frames, double r,
             Carriage& out);

 private:
  static constexpr std::size_t kRemembered = 16;  // neighbours of an anchor
  static constexpr std::int64_t kJudgeEvery = 4, kMinJudged = 3;

  // Up to `most` neighbours for which may_carry(neighbour) holds.
  template <typename May>
  void list_steadiest(std::int32_t marker, std::size_t most, May&& may_carry) {
    s_.steadiest.clear();
    for (const Bond& bond : neighbours_.of(marker))
      if ((!bonds_only_ || is_bond(bond, r_)) && may_carry(bond.other))
        keep_smallest(s_.steadiest, most, {neighbours_.variance(bond), bond.other});
  }

  struct Memory {
    std::vector<std::pair<double, std::int32_t>> steadiest;
    std::vector<RigidPair> pairs;
  };

  int D_;
  double r_;
  bool bonds_only_;
  std::int64_t n_frames_ = 0;
  Neighbours neighbours_;
  std::map<std::int32_t, Trust> trust_;
  Fresh<Memory> s_;
};

// A carrier for the tracks of a method: keeps the last frames and the anchors of occluded markers. Its
// places enter the filters of tracks, so that strangers must not carry each other.
class BodyCarrier {
 public:
  BodyCarrier(int D, double r) : carrier_(D, r, true) {}

  int n_axes() const { return carrier_.n_axes(); }
  double noise() const { return carrier_.noise(); }

  // The markers that are seen in the next frame, in order of their numbers.
  void see(std::span<const Seen> seen);
  // A marker that will not be seen again.
  void forget(std::int32_t marker);

  // Where a marker is that was not seen in the frames before, by where others are. False where none of
  // its neighbours is among them, or too little is known of it. Of the frames before this one, `n_open`
  // were not told to `see`: a marker that was there in the last that was may have gone since.
  bool carry(std::int32_t marker, const Places& now, Carriage& out, std::int64_t n_open = 0);

  // The bonds of a marker, the steadiest first.
  std::span<const Bond> bonds(std::int32_t marker);
  // Pairs of markers that are bonded, each for one of them.
  std::int64_t n_bonds(std::int32_t marker) const;

 private:
  struct Hidden {
    std::vector<Anchor> anchors;
    std::int64_t n_back = 0;  // frames in which it was seen again
  };

  // A marker that is back for a while is not occluded any more. Until then it may be a ghost, so that
  // its anchors are kept.
  void welcome(std::int32_t marker);
  void hide(std::int32_t marker);
  // Where a marker was among others in the last frame in which it was seen, `back` frames ago, and
  // before that.
  void remember(std::int32_t marker, std::int64_t back, std::vector<Anchor>& anchors);

  struct Memory {
    std::vector<Bond> bonds;
    std::vector<Carriage> ways;
    std::vector<Anchor> anchors;
  };

  Carrier carrier_;
  std::int64_t n_frames_ = 0;
  std::deque<Sighting> frames_;
  std::map<std::int32_t, Hidden> hidden_;
  Fresh<Memory> s_;
};

}  // namespace asterism
