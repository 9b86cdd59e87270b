// Solves the joint events group by group: in closed form for a single track, exactly if the states
// are few, otherwise by a beam search.
#include "solve/joint_events.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <numeric>
#include <vector>

#include "solve/dual_prices.hpp"
#include "solve/joint_beam.hpp"

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
      for (const Link& l : graph.links_of(v)) out.edge[l.edge] = l.to == partner[v];
  }
  out.bound = 1;
  return out;
}

// The links of a group, without weights. Those of a vertex are in the order of the candidates.
void list_links(std::span<const Candidate> group, const GroupNumbering& by, MatchingGraph& graph) {
  const std::int32_t n = by.n_rows(), n_vertices = n + by.n_columns();
  graph.first.assign(n_vertices + 1, 0);
  for (std::size_t e = 0; e < group.size(); ++e) {
    ++graph.first[by.row_of[e]];
    ++graph.first[n + by.column_of[e]];
  }
  std::partial_sum(graph.first.begin(), graph.first.end(), graph.first.begin());
  graph.links.resize(2 * group.size());
  for (auto e = static_cast<std::int32_t>(group.size()); e-- > 0;) {
    const std::int32_t i = by.row_of[e], j = n + by.column_of[e];
    graph.links[--graph.first[i]] = {j, e};
    graph.links[--graph.first[j]] = {i, e};
  }
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
  std::vector<char> is_solved(n_, 0), has_any(n_, 0);  // by first row of a group; by row
  std::vector<char> is_cut(groups_.order.size(), 0);
  double omitted = 0;
  const auto solve_one = [&](std::size_t g, bool may_cut) {
    double bound = 0;
    if (is_single(g)) {
      solve_single(g);
    } else {
      price(g);
      const Elimination& elimination = order_.best(graph_, may_cut ? max_frontier() : kUnlimited);
      if (elimination.order.empty()) {
        omitted += cut(g, is_cut);
        return;
      }
      bound = solve_group(g, elimination);
    }
    is_solved[groups_[g].front().row] = 1;
    summary_.n_beams += bound > 0;
    log_exact += std::log1p(-bound);
  };
  for (std::size_t g = 0; g < groups_.size(); ++g) solve_one(g, negligible_ > 0);
  if (summary_.n_cut > 0) groups_ = groups_without(groups_, is_cut, n_, n_columns_);
  log_exact += std::log1p(-std::min(omitted, 1.0));
  for (const Candidate& c : groups_.order) has_any[c.row] = 1;
  for (std::int32_t i = 0; i < n_; ++i)
    if (!has_any[i]) summary_.log_total += log_miss_[i];
  for (std::size_t g = 0; g < groups_.size(); ++g)
    if (!is_solved[groups_[g].front().row]) solve_one(g, false);
  if (log_exact < 0) summary_.bound = -std::expm1(log_exact);
  return summary_;
}

void JointEvents::solve_single(std::size_t g) {
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
}

void JointEvents::price(std::size_t g) {
  const std::span<const Candidate> group = groups_[g];
  by_.number(group);
  const std::int32_t n = by_.n_rows(), m = by_.n_columns();
  list_partners(group, by_, best_, partner_);
  left_.assign(n, 0);
  price_.assign(m, 0);
  find_prices(group, by_, partner_, left_, price_);
  list_links(group, by_, graph_);
}

std::vector<double> JointEvents::marginal_bounds() {
  std::vector<std::int32_t> best(n_, -1);
  std::vector<double> out(groups_.order.size());
  NegligibleLinks negligible;
  best_ = best;
  for (std::size_t g = 0; g < groups_.size(); ++g) {
    assignment_.solve(groups_[g], best_);
    price(g);
    const std::span<const double> bounds =
        negligible.bounds(groups_[g], by_, partner_, left_, price_);
    for (std::size_t e = 0; e < bounds.size(); ++e)
      out[groups_.sources[groups_.starts[g] + e]] = bounds[e];
  }
  return out;
}

double JointEvents::cut(std::size_t g, std::span<char> is_cut) {
  NegligibleLinks negligible;
  double omitted = 0;
  const std::span<const double> bounds =
      negligible.bounds(groups_[g], by_, partner_, left_, price_);
  const std::int64_t n_before = summary_.n_cut;
  for (std::size_t e = 0; e < bounds.size(); ++e) {
    if (!(bounds[e] <= negligible_)) continue;
    is_cut[groups_.starts[g] + e] = 1;
    omitted += bounds[e];
    ++summary_.n_cut;
  }
  summary_.n_beams += summary_.n_cut > n_before;
  return omitted;
}

double JointEvents::solve_group(std::size_t g, const Elimination& elimination) {
  const std::span<const Candidate> group = groups_[g];
  const std::int32_t n = by_.n_rows(), m = by_.n_columns();
  graph_.alone.resize(n + m);
  graph_.weight.resize(group.size());
  double log_scale = 0;
  for (std::int32_t i = 0; i < n; ++i) {
    left_[i] = snap(log_miss_[by_.rows[i]] + left_[i]);
    graph_.alone[i] = std::exp(log_miss_[by_.rows[i]] - left_[i]);
    log_scale += left_[i];
  }
  for (std::int32_t j = 0; j < m; ++j) {
    price_[j] = snap(price_[j]);
    graph_.alone[n + j] = std::exp(-price_[j]);
    log_scale += price_[j];
  }
  for (std::size_t e = 0; e < group.size(); ++e) {
    const std::int32_t i = by_.row_of[e], j = by_.column_of[e];
    graph_.weight[e] = std::exp(log_weight(g, e) - (left_[i] + price_[j]));
  }

  MatchingMarginals result = sum(elimination, n);
  if (!is_finite(result)) result = only_best(graph_, n, partner_);
  for (std::size_t e = 0; e < group.size(); ++e) marginal(g, e) = result.edge[e];
  for (std::int32_t i = 0; i < n; ++i) missed_[by_.rows[i]] = result.alone[i];
  summary_.log_total += result.log_total + log_scale;
  summary_.n_states = std::max(summary_.n_states, result.n_states);
  return result.bound;
}

// The largest frontier whose states are few enough for the exact sum.
std::int32_t JointEvents::max_frontier() const {
  return static_cast<std::int32_t>(std::bit_width(static_cast<std::uint64_t>(max_states_))) - 1;
}

MatchingMarginals JointEvents::sum(const Elimination& elimination, std::int32_t n) {
  if (elimination.peak <= max_frontier()) return exact_.solve(graph_, elimination);
  if (elimination.peak <= 64)
    return JointBeam<1>(graph_, elimination, n, partner_, max_states_).solve();
  if (elimination.peak <= 1024)
    return JointBeam<16>(graph_, elimination, n, partner_, max_states_).solve();
  throw FrontierLimit("more than 1024 tracks or detections compete at once");
}

}  // namespace asterism
