// The Metropolis–Hastings chain over partitions: draws a move, weighs it, takes it or stays.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "moves.hpp"
#include "partition.hpp"
#include "random.hpp"

namespace asterism {

struct ChainOptions {
  GrowthOptions growth;
  std::array<double, kMoves> weights{};  // ξ, up to a factor
  // The report's rules: nothing but births while there is no track, no merge and no switch while
  // there is one. The shares of the kinds of moves then depend on K.
  bool has_first_rules = false;
  // The report's chain: ω' is drawn from the best partition so far and weighed against the last one
  // that was taken. That climbs; it does not sample the posterior.
  bool is_ascent = false;
};

struct MoveCounts {
  std::int64_t n_drawn = 0, n_possible = 0, n_taken = 0;
};

template <typename Filter>
class Sampler {
 public:
  Sampler(const MotionModel& m, const ScoreModel& sm, const ChainOptions& options,
          std::uint64_t seed)
      : partition_(m, sm), opt_(options), random_(seed) {
    for (int K = 0; K < 3; ++K) shares_[K] = shares(K);
  }
  // The moves look at the partition beside them.
  Sampler(const Sampler& other)
      : partition_(other.partition_),
        opt_(other.opt_),
        random_(other.random_),
        shares_(other.shares_),
        counts_(other.counts_),
        best_gain_(other.best_gain_),
        last_gain_(other.last_gain_) {}
  Sampler& operator=(const Sampler&) = delete;

  Partition<Filter>& partition() { return partition_; }
  const Partition<Filter>& partition() const { return partition_; }
  const std::array<MoveCounts, kMoves>& counts() const { return counts_; }

  // One move; true where the partition changes. `seen(proposal, log of the reverse, is taken)` is
  // called for what was weighed to the end.
  template <typename Seen>
  bool step(Seen&& seen) {
    const Shares& now = shares_[std::min(partition_.tracks().size(), 2)];
    const double at = random_.uniform();
    int kind = 0;
    while (kind + 1 < kMoves && at >= now.upto[kind]) ++kind;
    MoveCounts& count = counts_[kind];
    ++count.n_drawn;
    if (!moves_.propose(static_cast<Move>(kind), random_, proposal_)) return false;
    ++count.n_possible;
    const Shares& then = shares_[std::min(n_tracks_after(), 2)];
    const int back = static_cast<int>(inverse(proposal_.move));
    const double log_u = std::log(random_.uniform());
    // A probability is at most 1: what is too little before the way back is weighed stays so.
    double log_ratio = proposal_.gain + (best_gain_ - last_gain_) + then.log[back] -
                       now.log[kind] - proposal_.log_forward;
    if (!(log_ratio > log_u) && !is_traced_) return false;
    const double log_reverse = moves_.log_reverse(proposal_);
    log_ratio += log_reverse;
    const bool is_taken = log_ratio > log_u;
    seen(proposal_, log_reverse, is_taken);
    if (!is_taken) return false;
    ++count.n_taken;
    if (opt_.is_ascent) {
      last_gain_ = best_gain_ + proposal_.gain;
      if (!(proposal_.gain > 0)) return false;
      best_gain_ = last_gain_;
    }
    partition_.apply(proposal_.all());
    return true;
  }
  bool step() {
    return step([](const Proposal<Filter>&, double, bool) {});
  }

  // Weigh everything to the end, for whoever looks on.
  void trace(bool is_traced) { is_traced_ = is_traced; }

 private:
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

  std::int32_t n_tracks_after() const {
    std::int32_t n = partition_.tracks().size();
    switch (proposal_.move) {
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
  Proposal<Filter> proposal_;
  std::array<Shares, 3> shares_{};
  std::array<MoveCounts, kMoves> counts_{};
  // Ascent: log posterior of the best partition and of the last one taken, less that at the start.
  double best_gain_ = 0, last_gain_ = 0;
  bool is_traced_ = false;
};

}  // namespace asterism
