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
#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>
#include <span>
#include <tuple>
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
  std::int64_t max_occlusion = 0;   // frames after which an occluded marker is removed; 0: never
  bool may_cut = true;           // cut links that neighbours contradict
};

class Stitcher {
 public:
  Stitcher(const MotionModel& m, const StitchOptions& options)
      : m_(m),
        opt_(options),
        so_far_{{}, {}, {m.axis.D, options.noise, options.ghost_radius}},
        neighbours_(m.axis.D, options.noise) {}

  const MotionModel& motion() const { return m_; }
  std::int32_t n_markers() const { return n_markers_; }
  std::size_t n_remembered() const { return markers_.size(); }
  std::int64_t n_cuts() const { return n_cuts_; }

  // Supplies advice on the tracklets that begin with a label.
  void advise(std::int64_t label, const JoinAdvice& advice) { assignment_.advise(label, advice); }

  // Processes one frame: its points and the tracker's label of each, -1 for none. Writes the
  // tracklet of each point, and calls `decide(decision)`.
  template <typename Decide>
  void step(const MotionStep& step, std::span<const Point> points,
            std::span<const std::int64_t> labels, std::span<std::int32_t> tracklet_of,
            Decide&& decide) {
    so_far_.frames.add(step, static_cast<std::size_t>(opt_.confirm + opt_.max_gap + 2));
    neighbours_.begin_frame(so_far_);
    predict_markers(step);
    add_points(points, labels, tracklet_of);
    cut_links(labels, tracklet_of);
    for (std::size_t i = 0; i < points.size(); ++i)
      if (tracklet_of[i] >= 0) add_detection(tracklet_of[i], points[i]);
    mark_occluded();
    extrapolate();
    learn();
    decide_due(false, decide);
    forget();
  }
  // The marker of a tracklet: kGhost for none, its best candidate while undecided.
  std::int32_t marker_of(std::int32_t tracklet) const {
    const Tracklet& f = so_far_.tracklets.at(tracklet);
    return f.marker == Decision::kOpen ? f.guess : f.marker;
  }
  bool is_open(std::int32_t tracklet) const {
    return so_far_.tracklets.at(tracklet).marker == Decision::kOpen;
  }
  // The tracklet that a detection with this label would continue, -1 if it would begin one, its
  // marker as above, and whether it is undecided.
  struct Continued {
    std::int32_t tracklet = -1, marker = -1;
    bool is_open = false;
  };
  Continued continued_by(std::int64_t label) const {
    const std::int32_t* id = of_label_.find(label);
    const Tracklet* f = id == nullptr ? nullptr : so_far_.tracklets.find(*id);
    if (f == nullptr || !can_continue(*id, *f)) return {};
    const bool is_undecided = f->marker == Decision::kOpen;
    return {*id, is_undecided ? f->guess : f->marker, is_undecided};
  }
  // A marker without a detection in the present frame: frames since its last one, its own motion
  // if that is extrapolated so far, and the position that its neighbours predict.
  struct Unseen {
    std::int32_t marker = 0;
    std::int64_t gap = 0;
    std::optional<MotionState> motion;
    std::optional<Carried> place;
  };
  // Calls use(unseen) for every marker for which is_selected(marker) holds. `present` holds the
  // markers detected in the present frame.
  template <typename Selected, typename Use>
  void each_unseen(const Places& present, Selected&& is_selected, Use&& use) {
    for (const auto& [k, known] : markers_) {
      if (!is_selected(k)) continue;
      Marker marker = known;
      marker.is_occluded = true;
      prepare(k, marker);
      Unseen out{k, now() - marker.last, std::nullopt, std::nullopt};
      if (out.gap <= kMotionFrames) out.motion = *marker.state;
      out.place = neighbours_.place(k, *marker.anchors, present);
      use(out);
    }
  }
  // Computes the best candidates of all undecided tracklets, as if no further frame came.
  void guess() {
    for (const auto& [id, f] : so_far_.tracklets)
      if (f.marker == Decision::kOpen && f.last == now()) {
        prepare_all();
        break;
      }
    assignment_.guess(so_far_, markers_, neighbours_,
                      [this](const Tracklet& f) { return is_short(f); });
  }
  // Decides the remaining tracklets after the last frame.
  template <typename Decide>
  void finish(Decide&& decide) {
    decide_due(true, decide);
  }

 private:
  static constexpr std::int32_t kMotionDetections = 4;  // over which motions are compared
  static constexpr std::int64_t kMotionFrames = 120;  // longest extrapolation of a motion
  // A link is cut if its log-likelihood ratio is at most the first value, and below the tracklet's
  // average by the second. The new tracklet starts with an average lowered by the third.
  static constexpr double kContradicted = 3, kFall = 8, kCutPenalty = 3;
  // Mean over the markers above which rigid prediction is considered reliable.
  static constexpr double kReliable = 2;

  std::int64_t now() const { return so_far_.frames.now(); }
  bool is_over(const Tracklet& f) const { return now() - f.last > opt_.max_gap; }
  bool is_brief(const Tracklet& f) const { return f.last - f.first + 1 < opt_.confirm; }
  bool is_short(const Tracklet& f) const { return is_over(f) && is_brief(f); }

  void predict_markers(const MotionStep& step) {
    for (auto& [id, marker] : markers_)
      if (marker.is_prepared() && now() - marker.last <= kMotionFrames)
        predict(m_, step, marker.state.own());
  }

  void add_points(std::span<const Point> points, std::span<const std::int64_t> labels,
               std::span<std::int32_t> tracklet_of) {
    for (std::size_t i = 0; i < points.size(); ++i) {
      tracklet_of[i] = labels[i] < 0 ? -1 : continued_by(labels[i]).tracklet;
      if (labels[i] >= 0 && tracklet_of[i] < 0) tracklet_of[i] = begin(labels[i]);
    }
    for (std::size_t i = 0; i < points.size(); ++i)
      if (tracklet_of[i] >= 0)
        so_far_.frames.newest().seen.push_back(
            {tracklet_of[i], points[i], static_cast<std::int32_t>(i)});
    so_far_.frames.newest().sort();
  }
  // A tracklet cannot continue if it is over, or if its marker was found in another tracklet.
  bool can_continue(std::int32_t id, const Tracklet& f) const {
    if (is_over(f)) return false;
    if (f.marker < 0) return f.marker == Decision::kOpen;
    const Marker* marker = markers_.find(f.marker);
    return marker != nullptr && marker->tracklet == id;
  }
  std::int32_t begin(std::int64_t label) {
    const std::int32_t id = n_tracklets_++;
    Tracklet& f = so_far_.tracklets[id];
    f.label = label;
    f.link_gain = usual_gain_;
    f.first = f.last = now();
    f.open = SharedCopy<Comparison>(Comparison{});
    of_label_[label] = id;
    return id;
  }

  bool may_be_ghost_of_another(const Tracklet& f, std::int32_t own) const {
    std::size_t n = 0, n_near = 0;
    for (const TrackletPoint& detection : f.open->detections)
      if (const Frame* at = so_far_.frames.find(detection.frame); at != nullptr) {
        ++n;
        n_near += so_far_.background.is_near_another(detection.at, *at, own);
      }
    return 2 * n_near > n;
  }

  // Whether neighbours predict the detected markers well on average.
  bool is_rigid() const {
    double sum = 0;
    std::size_t n = 0;
    for (const auto& [k, marker] : markers_)
      if (!marker.is_occluded) {
        sum += marker.mean_gain;
        ++n;
      }
    return n > 0 && sum > kReliable * static_cast<double>(n);
  }

  // Cuts the links into the newest frame that neighbours contradict.
  void cut_links(std::span<const std::int64_t> labels, std::span<std::int32_t> tracklet_of) {
    Frame& now = so_far_.frames.newest();
    w_.cut.clear();
    w_.links.clear();
    for_each_known(now.seen, &Frame::One::tracklet, so_far_.tracklets,
                   [&](Frame::One& one, Tracklet& f) {
      if (f.n > 0 && so_far_.frames.find(f.last) != nullptr)
        w_.links.push_back({&one, &f, std::min(kContradicted, f.link_gain - kFall)});
    });
    neighbours_.rate(so_far_, w_.links);
    for (const auto& [one, f, min_gain, gain] : w_.links)
      if (opt_.may_cut && gain < min_gain) {
        w_.cut.push_back(one);
      } else {
        f->link_gain += 0.2 * (gain - f->link_gain);
        usual_gain_ += 0.01 * (gain - usual_gain_);
      }
    if (w_.cut.empty()) return;
    n_cuts_ += static_cast<std::int64_t>(w_.cut.size());
    for (Frame::One* one : w_.cut) {
      const double link_gain = so_far_.tracklets.at(one->tracklet).link_gain - kCutPenalty;
      one->tracklet = tracklet_of[one->point] = begin(labels[one->point]);
      so_far_.tracklets.at(one->tracklet).link_gain = link_gain;
    }
    now.sort();
    neighbours_.forget_places();
  }
  void add_detection(std::int32_t id, const Point& y) {
    so_far_.background.add(y);
    Tracklet& f = so_far_.tracklets.at(id);
    if (f.marker >= 0) {
      Marker& marker = markers_.at(f.marker);
      marker.is_occluded = false;
      marker.release();
      marker.last = f.last = now();
      ++f.n;
      return;
    }
    if (f.marker == Decision::kOpen) compare(id, f, y);
    ++f.n;
    f.last = now();
  }
  // Updates the motions under which an undecided tracklet may have reached a detection. They are
  // predicted only now, because most false alarms have no second detection.
  void compare(std::int32_t id, Tracklet& f, const Point& y) {
    Comparison& open = f.open.own();
    if (f.n == 0) open.state = begin_state(m_, y);
    if (f.n > 0 && f.n < kMotionDetections) {
      const auto next = [&](MotionState& state) {
        for (std::int64_t t = f.last + 1; t <= now(); ++t)
          predict(m_, so_far_.frames.find(t)->step, state);
        return update(m_, Prediction(m_, state), y, state);
      };
      open.alone += next(open.state);
      for (Continuation& c : open.continuations) c.log_likelihood += next(c.state);
    }
    if (static_cast<std::int64_t>(open.detections.size()) < opt_.confirm)
      open.detections.push_back(
          {now(), y, neighbours_.peaks(so_far_, *so_far_.frames.newest().one(id))});
  }
  void mark_occluded() {
    for (auto& [k, marker] : markers_) {
      if (marker.last < now()) marker.is_occluded = true;
      // Its last frames are removed soon.
      if (now() - marker.last > opt_.max_gap) prepare(k, marker);
    }
  }
  // Stores the motion and the neighbours of each occluded marker.
  void prepare_all() {
    for (auto& [k, marker] : markers_) prepare(k, marker);
  }
  void prepare(std::int32_t k, Marker& marker) {
    if (!marker.is_occluded || marker.is_prepared()) return;
    neighbours_.remember_around(so_far_, k, marker);
    marker.state = SharedCopy<MotionState>(so_far_.frames.motion(m_, marker.tracklet));
  }
  // Extrapolates every occluded marker's motion to the tracklets that begin in this frame.
  void extrapolate() {
    for_each_known(so_far_.frames.newest().seen, &Frame::One::tracklet, so_far_.tracklets,
                   [&](const Frame::One& one, Tracklet& f) {
      if (f.n != 1 || f.marker != Decision::kOpen) return;
      prepare_all();
      std::vector<Continuation>& all = f.open.own().continuations;
      for (const auto& [k, marker] : markers_) {
        if (!marker.is_occluded || now() - marker.last > kMotionFrames) continue;
        Continuation& c = all.emplace_back(Continuation{k, *marker.state, 0});
        c.log_likelihood = update(m_, Prediction(m_, c.state), one.at, c.state);
      }
    });
  }
  void learn() {
    w_.seen.clear();
    for_each_known(so_far_.frames.newest().seen, &Frame::One::tracklet, so_far_.tracklets,
                   [&](const Frame::One& one, const Tracklet& f) {
      if (f.marker >= 0) w_.seen.push_back({f.marker, one.at});
    });
    neighbours_.learn(so_far_, w_.seen, markers_);
  }
  template <typename Decide>
  void decide_due(bool is_end, Decide&& decide) {
    w_.due.clear();
    for (const auto& [id, f] : so_far_.tracklets)
      if (f.marker == Decision::kOpen &&
          (is_end || is_over(f) || (f.last == now() && now() - f.first + 1 >= opt_.confirm)))
        w_.due.push_back(id);
    std::ranges::sort(w_.due, {}, [&](std::int32_t id) {
      return std::pair(so_far_.tracklets.at(id).first, id);
    });
    for (const std::int32_t id : w_.due) decide(decide_upon(id));
  }

  Decision decide_upon(std::int32_t id) {
    Tracklet& f = so_far_.tracklets.at(id);
    Decision out{id};
    prepare_all();
    std::tie(out.marker, out.probability) = assignment_.best(
        so_far_, markers_, neighbours_, id, [this](const Tracklet& g) { return is_short(g); });
    if (out.marker == Decision::kOpen) {
      // A tracklet that begins just before the end of the capture is short for that reason alone.
      const bool is_late = is_brief(f) && f.first >= opt_.confirm;
      const bool may_be_ghost =
          (is_short(f) || is_late) && (is_rigid() || may_be_ghost_of_another(f, id));
      out.marker = may_be_ghost ? Decision::kGhost : n_markers_++;
    }
    f.marker = out.marker;
    f.open = {};
    if (out.marker < 0) return out;
    Marker& marker = markers_[out.marker];
    out.after = marker.tracklet;
    marker.tracklet = id;
    marker.label = f.label;
    marker.last = f.last;
    marker.is_occluded = f.last < now();
    marker.release();
    neighbours_.add_places(so_far_, id, out.marker, markers_);
    return out;
  }

  // Removes tracklets that cannot continue, and markers occluded for long.
  void forget() {
    so_far_.tracklets.erase_if([&](const auto& entry) {
      const auto& [id, f] = entry;
      const bool is_gone = f.marker != Decision::kOpen &&
                           now() - f.last > opt_.confirm + 2 * opt_.max_gap + 2;
      if (!is_gone) return false;
      if (const std::int32_t* of = of_label_.find(f.label); of != nullptr && *of == id)
        of_label_.erase(f.label);
      return true;
    });
    if (opt_.max_occlusion == 0) return;
    markers_.erase_if([&](const auto& entry) {
      if (now() - entry.second.last <= opt_.max_occlusion) return false;
      neighbours_.forget(entry.first);
      return true;
    });
  }

  struct Memory {
    std::vector<RigidNeighbours::Link> links;
    std::vector<Frame::One*> cut;
    std::vector<MarkerPoint> seen;
    std::vector<std::int32_t> due;
  };

  MotionModel m_;
  StitchOptions opt_;
  std::int32_t n_tracklets_ = 0, n_markers_ = 0;
  std::int64_t n_cuts_ = 0;
  double usual_gain_ = 0;  // mean log-likelihood ratio of a link by neighbours
  StitchMemory so_far_;
  Markers markers_;
  FlatMap<std::int64_t, std::int32_t> of_label_;
  RigidNeighbours neighbours_;
  TrackletAssignment assignment_;
  Scratch<Memory> w_;  // scratch of one frame
};

}  // namespace asterism
