// Bindings of the MCMC trackers, for one motion model and for several.
#include <nanobind/stl/function.h>
#include <nanobind/stl/tuple.h>

#include <optional>

#include "mcmc/tracker/mcmc_tracker.hpp"
#include "python/bindings.hpp"
#include "python/motion_arrays.hpp"
#include "python/tracker_face.hpp"

using namespace nb::literals;
using namespace asterism;

namespace {

// Runs over all frames that a tracker has processed, and writes its labels. The GIL is held only in
// calls of `goes_on(fraction done)`. An exception in `goes_on` ends the run.
template <typename Tracker>
void finish(Tracker& tracker, Labels labels, Confidence confidence,
            const std::function<bool(double)>& goes_on) {
  const Labeller label = labeller(tracker, labels, confidence, tracker.so_far().n_seen);
  std::optional<nb::python_error> raised;
  {
    nb::gil_scoped_release release;
    tracker.finish(label, [&](double share) {
      nb::gil_scoped_acquire acquire;
      try {
        if (PyErr_CheckSignals() != 0) throw nb::python_error();
        return goes_on(share);
      } catch (nb::python_error& error) {
        raised.emplace(std::move(error));
        return false;
      }
    });
  }
  if (raised) throw std::move(*raised);
}

template <typename Filter>
void bind_mcmc_tracker(nb::module_& module, const char* name) {
  using Tracker = McmcTracker<Filter>;
  bind_tracker<Tracker>(module, name)
      .def(
          "__init__",
          [](Tracker* self, const MotionModel& model, const ScoreModel& score,
             const ChainOptions& chain, const McmcOptions& options, std::uint64_t seed) {
            require((model.M == 1) == std::is_same_v<Filter, OneMotion>, "model: as many motions");
            new (self) Tracker(model, score, chain, options, seed);
          },
          "model"_a, "score"_a, "chain"_a, "options"_a, "seed"_a)
      .def("start_from",
           [](Tracker& self, const In<std::int64_t>& labels, const SharedAcceleration* shared) {
             for (const std::int64_t label : flat(labels))
               require(shared == nullptr || label < static_cast<std::int64_t>(shared->size()),
                       "shared: as many markers as labels");
             self.start_from({labels.data(), labels.data() + labels.size()},
                             shared == nullptr ? nullptr : std::make_shared<const SharedAcceleration>(*shared));
           },
           "labels"_a, "shared"_a.none() = nb::none())
      .def("finish", &finish<Tracker>, "labels"_a.noconvert(), "confidence"_a.noconvert(),
           "goes_on"_a);
}

}  // namespace

void bind_mcmc(nb::module_& module) {
  nb::class_<ChainStats>(module, "ChainStats")
      .def_ro("n_search", &ChainStats::n_search)
      .def_ro("n_sampled", &ChainStats::n_sampled)
      .def_ro("n_walked", &ChainStats::n_walked)
      .def_ro("n_sure", &ChainStats::n_sure)
      .def_ro("n_cut", &ChainStats::n_cut)
      .def_ro("n_given", &ChainStats::n_given)
      .def_ro("n_refused", &ChainStats::n_refused)
      .def_ro("n_disagreements", &ChainStats::n_disagreements)
      .def_ro("n_unmoved", &ChainStats::n_unmoved)
      .def_ro("rhat", &ChainStats::rhat)
      .def_ro("ess", &ChainStats::ess)
      // (drawn, possible, taken) of each kind of move.
      .def_prop_ro("moves", [](const ChainStats& self) {
        std::vector<std::int64_t> counts;
        for (const MoveCounts& of : self.moves)
          counts.insert(counts.end(), {of.n_drawn, of.n_possible, of.n_taken});
        return array_of<std::int64_t>(counts, {kMoves, 3});
      }, nb::rv_policy::move);
  nb::class_<SampledStats, FrameStats>(module, "SampledStats")
      .def_ro("chain", &SampledStats::chain);

  nb::enum_<SplitBy>(module, "SplitBy")
      .value("whole", SplitBy::whole)
      .value("likelihood", SplitBy::likelihood)
      .value("cells", SplitBy::cells)
      .value("clusters", SplitBy::clusters);

  nb::class_<McmcOptions>(module, "McmcOptions")
      .def(
          "__init__",
          [](McmcOptions* self, std::int32_t window, bool is_whole, std::int32_t block,
             double moves, double deadline, bool has_assignment, double confidence,
             std::int32_t chains, std::int32_t threads, SplitBy split_by,
             double ambiguous_within, double distance, std::int32_t bonds, double tolerance) {
            require(window >= 1 && block >= 1, "window and block: at least 1");
            require(chains >= 1 && threads >= 1, "chains and threads: at least 1");
            require(bonds == 0 || (bonds >= 2 && bonds <= 4), "bonds: 0, 2, 3 or 4");
            new (self) McmcOptions{
                window,     is_whole, block,   moves,   deadline, has_assignment,
                confidence, chains,   threads, {split_by, ambiguous_within, distance},
                {bonds, window, tolerance}};
          },
          nb::kw_only(), "window"_a, "is_whole"_a, "block"_a, "moves"_a, "deadline"_a,
          "has_assignment"_a, "confidence"_a, "chains"_a, "threads"_a, "split_by"_a,
          "ambiguous_within"_a, "distance"_a, "bonds"_a, "tolerance"_a);

  nb::class_<ChainOptions>(module, "ChainOptions")
      .def(
          "__init__",
          [](ChainOptions* self, const In<double>& weights, bool is_informed, double stop,
             double floor, bool has_first_rules, bool is_ascent, double share_at_ambiguous,
             bool is_draw) {
            require(weights.ndim() == 1 && weights.size() == kMoves, "weights: one for each move");
            new (self) ChainOptions{
                {is_informed, stop, floor}, {}, has_first_rules, is_ascent, share_at_ambiguous,
                is_draw};
            std::copy_n(weights.data(), kMoves, self->weights.begin());
          },
          nb::kw_only(), "weights"_a, "is_informed"_a, "stop"_a, "floor"_a, "has_first_rules"_a,
          "is_ascent"_a, "share_at_ambiguous"_a = 0.0, "is_draw"_a = false);

  bind_mcmc_tracker<OneMotion>(module, "OneMotionTracker");
  bind_mcmc_tracker<SeveralMotions>(module, "SeveralMotionsTracker");
}
