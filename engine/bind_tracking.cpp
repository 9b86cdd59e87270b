// Filtering, scoring, association and their solvers, as Python sees them.
#include <nanobind/stl/pair.h>
#include <nanobind/stl/tuple.h>

#include "arrays.hpp"
#include "bindings.hpp"
#include "deferred_acceptance.hpp"
#include "filter_tracks.hpp"
#include "frame_tracker.hpp"

using namespace nb::literals;
using namespace asterism;

namespace {

MotionModel motion_model(int n_axes, const In<double>& H, const In<double>& P0, double noise_sigma,
                         const In<double>& T) {
  require(H.ndim() == 1 && H.shape(0) >= 1 && H.shape(0) <= kMaxStates, "H: 1 to 3 states");
  require(n_axes >= 1 && n_axes <= kMaxAxes, "n_axes: 1 to 3");
  const auto n = static_cast<int>(H.shape(0));
  require(P0.ndim() == 2 && P0.shape(0) == H.shape(0) && P0.shape(1) == H.shape(0),
          "P0: shape (n, n)");
  require(T.ndim() == 2 && T.shape(0) == T.shape(1) && T.shape(0) >= 1 && T.shape(0) <= kMaxModes,
          "T: shape (modes, modes), 1 to 3 modes");
  MotionModel m;
  m.M = static_cast<int>(T.shape(0));
  std::copy_n(T.data(), m.M * m.M, m.T.begin());
  m.w0 = stationary(m.T, m.M);
  m.axis.n = n;
  m.axis.D = n_axes;
  std::copy_n(H.data(), n, m.axis.H.begin());
  std::copy_n(P0.data(), n * n, m.axis.P0.begin());
  m.axis.r = noise_sigma * noise_sigma;
  return m;
}

// F and Q of every mode, one mode after the other.
MotionStep motion_step(const MotionModel& m, const double* F, const double* Q) {
  MotionStep step;
  const int nn = m.axis.n * m.axis.n;
  for (int b = 0; b < m.M; ++b) {
    std::copy_n(F + b * nn, nn, step.mode[b].F.begin());
    std::copy_n(Q + b * nn, nn, step.mode[b].Q.begin());
  }
  return step;
}

std::vector<MotionStep> motion_steps(const MotionModel& m, const In<double>& F,
                                     const In<double>& Q) {
  const auto n = static_cast<std::size_t>(m.axis.n), M = static_cast<std::size_t>(m.M);
  require(F.ndim() == 4 && F.shape(1) == M && F.shape(2) == n && F.shape(3) == n,
          "F: shape (kinds, modes, n, n)");
  require(Q.ndim() == 4 && Q.shape(0) == F.shape(0) && Q.shape(1) == M && Q.shape(2) == n &&
              Q.shape(3) == n,
          "Q: shape (kinds, modes, n, n)");
  std::vector<MotionStep> steps;
  for (std::size_t i = 0; i < F.shape(0); ++i)
    steps.push_back(motion_step(m, F.data() + i * M * n * n, Q.data() + i * M * n * n));
  return steps;
}

Timeline timeline(const MotionModel& m, const In<double>& times, const In<std::int32_t>& kind,
                  const In<double>& F, const In<double>& Q) {
  require(times.ndim() == 1 && kind.ndim() == 1 && times.shape(0) == kind.shape(0),
          "times and kind: shape (T,)");
  Timeline line{{times.data(), times.shape(0)}, {kind.data(), kind.shape(0)}, motion_steps(m, F, Q)};
  for (std::size_t t = 1; t < line.kind.size(); ++t)
    require(line.kind[t] >= 0 && static_cast<std::size_t>(line.kind[t]) < line.steps.size(),
            "kind: an index into F");
  return line;
}

std::vector<Point> to_points(const In<double>& array, int D) {
  require(array.ndim() == 2 && array.shape(1) == static_cast<std::size_t>(D),
          "points: shape (N, D)");
  std::vector<Point> points(array.shape(0), Point{});
  for (std::size_t i = 0; i < points.size(); ++i)
    std::copy_n(array.data() + i * D, D, points[i].begin());
  return points;
}

// The points of many tracks, one track after the other, and where each begins.
struct TrackPoints {
  std::vector<Point> points;
  std::span<const std::int64_t> frames, offsets;

  TrackPoints(const In<double>& p, const In<std::int64_t>& f, const In<std::int64_t>& o, int D,
              std::size_t n_frames)
      : points(to_points(p, D)), frames(f.data(), f.size()), offsets(o.data(), o.size()) {
    require(f.ndim() == 1 && frames.size() == points.size(), "frames: shape (N,)");
    require(o.ndim() == 1 && !offsets.empty() && offsets.front() == 0 &&
                offsets.back() == static_cast<std::int64_t>(points.size()),
            "offsets: from 0 to N");
    for (std::size_t k = 0; k + 1 < offsets.size(); ++k) {
      require(offsets[k] <= offsets[k + 1], "offsets: rising");
      for (std::int64_t i = offsets[k]; i < offsets[k + 1]; ++i)
        require(frames[i] >= 0 && frames[i] < static_cast<std::int64_t>(n_frames) &&
                    (i == offsets[k] || frames[i] > frames[i - 1]),
                "frames: rising within a track");
    }
  }
  std::size_t n_tracks() const { return offsets.size() - 1; }
  std::span<const Point> points_of(std::size_t k) const {
    return std::span(points).subspan(offsets[k], offsets[k + 1] - offsets[k]);
  }
  std::span<const std::int64_t> frames_of(std::size_t k) const {
    return frames.subspan(offsets[k], offsets[k + 1] - offsets[k]);
  }
};

Out<double> score_tracks(const MotionModel& m, const ScoreModel& sm, const In<double>& points,
                         const In<std::int64_t>& frames, const In<std::int64_t>& offsets,
                         const In<double>& times, const In<std::int32_t>& kind,
                         const In<double>& F, const In<double>& Q) {
  const Timeline line = timeline(m, times, kind, F, Q);
  const TrackPoints tracks(points, frames, offsets, m.axis.D, line.times.size());
  Owned<double> scores(tracks.n_tracks());
  {
    nb::gil_scoped_release release;
    const auto log_end = log_end_table(sm, static_cast<std::int64_t>(line.times.size()));
    for (std::size_t k = 0; k < tracks.n_tracks(); ++k)
      scores.data[k] =
          score_track(m, sm, line, tracks.points_of(k), tracks.frames_of(k), log_end);
  }
  return scores.give({tracks.n_tracks()});
}

nb::tuple filter_tracks(const MotionModel& m, const In<double>& points,
                        const In<std::int64_t>& frames, const In<std::int64_t>& offsets,
                        const In<double>& times, const In<std::int32_t>& kind, const In<double>& F,
                        const In<double>& Q, bool smooth) {
  const Timeline line = timeline(m, times, kind, F, Q);
  const TrackPoints tracks(points, frames, offsets, m.axis.D, line.times.size());
  const std::size_t K = tracks.n_tracks();
  Owned<std::int64_t> starts(K + 1);
  for (std::size_t k = 0; k < K; ++k) {
    const auto f = tracks.frames_of(k);
    starts.data[k + 1] = starts.data[k] + (f.empty() ? 0 : f.back() - f.front() + 1);
  }
  const auto total = static_cast<std::size_t>(starts.data[K]);
  const std::size_t D = m.axis.D, n = m.axis.n;
  Owned<double> means(total * D * n), covariances(total * n * n), log_densities(tracks.points.size());
  {
    nb::gil_scoped_release release;
    std::vector<AxisState> states, predicted;
    for (std::size_t k = 0; k < K; ++k) {
      const auto f = tracks.frames_of(k);
      if (f.empty()) continue;
      states.resize(starts.data[k + 1] - starts.data[k]);
      predicted.resize(states.size());
      filter_track(m, line, tracks.points_of(k), f, states, predicted,
                   {log_densities.data.get() + tracks.offsets[k], f.size()});
      if (smooth) smooth_track(m, line, f.front(), predicted, states);
      for (std::size_t i = 0; i < states.size(); ++i) {
        const std::size_t at = starts.data[k] + i;
        for (std::size_t d = 0; d < D; ++d)
          std::copy_n(states[i].x[d].begin(), n, means.data.get() + (at * D + d) * n);
        std::copy_n(states[i].P.begin(), n * n, covariances.data.get() + at * n * n);
      }
    }
  }
  return nb::make_tuple(means.give({total, D, n}), covariances.give({total, n, n}),
                        starts.give({K + 1}), log_densities.give({tracks.points.size()}));
}

// One frame on a copy of the state: (new state, labels, revised detections, their labels, stats).
nb::tuple tracker_step(const FrameTracker& before, double time, const In<double>& F,
                       const In<double>& Q, const In<double>& points) {
  const MotionModel& m = before.model();
  const std::size_t size = static_cast<std::size_t>(m.M) * m.axis.n * m.axis.n;
  require(F.size() == size && Q.size() == size, "F and Q: shape (modes, n, n)");
  FrameTracker after(before);
  const std::vector<Point> frame = to_points(points, m.axis.D);
  const MotionStep step = motion_step(m, F.data(), Q.data());
  Owned<std::int64_t> labels(frame.size());
  std::fill_n(labels.data.get(), frame.size(), -1);
  std::vector<std::pair<std::int64_t, std::int64_t>> revised;
  const std::int64_t first = before.n_seen();
  FrameStats stats;
  {
    nb::gil_scoped_release release;
    stats = after.step(time, step, frame, [&](std::int64_t detection, std::int64_t id) {
      if (detection >= first)
        labels.data[detection - first] = id;
      else
        revised.emplace_back(detection, id);
    });
  }
  Owned<std::int64_t> which(revised.size()), ids(revised.size());
  for (std::size_t i = 0; i < revised.size(); ++i)
    std::tie(which.data[i], ids.data[i]) = revised[i];
  return nb::make_tuple(std::move(after), labels.give({frame.size()}), which.give({revised.size()}),
                        ids.give({revised.size()}), stats);
}

// Many frames in place. `labels` covers every detection since the state began.
FrameStats tracker_run(FrameTracker& tracker, const In<double>& times, const In<std::int32_t>& kind,
                       const In<double>& F, const In<double>& Q, const In<std::int64_t>& offsets,
                       const In<double>& points,
                       nb::ndarray<std::int64_t, nb::numpy, nb::c_contig, nb::device::cpu> labels) {
  const MotionModel& m = tracker.model();
  const Timeline line = timeline(m, times, kind, F, Q);
  const std::vector<Point> all = to_points(points, m.axis.D);
  const std::size_t T = line.times.size();
  require(offsets.ndim() == 1 && offsets.shape(0) == T + 1, "offsets: shape (T + 1,)");
  require(T == 0 || line.kind[0] >= 0, "kind: an index into F");
  for (std::size_t t = 0; t <= T; ++t)
    require(offsets.data()[t] >= 0 && offsets.data()[t] <= static_cast<std::int64_t>(all.size()) &&
                (t == 0 || offsets.data()[t] >= offsets.data()[t - 1]),
            "offsets: rising, within the points");
  require(T == 0 || static_cast<std::int64_t>(labels.size()) >=
                        tracker.n_seen() + offsets.data()[T] - offsets.data()[0],
          "labels: one for every detection so far");
  FrameStats total;
  nb::gil_scoped_release release;
  for (std::size_t t = 0; t < T; ++t) {
    const auto frame = std::span(all).subspan(offsets.data()[t],
                                              offsets.data()[t + 1] - offsets.data()[t]);
    const FrameStats s = tracker.step(
        line.times[t], line.step(t), frame,
        [&](std::int64_t detection, std::int64_t id) { labels.data()[detection] = id; });
    total.n_candidates += s.n_candidates;
    total.n_groups += s.n_groups;
    total.largest_group = std::max(total.largest_group, s.largest_group);
    total.n_confirmed = s.n_confirmed;
    total.n_tentative = s.n_tentative;
    total.n_pending = s.n_pending;
  }
  return total;
}

// What a live display needs of the tracks: ids, gaps, positions and velocities of the confirmed.
nb::tuple tracker_tracks(const FrameTracker& tracker) {
  const MotionModel& m = tracker.model();
  std::size_t K = 0;
  for (const LiveTrack& t : tracker.tracks()) K += t.is_confirmed();
  const std::size_t D = m.axis.D, n = m.axis.n;
  Owned<std::int64_t> ids(K), gaps(K);
  Owned<double> means(K * D * n), covariances(K * n * n);
  std::size_t k = 0;
  for (const LiveTrack& t : tracker.tracks()) {
    if (!t.is_confirmed()) continue;
    ids.data[k] = t.id;
    gaps.data[k] = t.gap;
    const AxisState state = collapse(m, t.state);
    for (std::size_t d = 0; d < D; ++d)
      std::copy_n(state.x[d].begin(), n, means.data.get() + (k * D + d) * n);
    std::copy_n(state.P.begin(), n * n, covariances.data.get() + k * n * n);
    ++k;
  }
  return nb::make_tuple(ids.give({K}), gaps.give({K}), means.give({K, D, n}),
                        covariances.give({K, n, n}));
}

// Rows and columns of a sparse gain list, ordered by row, paired for the greatest sum of gains.
Out<std::int32_t> assign(std::int32_t n_rows, std::int32_t n_columns, const In<std::int32_t>& rows,
                         const In<std::int32_t>& columns, const In<double>& gains) {
  require(rows.size() == gains.size() && columns.size() == gains.size(), "one gain a pair");
  require(n_rows >= 0 && n_columns >= 0, "sizes ≥ 0");
  std::vector<Candidate> candidates;
  for (std::size_t e = 0; e < gains.size(); ++e) {
    const std::int32_t i = rows.data()[e], j = columns.data()[e];
    require(i >= 0 && i < n_rows && j >= 0 && j < n_columns, "indices within the sizes");
    require(e == 0 || i >= rows.data()[e - 1], "pairs ordered by row");
    candidates.push_back({i, j, gains.data()[e], 0});
  }
  Owned<std::int32_t> match(n_rows);
  std::fill_n(match.data.get(), n_rows, -1);
  {
    nb::gil_scoped_release release;
    const Groups groups = connected_groups(candidates, n_rows, n_columns);
    Assignment solver;
    for (std::size_t g = 0; g < groups.size(); ++g)
      solver.solve(groups[g], {match.data.get(), static_cast<std::size_t>(n_rows)});
  }
  return match.give({static_cast<std::size_t>(n_rows)});
}

std::pair<Out<std::int32_t>, std::int64_t> marry(const In<std::int64_t>& first,
                                                 const In<std::int32_t>& receivers,
                                                 const In<double>& costs,
                                                 std::int32_t n_receivers) {
  require(first.ndim() == 1 && first.size() >= 1, "first: shape (P + 1,)");
  require(receivers.size() == costs.size(), "a cost for every wish");
  const std::size_t P = first.size() - 1;
  require(first.data()[0] == 0 && first.data()[P] == static_cast<std::int64_t>(costs.size()),
          "first: from 0 to the number of wishes");
  for (std::size_t p = 0; p < P; ++p) require(first.data()[p] <= first.data()[p + 1], "first: rising");
  std::vector<Proposal> lists;
  for (std::size_t e = 0; e < costs.size(); ++e) {
    const std::int32_t r = receivers.data()[e];
    require(r >= 0 && r < n_receivers, "receivers within their number");
    lists.push_back({r, costs.data()[e]});
  }
  Owned<std::int32_t> partner(P);
  const std::int64_t n = deferred_acceptance(lists, {first.data(), first.size()}, n_receivers,
                                             {partner.data.get(), P});
  return {partner.give({P}), n};
}

}  // namespace

void bind_tracking(nb::module_& module) {
  nb::class_<MotionModel>(module, "MotionModel")
      .def_static("make", &motion_model, "n_axes"_a, "H"_a, "P0"_a, "noise_sigma"_a, "T"_a);

  nb::class_<ScoreModel>(module, "ScoreModel")
      .def(
          "__init__",
          [](ScoreModel* self, double birth_density, double clutter_density, double p_detection,
             double p_disappear, double max_speed, double speed_margin, int max_gap,
             bool last_termination) {
            new (self) ScoreModel{std::log(birth_density),
                                  std::log(clutter_density),
                                  std::log(p_detection),
                                  std::log1p(-p_detection),
                                  std::log1p(-p_disappear),
                                  p_disappear,
                                  p_detection,
                                  max_speed,
                                  speed_margin,
                                  max_gap,
                                  last_termination};
          },
          nb::kw_only(), "birth_density"_a, "clutter_density"_a, "p_detection"_a, "p_disappear"_a,
          "max_speed"_a, "speed_margin"_a, "max_gap"_a, "last_termination"_a);

  nb::class_<FrameStats>(module, "FrameStats")
      .def_ro("n_candidates", &FrameStats::n_candidates)
      .def_ro("n_groups", &FrameStats::n_groups)
      .def_ro("largest_group", &FrameStats::largest_group)
      .def_ro("n_confirmed", &FrameStats::n_confirmed)
      .def_ro("n_tentative", &FrameStats::n_tentative)
      .def_ro("n_pending", &FrameStats::n_pending);

  nb::class_<FrameTracker>(module, "FrameTracker")
      .def(
          "__init__",
          [](FrameTracker* self, const MotionModel& model, const ScoreModel& score,
             std::int32_t matcher, double gate, double confirm_score, double delete_drop,
             std::int64_t max_candidates, bool is_strict, std::int32_t capacity,
             double merged_within) {
            require(capacity >= 1 && capacity <= 64, "capacity: 1 to 64");
            require(matcher >= 0 && matcher <= 2, "matcher: 0, 1 or 2");
            new (self) FrameTracker(model, score,
                                    {static_cast<Matcher>(matcher), gate, confirm_score,
                                     delete_drop, max_candidates, is_strict, capacity,
                                     merged_within});
          },
          "model"_a, "score"_a, nb::kw_only(), "matcher"_a, "gate"_a, "confirm_score"_a,
          "delete_drop"_a, "max_candidates"_a, "is_strict"_a,
          "capacity"_a, "merged_within"_a)
      .def("step", &tracker_step, "time"_a, "F"_a, "Q"_a, "points"_a)
      .def("run", &tracker_run, "times"_a, "kind"_a, "F"_a, "Q"_a, "offsets"_a, "points"_a,
           "labels"_a.noconvert())
      .def("copy", [](const FrameTracker& self) { return FrameTracker(self); })
      .def("tracks", &tracker_tracks)
      .def_prop_ro("n_frames", &FrameTracker::n_frames)
      .def_prop_ro("n_seen", &FrameTracker::n_seen)
      .def_prop_ro("n_ids", &FrameTracker::n_ids)
      .def_prop_ro("last_time", &FrameTracker::last_time);

  module.def("score_tracks", &score_tracks, "model"_a, "score"_a, "points"_a, "frames"_a,
             "offsets"_a, "times"_a, "kind"_a, "F"_a, "Q"_a);
  module.def("filter_tracks", &filter_tracks, "model"_a, "points"_a, "frames"_a, "offsets"_a,
             "times"_a, "kind"_a, "F"_a, "Q"_a, "smooth"_a);
  module.def("assign", &assign, "n_rows"_a, "n_columns"_a, "rows"_a, "columns"_a, "gains"_a);
  module.def("marry", &marry, "first"_a, "receivers"_a, "costs"_a, "n_receivers"_a);

  nb::register_exception_translator([](const std::exception_ptr& p, void*) {
    try {
      std::rethrow_exception(p);
    } catch (const CandidateLimit&) {
      PyErr_SetString(PyExc_OverflowError, "too many candidates in a frame");
    }
  });
}
