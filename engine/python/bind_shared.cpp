// Bindings of the density of markers that accelerate together.
#include <nanobind/stl/tuple.h>

#include <algorithm>
#include <limits>
#include <utility>
#include <vector>

#include "filter/track_filter.hpp"
#include "python/arrays.hpp"
#include "python/bindings.hpp"
#include "python/motion_arrays.hpp"
#include "rigid/marker_places.hpp"
#include "rigid/shared_acceleration.hpp"

using namespace nb::literals;
using namespace asterism;

namespace {

constexpr std::size_t kShared = SharedAcceleration::kComponents;

Point point_of(const In<double>& array, std::size_t row) {
  Point out{};
  std::copy_n(array.data() + row * array.shape(1), array.shape(1), out.begin());
  return out;
}

// The bonds of marker k are those from offsets[k] to offsets[k + 1], by increasing variance.
void make_shared_acceleration(SharedAcceleration* self, const In<std::int64_t>& offsets,
                              const In<std::int32_t>& others, const In<double>& distances,
                              const In<double>& variances, const In<double>& shape,
                              const In<double>& own_shape, const In<double>& log_weights,
                              const In<double>& log_begin_weights, double volume) {
  const std::size_t n = others.size();
  require(offsets.ndim() == 1, "offsets: shape (K + 1,)");
  require_offsets(flat(offsets), n, "offsets: rising, within the bonds");
  require(distances.size() == n && variances.size() == n, "distances and variances: shape (B,)");
  const std::size_t K = offsets.size() - 1;
  require(own_shape.ndim() == 2 && own_shape.shape(0) == K &&
              (own_shape.shape(1) == 2 || own_shape.shape(1) == 3),
          "own_shape: shape (K, 2 or 3)");
  require(shape.ndim() == 2 && shape.shape(0) == n && shape.shape(1) == own_shape.shape(1),
          "shape: shape (B, D)");
  for (const In<double>* each : {&log_weights, &log_begin_weights})
    require(each->ndim() == 2 && each->shape(0) == K && each->shape(1) == kShared,
            "log_weights and log_begin_weights: shape (K, components)");
  require(volume > 0, "volume: > 0");
  std::vector<SharedAcceleration::Marker> markers(K);
  for (std::size_t k = 0; k < K; ++k) {
    SharedAcceleration::Marker& marker = markers[k];
    marker.shape = point_of(own_shape, k);
    std::copy_n(log_weights.data() + k * kShared, kShared, marker.log_weight.begin());
    std::copy_n(log_begin_weights.data() + k * kShared, kShared, marker.log_begin.begin());
    for (auto b = static_cast<std::size_t>(offsets.data()[k]);
         b < static_cast<std::size_t>(offsets.data()[k + 1]); ++b) {
      const std::int32_t other = others.data()[b];
      require(other >= 0 && other < static_cast<std::int64_t>(k), "others: markers before it");
      marker.before.push_back(
          {other, 1 / variances.data()[b], distances.data()[b], point_of(shape, b)});
    }
  }
  new (self) SharedAcceleration(static_cast<int>(own_shape.shape(1)), volume, std::move(markers));
}

// The log densities (N, components) of the detections of tracks, and the predicted positions and
// variances, (N, D + 1). Each track is of a marker, -1 for none, and those of no marker and those
// that are not counted get NaN. The first detection of a track has no predicted position.
nb::tuple shared_densities(const SharedAcceleration& shared, const MotionModel& m,
                             const In<std::int32_t>& markers, const In<bool>& is_counted,
                             const In<double>& points, const In<std::int64_t>& frames,
                             const In<std::int64_t>& offsets, const In<double>& times,
                             const In<std::int32_t>& kind, const In<double>& F,
                             const In<double>& Q) {
  const TrackPoints tracks(points, frames, offsets, m.axis.D, times.size());
  const Timeline line = timeline(m, times, kind, F, Q);
  require(shared.n_axes() == m.axis.D, "shared: as many axes as the model");
  require(markers.size() == tracks.n_tracks(), "markers: one for each track");
  require(is_counted.size() == tracks.n_tracks(), "is_counted: one for each track");
  require_within(flat(markers), -1, static_cast<std::int32_t>(shared.size()), "markers: known ones");
  const auto D = static_cast<std::size_t>(m.axis.D);
  Owned<double> out(tracks.points.size() * kShared), predicted(tracks.points.size() * (D + 1));
  {
    nb::gil_scoped_release release;
    constexpr double none = std::numeric_limits<double>::quiet_NaN();
    std::fill_n(out.data.get(), tracks.points.size() * kShared, none);
    std::fill_n(predicted.data.get(), tracks.points.size() * (D + 1), none);
    const auto n_frames = static_cast<std::int64_t>(times.size());
    MarkerPlaces places;
    places.begin(shared.size(), 0, n_frames);
    for (std::size_t k = 0; k < tracks.n_tracks(); ++k)
      for (std::int64_t i = tracks.offsets[k]; markers.data()[k] >= 0 && i < tracks.offsets[k + 1]; ++i)
        places.add(markers.data()[k], tracks.frames[i], tracks.points[i]);
    SharedAcceleration::Mixture mixture;
    SharedAcceleration::Memory memory;
    for (std::size_t k = 0; k < tracks.n_tracks(); ++k) {
      const auto own = tracks.points_of(k);
      const auto at = tracks.frames_of(k);
      const std::int32_t marker = markers.data()[k];
      if (own.empty() || marker < 0 || !is_counted.data()[k]) continue;
      MotionState state = begin_state(m, own[0]);
      std::ranges::copy(shared.begin_densities(marker, at[0], own[0], m.axis.r, places, memory),
                        out.data.get() + static_cast<std::size_t>(tracks.offsets[k]) * kShared);
      for (std::size_t i = 1; i < own.size(); ++i) {
        for (std::int64_t t = at[i - 1] + 1; t <= at[i]; ++t) predict(m, line.step(t), state);
        const Prediction prediction(m, state);
        shared.predict(PredictionByMode(prediction, m.axis.r),
                       {marker, at[i - 1], at[i], own[i - 1], own[i], i > 1}, places, memory, mixture);
        update(m, prediction, own[i], state);
        const std::size_t row = static_cast<std::size_t>(tracks.offsets[k]) + i;
        std::ranges::copy(shared.densities(mixture, own[i]), out.data.get() + row * kShared);
        const SharedAcceleration::Moments moments = shared.moments(marker, mixture);
        std::copy_n(moments.at.begin(), D, predicted.data.get() + row * (D + 1));
        predicted.data[row * (D + 1) + D] = moments.variance;
      }
    }
  }
  return nb::make_tuple(out.give({tracks.points.size(), kShared}),
                        predicted.give({tracks.points.size(), D + 1}));
}

}  // namespace

void bind_shared(nb::module_& module) {
  nb::class_<SharedAcceleration>(module, "SharedAcceleration")
      .def("__init__", &make_shared_acceleration, nb::kw_only(), "offsets"_a, "others"_a,
           "distances"_a, "variances"_a, "shape"_a, "own_shape"_a, "log_weights"_a,
           "log_begin_weights"_a, "volume"_a);
  module.def("shared_densities", &shared_densities, "shared"_a, "model"_a, "markers"_a,
             "is_counted"_a, "points"_a, "frames"_a, "offsets"_a, "times"_a, "kind"_a, "F"_a, "Q"_a);
}
