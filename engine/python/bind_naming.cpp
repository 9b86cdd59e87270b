// Bindings of the search for names.
#include <nanobind/stl/pair.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <tuple>
#include <utility>
#include <vector>

#include "naming/exchanged_stretches.hpp"
#include "naming/measured_neighbours.hpp"
#include "naming/name_evidence.hpp"
#include "naming/name_search.hpp"
#include "naming/name_window.hpp"
#include "naming/track_distances.hpp"
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

NeighbourTables neighbour_tables(const In<std::int64_t>& neighbours, const In<double>& distances,
                                 const In<double>& variances, const In<double>& weights) {
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
  return tables;
}

Out<double> scores_in_window(const In<double>& points, const In<std::int64_t>& rows,
                   const In<std::int64_t>& holder,
                   const In<std::int64_t>& neighbours, const In<double>& distances,
                   const In<double>& variances, const In<double>& weights) {
  require(points.ndim() == 3 && points.shape(2) == 3, "points: (F, A, 3)");
  const auto A = static_cast<std::int32_t>(points.shape(1));
  const NeighbourTables tables = neighbour_tables(neighbours, distances, variances, weights);
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

// Points of a frame, and the label of each.
using LabelledFrame = std::pair<In<double>, In<std::int64_t>>;

void require_frame(const LabelledFrame& frame) {
  const auto& [points, labels] = frame;
  require(labels.ndim() == 1 && points.ndim() == 2 && points.shape(0) == labels.size() &&
              points.shape(1) >= 2 && points.shape(1) <= 3,
          "frames: points of shape (n, 2) or (n, 3) and n labels");
}

// Writes a point as three coordinates; those of two have z = 0.
void place_point(const In<double>& points, std::size_t i, double* to) {
  to[2] = 0;
  std::copy_n(points.data() + i * points.shape(1), points.shape(1), to);
}

// The marker of a track, -1 for none.
std::int32_t marker_given(const nb::dict& marker_of, std::int64_t label, std::int32_t n_markers) {
  PyObject* found = PyDict_GetItem(marker_of.ptr(), nb::int_(label).ptr());
  if (found == nullptr) return -1;
  const auto m = nb::cast<std::int32_t>(nb::handle(found));
  require(m >= 0 && m < n_markers, "marker_of: markers");
  return m;
}

// The tracks of the last frame, by label, in all frames.
class LastTracks {
 public:
  LastTracks(const std::vector<LabelledFrame>& frames, const nb::dict& marker_of,
             const In<std::int64_t>& neighbours, const In<double>& distances,
             const In<double>& variances, const In<double>& weights)
      : tables_(neighbours, distances, variances, weights), labels_(labels_of(frames)),
        window_(static_cast<std::int32_t>(frames.size()), positions(frames), markers(marker_of),
                std::apply(neighbour_tables, tables_)) {}

  const NameWindow& window() const { return window_; }
  std::int64_t label(std::int32_t k) const {
    require_track(k);
    return labels_[k];
  }
  void require_track(std::int32_t k) const {
    require(k >= 0 && k < window_.n_tracks(), "k: a track");
  }
  void require_named(std::int32_t k) const {
    require_track(k);
    require(window_.marker(k) >= 0, "k: a track with a name");
  }

 private:
  static std::vector<std::int64_t> labels_of(const std::vector<LabelledFrame>& frames) {
    require(!frames.empty(), "frames: at least one");
    std::vector<std::int64_t> labels = values_as<std::int64_t>(frames.back().second);
    std::erase_if(labels, [](std::int64_t k) { return k < 0; });
    std::ranges::sort(labels);
    return labels;
  }

  std::vector<double> positions(const std::vector<LabelledFrame>& frames) const {
    const std::size_t A = labels_.size();
    std::vector<double> out(frames.size() * A * 3, NAN);
    for (std::size_t f = 0; f < frames.size(); ++f) {
      require_frame(frames[f]);
      const auto& [points, labels] = frames[f];
      auto at = labels_.begin();  // labels mostly rise in a frame
      for (std::size_t i = 0; i < labels.size(); ++i) {
        const std::int64_t label = labels.data()[i];
        if (at == labels_.end() || *at != label) at = std::ranges::lower_bound(labels_, label);
        if (at == labels_.end() || *at != label) continue;
        place_point(points, i, &out[3 * (f * A + static_cast<std::size_t>(at - labels_.begin()))]);
        ++at;
      }
    }
    return out;
  }

  std::vector<std::int32_t> markers(const nb::dict& marker_of) const {
    const auto M = static_cast<std::int32_t>(std::get<0>(tables_).shape(0));
    std::vector<std::int32_t> out;
    for (const std::int64_t label : labels_) out.push_back(marker_given(marker_of, label, M));
    return out;
  }

  std::tuple<In<std::int64_t>, In<double>, In<double>, In<double>> tables_;  // kept alive
  std::vector<std::int64_t> labels_;
  NameWindow window_;
};

// The number, sum and sum of squares of distances between markers, with those of one more frame.
Out<double> with_distances(const In<double>& sums, const nb::dict& marker_of,
                           const In<double>& points, const In<std::int64_t>& labels) {
  require(sums.ndim() == 3 && sums.shape(0) == 3 && sums.shape(1) == sums.shape(2),
          "sums: (3, M, M)");
  const std::size_t M = sums.shape(1);
  require_frame({points, labels});
  std::vector<double> pose(3 * M, NAN);
  for (std::size_t i = 0; i < labels.size(); ++i) {
    const auto m = marker_given(marker_of, labels.data()[i], static_cast<std::int32_t>(M));
    if (m >= 0) place_point(points, i, &pose[3 * m]);
  }
  Owned<double> out(sums.size());
  std::copy_n(sums.data(), sums.size(), out.data.get());
  add_distances(pose, {out.data.get(), sums.size()});
  return out.give({3, M, M});
}

// Returns (neighbours, distances, variances, weights) of some markers, each (n, R).
nb::tuple measured_neighbours(const In<std::int64_t>& markers, double size, bool is_kept,
                              const In<double>& distances, const In<double>& movements,
                              const In<double>& variations, const In<double>& middle,
                              const In<double>& spread, const In<double>& n_frames) {
  require(distances.ndim() == 2 && distances.shape(0) == distances.shape(1), "distances: (M, M)");
  const std::size_t M = distances.shape(0), n = markers.size(),
                    R = std::min<std::size_t>(kNamedBy, M);
  for (const auto* table : {&movements, &variations})
    require(table->size() == M * M, "movements, variations: (M, M)");
  for (const auto* table : {&middle, &spread, &n_frames})
    require(table->size() == n * M, "middle, spread, n_frames: (n, M)");
  require_within(values_as<std::int32_t>(markers), 0, static_cast<std::int32_t>(M), "markers");
  Owned<std::int64_t> neighbour(n * R);
  Owned<double> distance(n * R), variance(n * R), weight(n * R);
  measure_neighbours({flat(distances), flat(movements), flat(variations), flat(middle),
                      flat(spread), flat(n_frames)},
                     flat(markers), static_cast<std::int32_t>(M), size, is_kept,
                     {{neighbour.data.get(), n * R}, {distance.data.get(), n * R},
                      {variance.data.get(), n * R}, {weight.data.get(), n * R}});
  return nb::make_tuple(neighbour.give({n, R}), distance.give({n, R}), variance.give({n, R}),
                        weight.give({n, R}));
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
  module.def("distances_between", &distances_between_tracks, "positions"_a);
  module.def("exchanges_by_distances", &find_exchanged_stretches, "positions"_a, nb::kw_only(),
             "min_frames"_a);
  module.def("with_distances", &with_distances, "sums"_a, "marker_of"_a, "points"_a, "labels"_a);
  module.def("measured_neighbours", &measured_neighbours, "markers"_a, nb::kw_only(), "size"_a,
             "is_kept"_a, "distances"_a, "movements"_a, "variations"_a, "middle"_a, "spread"_a,
             "n_frames"_a);
  nb::class_<LastTracks>(module, "LastTracks")
      .def(nb::init<const std::vector<LabelledFrame>&, const nb::dict&, const In<std::int64_t>&,
                    const In<double>&, const In<double>&, const In<double>&>(),
           "frames"_a, "marker_of"_a, nb::kw_only(), "neighbours"_a, "distances"_a, "variances"_a,
           "weights"_a)
      .def("named",
           [](const LastTracks& self, std::int64_t turn) {
             return self.window().turn_of_named(turn);
           },
           "turn"_a)
      .def("new",
           [](const LastTracks& self, std::int64_t turn) { return self.window().turn_of_new(turn); },
           "turn"_a)
      .def("label", &LastTracks::label, "k"_a)
      .def("marker",
           [](const LastTracks& self, std::int32_t k) {
             self.require_track(k);
             return self.window().marker(k);
           },
           "k"_a)
      .def("holder",
           [](const LastTracks& self, std::int32_t m) {
             require(m >= 0 && m < self.window().n_markers(), "m: a marker");
             return self.window().holder(m);
           },
           "m"_a)
      .def("best_free",
           [](const LastTracks& self, std::int32_t k, double none, double temperature) {
             self.require_track(k);
             const auto best = self.window().best_free(k, none, temperature);
             return nb::make_tuple(best.marker, best.gain, best.probability);
           },
           "k"_a, nb::kw_only(), "none"_a, "temperature"_a)
      .def("better",
           [](const LastTracks& self, std::int32_t k, double none) {
             self.require_named(k);
             const auto best = self.window().better(k, none);
             return nb::make_tuple(best.marker, best.gain);
           },
           "k"_a, nb::kw_only(), "none"_a);
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
