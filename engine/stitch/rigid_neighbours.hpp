// Evidence of rigid neighbours for the links of tracklets and for occluded markers.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <span>
#include <utility>
#include <vector>

#include "base/scratch.hpp"
#include "rigid/carrier.hpp"
#include "rigid/tracklets.hpp"
#include "stitch/background_density.hpp"

namespace asterism {

class RigidNeighbours {
 public:
  RigidNeighbours(int D, double noise) : D_(D), noise_(noise), carrier_(D, noise * noise, false) {}

  // Updates the bonds with the markers of the newest frame.
  void learn(const StitchMemory& s, std::span<const MarkerPoint> seen, Markers& markers) {
    carrier_.learn(seen);
    assess(s, seen, markers);
  }
  void forget(std::int32_t marker) { carrier_.forget(marker); }

  // Prepares the evaluation of the links of the newest frame.
  void begin_links(const StitchMemory& s) {
    w_.n_common = 0;
    list_markers(s, s.frames.newest(), w_.places_now);
  }
  // Log-likelihood ratio of a tracklet's link into the newest frame, predicted by its neighbours,
  // against the background density. The most stable neighbours are used first, and the nearest ones
  // also if the result is below `enough`. Returns false if there are too few neighbours.
  bool link(const StitchMemory& s, const Frame::One& own, const Tracklet& f, double enough,
            double& gain) {
    const Common& common = common_with(s, f.last);
    if (common.pairs.size() < min_for_rotation(D_) + 2) return false;
    const Point then = *s.frames.find(f.last)->find(own.tracklet);
    const double background = s.background.log_density(own.at, s.frames.newest(), own.tracklet);
    // Segments hardly deform between two frames, so the residual of the fit alone gives the
    // variance.
    const auto say = [&](std::span<const RigidPair> pairs) {
      const RigidPrediction found(pairs, then, D_, square(noise_));
      return found.place(kNoise * square(noise_), 0).log_density(own.at, D_) - background;
    };
    gain = -std::numeric_limits<double>::infinity();
    if (f.marker >= 0)
      if (const auto pairs = carrier_.pair(f.marker, common.places, w_.places_now); pairs.size() == kSteadiest)
        gain = say(pairs);
    if (gain >= enough) return true;
    pair_nearest(common, own.tracklet, then);
    gain = std::max(gain, say(w_.pairs));
    return true;
  }

  // Stores the positions of the neighbours of an occluded marker. The last detections may already
  // be those of a ghost, so several earlier frames are stored.
  void remember_around(const StitchMemory& s, std::int32_t k, Marker& marker) {
    marker.anchors.clear();
    for (const std::int64_t back : Carrier::kAnchors) {
      const Frame* then = s.frames.find(marker.last - back);
      if (then == nullptr) continue;
      list_markers(s, *then, w_.places);
      carrier_.remember(k, w_.places, marker.last - back, marker.anchors);
    }
  }
  // Log-likelihood ratio for a tracklet to be the occluded marker k, predicted by the neighbours of
  // k. For each anchor, it is averaged over some detections of the tracklet, without the worst,
  // which may be a ghost. The anchors are alternatives, so their likelihoods are averaged.
  double log_odds(const StitchMemory& s, const Tracklet& f, std::int32_t id, std::int32_t k,
                  const Marker& marker) {
    const std::size_t every = std::max<std::size_t>(f.detections.size() / kLooks, 1);
    w_.looks.assign(marker.anchors.size(), {});
    Carriage way;
    for (std::size_t i = 0; i < f.detections.size(); i += every) {
      const Frame* at = s.frames.find(f.detections[i].frame);
      if (at == nullptr) continue;
      list_markers(s, *at, w_.places);
      const double not_carried = s.background.log_density(f.detections[i].at, *at, id);
      for (std::size_t a = 0; a < marker.anchors.size(); ++a) {
        // Over long gaps a segment returns to its shape, so the variance does not grow with the
        // gap.
        if (carrier_.carry(k, marker.anchors[a], w_.places, Carrier::kLag, kNoise * square(noise_), way))
          w_.looks[a].add(way.place.log_density(f.detections[i].at, D_) - not_carried);
      }
    }
    double max_gain = -std::numeric_limits<double>::infinity(), total = 0;
    for (const Looks& looks : w_.looks) max_gain = std::max(max_gain, looks.mean());
    if (max_gain == -std::numeric_limits<double>::infinity()) return max_gain;
    for (const Looks& looks : w_.looks) total += std::exp(looks.mean() - max_gain);
    return max_gain + std::log(total / static_cast<double>(w_.looks.size()));
  }

 private:
  static constexpr std::size_t kLooks = 3;  // frames of a tracklet in which it is compared
  // Added to the variance of a predicted position, in units of the measurement variance.
  static constexpr double kNoise = 12;

  static double square(double x) { return x * x; }

  // The markers of an earlier frame, and the tracklets detected in it and in the newest frame.
  struct Common {
    std::int64_t then = 0;
    Places places;
    std::vector<std::pair<std::int32_t, RigidPair>> pairs;
  };
  const Common& common_with(const StitchMemory& s, std::int64_t then) {
    for (std::size_t k = 0; k < w_.n_common; ++k)
      if (w_.common[k].then == then) return w_.common[k];
    if (w_.n_common == w_.common.size()) w_.common.emplace_back();
    Common& common = w_.common[w_.n_common++];
    common.then = then;
    common.pairs.clear();
    list_markers(s, *s.frames.find(then), common.places);
    const auto& before = s.frames.find(then)->seen;
    auto a = before.begin();
    for (const auto& b : s.frames.newest().seen) {
      while (a != before.end() && a->tracklet < b.tracklet) ++a;
      if (a != before.end() && a->tracklet == b.tracklet)
        common.pairs.push_back({b.tracklet, {a->at, b.at, 1}});
    }
    return common;
  }
  void pair_nearest(const Common& common, std::int32_t own, const Point& then) {
    w_.nearest.clear();
    for (std::int32_t k = 0; k < static_cast<std::int32_t>(common.pairs.size()); ++k)
      if (common.pairs[k].first != own)
        keep_smallest(w_.nearest, kSteadiest, {squared_distance(common.pairs[k].second.a, then, D_), k});
    w_.pairs.clear();
    for (const auto& [distance2, k] : w_.nearest) {
      w_.pairs.push_back(common.pairs[k].second);
      w_.pairs.back().weight = 1 / (distance2 + w_.nearest.front().first + square(40 * noise_));
    }
  }
  // Updates the mean log-likelihood ratio with which neighbours predict each detected marker.
  void assess(const StitchMemory& s, std::span<const MarkerPoint> seen, Markers& markers) {
    const Frame* then = s.frames.find(s.frames.now() - Carrier::kLag);
    if (then == nullptr) return;
    list_markers(s, *then, w_.places);
    list_markers(s, s.frames.newest(), w_.places_now);
    const auto update = [&](const MarkerPoint& one, const RigidPrediction& found,
                            const Accuracy& accuracy) {
      Marker& marker = markers.at(one.marker);
      const Carried place =
          carrier_.place(found, accuracy, Carrier::kLag, kNoise * square(noise_));
      const double gain =
          place.log_density(one.at, D_) -
          s.background.log_density(one.at, s.frames.newest(), marker.tracklet);
      marker.mean_gain += 0.2 * (std::clamp(gain, -20.0, 20.0) - marker.mean_gain);
    };
    carrier_.assess(seen, w_.places, w_.places_now, update);
  }

  // The positions of the markers in a frame.
  static void list_markers(const StitchMemory& s, const Frame& at, Places& places) {
    places.clear();
    for (const auto& one : at.seen)
      if (const auto f = s.tracklets.find(one.tracklet);
          f != s.tracklets.end() && f->second.marker >= 0)
        places.set(f->second.marker, one.at);
  }

  struct Looks {
    double sum = 0, worst = 0;
    int n = 0;

    void add(double gain) {
      sum += gain;
      worst = n == 0 ? gain : std::min(worst, gain);
      ++n;
    }
    double mean() const {
      if (n == 0) return -std::numeric_limits<double>::infinity();
      return n > 2 ? (sum - worst) / (n - 1) : sum / n;
    }
  };
  struct Memory {
    std::vector<Common> common;  // of the earlier frames from which links lead into the newest
    std::size_t n_common = 0;
    std::vector<std::pair<double, std::int32_t>> nearest;
    std::vector<Looks> looks;
    std::vector<RigidPair> pairs;
    Places places, places_now;
  };

  int D_;
  double noise_;
  Carrier carrier_;
  Scratch<Memory> w_;  // scratch of one frame
};

}  // namespace asterism
