// Runs a chain on a part of a partition, to find its best state or to estimate confidence.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numeric>
#include <span>
#include <utility>
#include <vector>

#include "mcmc/chain/budgets.hpp"
#include "mcmc/chain/chain_stats.hpp"
#include "mcmc/chain/marginals.hpp"
#include "mcmc/chain/sampler.hpp"
#include "mcmc/chain/split.hpp"
#include "mcmc/chain/trace.hpp"

namespace asterism {

// Results of a chain, separately for its two halves.
struct Halves {
  static constexpr int kN = 2;
  std::vector<std::int32_t> detections;      // numbers in the whole partition
  // Fraction of moves in which each has its reference predecessor.
  std::array<std::vector<double>, kN> shares;
  std::array<double, kN> mean{}, variance{};   // of the log posterior
  std::array<std::int64_t, kN> n_moves{};
  double ess = 0;  // NaN for a chain that never moved

  std::int64_t all_moves() const { return std::accumulate(n_moves.begin(), n_moves.end(), std::int64_t{0}); }
};

template <typename Filter>
class ChainRunner {
 public:
  ChainRunner(Partition<Filter> empty, const ChainOptions& options)
      : sampler_(std::move(empty), options, 0),
        marginals_(sampler_.partition()),
        hot_share_(options.share_at_ambiguous),
        is_draw_(options.is_draw),
        is_ascent_(options.is_ascent) {}

  // Lists the plausible moves at the ambiguous links of a group. Their detections have the numbers
  // of the whole partition.
  std::vector<HotMove> list(const Partition<Filter>& whole, const Group& group) {
    sampler_.partition().take_part(whole, group.tracks, group.free);
    sampler_.begin_part(whole, group.tracks);
    list_hot(group.ambiguous);
    std::vector<HotMove> out;
    for (const Hot& hot : hot_) {
      const auto origin = [&](std::int32_t i) { return i < 0 ? -1 : sampler_.partition().origin(i); };
      const auto& [kind, y, a, c] = hot.move.toggle;
      out.push_back({{kind, origin(y), origin(a), origin(c)}, hot.gain});
    }
    return out;
  }

  // Searches for the best partition, returns its gain over the start, and stays there. With
  // `is_draw` it stays at the last state instead and returns infinity.
  //
  // A chain of the posterior visits partitions in which a few of many ambiguous links are not at
  // their best. The search therefore goes back from the newest frames in stretches. In each it
  // samples moves at the links of the stretch, returns to the best partition so far, and samples a
  // power of the posterior, which accepts hardly any loss.
  double search(const Partition<Filter>& whole, const Group& group, std::uint64_t seed,
                const Budget& budget, ChainStats& stats) {
    begin(whole, group, seed);
    sampler_.weigh_above(sampler_.kOnlyWhatMayBeTaken);
    const auto start = Clock::now();
    std::int64_t n = 0;
    const auto run_until = [&](double share) {
      const Budget part = budget.first(share, start);
      for (; !part.is_over(n) && !budget.is_over(n); ++n) step([](const Change<Filter>&, bool) {});
    };
    if (is_draw_ || is_ascent_) {
      run_until(1);
    } else {
      each_stretch([&](double from, double to) {
        run_until(from + kSampled * (to - from));
        sampler_.restore_best();
        sampler_.cool(kColdness);
        run_until(to);
        sampler_.restore_best();
        sampler_.cool(1);
      });
    }
    stats.n_search += n;
    stats.add_moves(sampler_.counts());
    if (is_draw_) return std::numeric_limits<double>::infinity();
    sampler_.restore_best();
    return sampler_.max_gain();
  }
  const Partition<Filter>& partition() const { return sampler_.partition(); }

  // Estimates the probability of the links of the initial partition.
  void sample(const Partition<Filter>& whole, const Group& group, std::uint64_t seed,
              const Budget& budget, Halves& out, ChainStats& stats) {
    const Partition<Filter>& p = sampler_.partition();
    begin(whole, group, seed);
    sampler_.weigh_above(kLookedAtAbove);
    marginals_.begin();
    out.detections.clear();
    for (std::int32_t i = 0; i < p.window().n_ids(); ++i)
      if (!p.is_frozen(i)) out.detections.push_back(p.origin(i));
    // The halves have the same number of moves; if time is limited, each has half of it.
    const auto weigh = [&](const Change<Filter>& change, bool is_taken) {
      marginals_.weigh(change, is_taken);
    };
    Trace trace;
    const std::int64_t half = std::max<std::int64_t>(budget.moves / Halves::kN, 1);
    for (int h = 0; h < Halves::kN; ++h) {
      marginals_.forget();
      trace.begin(half);
      const bool is_last = h + 1 == Halves::kN;
      const Clock::time_point until = budget.first(is_last ? 1 : 0.5, Clock::now()).until;
      const Budget own{half, until, budget.watch};
      std::int64_t n = 0;
      for (; n == 0 || !own.is_over(n); ++n) {
        step(weigh);
        marginals_.count();
        trace.add(sampler_.gain());
      }
      out.n_moves[h] = n;
      out.mean[h] = trace.mean();
      out.variance[h] = trace.variance();
      out.shares[h].clear();
      for (std::int32_t i = 0; i < p.window().n_ids(); ++i)
        if (!p.is_frozen(i)) out.shares[h].push_back(marginals_.share(i));
    }
    out.ess = trace.ess_of_halves(out.all_moves());
    stats.n_sampled += out.all_moves();
    stats.add_moves(sampler_.counts());
  }

 private:
  static constexpr std::int64_t kStretch = 10;  // frames
  static constexpr double kSampled = 0.7;       // of the moves of a stretch
  static constexpr double kColdness = 100;      // power of the posterior in the others
  // Log ratio without the reverse move below which a rejected move is not evaluated further.
  static constexpr double kLookedAtAbove = -9;

  // Places the chain at the start of a group.
  void begin(const Partition<Filter>& whole, const Group& group, std::uint64_t seed) {
    Partition<Filter>& p = sampler_.partition();
    p.take_part(whole, group.tracks, group.free);
    sampler_.begin(seed);
    sampler_.begin_part(whole, group.tracks);
    sampler_.begin_best();
    if (!group.is_listed) return list_hot(group.ambiguous);
    hot_.clear();
    number_locally();
    for (const auto& [toggle, gain] : group.moves) {
      const auto& [kind, y, a, c] = toggle;
      add_listed({kind, local(y), local(a), local(c)}, gain);
    }
    forget_numbers();
  }

  // Calls visit(from, to) with the plausible moves of each stretch of about kStretch frames, from the
  // newest to the oldest, and its share of all plausible moves as an interval.
  template <typename Visit>
  void each_stretch(Visit&& visit) {
    const DetectionWindow& window = sampler_.partition().window();
    const auto age = [&](const Hot& hot) { return window.now() - window[hot.move.toggle.y].frame; };
    std::int64_t n_frames = 1;
    for (const Hot& hot : hot_) n_frames = std::max(n_frames, age(hot) + 1);
    const std::int64_t n = (n_frames + kStretch / 2) / kStretch;
    if (n < 2) return visit(0.0, 1.0);
    std::vector<std::vector<Hot>> stretches(n);
    for (const Hot& hot : hot_) stretches[age(hot) * n / n_frames].push_back(hot);
    const auto n_all = static_cast<double>(hot_.size());
    double from = 0;
    for (const std::vector<Hot>& stretch : stretches) {
      hot_.clear();
      for (const Hot& hot : stretch) add_listed(hot.move.toggle, hot.gain);
      const double to = from + static_cast<double>(stretch.size()) / n_all;
      visit(from, to);
      from = to;
    }
  }

  template <typename Observe>
  void step(Observe&& observe) {
    if (hot_.empty() || sampler_.random().uniform() >= hot_share_) {
      sampler_.step(observe);
      return;
    }
    const double at = sampler_.random().uniform() * hot_.back().upto;
    const auto hot = std::upper_bound(hot_.begin(), hot_.end(), at,
                                      [](double x, const Hot& h) { return x < h.upto; });
    sampler_.step(hot->move, observe);
  }

  // Lists the involutive moves at the ambiguous links of this part. They are in detailed balance
  // because the list and its probabilities are fixed.
  void list_hot(std::span<const AmbiguousLinks::Link> links) {
    hot_.clear();
    if (hot_share_ == 0) return;
    has_skip_.assign(sampler_.partition().window().n_ids(), false);
    number_locally();
    for (const auto& [from, to] : links) list_at(local(from), local(to));
    forget_numbers();
  }
  void list_at(std::int32_t a, std::int32_t y) {
    const Partition<Filter>& p = sampler_.partition();
    if (a < 0 || y < 0 || p.is_frozen(y)) return;  // a settled link is not ambiguous any more
    const std::int32_t x = p.track_of(a) < 0 ? -1 : p.after(a);
    const std::int32_t c = p.track_of(y) < 0 ? -1 : p.before(y);
    add_skips(a, y);
    if (p.track_of(a) < 0 || x == y) {
      add_hot({Toggle::Kind::begin, y, a});
      return;
    }
    if (c >= 0) {
      add_hot({Toggle::Kind::relocate, y, a, c});
      if (x < 0) add_hot({Toggle::Kind::transfer, y, a, c});
    }
    if (x < 0 || p.is_frozen(x)) return;
    add_hot({Toggle::Kind::swap, y, x});
    add_hot({Toggle::Kind::trade, y, x});
  }
  // `local` returns the number in this part of a detection of the whole partition, -1 for others,
  // between `number_locally` and `forget_numbers`.
  void number_locally() {
    const Partition<Filter>& p = sampler_.partition();
    for (std::int32_t i = 0; i < p.window().n_ids(); ++i) {
      if (static_cast<std::int32_t>(local_.size()) <= p.origin(i)) local_.resize(p.origin(i) + 1, -1);
      local_[p.origin(i)] = i;
    }
  }
  std::int32_t local(std::int32_t i) const {
    return i >= 0 && i < static_cast<std::int32_t>(local_.size()) ? local_[i] : -1;
  }
  void forget_numbers() {
    const Partition<Filter>& p = sampler_.partition();
    for (std::int32_t i = 0; i < p.window().n_ids(); ++i) local_[p.origin(i)] = -1;
  }
  // Adds the move that makes an absent link, or those that remove either end of a present link.
  void add_skips(std::int32_t a, std::int32_t y) {
    const Partition<Filter>& p = sampler_.partition();
    if (p.track_of(a) < 0) return;
    const std::int32_t next = p.after(a);
    if (next == y) {
      add_skip_of(y);
      add_skip_of(a);
    } else if (p.is_free(y)) {
      add_hot({Toggle::Kind::skip, y, a, next});
    }
  }
  void add_skip_of(std::int32_t y) {
    const Partition<Filter>& p = sampler_.partition();
    if (has_skip_[y] || p.is_frozen(y) || p.before(y) < 0) return;
    has_skip_[y] = true;
    add_hot({Toggle::Kind::skip, y, p.before(y), p.after(y)});
  }
  void add_hot(const Toggle& toggle) {
    double gain = 0;
    if (sampler_.estimate(toggle, -kHotWithin, gain)) add_listed(toggle, gain);
  }
  void add_listed(const Toggle& toggle, double gain) {
    const double before = hot_.empty() ? 0 : hot_.back().upto;
    hot_.push_back({{toggle}, gain, before + std::exp(std::min(gain, 0.0) / 4)});
  }
  static constexpr double kHotWithin = 12;

  Sampler<Filter> sampler_;
  Marginals<Filter> marginals_;
  double hot_share_;
  bool is_draw_, is_ascent_;
  // The plausible moves at ambiguous links, each with its cumulative weight.
  struct Hot {
    typename Sampler<Filter>::Listed move;
    double gain = 0, upto = 0;  // the gain is estimated at the start
  };
  std::vector<Hot> hot_;
  std::vector<std::int32_t> local_;
  std::vector<char> has_skip_;  // detections that already have a skip move
};

}  // namespace asterism
