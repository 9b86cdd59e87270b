// Predicts occluded markers from rigid neighbours, which are said to carry them. The carrier
// selects the neighbours of each marker, stores their relative positions at the last detection, and
// estimates the accuracy of its predictions.
//
// While a marker is detected, the carrier regularly predicts its present position from the frame
// kLag frames earlier. The errors of these predictions scale the variance of later ones
// (rigid/carried.hpp), which grows with the length of the occlusion.
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

// The position of a marker in a frame and those of its neighbours, by increasing variance of their
// distances.
struct Anchor {
  std::int64_t frame = 0;
  Point at{};
  std::vector<MarkerPoint> around;
  std::vector<double> weight;  // of the neighbours in `around`
};

struct Carriage {
  Carried place;
  double nearest = 0;  // distance of the nearest neighbour
  std::int32_t n_neighbours = 0;
};

// The element with the smallest sum of distances to the others, the first of equals.
const Carriage& middle(std::span<const Carriage> ways, int D);

// Mean squared error per axis of the positions predicted by a rotation over kLag frames, and its
// expected value. The means have a memory of kRecent predictions.
struct Accuracy {
  static constexpr std::int64_t kRecent = 50;
  static constexpr double kMinKappa = 0.02;  // lower bound of κ

  std::int64_t n_assessed = 0, n = 0;
  double error = 0, expected = 0;

  void add(double error2, double variance) {
    const double share = 1 / static_cast<double>(std::min(++n, kRecent));
    error += share * (error2 - error);
    expected += share * (variance - expected);
  }
  // Both positions were measured, so the error contains the measurement noise of both.
  double kappa(double r) const { return n == 0 ? 1 : (error - 2 * r) / expected; }
};

class Carrier {
 public:
  static constexpr std::int64_t kLag = 12;  // frames
  // Offsets of the anchor frames before the last detection. Several are used because the last
  // detections may be those of a ghost beside the marker.
  static constexpr std::array<std::int64_t, 3> kAnchors{0, 4, 10};

  // `r` is the variance of a measured coordinate. Neighbours without a bond are also used if the
  // variance of their distance is small, unless `bonds_only` is set.
  Carrier(int D, double r, bool bonds_only)
      : D_(D), r_(r), bonds_only_(bonds_only), neighbours_(D, r) {}

  int n_axes() const { return D_; }
  double noise() const { return r_; }

  // Adds the detected markers of the next frame.
  void learn(std::span<const MarkerPoint> seen) {
    ++n_frames_;
    neighbours_.add(seen);
  }
  // Removes a marker that will not be detected again.
  void forget(std::int32_t marker) {
    neighbours_.forget(marker);
    accuracy_.erase(marker);
  }

  auto neighbours(std::int32_t marker) const { return neighbours_.of(marker); }
  // Pairs of positions of the marker's most stable neighbours that are detected in both frames.
  template <typename Then, typename Now>
  std::span<const RigidPair> pair(std::int32_t marker, const Then& then, const Now& now) {
    s_.pairs.clear();
    for (const Bond& bond : neighbours_.of(marker)) {
      if (bonds_only_ && !is_bond(bond, r_)) continue;
      const Point* before = then.find(bond.other);
      const Point* at = before != nullptr ? now.find(bond.other) : nullptr;
      if (at == nullptr) continue;
      s_.pairs.push_back({*before, *at, 1 / neighbours_.variance(bond)});
      if (s_.pairs.size() == kSteadiest) break;
    }
    return s_.pairs;
  }

  // Compares the detected positions of some markers with those predicted from `then`, kLag frames
  // earlier. Calls tell(marker, prediction, accuracy before this frame).
  template <typename Then, typename Now, typename Visit>
  void assess(std::span<const MarkerPoint> seen, const Then& then, const Now& now, Visit&& visit) {
    const auto pairs_of = [&](const MarkerPoint& one, Point& was) -> std::span<const RigidPair> {
      if ((n_frames_ + one.marker) % kAssessEvery != 0) return {};
      const Point* before = then.find(one.marker);
      if (before == nullptr) return {};
      was = *before;
      return pair(one.marker, then, now);
    };
    s_.predictions.each(D_, r_, seen, pairs_of, [&](const MarkerPoint& one, const RigidPrediction& found) {
      Accuracy& accuracy = accuracy_[one.marker];
      visit(one, found, std::as_const(accuracy));
      ++accuracy.n_assessed;
      if (!found.may_turn()) return;
      // An error beyond the nearest neighbour is due to a wrong association, so it is clipped.
      const double error2 = std::min(squared_distance(one.at, found.turned(), D_), found.nearest2());
      accuracy.add(error2 / D_, found.turned_variance(0, 1));
    });
  }
  // Whether the accuracy was assessed often enough for predictions to be used.
  bool is_assessed(std::int32_t marker) const {
    const Accuracy* accuracy = accuracy_.find(marker);
    return accuracy != nullptr && accuracy->n_assessed >= kMinAssessed;
  }

  // Adds an anchor of the marker in `then`, frame number `frame`, if any neighbour is detected
  // there.
  template <typename Then>
  void remember(std::int32_t marker, const Then& then, std::int64_t frame,
                std::vector<Anchor>& anchors) {
    const Point* own = then.find(marker);
    if (own == nullptr) return;
    Anchor anchor{frame, *own, {}, {}};
    for (const Bond& bond : neighbours_.of(marker)) {
      if (bonds_only_ && !is_bond(bond, r_)) continue;
      const Point* at = then.find(bond.other);
      if (at == nullptr) continue;
      anchor.around.push_back({bond.other, *at});
      anchor.weight.push_back(1 / neighbours_.variance(bond));
      if (anchor.around.size() == kRemembered) break;
    }
    if (!anchor.around.empty()) anchors.push_back(std::move(anchor));
  }
  // The position of a marker carried over `frames` frames. `r` is the additional variance.
  Carried place(const RigidPrediction& found, const Accuracy& accuracy, std::int64_t frames,
                double r) const;
  // Predicts the position of a marker from each of its anchors some of whose neighbours are
  // detected now, and calls use(anchor, carriage). `frames_since(anchor)` is the number of frames
  // over which the marker is carried. `r` is the additional variance.
  template <typename FramesSince, typename Use>
  void carry(std::int32_t marker, std::span<const Anchor> anchors, const Places& now, double r,
             FramesSince&& frames_since, Use&& use) {
    const Accuracy* assessed = accuracy_.find(marker);
    const Accuracy accuracy = assessed == nullptr ? Accuracy{} : *assessed;
    const auto pairs_of = [&](const Anchor& anchor, Point& was) -> std::span<const RigidPair> {
      was = anchor.at;
      s_.pairs.clear();
      for (std::size_t k = 0; k < anchor.around.size() && s_.pairs.size() < kSteadiest; ++k)
        if (const Point* at = now.find(anchor.around[k].marker); at != nullptr)
          s_.pairs.push_back({anchor.around[k].at, *at, anchor.weight[k]});
      return s_.pairs;
    };
    s_.predictions.each(D_, r_, anchors, pairs_of, [&](const Anchor& anchor, const RigidPrediction& found) {
      use(anchor, Carriage{place(found, accuracy, frames_since(anchor), r),
                           std::sqrt(found.nearest2()), found.n_neighbours()});
    });
  }

 private:
  static constexpr std::size_t kRemembered = 16;  // neighbours of an anchor
  static constexpr std::int64_t kAssessEvery = 4, kMinAssessed = 3;

  struct Memory {
    std::vector<RigidPair> pairs;
    RigidPredictions predictions;
  };

  int D_;
  double r_;
  bool bonds_only_;
  std::int64_t n_frames_ = 0;
  Neighbours neighbours_;
  FlatMap<std::int32_t, Accuracy> accuracy_;
  Scratch<Memory> s_;
};

// The carrier of a frame-by-frame method: keeps the latest frames and the anchors of occluded
// markers. Its predictions enter the filters of tracks, so it uses bonds only; unrelated markers
// must not carry each other.
class RigidCarrier {
 public:
  RigidCarrier(int D, double r) : carrier_(D, r, true) {}

  int n_axes() const { return carrier_.n_axes(); }
  double noise() const { return carrier_.noise(); }

  // Adds the markers detected in the next frame, by increasing number.
  void see(std::span<const MarkerPoint> seen);
  // Removes a marker that will not be detected again.
  void forget(std::int32_t marker);

  // Predicts the position of an occluded marker from the present positions of others. Returns false
  // if none of its neighbours is among them or its accuracy is unknown. The last `n_open` frames
  // were not passed to `see`, so a marker that was detected in the last known frame may have become
  // occluded since.
  bool carry(std::int32_t marker, const Places& now, Carriage& out, std::int64_t n_open = 0);

  // All distances known of a marker, whether they are bonds or not.
  auto distances(std::int32_t marker) const { return carrier_.neighbours(marker); }

 private:
  struct Occlusion {
    std::vector<Anchor> anchors;
    std::int64_t n_back = 0;  // frames in which the marker was detected again
  };

  // Ends the occlusion of a marker that has been detected for several frames. Until then the
  // detections may be a ghost, so the anchors are kept.
  void mark_detected(std::int32_t marker);
  void mark_occluded(std::int32_t marker);
  // Adds the anchors of a marker whose last detection was `back` frames ago.
  void remember(std::int32_t marker, std::int64_t back, std::vector<Anchor>& anchors);

  struct Memory {
    std::vector<Carriage> ways;
    std::vector<Anchor> anchors;
  };

  Carrier carrier_;
  std::int64_t n_frames_ = 0;
  std::deque<MarkerFrame> frames_;
  std::map<std::int32_t, Occlusion> occluded_;
  Scratch<Memory> s_;
};

}  // namespace asterism
