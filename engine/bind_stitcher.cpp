// Fragments made into markers, as Python sees it.
#include <chrono>

#include "arrays.hpp"
#include "bindings.hpp"
#include "motion_arrays.hpp"
#include "stitcher.hpp"

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

nb::tuple run(Stitcher& stitcher, const MotionModel& m, const In<double>& times,
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

// (R, from, to, rms) of the rigid motion that takes points to others.
nb::tuple fit(const In<double>& a, const In<double>& b, const In<double>& weights) {
  require(a.ndim() == 2 && a.shape(1) >= 1 && a.shape(1) <= kMaxAxes && b.ndim() == 2 &&
              b.shape(0) == a.shape(0) && b.shape(1) == a.shape(1) && weights.ndim() == 1 &&
              weights.size() == a.shape(0) && a.shape(0) > 0,
          "a and b: shape (n, D); weights: shape (n,)");
  const auto D = static_cast<int>(a.shape(1));
  const std::vector<Point> from = to_points(a, D), to = to_points(b, D);
  std::vector<RigidPair> pairs;
  for (std::size_t k = 0; k < from.size(); ++k) pairs.push_back({from[k], to[k], weights.data()[k]});
  const RigidFit found = fit_rigid(pairs, D);
  Owned<double> R(9), x(3), y(3);
  std::copy(found.R.begin(), found.R.end(), R.data.get());
  std::copy(found.from.begin(), found.from.end(), x.data.get());
  std::copy(found.to.begin(), found.to.end(), y.data.get());
  return nb::make_tuple(R.give({3, 3}), x.give({3}), y.give({3}), found.rms);
}

}  // namespace

void bind_stitcher(nb::module_& module) {
  module.def("fit_rigid", &fit, "a"_a, "b"_a, "weights"_a);
  nb::class_<Stitcher>(module, "Stitcher")
      .def(
          "__init__",
          [](Stitcher* self, const MotionModel& m, double noise, double ghost_radius,
             std::int64_t confirm, std::int64_t max_gap, std::int64_t max_hidden) {
            new (self) Stitcher(m, {noise, ghost_radius, confirm, max_gap, max_hidden});
          },
          "motion"_a, nb::kw_only(), "noise"_a, "ghost_radius"_a, "confirm"_a, "max_gap"_a,
          "max_hidden"_a)
      // (fragment of each point, and of each fragment its marker, the fragment before, how probably).
      .def("run", &run, "motion"_a, "times"_a, "kind"_a, "F"_a, "Q"_a, "offsets"_a, "points"_a,
           "labels"_a)
      .def_prop_ro("n_cuts", &Stitcher::n_cuts)
      .def_prop_ro("n_markers", &Stitcher::n_markers);
}
