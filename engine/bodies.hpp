// What their neighbours say of markers: bodies bend, and hardly stretch.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <map>
#include <span>
#include <utility>
#include <vector>

#include "carrying.hpp"
#include "elsewhere.hpp"
#include "fragments.hpp"
#include "neighbours.hpp"

namespace asterism {

class Bodies {
 public:
  using Fragments = std::map<std::int32_t, Fragment>;
  using Markers = std::map<std::int32_t, Marker>;

  Bodies(int D, double noise, const Fragments& fragments, const RecentFrames& frames,
         const Elsewhere& elsewhere)
      : D_(D),
        noise_(noise),
        fragments_(fragments),
        frames_(frames),
        elsewhere_(elsewhere),
        neighbours_(D, noise) {}

  // The markers of the newest frame.
  void learn(std::span<const Seen> seen, Markers& markers) {
    neighbours_.add(seen);
    judge(seen, markers);
  }
  void forget(std::int32_t marker) { neighbours_.forget(marker); }

  // Before the links of the newest frame are asked for.
  void begin_links() {
    common_from_ = kNever;
    list_markers(frames_.newest(), places_now_);
  }
  // How well the neighbours know the link of a fragment from then to now: log density against
  // elsewhere. False where there are too few to say.
  bool link(const Frame::One& own, std::int64_t when, double& gain) {
        list_common(when);
    if (common_.size() < least_for_rotation(D_) + 2) return false;
    const Point then = *frames_.find(when)->find(own.fragment);
    const std::int32_t marker = fragments_.at(own.fragment).marker;
    pair_nearest(own.fragment, then);
    gain = carry(pairs_, then, D_, 3 * noise_).log_density(own.at);
    if (marker >= 0 && pair_steadiest(marker) && pairs_.size() == kFitted)
      gain = std::max(gain, carry(pairs_, then, D_, 3 * noise_).log_density(own.at));
    gain -= elsewhere_.log_density(own.at, frames_.newest(), own.fragment);
    return true;
  }

  // A marker that is not seen any more remembers who was around it.
  void remember_around(std::int32_t k, Marker& marker) {
    marker.is_hidden = true;
    marker.around.clear();
    marker.weight.clear();
    const Frame* then = frames_.find(marker.last);
    if (then == nullptr) return;
    std::vector<std::pair<double, Seen>> found;
    list_markers(*then, places_);
    for (const Bond& bond : neighbours_.of(k))
      if (const Point* at = places_.find(bond.other); at != nullptr && bond.other != k)
        found.push_back({neighbours_.unsteadiness(bond), {bond.other, *at}});
    std::sort(found.begin(), found.end(), [](const auto& a, const auto& b) {
      return std::pair(a.first, a.second.marker) < std::pair(b.first, b.second.marker);
    });
    if (found.size() > kRemembered) found.resize(kRemembered);
    for (const auto& [unsteady, seen] : found) {
      marker.around.push_back(seen);
      marker.weight.push_back(1 / square(unsteady));
    }
  }
  // How well the neighbours of a hidden marker carry it to where a fragment is.
  double log_odds(const Fragment& f, std::int32_t id, const Marker& marker) {
        double sum = 0;
    int n = 0;
    const std::size_t every = std::max<std::size_t>(f.sights.size() / kLooks, 1);
    for (std::size_t s = 0; s < f.sights.size(); s += every) {
      const Frame* at = frames_.find(f.sights[s].frame);
      if (at == nullptr) continue;
      list_markers(*at, places_);
      pairs_.clear();
      for (std::size_t r = 0; r < marker.around.size() && pairs_.size() < kFitted; ++r)
        if (const Point* now = places_.find(marker.around[r].marker); now != nullptr)
          pairs_.push_back({marker.around[r].at, *now, marker.weight[r]});
      if (pairs_.empty()) continue;
      sum += carry(pairs_, marker.at, D_, 4 * noise_).log_density(f.sights[s].at) -
             elsewhere_.log_density(f.sights[s].at, *at, id);
      ++n;
    }
    return n > 0 ? sum / n : -std::numeric_limits<double>::infinity();
  }

 private:
  static constexpr std::int64_t kNever = std::numeric_limits<std::int64_t>::min() / 2;
  static constexpr std::size_t kFitted = 6;       // neighbours that a fit is made of
  static constexpr std::size_t kRemembered = 16;  // neighbours of a hidden marker
  static constexpr std::size_t kLooks = 3;        // frames of a fragment in which it is compared
  static constexpr std::int64_t kTrustLag = 12, kTrustEvery = 4;  // frames

  static double square(double x) { return x * x; }

  // Fragments that are seen both then and now.
  void list_common(std::int64_t then) {
    if (common_from_ == then) return;
    common_from_ = then;
    common_.clear();
    list_markers(*frames_.find(then), places_);
    const auto& before = frames_.find(then)->seen;
    auto a = before.begin();
    for (const auto& b : frames_.newest().seen) {
      while (a != before.end() && a->fragment < b.fragment) ++a;
      if (a != before.end() && a->fragment == b.fragment)
        common_.push_back({b.fragment, {a->at, b.at, 1}});
    }
  }
  void pair_nearest(std::int32_t own, const Point& then) {
    nearest_.clear();
    for (std::int32_t k = 0; k < static_cast<std::int32_t>(common_.size()); ++k)
      if (common_[k].first != own)
        nearest_.emplace_back(squared_distance(common_[k].second.a, then, D_), k);
    const std::size_t n = std::min(kFitted, nearest_.size());
    std::partial_sort(nearest_.begin(), nearest_.begin() + static_cast<std::ptrdiff_t>(n),
                      nearest_.end());
    pairs_.clear();
    for (std::size_t k = 0; k < n; ++k) {
      pairs_.push_back(common_[nearest_[k].second].second);
      pairs_.back().weight = 1 / (nearest_[k].first + nearest_.front().first + square(40 * noise_));
    }
  }
  // The steadiest neighbours that are in both `places_` and `places_now_`.
  bool pair_steadiest(std::int32_t marker) {
    steady_.clear();
    pairs_.clear();
    for (const Bond& bond : neighbours_.of(marker))
      if (places_.find(bond.other) != nullptr && places_now_.find(bond.other) != nullptr)
        steady_.emplace_back(neighbours_.unsteadiness(bond), bond.other);
    const std::size_t n = std::min(kFitted, steady_.size());
    std::partial_sort(steady_.begin(), steady_.begin() + static_cast<std::ptrdiff_t>(n),
                      steady_.end());
    for (std::size_t r = 0; r < n; ++r)
      pairs_.push_back({*places_.find(steady_[r].second), *places_now_.find(steady_[r].second),
                        1 / square(steady_[r].first)});
    return n > 0;
  }
  // While a marker is seen, where its neighbours would have carried it in a while is a test of them.
  void judge(std::span<const Seen> seen, Markers& markers) {
        const Frame* then = frames_.find(frames_.now() - kTrustLag);
    if (then == nullptr) return;
    list_markers(*then, places_);
    list_markers(frames_.newest(), places_now_);
    for (const Seen& one : seen) {
      if ((frames_.now() + one.marker) % kTrustEvery != 0) continue;
      const Point* before = places_.find(one.marker);
      if (before == nullptr) continue;
      if (!pair_steadiest(one.marker)) continue;
      Marker& marker = markers.at(one.marker);
      const double gain = carry(pairs_, *before, D_, 4 * noise_).log_density(one.at) -
                          elsewhere_.log_density(one.at, frames_.newest(), marker.fragment);
      marker.trust += 0.2 * (std::clamp(gain, -20.0, 20.0) - marker.trust);
    }
  }

  // Where the markers are in a frame.
  void list_markers(const Frame& at, Places& places) const {
    places.clear();
    for (const auto& one : at.seen)
      if (const auto f = fragments_.find(one.fragment); f != fragments_.end() && f->second.marker >= 0)
        places.set(f->second.marker, one.at);
  }

  int D_;
  double noise_;
  const Fragments& fragments_;
  const RecentFrames& frames_;
  const Elsewhere& elsewhere_;
  Neighbours neighbours_;

  // While a frame is worked on.
  std::int64_t common_from_ = kNever;
  std::vector<std::pair<std::int32_t, RigidPair>> common_;
  std::vector<std::pair<double, std::int32_t>> nearest_, steady_;
  std::vector<RigidPair> pairs_;
  Places places_, places_now_;
};

}  // namespace asterism
