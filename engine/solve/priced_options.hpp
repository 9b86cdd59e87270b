// Lagrangian relaxation of a set packing: the options of the hypothesis trees of a cluster, dual
// prices of the resources, and the best packing found so far.
//
// At given prices, the reduced weight of an option is its weight minus the prices of its resources.
// The sum of all prices and of the largest reduced weight of each tree bounds the weight of every
// packing.
#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>
#include <numeric>
#include <span>
#include <utility>
#include <vector>

namespace asterism {

// An option of a tree: its log weight and the resources that it uses, which the caller keeps.
struct PackingOption {
  double log_weight = 0;
  std::span<const std::int32_t> uses;
};

class PricedOptions {
 protected:
  static constexpr double kBetter = 1e-9;

  struct Option {
    double log_weight = 0;
    std::int32_t begin = 0, end = 0;  // of its resources in `uses_`
    std::int32_t number = 0;
  };
  struct Packing {
    std::vector<std::int32_t> own;  // option of each tree, in the caller's numbering
    double log_weight = 0;
  };

  // The resources that occur are numbered anew, in their order, because a cluster uses few of them.
  explicit PricedOptions(std::span<const std::vector<PackingOption>> trees) {
    thread_local std::vector<std::int32_t> new_number;  // by resource, -1 between the calls
    std::vector<std::int32_t> resources;
    std::size_t n_all = 0, n_uses = 0;
    for (const auto& options : trees)
      for (const PackingOption& option : options) {
        ++n_all;
        n_uses += option.uses.size();
        for (const std::int32_t r : option.uses) {
          if (r >= static_cast<std::int32_t>(new_number.size())) new_number.resize(r + 1, -1);
          if (std::exchange(new_number[r], 0) < 0) resources.push_back(r);
        }
      }
    options_.reserve(n_all);
    reduced_.reserve(n_all);
    uses_.reserve(n_uses);
    std::ranges::sort(resources);
    for (std::size_t k = 0; k < resources.size(); ++k)
      new_number[resources[k]] = static_cast<std::int32_t>(k);
    for (const auto& options : trees) {
      first_.push_back(n_options());
      for (const PackingOption& option : options) {
        const auto begin = static_cast<std::int32_t>(uses_.size());
        for (const std::int32_t r : option.uses) uses_.push_back(new_number[r]);
        options_.push_back({option.log_weight, begin, static_cast<std::int32_t>(uses_.size()),
                            n_options() - first_.back()});
        reduced_.push_back(option.log_weight);
      }
    }
    first_.push_back(n_options());
    for (const std::int32_t r : resources) new_number[r] = -1;
    price_.assign(resources.size(), 0);
    describe();
  }

  double max_reduced(std::int32_t tree) const {
    return *std::max_element(reduced_.begin() + first_[tree], reduced_.begin() + first_[tree + 1]);
  }
  // Upper bound of the weight of a packing, at the prices.
  double bound() const {
    double sum = 0;
    for (const double x : price_) sum += x;
    for (std::int32_t i = 0; i < n_trees(); ++i) sum += max_reduced(i);
    return sum;
  }
  std::int32_t n_options() const { return static_cast<std::int32_t>(options_.size()); }
  double log_weight(std::int32_t option) const { return options_[option].log_weight; }
  // Number of an option within its tree, in the caller's numbering.
  std::int32_t number(std::int32_t option) const { return options_[option].number; }
  std::span<const std::int32_t> uses_of(const Option& option) const {
    return std::span(uses_).subspan(option.begin, option.end - option.begin);
  }
  std::span<const std::int32_t> uses_of(std::int32_t option) const {
    return uses_of(options_[option]);
  }
  std::int32_t n_trees() const { return static_cast<std::int32_t>(first_.size()) - 1; }

  // Sorts the options of every tree by reduced weight, largest first, and lists the users of each
  // resource.
  void sort() {
    std::vector<std::int32_t> order(options_.size());
    for (std::size_t o = 0; o < order.size(); ++o) order[o] = static_cast<std::int32_t>(o);
    for (std::size_t i = 0; i + 1 < first_.size(); ++i)
      std::sort(order.begin() + first_[i], order.begin() + first_[i + 1],
                [&](std::int32_t a, std::int32_t b) {
                  return reduced_[a] != reduced_[b] ? reduced_[a] > reduced_[b] : a < b;
                });
    std::vector<Option> options;
    std::vector<double> reduced;
    for (const std::int32_t o : order) {
      options.push_back(options_[o]);
      reduced.push_back(reduced_[o]);
    }
    options_ = std::move(options);
    reduced_ = std::move(reduced);
    list_users();
    describe();
  }
  // Computes the tree of each option, and the largest weight of each tree.
  void describe() {
    tree_of_.resize(options_.size());
    max_log_weight_.assign(n_trees(), -std::numeric_limits<double>::infinity());
    for (std::int32_t i = 0; i < n_trees(); ++i)
      for (std::int32_t o = first_[i]; o < first_[i + 1]; ++o) {
        tree_of_[o] = i;
        max_log_weight_[i] = std::max(max_log_weight_[i], log_weight(o));
      }
  }
  void list_users() {
    first_user_.assign(price_.size() + 1, 0);
    for (std::int32_t o = 0; o < n_options(); ++o)
      for (const std::int32_t r : uses_of(o)) ++first_user_[r + 1];
    std::partial_sum(first_user_.begin(), first_user_.end(), first_user_.begin());
    std::vector<std::int32_t> next(first_user_.begin(), first_user_.end() - 1);
    users_.resize(first_user_.back());
    for (std::int32_t o = 0; o < n_options(); ++o)
      for (const std::int32_t r : uses_of(o)) users_[next[r]++] = o;
  }
  // The options that use a resource.
  std::span<const std::int32_t> users_of(std::int32_t resource) const {
    return std::span(users_).subspan(first_user_[resource],
                                     first_user_[resource + 1] - first_user_[resource]);
  }

  // Lowers the bound by descent on the prices: the price of a resource rises if several chosen
  // options use it, and falls if none does. The direction is a deflected subgradient (Camerini,
  // Fratta & Maffioli 1975), the step length follows the best known packing (Polyak 1969). The
  // options chosen in a round are repaired into a packing, which may replace the best known one
  // unless that is proven optimal.
  void set_prices(bool is_best) {
    double min_dual = std::numeric_limits<double>::infinity(), step = 1;
    std::vector<double> price(price_.size(), 0), used(price_.size()), way(price_.size(), 0);
    std::vector<std::int32_t> chosen(n_trees());
    int n_idle = 0;
    for (int round = 0; round < kPriceRounds && step > 1e-3; ++round) {
      double dual = 0, length = 0;
      for (const double x : price) dual += x;
      std::fill(used.begin(), used.end(), 0);
      reprice(price);
      for (std::int32_t i = 0; i < n_trees(); ++i) {
        chosen[i] = static_cast<std::int32_t>(
            std::max_element(reduced_.begin() + first_[i], reduced_.begin() + first_[i + 1]) -
            reduced_.begin());
        dual += reduced_[chosen[i]];
        for (const std::int32_t r : uses_of(chosen[i])) used[r] += 1;
      }
      if (dual < min_dual - kBetter) {
        min_dual = dual;
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
      if (!(min_dual > known_.log_weight + kClosed)) break;
      double along = 0, own = 0;
      for (std::size_t r = 0; r < price.size(); ++r) {
        // An unused resource of price zero needs no change.
        if (used[r] < 1 && price[r] <= 0) used[r] = 1;
        along += (1 - used[r]) * way[r];
        own += way[r] * way[r];
        length += (1 - used[r]) * (1 - used[r]);
      }
      if (length == 0) break;  // no conflict is left, so the bound is attained
      const double memory = along < 0 && own > 0 ? -1.5 * along / own : 0;
      double size = 0;
      for (std::size_t r = 0; r < price.size(); ++r) {
        way[r] = (1 - used[r]) + memory * way[r];
        size += way[r] * way[r];
      }
      if (size == 0) break;
      for (std::size_t r = 0; r < price.size(); ++r)
        price[r] = std::max(price[r] - step * (dual - known_.log_weight) / size * way[r], 0.0);
    }
    reprice(price_);
  }
  // The lists that `keep_core` shortens.
  struct OptionLists {
    std::vector<Option> options;
    std::vector<double> reduced;
    std::vector<std::int32_t> first;
  };
  // Leaves only the options that a packing better than the known one may contain, and those without
  // resources, so that a packing exists. The loss of an option at the prices must not exceed the
  // duality gap. Returns all options.
  OptionLists keep_core() {
    OptionLists all{options_, reduced_, first_};
    const double gap = bound() - known_.log_weight;
    std::int32_t n = 0;
    for (std::int32_t i = 0; i < n_trees(); ++i) {
      const double min_reduced = max_reduced(i) - gap - kBetter;
      first_[i] = n;
      for (std::int32_t o = all.first[i]; o < all.first[i + 1]; ++o) {
        if (all.reduced[o] < min_reduced && !uses_of(all.options[o]).empty()) continue;
        options_[n] = all.options[o];
        reduced_[n++] = all.reduced[o];
      }
    }
    first_.back() = n;
    options_.resize(n);
    reduced_.resize(n);
    sort();
    return all;
  }
  void restore(OptionLists all) {
    options_ = std::move(all.options);
    reduced_ = std::move(all.reduced);
    first_ = std::move(all.first);
    describe();
  }
  void reprice(const std::vector<double>& price) {
    for (std::int32_t o = 0; o < n_options(); ++o) {
      reduced_[o] = log_weight(o);
      for (const std::int32_t r : uses_of(o)) reduced_[o] -= price[r];
    }
  }

  Packing packing(const std::vector<std::int32_t>& chosen) const {
    Packing out;
    for (const std::int32_t o : chosen) {
      out.own.push_back(number(o));
      out.log_weight += log_weight(o);
    }
    return out;
  }

  bool uses(std::int32_t option, std::int32_t resource) const {
    return std::ranges::find(uses_of(option), resource) != uses_of(option).end();
  }

  // Makes a packing of the chosen options, of which several may use one resource. Trees take the
  // best option that fits, in the order of the reduced weights of their chosen options. Then single
  // trees are improved until none can be.
  std::vector<std::int32_t> repaired(const std::vector<std::int32_t>& chosen) {
    std::vector<std::int32_t> order(n_trees()), out(chosen);
    for (std::int32_t i = 0; i < n_trees(); ++i) order[i] = i;
    std::ranges::sort(order, [&](std::int32_t a, std::int32_t b) {
      const double x = reduced_[chosen[a]], y = reduced_[chosen[b]];
      return x != y ? x > y : a < b;
    });
    is_used_.assign(price_.size(), 0);
    for (const std::int32_t i : order) {
      if (!fits(out[i])) out[i] = best_fitting(i, [&](std::int32_t o) { return reduced_[o]; });
      mark(out[i], 1);
    }
    for (bool is_better = true; is_better;) {
      is_better = false;
      for (std::int32_t i = 0; i < n_trees(); ++i) {
        if (!(max_log_weight_[i] > log_weight(out[i]) + kBetter)) continue;
        mark(out[i], 0);
        const std::int32_t best =
            best_fitting(i, [&](std::int32_t o) { return log_weight(o); });
        if (log_weight(best) > log_weight(out[i]) + kBetter) {
          out[i] = best;
          is_better = true;
        }
        mark(out[i], 1);
      }
    }
    return out;
  }
  bool fits(std::int32_t option) const {
    return std::ranges::none_of(uses_of(option), [&](std::int32_t r) { return is_used_[r]; });
  }
  void mark(std::int32_t option, char is_used) {
    for (const std::int32_t r : uses_of(option)) is_used_[r] = is_used;
  }
  template <typename Value>
  std::int32_t best_fitting(std::int32_t tree, Value&& value) const {
    std::int32_t best = -1;
    for (std::int32_t o = first_[tree]; o < first_[tree + 1]; ++o)
      if ((best < 0 || value(o) > value(best)) && fits(o)) best = o;
    return best;
  }
  void keep_if_better(const std::vector<std::int32_t>& chosen) {
    Packing one = packing(chosen);
    if (known_.own.empty() || one.log_weight > known_.log_weight) known_ = std::move(one);
  }

  std::vector<Option> options_;  // by tree, the best first
  std::vector<std::int32_t> uses_;
  std::vector<double> reduced_, price_;  // reduced weight of each option; price of each resource
  std::vector<double> max_log_weight_;   // of the options of each tree
  std::vector<std::int32_t> users_, first_user_;  // of resource r: first_user_[r] to [r + 1]
  std::vector<std::int32_t> first_, tree_of_;
  Packing known_;  // the best packing found so far
  std::vector<char> is_used_;

 private:
  static constexpr int kPriceRounds = 300;
  static constexpr double kClosed = 1e-3;  // duality gap at which the descent stops
};

}  // namespace asterism
