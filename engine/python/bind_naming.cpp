// Bindings of the search for names.
#include <nanobind/stl/pair.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>
#include <vector>

#include "naming/name_evidence.hpp"
#include "naming/name_search.hpp"
#include "naming/window_scores.hpp"
#include "python/arrays.hpp"
#include "python/bindings.hpp"

using namespace nb::literals;
using namespace asterism;

namespace {

template <typename To, typename From>
std::vector<To> values_as(const In<From>& array) {
  return {array.data(), array.data() + array.size()};
}

void require_within(const std::vector<std::int32_t>& values, std::int32_t least, std::int32_t n,
                   const char* what) {
  for (const std::int32_t x : values) require(x >= least && x < n, what);
}

Names names_given(const In<std::int64_t>& names, const NameEvidence& evidence) {
  require(names.ndim() == 1 && names.size() == static_cast<std::size_t>(evidence.n_tracks()),
          "names: shape (K,)");
  Names out = values_as<std::int32_t>(names);
  require_within(out, -1, evidence.n_markers(), "names: markers, or -1");
  return out;
}

void make_evidence(NameEvidence* self, const In<double>& distances, const In<double>& movements,
          const In<double>& variations, const In<double>& prior, const In<std::int64_t>& quads, const In<double>& heights,
          const In<std::int64_t>& pairs, const In<double>& pair_distances,
          const In<double>& pair_spreads, const In<double>& positions, const In<double>& spreads,
          double size, const In<double>& weights, double none) {
  MarkerTables markers;
  require(distances.ndim() == 2 && distances.shape(0) == distances.shape(1), "distances: (M, M)");
  markers.M = static_cast<std::int32_t>(distances.shape(0));
  require(movements.size() == distances.size() && variations.size() == distances.size(),
          "movements, variations: (M, M)");
  markers.distance = values_as<double>(distances);
  markers.movement = values_as<double>(movements);
  markers.variation = values_as<double>(variations);
  require(spreads.ndim() == 2 && spreads.shape(0) == spreads.shape(1), "spreads: (K, K)");
  require(prior.size() == spreads.shape(0) * distances.shape(0), "prior: (K, M)");
  TrackPairs tracks;
  tracks.K = static_cast<std::int32_t>(spreads.shape(0));
  const std::size_t P = pair_distances.size();
  require(pairs.ndim() == 2 && pairs.shape(0) == P && pairs.shape(1) == 2, "pairs: (P, 2)");
  require(pair_spreads.size() == P, "pair_spreads: (P,)");
  for (std::size_t p = 0; p < P; ++p) {
    tracks.first.push_back(static_cast<std::int32_t>(pairs.data()[2 * p]));
    tracks.second.push_back(static_cast<std::int32_t>(pairs.data()[2 * p + 1]));
  }
  require_within(tracks.first, 0, tracks.K, "pairs: tracks");
  require_within(tracks.second, 0, tracks.K, "pairs: tracks");
  tracks.distance = values_as<double>(pair_distances);
  tracks.spread = values_as<double>(pair_spreads);
  TrackPoses poses;
  require(positions.ndim() == 3 && positions.shape(2) == 3 &&
              positions.shape(1) == static_cast<std::size_t>(tracks.K),
          "positions: (F, K, 3)");
  poses.F = static_cast<std::int32_t>(positions.shape(0));
  poses.positions = values_as<double>(positions);
  poses.spread = values_as<double>(spreads);
  require(quads.ndim() == 2 && quads.shape(1) == 4, "quads: (Q, 4)");
  require(heights.ndim() == 2 && heights.shape(1) == 3 && heights.shape(0) == quads.shape(0),
          "heights: (Q, 3), height, variance and weight");
  std::vector<Quad> own;
  for (std::size_t q = 0; q < quads.shape(0); ++q) {
    const std::int64_t* m = quads.data() + 4 * q;
    for (int i = 0; i < 4; ++i) require(m[i] >= 0 && m[i] < markers.M, "quads: markers");
    const double* h = heights.data() + 3 * q;
    own.push_back({static_cast<std::int32_t>(m[0]),
                   {static_cast<std::int32_t>(m[1]), static_cast<std::int32_t>(m[2]),
                    static_cast<std::int32_t>(m[3])},
                   h[0], h[1], h[2]});
  }
  require(weights.size() == kFits, "weights: of four components");
  FitWeights w;
  std::copy_n(weights.data(), kFits, w.begin());
  nb::gil_scoped_release release;
  new (self) NameEvidence(markers, std::move(own), std::move(tracks), std::move(poses),
                          values_as<double>(prior), size, w,
                          none);
}

void make_name_search(NameSearch* self, const NameEvidence& evidence,
                 const std::vector<std::vector<std::int32_t>>& groups,
                 const In<std::int64_t>& partner,
                 const std::vector<std::vector<std::int32_t>>& near) {
  std::vector<std::int32_t> partners = values_as<std::int32_t>(partner);
  require(partners.size() == static_cast<std::size_t>(evidence.n_markers()), "partner: (M,)");
  require_within(partners, -2, evidence.n_markers(), "partner: markers, -1 or -2");
  for (const auto& group : groups) require_within(group, 0, evidence.n_markers(), "groups: markers");
  require(near.size() == static_cast<std::size_t>(evidence.n_tracks()), "near: one list a track");
  for (const auto& list : near) require_within(list, 0, evidence.n_tracks(), "near: tracks");
  new (self) NameSearch(evidence, groups, std::move(partners), near);
}

// Runs a search from a start; returns names and score.
template <typename Run>
nb::tuple searched(NameSearch& search, const In<std::int64_t>& names, Run&& run) {
  NamedState state;
  Names start = names_given(names, search.evidence());
  {
    nb::gil_scoped_release release;
    state = run(std::move(start));
  }
  return nb::make_tuple(array_of<std::int64_t>(state.names), state.score);
}

Out<double> scores_in_window(const In<double>& points, const In<std::int64_t>& rows,
                   const In<std::int64_t>& holder,
                   const In<std::int64_t>& neighbours, const In<double>& distances,
                   const In<double>& variances, const In<double>& weights) {
  require(points.ndim() == 3 && points.shape(2) == 3, "points: (F, A, 3)");
  const auto A = static_cast<std::int32_t>(points.shape(1));
  NeighbourTables tables;
  require(neighbours.ndim() == 2, "neighbours: (M, R)");
  tables.M = static_cast<std::int32_t>(neighbours.shape(0));
  tables.R = static_cast<std::int32_t>(neighbours.shape(1));
  tables.neighbour = flat(neighbours);
  tables.distance = flat(distances);
  tables.variance = flat(variances);
  tables.weight = flat(weights);
  for (const std::int64_t m : tables.neighbour)
    require(m >= 0 && m < tables.M, "neighbours: markers");
  for (const auto& table : {tables.distance, tables.variance, tables.weight})
    require(table.size() == tables.neighbour.size(), "distances, variances, weights: (M, R)");
  const std::vector<std::int32_t> own = values_as<std::int32_t>(holder);
  require(own.size() == static_cast<std::size_t>(tables.M), "holder: (M,)");
  require_within(own, -1, A, "holder: tracks, or -1");
  const std::vector<std::int32_t> scored = values_as<std::int32_t>(rows);
  require_within(scored, 0, A, "rows: tracks");
  Owned<double> out(scored.size() * tables.M);
  {
    nb::gil_scoped_release release;
    window_scores(flat(points), static_cast<std::int32_t>(points.shape(0)), A, scored, own,
                  tables, {out.data.get(), scored.size() * tables.M});
  }
  return out.give({scored.size(), static_cast<std::size_t>(tables.M)});
}

// The positions of the tracks with these labels, rising, in some frames of (points, labels): (F, A,
// 3), NaN without a detection; 2-D points have z = 0.
Out<double> positions_of_labels(const In<std::int64_t>& tracks,
                                const std::vector<std::pair<In<double>, In<std::int64_t>>>& frames) {
  const auto wanted = flat(tracks);
  require(std::ranges::is_sorted(wanted), "tracks: rising");
  const std::size_t A = wanted.size();
  Owned<double> out(frames.size() * A * 3);
  std::fill_n(out.data.get(), frames.size() * A * 3, NAN);
  for (std::size_t f = 0; f < frames.size(); ++f) {
    const auto& [points, labels] = frames[f];
    const std::size_t n = labels.size();
    require(labels.ndim() == 1 && points.ndim() == 2 && points.shape(0) == n &&
                points.shape(1) >= 2 && points.shape(1) <= 3,
            "frames: points of shape (n, 2) or (n, 3) and n labels");
    const std::size_t D = points.shape(1);
    for (std::size_t i = 0; i < n; ++i) {
      const auto at = std::ranges::lower_bound(wanted, labels.data()[i]);
      if (at == wanted.end() || *at != labels.data()[i]) continue;
      double* to = out.data.get() + 3 * (f * A + static_cast<std::size_t>(at - wanted.begin()));
      to[2] = 0;
      std::copy_n(points.data() + i * D, D, to);
    }
  }
  return out.give({frames.size(), A, 3});
}

}  // namespace

void bind_naming(nb::module_& module) {
  nb::class_<NameEvidence>(module, "NameEvidence")
      .def("__init__", &make_evidence, nb::kw_only(), "distances"_a, "movements"_a, "variations"_a, "prior"_a,
           "quads"_a, "heights"_a, "pairs"_a, "pair_distances"_a, "pair_spreads"_a, "positions"_a,
           "spreads"_a, "size"_a, "weights"_a, "none"_a)
      .def_prop_ro("n_markers", &NameEvidence::n_markers)
      .def("scores",
           [](const NameEvidence& self, const In<std::int64_t>& names) {
             const Names own = names_given(names, self);
             std::vector<std::int32_t> all(self.n_tracks());
             std::iota(all.begin(), all.end(), 0);
             std::vector<double> out;
             self.scores(own, all, out);
             return array_of<double>(out, {static_cast<std::size_t>(self.n_tracks()),
                                           static_cast<std::size_t>(self.n_markers())});
           },
           "names"_a)
      .def("total",
           [](const NameEvidence& self, const In<std::int64_t>& names) {
             return self.total(names_given(names, self));
           },
           "names"_a);
  module.def("window_scores", &scores_in_window, "points"_a, nb::kw_only(), "rows"_a, "holder"_a, "neighbours"_a,
             "distances"_a, "variances"_a, "weights"_a);
  module.def("positions_of_labels", &positions_of_labels, "tracks"_a, "frames"_a);
  nb::class_<NameSearch>(module, "NameSearch")
      .def("__init__", &make_name_search, nb::keep_alive<1, 2>(), "evidence"_a, nb::kw_only(),
           "groups"_a, "partner"_a, "near"_a)
      .def("settled",
           [](NameSearch& self, const In<std::int64_t>& names) {
             return searched(self, names, [&](Names start) { return self.settled(std::move(start)); });
           },
           "names"_a)
      .def("improved",
           [](NameSearch& self, const In<std::int64_t>& names) {
             return searched(self, names, [&](Names start) { return self.improved(std::move(start)); });
           },
           "names"_a);
}
