// Weighted set packing: finds the k best selections of one option per tree of a cluster such that
// no resource is used twice. The solver is exact within a limit on nodes.
//
// Best-first branch and bound. A node allows some options of each tree; its bound is the sum of the
// best of them. If two best options use the same resource, the node is split by the owner of that
// resource. Otherwise they form a packing, and the rest of the node is split as by Murty. The parts
// are disjoint, so every packing is found once.
//
// If that takes more than a few nodes, the resources get prices (solve/priced_options.hpp). The
// bound of a node is then the sum of all prices and of its largest reduced weights.
#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>
#include <numeric>
#include <span>
#include <utility>
#include <vector>

#include "solve/priced_options.hpp"

namespace asterism {

struct PackingSummary {
  bool is_exact = true;  // all packings requested were found within the node limit
  double bound = 0;      // upper bound of the weight of a packing
  std::int64_t n_nodes = 0;
};

class SetPacking : PricedOptions {
 public:
  // Options of each tree. Each tree needs an option without resources, so that a packing exists.
  explicit SetPacking(std::span<const std::vector<PackingOption>> trees) : PricedOptions(trees) {}

  // For each tree and option, a lower bound of the weight lost by taking that option: a packing
  // that contains it weighs at most the bound minus that loss. The options of the best known
  // packing lose nothing.
  struct Losses {
    double bound = 0;
    std::vector<std::vector<double>> of;
    std::vector<std::int32_t> best;  // option of each tree in the best known packing
  };
  Losses losses() {
    // Without prices, a few nodes do not solve a large cluster.
    bool is_best = false;
    if (n_trees() <= kManyTrees) {
      sort();
      is_best = search(1, 0, kUnpriced).is_exact;
    }
    if (!is_best || bound() > known_.log_weight + kBetter) {
      set_prices(is_best);
      if (!is_best) {
        OptionLists all = keep_core();
        search(1, 0, kUnpriced);
        restore(std::move(all));
      }
    }
    std::vector<double> loss(options_.size());
    std::vector<std::int32_t> best(n_trees());
    for (std::int32_t i = 0; i < n_trees(); ++i) {
      const double max_of_tree = max_reduced(i);
      for (std::int32_t o = first_[i]; o < first_[i + 1]; ++o) {
        loss[o] = std::max(0.0, max_of_tree - reduced_[o]);  // 0 if both are infinite
        if (number(o) == known_.own[i]) best[i] = o;
      }
      loss[best[i]] = 0;
    }
    const std::vector<double> others = lost_by_others(loss, best);
    Losses out{bound(), {}, known_.own};
    out.of.resize(n_trees());
    for (std::int32_t i = 0; i < n_trees(); ++i) {
      out.of[i].resize(first_[i + 1] - first_[i]);
      for (std::int32_t o = first_[i]; o < first_[i + 1]; ++o)
        out.of[i][number(o)] = loss[o] + others[o];
    }
    return out;
  }

  // Calls found(option of each tree, weight) for up to k packings, the best first, none more than
  // `drop` below the best. If the node limit is reached first, the best repaired packing is
  // returned.
  template <typename Found>
  PackingSummary solve(std::int64_t k, double drop, std::int64_t max_nodes, Found&& found) {
    sort();
    PackingSummary summary = search(k, drop, std::min(max_nodes, kUnpriced));
    if (!summary.is_exact && max_nodes > kUnpriced) {
      set_prices(false);
      sort();
      const std::int64_t n_before = summary.n_nodes;
      summary = search(k, drop, max_nodes - n_before);
      summary.n_nodes += n_before;
    }
    for (const Packing& packing : packings_)
      found(std::span<const std::int32_t>(packing.own), packing.log_weight);
    return summary;
  }

 private:
  static constexpr std::int64_t kUnpriced = 32;  // number of nodes before prices are used
  static constexpr int kDives = 32;
  static constexpr std::int32_t kManyTrees = 64;

  struct Node {
    double bound = 0;
    std::int64_t number = 0;
    bool is_packing = false;            // `chosen` is a packing, and the only one in the node
    std::vector<bool> is_banned;        // by option
    std::vector<std::int32_t> chosen;  // best allowed option of each tree

    bool operator<(const Node& other) const {
      return bound != other.bound ? bound < other.bound : number > other.number;
    }
  };

  // Loss of the other trees, at the prices, if a tree takes an option. It is the larger of two
  // bounds: the loss of the trees that must release its resources, and the smallest loss of a tree
  // that takes a released resource.
  std::vector<double> lost_by_others(const std::vector<double>& loss,
                                     const std::vector<std::int32_t>& best) const {
    constexpr double kNever = std::numeric_limits<double>::infinity();
    std::vector<std::int32_t> owner(price_.size(), -1);
    // By resource, of its owner; of others.
    std::vector<double> without(price_.size(), 0), taken(price_);
    for (std::int32_t i = 0; i < n_trees(); ++i)
      for (const std::int32_t r : uses_of(best[i])) {
        owner[r] = i;
        without[r] = kNever;
        for (std::int32_t o = first_[i]; o < first_[i + 1]; ++o)
          if (loss[o] < without[r] && !uses(o, r)) without[r] = loss[o];
      }
    for (std::int32_t o = 0; o < first_.back(); ++o)
      for (const std::int32_t r : uses_of(o))
        if (owner[r] != tree_of_[o]) taken[r] = std::min(taken[r], loss[o]);
    std::vector<double> out(options_.size(), 0);
    std::vector<std::pair<std::int32_t, double>> losers;
    for (std::int32_t o = 0; o < first_.back(); ++o) {
      losers.clear();
      for (const std::int32_t r : uses_of(o)) {
        if (owner[r] < 0 || owner[r] == tree_of_[o]) continue;
        const auto at = std::ranges::find(losers, owner[r], &std::pair<std::int32_t, double>::first);
        if (at == losers.end())
          losers.emplace_back(owner[r], without[r]);
        else
          at->second = std::max(at->second, without[r]);
      }
      double given_up = 0;
      for (const auto& [tree, min_loss] : losers) given_up += min_loss;
      for (const std::int32_t r : uses_of(best[tree_of_[o]]))
        if (taken[r] > out[o] && !uses(o, r)) out[o] = taken[r];
      out[o] = std::max(out[o], given_up);
    }
    return out;
  }
  PackingSummary search(std::int64_t k, double drop, std::int64_t max_nodes) {
    PackingSummary summary;
    packings_.clear();
    heap_.clear();
    drop_ = drop;
    n_pushed_ = 0;
    sum_of_prices_ = std::accumulate(price_.begin(), price_.end(), 0.0);
    n_left_ = max_nodes + k;
    Node root;
    root.is_banned.assign(options_.size(), 0);
    root.chosen.assign(first_.begin(), first_.end() - 1);
    push(std::move(root));
    summary.bound = heap_.front().bound;
    while (!heap_.empty() && static_cast<std::int64_t>(packings_.size()) < k) {
      std::pop_heap(heap_.begin(), heap_.end());
      Node node = std::move(heap_.back());
      heap_.pop_back();
      --n_left_;
      if (!packings_.empty() && node.bound < packings_.front().log_weight - drop) break;
      if (packings_.empty()) summary.bound = node.bound;
      if (node.is_packing) {
        packings_.push_back(packing(node.chosen));
        if (packings_.size() == 1) keep_if_better(node.chosen);
        continue;
      }
      if (++summary.n_nodes > max_nodes) {
        summary.is_exact = false;
        if (packings_.empty()) {
          dive(std::move(node));
          packings_.push_back(known_);
        }
        break;
      }
      const std::int32_t contested = conflict(node);
      if (contested >= 0) {
        split_by_owner(node, contested);
        continue;
      }
      if (k == 1 && weight(node.chosen) >= node.bound) {  // nothing left is better
        packings_.push_back(packing(node.chosen));
        keep_if_better(node.chosen);
        break;
      }
      split_rest(node);
      node.is_packing = true;
      push(std::move(node));
    }
    if (!packings_.empty() && summary.is_exact) summary.bound = packings_.front().log_weight;
    return summary;
  }

  double weight(const std::vector<std::int32_t>& chosen) const {
    double sum = 0;
    for (const std::int32_t o : chosen) sum += log_weight(o);
    return sum;
  }

  void push(Node node) {
    if (node.is_packing) {
      node.bound = weight(node.chosen);
    } else {
      node.bound = sum_of_prices_;
      for (const std::int32_t o : node.chosen) node.bound += reduced_[o];
    }
    // The node contains no packing that would count.
    if (!known_.own.empty() && node.bound < known_.log_weight - drop_ - kBetter) return;
    node.number = n_pushed_++;
    heap_.push_back(std::move(node));
    std::push_heap(heap_.begin(), heap_.end());
    if (static_cast<std::int64_t>(heap_.size()) / 2 > n_left_) forget_last();
  }

  // Finds packings when the search is stopped early. From each of the best remaining nodes it
  // follows the best child until no resource is contested, then repairs the choice.
  void dive(Node node) {
    std::vector<Node> starts = std::exchange(heap_, {});
    for (int n = 0; n < kDives; ++n) {
      while (true) {
        const std::int32_t contested = node.is_packing ? -1 : conflict(node);
        if (contested < 0) break;
        keep_if_better(repaired(node.chosen));
        split_by_owner(node, contested);
        if (heap_.empty()) break;
        node = std::move(*std::max_element(heap_.begin(), heap_.end()));
        heap_.clear();
      }
      keep_if_better(repaired(node.chosen));
      if (starts.empty()) return;
      std::pop_heap(starts.begin(), starts.end());
      node = std::move(starts.back());
      starts.pop_back();
    }
  }

  // Drops the nodes that the search can no longer reach: it takes the best first and stops after
  // `max_nodes` nodes and k packings.
  void forget_last() {
    const auto end = heap_.begin() + static_cast<std::ptrdiff_t>(n_left_);
    std::nth_element(heap_.begin(), end, heap_.end(),
                     [](const Node& a, const Node& b) { return b < a; });
    heap_.erase(end, heap_.end());
    std::make_heap(heap_.begin(), heap_.end());
  }

  // Bans an option. Returns false if its tree has none left.
  bool ban(Node& node, std::int32_t option) const {
    if (node.is_banned[option]) return true;
    node.is_banned[option] = 1;
    const std::int32_t i = tree_of_[option];
    std::int32_t& best = node.chosen[i];
    while (best < first_[i + 1] && node.is_banned[best]) ++best;
    return best < first_[i + 1];
  }

  // The smallest resource that two of the chosen options use, or -1.
  std::int32_t conflict(const Node& node) {
    is_used_.assign(price_.size(), 0);
    std::int32_t first = -1;
    for (const std::int32_t o : node.chosen)
      for (const std::int32_t r : uses_of(o)) {
        if (is_used_[r] && (first < 0 || r < first)) first = r;
        is_used_[r] = 1;
      }
    return first;
  }

  void split_by_owner(const Node& node, std::int32_t resource) {
    std::vector<std::int32_t> claimants;
    for (std::int32_t i = 0; i < n_trees(); ++i)
      if (uses(node.chosen[i], resource)) claimants.push_back(i);
    const auto is_claimant = [&](std::int32_t i) {
      return std::find(claimants.begin(), claimants.end(), i) != claimants.end();
    };
    for (const std::int32_t owner : claimants) {
      Node child = node;
      bool is_possible = true;
      for (const std::int32_t o : users_of(resource))
        if (tree_of_[o] != owner) is_possible = is_possible && ban(child, o);
      for (std::int32_t o = first_[owner]; is_possible && o < first_[owner + 1]; ++o)
        if (!uses(o, resource)) is_possible = ban(child, o);
      if (is_possible) push(std::move(child));
    }
    Node child = node;
    bool is_possible = true;
    for (const std::int32_t o : users_of(resource))
      if (is_claimant(tree_of_[o])) is_possible = is_possible && ban(child, o);
    if (is_possible) push(std::move(child));
  }

  // Partitions the node without its chosen packing: in part i, the trees before i keep their
  // options and tree i changes its own.
  void split_rest(const Node& node) {
    Node kept = node;
    for (std::int32_t i = 0; i < n_trees(); ++i) {
      Node child = kept;
      if (ban(child, node.chosen[i])) push(std::move(child));
      for (std::int32_t o = first_[i]; o < first_[i + 1]; ++o)
        if (o != node.chosen[i]) kept.is_banned[o] = 1;
    }
  }

  std::vector<Packing> packings_;
  std::vector<Node> heap_;
  double drop_ = 0, sum_of_prices_ = 0;  // of the current search
  std::int64_t n_pushed_ = 0;
  std::int64_t n_left_ = 0;  // nodes that may still be taken
};

}  // namespace asterism
