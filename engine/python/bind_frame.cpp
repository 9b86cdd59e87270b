// Bindings of the trackers with one decision per frame.
#include "frame/frame_tracker.hpp"
#include "frame/joint_tracker.hpp"
#include "python/bindings.hpp"
#include "python/motion_arrays.hpp"
#include "python/tracker_face.hpp"

using namespace nb::literals;
using namespace asterism;

void bind_frame(nb::module_& module) {
  bind_tracker<FrameTracker>(module, "FrameTracker")
      .def(
          "__init__",
          [](FrameTracker* self, const MotionModel& model, const ScoreModel& score,
             const LifeOptions& life, Pairing pairing, bool is_strict, std::int32_t capacity,
             double merged_within, const CarryOptions& carry) {
            require(capacity >= 1 && capacity <= 64, "capacity: 1 to 64");
            require(!(is_strict && carry.is_on), "carry: not where is_strict");
            new (self) FrameTracker(model, score, life,
                                    {pairing, is_strict, capacity, merged_within}, carry);
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
                                    {max_states, is_guarded, is_sure_until_gap}, carry);
          },
          "model"_a, "score"_a, "life"_a, nb::kw_only(), "max_states"_a, "is_guarded"_a,
          "is_sure_until_gap"_a, "carry"_a);
}
