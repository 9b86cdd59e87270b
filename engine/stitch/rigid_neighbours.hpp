// Evidence of rigid neighbours for the links of tracklets and for occluded markers.
#pragma once

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <cstdint>
#include <deque>
#include <limits>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "base/flat_map.hpp"
#include "base/scratch.hpp"
#include "base/shared_copy.hpp"
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
  // Removes what belongs to the frame before, and to frames that are no longer kept.
  void begin_frame(const StitchMemory& s) {
    w_.n_common = 0;
    forget_places();
    ways_.erase_if([&](const auto& of_frame) { return s.frames.find(of_frame.first) == nullptr; });
  }
  // Removes the positions of markers, because a detection has another tracklet now.
  void forget_places() {
    w_.n_known = 0;
    w_.looked_at = -1;
    w_.peaks.clear();
  }
  // Adds the positions of a tracklet that has a marker now. Predictions stay known unless they are
  // of that marker or may use it.
  void add_places(const StitchMemory& s, std::int32_t tracklet, std::int32_t k,
                  const Markers& markers) {
    for (std::size_t i = 0; i < w_.n_known; ++i)
      if (const Point* at = s.frames.find(w_.known[i].frame)->find(tracklet); at != nullptr)
        w_.known[i].places.set(k, *at);
    const auto uses = [&](const Anchor& anchor) {
      return std::ranges::find(anchor.around, k, &MarkerPoint::marker) != anchor.around.end();
    };
    w_.using_it.clear();
    for (const auto& [other, marker] : markers)
      if (marker.is_prepared() && std::ranges::any_of(*marker.anchors, uses))
        w_.using_it.push_back(other);
    for (auto& [t, ways] : ways_) {
      if (ways->find(k) != nullptr) ways.own().erase(k);
      if (s.frames.find(t)->find(tracklet) == nullptr) continue;
      for (const std::int32_t other : w_.using_it)
        if (ways->find(other) != nullptr) ways.own().erase(other);
    }
  }
  // Sum of the peaks of the background density beside all others at a detection of the newest frame.
  double peaks(const StitchMemory& s, const Frame::One& one) {
    const Frame& now = s.frames.newest();
    if (w_.peaks.empty()) s.background.sum_peaks(now, w_.peaks);
    return w_.peaks[static_cast<std::size_t>(&one - now.seen.data())];
  }

  // Link of a tracklet into the newest frame.
  struct Link {
    Frame::One* own = nullptr;
    Tracklet* tracklet = nullptr;
    double enough = 0;  // a log-likelihood ratio that need not be known better
    double gain = -std::numeric_limits<double>::infinity();
  };
  // Computes the log-likelihood ratios of links, predicted by the tracklets' neighbours, against the
  // background density. The most stable neighbours are used first, and the nearest ones also if the
  // result is below `enough`. Links with too few neighbours are removed.
  void rate(const StitchMemory& s, std::vector<Link>& links) {
    std::erase_if(links, [&](const Link& link) {
      return common_with(s, link.tracklet->last).pairs.size() < min_for_rotation(D_) + 2;
    });
    // Segments hardly deform between two frames, so the residual of the fit alone gives the
    // variance.
    const auto say = [&](Link& link, const RigidPrediction& found) {
      const double gain = found.place(kNoise * square(noise_), 0).log_density(link.own->at, D_) -
                          not_carried_now(s, *link.own);
      link.gain = std::max(link.gain, gain);
    };
    const auto then = [&](const Link& link) {
      return *s.frames.find(link.tracklet->last)->find(link.own->tracklet);
    };
    const auto steadiest = [&](const Link& link, Point& was) -> std::span<const RigidPair> {
      if (link.tracklet->marker < 0) return {};
      const auto pairs = carrier_.pair(link.tracklet->marker, places(s, link.tracklet->last),
                                       places(s, s.frames.now()));
      if (pairs.size() < kSteadiest) return {};
      was = then(link);
      return pairs;
    };
    const auto nearest = [&](const Link& link, Point& was) -> std::span<const RigidPair> {
      if (link.gain >= link.enough) return {};
      was = then(link);
      pair_nearest(common_with(s, link.tracklet->last), link.own->tracklet, was);
      return w_.pairs;
    };
    w_.predictions.each(D_, square(noise_), links, steadiest, say);
    w_.predictions.each(D_, square(noise_), links, nearest, say);
  }

  // Stores the positions of the neighbours of an occluded marker. The last detections may already
  // be those of a ghost, so several earlier frames are stored.
  void remember_around(const StitchMemory& s, std::int32_t k, Marker& marker) {
    std::vector<Anchor> anchors;
    for (const std::int64_t back : Carrier::kAnchors)
      if (const std::int64_t then = marker.last - back; s.frames.find(then) != nullptr)
        carrier_.remember(k, places(s, then), then, anchors);
    marker.anchors = SharedCopy<std::vector<Anchor>>(std::move(anchors));
  }
  // Predicts the occluded marker k in the newest frame, because an undecided tracklet there may be
  // compared with it later. The frame of a decision would otherwise predict it in many frames.
  void prepare(const StitchMemory& s, std::int32_t k, const Marker& marker) {
    carry(s, k, *marker.anchors, s.frames.now());
  }
  // Log-likelihood ratio for a tracklet to be the occluded marker k, predicted by the neighbours of
  // k. For each anchor, it is averaged over some detections of the tracklet, without the worst,
  // which may be a ghost. The anchors are alternatives, so their likelihoods are averaged.
  double log_odds(const StitchMemory& s, const Tracklet& f, std::int32_t id, std::int32_t k,
                  const Marker& marker) {
    if (w_.looked_at != id) look(s, f, id);
    const std::vector<Anchor>& anchors = *marker.anchors;
    w_.looks.assign(anchors.size(), {});
    for (const Moment& moment : w_.moments) {
      const Ways& ways = carry(s, k, anchors, moment.frame);
      for (std::size_t a = 0; a < anchors.size(); ++a)
        if (ways[a]) w_.looks[a].add(ways[a]->log_density(moment.at, D_) - moment.not_carried);
    }
    double max_gain = -std::numeric_limits<double>::infinity(), total = 0;
    for (const Looks& looks : w_.looks) max_gain = std::max(max_gain, looks.mean());
    if (max_gain == -std::numeric_limits<double>::infinity()) return max_gain;
    for (const Looks& looks : w_.looks) total += std::exp(looks.mean() - max_gain);
    return max_gain + std::log(total / static_cast<double>(w_.looks.size()));
  }
  // Position of the occluded marker k predicted from the markers detected at `now`, as in
  // `log_odds`.
  std::optional<Carried> place(std::int32_t k, std::span<const Anchor> anchors, const Places& now) {
    w_.ways.clear();
    carrier_.carry(
        k, anchors, now, kNoise * square(noise_), [](const Anchor&) { return Carrier::kLag; },
        [&](const Anchor&, const Carriage& way) { w_.ways.push_back(way); });
    if (w_.ways.empty()) return std::nullopt;
    return middle(w_.ways, D_).place;
  }

 private:
  static constexpr std::size_t kLooks = 3;  // frames of a tracklet in which it is compared
  // Added to the variance of a predicted position, in units of the measurement variance.
  static constexpr double kNoise = 12;

  static double square(double x) { return x * x; }

  // A detection of a tracklet that is compared with occluded markers, and its background density.
  struct Moment {
    std::int64_t frame = 0;
    Point at{};
    double not_carried = 0;
  };
  // The positions predicted from the anchors of an occluded marker.
  using Ways = std::array<std::optional<Carried>, Carrier::kAnchors.size()>;
  // What is known of a frame that is kept.
  struct Known {
    std::int64_t frame = 0;
    Places places;
  };

  // Interval of the detections of a tracklet in which it is compared.
  static std::size_t interval(std::size_t n) { return std::max<std::size_t>(n / kLooks, 1); }
  // Selects the moments of a tracklet. They are the same for all occluded markers.
  void look(const StitchMemory& s, const Tracklet& f, std::int32_t id) {
    w_.looked_at = id;
    w_.moments.clear();
    const std::vector<TrackletPoint>& detections = f.open->detections;
    const std::size_t every = interval(detections.size());
    for (std::size_t i = 0; i < detections.size(); i += every)
      if (const Frame* at = s.frames.find(detections[i].frame); at != nullptr)
        w_.moments.push_back({detections[i].frame, detections[i].at,
                              s.background.log_density(detections[i].peaks, *at)});
  }

  // The tracklets detected in an earlier frame and in the newest one.
  struct Common {
    std::int64_t then = 0;
    std::vector<std::pair<std::int32_t, RigidPair>> pairs;
  };
  const Common& common_with(const StitchMemory& s, std::int64_t then) {
    for (std::size_t k = 0; k < w_.n_common; ++k)
      if (w_.common[k].then == then) return w_.common[k];
    if (w_.n_common == w_.common.size()) w_.common.emplace_back();
    Common& common = w_.common[w_.n_common++];
    common.then = then;
    common.pairs.clear();
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
    const std::int64_t then = s.frames.now() - Carrier::kLag;
    if (s.frames.find(then) == nullptr) return;
    const auto update = [&](const MarkerPoint& one, const RigidPrediction& found,
                            const Accuracy& accuracy) {
      Marker& marker = markers.at(one.marker);
      const Carried place =
          carrier_.place(found, accuracy, Carrier::kLag, kNoise * square(noise_));
      const double gain =
          place.log_density(one.at, D_) - not_carried_now(s, *s.frames.newest().one(marker.tracklet));
      marker.mean_gain += 0.2 * (std::clamp(gain, -20.0, 20.0) - marker.mean_gain);
    };
    carrier_.assess(seen, places(s, then), places(s, s.frames.now()), update);
  }

  Known& known(const StitchMemory& s, std::int64_t t) {
    for (std::size_t k = 0; k < w_.n_known; ++k)
      if (w_.known[k].frame == t) {
        assert(is_current(s, w_.known[k]));
        return w_.known[k];
      }
    if (w_.n_known == w_.known.size()) w_.known.emplace_back();
    Known& known = w_.known[w_.n_known++];
    known.frame = t;
    const std::vector<Frame::One>& seen = s.frames.find(t)->seen;
    known.places.clear();
    known.places.reserve(seen.size());
    for_each_known(seen, &Frame::One::tracklet, s.tracklets,
                   [&](const Frame::One& one, const Tracklet& f) {
      if (f.marker >= 0) known.places.set(f.marker, one.at);
    });
    return known;
  }
  // Whether the positions are those that would be listed now.
  static bool is_current(const StitchMemory& s, const Known& known) {
    std::size_t n = 0, n_equal = 0;
    for_each_known(s.frames.find(known.frame)->seen, &Frame::One::tracklet, s.tracklets,
                   [&](const Frame::One& one, const Tracklet& f) {
      const Point* at = f.marker < 0 ? nullptr : known.places.find(f.marker);
      n += f.marker >= 0;
      n_equal += at != nullptr && *at == one.at;
    });
    return n_equal == n && known.places.size() == n;
  }
  // The positions of the markers in a frame.
  const Places& places(const StitchMemory& s, std::int64_t t) { return known(s, t).places; }
  // Where an occluded marker was in a frame, by its anchors. It is the same for all tracklets.
  const Ways& carry(const StitchMemory& s, std::int32_t k, std::span<const Anchor> anchors,
                    std::int64_t t) {
    SharedCopy<FlatMap<std::int32_t, Ways>>& then = ways_[t];
    if (!then.has_value()) then = SharedCopy(FlatMap<std::int32_t, Ways>{});
    if (const Ways* ways = then->find(k); ways != nullptr) {
      assert(*ways == predict(s, k, anchors, t));
      return *ways;
    }
    return then.own()[k] = predict(s, k, anchors, t);
  }
  Ways predict(const StitchMemory& s, std::int32_t k, std::span<const Anchor> anchors,
               std::int64_t t) {
    Ways ways;
    // Over long gaps a segment returns to its shape, so the variance does not grow with the gap.
    carrier_.carry(
        k, anchors, places(s, t), kNoise * square(noise_),
        [](const Anchor&) { return Carrier::kLag; },
        [&](const Anchor& anchor, const Carriage& way) {
          ways[static_cast<std::size_t>(&anchor - anchors.data())] = way.place;
        });
    return ways;
  }
  // Background density of a detection of the newest frame.
  double not_carried_now(const StitchMemory& s, const Frame::One& one) {
    return s.background.log_density(peaks(s, one), s.frames.newest());
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
    std::vector<Carriage> ways;
    std::vector<RigidPair> pairs;
    RigidPredictions predictions;
    std::vector<std::int32_t> using_it;  // occluded markers with a certain neighbour
    std::deque<Known> known;  // references stay valid
    std::size_t n_known = 0;
    std::vector<double> peaks;  // of the newest frame
    std::int32_t looked_at = -1;  // the tracklet of `moments`
    std::vector<Moment> moments;
  };

  int D_;
  double noise_;
  Carrier carrier_;
  // Predictions in the frames that are kept, by frame and by occluded marker. Those from before a
  // marker was last detected are not used any more, because later tracklets alone can continue it.
  FlatMap<std::int64_t, SharedCopy<FlatMap<std::int32_t, Ways>>> ways_;
  Scratch<Memory> w_;  // scratch of one frame
};

}  // namespace asterism
