// The best ways for all trees of a cluster to take one option each, no resource twice: weighted set
// packing, exactly, and the k best in order.
//
// Best first. A node allows each tree some of its options and is worth at most the sum of their best
// ones. Where two of these want one resource, the node is split by who has it; where none do, they are
// the best of the node, and the rest of it is split as Murty does. The parts never overlap, so that
// every packing comes once.
#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>
#include <span>
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
      order_of_.emplace_back();
      for (std::size_t k = 0; k < options.size(); ++k)
        order_of_.back().push_back(static_cast<std::int32_t>(k));
      std::stable_sort(order_of_.back().begin(), order_of_.back().end(),
                       [&](std::int32_t a, std::int32_t b) { return options[a].worth > options[b].worth; });
      for (const std::int32_t k : order_of_.back()) options_.push_back(&options[k]);
    }
    first_.push_back(static_cast<std::int32_t>(options_.size()));
    std::int32_t n_resources = 0;
    for (const PackingOption* o : options_)
      for (const std::int32_t r : o->uses) n_resources = std::max(n_resources, r + 1);
    users_.resize(n_resources);
    for (std::size_t o = 0; o < options_.size(); ++o)
      for (const std::int32_t r : options_[o]->uses) users_[r].push_back(static_cast<std::int32_t>(o));
    tree_of_.resize(options_.size());
    for (std::size_t i = 0; i + 1 < first_.size(); ++i)
      for (std::int32_t o = first_[i]; o < first_[i + 1]; ++o) tree_of_[o] = static_cast<std::int32_t>(i);
  }

  // Calls found(option of each tree, worth) for up to k packings, the best first, none of them more
  // than `drop` below it. With more than `max_nodes` nodes the best that can be repaired is given.
  template <typename Found>
  PackingSummary solve(std::int64_t k, double drop, std::int64_t max_nodes, Found&& found) {
    PackingSummary summary;
    Node root;
    root.is_banned.assign(options_.size(), 0);
    root.chosen.resize(n_trees());
    for (std::int32_t i = 0; i < n_trees(); ++i) root.chosen[i] = first_[i];
    push(std::move(root));
    double best = -std::numeric_limits<double>::infinity();
    std::int64_t n_found = 0;
    summary.bound = heap_.front().bound;
    while (!heap_.empty() && n_found < k) {
      std::pop_heap(heap_.begin(), heap_.end());
      const Node node = std::move(heap_.back());
      heap_.pop_back();
      if (n_found > 0 && node.bound < best - drop) break;
      if (++summary.n_nodes > max_nodes) {
        summary.is_exact = false;
        if (n_found == 0) summary.bound = node.bound;
        if (n_found == 0) give(repaired(node), found);
        return summary;
      }
      const std::int32_t contested = conflict(node);
      if (contested >= 0) {
        split_by_owner(node, contested);
        continue;
      }
      if (n_found++ == 0) summary.bound = best = node.bound;
      give(node.chosen, found);
      if (n_found < k) split_rest(node);
    }
    return summary;
  }

 private:
  struct Node {
    double bound = 0;
    std::int64_t number = 0;
    std::vector<char> is_banned;        // by option
    std::vector<std::int32_t> chosen;  // best allowed option of each tree

    bool operator<(const Node& other) const {
      return bound != other.bound ? bound < other.bound : number > other.number;
    }
  };

  std::int32_t n_trees() const { return static_cast<std::int32_t>(first_.size()) - 1; }

  template <typename Found>
  void give(const std::vector<std::int32_t>& chosen, Found&& found) const {
    std::vector<std::int32_t> own(chosen.size());
    double worth = 0;
    for (std::int32_t i = 0; i < n_trees(); ++i) {
      own[i] = order_of_[i][chosen[i] - first_[i]];
      worth += options_[chosen[i]]->worth;
    }
    found(std::span<const std::int32_t>(own), worth);
  }

  void push(Node node) {
    node.bound = 0;
    for (std::int32_t i = 0; i < n_trees(); ++i) node.bound += options_[node.chosen[i]]->worth;
    node.number = n_pushed_++;
    heap_.push_back(std::move(node));
    std::push_heap(heap_.begin(), heap_.end());
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

  // A packing from a node that was not solved: trees by worth, each by its best option that fits.
  std::vector<std::int32_t> repaired(const Node& node) {
    std::vector<std::int32_t> order(n_trees()), out(n_trees());
    for (std::int32_t i = 0; i < n_trees(); ++i) order[i] = i;
    std::stable_sort(order.begin(), order.end(), [&](std::int32_t a, std::int32_t b) {
      return options_[node.chosen[a]]->worth > options_[node.chosen[b]]->worth;
    });
    is_used_.assign(users_.size(), 0);
    for (const std::int32_t i : order) {
      out[i] = first_[i];
      while (std::any_of(options_[out[i]]->uses.begin(), options_[out[i]]->uses.end(),
                         [&](std::int32_t r) { return is_used_[r]; }))
        ++out[i];
      for (const std::int32_t r : options_[out[i]]->uses) is_used_[r] = 1;
    }
    return out;
  }

  std::vector<const PackingOption*> options_;  // by tree, the best first
  std::vector<std::vector<std::int32_t>> order_of_, users_;
  std::vector<std::int32_t> first_, tree_of_;
  std::vector<Node> heap_;
  std::vector<char> is_used_;
  std::int64_t n_pushed_ = 0;
};

}  // namespace asterism
