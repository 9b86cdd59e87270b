// Bindings of the trackers with hypothesis trees: track splitting, TOMHT and MHT.
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

// Returns λ of the confirmed tracks and its number of detections, in the order of `tracks`; nothing
// without a χ² test.
nb::dict chi2(const TreeTracker<Forest>& tracker) {
  nb::dict out;
  if (!tracker.forest().has_test()) return out;
  const auto tracks = confirmed(tracker.live());
  out["chi2"] = array_of<double>(tracks, [](const auto* t) { return t->more.lambda; });
  out["updates"] = array_of<std::int64_t>(tracks, [](const auto* t) { return t->more.n_updates; });
  return out;
}

// The window of undecided frames for joint hypotheses.
HypothesisWindow joint_window(const MotionModel& model, const ScoreModel& score,
                              const LifeOptions& life, BranchOptions branches,
                              const CarryOptions& carry, double new_track_claim) {
  branches.is_joint = true;
  branches.log_end = log_end_table(score, score.max_gap + kMaxWindow);
  // A branch may be this much less likely than another and still be better than ending the track
  // and initiating a new one.
  branches.prune_drop += std::max(score.log_clutter - score.log_birth - score.log_detect, 0.0) -
                         std::log(score.p_disappear);
  return {{model, score, life, branches, carry}, new_track_claim};
}

// Returns for each cluster: numbers of its trees, open detections that they may take, the tree that
// has each detection by hypothesis (-1 for none), log weights.
nb::list clusters(const TreeTracker<HypothesisMatrix>& tracker) {
  const HypothesisWindow& window = tracker.forest().window();
  std::map<std::int64_t, std::size_t> index_of;
  for (std::size_t i = 0; i < window.n_all(); ++i) index_of[window.tree(i).more.key] = i;
  nb::list out;
  for (const Cluster& cluster : tracker.forest().clusters()) {
    const std::size_t n = cluster.keys.size(), H = cluster.hypotheses.size();
    // For each detection, the tree that has it in each hypothesis.
    std::map<std::int64_t, std::vector<std::int64_t>> owners;
    for (std::size_t h = 0; h < H; ++h)
      for (std::size_t k = 0; k < n; ++k) {
        const std::int32_t b = cluster.hypotheses[h].branches[k];
        const std::size_t i = index_of.at(cluster.keys[k]);
        if (b < 0) continue;
        const Branch& branch = window.tree(i).more.branches[b];
        window.each_detection(i, branch, [&](std::int64_t detection) {
          std::vector<std::int64_t>& own =
              owners.try_emplace(window.frames.front()->first + detection, H, -1).first->second;
          if (!window.is_lone(i, branch)) own[h] = cluster.keys[k];
        });
      }
    std::vector<std::int64_t> origins;
    for (std::size_t h = 0; h < H; ++h)
      for (const auto& [detection, keys] : owners) origins.push_back(keys[h]);
    const auto first = [](const auto& owner) { return owner.first; };
    out.append(nb::make_tuple(
        array_of<std::int64_t>(cluster.keys), array_of<std::int64_t>(owners, first),
        array_of<std::int64_t>(origins, {H, owners.size()}),
        array_of<double>(cluster.hypotheses, &Hypothesis::log_weight)));
  }
  return out;
}

}  // namespace

void bind_trees(nb::module_& module) {
  nb::class_<TreeStats, FrameStats>(module, "TreeStats")
      .def_ro("n_branches", &TreeStats::n_branches)
      .def_ro("peak_branches", &TreeStats::peak_branches)
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
             const LifeOptions& life, const BranchOptions& branches, Pairing pairing,
             bool is_independent, const CarryOptions& carry) {
            require(!(is_independent && carry.is_on), "carry: not where is_independent");
            new (self) TreeTracker<Forest>(
                Forest({model, score, life, branches, carry}, {pairing, is_independent}));
          },
          "model"_a, "score"_a, "life"_a, "branches"_a, nb::kw_only(), "pairing"_a,
          "is_independent"_a, "carry"_a);

  bind_tracker<TreeTracker<HypothesisForest>>(module, "HypothesisTracker")
      .def(
          "__init__",
          [](TreeTracker<HypothesisForest>* self, const MotionModel& model, const ScoreModel& score,
             LifeOptions life, const BranchOptions& branches, std::int64_t max_hypotheses,
             std::int64_t max_nodes, double new_track_claim, const CarryOptions& carry,
             nb::object choose) {
            require(max_hypotheses >= 1 && max_nodes >= 1, "limits: at least 1");
            const double drop = branches.prune_drop;
            // A tentative track is judged by its branches, and not by its decided part.
            const double delete_drop =
                std::exchange(life.delete_drop, std::numeric_limits<double>::infinity());
            Packer packer;
            if (!choose.is_none())
              packer = [shared = std::make_shared<const PythonPacker>(std::move(choose))](
                           std::span<const std::vector<PackingOption>> trees,
                           std::span<const std::int32_t> first_resource,
                           TreeStats& stats) { return (*shared)(trees, first_resource, stats); };
            new (self) TreeTracker<HypothesisForest>(
                HypothesisForest(joint_window(model, score, life, branches, carry, new_track_claim),
                                 {max_hypotheses, max_nodes, -drop, delete_drop,
                                  std::max(drop, 25.0), drop, std::move(packer)}));
          },
          "model"_a, "score"_a, "life"_a, "branches"_a, nb::kw_only(), "max_hypotheses"_a,
          "max_nodes"_a, "new_track_claim"_a, "carry"_a, "choose"_a = nb::none());

  bind_tracker<TreeTracker<HypothesisMatrix>>(module, "MatrixTracker")
      .def("clusters", &clusters)
      .def(
          "__init__",
          [](TreeTracker<HypothesisMatrix>* self, const MotionModel& model, const ScoreModel& score,
             const LifeOptions& life, const BranchOptions& branches, std::int64_t max_hypotheses,
             double merged_within, double new_track_claim, const CarryOptions& carry) {
            require(max_hypotheses >= 1, "max_hypotheses: at least 1");
            new (self) TreeTracker<HypothesisMatrix>(
                HypothesisMatrix(joint_window(model, score, life, branches, carry, new_track_claim),
                                 {max_hypotheses, branches.prune_drop, merged_within}));
          },
          "model"_a, "score"_a, "life"_a, "branches"_a, nb::kw_only(), "max_hypotheses"_a,
          "merged_within"_a, "new_track_claim"_a, "carry"_a);
}
