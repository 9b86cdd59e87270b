// Bindings of the likelihood that motion fits maximise.
#include "filter/motion_likelihood.hpp"
#include "python/arrays.hpp"
#include "python/bindings.hpp"
#include "python/motion_arrays.hpp"

using namespace nb::literals;
using namespace asterism;

namespace {

void make(MotionLikelihood* self, int n_axes, const In<double>& points,
          const In<std::int64_t>& frames, const In<std::int64_t>& offsets,
          const In<std::int32_t>& kind, const In<double>& steps) {
  require(n_axes == 2 || n_axes == 3, "n_axes: 2 or 3");
  require(steps.ndim() == 2 && steps.shape(1) == 4, "steps: shape (kinds, 4)");
  require(kind.ndim() == 1, "kind: shape (T,)");
  std::vector<UnitStep> units;
  for (std::size_t k = 0; k < steps.shape(0); ++k) {
    const double* at = steps.data() + 4 * k;
    units.push_back({at[0], at[1], at[2], at[3]});
  }
  const std::span kinds(kind.data(), kind.shape(0));
  for (const std::int32_t k : kinds)
    require(k >= 0 && k < static_cast<std::int64_t>(units.size()), "kind: an index into steps");
  const TrackPoints tracks(points, frames, offsets, n_axes, kinds.size());
  new (self) MotionLikelihood(n_axes, tracks.points, tracks.frames, tracks.offsets, kinds,
                              std::move(units));
}

double sum(const MotionLikelihood& self, const In<double>& squares, const In<double>& transitions,
           double variance, double velocity_variance) {
  LeveledMotion m;
  require(squares.ndim() == 1 && squares.shape(0) >= 1 && squares.shape(0) <= kMaxModes,
          "squares: of 1 to 3 levels");
  m.M = static_cast<int>(squares.shape(0));
  require(transitions.ndim() == 2 && transitions.shape(0) == squares.shape(0) &&
              transitions.shape(1) == squares.shape(0),
          "transitions: shape (modes, modes)");
  std::copy_n(squares.data(), m.M, m.squares.begin());
  std::copy_n(transitions.data(), m.M * m.M, m.T.begin());
  m.w0 = stationary(m.T, m.M);
  m.r = variance;
  m.velocity_variance = velocity_variance;
  nb::gil_scoped_release release;
  return self.sum(m);
}

}  // namespace

void bind_likelihood(nb::module_& module) {
  nb::class_<MotionLikelihood>(module, "MotionLikelihood")
      .def("__init__", &make, nb::kw_only(), "n_axes"_a, "points"_a, "frames"_a, "offsets"_a,
           "kind"_a, "steps"_a)
      .def("sum", &sum, nb::kw_only(), "squares"_a, "transitions"_a, "variance"_a,
           "velocity_variance"_a);
}
