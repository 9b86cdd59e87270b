// Marginals of weighted matchings whose frontier is too wide for solve/joint_exact.hpp: the same
// sum over the heaviest states only, with a proven bound of the omitted mass.
//
//   F(s) ≤ mass that reaches state s;  B(s) ≤ U(s);  dropped mass D ≤ Σ_dropped F(s) U(s)
//   the kept events have mass Z and all events at most Z + D, so the total variation between the
//   two distributions is at most D / (Z + D)
//
// U comes from a backward pass that follows the use of some vertices and ignores that of the
// others. For an ignored vertex it takes the larger of the values as used and as unused, when the
// vertex is summed out. The bound is tightest if the weights are scaled first: the options of a
// track sum to 1, and so do those of a detection that several tracks compete for.
#pragma once

#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numeric>
#include <span>
#include <utility>
#include <vector>

#include "math/log_sums.hpp"
#include "solve/elimination.hpp"
#include "solve/joint_exact.hpp"
#include "solve/used_sets.hpp"

namespace asterism {

template <std::size_t W>
class JointBeam {
 public:
  // `partner` is the best matching, whose states are never dropped. Vertices below `n_tracks` are
  // tracks.
  JointBeam(const MatchingGraph& graph, const Elimination& elimination, std::int32_t n_tracks,
            std::span<const std::int32_t> partner, std::int64_t max_states)
      : graph_(graph), steps_(elimination.steps(graph_, links_)), partner_(partner), max_states_(max_states) {
    log_scale_ = balance(n_tracks);
    choose_slots();
    choose_followed();
  }

  MatchingMarginals solve() {
    bound_completions();
    MatchingMarginals out;
    out.edge.assign(graph_.weight.size(), 0);
    out.alone.assign(graph_.alone.size(), 0);
    const std::size_t n = steps_.size();
    layers_.resize(n + 1);
    layers_[0] = {{Set{}}, {1.0}, 0};
    best_.assign(1, Set{});
    std::int64_t n_all_dropped = 0;
    double log_all_dropped = -std::numeric_limits<double>::infinity();
    // Some layers are kept and the others are recomputed, as in solve/joint_exact.hpp.
    const auto stride = static_cast<std::size_t>(std::sqrt(static_cast<double>(n)));
    for (std::size_t t = 0; t < n; ++t) {
      const auto [log_dropped, n_dropped] = prune(t);
      n_all_dropped += n_dropped;
      log_all_dropped = log_sum(log_all_dropped, log_dropped);
      forward(t);
      out.n_states = std::max(out.n_states, static_cast<std::int64_t>(layers_[t + 1].sets.size()));
      advance(t);
      if (t % stride != 0) layers_[t] = {};
    }
    const double log_kept = log_of(layers_[n].values[0], layers_[n].exponent);
    out.log_total = log_kept + log_scale_;
    backward(out);
    const double share = 1 / (1 + std::exp(log_kept - log_all_dropped));
    if (n_all_dropped > 0 || share > kNothing)
      out.bound = std::min(1.0, share * (1 + kRounding) + kRounding * kRounding);
    return out;
  }

 private:
  using Set = UsedSet<W>;
  struct Layer {
    std::vector<Set> sets;
    std::vector<double> values;
    std::int64_t exponent = 0;
  };

  static constexpr std::int32_t kMaxFollowed = 16, kBalanceRounds = 200;
  static constexpr double kNothing = 1e-17;  // an error far below rounding
  static constexpr double kRounding = 1e-7;  // far above the rounding of the log of a mass

  static double log_of(double value, std::int64_t exponent) {
    return std::log(value) + static_cast<double>(exponent) * std::log(2.0);
  }

  // Divides all values by the power of two that brings the largest near 1. Returns its exponent.
  static std::int64_t scale(std::vector<double>& values) {
    const double largest = *std::max_element(values.begin(), values.end());
    if (largest == 0) return 0;
    const int exponent = std::ilogb(largest);
    for (double& x : values) x = std::ldexp(x, -exponent);
    return exponent;
  }

  // Scales the options of every track to sum to 1. The options of a detection are scaled to sum to
  // 1 too, unless it is more likely unused. Returns the log of the factor removed.
  double balance(std::int32_t n_tracks) {
    const std::int32_t n = graph_.size();
    std::vector<double> x(n, 1.0);
    const auto wanted = [&](std::int32_t v) {
      double sum = 0;
      for (const Link& l : graph_.links_of(v)) sum += graph_.weight[l.edge] * x[l.to];
      return sum;
    };
    for (std::int32_t round = 0; round <= kBalanceRounds; ++round) {
      if (round > 0)
        for (std::int32_t v = n_tracks; v < n; ++v) x[v] = 1 / std::max(graph_.alone[v], wanted(v));
      for (std::int32_t v = 0; v < n_tracks; ++v) x[v] = 1 / (graph_.alone[v] + wanted(v));
    }
    double log_scale = 0;
    for (std::int32_t v = 0; v < n; ++v) {
      graph_.alone[v] *= x[v];
      log_scale -= std::log(x[v]);
      if (v < n_tracks)
        for (const Link& l : graph_.links_of(v)) graph_.weight[l.edge] *= x[v] * x[l.to];
    }
    return log_scale;
  }

  // Assigns a slot to each vertex while it is in the frontier, and records the steps in which it
  // enters and leaves. The vertex of a step releases its slot before the entering vertices take
  // theirs. The number of slots is then at most the size of the largest frontier, from which W is
  // chosen.
  void choose_slots() {
    slot_.assign(graph_.size(), -1);
    enters_.assign(graph_.size(), -1);
    leaves_.assign(graph_.size(), -1);
    std::vector<std::int32_t> spare;
    std::int32_t n_slots = 0;
    for (std::size_t t = 0; t < steps_.size(); ++t) {
      const std::int32_t v = steps_[t].vertex;
      leaves_[v] = static_cast<std::int32_t>(t);
      if (slot_[v] >= 0) spare.push_back(slot_[v]);
      for (const auto& [u, edge] : steps_[t].entering) {
        if (spare.empty()) spare.push_back(n_slots++);
        slot_[u] = spare.back();
        spare.pop_back();
        enters_[u] = static_cast<std::int32_t>(t);
      }
    }
    assert(n_slots <= static_cast<std::int32_t>(64 * W));
  }

  // The backward pass follows the vertices with the strongest conflicts, as far as the state limit
  // allows.
  void choose_followed() {
    const auto n = static_cast<std::int32_t>(steps_.size());
    std::vector<double> conflict(n, 0);
    for (std::int32_t v = 0; v < n; ++v) {
      double sum = 0, squares = 0;
      for (const Link& l : graph_.links_of(v)) {
        sum += graph_.weight[l.edge];
        squares += graph_.weight[l.edge] * graph_.weight[l.edge];
      }
      conflict[v] = sum * sum - squares;
    }
    std::vector<std::int32_t> order(n);
    std::iota(order.begin(), order.end(), 0);
    std::stable_sort(order.begin(), order.end(),
                     [&](std::int32_t a, std::int32_t b) { return conflict[a] > conflict[b]; });
    std::int32_t room = 0;
    while (room < kMaxFollowed && std::int64_t{2} << room <= max_states_) ++room;
    std::vector<std::int32_t> n_followed(n + 1, 0);  // in the layer before each step
    is_followed_.assign(n, 0);
    for (const std::int32_t v : order) {
      if (slot_[v] < 0) continue;
      const auto from = n_followed.begin() + enters_[v] + 1;
      const auto to = n_followed.begin() + leaves_[v] + 1;
      if (std::any_of(from, to, [&](std::int32_t k) { return k >= room; })) continue;
      std::for_each(from, to, [](std::int32_t& k) { ++k; });
      is_followed_[v] = 1;
    }
    followed_.assign(n + 1, {});
    for (std::int32_t v = 0; v < n; ++v)
      if (is_followed_[v])
        for (std::int32_t t = enters_[v] + 1; t <= leaves_[v]; ++t) followed_[t].push_back(v);
  }

  std::int32_t position(std::size_t t, std::int32_t v) const {
    const auto& f = followed_[t];
    return static_cast<std::int32_t>(std::find(f.begin(), f.end(), v) - f.begin());
  }

  // U of every layer, over the used sets of the followed vertices.
  void bound_completions() {
    const std::size_t n = steps_.size();
    completion_.resize(n + 1);
    completion_exponent_.assign(n + 1, 0);
    completion_[n] = {1.0};
    for (std::size_t t = n; t-- > 0;) {
      const EliminationStep& step = steps_[t];
      const std::vector<double>& after = completion_[t + 1];
      std::vector<double>& before = completion_[t];
      before.assign(std::size_t{1} << followed_[t].size(), 0);
      struct Option {
        std::size_t bit;
        double weight;
      };
      std::vector<Option> options;
      double alone = graph_.alone[step.vertex];
      for (const Link& l : step.links) {
        if (is_followed_[l.to])
          options.push_back({std::size_t{1} << position(t + 1, l.to), graph_.weight[l.edge]});
        else
          alone += graph_.weight[l.edge];
      }
      // Positions of the bits of this layer in the next one.
      std::vector<std::size_t> image;
      std::size_t own = 0;
      for (std::size_t k = 0; k < followed_[t].size(); ++k) {
        const std::int32_t u = followed_[t][k];
        if (u == step.vertex) own = std::size_t{1} << k;
        image.push_back(u == step.vertex ? 0 : std::size_t{1} << position(t + 1, u));
      }
      const bool is_forgotten = step.is_active && own == 0;
      for (std::size_t s = 0; s < before.size(); ++s) {
        std::size_t next = 0;
        for (std::size_t k = 0; k < image.size(); ++k)
          if (s >> k & 1) next |= image[k];
        double value = after[next];
        if (!(s & own)) {
          double sum = alone * value;
          for (const Option& o : options)
            if (!(next & o.bit)) sum += o.weight * after[next | o.bit];
          value = is_forgotten ? std::max(value, sum) : sum;
        }
        before[s] = value;
      }
      completion_exponent_[t] = completion_exponent_[t + 1] + scale(before);
      // A value that underflowed must still count in the bound.
      for (double& x : before) x = std::max(x, std::numeric_limits<double>::min());
    }
  }

  // Limits layer t to so many states that their successors number at most max_states. Returns the
  // log of a bound of the dropped mass, and the number of dropped states.
  std::pair<double, std::int64_t> prune(std::size_t t) {
    const Set& best = best_[t];
    Layer& layer = layers_[t];
    const std::size_t n_next = steps_[t].links.size() + 1;
    const std::size_t room =
        std::max<std::size_t>(1, static_cast<std::size_t>(max_states_) / n_next);
    // Mass that underflow may lose in this step: F and U are at most about 1.
    const auto n_lost = static_cast<double>(layer.sets.size() * (n_next + 1));
    double dropped = 4 * n_lost * std::numeric_limits<double>::min();
    const std::int64_t exponent = layer.exponent + completion_exponent_[t];
    if (layer.sets.size() <= room) return {log_of(dropped, exponent), 0};
    struct Scored {
      double score;
      std::int32_t at;
    };
    std::vector<Scored> order(layer.sets.size());
    for (std::size_t i = 0; i < order.size(); ++i) {
      std::size_t s = 0;
      for (std::size_t k = 0; k < followed_[t].size(); ++k)
        s |= std::size_t{layer.sets[i].has(slot_[followed_[t][k]])} << k;
      order[i] = {layer.values[i] * completion_[t][s], static_cast<std::int32_t>(i)};
    }
    const auto is_better = [&](const Scored& a, const Scored& b) {
      const bool best_a = layer.sets[a.at] == best, best_b = layer.sets[b.at] == best;
      if (best_a != best_b) return best_a;
      if (a.score != b.score) return a.score > b.score;
      return layer.sets[a.at] < layer.sets[b.at];
    };
    const auto end = order.begin() + static_cast<std::ptrdiff_t>(room);
    std::nth_element(order.begin(), end, order.end(), is_better);
    for (auto it = end; it != order.end(); ++it) dropped += it->score;
    const std::int64_t n_dropped = order.end() - end;
    order.resize(room);
    std::sort(order.begin(), order.end(),
              [](const Scored& a, const Scored& b) { return a.at < b.at; });
    Layer kept{{}, {}, layer.exponent};
    kept.sets.reserve(room);
    kept.values.reserve(room);
    for (const Scored& o : order) {
      kept.sets.push_back(layer.sets[o.at]);
      kept.values.push_back(layer.values[o.at]);
    }
    layer = std::move(kept);
    return {log_of(dropped, exponent), n_dropped};
  }

  void forward(std::size_t t) {
    const Layer& in = layers_[t];
    Layer& out = layers_[t + 1];
    index_.reset(out.sets);
    const auto put = [&](const Set& set, double value) {
      const auto i = static_cast<std::size_t>(index_.find_or_add(set));
      if (i == out.values.size()) out.values.push_back(0);
      out.values[i] += value;
    };
    each_choice(t, [&](std::size_t i, const Set& next, double weight, std::int32_t) {
      put(next, in.values[i] * weight);
    });
    out.exponent = in.exponent + scale(out.values);
  }

  void backward(MatchingMarginals& out) {
    std::vector<double> after{1.0}, before, sums;
    for (std::size_t t = steps_.size(); t-- > 0;) {
      std::size_t made = t;
      while (layers_[made].sets.empty()) --made;
      for (; made < t; ++made) {
        forward(made);
        prune(made + 1);
      }
      const Layer& in = layers_[t];
      index_.reset(layers_[t + 1].sets);
      before.assign(in.sets.size(), 0);
      sums.assign(graph_.degree(steps_[t].vertex) + 2, 0);
      each_choice(t, [&](std::size_t i, const Set& next, double weight, std::int32_t option) {
        const std::int32_t k = index_.find(next);
        if (k < 0) return;  // dropped
        before[i] += weight * after[k];
        sums[option + 2] += in.values[i] * weight * after[k];
      });
      const double total = std::accumulate(sums.begin(), sums.end(), 0.0);
      out.alone[steps_[t].vertex] = sums[1] / total;
      for (std::size_t k = 0; k < steps_[t].links.size(); ++k)
        out.edge[steps_[t].links[k].edge] = sums[k + 2] / total;
      scale(before);
      std::swap(before, after);
      layers_[t + 1] = {};
    }
  }

  // Calls visit(state, next set, weight, option) with option -2 for a used vertex, -1 for an
  // unmatched one, else the number of the link.
  template <typename Visit>
  void each_choice(std::size_t t, const Visit& visit) const {
    const EliminationStep& step = steps_[t];
    const Layer& in = layers_[t];
    const std::int32_t own = step.is_active ? slot_[step.vertex] : -1;
    for (std::size_t i = 0; i < in.sets.size(); ++i) {
      Set next = in.sets[i];
      if (own >= 0 && next.has(own)) {
        next.flip(own);
        visit(i, next, 1.0, -2);
        continue;
      }
      visit(i, next, graph_.alone[step.vertex], -1);
      for (std::size_t k = 0; k < step.links.size(); ++k) {
        const std::int32_t slot = slot_[step.links[k].to];
        if (next.has(slot)) continue;
        next.flip(slot);
        visit(i, next, graph_.weight[step.links[k].edge], static_cast<std::int32_t>(k));
        next.flip(slot);
      }
    }
  }

  // The used set of the best matching after step t.
  void advance(std::size_t t) {
    const EliminationStep& step = steps_[t];
    Set best = best_[t];
    if (step.is_active && best.has(slot_[step.vertex]))
      best.flip(slot_[step.vertex]);
    else
      for (const Link& l : step.links)
        if (l.to == partner_[step.vertex]) best.flip(slot_[l.to]);
    best_.push_back(best);
  }

  MatchingGraph graph_;
  std::vector<Link> links_;  // of the steps
  std::vector<EliminationStep> steps_;
  std::span<const std::int32_t> partner_;
  std::int64_t max_states_ = 1;
  double log_scale_ = 0;
  std::vector<std::int32_t> slot_, enters_, leaves_;
  std::vector<char> is_followed_;
  std::vector<std::vector<std::int32_t>> followed_;  // in the layer before each step
  std::vector<std::vector<double>> completion_;
  std::vector<std::int64_t> completion_exponent_;
  std::vector<Layer> layers_;
  std::vector<Set> best_;  // in the layer before each step
  SetIndex<W> index_;
};

}  // namespace asterism
