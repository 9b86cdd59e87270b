// Fragments made into markers, as Python sees it.
#include <chrono>
#include <tuple>

#include "python/arrays.hpp"
#include "python/bindings.hpp"
#include "python/motion_arrays.hpp"
#include "stitch/live_stitcher.hpp"

using namespace nb::literals;
using namespace asterism;

namespace {

// Of every fragment: its marker, the fragment that it goes on with, and how probably.
struct Decisions {
  std::vector<Decision> all;

  void operator()(const Decision& d) {
    if (static_cast<std::size_t>(d.fragment) >= all.size()) all.resize(d.fragment + 1);
    all[d.fragment] = d;
  }
};

nb::tuple run_stitcher(Stitcher& stitcher, const MotionModel& m, const In<double>& times,
                       const In<std::int32_t>& kind, const In<double>& F, const In<double>& Q,
                       const In<std::int64_t>& offsets, const In<double>& points,
                       const In<std::int64_t>& labels) {
  const Timeline line = timeline(m, times, kind, F, Q);
  const std::vector<Point> all = to_points(points, m.axis.D);
  const std::size_t T = line.times.size(), N = all.size();
  require(labels.ndim() == 1 && labels.size() == N, "labels: one for each point");
  require(offsets.ndim() == 1 && offsets.size() == T + 1, "offsets: shape (T + 1,)");
  require(T == 0 || line.kind[0] >= 0, "kind: an index into F");
  for (std::size_t t = 0; t <= T; ++t)
    require(offsets.data()[t] >= 0 && offsets.data()[t] <= static_cast<std::int64_t>(N) &&
                (t == 0 || offsets.data()[t] >= offsets.data()[t - 1]),
            "offsets: rising, within the points");
  Owned<std::int32_t> fragment_of(N);
  std::fill_n(fragment_of.data.get(), N, -1);
  Decisions decisions;
  {
    nb::gil_scoped_release release;
    auto next_look = std::chrono::steady_clock::now();
    for (std::size_t t = 0; t < T; ++t) {
      if (std::chrono::steady_clock::now() > next_look) {
        nb::gil_scoped_acquire acquire;
        if (PyErr_CheckSignals() != 0) throw nb::python_error();
        next_look = std::chrono::steady_clock::now() + std::chrono::milliseconds(50);
      }
      const auto from = static_cast<std::size_t>(offsets.data()[t]);
      const auto n = static_cast<std::size_t>(offsets.data()[t + 1]) - from;
      stitcher.step(line.step(t), {all.data() + from, n}, {labels.data() + from, n},
                    {fragment_of.data.get() + from, n}, decisions);
    }
    stitcher.finish(decisions);
  }
  const std::size_t n = decisions.all.size();
  Owned<std::int32_t> marker(n), after(n);
  Owned<double> probability(n);
  for (std::size_t k = 0; k < n; ++k) {
    marker.data[k] = decisions.all[k].marker;
    after.data[k] = decisions.all[k].after;
    probability.data[k] = decisions.all[k].probability;
  }
  return nb::make_tuple(fragment_of.give({N}), marker.give({n}), after.give({n}),
                        probability.give({n}));
}

// One frame of a stream, on a copy: (new state, markers, earlier detections whose marker changes, their
// markers).
nb::tuple step_stitcher(const LiveStitcher& before, const In<double>& F, const In<double>& Q,
                        const In<double>& points, const In<std::int64_t>& labels,
                        const In<std::int64_t>& revised, const In<std::int64_t>& revised_labels) {
  const MotionModel& m = before.motion();
  const std::size_t size = static_cast<std::size_t>(m.M) * m.axis.n * m.axis.n;
  require(F.size() == size && Q.size() == size, "F and Q: shape (modes, n, n)");
  const std::vector<Point> frame = to_points(points, m.axis.D);
  require(labels.ndim() == 1 && labels.size() == frame.size(), "labels: one for each point");
  require(revised.ndim() == 1 && revised_labels.ndim() == 1 &&
              revised.size() == revised_labels.size(),
          "revised_labels: one for each of revised");
  using Change = std::pair<std::int64_t, std::int64_t>;
  std::vector<Change> changes(revised.size()), told;
  for (std::size_t i = 0; i < changes.size(); ++i) {
    changes[i] = {revised.data()[i], revised_labels.data()[i]};
    require(changes[i].first >= 0 && changes[i].first < before.n_seen(),
            "revised: detections of earlier frames");
  }
  LiveStitcher after(before);
  Owned<std::int64_t> own(frame.size());
  {
    nb::gil_scoped_release release;
    const std::int64_t first = before.n_seen();
    after.step(motion_step(m, F.data(), Q.data()), frame, {labels.data(), frame.size()}, changes,
               [&](std::int64_t detection, std::int64_t marker) {
                 if (detection < first)
                   told.emplace_back(detection, marker);
                 else
                   own.data[detection - first] = marker;
               });
  }
  Owned<std::int64_t> which(told.size()), markers(told.size());
  for (std::size_t i = 0; i < told.size(); ++i)
    std::tie(which.data[i], markers.data[i]) = told[i];
  return nb::make_tuple(std::move(after), own.give({frame.size()}), which.give({told.size()}),
                        markers.give({told.size()}));
}

std::vector<RigidPair> to_pairs(const In<double>& a, const In<double>& b,
                                const In<double>& weights) {
  require(a.ndim() == 2 && a.shape(1) >= 1 && a.shape(1) <= kMaxAxes && b.ndim() == 2 &&
              b.shape(0) == a.shape(0) && b.shape(1) == a.shape(1) && weights.ndim() == 1 &&
              weights.size() == a.shape(0) && a.shape(0) > 0,
          "a and b: shape (n, D); weights: shape (n,)");
  const auto D = static_cast<int>(a.shape(1));
  const std::vector<Point> from = to_points(a, D), to = to_points(b, D);
  std::vector<RigidPair> pairs;
  for (std::size_t k = 0; k < from.size(); ++k) pairs.push_back({from[k], to[k], weights.data()[k]});
  return pairs;
}

// (R, from, to, rms) of the rigid motion that takes points to others.
nb::tuple fit(const In<double>& a, const In<double>& b, const In<double>& weights) {
  const RigidFit found = fit_rigid(to_pairs(a, b, weights), static_cast<int>(a.shape(1)));
  Owned<double> R(9), x(3), y(3);
  std::copy(found.R.begin(), found.R.end(), R.data.get());
  std::copy(found.from.begin(), found.from.end(), x.data.get());
  std::copy(found.to.begin(), found.to.end(), y.data.get());
  return nb::make_tuple(R.give({3, 3}), x.give({3}), y.give({3}), found.rms);
}

// (where they carry what was at `then`, its variance beside `r`, log densities at some points).
nb::tuple carried(const In<double>& a, const In<double>& b, const In<double>& weights,
                  const In<double>& then, double r, const In<double>& points) {
  const std::vector<RigidPair> pairs = to_pairs(a, b, weights);
  const auto D = static_cast<int>(a.shape(1));
  const std::vector<Point> was = to_points(then, D), at = to_points(points, D);
  require(was.size() == 1, "then: shape (1, D)");
  const Carried found = RigidPrediction(pairs, was[0], D, r).place(r, 1);
  Owned<double> place(kMaxAxes), densities(at.size());
  std::copy(found.at.begin(), found.at.end(), place.data.get());
  for (std::size_t i = 0; i < at.size(); ++i) densities.data[i] = found.log_density(at[i], D);
  return nb::make_tuple(place.give({kMaxAxes}), found.variance, densities.give({at.size()}));
}

// Log density of each of some points of a frame among the others, where some were seen before.
Out<double> densities_elsewhere(const In<double>& before, const In<double>& points, double noise,
                                double ghost_radius) {
  require(points.ndim() == 2 && points.shape(1) >= 1 && points.shape(1) <= kMaxAxes,
          "points: shape (n, D)");
  const auto D = static_cast<int>(points.shape(1));
  Elsewhere elsewhere(D, noise, ghost_radius);
  for (const Point& y : to_points(before, D)) elsewhere.add(y);
  Frame frame;
  for (const Point& y : to_points(points, D))
    frame.seen.push_back({static_cast<std::int32_t>(frame.seen.size()), y});
  Owned<double> densities(frame.seen.size());
  for (const auto& one : frame.seen)
    densities.data[one.fragment] = elsewhere.log_density(one.at, frame, one.fragment);
  return densities.give({frame.seen.size()});
}

void add_frame(Neighbours& neighbours, const In<std::int32_t>& markers, const In<double>& points) {
  require(points.ndim() == 2 && markers.ndim() == 1 && markers.size() == points.shape(0),
          "markers: one for each point");
  const std::vector<Point> at = to_points(points, static_cast<int>(points.shape(1)));
  std::vector<Seen> seen;
  for (std::size_t i = 0; i < at.size(); ++i) {
    require(markers.data()[i] >= 0, "markers: numbers from 0");
    seen.push_back({markers.data()[i], at[i]});
  }
  neighbours.add(seen);
}

// (the others, frames seen together, mean distances, their variances, predictive variances).
nb::tuple bonds_of(const Neighbours& neighbours, std::int32_t marker) {
  const std::span<const Bond> bonds = neighbours.of(marker);
  const std::size_t n = bonds.size();
  Owned<std::int64_t> others(n), frames(n);
  Owned<double> means(n), variances(n), predictive(n);
  for (std::size_t k = 0; k < n; ++k) {
    others.data[k] = bonds[k].other;
    frames.data[k] = bonds[k].n;
    means.data[k] = bonds[k].mean;
    variances.data[k] = bonds[k].variance;
    predictive.data[k] = neighbours.variance(bonds[k]);
  }
  return nb::make_tuple(others.give({n}), frames.give({n}), means.give({n}), variances.give({n}),
                        predictive.give({n}));
}

// (predictive variances, whether each is a bond) of distances without noise of their own.
nb::tuple judge_distances(const In<double>& means, const In<double>& variances,
                          const In<std::int64_t>& frames) {
  const std::size_t n = means.size();
  require(means.ndim() == 1 && variances.size() == n && frames.size() == n,
          "means, variances and frames: shape (n,)");
  Owned<double> predictive(n);
  Owned<bool> is_one(n);
  for (std::size_t k = 0; k < n; ++k) {
    const Bond bond{0, frames.data()[k], means.data()[k], variances.data()[k]};
    predictive.data[k] = predictive_variance(bond, 0);
    is_one.data[k] = is_bond(bond, 0);
  }
  return nb::make_tuple(predictive.give({n}), is_one.give({n}));
}

}  // namespace

void bind_stitcher(nb::module_& module) {
  module.attr("BEND") = kBend;
  module.attr("MIN_TOGETHER") = kMinTogether;
  module.def("judge_distances", &judge_distances, "means"_a, "variances"_a, "frames"_a);
  module.def("fit_rigid", &fit, "a"_a, "b"_a, "weights"_a);
  module.def("carried", &carried, "a"_a, "b"_a, "weights"_a, "then"_a, "r"_a, "points"_a);
  module.def("densities_elsewhere", &densities_elsewhere, "before"_a, "points"_a, nb::kw_only(),
             "noise"_a, "ghost_radius"_a);
  nb::class_<Neighbours>(module, "Neighbours")
      .def(nb::init<int, double>(), "n_axes"_a, "r"_a)
      .def("add", &add_frame, "markers"_a, "points"_a)
      .def("of", &bonds_of, "marker"_a);
  nb::class_<StitchOptions>(module, "StitchOptions")
      .def(
          "__init__",
          [](StitchOptions* self, double noise, double ghost_radius, std::int64_t confirm,
             std::int64_t max_gap, std::int64_t max_hidden, bool may_cut) {
            new (self) StitchOptions{noise, ghost_radius, confirm, max_gap, max_hidden, may_cut};
          },
          nb::kw_only(), "noise"_a, "ghost_radius"_a, "confirm"_a, "max_gap"_a, "max_hidden"_a,
          "may_cut"_a);
  nb::class_<Stitcher>(module, "Stitcher")
      .def(nb::init<const MotionModel&, const StitchOptions&>(), "motion"_a, "options"_a)
      // (fragment of each point, and of each fragment its marker, the fragment before, how probably).
      .def_prop_ro_static("WORTH", [](nb::handle) { return Claims::kWorth; })
      .def("run", &run_stitcher, "motion"_a, "times"_a, "kind"_a, "F"_a, "Q"_a, "offsets"_a,
           "points"_a, "labels"_a)
      .def(
          "advise",
          [](Stitcher& self, const In<std::int64_t>& labels, const In<std::int64_t>& before,
             const In<double>& weights) {
            require(labels.ndim() == 1 && before.size() == labels.size() &&
                        weights.size() == labels.size(),
                    "labels, before and weights: shape (n,)");
            for (std::size_t i = 0; i < labels.size(); ++i)
              self.advise(labels.data()[i], {before.data()[i], weights.data()[i]});
          },
          "labels"_a, "before"_a, "weights"_a)
      .def_prop_ro("n_cuts", &Stitcher::n_cuts)
      .def_prop_ro("n_markers", &Stitcher::n_markers);
  nb::class_<LiveStitcher>(module, "LiveStitcher")
      .def(nb::init<const MotionModel&, const StitchOptions&, std::int64_t>(), "motion"_a,
           "options"_a, nb::kw_only(), "lag"_a)
      .def("step", &step_stitcher, "F"_a, "Q"_a, "points"_a, "labels"_a, "revised"_a,
           "revised_labels"_a)
      .def_prop_ro("n_seen", &LiveStitcher::n_seen)
      .def_prop_ro("n_joins", &LiveStitcher::n_joins)
      .def_prop_ro("n_ghosts", &LiveStitcher::n_ghosts)
      .def_prop_ro("n_cuts", [](const LiveStitcher& self) { return self.stitcher().n_cuts(); })
      .def_prop_ro("n_markers", [](const LiveStitcher& self) { return self.stitcher().n_markers(); })
      .def_prop_ro("n_remembered",
                   [](const LiveStitcher& self) { return self.stitcher().n_remembered(); });
}
