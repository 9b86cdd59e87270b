// Runs several chains in parallel in every group of a partition, to find the best partition and its
// confidence.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <numeric>
#include <span>
#include <vector>

#include "base/parallel.hpp"
#include "base/scratch.hpp"
#include "mcmc/chain/budgets.hpp"
#include "mcmc/chain/chain_runner.hpp"
#include "mcmc/chain/chain_stats.hpp"
#include "mcmc/chain/split.hpp"
#include "mcmc/model/edits_to_part.hpp"

namespace asterism {

template <typename Filter>
class ParallelChains {
 public:
  ParallelChains(const ChainOptions& chain, std::int32_t n_chains, std::int32_t n_threads)
      : chain_(chain), n_chains_(n_chains), n_threads_(n_threads) {}

  // Lists the plausible moves of each group, by which it may be divided. A draw from the posterior
  // needs the whole group, because it may also reach partitions by several implausible moves.
  void list(const Partition<Filter>& whole, std::span<Group> groups) {
    if (chain_.share_at_ambiguous == 0 || chain_.is_draw) return;
    each(whole, groups, 1, [&](ChainRunner<Filter>& runner, std::size_t g) {
      groups[g].moves = runner.list(whole, groups[g]);
      groups[g].is_listed = true;
    });
  }

  // Sets each group to the best state that its chains find. Where markers accelerate together, the
  // score of a group depends on the others, so that each is searched after the one before.
  void search(Partition<Filter>& whole, std::span<Group> groups, const Budgets& budgets,
              std::uint64_t seed, ChainStats& stats) {
    struct Found {
      double gain = 0;
      ChainStats stats;
      std::vector<Edit<Filter>> edits;
    };
    std::vector<Found> found(groups.size() * n_chains_);
    const std::size_t n_at_once = whole.is_shared() ? 1 : groups.size();
    for (std::size_t begin = 0; begin < groups.size(); begin += n_at_once) {
      each(whole, groups.subspan(begin, n_at_once), n_chains_,
           [&](ChainRunner<Filter>& runner, std::size_t n) {
        const std::size_t task = begin * n_chains_ + n, g = task / n_chains_;
        Found& own = found[task];
        own.gain = runner.search(whole, groups[g], seed_of(seed, task), budgets.of(g), own.stats);
        if (own.gain > 0) own.edits = edits_to_part(whole, runner.partition(), groups[g].tracks);
      });
      for (std::size_t g = begin; g < begin + n_at_once; ++g) {
        const auto first = found.begin() + static_cast<std::ptrdiff_t>(g) * n_chains_;
        const auto last = first + n_chains_;
        for (auto one = first; one != last; ++one) stats.add(one->stats);
        const auto best = std::max_element(
            first, last, [](const Found& a, const Found& b) { return a.gain < b.gain; });
        if (best->gain > 0) change(whole, groups[g], best->edits);
      }
    }
  }

  // For each detection of the whole partition, the fraction of the chains' states in which it has
  // its present predecessor; 1 for detections in no group.
  std::vector<double> sample(const Partition<Filter>& whole, std::span<const Group> groups,
                             const Budgets& budgets, std::uint64_t seed, ChainStats& stats) {
    std::vector<Halves> found(groups.size() * n_chains_);
    std::vector<ChainStats> counts(found.size());
    each(whole, groups, n_chains_, [&](ChainRunner<Filter>& runner, std::size_t task) {
      const std::size_t g = task / n_chains_;
      runner.sample(whole, groups[g], seed_of(seed, task), budgets.of(g), found[task], counts[task]);
    });
    for (const ChainStats& one : counts) stats.add(one);
    std::vector<double> shares(whole.window().n_ids(), 1.0);
    for (std::size_t g = 0; g < groups.size(); ++g)
      judge(std::span<const Halves>(found).subspan(g * n_chains_, n_chains_), shares, stats);
    return shares;
  }

 private:
  // Difference of a fraction between halves from which a detection counts as uncertain.
  static constexpr double kUncertain = 0.1;

  // A seed that depends on the task but not on the thread that runs it.
  static std::uint64_t seed_of(std::uint64_t seed, std::size_t task) {
    return Random(seed ^ static_cast<std::uint64_t>(task)).next();
  }

  // Applies the result of a search to a group.
  static void change(Partition<Filter>& whole, Group& group, std::span<Edit<Filter>> edits) {
    if (edits.empty()) return;
    std::vector<std::int32_t>& free = group.free;
    for (const std::int32_t k : group.tracks)
      for (std::int32_t n = whole.track(k).n_frozen; n < whole.track(k).size(); ++n)
        free.push_back(whole.track(k).nodes[n]);
    whole.apply(edits);
    for (const Edit<Filter>& edit : edits)
      if (!whole.tracks().has(edit.track))
        std::erase(group.tracks, edit.track);
      else if (std::ranges::find(group.tracks, edit.track) == group.tracks.end())
        group.tracks.push_back(edit.track);
    std::erase_if(free, [&](std::int32_t i) { return !whole.is_free(i); });
    group.is_listed = false;
  }

  // Runs so many tasks for each group. The longest begin first, so that no thread waits for one at
  // the end.
  template <typename Run>
  void each(const Partition<Filter>& whole, std::span<const Group> groups, std::int32_t n_tasks, Run&& run) {
    auto& runners = s_.runners;
    while (static_cast<std::int32_t>(runners.size()) < n_threads_)
      runners.push_back(std::make_unique<ChainRunner<Filter>>(whole.empty(), chain_));
    std::vector<std::size_t> order(groups.size() * n_tasks);
    std::iota(order.begin(), order.end(), 0);
    if (n_threads_ > 1)
      std::ranges::stable_sort(order, std::greater{},
                               [&](std::size_t task) { return groups[task / n_tasks].n_open; });
    in_parallel(static_cast<std::int64_t>(order.size()), n_threads_,
                [&](std::int32_t w, std::int64_t k) { run(*runners[w], order[k]); });
  }

  // Computes split R̂ (Gelman et al. 2013) of the log posterior over the halves of all chains, and
  // the mean fractions weighted by moves. Chains that never moved have no variance, so their R̂ and
  // effective sample size are undefined.
  static void judge(std::span<const Halves> chains, std::vector<double>& shares, ChainStats& stats) {
    const auto n_halves = static_cast<double>(chains.size() * Halves::kN);
    double mean = 0, within = 0, between = 0, moves = 0;
    // Over the chains for which it is defined.
    double ess = std::numeric_limits<double>::quiet_NaN();
    for (const Halves& chain : chains) {
      if (!std::isnan(chain.ess)) ess = std::isnan(ess) ? chain.ess : ess + chain.ess;
      moves += static_cast<double>(chain.all_moves());
      for (int h = 0; h < Halves::kN; ++h) {
        mean += chain.mean[h] / n_halves;
        within += chain.variance[h] / n_halves;
      }
    }
    for (const Halves& chain : chains)
      for (int h = 0; h < Halves::kN; ++h)
        between += (chain.mean[h] - mean) * (chain.mean[h] - mean) / (n_halves - 1);
    if (within > 0)
      stats.add_mixing(std::sqrt(1 + between / within), ess);
    else
      ++stats.n_unmoved;
    for (std::size_t n = 0; n < chains[0].detections.size(); ++n) {
      double sum = 0, min_share = 1, max_share = 0;
      for (const Halves& chain : chains)
        for (int h = 0; h < Halves::kN; ++h) {
          const double share = chain.shares[h][n];
          sum += share * (n_halves * static_cast<double>(chain.n_moves[h]) / moves) / n_halves;
          min_share = std::min(min_share, share);
          max_share = std::max(max_share, share);
        }
      shares[chains[0].detections[n]] = std::clamp(sum, 0.0, 1.0);
      stats.n_disagreements += max_share - min_share > kUncertain;
    }
  }

  struct Memory {
    std::vector<std::unique_ptr<ChainRunner<Filter>>> runners;
  };
  ChainOptions chain_;
  std::int32_t n_chains_, n_threads_;
  Scratch<Memory> s_;
};

}  // namespace asterism
