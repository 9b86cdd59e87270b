// Score of an assignment of detections to tracks: how well distances and motion support it.
//
//   distances  mean log density of the distances to other tracks of the frame by the profile of the
//              track, relative to an unknown marker
//   motion     log density of the deviation from the polynomial through the detections of the track
//              around the frame, relative to clutter
//
// Both deviations are Student's t with three degrees of freedom. Every term has the weight ¼, since
// the distances of one frame are correlated, and each detection is part of five deviations from
// smooth motion. The mean of the distances counts like six of them.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>
#include <span>
#include <vector>

#include "confidence/distance_profiles.hpp"
#include "math/point.hpp"

namespace asterism {

// Detections by frame, with those that may change their track.
struct OpenFrames {
  std::span<const Point> points;
  std::span<const std::int64_t> offsets;
  std::span<const std::uint8_t> is_open;
  std::span<const double> ghost;  // log odds of each detection being a ghost
  std::span<const double> sigma;  // of each track, deviation of a coordinate from smooth motion
  double log_clutter = 0;         // log density of clutter
  double change = 0;              // log odds that a change must gain
  std::int64_t max_gap = 0;       // frames that motion predicts over
  int D = 3;
};

// Up to four detections of a track around a frame, and when they are, in frames from it.
struct NearDetections {
  std::array<std::int32_t, 4> point{};
  std::array<double, 4> when{};
  std::size_t n = 0;

  void add(std::int32_t i, std::int64_t frames) {
    point[n] = i;
    when[n++] = static_cast<double>(frames);
  }
};

// Density of the next detection of a track in a frame; 0 in the logarithm where it is not known.
struct SmoothMotion {
  Point mean{};
  double per_variance = 0, peak = 0;
};

class AssignmentScore {
 public:
  AssignmentScore(const OpenFrames& all, DistanceProfiles& profiles, std::span<std::int64_t> labels)
      : all_(all), profiles_(profiles), labels_(labels), own_(labels.size()),
        reach_(labels.size(), kLater) {
    std::vector<std::int64_t> begin(n_tracks(), n_frames()), end(n_tracks(), 0);
    each_labelled([&](std::int64_t t, std::int64_t, std::int64_t k) {
      begin[k] = std::min(begin[k], std::max<std::int64_t>(t - all.max_gap, 0));
      end[k] = std::min(t + all.max_gap + 1, n_frames());
    });
    std::int64_t n = 0;
    for (std::int64_t k = 0; k < n_tracks(); ++k) {
      near_.push_back({begin[k], end[k], n - begin[k]});
      n += std::max<std::int64_t>(end[k] - begin[k], 0);
    }
    at_.assign(n, -1);
    each_labelled([&](std::int64_t t, std::int64_t i, std::int64_t k) {
      at_[near_[k].start + t] = static_cast<std::int32_t>(i);
    });
  }

  const OpenFrames& all() const { return all_; }
  std::int64_t n_frames() const { return static_cast<std::int64_t>(all_.offsets.size()) - 1; }
  std::int64_t n_tracks() const { return static_cast<std::int64_t>(all_.sigma.size()); }
  std::int64_t label(std::int64_t i) const { return labels_[i]; }
  // Detection of a track in a frame, -1 for none.
  std::int32_t at(std::int64_t t, std::int64_t k) const {
    return is_near(t, k) ? at_[near_[k].start + t] : -1;
  }
  // Whether a track is near a frame: long before or after it, another track may be of its marker.
  bool is_near(std::int64_t t, std::int64_t k) const {
    return t >= near_[k].begin && t < near_[k].end;
  }
  // Gives a track that is near a detection, or none. The detection that it had must go elsewhere.
  void put(std::int64_t t, std::int64_t k, std::int32_t i) {
    at_[near_[k].start + t] = i;
    if (i >= 0) labels_[i] = k;
    forget(t);
  }
  // Takes an open detection from its track.
  void clear(std::int64_t t, std::int64_t i) {
    if (labels_[i] >= 0) at_[near_[labels_[i]].start + t] = -1;
    labels_[i] = -1;
    forget(t);
  }

  // Of detection i in track k, without those to one other track; -inf without enough distances, and
  // perhaps where it is below `least`.
  double distances(std::int64_t t, std::int64_t i, std::int64_t k, std::int64_t without,
                   double least) {
    return kDistances * support(t, i, k, without, least / kDistances).value;
  }
  // Of detection i in its own track, as above. It is computed once for each row of detections.
  double own_distances(std::int64_t t, std::int64_t i, std::int64_t without) {
    const std::int64_t k = labels_[i];
    if (reach_[i] == kLater) {
      const auto found = support(t, i, k, k, kLeast);
      own_[i] = kDistances * found.value;
      reach_[i] = static_cast<std::int8_t>(std::min(found.reach, kMaxReach));
    }
    if (reach_[i] > 0 && (reach_[i] == kMaxReach || profiles_.uses(k, reach_[i], without)))
      return distances(t, i, k, without, kLeast);
    return own_[i];
  }
  double max_distances(std::int64_t k) { return kDistances * profiles_.max_support(k); }

  // Motion of a track between other detections of it.
  SmoothMotion between(std::int64_t k, const NearDetections& around) const {
    SmoothMotion found;
    if (around.n == 0) return found;
    double before = kNone, after = kNone;
    for (std::size_t a = 0; a < around.n; ++a) {
      double& side = around.when[a] < 0 ? before : after;
      side = std::min(side, std::abs(around.when[a]));
    }
    double growth = 0;  // of the variance
    if (before < kNone && after < kNone) {
      const double half2 = (before + after) * (before + after) / 4;
      growth = 1 + half2 * (around.n > 1 ? half2 : 1) * (around.n > 2 ? half2 : 1) / 4;
    } else {
      const double gap = std::min(before, after), gap2 = gap * gap;
      growth = around.n > 1 ? 4 + kUnaccelerated * gap2 * gap2 : kUnmoved * gap2;
    }
    for (std::size_t a = 0; a < around.n; ++a) {
      double weight = 1;
      for (std::size_t b = 0; b < around.n; ++b)
        if (b != a) weight *= -around.when[b] / (around.when[a] - around.when[b]);
      for (int d = 0; d < all_.D; ++d) found.mean[d] += weight * all_.points[around.point[a]][d];
    }
    const double variance = all_.sigma[k] * all_.sigma[k] * growth;
    found.per_variance = 1 / (3 * variance);
    found.peak = -all_.D / 2.0 * std::log(2 * std::numbers::pi * variance) - all_.log_clutter;
    return found;
  }
  // Squared distance from the mean beyond which motion and distances cannot gain more than `gain`.
  double range2(const SmoothMotion& of_track, double gain) const {
    if (of_track.per_variance == 0) return std::numeric_limits<double>::infinity();
    const double fall = of_track.peak + gain / kMotion;
    return 1.000001 * std::expm1(std::max(2 * fall / (3 + all_.D), 0.0)) / of_track.per_variance;
  }
  // Of a detection by the motion of its track; 0 where it is not known.
  double motion(std::int64_t i, const SmoothMotion& of_track) const {
    const double off2 = squared_distance(all_.points[i], of_track.mean, all_.D);
    const double fall = (3 + all_.D) / 2.0 * std::log1p(off2 * of_track.per_variance);
    return kMotion * (of_track.peak - fall);
  }

 private:
  // Frames of a track and those near it, and where they start in `at_`.
  struct Near {
    std::int64_t begin = 0, end = 0, start = 0;
  };

  template <typename Use>
  void each_labelled(Use&& use) const {
    for (std::int64_t t = 0; t < n_frames(); ++t)
      for (std::int64_t i = all_.offsets[t]; i < all_.offsets[t + 1]; ++i)
        if (labels_[i] >= 0) use(t, i, labels_[i]);
  }
  DistanceProfiles::Support support(std::int64_t t, std::int64_t i, std::int64_t k,
                                    std::int64_t without, double least) {
    const auto at_now = [&](std::int32_t other) { return at(t, other); };
    return profiles_.support(k, all_.points[i], all_.points, at_now, without, least);
  }
  // Forgets what depends on the row of a frame.
  void forget(std::int64_t t) {
    std::fill(reach_.begin() + all_.offsets[t], reach_.begin() + all_.offsets[t + 1], kLater);
  }

  static constexpr std::int8_t kLater = -1;
  static constexpr std::int32_t kMaxReach = 127;
  static constexpr double kLeast = -std::numeric_limits<double>::infinity();
  static constexpr double kDistances = 1.5, kMotion = 0.25;  // weights
  static constexpr double kUnaccelerated = 9, kUnmoved = 100;  // growth on one side
  static constexpr double kNone = 1e9;                         // frames

  OpenFrames all_;
  DistanceProfiles& profiles_;
  std::span<std::int64_t> labels_;
  std::vector<Near> near_;        // of each track, before the assignment
  std::vector<std::int32_t> at_;  // by track and frame
  // Of each detection: distances in its own track, and how many of the profile they took.
  std::vector<double> own_;
  std::vector<std::int8_t> reach_;
};

}  // namespace asterism
