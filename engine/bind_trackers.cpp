// The trackers that take a frame at a time, as Python sees them: one face for all.
#include <nanobind/stl/tuple.h>

#include <map>

#include "bindings.hpp"
#include "forest.hpp"
#include "frame_tracker.hpp"
#include "hypothesis_forest.hpp"
#include "hypothesis_matrix.hpp"
#include "joint_tracker.hpp"
#include "mcmc_tracker.hpp"
#include "motion_arrays.hpp"
#include "tree_tracker.hpp"

using namespace nb::literals;
using namespace asterism;

namespace {

using Labels = nb::ndarray<std::int64_t, nb::numpy, nb::c_contig, nb::device::cpu>;
using Confidence = nb::ndarray<double, nb::numpy, nb::c_contig, nb::device::cpu>;

// One frame on a copy of the state: (new state, labels, their confidence, earlier detections whose
// label changes, their labels, their confidence, stats). Without confidence its arrays are empty.
template <typename Tracker>
nb::tuple step(const Tracker& before, double time, const In<double>& F, const In<double>& Q,
               const In<double>& points) {
  const MotionModel& m = before.motion();
  const std::size_t size = static_cast<std::size_t>(m.M) * m.axis.n * m.axis.n;
  require(F.size() == size && Q.size() == size, "F and Q: shape (modes, n, n)");
  Tracker after(before);
  const std::vector<Point> frame = to_points(points, m.axis.D);
  const MotionStep motion = motion_step(m, F.data(), Q.data());
  const std::size_t n = frame.size(), n_sure = before.has_confidence() ? n : 0;
  Owned<std::int64_t> labels(n);
  Owned<double> confidence(n_sure);
  std::fill_n(labels.data.get(), n, -1);
  struct Revision {
    std::int64_t detection, id;
    double confidence;
  };
  std::vector<Revision> revised;
  const std::int64_t first = before.n_seen();
  FrameStats stats;
  {
    nb::gil_scoped_release release;
    stats = after.step(time, motion, frame, [&](std::int64_t detection, std::int64_t id, double p) {
      if (detection < first) {
        revised.push_back({detection, id, p});
        return;
      }
      labels.data[detection - first] = id;
      if (n_sure > 0) confidence.data[detection - first] = p;
    });
  }
  const std::size_t r = revised.size(), r_sure = before.has_confidence() ? r : 0;
  Owned<std::int64_t> which(r), ids(r);
  Owned<double> sure(r_sure);
  for (std::size_t i = 0; i < r; ++i) {
    which.data[i] = revised[i].detection;
    ids.data[i] = revised[i].id;
    if (r_sure > 0) sure.data[i] = revised[i].confidence;
  }
  return nb::make_tuple(std::move(after), labels.give({n}), confidence.give({n_sure}),
                        which.give({r}), ids.give({r}), sure.give({r_sure}), stats);
}

// Many frames in place. `labels` covers every detection since the state began; so does `confidence`
// where the tracker has any.
template <typename Tracker>
void run(Tracker& tracker, const In<double>& times, const In<std::int32_t>& kind,
         const In<double>& F, const In<double>& Q, const In<std::int64_t>& offsets,
         const In<double>& points, Labels labels, Confidence confidence) {
  const MotionModel& m = tracker.motion();
  const Timeline line = timeline(m, times, kind, F, Q);
  const std::vector<Point> all = to_points(points, m.axis.D);
  const std::size_t T = line.times.size();
  require(offsets.ndim() == 1 && offsets.shape(0) == T + 1, "offsets: shape (T + 1,)");
  require(T == 0 || line.kind[0] >= 0, "kind: an index into F");
  for (std::size_t t = 0; t <= T; ++t)
    require(offsets.data()[t] >= 0 && offsets.data()[t] <= static_cast<std::int64_t>(all.size()) &&
                (t == 0 || offsets.data()[t] >= offsets.data()[t - 1]),
            "offsets: rising, within the points");
  const std::int64_t n_seen =
      tracker.n_seen() + (T == 0 ? 0 : offsets.data()[T] - offsets.data()[0]);
  require(static_cast<std::int64_t>(labels.size()) >= n_seen,
          "labels: one for every detection so far");
  require(!tracker.has_confidence() || static_cast<std::int64_t>(confidence.size()) >= n_seen,
          "confidence: one for every detection so far");
  nb::gil_scoped_release release;
  const auto label = [&](std::int64_t detection, std::int64_t id, double p) {
    labels.data()[detection] = id;
    if (tracker.has_confidence()) confidence.data()[detection] = p;
  };
  for (std::size_t t = 0; t < T; ++t) {
    const auto frame = std::span(all).subspan(offsets.data()[t],
                                              offsets.data()[t + 1] - offsets.data()[t]);
    if constexpr (requires { tracker.end_pass(label); })
      tracker.pass(line.times[t], line.step(t), frame, label);
    else
      tracker.step(line.times[t], line.step(t), frame, label);
  }
  if constexpr (requires { tracker.end_pass(label); }) tracker.end_pass(label);
}

// What a live display needs of the believed tracks: (ids, gaps, log odds that they exist, means and
// covariances of the state).
template <typename Tracker>
nb::tuple tracks(const Tracker& tracker) {
  const MotionModel& m = tracker.motion();
  const auto& live = tracker.live();
  std::size_t K = 0;
  for (const auto& t : live.tracks) K += t.is_confirmed();
  const std::size_t D = m.axis.D, n = m.axis.n;
  Owned<std::int64_t> ids(K), gaps(K);
  Owned<double> scores(K), means(K * D * n), covariances(K * n * n);
  std::size_t k = 0;
  for (const auto& t : live.tracks) {
    if (!t.is_confirmed()) continue;
    ids.data[k] = t.id;
    gaps.data[k] = t.gap;
    scores.data[k] = t.score;
    const AxisState state = collapse(m, t.state);
    for (std::size_t d = 0; d < D; ++d)
      std::copy_n(state.x[d].begin(), n, means.data.get() + (k * D + d) * n);
    std::copy_n(state.P.begin(), n * n, covariances.data.get() + k * n * n);
    ++k;
  }
  return nb::make_tuple(ids.give({K}), gaps.give({K}), scores.give({K}), means.give({K, D, n}),
                        covariances.give({K, n, n}));
}

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

// A Python function that chooses: (first option of each tree, worths, first use of each option, uses,
// first resource of each frame) to (option of each tree, bound of the sum of worths). Trackers are
// copied and dropped without the GIL, so the function is held once and let go with it.
class PythonPacker {
 public:
  explicit PythonPacker(nb::object choose) : choose_(std::move(choose)) {}
  PythonPacker(const PythonPacker&) = delete;
  PythonPacker& operator=(const PythonPacker&) = delete;
  ~PythonPacker() {
    nb::gil_scoped_acquire acquire;
    choose_.reset();
  }

  std::vector<std::int32_t> operator()(std::span<const std::vector<PackingOption>> trees,
                                       std::span<const std::int32_t> first_resource,
                                       FrameStats& stats) const {
    std::size_t n_options = 0, n_uses = 0;
    for (const auto& options : trees)
      for (const PackingOption& option : options) {
        ++n_options;
        n_uses += option.uses.size();
      }
    nb::gil_scoped_acquire acquire;
    Owned<std::int64_t> first_option(trees.size() + 1), first_use(n_options + 1);
    Owned<double> worths(n_options);
    Owned<std::int32_t> uses(n_uses), resources(first_resource.size());
    std::copy(first_resource.begin(), first_resource.end(), resources.data.get());
    std::size_t o = 0, u = 0;
    for (std::size_t i = 0; i < trees.size(); ++i) {
      for (const PackingOption& option : trees[i]) {
        worths.data[o] = option.worth;
        for (const std::int32_t r : option.uses) uses.data[u++] = r;
        first_use.data[++o] = static_cast<std::int64_t>(u);
      }
      first_option.data[i + 1] = static_cast<std::int64_t>(o);
    }
    const nb::tuple out = nb::cast<nb::tuple>(
        choose_(first_option.give({trees.size() + 1}), worths.give({n_options}),
                first_use.give({n_options + 1}), uses.give({n_uses}),
                resources.give({first_resource.size()})));
    const auto own = nb::cast<In<std::int32_t>>(out[0]);
    require(own.size() == trees.size(), "an option for every tree");
    double value = 0;
    for (std::size_t i = 0; i < trees.size(); ++i) {
      const std::int32_t k = own.data()[i];
      require(k >= 0 && k < static_cast<std::int32_t>(trees[i].size()), "options of the trees");
      value += trees[i][k].worth;
    }
    const double gap = nb::cast<double>(out[1]) - value;
    stats.gap = std::max(stats.gap, gap > 1e-6 ? gap : 0.0);
    stats.n_beams += gap > 1e-6;
    return {own.data(), own.data() + own.size()};
  }

 private:
  nb::object choose_;
};

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

template <typename Tracker>
nb::class_<Tracker> bind(nb::module_& module, const char* name) {
  return nb::class_<Tracker>(module, name)
      .def("step", &step<Tracker>, "time"_a, "F"_a, "Q"_a, "points"_a)
      .def("run", &run<Tracker>, "times"_a, "kind"_a, "F"_a, "Q"_a, "offsets"_a, "points"_a,
           "labels"_a.noconvert(), "confidence"_a.noconvert())
      .def("copy", [](const Tracker& self) { return Tracker(self); })
      .def("tracks", &tracks<Tracker>)
      .def_prop_ro("has_confidence", &Tracker::has_confidence)
      .def_prop_ro("n_frames", &Tracker::n_frames)
      .def_prop_ro("n_seen", &Tracker::n_seen)
      .def_prop_ro("n_ids", [](const Tracker& self) { return self.n_ids(); })
      .def_prop_ro("last_time", &Tracker::last_time)
      .def_prop_ro("total", [](const Tracker& self) { return self.total(); });
}

template <typename Filter>
void bind_mcmc(nb::module_& module, const char* name) {
  using Tracker = McmcTracker<Filter>;
  bind<Tracker>(module, name)
      .def(
          "__init__",
          [](Tracker* self, const MotionModel& model, const ScoreModel& score,
             const ChainOptions& chain, std::int32_t window, double moves, double deadline,
             bool has_assignment, std::uint64_t seed) {
            require(window >= 1, "window: at least 1");
            require((model.M == 1) == std::is_same_v<Filter, OneMotion>, "model: as many motions");
            new (self) Tracker(model, score, chain,
                               {window, moves, deadline, has_assignment}, seed);
          },
          "model"_a, "score"_a, "chain"_a, nb::kw_only(), "window"_a, "moves"_a, "deadline"_a, "has_assignment"_a, "seed"_a);
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
      .def_ro("n_moves", &FrameStats::n_moves)
      .def_ro("n_taken", &FrameStats::n_taken);

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
             double floor, bool has_first_rules, bool is_ascent) {
            require(weights.ndim() == 1 && weights.size() == kMoves, "weights: one for each move");
            new (self) ChainOptions{{is_informed, stop, floor}, {}, has_first_rules, is_ascent};
            std::copy_n(weights.data(), kMoves, self->weights.begin());
          },
          nb::kw_only(), "weights"_a, "is_informed"_a, "stop"_a, "floor"_a, "has_first_rules"_a,
          "is_ascent"_a);

  bind<FrameTracker>(module, "FrameTracker")
      .def(
          "__init__",
          [](FrameTracker* self, const MotionModel& model, const ScoreModel& score,
             const LifeOptions& life, std::int32_t matcher, bool is_strict, std::int32_t capacity,
             double merged_within) {
            require(capacity >= 1 && capacity <= 64, "capacity: 1 to 64");
            require(matcher >= 0 && matcher <= 2, "matcher: 0, 1 or 2");
            new (self) FrameTracker(
                model, score, life,
                {static_cast<Matcher>(matcher), is_strict, capacity, merged_within});
          },
          "model"_a, "score"_a, "life"_a, nb::kw_only(), "matcher"_a, "is_strict"_a, "capacity"_a,
          "merged_within"_a);

  bind<JointTracker>(module, "JointTracker")
      .def(
          "__init__",
          [](JointTracker* self, const MotionModel& model, const ScoreModel& score,
             const LifeOptions& life, std::int64_t max_states, bool is_guarded,
             bool is_sure_until_gap) {
            require(max_states >= 1 && max_states <= std::int64_t{1} << 30,
                    "max_states: 1 to 2^30");
            new (self) JointTracker(model, score, life, {max_states, is_guarded, is_sure_until_gap});
          },
          "model"_a, "score"_a, "life"_a, nb::kw_only(), "max_states"_a, "is_guarded"_a,
          "is_sure_until_gap"_a);

  nb::class_<BranchOptions>(module, "BranchOptions")
      .def(
          "__init__",
          [](BranchOptions* self, std::int32_t window, std::int32_t max_branches,
             std::int32_t merge_last, double prune_drop, double fading, const In<double>& delta,
             double z) {
            require(window >= 1 && window <= kMaxWindow, "window: 1 to 16");
            require(max_branches >= 1 && merge_last >= 1, "max_branches, merge_last: at least 1");
            new (self) BranchOptions{window, max_branches, merge_last, prune_drop, fading,
                                     {delta.data(), delta.data() + delta.size()}, z, false, {}};
          },
          nb::kw_only(), "window"_a, "max_branches"_a, "merge_last"_a, "prune_drop"_a, "fading"_a,
          "delta"_a, "z"_a);

  bind<TreeTracker<Forest>>(module, "TreeTracker")
      .def("chi2", &chi2)
      .def(
          "__init__",
          [](TreeTracker<Forest>* self, const MotionModel& model, const ScoreModel& score,
             const LifeOptions& life, const BranchOptions& branches, std::int32_t resolver,
             bool is_independent) {
            require(resolver >= 0 && resolver <= 2, "resolver: 0, 1 or 2");
            new (self) TreeTracker<Forest>(Forest(
                model, score, life, branches, {static_cast<Resolver>(resolver), is_independent}));
          },
          "model"_a, "score"_a, "life"_a, "branches"_a, nb::kw_only(), "resolver"_a,
          "is_independent"_a);

  bind<TreeTracker<HypothesisForest>>(module, "HypothesisTracker")
      .def(
          "__init__",
          [](TreeTracker<HypothesisForest>* self, const MotionModel& model, const ScoreModel& score,
             const LifeOptions& life, BranchOptions branches, std::int64_t max_hypotheses,
             std::int64_t max_nodes, double new_track_claim, nb::object choose) {
            require(max_hypotheses >= 1 && max_nodes >= 1, "limits: at least 1");
            const double least_new_worth = -branches.prune_drop;
            const double drop = std::max(branches.prune_drop, 25.0);
            make_joint(branches, score);
            Packer packer;
            if (!choose.is_none())
              packer = [shared = std::make_shared<const PythonPacker>(std::move(choose))](
                           std::span<const std::vector<PackingOption>> trees,
                           std::span<const std::int32_t> first_resource,
                           FrameStats& stats) { return (*shared)(trees, first_resource, stats); };
            new (self) TreeTracker<HypothesisForest>(
                HypothesisForest(model, score, life, branches, new_track_claim,
                                 {max_hypotheses, max_nodes, least_new_worth, drop,
                                  std::move(packer)}));
          },
          "model"_a, "score"_a, "life"_a, "branches"_a, nb::kw_only(), "max_hypotheses"_a,
          "max_nodes"_a, "new_track_claim"_a, "choose"_a = nb::none());

  bind<TreeTracker<HypothesisMatrix>>(module, "MatrixTracker")
      .def("clusters", &clusters)
      .def(
          "__init__",
          [](TreeTracker<HypothesisMatrix>* self, const MotionModel& model, const ScoreModel& score,
             const LifeOptions& life, BranchOptions branches, std::int64_t max_hypotheses,
             double merged_within, double new_track_claim) {
            require(max_hypotheses >= 1, "max_hypotheses: at least 1");
            const double drop = branches.prune_drop;
            make_joint(branches, score);
            new (self) TreeTracker<HypothesisMatrix>(
                HypothesisMatrix(model, score, life, branches, new_track_claim,
                                 {max_hypotheses, drop, merged_within}));
          },
          "model"_a, "score"_a, "life"_a, "branches"_a, nb::kw_only(), "max_hypotheses"_a,
          "merged_within"_a, "new_track_claim"_a);

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
