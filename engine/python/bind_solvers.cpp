// Bindings of the solvers on plain arrays.
#include <nanobind/stl/pair.h>
#include <nanobind/stl/tuple.h>

#include <cmath>

#include "math/nearest.hpp"
#include "python/arrays.hpp"
#include "python/bindings.hpp"
#include "solve/assignment.hpp"
#include "solve/deferred_acceptance.hpp"
#include "solve/joint_events.hpp"
#include "solve/k_best.hpp"
#include "solve/set_packing.hpp"

using namespace nb::literals;
using namespace asterism;

namespace {

// The possible pairings of a matrix of log weights, and their weights.
std::pair<std::vector<Candidate>, std::vector<double>> pairings_of(const In<double>& log_weights,
                                                                   const In<double>& log_miss) {
  require(log_weights.ndim() == 2 && log_miss.ndim() == 1 &&
              log_weights.shape(0) == log_miss.shape(0),
          "log_weights: shape (n, m), log_miss: shape (n,)");
  constexpr std::size_t max_size = std::size_t{1} << 30;
  require(log_weights.shape(0) < max_size && log_weights.shape(1) < max_size, "sizes below 2^30");
  std::pair<std::vector<Candidate>, std::vector<double>> out;
  for (std::size_t i = 0; i < log_weights.shape(0); ++i)
    for (std::size_t j = 0; j < log_weights.shape(1); ++j) {
      const double w = log_weights.data()[i * log_weights.shape(1) + j];
      if (!(w > -std::numeric_limits<double>::infinity())) continue;
      out.first.push_back({static_cast<std::int32_t>(i), static_cast<std::int32_t>(j),
                           w - log_miss.data()[i], 0});
      out.second.push_back(w);
    }
  return out;
}

// Returns (marginals with the miss last, log of the total weight, best event, bound, largest number
// of states). In groups that need more states, links with a marginal of at most `negligible` are cut.
nb::tuple joint_marginals(const In<double>& log_weights, const In<double>& log_miss,
                          std::int64_t max_states, double negligible) {
  const auto [pairings, weights] = pairings_of(log_weights, log_miss);
  require(max_states >= 1 && max_states <= std::int64_t{1} << 30, "max_states: 1 to 2^30");
  const std::size_t n = log_weights.shape(0), m = log_weights.shape(1);
  std::vector<double> marginals(n * (m + 1));
  std::vector<std::int32_t> best(n);
  JointSummary summary;
  {
    nb::gil_scoped_release release;
    std::vector<double> paired(pairings.size()), missed(n);
    summary =
        JointEvents(pairings, weights, flat(log_miss), static_cast<std::int32_t>(m), max_states,
                    negligible)
            .solve(paired, missed, best);
    for (std::size_t e = 0; e < pairings.size(); ++e)
      marginals[pairings[e].row * (m + 1) + pairings[e].column] = paired[e];
    for (std::size_t i = 0; i < n; ++i) marginals[i * (m + 1) + m] = missed[i];
  }
  return nb::make_tuple(array_of<double>(marginals, {n, m + 1}), summary.log_total,
                        array_of<std::int32_t>(best), summary.bound, summary.n_states);
}

// Returns the upper bounds of the marginals by which links are cut, 0 for no link.
Out<double> marginal_bounds(const In<double>& log_weights, const In<double>& log_miss) {
  const auto [pairings, weights] = pairings_of(log_weights, log_miss);
  const std::size_t n = log_weights.shape(0), m = log_weights.shape(1);
  JointEvents events(pairings, weights, flat(log_miss), static_cast<std::int32_t>(m), 1);
  const std::vector<double> found = events.marginal_bounds();
  std::vector<double> bounds(n * m);
  for (std::size_t e = 0; e < pairings.size(); ++e)
    bounds[pairings[e].row * m + pairings[e].column] = found[e];
  return array_of<double>(bounds, {n, m});
}

std::vector<Point> plain_points(const In<double>& array, const char* what) {
  require(array.ndim() == 2 && (array.shape(1) == 2 || array.shape(1) == 3), what);
  std::vector<Point> out(array.shape(0));
  for (std::size_t i = 0; i < out.size(); ++i)
    std::copy_n(array.data() + i * array.shape(1), array.shape(1), out[i].begin());
  return out;
}

// The points of the frames of a capture, which are sorted when a frame is first asked for.
class NearestPoints {
 public:
  NearestPoints(const In<double>& points, const In<std::int64_t>& offsets)
      : points_(plain_points(points, "points: shape (N, 2 or 3)")),
        offsets_(flat(offsets).begin(), flat(offsets).end()),
        n_axes_(points.shape(1)),
        nearest_(points_, offsets_, static_cast<int>(n_axes_)) {
    require_offsets(offsets_, points_.size(), "offsets: increasing, within the points");
  }
  NearestPoints(const NearestPoints&) = delete;  // the spans would refer to the original

  // For each place, the two nearest points of a frame: (indices or -1, distances or inf).
  nb::tuple two(const In<double>& places, const In<std::int64_t>& frames) {
    const std::vector<Point> from = plain_points(places, "places: shape (Q, 2 or 3)");
    require(places.shape(1) == n_axes_, "points and places with the same number of axes");
    require(frames.ndim() == 1 && frames.shape(0) == from.size(), "frames: shape (Q,)");
    const auto n_frames = static_cast<std::int64_t>(offsets_.size()) - 1;
    for (const std::int64_t t : flat(frames)) require(t >= 0 && t < n_frames, "frames: within offsets");
    Owned<std::int64_t> index(2 * from.size());
    Owned<double> distance(2 * from.size());
    {
      nb::gil_scoped_release release;
      for (std::size_t q = 0; q < from.size(); ++q) {
        const NearestInFrame::Two found = nearest_.of(from[q], frames.data()[q]);
        for (int k = 0; k < 2; ++k) {
          index.data[2 * q + k] = found.index[k];
          distance.data[2 * q + k] = std::sqrt(found.distance2[k]);
        }
      }
    }
    return nb::make_tuple(index.give({from.size(), 2}), distance.give({from.size(), 2}));
  }

 private:
  std::vector<Point> points_;
  std::vector<std::int64_t> offsets_;
  std::size_t n_axes_;
  NearestInFrame nearest_;
};

// Pairs rows and columns of a sparse list of gains, ordered by row, for the largest sum of gains.
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
  std::vector<std::int32_t> match(n_rows, -1);
  {
    nb::gil_scoped_release release;
    Assignment().solve_groups(candidates, n_columns, match);
  }
  return array_of<std::int32_t>(match);
}

std::pair<Out<std::int32_t>, std::int64_t> marry(const In<std::int64_t>& first,
                                                 const In<std::int32_t>& receivers,
                                                 const In<double>& costs,
                                                 std::int32_t n_receivers) {
  require(receivers.size() == costs.size(), "a cost for every wish");
  require_offsets(flat(first), costs.size(), "first: rising, within the number of wishes");
  std::vector<Proposal> lists;
  for (std::size_t e = 0; e < costs.size(); ++e) {
    const std::int32_t r = receivers.data()[e];
    require(r >= 0 && r < n_receivers, "receivers within their number");
    lists.push_back({r, costs.data()[e]});
  }
  std::vector<std::int32_t> partner(first.size() - 1);
  const std::int64_t n = deferred_acceptance(lists, flat(first), n_receivers, partner);
  return {array_of<std::int32_t>(partner), n};
}

// The first k assignments of n rows to N ≥ n columns by cost; all further rows cost nothing.
Out<std::int32_t> k_best(const In<double>& cost, std::int64_t k) {
  require(cost.ndim() == 2 && cost.shape(1) >= cost.shape(0), "cost: shape (n, N), N ≥ n");
  require(cost.shape(1) < std::size_t{1} << 15, "N below 2^15");
  const std::size_t n = cost.shape(0), N = cost.shape(1);
  std::vector<std::int32_t> all;
  std::size_t n_found = 0;
  {
    nb::gil_scoped_release release;
    KBest best(flat(cost), static_cast<std::int32_t>(n), static_cast<std::int32_t>(N));
    for (; static_cast<std::int64_t>(n_found) < k && best.next(); ++n_found)
      all.insert(all.end(), best.columns().begin(), best.columns().end());
  }
  return array_of<std::int32_t>(all, {n_found, n});
}

// Options are listed by tree; option o uses uses[first_use[o]:first_use[o + 1]]. Each tree needs
// one without uses.
std::vector<std::vector<PackingOption>> packing_trees(const In<std::int64_t>& first_option,
                                                      const In<double>& weights,
                                                      const In<std::int64_t>& first_use,
                                                      const In<std::int32_t>& uses) {
  require_offsets(flat(first_option), weights.size(), "first_option: rising, within the options");
  require(first_use.size() == weights.size() + 1, "one list of uses an option");
  require_offsets(flat(first_use), uses.size(), "first_use: rising, within the uses");
  std::vector<std::vector<PackingOption>> trees(first_option.size() - 1);
  for (std::size_t i = 0; i < trees.size(); ++i) {
    bool has_free = false;
    for (std::int64_t o = first_option.data()[i]; o < first_option.data()[i + 1]; ++o) {
      const std::int64_t a = first_use.data()[o], b = first_use.data()[o + 1];
      for (std::int64_t u = a; u < b; ++u) require(uses.data()[u] >= 0, "resources from 0");
      trees[i].push_back({weights.data()[o], flat(uses).subspan(a, b - a)});
      has_free = has_free || a == b;
    }
    require(has_free, "an option that uses nothing in every tree");
  }
  return trees;
}

// Returns (upper bound of the weight of a packing; the loss by each option, in the order given).
nb::tuple packing_losses(const In<std::int64_t>& first_option, const In<double>& weights,
                           const In<std::int64_t>& first_use, const In<std::int32_t>& uses) {
  const auto trees = packing_trees(first_option, weights, first_use, uses);
  const SetPacking::Losses losses = SetPacking(trees).losses();
  std::vector<double> all;
  for (const std::vector<double>& tree : losses.of) all.insert(all.end(), tree.begin(), tree.end());
  return nb::make_tuple(losses.bound, array_of<double>(all));
}

// The k best selections of one option per tree such that no resource is used twice.
nb::tuple pack(const In<std::int64_t>& first_option, const In<double>& weights,
               const In<std::int64_t>& first_use, const In<std::int32_t>& uses, std::int64_t k,
               double drop, std::int64_t max_nodes) {
  const auto trees = packing_trees(first_option, weights, first_use, uses);
  std::vector<std::int32_t> all;
  std::vector<double> totals;
  PackingSummary summary;
  {
    nb::gil_scoped_release release;
    summary = SetPacking(trees).solve(
        k, drop, max_nodes, [&](std::span<const std::int32_t> options, double log_weight) {
          all.insert(all.end(), options.begin(), options.end());
          totals.push_back(log_weight);
        });
  }
  return nb::make_tuple(array_of<std::int32_t>(all, {totals.size(), trees.size()}),
                        array_of<double>(totals), summary.is_exact, summary.bound, summary.n_nodes);
}

}  // namespace

void bind_solvers(nb::module_& module) {
  module.def("assign", &assign, "n_rows"_a, "n_columns"_a, "rows"_a, "columns"_a, "gains"_a);
  nb::class_<NearestPoints>(module, "NearestPoints")
      .def(nb::init<const In<double>&, const In<std::int64_t>&>(), "points"_a, "offsets"_a)
      .def("two", &NearestPoints::two, "places"_a, "frames"_a);
  module.def("marry", &marry, "first"_a, "receivers"_a, "costs"_a, "n_receivers"_a);
  module.def("k_best", &k_best, "cost"_a, "k"_a);
  module.def("pack", &pack, "first_option"_a, "log_weights"_a, "first_use"_a, "uses"_a, "k"_a,
             "drop"_a, "max_nodes"_a);
  module.def("packing_losses", &packing_losses, "first_option"_a, "log_weights"_a,
             "first_use"_a, "uses"_a);
  module.def("joint_marginals", &joint_marginals, "log_weights"_a, "log_miss"_a, "max_states"_a,
             "negligible"_a = 0.0);

  module.def("marginal_bounds", &marginal_bounds, "log_weights"_a, "log_miss"_a);

  nb::exception<FrontierLimit>(module, "FrontierLimit");
}
