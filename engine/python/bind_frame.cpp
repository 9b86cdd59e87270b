// The trackers that decide frame by frame, and what carries their hidden tracks.
#include <nanobind/stl/optional.h>
#include <nanobind/stl/tuple.h>

#include <optional>
#include <tuple>

#include "frame/frame_tracker.hpp"
#include "frame/joint_tracker.hpp"
#include "python/bindings.hpp"
#include "python/motion_arrays.hpp"
#include "python/tracker_face.hpp"
#include "rigid/carrier.hpp"

using namespace nb::literals;
using namespace asterism;

namespace {

std::vector<Seen> to_seen(const In<std::int64_t>& markers, const In<double>& points, int D) {
  const std::vector<Point> at = to_points(points, D);
  require(markers.ndim() == 1 && markers.size() == at.size(), "markers: one for each point");
  std::vector<Seen> seen;
  for (std::size_t k = 0; k < at.size(); ++k) {
    const std::int64_t marker = markers.data()[k];
    require(marker >= 0 && marker < std::int64_t{1} << 30, "markers: 0 to 2^30");
    require(k == 0 || markers.data()[k - 1] < marker, "markers: rising");
    seen.push_back({static_cast<std::int32_t>(marker), at[k]});
  }
  return seen;
}

// (place, its variance, how many neighbours carry it) or None.
std::optional<std::tuple<Out<double>, double, std::int32_t>> carry(BodyCarrier& self,
                                                                    std::int64_t marker,
                                                                    const In<std::int64_t>& markers,
                                                                    const In<double>& points) {
  require(marker >= 0 && marker < std::int64_t{1} << 30, "marker: 0 to 2^30");
  Places places;
  places.clear();
  for (const Seen& one : to_seen(markers, points, self.n_axes())) places.set(one.marker, one.at);
  Carriage found;
  if (!self.carry(static_cast<std::int32_t>(marker), places, found)) return std::nullopt;
  const auto D = static_cast<std::size_t>(self.n_axes());
  Owned<double> at(D);
  std::copy_n(found.place.at.begin(), D, at.data.get());
  return std::tuple(at.give({D}), found.place.variance, found.n_neighbours);
}

}  // namespace

void bind_frame(nb::module_& module) {
  nb::class_<BodyCarrier>(module, "BodyCarrier")
      .def(
          "__init__",
          [](BodyCarrier* self, int n_axes, double noise_sigma) {
            require(n_axes == 2 || n_axes == 3, "n_axes: 2 or 3");
            require(noise_sigma > 0, "noise_sigma: above 0");
            new (self) BodyCarrier(n_axes, noise_sigma * noise_sigma);
          },
          nb::kw_only(), "n_axes"_a, "noise_sigma"_a)
      .def(
          "see",
          [](BodyCarrier& self, const In<std::int64_t>& markers, const In<double>& points) {
            self.see(to_seen(markers, points, self.n_axes()));
          },
          "markers"_a, "points"_a)
      .def("carry", &carry, "marker"_a, "markers"_a, "points"_a)
      .def(
          "n_bonds",
          [](const BodyCarrier& self, std::int32_t marker) { return self.n_bonds(marker); },
          "marker"_a)
      .def(
          "forget", [](BodyCarrier& self, std::int32_t marker) { self.forget(marker); },
          "marker"_a);

  bind_tracker<FrameTracker>(module, "FrameTracker")
      .def(
          "__init__",
          [](FrameTracker* self, const MotionModel& model, const ScoreModel& score,
             const LifeOptions& life, Pairing pairing, bool is_strict, std::int32_t capacity,
             double merged_within, const CarryOptions& carry) {
            require(capacity >= 1 && capacity <= 64, "capacity: 1 to 64");
            require(!(is_strict && carry.is_on), "carry: not where is_strict");
            new (self) FrameTracker(
                model, score, life,
                {pairing, is_strict, capacity, merged_within, carry});
          },
          "model"_a, "score"_a, "life"_a, nb::kw_only(), "pairing"_a, "is_strict"_a, "capacity"_a,
          "merged_within"_a, "carry"_a);

  nb::class_<JointStats, FrameStats>(module, "JointStats")
      .def_ro("n_beams", &JointStats::n_beams)
      .def_ro("n_states", &JointStats::n_states)
      .def_ro("n_unguarded", &JointStats::n_unguarded)
      .def_ro("bound", &JointStats::bound);

  bind_tracker<JointTracker>(module, "JointTracker")
      .def(
          "__init__",
          [](JointTracker* self, const MotionModel& model, const ScoreModel& score,
             const LifeOptions& life, std::int64_t max_states, bool is_guarded,
             bool is_sure_until_gap, const CarryOptions& carry) {
            require(max_states >= 1 && max_states <= std::int64_t{1} << 30,
                    "max_states: 1 to 2^30");
            new (self) JointTracker(model, score, life,
                                    {max_states, is_guarded, is_sure_until_gap, carry});
          },
          "model"_a, "score"_a, "life"_a, nb::kw_only(), "max_states"_a, "is_guarded"_a,
          "is_sure_until_gap"_a, "carry"_a);
}
