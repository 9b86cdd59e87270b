// What every tracker is told, and what it tells of a frame.
#include <algorithm>

#include "python/bindings.hpp"
#include "python/motion_arrays.hpp"
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
      .def_ro("n_beams", &FrameStats::n_beams)
      .def_ro("n_states", &FrameStats::n_states)
      .def_ro("n_unguarded", &FrameStats::n_unguarded)
      .def_ro("bound", &FrameStats::bound)
      .def_ro("n_branches", &FrameStats::n_branches)
      .def_ro("most_branches", &FrameStats::most_branches)
      .def_ro("n_cut", &FrameStats::n_cut)
      .def_ro("n_limited", &FrameStats::n_limited)
      .def_ro("n_shared", &FrameStats::n_shared)
      .def_ro("n_hypotheses", &FrameStats::n_hypotheses)
      .def_ro("n_nodes", &FrameStats::n_nodes)
      .def_ro("gap", &FrameStats::gap)
      .def_ro("n_merged", &FrameStats::n_merged)
      .def_ro("n_bonds", &FrameStats::n_bonds)
      .def_ro("n_carried", &FrameStats::n_carried)
      .def_ro("n_returned", &FrameStats::n_returned)
      .def_ro("n_refused", &FrameStats::n_refused);

  nb::class_<LifeOptions>(module, "LifeOptions")
      .def(
          "__init__",
          [](LifeOptions* self, double gate, double confirm_score, double delete_drop,
             std::int64_t max_candidates) {
            new (self) LifeOptions{gate, confirm_score, delete_drop, max_candidates};
          },
          nb::kw_only(), "gate"_a, "confirm_score"_a, "delete_drop"_a, "max_candidates"_a);

  nb::class_<BranchOptions>(module, "BranchOptions")
      .def(
          "__init__",
          [](BranchOptions* self, std::int32_t window, std::int32_t max_branches,
             std::int32_t merge_last, double prune_drop, double fading, const In<double>& delta,
             double z) {
            require(window >= 1 && window <= kMaxWindow, "window: 1 to 16");
            require(max_branches >= 1 && merge_last >= 1, "max_branches, merge_last: at least 1");
            new (self) BranchOptions{window, max_branches, merge_last, prune_drop, fading,
                                     {delta.data(), delta.data() + delta.size()}, z, false, {}, 0};
          },
          nb::kw_only(), "window"_a, "max_branches"_a, "merge_last"_a, "prune_drop"_a, "fading"_a,
          "delta"_a, "z"_a);

  nb::class_<CarryOptions>(module, "CarryOptions")
      .def(
          "__init__",
          [](CarryOptions* self, bool is_on, std::int32_t max_carried, double bond_weight) {
            require(max_carried >= 0 && bond_weight >= 0, "options of bodies: at least 0");
            new (self) CarryOptions{is_on, max_carried, bond_weight};
          },
          nb::kw_only(), "is_on"_a = false, "max_carried"_a = 0, "bond_weight"_a = 0.0);

  nb::register_exception_translator([](const std::exception_ptr& p, void*) {
    try {
      std::rethrow_exception(p);
    } catch (const CandidateLimit&) {
      PyErr_SetString(PyExc_OverflowError, "too many candidates in a frame");
    }
  });
}
