// Bindings of the search for names in a whole capture.
#include <nanobind/stl/pair.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <numeric>
#include <utility>
#include <vector>

#include "naming/exchanged_stretches.hpp"
#include "naming/name_evidence.hpp"
#include "naming/name_search.hpp"
#include "naming/track_distances.hpp"
#include "python/arrays.hpp"
#include "python/bindings.hpp"

using namespace nb::literals;
using namespace asterism;

namespace {

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
  new (self) NameEvidence(std::move(markers), std::move(own), std::move(tracks), std::move(poses),
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

// Returns (median distances, spreads, numbers of common frames), each (K, K).
nb::tuple distances_between_tracks(const In<double>& positions) {
  require(positions.ndim() == 3, "positions: (F, K, D)");
  const std::size_t K = positions.shape(1);
  Owned<double> middle(K * K), spread(K * K);
  Owned<std::int64_t> n_frames(K * K);
  {
    nb::gil_scoped_release release;
    measure_distances(flat(positions), static_cast<std::int32_t>(positions.shape(0)),
                      static_cast<std::int32_t>(K), static_cast<std::int32_t>(positions.shape(2)),
                      {{middle.data.get(), K * K}, {spread.data.get(), K * K},
                       {n_frames.data.get(), K * K}});
  }
  return nb::make_tuple(middle.give({K, K}), spread.give({K, K}), n_frames.give({K, K}));
}

// Returns (track, other track, first frame, frame after the last) of each exchange.
auto find_exchanged_stretches(const In<double>& positions, std::int32_t min_frames) {
  require(positions.ndim() == 3 && positions.shape(2) == 3, "positions: (F, K, 3)");
  require(min_frames > 0, "min_frames: positive");
  nb::gil_scoped_release release;
  return ExchangedStretches(flat(positions), static_cast<std::int32_t>(positions.shape(0)),
                            static_cast<std::int32_t>(positions.shape(1)), min_frames)
      .found();
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
  module.def("distances_between", &distances_between_tracks, "positions"_a);
  module.def("exchanges_by_distances", &find_exchanged_stretches, "positions"_a, nb::kw_only(),
             "min_frames"_a);
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
