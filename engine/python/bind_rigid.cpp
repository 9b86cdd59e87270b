// Bindings of rigid motions between point sets.
#include <nanobind/stl/tuple.h>

#include <algorithm>
#include <vector>

#include "python/arrays.hpp"
#include "python/bindings.hpp"
#include "python/motion_arrays.hpp"
#include "rigid/carried.hpp"
#include "rigid/rigid_fit.hpp"

using namespace nb::literals;
using namespace asterism;

namespace {

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

// Returns (R, from, to, rms) of the rigid motion between two point sets.
nb::tuple fit(const In<double>& a, const In<double>& b, const In<double>& weights) {
  const RigidFit found = fit_rigid(to_pairs(a, b, weights), static_cast<int>(a.shape(1)));
  return nb::make_tuple(array_of<double>(found.R, {3, 3}), array_of<double>(found.from),
                        array_of<double>(found.to), found.rms);
}

// Returns (predicted position of what was at `then`, its variance in addition to `r`, log densities
// at some points).
nb::tuple carried(const In<double>& a, const In<double>& b, const In<double>& weights,
                  const In<double>& then, double r, const In<double>& points) {
  const std::vector<RigidPair> pairs = to_pairs(a, b, weights);
  const auto D = static_cast<int>(a.shape(1));
  const std::vector<Point> was = to_points(then, D), at = to_points(points, D);
  require(was.size() == 1, "then: shape (1, D)");
  Carried found;
  RigidPredictions().each(
      D, r, was,
      [&](const Point& one, Point& at_then) {
        at_then = one;
        return std::span<const RigidPair>(pairs);
      },
      [&](const Point&, const RigidPrediction& prediction) { found = prediction.place(r, 1); });
  const auto density = [&](const Point& y) { return found.log_density(y, D); };
  return nb::make_tuple(array_of<double>(found.at), found.variance, array_of<double>(at, density));
}

// The rotations of a shape that fit its points in each of F frames.
template <int D>
void fit_turns(const std::vector<Point>& shape, const std::vector<Point>& points,
               std::span<const double> weights, std::span<double> turns) {
  const std::size_t n = shape.size(), n_frames = points.size() / n;
  std::vector<RigidPair> pairs(n);
  rigid::LanePairs lanes;
  for (std::size_t begin = 0; begin < n_frames; begin += kLanes) {
    const std::size_t end = std::min<std::size_t>(begin + kLanes, n_frames);
    lanes.clear();
    for (std::size_t t = begin; t < end; ++t) {
      for (std::size_t k = 0; k < n; ++k) pairs[k] = {shape[k], points[t * n + k], weights[k]};
      lanes.add(pairs);
    }
    const LaneFit fit = fit_rigid_in<D>(lanes);
    for (std::size_t t = begin; t < end; ++t)
      for (int i = 0; i < D; ++i)
        for (int j = 0; j < D; ++j) turns[(t * D + i) * D + j] = fit.R[3 * i + j].at[t - begin];
  }
}

Out<double> turns(const In<double>& shape, const In<double>& points, const In<double>& weights) {
  require(shape.ndim() == 2 && (shape.shape(1) == 2 || shape.shape(1) == 3) && shape.shape(0) > 0,
          "shape: shape (n, 2 or 3)");
  const std::size_t n = shape.shape(0), D = shape.shape(1);
  require(points.ndim() == 2 && points.shape(1) == D && points.shape(0) % n == 0,
          "points: shape (F n, D)");
  require(weights.ndim() == 1 && weights.size() == n, "weights: shape (n,)");
  const std::size_t n_frames = points.shape(0) / n;
  Owned<double> found(n_frames * D * D);
  const std::span<double> out{found.data.get(), n_frames * D * D};
  const auto fit_in = D == 2 ? fit_turns<2> : fit_turns<3>;
  fit_in(to_points(shape, static_cast<int>(D)), to_points(points, static_cast<int>(D)),
         flat(weights), out);
  return found.give({n_frames, D, D});
}

}  // namespace

void bind_rigid(nb::module_& module) {
  module.def("fit_rigid", &fit, "a"_a, "b"_a, "weights"_a);
  module.def("turns", &turns, "shape"_a, "points"_a, "weights"_a);
  module.def("carried", &carried, "a"_a, "b"_a, "weights"_a, "then"_a, "r"_a, "points"_a);
}
