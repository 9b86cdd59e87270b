// Joint integrated probabilistic data association (JIPDA, Musicki & Evans 2004): joint
// probabilistic data association with an existence probability for each track. The life cycle of a
// track is that of tracks/live_tracks.hpp. Its score is the log odds of existence.
//
//   r        existence probability of a track, (1 - p_z) times that of the frame before
//   w_ij     r P_d N(y_j; ŷ_i, S_i) / (λ_f + P_d λ_b)      w_i0 = 1 - r P_d
//   β_ij     marginals of the joint events (solve/joint_events.hpp)
//   r⁺       1 - β_i0 + β_i0 r (1 - P_d) / (1 - r P_d)
//
// P_d is specific to each track: it averages the detection probabilities after a detection and
// after a missed detection, weighted by the probability of either (“Markov chain two” of Musicki,
// Evans & Stankovic 1994).
//
// Confirmed tracks share the detections first. Tentative tracks take remaining detections by the
// most likely event. Their predictions are so uncertain that an average over all detections in the
// gate would be meaningless.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

#include "filter/pda_update.hpp"
#include "frame/frame_pairing.hpp"
#include "solve/best_permutations.hpp"
#include "solve/joint_events.hpp"
#include "tracks/carried_tracks.hpp"
#include "tracks/live_tracks.hpp"

namespace asterism {

struct JointOptions {
  std::int64_t max_states = 1;  // of a layer of the exact sum, and of the beam search beyond
  bool is_guarded = true;       // use the guard against coalescence (solve/best_permutations.hpp)
  // Whether a confirmed track counts as existing until its gap is too long, because occlusions are
  // bursts that P_d does not model. Otherwise its r falls with every missed detection until the
  // track is deleted.
  bool is_sure_until_gap = true;
};

struct JointStats : FrameStats {
  // Groups that were not summed exactly, the bound of their error, the largest number of states,
  // and groups that were too large for the guard against coalescence.
  std::int64_t n_beams = 0, n_states = 0, n_unguarded = 0;
  double bound = 0;

  void add(const JointStats& next) {
    FrameStats::add(next);
    n_beams += next.n_beams;
    n_states = std::max(n_states, next.n_states);
    n_unguarded += next.n_unguarded;
    bound = std::max(bound, next.bound);
  }
};

class JointTracker {
 public:
  JointTracker(const MotionModel& model, const ScoreModel& score, const LifeOptions& life,
               const JointOptions& options, const CarryOptions& carry)
      : live_(model, score, life), opt_(options), carried_(model, score, carry) {}

  // Processes a frame as FrameTracker::step does. Every detection of the frame receives a label; -1
  // comes with the probability that it belongs to no confirmed track.
  template <typename Label>
  JointStats step(double time, const MotionStep& step, std::span<const Point> points, Label&& label) {
    JointStats stats;
    survive();
    find_candidates(time, step, points, stats);
    stats.n_candidates = static_cast<std::int64_t>(s_.candidates.size());
    s_.pairs.begin(live_.size(), points.size());
    s_.match_probability.assign(live_.size(), 0);
    s_.missed.assign(live_.size(), 1);
    s_.free.assign(points.size(), 1);
    share_among_confirmed(points, stats);
    share_among_tentative(points, stats);
    const double p_clutter = 1 - p_new(1);
    for (std::size_t j = 0; j < points.size(); ++j)
      label(live_.so_far.n_seen + static_cast<std::int64_t>(j), -1, s_.free[j] * p_clutter);
    update_tracks(time, points, stats, label);
    begin_tracks(time, points);
    carried_.learn(live_);
    live_.count(stats);
    live_.so_far.add(time, points.size());
    total_.add(stats);
    return stats;
  }

  bool has_confidence() const { return true; }
  const MotionModel& motion() const { return live_.m; }
  std::int64_t n_ids() const { return live_.next_id; }
  const LiveTracks<>& live() const { return live_; }
  const Progress& so_far() const { return live_.so_far; }
  const JointStats& total() const { return total_; }

 private:
  struct Memory {
    std::vector<Candidate> candidates, eligible;
    std::vector<double> offsets;  // gain of a pairing minus its log likelihood, by track
    std::vector<double> gains, marginals, log_miss, all_missed;
    std::vector<std::int32_t> best;  // by track
    std::vector<double> match_probability, missed;
    std::vector<double> free;  // probability that a detection belongs to no track
    FramePairing pairs;
    BestPermutations guard;
    std::vector<double> weights;
    std::vector<WeightedPoint> mixture;
  };

  // Log weight relative to a miss below which a pairing is ignored.
  static constexpr double kNegligible = -20.7;
  // Marginal up to which the links of a large group are cut.
  static constexpr double kNoMarginal = 1e-6;
  static constexpr double kMaxOdds = 700;

  static double probability(double log_odds) { return 1 / (1 + std::exp(-log_odds)); }

  double p_undetected(std::size_t i, double score) const {  // 1 - r P_d
    return probability(-score) + probability(score) * p_miss(i);
  }
  // Miss probability in this frame of a track that exists.
  double p_miss(std::size_t i) const {
    const double missed = live_.tracks[i].p_missed;
    return (1 - missed) * std::exp(live_.sm.log_miss) + missed * std::exp(live_.sm.log_remiss);
  }
  double p_detect(std::size_t i) const { return 1 - p_miss(i); }

  // The log odds of existence that are used in the association.
  double existence(std::size_t i) const {
    const LiveTrack<NoMore>& track = live_.tracks[i];
    const bool is_sure = opt_.is_sure_until_gap && track.is_confirmed();
    return is_sure ? std::max(track.score, live_.opt.confirm_score) : track.score;
  }

  // Probability that a detection initiates a track, if it belongs to no track with probability q.
  double p_new(double q) const {
    const double b = std::exp(live_.birth_gain());
    return q * b / (1 + b);
  }

  void survive() {
    const double log_die = std::log(live_.sm.p_disappear);
    for (LiveTrack<NoMore>& track : live_.tracks) {
      const double log_r = -softplus(-track.score), log_none = -softplus(track.score);
      const double log_died = log_die + log_r;
      const double max_log = std::max(log_none, log_died);
      const double log_gone =
          max_log + std::log(std::exp(log_none - max_log) + std::exp(log_died - max_log));
      track.score = live_.sm.log_survive + log_r - log_gone;
    }
  }

  void find_candidates(double time, const MotionStep& step, std::span<const Point> points,
                       JointStats& stats) {
    const double common = -live_.sm.log_clutter - live_.leftover_gain();
    s_.offsets.clear();
    for (std::size_t i = 0; i < live_.size(); ++i)
      s_.offsets.push_back(common + std::log(p_detect(i)) - softplus(-existence(i)) -
                           std::log(p_undetected(i, existence(i))));
    const auto min_log_likelihood_of = [&](std::size_t i, double gain) {
      return gain - s_.offsets[i];
    };
    const auto gain_of = [&](std::size_t i, double log_likelihood) {
      return s_.offsets[i] + log_likelihood;
    };
    carried_.list(live_, time, step, points, kNegligible, min_log_likelihood_of, gain_of,
                  s_.candidates, stats);
  }

  // Lists the candidates of the confirmed tracks, or those of the tentative ones with the remaining
  // detections.
  void find_eligible(bool confirmed) {
    s_.eligible.clear();
    s_.gains.clear();
    for (Candidate c : s_.candidates) {
      if (live_[c.row].is_confirmed() != confirmed || s_.pairs.is_taken[c.column]) continue;
      c.gain += std::log(s_.free[c.column]);
      if (!(c.gain > kNegligible)) continue;
      s_.eligible.push_back(c);
      s_.gains.push_back(c.gain);
    }
  }

  void share_among_confirmed(std::span<const Point> points, JointStats& stats) {
    find_eligible(true);
    s_.log_miss.assign(live_.size(), 0);
    s_.all_missed.resize(live_.size());
    s_.best.resize(live_.size());
    s_.marginals.resize(s_.eligible.size());
    JointEvents events(s_.eligible, s_.gains, s_.log_miss,
                       static_cast<std::int32_t>(points.size()), opt_.max_states, kNoMarginal);
    const JointSummary summary = events.solve(s_.marginals, s_.all_missed, s_.best);
    stats.n_beams += summary.n_beams;
    stats.n_states = std::max(stats.n_states, summary.n_states);
    stats.bound = std::max(stats.bound, summary.bound);
    const Groups& groups = events.groups();
    FramePairing::count(groups, stats);
    for (std::size_t g = 0; g < groups.size(); ++g)
      take_group(groups[g], std::span(groups.sources).subspan(groups.starts[g]), points, stats);
    for (std::size_t e = 0; e < s_.eligible.size(); ++e) {
      double& free = s_.free[s_.eligible[e].column];
      free = std::max(free - s_.marginals[e], 0.0);
    }
    s_.pairs.take(s_.eligible);
  }

  // Tentative tracks take the detections that the most likely event assigns to them. The
  // association probability of each is conditional on the other tracks following that event. A sum
  // over all joint events would be slow and uninformative, because tentative tracks fit almost any
  // detections.
  void share_among_tentative(std::span<const Point> points, JointStats& stats) {
    find_eligible(false);
    s_.pairs.pair(s_.eligible, points, live_.m.axis.D, {}, stats);
    for (std::size_t first = 0, last; first < s_.eligible.size(); first = last) {
      const std::int32_t i = s_.eligible[first].row, match = s_.pairs.match[i];
      const auto is_open = [&](const Candidate& c) {
        return !s_.pairs.is_taken[c.column] || match == c.column;
      };
      double max_log = 0, total = 0;
      for (last = first; last < s_.eligible.size() && s_.eligible[last].row == i; ++last)
        if (is_open(s_.eligible[last])) max_log = std::max(max_log, s_.eligible[last].gain);
      total = std::exp(-max_log);
      for (std::size_t e = first; e < last; ++e)
        if (is_open(s_.eligible[e])) total += std::exp(s_.eligible[e].gain - max_log);
      s_.missed[i] = std::exp(-max_log) / total;
      for (std::size_t e = first; e < last; ++e) {
        const Candidate& c = s_.eligible[e];
        if (!is_open(c)) continue;
        const double p = std::exp(c.gain - max_log) / total;
        s_.free[c.column] = std::max(s_.free[c.column] - p, 0.0);
        if (match == c.column) s_.match_probability[i] = p;
      }
      if (match >= 0) update(live_.m, live_.prediction(i), points[match], live_[i].state);
    }
  }

  // Applies the marginals of a group to its tracks: best assignment, miss probability and updated
  // state.
  void take_group(std::span<const Candidate> group, std::span<const std::int32_t> sources,
                  std::span<const Point> points, JointStats& stats) {
    for (std::size_t e = 0; e < group.size(); ++e) {
      const Candidate& c = group[e];
      s_.missed[c.row] = s_.all_missed[c.row];
      if (s_.best[c.row] != c.column) continue;
      s_.pairs.match[c.row] = c.column;
      s_.match_probability[c.row] = s_.marginals[sources[e]];
    }
    weigh(group, sources, stats);
    for (std::size_t first = 0, last; first < group.size(); first = last) {
      const std::int32_t i = group[first].row;
      double taken = 0;
      s_.mixture.clear();
      for (last = first; last < group.size() && group[last].row == i; ++last) {
        if (s_.weights[last] > 0) s_.mixture.push_back({points[group[last].column], s_.weights[last]});
        taken += s_.weights[last];
      }
      if (s_.mixture.empty()) continue;
      // The prediction from neighbours must not enter the track's own state before the marker is
      // detected.
      const std::int32_t match = s_.pairs.match[i];
      if (carried_.is_carried(i) && match < 0) continue;
      if (match >= 0) carried_.take(live_, i, points[match], stats);
      // Given that the track exists, a miss is less probable than without that condition.
      const double given_missed =
          probability(existence(i)) * p_miss(i) / p_undetected(i, existence(i));
      const double missed = std::max(1 - taken, 0.0) * given_missed;
      for (WeightedPoint& point : s_.mixture) point.weight /= taken + missed;
      update_by_all(live_.m, live_.prediction(i), s_.mixture, missed / (taken + missed),
                    live_[i].state);
    }
  }

  // Weights of the pairings of a group in the update of the states. They are the marginals; with
  // the guard, those over the best permutations; if the group is too large for the guard, the best
  // event.
  void weigh(std::span<const Candidate> group, std::span<const std::int32_t> sources,
             JointStats& stats) {
    const bool needs_guard = opt_.is_guarded && group.front().row != group.back().row;
    if (needs_guard && s_.guard.solve(group, s_.best, s_.weights)) return;
    stats.n_unguarded += needs_guard;
    s_.weights.resize(group.size());
    for (std::size_t e = 0; e < group.size(); ++e)
      s_.weights[e] = !needs_guard ? s_.marginals[sources[e]] : s_.best[group[e].row] == group[e].column;
  }

  template <typename Label>
  void update_tracks(double time, std::span<const Point> points, JointStats& stats,
                     Label&& label) {
    for (std::size_t i = 0; i < live_.size(); ++i) {
      LiveTrack<NoMore>& track = live_[i];
      update_existence(i);
      const std::int32_t j = s_.pairs.match[i];
      if (j < 0) {
        ++track.gap;
        carried_.miss(track, i, stats);
        const bool is_gone = existence(i) < -live_.opt.confirm_score;
        if (track.is_confirmed() && is_gone) track.gap = live_.sm.max_gap + track.carried;
        continue;
      }
      // For a tentative track, the confidence is conditional on the track being a marker.
      const double given = track.is_confirmed() ? 1 : probability(track.score);
      const double confidence = std::min(s_.match_probability[i] / given, 1.0);
      live_.take(i, j, points[j], time, confidence, label);
    }
    live_.end_tracks();
  }

  // Multiplies the odds of existence by their likelihood ratio, also if the association assumed
  // other odds.
  void update_existence(std::size_t i) {
    const double taken_as = existence(i), missed = std::max(s_.missed[i], 1e-300);
    const double exists_missed = missed * probability(taken_as) * p_miss(i);
    const double exists = (1 - missed) * p_undetected(i, taken_as) + exists_missed;
    const double factor = std::log(exists) - std::log(missed) + softplus(taken_as) - taken_as;
    double& score = live_[i].score;
    score = std::clamp(score + factor, -kMaxOdds, kMaxOdds);
    live_[i].p_missed = exists_missed / exists;
  }

  void begin_tracks(double time, std::span<const Point> points) {
    for (std::size_t j = 0; j < points.size(); ++j) {
      const double r = p_new(s_.free[j]);
      if (s_.pairs.is_taken[j] || !(r > 0)) continue;
      live_.begin(j, points[j], time, std::log(r) - std::log1p(-r));
    }
  }

  LiveTracks<> live_;
  JointOptions opt_;
  CarriedTracks carried_;
  JointStats total_;
  Scratch<Memory> s_;
};

}  // namespace asterism
