// Bindings of models, filters and scores.
#include "filter/track_filter.hpp"
#include "python/arrays.hpp"
#include "python/bindings.hpp"
#include "python/motion_arrays.hpp"

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

// Tracks, and the steps between their frames.
struct TimedTracks : TrackPoints {
  Timeline line;

  TimedTracks(const MotionModel& m, const In<double>& p, const In<std::int64_t>& f,
              const In<std::int64_t>& o, const In<double>& times, const In<std::int32_t>& kind,
              const In<double>& F, const In<double>& Q)
      : TrackPoints(p, f, o, m.axis.D, times.size()), line(timeline(m, times, kind, F, Q)) {}
};

Out<double> score_tracks(const MotionModel& m, const ScoreModel& sm, const In<double>& points,
                         const In<std::int64_t>& frames, const In<std::int64_t>& offsets,
                         const In<double>& times, const In<std::int32_t>& kind,
                         const In<double>& F, const In<double>& Q) {
  const TimedTracks tracks(m, points, frames, offsets, times, kind, F, Q);
  Owned<double> scores(tracks.n_tracks());
  {
    nb::gil_scoped_release release;
    const auto log_end = log_end_table(sm, static_cast<std::int64_t>(tracks.line.times.size()));
    for (std::size_t k = 0; k < tracks.n_tracks(); ++k)
      scores.data[k] =
          score_track(m, sm, tracks.line, tracks.points_of(k), tracks.frames_of(k), log_end);
  }
  return scores.give({tracks.n_tracks()});
}

nb::tuple filter_tracks(const MotionModel& m, const In<double>& points,
                        const In<std::int64_t>& frames, const In<std::int64_t>& offsets,
                        const In<double>& times, const In<std::int32_t>& kind, const In<double>& F,
                        const In<double>& Q, bool smooth) {
  const TimedTracks tracks(m, points, frames, offsets, times, kind, F, Q);
  std::vector<std::size_t> starts{0};
  std::vector<AxisState> all;
  Owned<double> log_densities(tracks.points.size());
  {
    nb::gil_scoped_release release;
    std::vector<AxisState> states, predicted;
    for (std::size_t k = 0; k < tracks.n_tracks(); ++k) {
      if (const auto f = tracks.frames_of(k); !f.empty()) {
        states.resize(f.back() - f.front() + 1);
        predicted.resize(states.size());
        filter_track(m, tracks.line, tracks.points_of(k), f, states, predicted,
                     {log_densities.data.get() + tracks.offsets[k], f.size()});
        if (smooth) smooth_track(m, tracks.line, f.front(), predicted, states);
        all.insert(all.end(), states.begin(), states.end());
      }
      starts.push_back(all.size());
    }
  }
  auto [means, covariances] = state_arrays(m, all);
  return nb::make_tuple(means, covariances, array_of<std::int64_t>(starts),
                        log_densities.give({tracks.points.size()}));
}

}  // namespace

void bind_tracking(nb::module_& module) {
  nb::class_<MotionModel>(module, "MotionModel")
      .def_static("make", &motion_model, "n_axes"_a, "H"_a, "P0"_a, "noise_sigma"_a, "T"_a)
      .def_prop_ro("n_axes", [](const MotionModel& m) { return m.axis.D; });

  nb::class_<ScoreModel>(module, "ScoreModel")
      .def(
          "__init__",
          [](ScoreModel* self, double birth_density, double clutter_density, double p_detection,
             double p_redetection, double p_disappear, double max_speed, double speed_margin,
             int max_gap, bool last_termination) {
            new (self) ScoreModel{std::log(birth_density),
                                  std::log(clutter_density),
                                  std::log1p(-p_disappear),
                                  p_disappear,
                                  p_detection,
                                  p_redetection,
                                  max_speed,
                                  speed_margin,
                                  max_gap,
                                  last_termination};
          },
          nb::kw_only(), "birth_density"_a, "clutter_density"_a, "p_detection"_a, "p_redetection"_a,
          "p_disappear"_a, "max_speed"_a, "speed_margin"_a, "max_gap"_a, "last_termination"_a);

  module.def("score_tracks", &score_tracks, "model"_a, "score"_a, "points"_a, "frames"_a,
             "offsets"_a, "times"_a, "kind"_a, "F"_a, "Q"_a);
  module.def("filter_tracks", &filter_tracks, "model"_a, "points"_a, "frames"_a, "offsets"_a,
             "times"_a, "kind"_a, "F"_a, "Q"_a, "smooth"_a);
}
