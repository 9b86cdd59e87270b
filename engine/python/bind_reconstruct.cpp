// Bindings of the reconstruction of points from many views.
#include <nanobind/stl/array.h>
#include <nanobind/stl/vector.h>

#include "base/parallel.hpp"
#include "multiview/many_views.hpp"
#include "python/arrays.hpp"
#include "python/bindings.hpp"

using namespace nb::literals;
using namespace asterism;

namespace {

// The cameras, their image models and the options of candidates.
struct ViewSolver {
  std::vector<Camera> cameras;  // copies, because the Python list may release its cameras
  std::vector<ImageSense> senses;
  CandidateOptions options;

  ViewSolver(const std::vector<const Camera*>& cameras_, const In<double>& sigma,
             const In<double>& p_detection, const In<double>& clutter, double log_density,
             double gate, std::int32_t min_views, std::array<double, 3> low,
             std::array<double, 3> high)
      : options{log_density, gate, min_views, low, high} {
    for (const Camera* camera : cameras_) cameras.push_back(*camera);
    const std::size_t C = cameras.size();
    require(sigma.size() == C && p_detection.size() == C && clutter.size() == C,
            "sigma, p_detection, clutter: one for each camera");
    for (std::size_t c = 0; c < C; ++c)
      senses.emplace_back(sigma.data()[c], p_detection.data()[c], clutter.data()[c]);
  }

  ManyViews views() const { return ManyViews(cameras, senses, options); }
};

std::span<const std::int64_t> checked(const In<double>& pixels, const In<std::int64_t>& offsets) {
  require(pixels.ndim() == 2 && pixels.shape(1) == 2, "pixels: shape (N, 2)");
  require_offsets(flat(offsets), pixels.shape(0), "offsets: rising, within the pixels");
  return flat(offsets);
}

// Position and variance of each.
std::vector<ExpectedPlace> places(const In<double>& points) {
  require(points.ndim() == 2 && points.shape(1) == 4, "priors: shape (M, 4)");
  std::vector<ExpectedPlace> out;
  for (std::size_t i = 0; i < points.shape(0); ++i) {
    const double* const p = points.data() + 4 * i;
    out.push_back({{p[0], p[1], p[2]}, p[3]});
  }
  return out;
}

// (points (n, 3), scores (n,), points of each frame (T,), offsets of their views (n + 1,), views,
// counts (4,): candidates, components searched, components cut; bound of the optimality gap).
nb::tuple reconstruct(const ViewSolver& solver, const In<double>& pixels,
                      const In<std::int64_t>& offsets, const In<double>& priors,
                      const In<std::int64_t>& prior_offsets, double merge,
                      std::int64_t max_nodes, std::int32_t n_threads) {
  const std::span<const std::int64_t> cells = checked(pixels, offsets);
  const std::size_t C = solver.cameras.size();
  require((cells.size() - 1) % C == 0, "offsets: shape (T * C + 1,)");
  const std::size_t T = (cells.size() - 1) / C;
  const std::vector<ExpectedPlace> expected = places(priors);
  require(prior_offsets.size() == T + 1, "prior_offsets: shape (T + 1,)");
  require_offsets(flat(prior_offsets), expected.size(), "prior_offsets: rising, within the priors");
  std::vector<std::vector<FoundPoint>> found(T);
  std::vector<FrameSummary> summaries(T);
  {
    nb::gil_scoped_release release;
    std::vector<ManyViews> workers(std::max(n_threads, 1), solver.views());
    in_parallel(static_cast<std::int64_t>(T), n_threads, [&](std::int32_t worker, std::int64_t t) {
      const std::span<const std::int64_t> own = cells.subspan(t * C, C + 1);
      const auto from = static_cast<std::size_t>(own[0]), n = static_cast<std::size_t>(own[C]) - from;
      const auto first = static_cast<std::size_t>(prior_offsets.data()[t]);
      const auto last = static_cast<std::size_t>(prior_offsets.data()[t + 1]);
      found[t] = workers[worker].solve({pixels.data() + 2 * from, 2 * n}, own,
                                       std::span(expected).subspan(first, last - first), merge, max_nodes,
                                       summaries[t]);
    });
  }
  std::vector<double> points, scores;
  std::vector<std::int64_t> starts{0}, views;
  std::array<std::int64_t, 3> figures{};
  double gap = 0;
  for (std::size_t t = 0; t < T; ++t) {
    for (const FoundPoint& p : found[t]) {
      points.insert(points.end(), {p.X.x, p.X.y, p.X.z});
      scores.push_back(p.score);
      for (const std::int32_t use : p.uses) views.push_back(cells[t * C] + use);
      starts.push_back(static_cast<std::int64_t>(views.size()));
    }
    figures[0] += summaries[t].n_candidates;
    figures[1] += summaries[t].choice.n_packed;
    figures[2] += summaries[t].choice.n_inexact;
    gap += summaries[t].choice.gap;
  }
  return nb::make_tuple(array_of<double>(points, {scores.size(), 3}), array_of<double>(scores),
                        array_of<std::int64_t>(found, &std::vector<FoundPoint>::size),
                        array_of<std::int64_t>(starts), array_of<std::int64_t>(views),
                        array_of<std::int64_t>(figures), gap);
}

}  // namespace

void bind_reconstruct(nb::module_& module) {
  nb::class_<ViewSolver>(module, "ViewSolver")
      .def(nb::init<const std::vector<const Camera*>&, const In<double>&, const In<double>&,
                    const In<double>&, double, double, std::int32_t, std::array<double, 3>,
                    std::array<double, 3>>(),
           nb::kw_only(), "cameras"_a, "sigma"_a, "p_detection"_a, "clutter"_a, "log_density"_a,
           "gate"_a, "min_views"_a, "low"_a, "high"_a)
      .def("reconstruct", &reconstruct, "pixels"_a, "offsets"_a, "priors"_a, "prior_offsets"_a,
           "merge"_a, "max_nodes"_a, "n_threads"_a);
}
