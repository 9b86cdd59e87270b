// Bindings of the options and the statistics that all trackers share.
#include <algorithm>

#include "python/bindings.hpp"
#include "frame/marriage_market.hpp"
#include "python/motion_arrays.hpp"
#include "python/tracker_face.hpp"
#include "tracks/carried_tracks.hpp"
#include "tracks/live_tracks.hpp"
#include "trees/branches.hpp"

using namespace nb::literals;
using namespace asterism;

void bind_options(nb::module_& module) {
  nb::class_<FrameStats>(module, "FrameStats")
      .def_ro("n_candidates", &FrameStats::n_candidates)
      .def_ro("n_groups", &FrameStats::n_groups)
      .def_ro("largest_group", &FrameStats::largest_group)
      .def_ro("n_confirmed", &FrameStats::n_confirmed)
      .def_ro("n_tentative", &FrameStats::n_tentative)
      .def_ro("n_pending", &FrameStats::n_pending)
      .def_ro("n_carried", &FrameStats::n_carried)
      .def_ro("n_returned", &FrameStats::n_returned)
      .def_ro("n_refused", &FrameStats::n_refused);

  nb::class_<LifeOptions>(module, "LifeOptions")
      .def(nb::init<double, double, double, std::int64_t>(), nb::kw_only(), "gate"_a,
           "confirm_score"_a, "delete_drop"_a, "max_candidates"_a);

  nb::class_<BranchOptions>(module, "BranchOptions")
      .def(
          "__init__",
          [](BranchOptions* self, std::int32_t window, std::int32_t max_branches,
             std::int32_t merge_last, double prune_drop, double fading, const In<double>& delta,
             double z) {
            require(window >= 1 && window <= kMaxWindow, "window: 1 to 16");
            require(max_branches >= 1 && merge_last >= 1, "max_branches, merge_last: at least 1");
            const std::span<const double> bounds = flat(delta);
            new (self) BranchOptions{window, max_branches, merge_last, prune_drop, fading,
                                     {bounds.begin(), bounds.end()}, z, false, {}, 0};
          },
          nb::kw_only(), "window"_a, "max_branches"_a, "merge_last"_a, "prune_drop"_a, "fading"_a,
          "delta"_a, "z"_a);

  nb::class_<CarryOptions>(module, "CarryOptions")
      .def(nb::init<bool, std::int32_t>(), nb::kw_only(), "is_on"_a = false,
           "max_carried"_a = 0);

  nb::enum_<Pairing>(module, "Pairing")
      .value("assignment", Pairing::assignment)
      .value("tracks_propose", Pairing::tracks_propose)
      .value("detections_propose", Pairing::detections_propose);


  nb::exception<CandidateLimit>(module, "CandidateLimit");
}
