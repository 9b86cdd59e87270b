// What their neighbours say of markers: bodies bend, and hardly stretch.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <span>
#include <utility>
#include <vector>

#include "base/scratch.hpp"
#include "rigid/carried_motion.hpp"
#include "rigid/neighbours.hpp"
#include "rigid/tracklets.hpp"
#include "stitch/background_density.hpp"

namespace asterism {

class Bodies {
 public:
  Bodies(int D, double noise) : D_(D), noise_(noise), neighbours_(D, noise) {}

  // The markers of the newest frame.
  void learn(const Sightings& s, std::span<const Seen> seen, Markers& markers) {
    neighbours_.add(seen);
    judge(s, seen, markers);
  }
  void forget(std::int32_t marker) { neighbours_.forget(marker); }

  // Before the links of the newest frame are asked for.
  void begin_links(const Sightings& s) {
    w_.common_from = kNever;
    list_markers(s, s.frames.newest(), w_.places_now);
  }
  // How well the neighbours know the link of a fragment from then to now: log density against
  // elsewhere, of the steadiest and, where these say less than `enough`, of the nearest too. False
  // where there are too few to say.
  bool link(const Sightings& s, const Frame::One& own, const Fragment& f, double enough,
            double& gain) {
    list_common(s, f.last);
    if (w_.common.size() < least_for_rotation(D_) + 2) return false;
    const Point then = *s.frames.find(f.last)->find(own.fragment);
    const double elsewhere = s.elsewhere.log_density(own.at, s.frames.newest(), own.fragment);
    const auto say = [&] {
      return carry(w_.pairs, then, D_, 3 * noise_).log_density(own.at) - elsewhere;
    };
    gain = -std::numeric_limits<double>::infinity();
    if (f.marker >= 0 && pair_steadiest(f.marker) && w_.pairs.size() == kFitted) gain = say();
    if (gain >= enough) return true;
    pair_nearest(own.fragment, then);
    gain = std::max(gain, say());
    return true;
  }

  // A marker that is not seen any more remembers who was around it. What was seen last of it may be
  // a ghost beside it already, so that some earlier frames are remembered too.
  void remember_around(const Sightings& s, std::int32_t k, Marker& marker) {
    marker.is_hidden = true;
    marker.anchors.clear();
    for (const std::int64_t back : kAnchors) {
      const Frame* then = s.frames.find(marker.last - back);
      if (then == nullptr) continue;
      list_markers(s, *then, w_.places);
      const Point* own = w_.places.find(k);
      if (own == nullptr) continue;
      w_.found.clear();
      for (const Bond& bond : neighbours_.of(k))
        if (const Point* at = w_.places.find(bond.other); at != nullptr && bond.other != k)
          w_.found.push_back({neighbours_.unsteadiness(bond), {bond.other, *at}});
      std::sort(w_.found.begin(), w_.found.end(), [](const auto& a, const auto& b) {
        return std::pair(a.first, a.second.marker) < std::pair(b.first, b.second.marker);
      });
      if (w_.found.size() > kRemembered) w_.found.resize(kRemembered);
      Anchor& anchor = marker.anchors.emplace_back();
      anchor.at = *own;
      for (const auto& [unsteady, seen] : w_.found) {
        anchor.around.push_back(seen);
        anchor.weight.push_back(1 / square(unsteady));
      }
    }
  }
  // How well the neighbours of a hidden marker carry it to where a fragment is: from each anchor on
  // the mean over some looks at the fragment but the worst, which may be at a ghost; any anchor may be
  // the right one.
  double log_odds(const Sightings& s, const Fragment& f, std::int32_t id, const Marker& marker) {
    const std::size_t every = std::max<std::size_t>(f.sights.size() / kLooks, 1);
    w_.looks.assign(marker.anchors.size(), {});
    for (std::size_t i = 0; i < f.sights.size(); i += every) {
      const Frame* at = s.frames.find(f.sights[i].frame);
      if (at == nullptr) continue;
      list_markers(s, *at, w_.places);
      const double not_carried = s.elsewhere.log_density(f.sights[i].at, *at, id);
      for (std::size_t a = 0; a < marker.anchors.size(); ++a) {
        const Anchor& anchor = marker.anchors[a];
        w_.pairs.clear();
        for (std::size_t r = 0; r < anchor.around.size() && w_.pairs.size() < kFitted; ++r)
          if (const Point* now = w_.places.find(anchor.around[r].marker); now != nullptr)
            w_.pairs.push_back({anchor.around[r].at, *now, anchor.weight[r]});
        if (w_.pairs.empty()) continue;
        w_.looks[a].add(carry(w_.pairs, anchor.at, D_, 4 * noise_).log_density(f.sights[i].at) -
                        not_carried);
      }
    }
    double most = -std::numeric_limits<double>::infinity(), total = 0;
    for (const Looks& looks : w_.looks) most = std::max(most, looks.mean());
    if (most == -std::numeric_limits<double>::infinity()) return most;
    for (const Looks& looks : w_.looks) total += std::exp(looks.mean() - most);
    return most + std::log(total / static_cast<double>(w_.looks.size()));
  }

 private:
  static constexpr std::int64_t kNever = std::numeric_limits<std::int64_t>::min() / 2;
  static constexpr std::size_t kFitted = 6;       // neighbours that a fit is made of
  static constexpr std::size_t kRemembered = 16;  // neighbours of a hidden marker
  static constexpr std::array<std::int64_t, 3> kAnchors{0, 4, 10};  // frames before it was seen last
  static constexpr std::size_t kLooks = 3;        // frames of a fragment in which it is compared
  static constexpr std::int64_t kTrustLag = 12, kTrustEvery = 4;  // frames

  static double square(double x) { return x * x; }

  // Sorts the least kFitted to the front, and says how many these are: insertion is quicker than a heap
  // for so few.
  static std::size_t least_first(std::vector<std::pair<double, std::int32_t>>& all) {
    std::size_t n = 0;
    for (std::size_t i = 0; i < all.size(); ++i) {
      const std::pair<double, std::int32_t> one = all[i];
      if (n == kFitted && !(one < all[n - 1])) continue;
      std::size_t at = n < kFitted ? n++ : n - 1;
      for (; at > 0 && one < all[at - 1]; --at) all[at] = all[at - 1];
      all[at] = one;
    }
    return n;
  }
  // Fragments that are seen both then and now.
  void list_common(const Sightings& s, std::int64_t then) {
    if (w_.common_from == then) return;
    w_.common_from = then;
    w_.common.clear();
    list_markers(s, *s.frames.find(then), w_.places);
    const auto& before = s.frames.find(then)->seen;
    auto a = before.begin();
    for (const auto& b : s.frames.newest().seen) {
      while (a != before.end() && a->fragment < b.fragment) ++a;
      if (a != before.end() && a->fragment == b.fragment)
        w_.common.push_back({b.fragment, {a->at, b.at, 1}});
    }
  }
  void pair_nearest(std::int32_t own, const Point& then) {
    w_.nearest.clear();
    for (std::int32_t k = 0; k < static_cast<std::int32_t>(w_.common.size()); ++k)
      if (w_.common[k].first != own)
        w_.nearest.emplace_back(squared_distance(w_.common[k].second.a, then, D_), k);
    const std::size_t n = least_first(w_.nearest);
    w_.pairs.clear();
    for (std::size_t k = 0; k < n; ++k) {
      w_.pairs.push_back(w_.common[w_.nearest[k].second].second);
      w_.pairs.back().weight = 1 / (w_.nearest[k].first + w_.nearest.front().first + square(40 * noise_));
    }
  }
  // The steadiest neighbours that are in both `w_.places` and `w_.places_now`.
  bool pair_steadiest(std::int32_t marker) {
    w_.steady.clear();
    w_.pairs.clear();
    for (const Bond& bond : neighbours_.of(marker))
      if (w_.places.find(bond.other) != nullptr && w_.places_now.find(bond.other) != nullptr)
        w_.steady.emplace_back(neighbours_.unsteadiness(bond), bond.other);
    const std::size_t n = least_first(w_.steady);
    for (std::size_t r = 0; r < n; ++r)
      w_.pairs.push_back({*w_.places.find(w_.steady[r].second), *w_.places_now.find(w_.steady[r].second),
                        1 / square(w_.steady[r].first)});
    return n > 0;
  }
  // While a marker is seen, where its neighbours would have carried it in a while is a test of them.
  void judge(const Sightings& s, std::span<const Seen> seen, Markers& markers) {
    const Frame* then = s.frames.find(s.frames.now() - kTrustLag);
    if (then == nullptr) return;
    list_markers(s, *then, w_.places);
    list_markers(s, s.frames.newest(), w_.places_now);
    for (const Seen& one : seen) {
      if ((s.frames.now() + one.marker) % kTrustEvery != 0) continue;
      const Point* before = w_.places.find(one.marker);
      if (before == nullptr) continue;
      if (!pair_steadiest(one.marker)) continue;
      Marker& marker = markers.at(one.marker);
      const double gain = carry(w_.pairs, *before, D_, 4 * noise_).log_density(one.at) -
                          s.elsewhere.log_density(one.at, s.frames.newest(), marker.fragment);
      marker.trust += 0.2 * (std::clamp(gain, -20.0, 20.0) - marker.trust);
    }
  }

  // Where the markers are in a frame.
  static void list_markers(const Sightings& s, const Frame& at, Places& places) {
    places.clear();
    for (const auto& one : at.seen)
      if (const auto f = s.fragments.find(one.fragment); f != s.fragments.end() && f->second.marker >= 0)
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
    std::int64_t common_from = kNever;
    std::vector<std::pair<std::int32_t, RigidPair>> common;
    std::vector<std::pair<double, std::int32_t>> nearest, steady;
    std::vector<std::pair<double, Seen>> found;
    std::vector<Looks> looks;
    std::vector<RigidPair> pairs;
    Places places, places_now;
  };

  int D_;
  double noise_;
  Neighbours neighbours_;
  Fresh<Memory> w_;  // while a frame is worked on
};

}  // namespace asterism
