// The trackers as Python sees them: how each is made, and what it alone can tell.
#include <nanobind/stl/function.h>
#include <nanobind/stl/tuple.h>

#include <map>

#include "bindings.hpp"
#include "forest.hpp"
#include "hypothesis_forest.hpp"
#include "hypothesis_matrix.hpp"
#include "mcmc_tracker.hpp"
#include "motion_arrays.hpp"
#include "python_packer.hpp"
#include "tracker_face.hpp"
#include "tree_tracker.hpp"

using namespace nb::literals;
using namespace asterism;

namespace {

// λ of the believed tracks and the number of detections in it, in the order of `tracks`.
nb::tuple chi2(const TreeTracker<Forest>& tracker) {
  std::size_t K = 0;
  for (const auto& t : tracker.live().tracks) K += t.is_confirmed();
  Owned<double> lambda(K);
  Owned<std::int64_t> n_updates(K);
  std::size_t k = 0;
  for (const auto& t : tracker.live().tracks) {
    if (!t.is_confirmed()) continue;
    lambda.data[k] = t.more.lambda;
    n_updates.data[k++] = t.more.n_updates;
  }
  return nb::make_tuple(lambda.give({K}), n_updates.give({K}));
}

// Branches that are worth their part of the log posterior.
void make_joint(BranchOptions& branches, const ScoreModel& score) {
  branches.is_joint = true;
  branches.log_end = log_end_table(score, score.max_gap + kMaxWindow);
  // A way on may be so much worse than another and still better than to lose the marker and to begin
  // a new one.
  branches.prune_drop += std::max(score.log_clutter - score.log_birth - score.log_detect, 0.0) -
                         std::log(score.p_disappear);
}

// Of each cluster (numbers of its trees, detections of the open frames that they may have, by
// hypothesis and detection the tree that has it or -1, log weights).
nb::list clusters(const TreeTracker<HypothesisMatrix>& tracker) {
  const HypothesisWindow& window = tracker.forest().window();
  std::map<std::int64_t, std::size_t> index_of;
  for (std::size_t i = 0; i < window.n_all(); ++i) index_of[window.tree(i).more.key] = i;
  nb::list out;
  for (const Cluster& cluster : tracker.forest().clusters()) {
    const std::size_t n = cluster.keys.size(), H = cluster.hypotheses.size();
    std::map<std::int64_t, std::size_t> place;  // of a detection
    std::vector<std::map<std::int64_t, std::int64_t>> owners(H);
    for (std::size_t h = 0; h < H; ++h)
      for (std::size_t k = 0; k < n; ++k) {
        const std::int32_t b = cluster.hypotheses[h].branches[k];
        const std::size_t i = index_of.at(cluster.keys[k]);
        if (b < 0) continue;
        const Branch& branch = window.tree(i).more.branches[b];
        for (const auto& frame : window.frames) {
          const std::int32_t j = branch.taken(frame->number);
          if (frame->number < window.first_frame(i) || j < 0) continue;
          place[frame->first + j] = 0;
          const bool is_lone = window.is_seed(i) && branch.n_taken < 2;
          owners[h][frame->first + j] = is_lone ? -1 : cluster.keys[k];
        }
      }
    std::size_t p = 0;
    for (auto& [detection, at] : place) at = p++;
    Owned<std::int64_t> keys(n), detections(p), origins(H * p);
    Owned<double> log_weights(H);
    std::copy(cluster.keys.begin(), cluster.keys.end(), keys.data.get());
    for (const auto& [detection, at] : place) detections.data[at] = detection;
    std::fill_n(origins.data.get(), H * p, -1);
    for (std::size_t h = 0; h < H; ++h) {
      log_weights.data[h] = cluster.hypotheses[h].log_weight();
      for (const auto& [detection, key] : owners[h])
        origins.data[h * p + place.at(detection)] = key;
    }
    out.append(nb::make_tuple(keys.give({n}), detections.give({p}), origins.give({H, p}),
                              log_weights.give({H})));
  }
  return out;
}

// Walks over all that a tracker has seen, and writes its labels. Between two calls of `goes_on`, with
// the share that is done, no Python runs; what it raises ends the walk.
template <typename Tracker>
void finish(Tracker& tracker, Labels labels, Confidence confidence,
            const std::function<bool(double)>& goes_on) {
  require(static_cast<std::int64_t>(labels.size()) >= tracker.n_seen(),
          "labels: one for every detection so far");
  require(!tracker.has_confidence() ||
              static_cast<std::int64_t>(confidence.size()) >= tracker.n_seen(),
          "confidence: one for every detection so far");
  std::optional<nb::python_error> raised;
  {
    nb::gil_scoped_release release;
    tracker.finish(
        [&](std::int64_t detection, std::int64_t id, double p) {
          labels.data()[detection] = id;
          if (tracker.has_confidence()) confidence.data()[detection] = p;
        },
        [&](double share) {
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
void bind_mcmc(nb::module_& module, const char* name) {
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
           [](Tracker& self, const In<std::int64_t>& labels) {
             self.start_from({labels.data(), labels.data() + labels.size()});
           },
           "labels"_a)
      .def("finish", &finish<Tracker>, "labels"_a.noconvert(), "confidence"_a.noconvert(),
           "goes_on"_a);
}

}  // namespace

void bind_trackers(nb::module_& module) {
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
      .def_ro("chain", &FrameStats::chain)
      .def_ro("n_bonds", &FrameStats::n_bonds)
      .def_ro("bond_score", &FrameStats::bond_score)
      .def_ro("n_carried", &FrameStats::n_carried)
      .def_ro("n_returned", &FrameStats::n_returned)
      .def_ro("n_refused", &FrameStats::n_refused);

  nb::class_<ChainStats>(module, "ChainStats")
      .def_ro("n_search", &ChainStats::n_search)
      .def_ro("n_sampled", &ChainStats::n_sampled)
      .def_ro("n_walked", &ChainStats::n_walked)
      .def_ro("n_sure", &ChainStats::n_sure)
      .def_ro("n_cut", &ChainStats::n_cut)
      .def_ro("n_given", &ChainStats::n_given)
      .def_ro("n_refused", &ChainStats::n_refused)
      .def_ro("n_doubtful", &ChainStats::n_doubtful)
      .def_ro("rhat", &ChainStats::rhat)
      .def_ro("ess", &ChainStats::ess)
      // (drawn, possible, taken) of each kind of move.
      .def_prop_ro("moves", [](const ChainStats& self) {
        Owned<std::int64_t> out(kMoves * 3);
        for (int k = 0; k < kMoves; ++k) {
          out.data[3 * k] = self.moves[k].n_drawn;
          out.data[3 * k + 1] = self.moves[k].n_possible;
          out.data[3 * k + 2] = self.moves[k].n_taken;
        }
        return out.give({kMoves, 3});
      }, nb::rv_policy::move);

  nb::class_<McmcOptions>(module, "McmcOptions")
      .def(
          "__init__",
          [](McmcOptions* self, std::int32_t window, bool is_whole, double moves, double deadline,
             bool has_assignment, double confidence, std::int32_t chains, std::int32_t threads,
             std::int32_t split_by, double doubt, double distance, std::int32_t bonds,
             double tolerance, double bond_weight) {
            require(window >= 1, "window: at least 1");
            require(chains >= 1 && threads >= 1, "chains and threads: at least 1");
            require(split_by >= 0 && split_by <= 3, "split_by: 0 to 3");
            require(bond_weight >= 0, "bond_weight: at least 0");
            require(bonds == 0 || (bonds >= 2 && bonds <= 4), "bonds: 0, 2, 3 or 4");
            new (self) McmcOptions{
                window,     is_whole, moves,   deadline, has_assignment,
                confidence, chains,   threads, {static_cast<SplitBy>(split_by), doubt, distance},
                {bonds, window, tolerance}, bond_weight};
          },
          nb::kw_only(), "window"_a, "is_whole"_a, "moves"_a, "deadline"_a, "has_assignment"_a,
          "confidence"_a, "chains"_a, "threads"_a, "split_by"_a, "doubt"_a, "distance"_a, "bonds"_a, "tolerance"_a,
          "bond_weight"_a);

  nb::class_<LifeOptions>(module, "LifeOptions")
      .def(
          "__init__",
          [](LifeOptions* self, double gate, double confirm_score, double delete_drop,
             std::int64_t max_candidates) {
            new (self) LifeOptions{gate, confirm_score, delete_drop, max_candidates};
          },
          nb::kw_only(), "gate"_a, "confirm_score"_a, "delete_drop"_a, "max_candidates"_a);

  nb::class_<ChainOptions>(module, "ChainOptions")
      .def(
          "__init__",
          [](ChainOptions* self, const In<double>& weights, bool is_informed, double stop,
             double floor, bool has_first_rules, bool is_ascent, double share_at_doubts,
             bool is_draw) {
            require(weights.ndim() == 1 && weights.size() == kMoves, "weights: one for each move");
            new (self) ChainOptions{
                {is_informed, stop, floor}, {}, has_first_rules, is_ascent, share_at_doubts, is_draw};
            std::copy_n(weights.data(), kMoves, self->weights.begin());
          },
          nb::kw_only(), "weights"_a, "is_informed"_a, "stop"_a, "floor"_a, "has_first_rules"_a,
          "is_ascent"_a, "share_at_doubts"_a = 0.0, "is_draw"_a = false);

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

  bind_tracker<TreeTracker<Forest>>(module, "TreeTracker")
      .def("chi2", &chi2)
      .def(
          "__init__",
          [](TreeTracker<Forest>* self, const MotionModel& model, const ScoreModel& score,
             const LifeOptions& life, BranchOptions branches, std::int32_t resolver,
             bool is_independent, const CarryOptions& carry) {
            require(resolver >= 0 && resolver <= 2, "resolver: 0, 1 or 2");
            require(!(is_independent && carry.is_on), "carry: not where is_independent");
            branches.max_carried = carry.max_carried;
            new (self) TreeTracker<Forest>(
                Forest(model, score, life, branches, carry,
                       {static_cast<Resolver>(resolver), is_independent}));
          },
          "model"_a, "score"_a, "life"_a, "branches"_a, nb::kw_only(), "resolver"_a,
          "is_independent"_a, "carry"_a);

  bind_tracker<TreeTracker<HypothesisForest>>(module, "HypothesisTracker")
      .def(
          "__init__",
          [](TreeTracker<HypothesisForest>* self, const MotionModel& model, const ScoreModel& score,
             const LifeOptions& life, BranchOptions branches, std::int64_t max_hypotheses,
             std::int64_t max_nodes, double new_track_claim, const CarryOptions& carry,
             nb::object choose) {
            require(max_hypotheses >= 1 && max_nodes >= 1, "limits: at least 1");
            const double least_new_worth = -branches.prune_drop;
            const double drop = std::max(branches.prune_drop, 25.0);
            make_joint(branches, score);
            branches.max_carried = carry.max_carried;
            Packer packer;
            if (!choose.is_none())
              packer = [shared = std::make_shared<const PythonPacker>(std::move(choose))](
                           std::span<const std::vector<PackingOption>> trees,
                           std::span<const std::int32_t> first_resource,
                           FrameStats& stats) { return (*shared)(trees, first_resource, stats); };
            new (self) TreeTracker<HypothesisForest>(
                HypothesisForest(model, score, life, branches, carry, new_track_claim,
                                 {max_hypotheses, max_nodes, least_new_worth, drop,
                                  std::move(packer)}));
          },
          "model"_a, "score"_a, "life"_a, "branches"_a, nb::kw_only(), "max_hypotheses"_a,
          "max_nodes"_a, "new_track_claim"_a, "carry"_a, "choose"_a = nb::none());

  bind_tracker<TreeTracker<HypothesisMatrix>>(module, "MatrixTracker")
      .def("clusters", &clusters)
      .def(
          "__init__",
          [](TreeTracker<HypothesisMatrix>* self, const MotionModel& model, const ScoreModel& score,
             const LifeOptions& life, BranchOptions branches, std::int64_t max_hypotheses,
             double merged_within, double new_track_claim, const CarryOptions& carry) {
            require(max_hypotheses >= 1, "max_hypotheses: at least 1");
            const double drop = branches.prune_drop;
            make_joint(branches, score);
            branches.max_carried = carry.max_carried;
            new (self) TreeTracker<HypothesisMatrix>(
                HypothesisMatrix(model, score, life, branches, carry, new_track_claim,
                                 {max_hypotheses, drop, merged_within}));
          },
          "model"_a, "score"_a, "life"_a, "branches"_a, nb::kw_only(), "max_hypotheses"_a,
          "merged_within"_a, "new_track_claim"_a, "carry"_a);

  bind_mcmc<OneMotion>(module, "OneMotionTracker");
  bind_mcmc<SeveralMotions>(module, "SeveralMotionsTracker");

  nb::register_exception_translator([](const std::exception_ptr& p, void*) {
    try {
      std::rethrow_exception(p);
    } catch (const CandidateLimit&) {
      PyErr_SetString(PyExc_OverflowError, "too many candidates in a frame");
    }
  });
}
