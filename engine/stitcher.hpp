// Fragments of tracks made into markers, through gaps of any length.
//
// A tracker that gives up early makes fragments that are pure: what comes back after a while is a
// stranger to it. Here a fragment that has been seen for a while, or is over, is weighed against every
// marker that is hidden:
//
//   body    the neighbours that keep their distance have moved on rigidly and carry the hidden marker
//           with them; how well they fit says how sure that is
//   motion  its own filter goes on through the gap
//
// against what else it may be: a new marker anywhere, or a ghost beside a marker. Fragments that are
// open at the same time compete for the hidden markers (an assignment). One that nothing explains is a
// new marker; if it was short and beside another, a ghost.
//
// A link inside a fragment is weighed by its neighbours too; where they contradict, it is cut.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <deque>
#include <limits>
#include <map>
#include <span>
#include <unordered_map>
#include <utility>
#include <vector>

#include "assignment.hpp"
#include "carrying.hpp"
#include "modes.hpp"
#include "neighbours.hpp"

namespace asterism {

struct StitchOptions {
  double noise = 0;         // of a detection, along an axis
  double ghost_radius = 0;  // so far from its marker is a ghost, about
  std::int64_t confirm = 15;     // frames until a fragment is decided upon
  std::int64_t max_gap = 0;      // frames after which an unseen fragment is over
  std::int64_t max_hidden = 0;   // frames after which a marker is forgotten; 0: never
};

// What was decided of a fragment.
struct Decision {
  static constexpr std::int32_t kOpen = -1, kGhost = -2;
  std::int32_t fragment = 0;
  std::int32_t marker = kOpen;
  std::int32_t after = -1;      // the fragment that it goes on with, -1 of a new marker
  double probability = 1;       // that it does
};

class Stitcher {
 public:
  Stitcher(const MotionModel& m, const StitchOptions& options)
      : m_(m), opt_(options), neighbours_(m.axis.D, options.noise) {}

  std::int32_t n_fragments() const { return n_fragments_; }
  std::int32_t n_markers() const { return n_markers_; }
  std::int64_t n_cuts() const { return n_cuts_; }
  const Neighbours& neighbours() const { return neighbours_; }

  // One frame: its points, and of each the label that the tracker gave it, -1 for none. Writes the
  // fragment of each, and tells `decide(decision)`.
  template <typename Decide>
  void step(const MotionStep& step, std::span<const Point> points,
            std::span<const std::int64_t> labels, std::span<std::int32_t> fragment_of,
            Decide&& decide) {
    ++now_;
    move_on(step);
    take_in(points, labels, fragment_of);
    cut_links(labels, fragment_of);
    for (std::size_t i = 0; i < points.size(); ++i)
      if (fragment_of[i] >= 0) see(fragment_of[i], points[i]);
    hide();
    learn();
    decide_due(false, decide);
    forget();
  }
  // After the last frame.
  template <typename Decide>
  void finish(Decide&& decide) {
    decide_due(true, decide);
  }

 private:
  static constexpr std::int64_t kNever = std::numeric_limits<std::int64_t>::min() / 2;
  static constexpr std::size_t kFitted = 6;       // neighbours that a fit is made of
  static constexpr std::size_t kRemembered = 16;  // neighbours of a hidden marker
  static constexpr std::size_t kLooks = 3;        // frames of a fragment in which it is compared
  static constexpr std::int32_t kMotionSights = 4;   // detections by which motions are compared
  static constexpr std::int64_t kMotionFrames = 120;  // a motion is believed no longer than that
  // Log odds that a fragment is a marker come back, before anything is compared: of one that was over
  // before it was decided upon, and of others.
  static constexpr double kShort = -3, kLong = 2;
  // A link is cut where the neighbours, which knew it well so far, now give it no more than this.
  static constexpr double kKnownWell = 6, kContradicted = 3, kDoubted = 3;
  static constexpr double kKnownFirst = 10;
  static constexpr double kTrusted = 2;          // of the markers on average: there are bodies
  static constexpr double kLeastMotion = 0.005;  // weight of the motion where the body is trusted
  static constexpr double kWorth = 0.4;  // of the log odds, in a probability
  static constexpr std::int64_t kTrustLag = 12, kTrustEvery = 4;

  struct Sight {
    std::int64_t frame = 0;
    Point at{};
  };
  // A hidden marker's own motion, gone on with by a fragment.
  struct Continuation {
    std::int32_t marker = 0;
    MotionState state;
    double log_likelihood = 0;
  };
  struct Fragment {
    std::int64_t label = -1;
    std::int32_t marker = Decision::kOpen;
    std::int64_t first = 0, last = 0;
    std::int32_t n = 0;
    std::vector<Sight> sights;  // until it is decided upon
    MotionState state;
    double alone = 0;  // log likelihood of its second detection and those after
    std::vector<Continuation> continuations;
    double known = kKnownFirst;  // how well its neighbours knew its links, on average
  };
  struct Marker {
    std::int32_t fragment = -1;
    std::int64_t last = 0;
    Point at{};
    MotionState state;           // now
    std::vector<Seen> around;    // when it was seen last, the steadiest first
    std::vector<double> weight;  // of these
    bool is_hidden = false;
    double trust = 3;  // how well its neighbours carried it lately, while it was seen
  };
  struct Frame {
    struct One {
      std::int32_t fragment = 0;
      Point at{};
      std::int32_t point = 0;  // its number in the frame
    };
    std::vector<One> seen;  // in order of fragments

    const Point* find(std::int32_t fragment) const {
      const auto at = std::lower_bound(seen.begin(), seen.end(), fragment,
                                       [](const One& one, std::int32_t id) { return one.fragment < id; });
      return at != seen.end() && at->fragment == fragment ? &at->at : nullptr;
    }
    void sort() {
      std::sort(seen.begin(), seen.end(),
                [](const One& a, const One& b) { return a.fragment < b.fragment; });
    }
  };
  // Where the markers are in a frame.
  class Places {
   public:
    void clear() { ++stamp_; }
    void set(std::int32_t marker, const Point& at) {
      if (static_cast<std::int32_t>(at_.size()) <= marker) at_.resize(marker + 1);
      at_[marker] = {stamp_, at};
    }
    const Point* find(std::int32_t marker) const {
      return marker < static_cast<std::int32_t>(at_.size()) && at_[marker].first == stamp_
                 ? &at_[marker].second
                 : nullptr;
    }

   private:
    std::int64_t stamp_ = 0;
    std::vector<std::pair<std::int64_t, Point>> at_;
  };

  const Frame* frame(std::int64_t t) const {
    const std::int64_t back = now_ - t;
    return back >= 0 && back < static_cast<std::int64_t>(frames_.size())
               ? &frames_[frames_.size() - 1 - static_cast<std::size_t>(back)]
               : nullptr;
  }
  bool is_over(const Fragment& f) const { return now_ - f.last > opt_.max_gap; }
  bool is_short(const Fragment& f) const {
    return is_over(f) && f.last - f.first + 1 < opt_.confirm;
  }

  void move_on(const MotionStep& step) {
    for (auto& [id, f] : fragments_) {
      if (f.marker >= 0) continue;  // the marker has its state
      predict(m_, step, f.state);
      if (f.n < kMotionSights)
        for (Continuation& c : f.continuations) predict(m_, step, c.state);
    }
    for (auto& [id, marker] : markers_)
      if (now_ - marker.last <= kMotionFrames) predict(m_, step, marker.state);
  }

  void take_in(std::span<const Point> points, std::span<const std::int64_t> labels,
               std::span<std::int32_t> fragment_of) {
    for (std::size_t i = 0; i < points.size(); ++i) {
      fragment_of[i] = -1;
      if (labels[i] < 0) continue;
      const auto at = of_label_.find(labels[i]);
      const bool goes_on = at != of_label_.end() && may_go_on(at->second);
      fragment_of[i] = goes_on ? at->second : begin(labels[i]);
    }
    frames_.emplace_back();
    for (std::size_t i = 0; i < points.size(); ++i)
      if (fragment_of[i] >= 0)
        frames_.back().seen.push_back({fragment_of[i], points[i], static_cast<std::int32_t>(i)});
    frames_.back().sort();
    while (static_cast<std::int64_t>(frames_.size()) > opt_.confirm + opt_.max_gap + 2)
      frames_.pop_front();
  }
  // A marker may have been found again elsewhere, or the fragment may be long over.
  bool may_go_on(std::int32_t id) const {
    const auto at = fragments_.find(id);
    if (at == fragments_.end() || is_over(at->second)) return false;
    if (at->second.marker < 0) return at->second.marker == Decision::kOpen;
    const auto marker = markers_.find(at->second.marker);
    return marker != markers_.end() && marker->second.fragment == id;
  }
  std::int32_t begin(std::int64_t label) {
    const std::int32_t id = n_fragments_++;
    Fragment& f = fragments_[id];
    f.label = label;
    f.first = f.last = now_;
    of_label_[label] = id;
    return id;
  }

  // Whether neighbours carry the markers that are seen, on the whole.
  bool has_bodies() const {
    double sum = 0;
    std::size_t n = 0;
    for (const auto& [k, marker] : markers_)
      if (!marker.is_hidden) {
        sum += marker.trust;
        ++n;
      }
    return n > 0 && sum > kTrusted * static_cast<double>(n);
  }

  // Links that the neighbours contradict.
  void cut_links(std::span<const std::int64_t> labels, std::span<std::int32_t> fragment_of) {
    Frame& now = frames_.back();
    cut_.clear();
    common_from_ = kNever;
    list_markers(now, places_now_);
    for (Frame::One& one : now.seen) {
      Fragment& f = fragments_.at(one.fragment);
      if (f.n == 0 || frame(f.last) == nullptr) continue;
      list_common(f.last);
      double gain = 0;
      if (!weigh_link(one, f.last, gain)) continue;
      if (gain < kContradicted && f.known > kKnownWell) {
        cut_.push_back(&one);
      } else {
        f.known += 0.2 * (gain - f.known);
      }
    }
    if (cut_.empty()) return;
    n_cuts_ += static_cast<std::int64_t>(cut_.size());
    for (Frame::One* one : cut_) {
      const double known = fragments_.at(one->fragment).known - kDoubted;
      one->fragment = fragment_of[one->point] = begin(labels[one->point]);
      fragments_.at(one->fragment).known = known;
    }
    now.sort();
  }
  // Fragments that are seen both then and now.
  void list_common(std::int64_t then) {
    if (common_from_ == then) return;
    common_from_ = then;
    common_.clear();
    list_markers(*frame(then), places_);
    const auto& before = frame(then)->seen;
    auto a = before.begin();
    for (const auto& b : frames_.back().seen) {
      while (a != before.end() && a->fragment < b.fragment) ++a;
      if (a != before.end() && a->fragment == b.fragment)
        common_.push_back({b.fragment, {a->at, b.at, 1}});
    }
  }
  bool weigh_link(const Frame::One& own, std::int64_t when, double& gain) {
    const int D = m_.axis.D;
    if (common_.size() < least_for_rotation(D) + 2) return false;
    const Point then = *frame(when)->find(own.fragment);
    const std::int32_t marker = fragments_.at(own.fragment).marker;
    pair_nearest(own.fragment, then);
    gain = carry(pairs_, then, D, 3 * opt_.noise).log_density(own.at);
    if (marker >= 0 && pair_steadiest(marker) && pairs_.size() == kFitted)
      gain = std::max(gain, carry(pairs_, then, D, 3 * opt_.noise).log_density(own.at));
    gain -= log_elsewhere(own.at, frames_.back(), own.fragment);
    return true;
  }
  void pair_nearest(std::int32_t own, const Point& then) {
    nearest_.clear();
    for (std::int32_t k = 0; k < static_cast<std::int32_t>(common_.size()); ++k)
      if (common_[k].first != own)
        nearest_.emplace_back(squared_distance(common_[k].second.a, then, m_.axis.D), k);
    const std::size_t n = std::min(kFitted, nearest_.size());
    std::partial_sort(nearest_.begin(), nearest_.begin() + static_cast<std::ptrdiff_t>(n),
                      nearest_.end());
    pairs_.clear();
    for (std::size_t k = 0; k < n; ++k) {
      pairs_.push_back(common_[nearest_[k].second].second);
      pairs_.back().weight = 1 / (nearest_[k].first + nearest_.front().first + square(40 * opt_.noise));
    }
  }
  static double square(double x) { return x * x; }

  // How probable a place is for what is no marker come back: anything anywhere, or a ghost beside a
  // marker.
  double log_elsewhere(const Point& y, const Frame& at, std::int32_t own) {
    const int D = m_.axis.D;
    const double radius2 = square(opt_.ghost_radius);
    double beside = 0;
    for (const auto& one : at.seen) {
      const double far = squared_distance(one.at, y, D) / radius2;
      if (one.fragment != own && far < 40) beside += std::exp(-0.5 * far);
    }
    const double n = std::max<double>(static_cast<double>(at.seen.size()), 1);
    return std::log(1 / volume_ +
                    beside / n / std::pow(2 * std::numbers::pi * radius2, 0.5 * D));
  }
  bool is_beside(const Fragment& f, std::int32_t own) {
    std::size_t n = 0, n_beside = 0;
    for (const Sight& sight : f.sights) {
      const Frame* at = frame(sight.frame);
      if (at == nullptr) continue;
      ++n;
      n_beside += std::any_of(at->seen.begin(), at->seen.end(), [&](const auto& other) {
        return other.fragment != own &&
               squared_distance(other.at, sight.at, m_.axis.D) < square(3 * opt_.ghost_radius);
      });
    }
    return 2 * n_beside > n;
  }

  void see(std::int32_t id, const Point& y) {
    grow_box(y);
    Fragment& f = fragments_.at(id);
    if (f.marker >= 0) {
      Marker& marker = markers_.at(f.marker);
      if (marker.is_hidden) {
        marker.is_hidden = false;
        marker.around.clear();
      }
      marker.last = f.last = now_;
      marker.at = y;
      update(m_, Prediction(m_, marker.state), y, marker.state);
      ++f.n;
      return;
    }
    if (f.n == 0) {
      f.state = begin_state(m_, y);
      for (const auto& [k, marker] : markers_)
        if (marker.last < now_ && now_ - marker.last <= kMotionFrames)
          f.continuations.push_back({k, marker.state, 0});
    } else if (f.n < kMotionSights) {
      f.alone += update(m_, Prediction(m_, f.state), y, f.state);
    } else {
      update(m_, Prediction(m_, f.state), y, f.state);
    }
    if (f.n < kMotionSights)
      for (Continuation& c : f.continuations)
        c.log_likelihood += update(m_, Prediction(m_, c.state), y, c.state);
    ++f.n;
    f.last = now_;
    if (static_cast<std::int64_t>(f.sights.size()) < opt_.confirm) f.sights.push_back({now_, y});
  }
  void grow_box(const Point& y) {
    if (!has_box_) low_ = high_ = y;
    has_box_ = true;
    volume_ = 1;
    for (int d = 0; d < m_.axis.D; ++d) {
      low_[d] = std::min(low_[d], y[d]);
      high_[d] = std::max(high_[d], y[d]);
      volume_ *= std::max(high_[d] - low_[d], 100 * opt_.noise);
    }
  }

  // Markers that are not seen any more remember who was around them.
  void hide() {
    for (auto& [k, marker] : markers_)
      if (!marker.is_hidden && marker.last < now_) remember_around(k, marker);
  }
  void remember_around(std::int32_t k, Marker& marker) {
    marker.is_hidden = true;
    marker.around.clear();
    marker.weight.clear();
    const Frame* then = frame(marker.last);
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
  void list_markers(const Frame& at, Places& places) const {
    places.clear();
    for (const auto& one : at.seen)
      if (const auto f = fragments_.find(one.fragment); f != fragments_.end() && f->second.marker >= 0)
        places.set(f->second.marker, one.at);
  }
  void learn() {
    seen_.clear();
    for (const auto& one : frames_.back().seen)
      if (const std::int32_t k = fragments_.at(one.fragment).marker; k >= 0)
        seen_.push_back({k, one.at});
    neighbours_.add(seen_);
    judge();
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
  void judge() {
    const int D = m_.axis.D;
    const Frame* then = frame(now_ - kTrustLag);
    if (then == nullptr) return;
    list_markers(*then, places_);
    list_markers(frames_.back(), places_now_);
    for (const Seen& one : seen_) {
      if ((now_ + one.marker) % kTrustEvery != 0) continue;
      const Point* before = places_.find(one.marker);
      if (before == nullptr) continue;
      if (!pair_steadiest(one.marker)) continue;
      Marker& marker = markers_.at(one.marker);
      const double gain = carry(pairs_, *before, D, 4 * opt_.noise).log_density(one.at) -
                          log_elsewhere(one.at, frames_.back(), marker.fragment);
      marker.trust += 0.2 * (std::clamp(gain, -20.0, 20.0) - marker.trust);
    }
  }

  template <typename Decide>
  void decide_due(bool is_end, Decide&& decide) {
    due_.clear();
    for (const auto& [id, f] : fragments_)
      if (f.marker == Decision::kOpen &&
          (is_end || is_over(f) || (f.last == now_ && now_ - f.first + 1 >= opt_.confirm)))
        due_.push_back(id);
    std::sort(due_.begin(), due_.end(), [&](std::int32_t a, std::int32_t b) {
      return std::pair(fragments_.at(a).first, a) < std::pair(fragments_.at(b).first, b);
    });
    for (const std::int32_t id : due_) decide(decide_upon(id));
  }

  Decision decide_upon(std::int32_t id) {
    Fragment& f = fragments_.at(id);
    Decision out{id};
    double most = -std::numeric_limits<double>::infinity();
    scored_.clear();
    for (const auto& [k, marker] : markers_) {
      const double gain = score(f, id, k, marker);
      most = std::max(most, gain);
      if (gain > 0) scored_.emplace_back(k, gain);
    }
    if (!scored_.empty()) out.marker = best_of(f, id, out.probability);
    if (out.marker == Decision::kOpen) {
      out.marker = is_short(f) && (has_bodies() || is_beside(f, id)) ? Decision::kGhost : n_markers_++;
      out.probability = 1 / (1 + odds(most));
    }
    f.marker = out.marker;
    if (out.marker < 0) return out;
    Marker& marker = markers_[out.marker];
    out.after = marker.fragment;
    marker.fragment = id;
    marker.last = f.last;
    marker.at = f.sights.back().at;
    marker.state = f.state;
    marker.is_hidden = false;
    if (const Frame* last = frame(f.last); last != nullptr) marker.at = *last->find(id);
    if (f.last < now_) remember_around(out.marker, marker);
    f.sights.clear();
    f.continuations.clear();
    return out;
  }

  // Neighbours bend together, and the looks at a fragment see the same bend: what they say is worth
  // less than their sum. How much less was measured on captures whose truth is known.
  static double odds(double gain) { return std::exp(std::min(kWorth * gain, 500.0)); }

  // Which hidden marker it is, if all that is open takes what fits best; and how probably.
  std::int32_t best_of(const Fragment& f, std::int32_t id, double& probability) {
    candidates_.clear();
    rivals_.assign(scored_.size(), 1);  // Σ of the odds of all that may be this marker, and of none
    double all = 1;
    for (std::int32_t c = 0; c < static_cast<std::int32_t>(scored_.size()); ++c) {
      candidates_.push_back({0, c, scored_[c].second, 0});
      all += odds(scored_[c].second);
    }
    std::int32_t row = 0;
    for (const auto& [other, g] : fragments_) {
      if (other == id || g.marker != Decision::kOpen || g.n == 0 || g.last < f.first) continue;
      ++row;
      for (std::int32_t c = 0; c < static_cast<std::int32_t>(scored_.size()); ++c) {
        const double gain = score(g, other, scored_[c].first, markers_.at(scored_[c].first));
        if (!(gain > 0)) continue;
        candidates_.push_back({row, c, gain, 0});
        rivals_[c] += odds(gain);
      }
    }
    match_.assign(row + 1, -1);
    assignment_.solve(candidates_, match_);
    if (match_[0] < 0) return Decision::kOpen;
    const double own = odds(scored_[match_[0]].second);
    probability = own / (all + rivals_[match_[0]] - 1);
    return scored_[match_[0]].first;
  }

  // Log odds that a fragment is a hidden marker come back.
  double score(const Fragment& f, std::int32_t id, std::int32_t k, const Marker& marker) {
    constexpr double never = -std::numeric_limits<double>::infinity();
    if (!marker.is_hidden || marker.last >= f.first) return never;
    const double body = body_score(f, id, marker), motion = motion_score(f, id, k);
    const double at_rest = std::clamp(1 / (1 + std::exp(marker.trust)), kLeastMotion, 0.5);
    const double a = body + std::log1p(-at_rest), b = motion + std::log(at_rest);
    const double more = std::max(a, b), less = std::min(a, b);
    if (more == never) return never;
    return more + std::log1p(std::exp(less - more)) + (is_short(f) ? kShort : kLong);
  }
  double body_score(const Fragment& f, std::int32_t id, const Marker& marker) {
    const int D = m_.axis.D;
    double sum = 0;
    int n = 0;
    const std::size_t every = std::max<std::size_t>(f.sights.size() / kLooks, 1);
    for (std::size_t s = 0; s < f.sights.size(); s += every) {
      const Frame* at = frame(f.sights[s].frame);
      if (at == nullptr) continue;
      list_markers(*at, places_);
      pairs_.clear();
      for (std::size_t r = 0; r < marker.around.size() && pairs_.size() < kFitted; ++r)
        if (const Point* now = places_.find(marker.around[r].marker); now != nullptr)
          pairs_.push_back({marker.around[r].at, *now, marker.weight[r]});
      if (pairs_.empty()) continue;
      sum += carry(pairs_, marker.at, D, 4 * opt_.noise).log_density(f.sights[s].at) -
             log_elsewhere(f.sights[s].at, *at, id);
      ++n;
    }
    return n > 0 ? sum / n : -std::numeric_limits<double>::infinity();
  }
  double motion_score(const Fragment& f, std::int32_t id, std::int32_t k) {
    for (const Continuation& c : f.continuations)
      if (c.marker == k)
        if (const Frame* at = frame(f.first); at != nullptr)
          return c.log_likelihood - f.alone - log_elsewhere(f.sights.front().at, *at, id);
    return -std::numeric_limits<double>::infinity();
  }

  // Fragments that can not go on, and markers that have been hidden for long.
  void forget() {
    for (auto at = fragments_.begin(); at != fragments_.end();) {
      const Fragment& f = at->second;
      const bool is_gone = f.marker != Decision::kOpen &&
                           now_ - f.last > opt_.confirm + 2 * opt_.max_gap + 2;
      if (!is_gone) {
        ++at;
        continue;
      }
      if (const auto of = of_label_.find(f.label); of != of_label_.end() && of->second == at->first)
        of_label_.erase(of);
      at = fragments_.erase(at);
    }
    if (opt_.max_hidden == 0) return;
    for (auto at = markers_.begin(); at != markers_.end();) {
      if (now_ - at->second.last <= opt_.max_hidden) {
        ++at;
        continue;
      }
      neighbours_.forget(at->first);
      at = markers_.erase(at);
    }
  }

  MotionModel m_;
  StitchOptions opt_;
  Neighbours neighbours_;
  std::int64_t now_ = -1;
  std::int32_t n_fragments_ = 0, n_markers_ = 0;
  std::int64_t n_cuts_ = 0;
  std::deque<Frame> frames_;  // the last ones
  std::map<std::int32_t, Fragment> fragments_;
  std::map<std::int32_t, Marker> markers_;
  std::unordered_map<std::int64_t, std::int32_t> of_label_;
  bool has_box_ = false;
  Point low_{}, high_{};
  double volume_ = 1;

  // While a frame is worked on.
  std::int64_t common_from_ = kNever;
  std::vector<std::pair<std::int32_t, RigidPair>> common_;
  std::vector<std::pair<double, std::int32_t>> nearest_;
  std::vector<Frame::One*> cut_;
  std::vector<RigidPair> pairs_;
  Places places_, places_now_;
  std::vector<std::pair<double, std::int32_t>> steady_;
  std::vector<Seen> seen_;
  std::vector<std::int32_t> due_, match_;
  std::vector<std::pair<std::int32_t, double>> scored_;
  std::vector<double> rivals_;
  std::vector<Candidate> candidates_;
  Assignment assignment_;
};

}  // namespace asterism
