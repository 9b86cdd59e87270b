// Bindings of the names of tracks in a few frames, as in a stream.
#include <nanobind/stl/pair.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <cmath>
#include <tuple>
#include <utility>
#include <vector>

#include "naming/measured_neighbours.hpp"
#include "naming/name_window.hpp"
#include "naming/window_scores.hpp"
#include "python/arrays.hpp"
#include "python/bindings.hpp"

using namespace nb::literals;
using namespace asterism;

namespace {

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

void bind_name_windows(nb::module_& module) {
  module.def("window_scores", &scores_in_window, "points"_a, nb::kw_only(), "rows"_a, "holder"_a, "neighbours"_a,
             "distances"_a, "variances"_a, "weights"_a);
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
}
