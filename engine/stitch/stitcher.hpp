// Stitches tracklets into the tracks of markers, across gaps of any length.
//
// A tracker that terminates tracks early produces pure tracklets, and a reappearing marker begins a
// new one. The stitcher decides on a tracklet when it is long enough or over. It compares the
// tracklet with every occluded marker by two log-likelihood ratios:
//
//   body    rigid neighbours predict the occluded marker from their own motion
//   motion  the marker's own filter is extrapolated through the gap
//
// The alternative hypothesis is a new marker anywhere or a ghost beside a marker. Tracklets
// detected at the same time compete for the occluded markers in an assignment. A tracklet without a
// match is a new marker, or a ghost if it was short and beside another marker.
//
// A link inside a tracklet is tested by its neighbours too, and is cut if they contradict it.
//
// The result of a pass through the capture in the other direction may be supplied as advice.
// Whoever has gone through the take in the other direction may advise.
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <tuple>
#include <unordered_map>
#include <utility>
#include <vector>

#include "base/scratch.hpp"
#include "filter/imm.hpp"
#include "rigid/tracklets.hpp"
#include "stitch/background_density.hpp"
#include "stitch/rigid_neighbours.hpp"
#include "stitch/tracklet_assignment.hpp"

namespace asterism {

struct StitchOptions {
  double noise = 0;         // of a detection, along an axis
  double ghost_radius = 0;  // scale of the distance of a ghost from its marker
  std::int64_t confirm = 15;     // frames until a tracklet is decided
  std::int64_t max_gap = 0;      // missed frames after which a tracklet is over
  std::int64_t max_hidden = 0;   // frames after which an occluded marker is removed; 0: never
  bool may_cut = true;           // cut links that neighbours contradict
};

class Stitcher {
 public:
  Stitcher(const MotionModel& m, const StitchOptions& options)
      : m_(m),
        opt_(options),
        so_far_{{}, {}, {m.axis.D, options.noise, options.ghost_radius}},
        bodies_(m.axis.D, options.noise) {}

  const MotionModel& motion() const { return m_; }
  std::int32_t n_markers() const { return n_markers_; }
  std::size_t n_remembered() const { return markers_.size(); }
  std::int64_t n_cuts() const { return n_cuts_; }

  // Supplies advice on the tracklets that begin with a label.
  void advise(std::int64_t label, const JoinAdvice& advice) { claims_.advise(label, advice); }

  // Processes one frame: its points and the tracker's label of each, -1 for none. Writes the
  // tracklet of each point, and calls `decide(decision)`.
  template <typename Decide>
  void step(const MotionStep& step, std::span<const Point> points,
            std::span<const std::int64_t> labels, std::span<std::int32_t> fragment_of,
            Decide&& decide) {
    so_far_.frames.add(step, static_cast<std::size_t>(opt_.confirm + opt_.max_gap + 2));
    move_on(step);
    take_in(points, labels, fragment_of);
    cut_links(labels, fragment_of);
    for (std::size_t i = 0; i < points.size(); ++i)
      if (fragment_of[i] >= 0) see(fragment_of[i], points[i]);
    hide();
    go_on();
    learn();
    decide_due(false, decide);
    forget();
  }
  // The marker of a tracklet: kGhost for none, its best candidate while undecided.
  std::int32_t marker_of(std::int32_t fragment) const {
    const Fragment& f = so_far_.fragments.at(fragment);
    return f.marker == Decision::kOpen ? f.guess : f.marker;
  }
  bool is_open(std::int32_t fragment) const {
    return so_far_.fragments.at(fragment).marker == Decision::kOpen;
  }
  // The tracklet that a detection with this label would continue, -1 if it would begin one.
  std::int32_t fragment_with(std::int64_t label) const {
    const auto at = of_label_.find(label);
    return at != of_label_.end() && may_go_on(at->second) ? at->second : -1;
  }
  // Computes the best candidates of all undecided tracklets, as if no further frame came.
  void guess() {
    claims_.guess(so_far_, markers_, bodies_, [this](const Fragment& f) { return is_short(f); });
  }
  // Decides the remaining tracklets after the last frame.
  template <typename Decide>
  void finish(Decide&& decide) {
    decide_due(true, decide);
  }

 private:
  static constexpr std::int32_t kMotionSights = 4;   // detections over which motions are compared
  static constexpr std::int64_t kMotionFrames = 120;  // longest extrapolation of a motion
  // A link is cut if its log-likelihood ratio is at most the first value, and below the tracklet's
  // average by the second. The new tracklet starts with an average lowered by the third.
  static constexpr double kContradicted = 3, kFall = 8, kDoubted = 3;
  // mean over the markers above which rigid prediction is considered reliable
  static constexpr double kTrusted = 2;

  std::int64_t now() const { return so_far_.frames.now(); }
  bool is_over(const Fragment& f) const { return now() - f.last > opt_.max_gap; }
  bool is_brief(const Fragment& f) const { return f.last - f.first + 1 < opt_.confirm; }
  bool is_short(const Fragment& f) const { return is_over(f) && is_brief(f); }

  void move_on(const MotionStep& step) {
    for (auto& [id, f] : so_far_.fragments) {
      if (f.marker != Decision::kOpen || f.n >= kMotionSights) continue;
      predict(m_, step, f.state);
      for (Continuation& c : f.continuations) predict(m_, step, c.state);
    }
    for (auto& [id, marker] : markers_)
      if (marker.is_hidden && now() - marker.last <= kMotionFrames) predict(m_, step, marker.state);
  }

  void take_in(std::span<const Point> points, std::span<const std::int64_t> labels,
               std::span<std::int32_t> fragment_of) {
    for (std::size_t i = 0; i < points.size(); ++i) {
      fragment_of[i] = labels[i] < 0 ? -1 : fragment_with(labels[i]);
      if (labels[i] >= 0 && fragment_of[i] < 0) fragment_of[i] = begin(labels[i]);
    }
    for (std::size_t i = 0; i < points.size(); ++i)
      if (fragment_of[i] >= 0)
        so_far_.frames.newest().seen.push_back({fragment_of[i], points[i], static_cast<std::int32_t>(i)});
    so_far_.frames.newest().sort();
  }
  // A tracklet cannot continue if it is over, or if its marker was found in another tracklet.
  bool may_go_on(std::int32_t id) const {
    const auto at = so_far_.fragments.find(id);
    if (at == so_far_.fragments.end() || is_over(at->second)) return false;
    if (at->second.marker < 0) return at->second.marker == Decision::kOpen;
    const auto marker = markers_.find(at->second.marker);
    return marker != markers_.end() && marker->second.fragment == id;
  }
  std::int32_t begin(std::int64_t label) {
    const std::int32_t id = n_fragments_++;
    Fragment& f = so_far_.fragments[id];
    f.label = label;
    f.known = usual_;
    f.first = f.last = now();
    of_label_[label] = id;
    return id;
  }

  bool is_beside(const Fragment& f, std::int32_t own) const {
    std::size_t n = 0, n_beside = 0;
    for (const FragmentPoint& sight : f.sights)
      if (const Frame* at = so_far_.frames.find(sight.frame); at != nullptr) {
        ++n;
        n_beside += so_far_.elsewhere.is_beside(sight.at, *at, own);
      }
    return 2 * n_beside > n;
  }

  // Whether neighbours predict the detected markers well on average.
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

  // Cuts the links into the newest frame that neighbours contradict.
  void cut_links(std::span<const std::int64_t> labels, std::span<std::int32_t> fragment_of) {
    Frame& now = so_far_.frames.newest();
    w_.cut.clear();
    bodies_.begin_links(so_far_);
    for (Frame::One& one : now.seen) {
      Fragment& f = so_far_.fragments.at(one.fragment);
      if (f.n == 0 || so_far_.frames.find(f.last) == nullptr) continue;
      const double least = std::min(kContradicted, f.known - kFall);
      double gain = 0;
      if (!bodies_.link(so_far_, one, f, f.known, gain)) continue;
      if (opt_.may_cut && gain < least) {
        w_.cut.push_back(&one);
      } else {
        f.known += 0.2 * (gain - f.known);
        usual_ += 0.01 * (gain - usual_);
      }
    }
    if (w_.cut.empty()) return;
    n_cuts_ += static_cast<std::int64_t>(w_.cut.size());
    for (Frame::One* one : w_.cut) {
      const double known = so_far_.fragments.at(one->fragment).known - kDoubted;
      one->fragment = fragment_of[one->point] = begin(labels[one->point]);
      so_far_.fragments.at(one->fragment).known = known;
    }
    now.sort();
  }
  void see(std::int32_t id, const Point& y) {
    so_far_.elsewhere.add(y);
    Fragment& f = so_far_.fragments.at(id);
    if (f.marker >= 0) {
      Marker& marker = markers_.at(f.marker);
      if (marker.is_hidden) {
        marker.is_hidden = false;
        marker.anchors.clear();
      }
      marker.last = f.last = now();
      ++f.n;
      return;
    }
    if (f.n == 0) {
      f.state = begin_state(m_, y);
    } else if (f.n < kMotionSights) {
      f.alone += update(m_, Prediction(m_, f.state), y, f.state);
      for (Continuation& c : f.continuations)
        c.log_likelihood += update(m_, Prediction(m_, c.state), y, c.state);
    }
    ++f.n;
    f.last = now();
    if (static_cast<std::int64_t>(f.sights.size()) < opt_.confirm) f.sights.push_back({now(), y});
  }
  // Stores the motion and the neighbours of each marker that became occluded.
  void hide() {
    for (auto& [k, marker] : markers_)
      if (!marker.is_hidden && marker.last < now()) hide(k, marker);
  }
  void hide(std::int32_t k, Marker& marker) {
    bodies_.remember_around(so_far_, k, marker);
    marker.state = so_far_.frames.motion(m_, marker.fragment);
  }
  // Extrapolates every occluded marker's motion to the tracklets that begin in this frame.
  void go_on() {
    for (const auto& one : so_far_.frames.newest().seen) {
      Fragment& f = so_far_.fragments.at(one.fragment);
      if (f.n != 1 || f.marker != Decision::kOpen) continue;
      for (const auto& [k, marker] : markers_) {
        if (!marker.is_hidden || now() - marker.last > kMotionFrames) continue;
        Continuation& c = f.continuations.emplace_back(Continuation{k, marker.state, 0});
        c.log_likelihood = update(m_, Prediction(m_, c.state), one.at, c.state);
      }
    }
  }
  void learn() {
    w_.seen.clear();
    for (const auto& one : so_far_.frames.newest().seen)
      if (const std::int32_t k = so_far_.fragments.at(one.fragment).marker; k >= 0)
        w_.seen.push_back({k, one.at});
    bodies_.learn(so_far_, w_.seen, markers_);
  }
  template <typename Decide>
  void decide_due(bool is_end, Decide&& decide) {
    w_.due.clear();
    for (const auto& [id, f] : so_far_.fragments)
      if (f.marker == Decision::kOpen &&
          (is_end || is_over(f) || (f.last == now() && now() - f.first + 1 >= opt_.confirm)))
        w_.due.push_back(id);
    std::sort(w_.due.begin(), w_.due.end(), [&](std::int32_t a, std::int32_t b) {
      return std::pair(so_far_.fragments.at(a).first, a) < std::pair(so_far_.fragments.at(b).first, b);
    });
    for (const std::int32_t id : w_.due) decide(decide_upon(id));
  }

  Decision decide_upon(std::int32_t id) {
    Fragment& f = so_far_.fragments.at(id);
    Decision out{id};
    std::tie(out.marker, out.probability) = claims_.best(
        so_far_, markers_, bodies_, id, [this](const Fragment& g) { return is_short(g); });
    if (out.marker == Decision::kOpen) {
      // A tracklet that begins just before the end of the capture is short for that reason alone.
      const bool is_late = is_brief(f) && f.first >= opt_.confirm;
      const bool may_be_ghost = (is_short(f) || is_late) && (has_bodies() || is_beside(f, id));
      out.marker = may_be_ghost ? Decision::kGhost : n_markers_++;
    }
    f.marker = out.marker;
    if (out.marker < 0) return out;
    Marker& marker = markers_[out.marker];
    out.after = marker.fragment;
    marker.fragment = id;
    marker.label = f.label;
    marker.last = f.last;
    marker.is_hidden = false;
    if (f.last < now()) hide(out.marker, marker);
    f.sights.clear();
    f.continuations.clear();
    return out;
  }

  // Removes tracklets that cannot continue, and markers occluded for long.
  void forget() {
    for (auto at = so_far_.fragments.begin(); at != so_far_.fragments.end();) {
      const Fragment& f = at->second;
      const bool is_gone = f.marker != Decision::kOpen &&
                           now() - f.last > opt_.confirm + 2 * opt_.max_gap + 2;
      if (!is_gone) {
        ++at;
        continue;
      }
      if (const auto of = of_label_.find(f.label); of != of_label_.end() && of->second == at->first)
        of_label_.erase(of);
      at = so_far_.fragments.erase(at);
    }
    if (opt_.max_hidden == 0) return;
    for (auto at = markers_.begin(); at != markers_.end();) {
      if (now() - at->second.last <= opt_.max_hidden) {
        ++at;
        continue;
      }
      bodies_.forget(at->first);
      at = markers_.erase(at);
    }
  }

  struct Memory {
    std::vector<Frame::One*> cut;
    std::vector<Seen> seen;
    std::vector<std::int32_t> due;
  };

  MotionModel m_;
  StitchOptions opt_;
  std::int32_t n_fragments_ = 0, n_markers_ = 0;
  std::int64_t n_cuts_ = 0;
  double usual_ = 0;  // mean log-likelihood ratio of a link by neighbours
  Sightings so_far_;
  Markers markers_;
  std::unordered_map<std::int64_t, std::int32_t> of_label_;
  Bodies bodies_;
  Claims claims_;
  Fresh<Memory> w_;  // scratch of one frame
};

}  // namespace asterism
