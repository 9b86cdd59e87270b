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

// Returns the log likelihood for each of several parameter sets.
Out<double> sums(const MotionLikelihood& self, const In<double>& squares,
                 const In<double>& transitions, const In<double>& variances,
                 double velocity_variance) {
  require(squares.ndim() == 2 && squares.shape(1) >= 1 && squares.shape(1) <= kMaxModes,
          "squares: shape (sets, 1 to 3 levels)");
  const std::size_t n = squares.shape(0), M = squares.shape(1);
  require(transitions.ndim() == 3 && transitions.shape(0) == n && transitions.shape(1) == M &&
              transitions.shape(2) == M,
          "transitions: shape (sets, modes, modes)");
  require(variances.ndim() == 1 && variances.shape(0) == n, "variances: shape (sets,)");
  Owned<double> out(n);
  {
    nb::gil_scoped_release release;
    for (std::size_t k = 0; k < n; ++k) {
      LeveledMotion m;
      m.M = static_cast<int>(M);
      std::copy_n(squares.data() + k * M, M, m.squares.begin());
      std::copy_n(transitions.data() + k * M * M, M * M, m.T.begin());
      m.w0 = stationary(m.T, m.M);
      m.r = variances.data()[k];
      m.velocity_variance = velocity_variance;
      out.data[k] = self.sum(m);
    }
  }
  return out.give({n});
}

}  // namespace

void bind_likelihood(nb::module_& module) {
  nb::class_<MotionLikelihood>(module, "MotionLikelihood")
      .def("__init__", &make, nb::kw_only(), "n_axes"_a, "points"_a, "frames"_a, "offsets"_a,
           "kind"_a, "steps"_a)
      .def("sums", &sums, nb::kw_only(), "squares"_a, "transitions"_a, "variances"_a,
           "velocity_variance"_a);
}
