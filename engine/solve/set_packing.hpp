// The best ways for all trees of a cluster to take one option each, no resource twice: weighted set
// packing, exactly, and the k best in order.
//
// Best first. A node allows each tree some of its options and is worth at most the sum of their best
// ones. Where two of these want one resource, the node is split by who has it; where none do, they are
// a packing, and the rest of the node is split as Murty does. The parts never overlap, so that every
// packing comes once.
//
// Where that takes more than a few nodes, the resources get prices, by subgradient (a Lagrangian
// relaxation): an option is worth so much less, whoever has a resource pays for it, and a node is worth
// at most the sum of all prices and of the best options at these prices.
#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>
#include <span>
#include <utility>
#include <vector>

namespace asterism {

// An option of a tree: what it is worth, and the resources that it uses.
struct PackingOption {
  double worth = 0;
  std::vector<std::int32_t> uses;
};

struct PackingSummary {
  bool is_exact = true;  // all that were asked for were found within the limit on nodes
  double bound = 0;      // no packing is worth more than this
  std::int64_t n_nodes = 0;
};

class SetPacking {
 public:
  // Options of each tree; each has one that uses nothing, so that there always is a packing.
  explicit SetPacking(std::span<const std::vector<PackingOption>> trees) {
    for (const auto& options : trees) {
      first_.push_back(static_cast<std::int32_t>(options_.size()));
      for (const PackingOption& option : options) {
        options_.push_back(&option);
        priced_.push_back(option.worth);
      }
    }
    first_.push_back(static_cast<std::int32_t>(options_.size()));
    std::int32_t n_resources = 0;
    for (const PackingOption* o : options_)
      for (const std::int32_t r : o->uses) n_resources = std::max(n_resources, r + 1);
    price_.assign(n_resources, 0);
    sort();
  }

  // What is lost with an option, by tree and option: no packing that holds it is worth more than the
  // bound less that. The options of the best packing that is known lose nothing.
  struct Losses {
    double bound = 0;
    std::vector<std::vector<double>> of;
    std::vector<std::int32_t> best;  // option of each tree in the best packing that is known
  };
  Losses losses() {
    const bool is_best = search(1, 0, kUnpriced).is_exact;
    if (bound() > known_.worth + kBetter) {
      set_prices(is_best);
      if (!is_best) {
        sort();
        search(1, 0, kUnpriced);
      }
    }
    std::vector<double> loss(options_.size());
    std::vector<std::int32_t> best(n_trees());
    for (std::int32_t i = 0; i < n_trees(); ++i) {
      const double most = most_priced(i);
      for (std::int32_t o = first_[i]; o < first_[i + 1]; ++o) {
        loss[o] = std::max(0.0, most - priced_[o]);  // 0 where both are infinite
        if (number_[o] == known_.own[i]) best[i] = o;
      }
      loss[best[i]] = 0;
    }
    const std::vector<double> others = lost_by_others(loss, best);
    Losses out{bound(), {}, known_.own};
    out.of.resize(n_trees());
    for (std::int32_t i = 0; i < n_trees(); ++i) {
      out.of[i].resize(first_[i + 1] - first_[i]);
      for (std::int32_t o = first_[i]; o < first_[i + 1]; ++o)
        out.of[i][number_[o]] = loss[o] + others[o];
    }
    return out;
  }

  // Calls found(option of each tree, worth) for up to k packings, the best first, none of them more
  // than `drop` below it. With more than `max_nodes` nodes the best that can be repaired is given.
  template <typename Found>
  PackingSummary solve(std::int64_t k, double drop, std::int64_t max_nodes, Found&& found) {
    PackingSummary summary = search(k, drop, std::min(max_nodes, kUnpriced));
    if (!summary.is_exact && max_nodes > kUnpriced) {
      set_prices(false);
      sort();
      const std::int64_t n_before = summary.n_nodes;
      summary = search(k, drop, max_nodes - n_before);
      summary.n_nodes += n_before;
    }
    for (const Packing& packing : packings_)
      found(std::span<const std::int32_t>(packing.own), packing.worth);
    return summary;
  }

 private:
  static constexpr std::int64_t kUnpriced = 32;  // nodes before prices are worth their while
  static constexpr int kPriceRounds = 300;
  static constexpr int kDives = 32;
  static constexpr double kBetter = 1e-9;
  static constexpr double kClosed = 1e-3;  // a gap that is worth no more rounds

  struct Packing {
    std::vector<std::int32_t> own;  // option of each tree, as the caller numbers them
    double worth = 0;
  };

  struct Node {
    double bound = 0;
    std::int64_t number = 0;
    bool is_packing = false;            // `chosen` is one, and all there is in the node
    std::vector<bool> is_banned;        // by option
    std::vector<std::int32_t> chosen;  // best allowed option of each tree

    bool operator<(const Node& other) const {
      return bound != other.bound ? bound < other.bound : number > other.number;
    }
  };

  double most_priced(std::int32_t tree) const {
    return *std::max_element(priced_.begin() + first_[tree], priced_.begin() + first_[tree + 1]);
  }
  // Loss of the other trees, at the prices, where a tree takes an option: the larger of what the trees
  // lose that must release its resources, and the least loss of a tree that takes a released resource.
  std::vector<double> lost_by_others(const std::vector<double>& loss,
                                     const std::vector<std::int32_t>& best) const {
    constexpr double kNever = std::numeric_limits<double>::infinity();
    std::vector<std::int32_t> owner(price_.size(), -1);
    std::vector<double> without(price_.size(), 0), taken(price_);  // by resource, of its owner; of others
    for (std::int32_t i = 0; i < n_trees(); ++i)
      for (const std::int32_t r : options_[best[i]]->uses) {
        owner[r] = i;
        without[r] = kNever;
        for (std::int32_t o = first_[i]; o < first_[i + 1]; ++o)
          if (loss[o] < without[r] && !uses(o, r)) without[r] = loss[o];
      }
    for (std::int32_t o = 0; o < first_.back(); ++o)
      for (const std::int32_t r : options_[o]->uses)
        if (owner[r] != tree_of_[o]) taken[r] = std::min(taken[r], loss[o]);
    std::vector<double> out(options_.size(), 0);
    std::vector<std::pair<std::int32_t, double>> losers;
    for (std::int32_t o = 0; o < first_.back(); ++o) {
      losers.clear();
      for (const std::int32_t r : options_[o]->uses) {
        if (owner[r] < 0 || owner[r] == tree_of_[o]) continue;
        const auto at = std::ranges::find(losers, owner[r], &std::pair<std::int32_t, double>::first);
        if (at == losers.end())
          losers.emplace_back(owner[r], without[r]);
        else
          at->second = std::max(at->second, without[r]);
      }
      double given_up = 0;
      for (const auto& [tree, least] : losers) given_up += least;
      for (const std::int32_t r : options_[best[tree_of_[o]]]->uses)
        if (taken[r] > out[o] && !uses(o, r)) out[o] = taken[r];
      out[o] = std::max(out[o], given_up);
    }
    return out;
  }
  // What no packing is worth more than, at the prices.
  double bound() const {
    double sum = 0;
    for (const double x : price_) sum += x;
    for (std::int32_t i = 0; i < n_trees(); ++i) sum += most_priced(i);
    return sum;
  }
  std::int32_t n_trees() const { return static_cast<std::int32_t>(first_.size()) - 1; }

  // Options of every tree by what they are worth at the prices, the best first; who uses what.
  void sort() {
    std::vector<std::int32_t> order(options_.size());
    for (std::size_t o = 0; o < order.size(); ++o) order[o] = static_cast<std::int32_t>(o);
    for (std::size_t i = 0; i + 1 < first_.size(); ++i)
      std::stable_sort(order.begin() + first_[i], order.begin() + first_[i + 1],
                       [&](std::int32_t a, std::int32_t b) { return priced_[a] > priced_[b]; });
    std::vector<const PackingOption*> options;
    std::vector<double> priced;
    std::vector<std::int32_t> number;
    for (const std::int32_t o : order) {
      options.push_back(options_[o]);
      priced.push_back(priced_[o]);
      number.push_back(number_.empty() ? o - first_[tree_of(o)] : number_[o]);
    }
    options_ = std::move(options);
    priced_ = std::move(priced);
    number_ = std::move(number);
    users_.assign(price_.size(), {});
    tree_of_.resize(options_.size());
    for (std::size_t i = 0; i + 1 < first_.size(); ++i)
      for (std::int32_t o = first_[i]; o < first_[i + 1]; ++o) {
        tree_of_[o] = static_cast<std::int32_t>(i);
        for (const std::int32_t r : options_[o]->uses) users_[r].push_back(o);
      }
  }
  std::int32_t tree_of(std::int32_t option) const {
    return static_cast<std::int32_t>(
        std::upper_bound(first_.begin(), first_.end() - 1, option) - first_.begin() - 1);
  }

  PackingSummary search(std::int64_t k, double drop, std::int64_t max_nodes) {
    PackingSummary summary;
    packings_.clear();
    heap_.clear();
    drop_ = drop;
    n_pushed_ = 0;
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
      if (!packings_.empty() && node.bound < packings_.front().worth - drop) break;
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
      split_rest(node);
      node.is_packing = true;
      push(std::move(node));
    }
    if (!packings_.empty() && summary.is_exact) summary.bound = packings_.front().worth;
    return summary;
  }

  // Lowers the bound by a descent on the prices: a resource that several options use becomes dearer,
  // one that none uses cheaper. The direction is a deflected subgradient (Camerini, Fratta & Maffioli
  // 1975), the length of a step follows the best known packing (Polyak 1969). The options chosen in a
  // round are repaired into a packing, which may become the best known one unless that is the best.
  void set_prices(bool is_best) {
    double least = std::numeric_limits<double>::infinity(), step = 1;
    std::vector<double> price(price_.size(), 0), used(price_.size()), way(price_.size(), 0);
    std::vector<std::int32_t> chosen(n_trees());
    int n_idle = 0;
    for (int round = 0; round < kPriceRounds && step > 1e-3; ++round) {
      double dual = 0, length = 0;
      for (const double x : price) dual += x;
      std::fill(used.begin(), used.end(), 0);
      for (std::int32_t o = 0; o < first_.back(); ++o) {
        priced_[o] = options_[o]->worth;
        for (const std::int32_t r : options_[o]->uses) priced_[o] -= price[r];
      }
      for (std::int32_t i = 0; i < n_trees(); ++i) {
        chosen[i] = static_cast<std::int32_t>(
            std::max_element(priced_.begin() + first_[i], priced_.begin() + first_[i + 1]) -
            priced_.begin());
        dual += priced_[chosen[i]];
        for (const std::int32_t r : options_[chosen[i]]->uses) used[r] += 1;
      }
      if (dual < least - kBetter) {
        least = dual;
        price_ = price;
        n_idle = 0;
      } else if (++n_idle >= 10) {
        step /= 2;
        n_idle = 0;
        price = price_;
        std::fill(way.begin(), way.end(), 0);
        continue;
      }
      if (!is_best) keep_if_better(repaired(chosen));
      if (!(least > known_.worth + kClosed)) break;
      double along = 0, own = 0;
      for (std::size_t r = 0; r < price.size(); ++r) {
        if (used[r] < 1 && price[r] <= 0) used[r] = 1;  // an unused resource is free already
        along += (1 - used[r]) * way[r];
        own += way[r] * way[r];
        length += (1 - used[r]) * (1 - used[r]);
      }
      if (length == 0) break;  // no conflict is left, so that the bound is met
      const double memory = along < 0 && own > 0 ? -1.5 * along / own : 0;
      double size = 0;
      for (std::size_t r = 0; r < price.size(); ++r) {
        way[r] = (1 - used[r]) + memory * way[r];
        size += way[r] * way[r];
      }
      if (size == 0) break;
      for (std::size_t r = 0; r < price.size(); ++r)
        price[r] = std::max(price[r] - step * (dual - known_.worth) / size * way[r], 0.0);
    }
    for (std::size_t o = 0; o < options_.size(); ++o) {
      priced_[o] = options_[o]->worth;
      for (const std::int32_t r : options_[o]->uses) priced_[o] -= price_[r];
    }
  }

  Packing packing(const std::vector<std::int32_t>& chosen) const {
    Packing out;
    for (const std::int32_t o : chosen) {
      out.own.push_back(number_[o]);
      out.worth += options_[o]->worth;
    }
    return out;
  }

  void push(Node node) {
    node.bound = 0;
    if (node.is_packing) {
      for (const std::int32_t o : node.chosen) node.bound += options_[o]->worth;
    } else {
      for (const double x : price_) node.bound += x;
      for (const std::int32_t o : node.chosen) node.bound += priced_[o];
    }
    if (!known_.own.empty() && node.bound < known_.worth - drop_ - kBetter) return;  // no packing in it would count
    node.number = n_pushed_++;
    heap_.push_back(std::move(node));
    std::push_heap(heap_.begin(), heap_.end());
    if (static_cast<std::int64_t>(heap_.size()) / 2 > n_left_) forget_last();
  }

  // Packings where the search is cut short: from the best nodes that are left, by the best part of each
  // node down to where nothing is contested, then repaired.
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

  // Drops the nodes that the search cannot reach any more, as it takes the best first and stops after
  // `max_nodes` nodes and k packings.
  void forget_last() {
    const auto end = heap_.begin() + static_cast<std::ptrdiff_t>(n_left_);
    std::nth_element(heap_.begin(), end, heap_.end(),
                     [](const Node& a, const Node& b) { return b < a; });
    heap_.erase(end, heap_.end());
    std::make_heap(heap_.begin(), heap_.end());
  }

  // Bans an option; false where its tree has none left.
  bool ban(Node& node, std::int32_t option) const {
    if (node.is_banned[option]) return true;
    node.is_banned[option] = 1;
    const std::int32_t i = tree_of_[option];
    std::int32_t& best = node.chosen[i];
    while (best < first_[i + 1] && node.is_banned[best]) ++best;
    return best < first_[i + 1];
  }

  // A resource that two of the chosen options use, the first of the tree that stands first; or -1.
  std::int32_t conflict(const Node& node) {
    is_used_.assign(users_.size(), 0);
    std::int32_t least = -1;
    for (const std::int32_t o : node.chosen)
      for (const std::int32_t r : options_[o]->uses) {
        if (is_used_[r] && (least < 0 || r < least)) least = r;
        is_used_[r] = 1;
      }
    return least;
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
      for (const std::int32_t o : users_[resource])
        if (tree_of_[o] != owner) is_possible = is_possible && ban(child, o);
      for (std::int32_t o = first_[owner]; is_possible && o < first_[owner + 1]; ++o)
        if (!uses(o, resource)) is_possible = ban(child, o);
      if (is_possible) push(std::move(child));
    }
    Node child = node;
    bool is_possible = true;
    for (const std::int32_t o : users_[resource])
      if (is_claimant(tree_of_[o])) is_possible = is_possible && ban(child, o);
    if (is_possible) push(std::move(child));
  }

  // All of the node but what it chooses: trees up to i keep their options, tree i changes its own.
  void split_rest(const Node& node) {
    Node kept = node;
    for (std::int32_t i = 0; i < n_trees(); ++i) {
      Node child = kept;
      if (ban(child, node.chosen[i])) push(std::move(child));
      for (std::int32_t o = first_[i]; o < first_[i + 1]; ++o)
        if (o != node.chosen[i]) kept.is_banned[o] = 1;
    }
  }

  bool uses(std::int32_t option, std::int32_t resource) const {
    const std::vector<std::int32_t>& list = options_[option]->uses;
    return std::find(list.begin(), list.end(), resource) != list.end();
  }

  // A packing from the options chosen, of which several may want one resource: trees by what these are
  // worth at the prices, each by its best option that fits; then each by a better one, while there is any.
  std::vector<std::int32_t> repaired(const std::vector<std::int32_t>& chosen) {
    std::vector<std::int32_t> order(n_trees()), out(chosen);
    for (std::int32_t i = 0; i < n_trees(); ++i) order[i] = i;
    std::stable_sort(order.begin(), order.end(), [&](std::int32_t a, std::int32_t b) {
      return priced_[chosen[a]] > priced_[chosen[b]];
    });
    is_used_.assign(users_.size(), 0);
    for (const std::int32_t i : order) {
      if (!fits(out[i])) out[i] = best_fitting(i, priced_);
      mark(out[i], 1);
    }
    std::vector<double> worth;
    for (const PackingOption* o : options_) worth.push_back(o->worth);
    for (bool is_better = true; is_better;) {
      is_better = false;
      for (std::int32_t i = 0; i < n_trees(); ++i) {
        mark(out[i], 0);
        const std::int32_t best = best_fitting(i, worth);
        if (worth[best] > worth[out[i]] + kBetter) {
          out[i] = best;
          is_better = true;
        }
        mark(out[i], 1);
      }
    }
    return out;
  }
  bool fits(std::int32_t option) const {
    return std::ranges::none_of(options_[option]->uses, [&](std::int32_t r) { return is_used_[r]; });
  }
  void mark(std::int32_t option, char is_used) {
    for (const std::int32_t r : options_[option]->uses) is_used_[r] = is_used;
  }
  std::int32_t best_fitting(std::int32_t tree, const std::vector<double>& value) const {
    std::int32_t best = -1;
    for (std::int32_t o = first_[tree]; o < first_[tree + 1]; ++o)
      if ((best < 0 || value[o] > value[best]) && fits(o)) best = o;
    return best;
  }
  void keep_if_better(const std::vector<std::int32_t>& chosen) {
    Packing one = packing(chosen);
    if (known_.own.empty() || one.worth > known_.worth) known_ = std::move(one);
  }

  std::vector<const PackingOption*> options_;  // by tree, the best first
  std::vector<double> priced_, price_;         // of options: worth less prices; of resources
  std::vector<std::int32_t> number_;           // of an option within its tree, as the caller has it
  std::vector<std::vector<std::int32_t>> users_;
  std::vector<std::int32_t> first_, tree_of_;
  std::vector<Packing> packings_;
  Packing known_;  // the best that was met
  std::vector<Node> heap_;
  std::vector<char> is_used_;
  double drop_ = 0;  // of the search
  std::int64_t n_pushed_ = 0;
  std::int64_t n_left_ = 0;  // nodes that may still be taken
};

}  // namespace asterism
