// The face that every tracker shows to Python: one frame on a copy, many frames in place, the tracks.
#pragma once

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <functional>
#include <span>
#include <type_traits>
#include <utility>
#include <vector>

#include "python/motion_arrays.hpp"
#include "tracks/live_tracks.hpp"

namespace asterism {

using namespace nb::literals;

using Labels = nb::ndarray<std::int64_t, nb::numpy, nb::c_contig, nb::device::cpu>;
using Confidence = nb::ndarray<double, nb::numpy, nb::c_contig, nb::device::cpu>;
// Takes a detection, its track's id or -1, and how sure that is. One type for all callers, so that a
// tracker is compiled once.
using Labeller = std::function<void(std::int64_t, std::int64_t, double)>;

// What one frame, taken on a copy of the tracker, decided. Without confidence its arrays are empty.
struct StepResult {
  nb::object tracker;  // the copy, after the frame
  nb::object labels, confidence;
  nb::object revised, revised_labels, revised_confidence;  // earlier detections whose label changes
  nb::object stats;
};

template <typename Tracker>
StepResult step(const Tracker& before, double time, const In<double>& F, const In<double>& Q,
               const In<double>& points) {
  const MotionModel& m = before.motion();
  const std::size_t size = static_cast<std::size_t>(m.M) * m.axis.n * m.axis.n;
  require(F.size() == size && Q.size() == size, "F and Q: shape (modes, n, n)");
  Tracker after(before);
  const std::vector<Point> frame = to_points(points, m.axis.D);
  const MotionStep motion = motion_step(m, F.data(), Q.data());
  const std::size_t n = frame.size(), n_sure = before.has_confidence() ? n : 0;
  Owned<std::int64_t> labels(n);
  Owned<double> confidence(n_sure);
  std::fill_n(labels.data.get(), n, -1);
  struct Revision {
    std::int64_t detection, id;
    double confidence;
  };
  std::vector<Revision> revised;
  const std::int64_t first = before.n_seen();
  const Labeller label = [&](std::int64_t detection, std::int64_t id, double p) {
    if (detection < first) {
      revised.push_back({detection, id, p});
      return;
    }
    labels.data[detection - first] = id;
    if (n_sure > 0) confidence.data[detection - first] = p;
  };
  std::decay_t<decltype(before.total())> stats;
  {
    nb::gil_scoped_release release;
    stats = after.step(time, motion, frame, label);
  }
  const std::size_t r = revised.size(), r_sure = before.has_confidence() ? r : 0;
  Owned<std::int64_t> which(r), ids(r);
  Owned<double> sure(r_sure);
  for (std::size_t i = 0; i < r; ++i) {
    which.data[i] = revised[i].detection;
    ids.data[i] = revised[i].id;
    if (r_sure > 0) sure.data[i] = revised[i].confidence;
  }
  return {nb::cast(std::move(after)), nb::cast(labels.give({n})),
          nb::cast(confidence.give({n_sure})), nb::cast(which.give({r})),
          nb::cast(ids.give({r})), nb::cast(sure.give({r_sure})), nb::cast(std::move(stats))};
}

// So often a run asks whether it is to end.
inline constexpr std::chrono::milliseconds kLookEvery{50};

// Many frames in place. `labels` covers every detection since the state began; so does `confidence`
// where the tracker has any.
template <typename Tracker>
void run(Tracker& tracker, const In<double>& times, const In<std::int32_t>& kind,
         const In<double>& F, const In<double>& Q, const In<std::int64_t>& offsets,
         const In<double>& points, Labels labels, Confidence confidence) {
  const MotionModel& m = tracker.motion();
  const Timeline line = timeline(m, times, kind, F, Q);
  const std::vector<Point> all = to_points(points, m.axis.D);
  const std::size_t T = line.times.size();
  require(offsets.ndim() == 1 && offsets.shape(0) == T + 1, "offsets: shape (T + 1,)");
  require(T == 0 || line.kind[0] >= 0, "kind: an index into F");
  for (std::size_t t = 0; t <= T; ++t)
    require(offsets.data()[t] >= 0 && offsets.data()[t] <= static_cast<std::int64_t>(all.size()) &&
                (t == 0 || offsets.data()[t] >= offsets.data()[t - 1]),
            "offsets: rising, within the points");
  const std::int64_t n_seen =
      tracker.n_seen() + (T == 0 ? 0 : offsets.data()[T] - offsets.data()[0]);
  require(static_cast<std::int64_t>(labels.size()) >= n_seen,
          "labels: one for every detection so far");
  require(!tracker.has_confidence() || static_cast<std::int64_t>(confidence.size()) >= n_seen,
          "confidence: one for every detection so far");
  nb::gil_scoped_release release;
  const Labeller label = [&](std::int64_t detection, std::int64_t id, double p) {
    labels.data()[detection] = id;
    if (tracker.has_confidence()) confidence.data()[detection] = p;
  };
  auto next_look = std::chrono::steady_clock::now() + kLookEvery;
  for (std::size_t t = 0; t < T; ++t) {
    if (std::chrono::steady_clock::now() > next_look) {
      nb::gil_scoped_acquire acquire;
      if (PyErr_CheckSignals() != 0) throw nb::python_error();
      next_look = std::chrono::steady_clock::now() + kLookEvery;
    }
    const auto frame = std::span(all).subspan(offsets.data()[t],
                                              offsets.data()[t + 1] - offsets.data()[t]);
    if constexpr (requires { tracker.end_pass(label); })
      tracker.pass(line.times[t], line.step(t), frame, label);
    else
      tracker.step(line.times[t], line.step(t), frame, label);
  }
  if constexpr (requires { tracker.end_pass(label); }) tracker.end_pass(label);
}

// What a live display needs of the confirmed tracks.
template <typename Tracker>
nb::dict tracks(const Tracker& tracker) {
  const MotionModel& m = tracker.motion();
  const auto& live = tracker.live();
  std::size_t K = 0;
  for (const auto& t : live.tracks) K += t.is_confirmed();
  const std::size_t D = m.axis.D, n = m.axis.n;
  Owned<std::int64_t> ids(K), gaps(K);
  Owned<double> scores(K), means(K * D * n), covariances(K * n * n);
  std::size_t k = 0;
  for (const auto& t : live.tracks) {
    if (!t.is_confirmed()) continue;
    ids.data[k] = t.id;
    gaps.data[k] = t.gap;
    scores.data[k] = t.score;
    const AxisState state = collapse(m, t.state);
    for (std::size_t d = 0; d < D; ++d)
      std::copy_n(state.x[d].begin(), n, means.data.get() + (k * D + d) * n);
    std::copy_n(state.P.begin(), n * n, covariances.data.get() + k * n * n);
    ++k;
  }
  nb::dict out;
  out["ids"] = ids.give({K});
  out["gaps"] = gaps.give({K});
  out["log_odds"] = scores.give({K});
  out["means"] = means.give({K, D, n});
  out["covariances"] = covariances.give({K, n, n});
  return out;
}

template <typename Tracker>
nb::class_<Tracker> bind_tracker(nb::module_& module, const char* name) {
  return nb::class_<Tracker>(module, name)
      .def("step", &step<Tracker>, "time"_a, "F"_a, "Q"_a, "points"_a)
      .def("run", &run<Tracker>, "times"_a, "kind"_a, "F"_a, "Q"_a, "offsets"_a, "points"_a,
           "labels"_a.noconvert(), "confidence"_a.noconvert())
      .def("copy", [](const Tracker& self) { return Tracker(self); })
      .def("tracks", &tracks<Tracker>)
      .def_prop_ro("has_confidence", &Tracker::has_confidence)
      .def_prop_ro("n_frames", &Tracker::n_frames)
      .def_prop_ro("n_seen", &Tracker::n_seen)
      .def_prop_ro("n_ids", [](const Tracker& self) { return self.n_ids(); })
      .def_prop_ro("last_time", &Tracker::last_time)
      .def_prop_ro("total", [](const Tracker& self) { return self.total(); });
}

}  // namespace asterism
