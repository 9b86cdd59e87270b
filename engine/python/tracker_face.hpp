// The interface of every tracker to Python: one frame or many in place, a copy, the tracks.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <optional>
#include <type_traits>
#include <utility>
#include <vector>

#include "python/motion_arrays.hpp"
#include "python/stitched.hpp"
#include "rigid/carried_state.hpp"
#include "tracks/live_tracks.hpp"

namespace asterism {

using namespace nb::literals;

using Labels = nb::ndarray<std::int64_t, nb::numpy, nb::c_contig, nb::device::cpu>;
using Confidence = nb::ndarray<double, nb::numpy, nb::c_contig, nb::device::cpu>;
// Receives a detection, the id of its track or -1, and the confidence. One type for all callers, so
// that a tracker is compiled once.
using Labeller = std::function<void(std::int64_t, std::int64_t, double)>;

// Writes into arrays that cover every detection since the state began. `confidence` is written if
// the tracker provides it.
template <typename Tracker>
Labeller labeller(const Tracker& tracker, Labels labels, Confidence confidence, std::int64_t n_seen) {
  const bool has_confidence = tracker.has_confidence();
  require(static_cast<std::int64_t>(labels.size()) >= n_seen,
          "labels: one for every detection so far");
  require(!has_confidence || static_cast<std::int64_t>(confidence.size()) >= n_seen,
          "confidence: one for every detection so far");
  return [=, to = labels.data(), sure = confidence.data()](std::int64_t detection, std::int64_t id,
                                                           double p) {
    to[detection] = id;
    if (has_confidence) sure[detection] = p;
  };
}

// Processes a frame and returns its decisions: labels and confidence, earlier detections whose label
// changes with their labels and confidence, and counts. A confidence that the tracker does not provide
// is None. With a stitcher, labels are markers, which have no confidence; `before` is the stitcher that
// it is a copy of.
template <typename Tracker>
nb::tuple step(Tracker& tracker, double time, const In<double>& F, const In<double>& Q,
               const In<double>& points, LiveStitcher* stitcher, const LiveStitcher* before) {
  std::vector<Point> frame = to_points(points, tracker.motion().axis.D);
  const MotionStep motion = motion_step(tracker.motion(), F, Q);
  std::vector<Decided> now(frame.size()), revised;
  const std::int64_t first = tracker.so_far().n_seen;
  require(stitcher == nullptr || (stitcher->n_seen() == first && before != nullptr &&
                                  before->n_seen() == first),
          "stitcher and before: of the same detections");
  const Labeller label = [&](std::int64_t detection, std::int64_t id, double p) {
    if (detection < first)
      revised.push_back({detection, id, p});
    else
      now[detection - first] = {detection, id, p};
  };
  std::decay_t<decltype(tracker.total())> stats;
  {
    nb::gil_scoped_release release;
    stats = tracker.step(time, motion, frame, label);
    if (stitcher != nullptr) {
      for (Point& y : frame) y.r = 0;  // the stitcher knows no noise but the sensor's
      stitch(*stitcher, *before, motion, frame, now, revised);
    }
  }
  const auto ids = [](const auto& all) { return nb::cast(array_of<std::int64_t>(all, &Decided::id)); };
  const auto sure = [&](const std::vector<Decided>& all) -> nb::object {
    if (stitcher != nullptr || !tracker.has_confidence()) return nb::none();
    return nb::cast(array_of<double>(all, &Decided::confidence));
  };
  return nb::make_tuple(ids(now), sure(now),
                        nb::cast(array_of<std::int64_t>(revised, &Decided::detection)),
                        ids(revised), sure(revised), std::move(stats));
}

// Processes many frames in place.
template <typename Tracker>
void run(Tracker& tracker, const In<double>& times, const In<std::int32_t>& kind,
         const In<double>& F, const In<double>& Q, const In<std::int64_t>& offsets,
         const In<double>& points, Labels labels, Confidence confidence) {
  const FrameRun frames(tracker.motion(), times, kind, F, Q, offsets, points);
  const Labeller label =
      labeller(tracker, labels, confidence, tracker.so_far().n_seen + frames.n_points());
  frames.each([&](std::size_t t, std::size_t, std::span<const Point> frame) {
    if constexpr (requires { tracker.end_pass(label); })
      tracker.pass(frames.line.times[t], frames.line.step(t), frame, label);
    else
      tracker.step(frames.line.times[t], frames.line.step(t), frame, label);
  });
  if constexpr (requires { tracker.end_pass(label); }) {
    nb::gil_scoped_release release;
    tracker.end_pass(label);
  }
}

template <typename More>
std::vector<const LiveTrack<More>*> confirmed(const LiveTracks<More>& live) {
  std::vector<const LiveTrack<More>*> out;
  for (const LiveTrack<More>& track : live.tracks)
    if (track.is_confirmed()) out.push_back(&track);
  return out;
}

// The present state of a track. While its marker is occluded, the position that neighbours predict is
// used as in association.
template <typename More>
AxisState present_state(const MotionModel& m, const LiveTrack<More>& track) {
  const std::optional<MotionState> fused =
      std::isfinite(track.place.variance)
          ? fuse(m, track.state, Prediction(m, track.state), track.place)
          : std::nullopt;
  return collapse(m, fused ? *fused : track.state);
}

// The states of the confirmed tracks, or of the markers of a stitcher (see TrackArrays).
template <typename Tracker>
nb::tuple tracks(const Tracker& tracker, LiveStitcher* stitcher) {
  const auto& live = tracker.live();
  std::vector<TrackNow> found;
  for (const auto* track : confirmed(live))
    found.push_back({track->id, track->gap, track->score, present_state(tracker.motion(), *track)});
  if (stitcher != nullptr) return marker_states(*stitcher, found);
  TrackArrays out(tracker.motion(), found.size());
  for (const TrackNow& one : found) out.add(one.id, one.gap, one.log_odds, one.state);
  return out.give();
}

template <typename Tracker>
nb::class_<Tracker> bind_tracker(nb::module_& module, const char* name) {
  return nb::class_<Tracker>(module, name)
      .def("step", &step<Tracker>, "time"_a, "F"_a, "Q"_a, "points"_a,
           "stitcher"_a.none() = nb::none(), "before"_a.none() = nb::none())
      .def("run", &run<Tracker>, "times"_a, "kind"_a, "F"_a, "Q"_a, "offsets"_a, "points"_a,
           "labels"_a.noconvert(), "confidence"_a.noconvert())
      .def("copy", [](const Tracker& self) { return Tracker(self); })
      .def("tracks", &tracks<Tracker>, "stitcher"_a.none() = nb::none())
      .def_prop_ro("has_confidence", &Tracker::has_confidence)
      .def_prop_ro("n_frames", [](const Tracker& self) { return self.so_far().n_frames; })
      .def_prop_ro("n_seen", [](const Tracker& self) { return self.so_far().n_seen; })
      .def_prop_ro("n_ids", [](const Tracker& self) { return self.n_ids(); })
      .def_prop_ro("last_time", [](const Tracker& self) { return self.so_far().last_time; })
      .def_prop_ro("total", [](const Tracker& self) { return self.total(); });
}

}  // namespace asterism
