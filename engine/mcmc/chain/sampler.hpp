// The Metropolis–Hastings chain over partitions: proposes a move, evaluates it, accepts or rejects
// it.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <map>
#include <span>
#include <utility>
#include <vector>

#include "math/random.hpp"
#include "mcmc/model/edit_filter.hpp"
#include "mcmc/model/partition.hpp"
#include "mcmc/model/shared_term.hpp"
#include "mcmc/moves/involutive_moves.hpp"
#include "mcmc/moves/moves.hpp"

namespace asterism {

struct ChainOptions {
  GrowthOptions growth;
  std::array<double, kMoves> weights{};  // ξ, up to a factor
  // The rules of the report: only births while there is no track, and no merge or switch while
  // there is one. The probabilities of the kinds of moves then depend on the number of tracks K.
  bool has_first_rules = false;
  // The chain of the report: ω' is drawn from the best partition so far and compared with the last
  // accepted one. This is an ascent and does not sample the posterior.
  bool is_ascent = false;
  // Probability of a move at an ambiguous link, if there is any (mcmc/chain/chain_runner.hpp).
  double share_at_ambiguous = 0;
  // Whether the result of a search is its last state, a draw from the posterior, instead of the
  // best state.
  bool is_draw = false;
};

template <typename Filter>
class Sampler {
 public:
  using Motion = Filter;

  Sampler(const MotionModel& m, const ScoreModel& sm, const ChainOptions& options,
          std::uint64_t seed)
      : Sampler(Partition<Filter>(m, sm), options, seed) {}
  Sampler(Partition<Filter> partition, const ChainOptions& options, std::uint64_t seed)
      : partition_(std::move(partition)), opt_(options), random_(seed) {
    for (int K = 0; K < 3; ++K) shares_[K] = shares(K);
  }
  Sampler(const Sampler&) = delete;  // the moves hold references to the partition
  Sampler& operator=(const Sampler&) = delete;

  Partition<Filter>& partition() { return partition_; }
  const Partition<Filter>& partition() const { return partition_; }
  const std::array<MoveCounts, kMoves>& counts() const { return counts_; }

  // Restarts with another seed, as a chain of the posterior.
  void begin(std::uint64_t seed) {
    random_ = Random(seed);
    coldness_ = 1;
    counts_ = {};
    best_gain_ = last_gain_ = 0;
  }

  // Begins a part of a partition, which was taken of these tracks.
  void begin_part(const Partition<Filter>& whole, std::span<const std::int32_t> tracks) {
    shared_.begin(whole, partition_, tracks);
  }

  // Makes one move; returns true if the partition changes. Calls `observe(change, is taken)` for
  // every evaluated proposal, before it is applied.
  template <typename Observe>
  bool step(Observe&& observe) {
    const Shares& now = shares_[std::min(partition_.tracks().size(), 2)];
    const double at = random_.uniform();
    int kind = 0;
    while (kind + 1 < kMoves && at >= now.upto[kind]) ++kind;
    MoveCounts& count = counts_[kind];
    ++count.n_drawn;
    if (!moves_.propose(static_cast<Move>(kind), random_, change_)) return false;
    if (shared_.excludes(change_.all())) return false;
    ++count.n_possible;
    const Shares& then = shares_[std::min(n_tracks_after(), 2)];
    const int back = static_cast<int>(inverse(change_.move));
    const double log_u = std::log(random_.uniform());
    // log_reverse is at most 0, so a ratio that is too small without it stays too small.
    const double reach = coldness_ * shared_.reach();
    const double threshold = std::min(log_u, weighed_above_) - reach;
    const double log_proposal = (best_gain_ - last_gain_) + then.log[back] - now.log[kind];
    change_.min_gain = (threshold - log_proposal + change_.log_forward) / coldness_;
    if (!moves_.weigh(change_)) return false;
    change_.log_ratio = coldness_ * change_.gain + log_proposal - change_.log_forward;
    if (!(change_.log_ratio > threshold)) return false;
    if (shared_.is_on()) add_shared();
    const bool is_weighed = change_.log_ratio > weighed_above_;
    change_.log_reverse = moves_.log_reverse(change_);
    change_.log_ratio += change_.log_reverse;
    const bool is_taken = take(log_u, is_weighed, observe);
    count.n_taken += is_taken;
    return is_taken;
  }
  bool step() {
    return step([](const Change<Filter>&, bool) {});
  }

  // A move of a list (mcmc/moves/involutive_moves.hpp). Its gain is kept while its tracks do not
  // change, because the moves of a list are proposed again and again.
  struct Listed {
    Toggle toggle;
    double gain = 0;
    std::int64_t weighed = -1;  // time of the partition

    bool is_known(const Partition<Filter>& p) const {
      return weighed >= std::max(p.changed(toggle.y), p.changed(toggle.a)) &&
             (toggle.c < 0 || weighed >= p.changed(toggle.c));
    }
  };
  template <typename Observe>
  bool step(Listed& move, Observe&& observe) {
    if (!propose(move.toggle)) return false;
    if (!move.is_known(partition_) || shared_.is_on()) {
      weigh_completely();
      move.gain = change_.gain;
      move.weighed = partition_.clock();
    }
    change_.gain = move.gain;
    change_.log_ratio = coldness_ * move.gain;
    const double log_u = std::log(random_.uniform());
    if (shared_.is_on() && move.gain > std::min(log_u, 0.0) - shared_.reach()) add_shared();
    return take(log_u, true, observe);
  }
  // Estimates the gain of a move; with a shared term it is exact. Returns false if the move is
  // impossible or the gain not above `min_gain`.
  bool estimate(const Toggle& toggle, double min_gain, double& gain) {
    change_.min_gain = min_gain - shared_.reach();
    if (!propose(toggle) || !toggles_.estimate(change_)) return false;
    gain = change_.gain;
    if (!shared_.is_on()) return true;
    if (!toggles_.weigh(change_)) return false;
    gain = change_.gain + shared_.gain(change_.all());
    return gain > min_gain;
  }
  Random& random() { return random_; }

  // Gain of the log posterior since `begin_best`, and its maximum.
  double gain() const { return gain_; }
  double max_gain() const { return max_gain_; }

  // `begin_best` starts to remember the best partition; `restore_best` returns the chain to it.
  void begin_best() {
    gain_ = max_gain_ = 0;
    is_best_ = true;
  }
  void restore_best() {
    if (is_best_ || gain_ >= max_gain_ - kBetter) return;
    edits_.clear();
    std::map<std::int32_t, std::size_t> now;  // tracks by first detection
    for (const std::int32_t k : partition_.tracks().items())
      now[partition_.track(k).nodes.front()] = static_cast<std::size_t>(k);
    for (std::size_t s = 0; s + 1 < first_saved_.size(); ++s) {
      const std::span<const std::int32_t> nodes(saved_.data() + first_saved_[s],
                                                saved_.data() + first_saved_[s + 1]);
      Edit<Filter>& edit = edits_.emplace_back();
      const auto at = now.find(nodes.front());
      if (at != now.end()) {
        edit.track = static_cast<std::int32_t>(at->second);
        const auto& own = partition_.track(edit.track).nodes;
        while (edit.keep < static_cast<std::int32_t>(std::min(own.size(), nodes.size())) &&
               own[edit.keep] == nodes[edit.keep])
          ++edit.keep;
        now.erase(at);
      }
      for (std::size_t n = edit.keep; n < nodes.size(); ++n) append(partition_, edit, nodes[n]);
    }
    for (const auto& [first, k] : now) edits_.emplace_back().track = static_cast<std::int32_t>(k);
    if (shared_.is_on()) shared_.apply(edits_);
    partition_.apply(edits_);
    is_best_ = true;
    gain_ = max_gain_;
  }

  // From now on the chain is one of the posterior to this power, until `begin`.
  void cool(double coldness) { coldness_ = coldness; }

  // Proposals with a log ratio above this, without the reverse move, are evaluated completely even
  // if they will be rejected. Estimators of marginals need them.
  void weigh_above(double log_p) { weighed_above_ = log_p; }
  static constexpr double kOnlyWhatMayBeTaken = std::numeric_limits<double>::infinity();

 private:
  bool propose(const Toggle& toggle) {
    return toggles_.propose(toggle, change_) && !shared_.excludes(change_.all());
  }
  template <typename Observe>
  bool take(double log_u, bool is_weighed, Observe&& observe) {
    const bool is_taken = change_.log_ratio > log_u;
    change_.p_taken = !is_weighed             ? is_taken
                      : change_.log_ratio >= 0 ? 1
                                               : std::exp(change_.log_ratio);
    observe(std::as_const(change_), is_taken);
    if (!is_taken) return false;
    if (opt_.is_ascent) {
      last_gain_ = best_gain_ + change_.gain;
      if (!(change_.gain > 0)) return false;
      best_gain_ = last_gain_;
    }
    if (is_best_ && change_.gain < 0) {
      save();
      is_best_ = false;
    }
    if (!change_.is_filtered()) weigh_completely();
    if (shared_.is_on()) shared_.apply(change_.all());
    partition_.apply(change_.all());
    gain_ += change_.gain;
    is_best_ = is_best_ || gain_ > max_gain_ + kBetter;
    max_gain_ = std::max(max_gain_, gain_);
    return true;
  }

  // Adds the change of the shared term to that of the own scores.
  void add_shared() {
    const double gain = shared_.gain(change_.all());
    change_.gain += gain;
    change_.log_ratio += coldness_ * gain;
  }
  void weigh_completely() {
    change_.min_gain = -std::numeric_limits<double>::infinity();
    toggles_.weigh(change_);
  }

  struct Shares {
    std::array<double, kMoves> upto{}, log{};
  };

  Shares shares(int K) const {
    std::array<double, kMoves> w = opt_.weights;
    if (opt_.has_first_rules && K == 0) {
      w.fill(0);
      w[0] = 1;
    }
    if (opt_.has_first_rules && K == 1)
      w[static_cast<int>(Move::merge)] = w[static_cast<int>(Move::switch_tails)] = 0;
    double sum = 0;
    for (const double x : w) sum += x;
    Shares out;
    double upto = 0;
    for (int k = 0; k < kMoves; ++k) {
      out.upto[k] = (upto += w[k] / sum);
      out.log[k] = std::log(w[k] / sum);
    }
    return out;
  }

  void save() {
    saved_.clear();
    first_saved_.assign(1, 0);
    for (const std::int32_t k : partition_.tracks().items()) {
      const auto& nodes = partition_.track(k).nodes;
      saved_.insert(saved_.end(), nodes.begin(), nodes.end());
      first_saved_.push_back(static_cast<std::int32_t>(saved_.size()));
    }
  }

  std::int32_t n_tracks_after() const {
    std::int32_t n = partition_.tracks().size();
    switch (change_.move) {
      case Move::birth:
      case Move::split: return n + 1;
      case Move::death:
      case Move::merge: return n - 1;
      default: return n;
    }
  }

  Partition<Filter> partition_;
  ChainOptions opt_;
  Random random_;
  Moves<Filter> moves_{partition_, opt_.growth};
  Toggles<Filter> toggles_{partition_};
  Change<Filter> change_;
  SharedTerm<Filter> shared_;
  std::array<Shares, 3> shares_{};
  std::array<MoveCounts, kMoves> counts_{};
  // Ascent: log posterior of the best partition and of the last accepted one, relative to the
  // start.
  double best_gain_ = 0, last_gain_ = 0;
  double coldness_ = 1;  // power of the posterior, an inverse temperature
  double weighed_above_ = kOnlyWhatMayBeTaken;

  // Since `begin_best`: the gain, its maximum, and whether the present partition attains it. If it
  // does not, the tracks of the best partition are saved.
  static constexpr double kBetter = 1e-9;
  double gain_ = 0, max_gain_ = 0;
  bool is_best_ = false;
  std::vector<std::int32_t> saved_, first_saved_;
  std::vector<Edit<Filter>> edits_;
};

}  // namespace asterism
