// From many views to points, as Python sees it.
#include <nanobind/stl/array.h>
#include <nanobind/stl/vector.h>

#include "base/parallel.hpp"
#include "multiview/many_views.hpp"
#include "python/arrays.hpp"
#include "python/bindings.hpp"

using namespace nb::literals;
using namespace asterism;

namespace {

// Cameras, what is known of their images, and what a candidate must be.
struct ViewSolver {
  std::vector<Camera> cameras;  // copies: the list that they came in may let go of them
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
  require(offsets.ndim() == 1 && offsets.size() >= 1 && offsets.data()[0] >= 0, "offsets: from 0");
  for (std::size_t i = 1; i < offsets.size(); ++i)
    require(offsets.data()[i] >= offsets.data()[i - 1], "offsets: rising");
  require(offsets.data()[offsets.size() - 1] <= static_cast<std::int64_t>(pixels.shape(0)),
          "offsets: within the pixels");
  return {offsets.data(), offsets.size()};
}

// Place and variance of each.
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
//  counts (4,): candidates, parts searched, parts cut; and what the best choice may be worth more).
nb::tuple reconstruct(const ViewSolver& solver, const In<double>& pixels,
                      const In<std::int64_t>& offsets, const In<double>& priors,
                      const In<std::int64_t>& prior_offsets, double merge,
                      std::int64_t max_nodes, std::int32_t n_threads) {
  const std::span<const std::int64_t> cells = checked(pixels, offsets);
  const std::size_t C = solver.cameras.size();
  require((cells.size() - 1) % C == 0, "offsets: shape (T * C + 1,)");
  const std::size_t T = (cells.size() - 1) / C;
  const std::vector<ExpectedPlace> expected = places(priors);
  require(prior_offsets.size() == T + 1 && prior_offsets.data()[0] == 0 &&
              prior_offsets.data()[T] == static_cast<std::int64_t>(expected.size()),
          "prior_offsets: shape (T + 1,)");
  for (std::size_t t = 0; t < T; ++t)
    require(prior_offsets.data()[t] <= prior_offsets.data()[t + 1], "prior_offsets: rising");
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
  std::size_t n_points = 0, n_views = 0;
  for (const auto& frame : found) {
    n_points += frame.size();
    for (const FoundPoint& p : frame) n_views += p.uses.size();
  }
  Owned<double> points(3 * n_points), scores(n_points);
  Owned<std::int64_t> counts(T), starts(n_points + 1), views(n_views), figures(3);
  std::size_t i = 0, v = 0;
  double gap = 0;
  for (std::size_t t = 0; t < T; ++t) {
    counts.data[t] = static_cast<std::int64_t>(found[t].size());
    for (const FoundPoint& p : found[t]) {
      const double X[3] = {p.X.x, p.X.y, p.X.z};
      std::copy_n(X, 3, points.data.get() + 3 * i);
      scores.data[i++] = p.score;
      for (const std::int32_t use : p.uses) views.data[v++] = cells[t * C] + use;
      starts.data[i] = static_cast<std::int64_t>(v);
    }
    figures.data[0] += summaries[t].n_candidates;
    figures.data[1] += summaries[t].choice.n_packed;
    figures.data[2] += summaries[t].choice.n_inexact;
    gap += summaries[t].choice.gap;
  }
  return nb::make_tuple(points.give({n_points, 3}), scores.give({n_points}), counts.give({T}),
                        starts.give({n_points + 1}), views.give({n_views}), figures.give({3}), gap);
}

// Of one frame: (scores (n,), offsets of their views (n + 1,), views), before any choice.
nb::tuple candidates(const ViewSolver& solver, const In<double>& pixels,
                     const In<std::int64_t>& offsets) {
  const std::span<const std::int64_t> cells = checked(pixels, offsets);
  require(cells.size() == solver.cameras.size() + 1, "offsets: shape (C + 1,)");
  ManyViews frame = solver.views();
  const std::vector<PointCandidate> all =
      frame.candidates({pixels.data(), 2 * pixels.shape(0)}, cells, {});
  std::vector<std::int64_t> starts{0}, views;
  for (const PointCandidate& c : all) {
    for (const std::int32_t use : frame.uses(c)) views.push_back(use);
    starts.push_back(static_cast<std::int64_t>(views.size()));
  }
  Owned<double> scores(all.size());
  Owned<std::int64_t> first(starts.size()), numbers(views.size());
  for (std::size_t i = 0; i < all.size(); ++i) scores.data[i] = all[i].score;
  std::copy(starts.begin(), starts.end(), first.data.get());
  std::copy(views.begin(), views.end(), numbers.data.get());
  return nb::make_tuple(scores.give({all.size()}), first.give({starts.size()}),
                        numbers.give({views.size()}));
}

// The best compatible candidates: (their numbers, whether that is proved, by how much at most not).
nb::tuple choose(const In<double>& scores, const In<std::int64_t>& first, const In<std::int64_t>& views,
                 std::int64_t max_nodes) {
  const std::size_t n = scores.size();
  require(first.size() == n + 1 && first.data()[0] == 0 &&
              first.data()[n] == static_cast<std::int64_t>(views.size()),
          "first: shape (n + 1,)");
  std::vector<std::vector<std::int32_t>> uses(n);
  std::int32_t n_points = 0;
  for (std::size_t i = 0; i < n; ++i)
    for (std::int64_t v = first.data()[i]; v < first.data()[i + 1]; ++v) {
      const std::int64_t use = views.data()[v];
      require(use >= 0 && use < (std::int64_t{1} << 30), "views: numbers from 0");
      uses[i].push_back(static_cast<std::int32_t>(use));
      n_points = std::max(n_points, uses[i].back() + 1);
    }
  ChoiceSummary summary;
  const std::vector<std::int32_t> chosen =
      CandidateChoice(uses, {scores.data(), n}, static_cast<std::size_t>(n_points))
          .solve(max_nodes, summary);
  Owned<std::int64_t> out(chosen.size());
  std::copy(chosen.begin(), chosen.end(), out.data.get());
  return nb::make_tuple(out.give({chosen.size()}), summary.n_inexact == 0, summary.gap);
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
           "merge"_a, "max_nodes"_a, "n_threads"_a)
      .def("candidates", &candidates, "pixels"_a, "offsets"_a);
  module.def("choose_candidates", &choose, "scores"_a, "first"_a, "views"_a, "max_nodes"_a);
}
