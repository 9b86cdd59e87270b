// Solves the joint events group by group: in closed form for a single track, exactly if the states
// are few, otherwise by a beam search.
#include "solve/joint_events.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <vector>

#include "solve/elimination.hpp"
#include "solve/joint_beam.hpp"
#include "solve/joint_exact.hpp"

namespace asterism {

namespace {

// Rounds a price to a grid, so that the sum of two prices, and its difference to a similar weight,
// are exact.
double snap(double x) {
  constexpr double grid = 1 << 20;
  return std::abs(x) < grid * grid ? std::nearbyint(x * grid) / grid : x;
}

bool is_finite(const MatchingMarginals& result) {
  const auto finite = [](double x) { return std::isfinite(x); };
  return std::isfinite(result.log_total) &&
         std::all_of(result.edge.begin(), result.edge.end(), finite) &&
         std::all_of(result.alone.begin(), result.alone.end(), finite);
}

// Fallback for groups of hundreds of tracks that exceed the range of doubles. Returns the best
// event alone, with weight 1. The bound is 1, because nothing is known of the omitted mass.
MatchingMarginals only_best(const MatchingGraph& graph, std::int32_t n,
                            std::span<const std::int32_t> partner) {
  MatchingMarginals out;
  out.edge.assign(graph.weight.size(), 0);
  out.alone.assign(graph.size(), 0);
  for (std::int32_t v = 0; v < graph.size(); ++v) {
    out.alone[v] = partner[v] < 0;
    if (v < n)
      for (const Link& l : graph.links[v]) out.edge[l.edge] = l.to == partner[v];
  }
  out.bound = 1;
  return out;
}

// The smallest prices p ≥ 0 at which every track prefers its detection in the best event, and the
// remaining gain of each track. Prices rise from 0 and converge because the event is optimal.
void find_prices(std::span<const Candidate> group, const GroupNumbering& by,
                 std::span<const std::int32_t> partner, std::span<double> left,
                 std::span<double> p) {
  const std::int32_t n = by.n_rows();
  std::vector<std::size_t> own(n, 0);
  for (std::size_t e = 0; e < group.size(); ++e)
    if (partner[by.row_of[e]] == n + by.column_of[e]) own[by.row_of[e]] = e;
  const auto content = [&](std::int32_t i) {
    left[i] = partner[i] < 0 ? 0 : group[own[i]].gain - p[partner[i] - n];
  };
  for (std::int32_t i = 0; i < n; ++i) content(i);
  // Rounding may let ties rise for ever, so the rounds are limited. Any prices give correct
  // results.
  bool is_rising = true;
  for (std::int32_t round = 0; round <= n && is_rising; ++round) {
    is_rising = false;
    for (std::size_t e = 0; e < group.size(); ++e) {
      const std::int32_t i = by.row_of[e], j = by.column_of[e], holder = partner[n + j];
      if (holder < 0 || holder == i || group[e].gain - left[i] <= p[j]) continue;
      p[j] = group[e].gain - left[i];
      content(holder);
      is_rising = true;
    }
  }
}

// The links of a group, without weights.
MatchingGraph graph_of(std::span<const Candidate> group, const GroupNumbering& by) {
  const std::int32_t n = by.n_rows();
  MatchingGraph graph;
  graph.links.resize(n + by.n_columns());
  for (std::size_t e = 0; e < group.size(); ++e) {
    const std::int32_t i = by.row_of[e], j = n + by.column_of[e];
    graph.links[i].push_back({j, static_cast<std::int32_t>(e)});
    graph.links[j].push_back({i, static_cast<std::int32_t>(e)});
  }
  return graph;
}

}  // namespace

JointSummary JointEvents::solve(std::span<double> marginals, std::span<double> missed,
                                std::span<std::int32_t> best) {
  marginals_ = marginals;
  missed_ = missed;
  best_ = best;
  std::fill(marginals.begin(), marginals.end(), 0.0);
  std::fill(missed.begin(), missed.end(), 1.0);
  std::fill(best.begin(), best.end(), -1);
  for (std::size_t g = 0; g < groups_.size(); ++g) assignment_.solve(groups_[g], best_);
  double log_exact = 0;  // log of the fraction of the events that was summed
  if (negligible_ > 0) log_exact += std::log1p(-cut());
  std::vector<char> has_any(n_, 0);
  for (const Candidate& c : groups_.order) has_any[c.row] = 1;
  for (std::int32_t i = 0; i < n_; ++i)
    if (!has_any[i]) summary_.log_total += log_miss_[i];
  for (std::size_t g = 0; g < groups_.size(); ++g) {
    const double bound = is_single(g) ? solve_single(g) : solve_group(g);
    summary_.n_beams += bound > 0;
    log_exact += std::log1p(-bound);
  }
  if (log_exact < 0) summary_.bound = -std::expm1(log_exact);
  return summary_;
}

double JointEvents::solve_single(std::size_t g) {
  const std::int32_t i = groups_[g].front().row;
  const std::size_t n = groups_[g].size();
  double max_log = log_miss_[i], total = 0;
  for (std::size_t e = 0; e < n; ++e) max_log = std::max(max_log, log_weight(g, e));
  for (std::size_t e = 0; e < n; ++e)
    total += marginal(g, e) = std::exp(log_weight(g, e) - max_log);
  total += missed_[i] = std::exp(log_miss_[i] - max_log);
  for (std::size_t e = 0; e < n; ++e) marginal(g, e) /= total;
  missed_[i] /= total;
  summary_.log_total += max_log + std::log(total);
  return 0;
}

JointEvents::Priced JointEvents::price(std::size_t g) const {
  const std::span<const Candidate> group = groups_[g];
  Priced out;
  out.by.number(group);
  const std::int32_t n = out.by.n_rows(), m = out.by.n_columns();
  out.partner.assign(n + m, -1);
  for (std::size_t e = 0; e < group.size(); ++e)
    if (best_[group[e].row] == group[e].column) {
      out.partner[out.by.row_of[e]] = n + out.by.column_of[e];
      out.partner[n + out.by.column_of[e]] = out.by.row_of[e];
    }
  out.left.resize(n);
  out.price.resize(m);
  find_prices(group, out.by, out.partner, out.left, out.price);
  return out;
}

std::vector<double> JointEvents::marginal_bounds() {
  std::vector<std::int32_t> best(n_, -1);
  std::vector<double> out(groups_.order.size());
  NegligibleLinks negligible;
  best_ = best;
  for (std::size_t g = 0; g < groups_.size(); ++g) {
    assignment_.solve(groups_[g], best_);
    const Priced priced = price(g);
    const std::span<const double> bounds =
        negligible.bounds(groups_[g], priced.by, priced.partner, priced.left, priced.price);
    for (std::size_t e = 0; e < bounds.size(); ++e)
      out[groups_.sources[groups_.starts[g] + e]] = bounds[e];
  }
  return out;
}

double JointEvents::cut() {
  NegligibleLinks negligible;
  std::vector<char> is_cut(groups_.order.size(), 0);
  double omitted = 0;
  for (std::size_t g = 0; g < groups_.size(); ++g) {
    const std::span<const Candidate> group = groups_[g];
    if (is_single(g)) continue;
    const Priced priced = price(g);
    const MatchingGraph graph = graph_of(group, priced.by);
    EliminationOrder order(graph);
    if (order.may_fit(max_frontier()) && order.best().peak <= max_frontier()) continue;
    const std::span<const double> bounds =
        negligible.bounds(group, priced.by, priced.partner, priced.left, priced.price);
    const std::int64_t n_before = summary_.n_cut;
    for (std::size_t e = 0; e < group.size(); ++e) {
      if (!(bounds[e] <= negligible_)) continue;
      is_cut[groups_.starts[g] + e] = 1;
      omitted += bounds[e];
      ++summary_.n_cut;
    }
    summary_.n_beams += summary_.n_cut > n_before;
  }
  if (summary_.n_cut > 0) groups_ = groups_without(groups_, is_cut, n_, n_columns_);
  return std::min(omitted, 1.0);
}

double JointEvents::solve_group(std::size_t g) {
  const std::span<const Candidate> group = groups_[g];
  auto [by, partner, u, p] = price(g);
  const std::int32_t n = by.n_rows(), m = by.n_columns();
  MatchingGraph graph = graph_of(group, by);
  graph.alone.resize(n + m);
  graph.weight.resize(group.size());
  double log_scale = 0;
  for (std::int32_t i = 0; i < n; ++i) {
    u[i] = snap(log_miss_[by.rows[i]] + u[i]);
    graph.alone[i] = std::exp(log_miss_[by.rows[i]] - u[i]);
    log_scale += u[i];
  }
  for (std::int32_t j = 0; j < m; ++j) {
    p[j] = snap(p[j]);
    graph.alone[n + j] = std::exp(-p[j]);
    log_scale += p[j];
  }
  for (std::size_t e = 0; e < group.size(); ++e) {
    const std::int32_t i = by.row_of[e], j = by.column_of[e];
    graph.weight[e] = std::exp(log_weight(g, e) - (u[i] + p[j]));
  }

  MatchingMarginals result = sum(graph, n, partner);
  if (!is_finite(result)) result = only_best(graph, n, partner);
  for (std::size_t e = 0; e < group.size(); ++e) marginal(g, e) = result.edge[e];
  for (std::int32_t i = 0; i < n; ++i) missed_[by.rows[i]] = result.alone[i];
  summary_.log_total += result.log_total + log_scale;
  summary_.n_states = std::max(summary_.n_states, result.n_states);
  return result.bound;
}

// The largest frontier whose states are few enough for the exact sum.
std::int32_t JointEvents::max_frontier() const {
  return static_cast<std::int32_t>(std::bit_width(static_cast<std::uint64_t>(max_states_))) - 1;
}

MatchingMarginals JointEvents::sum(const MatchingGraph& graph, std::int32_t n,
                                   std::span<const std::int32_t> partner) const {
  const Elimination elimination = EliminationOrder(graph).best();
  if (elimination.peak <= max_frontier())
    return JointExact(graph, elimination).solve();
  if (elimination.peak <= 64)
    return JointBeam<1>(graph, elimination, n, partner, max_states_).solve();
  if (elimination.peak <= 1024)
    return JointBeam<16>(graph, elimination, n, partner, max_states_).solve();
  throw FrontierLimit("more than 1024 tracks or detections compete at once");
}

}  // namespace asterism
