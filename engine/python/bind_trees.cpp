// The trackers that keep several futures of a track open: trees, forests of hypotheses, matrices.
#include <nanobind/stl/function.h>
#include <nanobind/stl/tuple.h>

#include <limits>
#include <map>
#include <utility>

#include "mht/reid_mht.hpp"
#include "python/bindings.hpp"
#include "python/motion_arrays.hpp"
#include "python/python_packer.hpp"
#include "python/tracker_face.hpp"
#include "trees/tomht.hpp"
#include "trees/track_splitting.hpp"
#include "trees/tree_tracker.hpp"

using namespace nb::literals;
using namespace asterism;

namespace {

// λ of the believed tracks and the number of detections in it, in the order of `tracks`.
nb::dict chi2(const TreeTracker<Forest>& tracker) {
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
  nb::dict out;
  out["chi2"] = lambda.give({K});
  out["updates"] = n_updates.give({K});
  return out;
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

}  // namespace

// Long, because it is a list: what each class shows to Python.
void bind_trees(nb::module_& module) {
  nb::class_<TreeStats, FrameStats>(module, "TreeStats")
      .def_ro("n_branches", &TreeStats::n_branches)
      .def_ro("most_branches", &TreeStats::most_branches)
      .def_ro("n_cut", &TreeStats::n_cut)
      .def_ro("n_limited", &TreeStats::n_limited)
      .def_ro("n_shared", &TreeStats::n_shared)
      .def_ro("n_beams", &TreeStats::n_beams)
      .def_ro("bound", &TreeStats::bound)
      .def_ro("gap", &TreeStats::gap)
      .def_ro("n_hypotheses", &TreeStats::n_hypotheses)
      .def_ro("n_merged", &TreeStats::n_merged)
      .def_ro("n_nodes", &TreeStats::n_nodes);

  bind_tracker<TreeTracker<Forest>>(module, "TreeTracker")
      .def("chi2", &chi2)
      .def(
          "__init__",
          [](TreeTracker<Forest>* self, const MotionModel& model, const ScoreModel& score,
             const LifeOptions& life, BranchOptions branches, Pairing pairing,
             bool is_independent, const CarryOptions& carry) {
            require(!(is_independent && carry.is_on), "carry: not where is_independent");
            branches.max_carried = carry.max_carried;
            new (self) TreeTracker<Forest>(
                Forest(model, score, life, branches, carry,
                       {pairing, is_independent}));
          },
          "model"_a, "score"_a, "life"_a, "branches"_a, nb::kw_only(), "pairing"_a,
          "is_independent"_a, "carry"_a);

  bind_tracker<TreeTracker<HypothesisForest>>(module, "HypothesisTracker")
      .def(
          "__init__",
          [](TreeTracker<HypothesisForest>* self, const MotionModel& model, const ScoreModel& score,
             LifeOptions life, BranchOptions branches, std::int64_t max_hypotheses,
             std::int64_t max_nodes, double new_track_claim, const CarryOptions& carry,
             nb::object choose) {
            require(max_hypotheses >= 1 && max_nodes >= 1, "limits: at least 1");
            const double least_new_worth = -branches.prune_drop;
            const double drop = std::max(branches.prune_drop, 25.0), ambiguous_drop = branches.prune_drop;
            make_joint(branches, score);
            branches.max_carried = carry.max_carried;
            // A tentative track is judged by its branches, and not by what is decided of it.
            const double delete_drop =
                std::exchange(life.delete_drop, std::numeric_limits<double>::infinity());
            Packer packer;
            if (!choose.is_none())
              packer = [shared = std::make_shared<const PythonPacker>(std::move(choose))](
                           std::span<const std::vector<PackingOption>> trees,
                           std::span<const std::int32_t> first_resource,
                           TreeStats& stats) { return (*shared)(trees, first_resource, stats); };
            new (self) TreeTracker<HypothesisForest>(
                HypothesisForest(model, score, life, branches, carry, new_track_claim,
                                 {max_hypotheses, max_nodes, least_new_worth, delete_drop, drop,
                                  ambiguous_drop, std::move(packer)}));
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
}
