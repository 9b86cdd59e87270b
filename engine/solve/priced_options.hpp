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
#include <span>
#include <utility>
#include <vector>

namespace asterism {

// An option of a tree: its log weight and the resources that it uses.
struct PackingOption {
  double log_weight = 0;
  std::vector<std::int32_t> uses;
};

class PricedOptions {
 protected:
  static constexpr double kBetter = 1e-9;

  struct Packing {
    std::vector<std::int32_t> own;  // option of each tree, in the caller's numbering
    double log_weight = 0;
  };

  explicit PricedOptions(std::span<const std::vector<PackingOption>> trees) {
    for (const auto& options : trees) {
      first_.push_back(static_cast<std::int32_t>(options_.size()));
      for (const PackingOption& option : options) {
        options_.push_back(&option);
        reduced_.push_back(option.log_weight);
      }
    }
    first_.push_back(static_cast<std::int32_t>(options_.size()));
    std::int32_t n_resources = 0;
    for (const PackingOption* o : options_)
      for (const std::int32_t r : o->uses) n_resources = std::max(n_resources, r + 1);
    price_.assign(n_resources, 0);
    sort();
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
  std::int32_t n_trees() const { return static_cast<std::int32_t>(first_.size()) - 1; }

  // Sorts the options of every tree by reduced weight, largest first, and lists the users of each
  // resource.
  void sort() {
    std::vector<std::int32_t> order(options_.size());
    for (std::size_t o = 0; o < order.size(); ++o) order[o] = static_cast<std::int32_t>(o);
    for (std::size_t i = 0; i + 1 < first_.size(); ++i)
      std::stable_sort(order.begin() + first_[i], order.begin() + first_[i + 1],
                       [&](std::int32_t a, std::int32_t b) { return reduced_[a] > reduced_[b]; });
    std::vector<const PackingOption*> options;
    std::vector<double> reduced;
    std::vector<std::int32_t> number;
    for (const std::int32_t o : order) {
      options.push_back(options_[o]);
      reduced.push_back(reduced_[o]);
      number.push_back(number_.empty() ? o - first_[tree_of(o)] : number_[o]);
    }
    options_ = std::move(options);
    reduced_ = std::move(reduced);
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
        for (const std::int32_t r : options_[chosen[i]]->uses) used[r] += 1;
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
  void reprice(const std::vector<double>& price) {
    for (std::size_t o = 0; o < options_.size(); ++o) {
      reduced_[o] = options_[o]->log_weight;
      for (const std::int32_t r : options_[o]->uses) reduced_[o] -= price[r];
    }
  }

  Packing packing(const std::vector<std::int32_t>& chosen) const {
    Packing out;
    for (const std::int32_t o : chosen) {
      out.own.push_back(number_[o]);
      out.log_weight += options_[o]->log_weight;
    }
    return out;
  }

  bool uses(std::int32_t option, std::int32_t resource) const {
    const std::vector<std::int32_t>& list = options_[option]->uses;
    return std::find(list.begin(), list.end(), resource) != list.end();
  }

  // Makes a packing of the chosen options, of which several may use one resource. Trees take the
  // best option that fits, in the order of the reduced weights of their chosen options. Then single
  // trees are improved until none can be.
  std::vector<std::int32_t> repaired(const std::vector<std::int32_t>& chosen) {
    std::vector<std::int32_t> order(n_trees()), out(chosen);
    for (std::int32_t i = 0; i < n_trees(); ++i) order[i] = i;
    std::stable_sort(order.begin(), order.end(), [&](std::int32_t a, std::int32_t b) {
      return reduced_[chosen[a]] > reduced_[chosen[b]];
    });
    is_used_.assign(users_.size(), 0);
    for (const std::int32_t i : order) {
      if (!fits(out[i])) out[i] = best_fitting(i, reduced_);
      mark(out[i], 1);
    }
    std::vector<double> log_weight;
    for (const PackingOption* o : options_) log_weight.push_back(o->log_weight);
    for (bool is_better = true; is_better;) {
      is_better = false;
      for (std::int32_t i = 0; i < n_trees(); ++i) {
        mark(out[i], 0);
        const std::int32_t best = best_fitting(i, log_weight);
        if (log_weight[best] > log_weight[out[i]] + kBetter) {
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
    if (known_.own.empty() || one.log_weight > known_.log_weight) known_ = std::move(one);
  }

  std::vector<const PackingOption*> options_;  // by tree, the best first
  std::vector<double> reduced_, price_;  // reduced weight of each option; price of each resource
  std::vector<std::int32_t> number_;  // of an option within its tree, in the caller's numbering
  std::vector<std::vector<std::int32_t>> users_;
  std::vector<std::int32_t> first_, tree_of_;
  Packing known_;  // the best packing found so far
  std::vector<char> is_used_;

 private:
  static constexpr int kPriceRounds = 300;
  static constexpr double kClosed = 1e-3;  // duality gap at which the descent stops
};

}  // namespace asterism
