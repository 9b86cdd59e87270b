// Exact marginals of all weighted matchings of a connected graph: a forward and a backward pass
// over the used sets of the frontier (solve/elimination.hpp).
//
//   F_t(s)  total weight of the choices of the steps before t that leave the used set s
//   B_t(s)  total weight of the choices of the steps from t on, given s
//   P(edge (v, u)) = Σ_{s: v, u free} F_t(s) weight_vu B_{t+1}(s + u) / Σ_s F_t(s) B_t(s)
//
// Layers are dense arrays over bit masks, scaled by powers of two so that the largest value is near
// 1. Only some of the F_t are kept and the others are recomputed. The memory is then about 2
// sqrt(all · largest) instead of all.
#pragma once

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <span>
#include <utility>
#include <vector>

#include "solve/elimination.hpp"

namespace asterism {

struct MatchingMarginals {
  std::vector<double> edge;   // probability that an edge is matched
  std::vector<double> alone;  // probability that a vertex is unmatched
  double log_total = 0;
  double bound = 0;  // of the total variation between the summed distribution and the full one
  std::int64_t n_states = 1;
};

// Its working memory serves many graphs.
class JointExact {
 public:
  MatchingMarginals solve(const MatchingGraph& graph, const Elimination& elimination) {
    graph_ = &graph;
    list_steps(elimination);
    MatchingMarginals out;
    out.edge.assign(graph_->weight.size(), 0);
    out.alone.assign(graph_->alone.size(), 0);
    choose_kept();
    const auto n = static_cast<std::int32_t>(steps_.size());
    layers_[0] = take(1);
    layers_[0][0] = 1;
    std::int64_t exponent = 0;
    for (std::int32_t t = 0; t < n; ++t) {
      exponent += forward(t);
      out.n_states = std::max(out.n_states, std::int64_t{1} << steps_[t].n_out);
      if (!is_kept_[t]) give_back(layers_[t]);
    }
    out.log_total = std::log(layers_[n][0]) + static_cast<double>(exponent) * std::log(2.0);
    give_back(layers_[n]);
    std::vector<double> after = take(1);
    after[0] = 1;
    for (std::int32_t t = n - 1; t >= 0; --t) {
      std::int32_t made = t;
      while (layers_[made].empty()) --made;
      for (; made < t; ++made) forward(made);
      std::vector<double> before = take(std::size_t{1} << n_in(t));
      out.bound += backward(t, after, before, out);
      std::swap(after, before);
      give_back(before);
      give_back(layers_[t]);
    }
    out.bound = out.bound < kNothing ? 0 : std::min(out.bound, 1.0);
    return out;
  }

 private:
  struct Option {
    std::int32_t bit, edge;
  };

  // `bit` is the vertex's own bit in the layer before, -1 if it is not in the frontier. Without
  // that bit the layer before has n_base bits; the bits of the entering vertices follow above them.
  struct Step {
    std::int32_t vertex = 0, bit = -1, n_base = 0, n_out = 0;
    std::span<const Option> options;
  };

  static constexpr std::int32_t kTileBits = 11;  // tiles that stay in the first-level cache
  static constexpr std::size_t kSmall = std::size_t{1} << 22;  // doubles that are always kept
  static constexpr double kNothing = 1e-17;  // an error far below rounding

  std::int32_t n_in(std::int32_t t) const { return steps_[t].n_base + (steps_[t].bit >= 0); }

  void list_steps(const Elimination& elimination) {
    frontier_.clear();
    steps_.clear();
    options_.clear();
    options_.reserve(graph_->weight.size());  // so that the spans stay valid
    for (const EliminationStep& from : elimination.steps(*graph_, links_)) {
      Step step;
      step.vertex = from.vertex;
      if (from.is_active) {
        const auto at = std::ranges::find(frontier_, from.vertex);
        step.bit = static_cast<std::int32_t>(at - frontier_.begin());
        frontier_.erase(at);
      }
      step.n_base = static_cast<std::int32_t>(frontier_.size());
      for (const Link& l : from.entering) frontier_.push_back(l.to);
      step.n_out = static_cast<std::int32_t>(frontier_.size());
      const std::size_t begin = options_.size();
      for (const Link& l : from.links) {
        const auto at = std::ranges::find(frontier_, l.to);
        options_.push_back({static_cast<std::int32_t>(at - frontier_.begin()), l.edge});
      }
      step.options = std::span<const Option>(options_).subspan(begin);
      steps_.push_back(step);
    }
    layers_.resize(steps_.size() + 1);
  }

  void choose_kept() {
    double all = 0, largest = 0, run = 0;
    const auto n = static_cast<std::int32_t>(steps_.size());
    const auto size = [&](std::int32_t t) { return std::ldexp(1.0, n_in(t)); };
    for (std::int32_t t = 0; t < n; ++t) {
      all += size(t);
      largest = std::max(largest, size(t));
    }
    is_kept_.assign(n, all <= static_cast<double>(kSmall));
    if (is_kept_[0]) return;
    const double limit = std::sqrt(all * largest);
    is_kept_[0] = 1;
    for (std::int32_t t = 1; t < n; ++t) {
      run += size(t);
      if (run < limit) continue;
      is_kept_[t] = 1;
      run = 0;
    }
  }

  std::vector<double> take(std::size_t size) {
    if (spare_.empty()) return std::vector<double>(size);
    std::vector<double> layer = std::move(spare_.back());
    spare_.pop_back();
    layer.resize(size);
    return layer;
  }
  void give_back(std::vector<double>& layer) {
    if (layer.capacity() > 0) spare_.push_back(std::move(layer));
    layer = {};
  }

  // Splits a layer by the bit of the vertex itself, into the states where it is free and where it
  // is used.
  void split(std::int32_t t) {
    const Step& step = steps_[t];
    if (step.bit < 0) return;
    const std::size_t size = std::size_t{1} << step.n_base, run = std::size_t{1} << step.bit;
    free_.resize(size);
    used_.resize(size);
    const double* in = layers_[t].data();
    for (std::size_t s = 0; s < size; s += run, in += 2 * run) {
      std::copy_n(in, run, free_.data() + s);
      std::copy_n(in + run, run, used_.data() + s);
    }
  }

  // After n steps at most n vertices are used, so tiles with more bits are zero.
  static bool is_reached(std::size_t tile, std::int32_t n_steps) {
    return std::popcount(tile) <= n_steps;
  }

  // Computes layers_[t + 1] from layers_[t]. Returns the exponent of the power of two removed.
  std::int64_t forward(std::int32_t t) {
    const Step& step = steps_[t];
    split(t);
    const bool is_active = step.bit >= 0;
    const double* free = is_active ? free_.data() : layers_[t].data();
    const std::size_t size = std::size_t{1} << step.n_base;
    const std::size_t tile = std::min(size, std::size_t{1} << kTileBits);
    const double alone = graph_->alone[step.vertex];
    layers_[t + 1] = take(std::size_t{1} << step.n_out);
    double* out = layers_[t + 1].data();
    std::fill(out + size, out + (std::size_t{1} << step.n_out), 0.0);
    for (std::size_t at = 0; at < size; at += tile) {
      if (!is_reached(at / tile, t + 1)) {
        std::fill_n(out + at, tile, 0.0);
        continue;
      }
      for (std::size_t s = at; s < at + tile; ++s) out[s] = alone * free[s];
      if (is_active)
        for (std::size_t s = at; s < at + tile; ++s) out[s] += used_[s];
      for (const Option& option : step.options) {
        const std::size_t bit = std::size_t{1} << option.bit;
        const double w = graph_->weight[option.edge];
        if (bit >= size)
          add(out + bit + at, free + at, w, tile);
        else if (bit >= tile) {
          if (at & bit) add(out + at, free + (at ^ bit), w, tile);
        } else
          for (std::size_t s = at; s < at + tile; s += 2 * bit)
            add(out + s + bit, free + s, w, bit);
      }
    }
    return scale(layers_[t + 1]);
  }

  // Computes `before` from `after`, and the marginals of step t. Returns a bound of the fraction of
  // the mass that underflow may have lost.
  double backward(std::int32_t t, const std::vector<double>& after, std::vector<double>& before,
                  MatchingMarginals& marginals) {
    const Step& step = steps_[t];
    split(t);
    const bool is_active = step.bit >= 0;
    const double* free = is_active ? free_.data() : layers_[t].data();
    const std::size_t size = std::size_t{1} << step.n_base;
    const std::size_t tile = std::min(size, std::size_t{1} << kTileBits);
    const double alone = graph_->alone[step.vertex];
    rest_.resize(is_active ? size : 0);
    double* rest = is_active ? rest_.data() : before.data();
    sums_.assign(step.options.size(), 0);
    double sum_alone = 0, sum_used = 0;
    for (std::size_t at = 0; at < size; at += tile) {
      std::fill_n(rest + at, tile, 0.0);
      if (!is_reached(at / tile, t)) continue;
      sum_alone += add(rest + at, after.data() + at, alone, free + at, tile);
      if (is_active) sum_used += dot(used_.data() + at, after.data() + at, tile);
      for (std::size_t k = 0; k < step.options.size(); ++k) {
        const std::size_t bit = std::size_t{1} << step.options[k].bit;
        const double w = graph_->weight[step.options[k].edge];
        if (bit >= tile) {
          if (!(at & bit))
            sums_[k] += add(rest + at, after.data() + (at | bit), w, free + at, tile);
        } else
          for (std::size_t s = at; s < at + tile; s += 2 * bit)
            sums_[k] += add(rest + s, after.data() + s + bit, w, free + s, bit);
      }
    }
    double total = alone * sum_alone + sum_used;
    for (std::size_t k = 0; k < sums_.size(); ++k)
      total += sums_[k] *= graph_->weight[step.options[k].edge];
    if (is_active) {
      const std::size_t run = std::size_t{1} << step.bit;
      double* in = before.data();
      for (std::size_t s = 0; s < size; s += run, in += 2 * run) {
        std::copy_n(rest_.data() + s, run, in);
        std::copy_n(after.data() + s, run, in + run);
      }
    }
    scale(before);
    for (std::size_t k = 0; k < sums_.size(); ++k)
      marginals.edge[step.options[k].edge] = sums_[k] / total;
    marginals.alone[step.vertex] = alone * sum_alone / total;
    // Every value of a layer may have lost a few times the smallest normal number; the largest
    // value of either layer is near 1.
    const auto n_lost = static_cast<double>((step.options.size() + 2) << n_in(t));
    return 4 * n_lost * std::numeric_limits<double>::min() / total;
  }

  static void add(double* to, const double* from, double w, std::size_t n) {
    for (std::size_t i = 0; i < n; ++i) to[i] += w * from[i];
  }

  // to += w · from; returns Σ by · from. Four partial sums break the dependency chain, so that the
  // processor adds them in parallel.
  static double add(double* to, const double* from, double w, const double* by, std::size_t n) {
    if (n < 4) {
      double sum = 0;
      for (std::size_t i = 0; i < n; ++i) {
        to[i] += w * from[i];
        sum += by[i] * from[i];
      }
      return sum;
    }
    double sum[4] = {0, 0, 0, 0};
    for (std::size_t i = 0; i < n; i += 4)
      for (std::size_t k = 0; k < 4; ++k) {
        to[i + k] += w * from[i + k];
        sum[k] += by[i + k] * from[i + k];
      }
    return (sum[0] + sum[1]) + (sum[2] + sum[3]);
  }

  static double dot(const double* a, const double* b, std::size_t n) {
    double sum = 0;
    for (std::size_t i = 0; i < n; ++i) sum += a[i] * b[i];
    return sum;
  }

  static std::int64_t scale(std::vector<double>& layer) {
    double largest = 0;
    for (const double x : layer) largest = std::max(largest, x);
    if (largest == 0) return 0;
    const int exponent = std::ilogb(largest);
    if (exponent == 0) return 0;
    // In two factors, because the inverse of a very small number overflows.
    const double a = std::ldexp(1.0, -exponent / 2), b = std::ldexp(1.0, -exponent + exponent / 2);
    for (double& x : layer) x = x * a * b;
    return exponent;
  }

  const MatchingGraph* graph_ = nullptr;
  std::vector<Step> steps_;
  std::vector<Link> links_;           // of the elimination
  std::vector<std::int32_t> frontier_;
  std::vector<Option> options_;       // by step
  std::vector<std::vector<double>> layers_, spare_;
  std::vector<char> is_kept_;
  std::vector<double> free_, used_, rest_, sums_;
};

}  // namespace asterism
