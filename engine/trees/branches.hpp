// Track hypotheses as branches of a tree. In each frame of an undecided window, a branch is split
// into one branch per gated detection and one for a missed detection.
//
//   λ(k) = ρ λ(k-1) + e²    e² = νᵀ S⁻¹ ν of the k-th detection, ρ fading factor (1: none)
//   δ(k)                    a branch is kept while λ(k) ≤ δ(k); P[λ(k) > δ(k)] = α for a true track
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <vector>

#include "filter/nis.hpp"
#include "rigid/carried_state.hpp"
#include "tracks/live_tracks.hpp"
#include "trees/tree_stats.hpp"

namespace asterism {

inline constexpr int kMaxWindow = 16;

struct BranchOptions {
  std::int32_t window = 1;        // frames until one is decided
  std::int32_t max_branches = 1;  // of a track
  // Branches with the same detections in this many last frames are merged.
  std::int32_t merge_last = 1;
  double prune_drop = 0;          // a branch is pruned this many nats below the best of its tree
  double fading = 1;              // ρ
  std::vector<double> delta;      // δ(1), δ(2), …; empty: no test
  bool has_test() const { return !delta.empty(); }
  double z = 0;                   // normal quantile of α, for δ beyond those if ρ is 1
  // Whether tracks are evaluated jointly. The gain of a branch is then its term of the log
  // posterior, and conflicts between tracks are resolved by the joint choice instead of by claims.
  bool is_joint = false;
  // For joint evaluation: log probability of no further detection in so many frames.
  std::vector<double> log_end;
  std::int32_t max_carried = 0;  // frames for which neighbours may predict an occluded track
};

// The association weight with which a confirmed track expects a detection: w_j / (w_0 + Σ_{l≠j}
// w_l), where w_j = P_d N(y_j; ŷ, S) / λ_f and w_0 = 1 - P_d, with P_r for P_d after a missed
// detection. If another track takes the detection, the likelihood of the frame falls by the factor
// 1 + value.
struct Claim {
  std::int64_t track = 0;  // key of the track
  std::int32_t column = 0;
  double value = 0;
};

// An undecided frame. It is immutable, so that copies of a tracker share it.
struct WindowFrame {
  std::int64_t number = 0, first = 0;  // of the frame; of its first detection
  double time = 0;
  MotionStep step;
  std::vector<Point> points;
  PointGrid grid;
  std::vector<Claim> claims;    // ordered by track
  std::vector<double> claimed;  // by all tracks, for each detection
  std::vector<NeighbourAdvice> advice;   // ordered by track, only tracks that have any

  // The loss of log likelihood if a track takes a detection that other tracks expect, applied until
  // the frame is decided. It is exact for two tracks. With more, each is treated as if it were the
  // only other one (linear multitarget, Musicki & La Scala 2008).
  double crowding(std::int64_t track, std::int32_t column) const {
    double others = claimed[column];
    auto at = std::lower_bound(claims.begin(), claims.end(), track,
                               [](const Claim& c, std::int64_t key) { return c.track < key; });
    for (; at != claims.end() && at->track == track; ++at)
      if (at->column == column) others -= at->value;
    return std::log1p(std::max(others, 0.0));
  }

  const NeighbourAdvice* advice_to(std::int64_t track) const {
    const auto at = std::ranges::lower_bound(advice, track, {}, &NeighbourAdvice::track);
    return at != advice.end() && at->track == track ? &*at : nullptr;
  }
  double bond_gains(std::int64_t track, std::int32_t column) const {
    const NeighbourAdvice* own = advice_to(track);
    return own == nullptr ? 0 : own->of(column);
  }
};

struct Branch {
  // The last frame: the prediction for it, by its number in the tree, and the detection taken, which
  // is `last`, with the likelihoods from that prediction. Most branches are pruned before the next
  // frame, so the update with the detection is computed on demand.
  std::int32_t prediction = 0;
  bool is_detected = false;
  std::array<double, kMaxModes> each{};
  double log_likelihood = 0;
  double score = 0;  // as in LiveTrack
  double lambda = 0;
  std::int64_t n_updates = 0;
  double last_time = 0;
  Point last{};
  std::int32_t gap = 0, carried = 0;  // as in LiveTrack
  std::int32_t n_taken = 0;           // detections within the window
  bool has_ended = false;
  bool is_chosen = false;  // in the last joint choice
  // The detection in each frame of the window, -1 for a missed detection. The index is the frame
  // number modulo the longest window.
  std::array<std::int32_t, kMaxWindow> path{};
  // Its squared distance from the prediction, by the same index. Joint evaluation does not read the
  // distances. They are then left out, because branches are copied often.
  std::vector<double> distance2;

  std::int32_t taken(std::int64_t frame) const { return path[frame % kMaxWindow]; }
  std::int32_t unpredicted() const { return gap - carried; }
};

// The tree of a track: λ up to the last decided frame, and the branches from there on.
struct Tree {
  std::int64_t key = 0;    // number in order of initiation
  std::int64_t first = 0;  // first frame, while that is undecided
  double lambda = 0;
  std::int64_t n_updates = 0;
  std::vector<Branch> branches;
  // States predicted for the newest frame, one for each branch that it had before. They change in
  // that frame only, so that copies of the tree share them afterwards.
  std::shared_ptr<std::vector<MotionState>> predicted;

  // Begins with one branch in a given state.
  void plant(const MotionState& state, Branch branch) {
    predicted = std::make_shared<std::vector<MotionState>>(1, state);
    branches.assign(1, std::move(branch));
  }
  const MotionState& predicted_of(const Branch& b) const { return (*predicted)[b.prediction]; }
  // The state of a branch after its last frame.
  MotionState state_of(const MotionModel& m, const Branch& b) const {
    MotionState state = predicted_of(b);
    if (b.is_detected) update(m, b.each, b.log_likelihood, b.last, state);
    return state;
  }
  // Predicts all branches for the next frame.
  void advance(const MotionModel& m, const MotionStep& step) {
    auto next = std::make_shared<std::vector<MotionState>>();
    next->reserve(branches.size());
    for (Branch& b : branches) {
      if (b.has_ended) continue;
      MotionState& state = next->emplace_back(predicted_of(b));
      if (b.is_detected) update(m, b.each, b.log_likelihood, b.last, state);
      predict(m, step, state);
      b.prediction = static_cast<std::int32_t>(next->size()) - 1;
      b.is_detected = false;
    }
    predicted = std::move(next);
  }

  // The branch of the last joint choice if there is one, else the most likely branch.
  const Branch& best() const {
    const auto chosen = std::ranges::find(branches, true, &Branch::is_chosen);
    return chosen == branches.end() ? branches.front() : *chosen;
  }
};

class BranchGrower {
 public:
  BranchGrower(const LiveTracks<Tree>& live, const BranchOptions& options)
      : live_(live), opt_(options) {}

  // Score by which the branches of a tree are compared while the track is alive: that of the branch
  // minus the gain that its detections would have if left unassigned.
  double rank(const Branch& b) const { return b.score - b.n_taken * live_.leftover_gain(); }

  // Log-likelihood ratio of a branch. In joint evaluation it is the branch's term of the posterior,
  // where trailing missed detections also allow for the end of the track.
  double log_ratio(const Branch& b) const {
    if (!opt_.is_joint) return rank(b);
    return b.score - live_.misses_gain(0, b.unpredicted()) + opt_.log_end[b.unpredicted()];
  }

  // Begins the tree of a track with one branch, for its decided part.
  void plant(LiveTrack<Tree>& track) const {
    Branch b;
    b.score = track.score;
    b.lambda = track.more.lambda;
    b.n_updates = track.more.n_updates;
    b.last_time = track.last_time;
    b.last = track.last;
    b.gap = track.gap;
    b.carried = track.carried;
    if (!opt_.is_joint) b.distance2.assign(kMaxWindow, 0);
    track.more.plant(track.state, std::move(b));
  }

  // Splits every branch over a further frame, the n_open-th undecided one, for which the tree has
  // been advanced. Then prunes to at most
  // `max_branches`; kAll keeps all.
  static constexpr std::int32_t kAll = std::numeric_limits<std::int32_t>::max();
  void grow(const WindowFrame& frame, LiveTrack<Tree>& track, std::int32_t n_open,
            std::int32_t max_branches, TreeStats& stats) {
    grown_.clear();
    for (Branch& parent : track.more.branches)
      split(frame, track, parent, grown_, stats);
    prune(frame.number, n_open, max_branches, stats);
    track.more.branches.clear();
    track.more.branches.reserve(kept_.size());
    for (const std::int32_t b : kept_) track.more.branches.push_back(std::move(grown_[b]));
  }

  // Prediction for a track missed in the last `gap` frames. Its state must be predicted to the
  // frame.
  Expected expected(const MotionState& state, std::int32_t gap, const NeighbourAdvice* advice) const {
    const bool is_predicted = advice != nullptr && advice->is_carried && gap > 0;
    return Expected(live_.m, state, is_predicted ? &advice->place : nullptr);
  }
  // Whether a track without a detection is kept alive by the prediction from its neighbours. Such a
  // frame counts as occluded and does not change the probability that the marker still exists.
  bool lives_on(const Expected& expected, std::int32_t gap, const NeighbourAdvice* advice) const {
    return expected.is_carried() && !advice->is_uncertain && gap < opt_.max_carried;
  }

  // Adds the continuations of a branch in a further frame: one for each detection in its gate, then
  // the missed detection, into which the branch itself turns. The branch is moved from.
  void split(const WindowFrame& frame, LiveTrack<Tree>& track, Branch& parent,
             std::vector<Branch>& out, TreeStats& stats) const {
    const std::int64_t slot = frame.number % kMaxWindow;
    parent.path[slot] = -1;
    if (!opt_.is_joint) parent.distance2[slot] = 0;
    if (parent.has_ended) {
      if (opt_.is_joint) {  // one more missed frame
        parent.score += live_.miss_gain(parent.unpredicted());
        ++parent.gap;
      }
      out.push_back(std::move(parent));
      return;
    }
    const NeighbourAdvice* advice = frame.advice_to(track.more.key);
    const Expected all = expected(track.more.predicted_of(parent), parent.gap, advice);
    const double hit = live_.hit_gain(parent.gap), miss = live_.miss_gain(parent.gap);
    const double min_log_likelihood =
        track.is_confirmed() ? miss + live_.leftover_gain() - hit - opt_.prune_drop
                    : -std::numeric_limits<double>::infinity();
    const auto child_with = [&](std::int32_t j, double d2) {
      const Point& y = frame.points[j];
      ++stats.n_candidates;
      const Prediction& prediction = all.of(y);
      const double lambda = next_lambda(parent.lambda, prediction, y);
      if (!passes(lambda, parent.n_updates + 1)) {
        ++stats.n_cut;
        return;
      }
      std::array<double, kMaxModes> each{};
      const double log_likelihood = prediction.log_likelihood(y, each);
      const double hit_gain = hit + log_likelihood;
      if (!std::isfinite(hit_gain)) return;
      Branch& child = out.emplace_back(parent);  // branches are large, so it is not copied again
      if (all.is_carried()) {
        std::vector<MotionState>& states = *track.more.predicted;
        MotionState chosen = states[parent.prediction];
        all.choose(y, chosen);
        child.prediction = static_cast<std::int32_t>(states.size());
        states.push_back(chosen);
      }
      child.is_detected = true;
      child.each = each;
      child.log_likelihood = log_likelihood;
      child.score += opt_.is_joint ? hit_gain : hit_gain - frame.crowding(track.more.key, j);
      if (advice != nullptr) child.score += advice->of(j);
      child.lambda = lambda;
      ++child.n_updates;
      ++child.n_taken;
      child.last = y;
      child.last_time = frame.time;
      child.gap = child.carried = 0;
      child.path[slot] = j;
      if (!opt_.is_joint) child.distance2[slot] = d2;
    };
    const bool is_reappearance = advice != nullptr && advice->is_reappearance;
    if (all.is_carried()) {
      for (const std::int32_t j : advice->may_take)
        child_with(j, squared_distance(frame.points[j], all.of(frame.points[j]).center,
                                       live_.m.axis.D));
    } else if (!is_reappearance) {
      const Prediction& own = all.prediction();
      live_.within_gate(frame.grid, frame.points, own,
                        own.radius(live_.opt.gate, min_log_likelihood, frame.grid.max_r()),
                        parent.last, frame.time - parent.last_time, child_with);
    }
    if (static_cast<std::int64_t>(out.size()) > live_.opt.max_candidates) throw CandidateLimit("too many candidates in a frame");
    if (lives_on(all, parent.gap, advice))
      ++parent.carried;
    else
      parent.score += miss;
    ++parent.gap;
    parent.has_ended = is_reappearance || parent.unpredicted() >= live_.sm.max_gap;
    out.push_back(std::move(parent));
  }

  // Adds the claims of a track's best branch on the detections of the next frame, for which its tree
  // has been advanced.
  void claim(const LiveTrack<Tree>& track, WindowFrame& frame) {
    const Branch& best = track.more.branches.front();
    if (best.has_ended) return;
    const NeighbourAdvice* advice = frame.advice_to(track.more.key);
    if (advice != nullptr && advice->is_reappearance) return;
    const Expected all = expected(track.more.predicted_of(best), best.gap, advice);
    const Prediction& prediction = all.prediction();
    const double log_hit = live_.sm.log_hit(best.gap) - live_.sm.log_clutter;
    // Smaller weights are negligible against clutter.
    const double radius = prediction.radius(live_.opt.gate, kNoClaim - log_hit,
                                             frame.grid.max_r());
    if (radius < 0 && !all.is_carried()) return;
    std::array<double, kMaxModes> each{};
    const std::size_t first = frame.claims.size();
    const auto weigh = [&](std::int32_t j, double) {
      const Point& y = frame.points[j];
      const double log_w = log_hit + all.of(y).log_likelihood(y, each);
      if (log_w > kNoClaim && log_w < 700) frame.claims.push_back({track.more.key, j, std::exp(log_w)});
    };
    if (all.is_carried())
      for (const std::int32_t j : advice->may_take) weigh(j, 0);
    else
      frame.grid.within(prediction.center, radius, weigh);
    weights_.clear();
    for (std::size_t c = first; c < frame.claims.size(); ++c)
      weights_.push_back(frame.claims[c].value);
    for (std::size_t c = 0; c < weights_.size(); ++c) {
      double others = std::exp(live_.sm.log_missed(best.gap));
      for (std::size_t l = 0; l < weights_.size(); ++l)
        if (l != c) others += weights_[l];
      Claim& claim = frame.claims[first + c];
      claim.value = weights_[c] / others;
      frame.claimed[claim.column] += claim.value;
    }
  }

  // λ after a further detection; 0 without a test.
  double next_lambda(double lambda, const Prediction& prediction, const Point& y) const {
    return opt_.has_test() ? opt_.fading * lambda + nis(prediction, y) : 0;
  }
  bool passes(double lambda, std::int64_t n_updates) const {
    if (!opt_.has_test()) return true;
    const auto k = static_cast<std::size_t>(n_updates);
    if (k <= opt_.delta.size()) return lambda <= opt_.delta[k - 1];
    if (opt_.fading < 1) return lambda <= opt_.delta.back();
    // Approximation of Wilson & Hilferty 1931; with thousands of degrees of freedom accurate to
    // seven digits.
    const double v = 2.0 / (9.0 * static_cast<double>(k) * live_.m.axis.D);
    const double root = 1 - v + opt_.z * std::sqrt(v);
    return lambda <= 2.0 / (9.0 * v) * root * root * root;
  }

 private:
  static constexpr double kNoClaim = -7;  // log of w

  void prune(std::int64_t frame, std::int32_t n_open, std::int32_t max_branches, TreeStats& stats) {
    ranked_.clear();  // branches are large, so their ranks are sorted
    for (std::size_t b = 0; b < grown_.size(); ++b)
      ranked_.emplace_back(-rank(grown_[b]), static_cast<std::int32_t>(b));
    std::ranges::sort(ranked_);
    const double min_rank = max_branches == kAll ? -std::numeric_limits<double>::infinity()
                                              : -ranked_.front().first - opt_.prune_drop;
    kept_.clear();
    for (const auto& [negated, b] : ranked_) {
      if (-negated < min_rank) break;
      if (n_open > opt_.merge_last && is_merged(grown_[b], frame)) continue;
      if (kept_.size() == static_cast<std::size_t>(max_branches)) {
        ++stats.n_limited;
        continue;
      }
      kept_.push_back(b);
    }
    stats.peak_branches = std::max(stats.peak_branches, static_cast<std::int64_t>(kept_.size()));
  }

  // Whether a more likely branch has the same detections in the last frames.
  bool is_merged(const Branch& branch, std::int64_t frame) const {
    for (const std::int32_t a : kept_) {
      bool is_same = true;
      for (std::int32_t k = 0; k < opt_.merge_last && is_same; ++k)
        is_same = grown_[a].taken(frame - k) == branch.taken(frame - k);
      if (is_same) return true;
    }
    return false;
  }

  const LiveTracks<Tree>& live_;
  const BranchOptions& opt_;
  std::vector<Branch> grown_;
  std::vector<std::pair<double, std::int32_t>> ranked_;
  std::vector<std::int32_t> kept_;  // indices of the branches that remain, best first
  std::vector<double> weights_;
};

}  // namespace asterism
