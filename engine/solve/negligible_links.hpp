// Upper bounds of the marginals of the links of a group. Links that are provably negligible may be
// cut, so that the group divides.
//
//   r_v(G) = Z(G - v) / Z(G) = 1 / (a_v + Σ_u w_vu r_u(G - v))          Z: sum over the matchings
//   P(v, u matched) = w_vu r_u(G - v) / (a_v + Σ_u' w_vu' r_u'(G - v))
//
// a and w are the weights of being unmatched and of a link. Unrolled, the recursion removes the
// vertices of a path (the tree of self-avoiding walks, Bayati et al. 2007), and r falls where a
// neighbour's r rises. If the path always continues with the partner of a vertex in the best
// matching, the removed set S consists of pairs of partners and at most one single track. Bounds
// that hold for every such S need no path, only one number for each vertex:
//
//   A_t ≥ r_t(G - S)   S of pairs                     E_d ≤ r_d(G - S)   S of pairs and d's partner
//   B_d ≥ r_d(G - S)   S of pairs and a track         D_t ≤ r_t(G - S)   the same and t's partner
//
//   A_t = 1 / (a_t + w E_partner)          E_d = 1 / (a_d + Σ_{t ≠ partner} w_dt A_t)
//   B_d = 1 / (a_d + w D_partner)          D_t = 1 / (a_t + Σ_{d ≠ partner} w_td B_d + worst)
//
// where `worst` lets one of the d have lost its partner, so that its r may be as large as 1 / a_d.
// The equations are repeated from A = 1 / a and B = 1 / a; the bounds hold after every round. By the
// union bound, the events with any link of a set have at most the sum of its bounds.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

#include "solve/group_numbering.hpp"

namespace asterism {

class NegligibleLinks {
 public:
  // Returns an upper bound of the marginal of every link. `left` and `price` are the dual prices of
  // rows and columns (solve/joint_events.hpp) and `partner` the best event: of row i, n_rows + its
  // column, or -1. The span is valid until the next call.
  std::span<const double> bounds(std::span<const Candidate> group, const GroupNumbering& by,
                                 std::span<const std::int32_t> partner,
                                 std::span<const double> left, std::span<const double> price) {
    const std::int32_t n = by.n_rows(), m = by.n_columns();
    bound_.assign(group.size(), 1);
    if (std::ranges::any_of(left, [](double x) { return !(x < kMaxGain); })) return bound_;
    w_.resize(group.size());
    for (std::size_t e = 0; e < group.size(); ++e)
      w_[e] = std::exp(group[e].gain - left[by.row_of[e]] - price[by.column_of[e]]);
    a_.resize(n + m);
    for (std::int32_t i = 0; i < n; ++i) a_[i] = std::exp(-left[i]);
    for (std::int32_t j = 0; j < m; ++j) a_[n + j] = std::exp(-price[j]);
    high_.resize(n + m);
    for (std::int32_t v = 0; v < n + m; ++v) high_[v] = 1 / a_[v];
    low_.resize(n + m);
    for (int round = 0; round < kRounds; ++round) refine(group, by, partner);

    for (std::size_t e = 0; e < group.size(); ++e) {
      const std::int32_t i = by.row_of[e], own = partner[i];
      if (own == n + by.column_of[e]) continue;
      const double with = w_[e] * high_[n + by.column_of[e]];
      const double without = a_[i] + (own < 0 ? 0 : own_[i] * low_[own]);
      bound_[e] = with / (with + without);
    }
    return bound_;
  }

 private:
  static constexpr int kRounds = 8;
  static constexpr double kMaxGain = 300;  // so that no weight or product over- or underflows

  // One round. `high_` holds A of rows and B of columns, `low_` D of rows and E of columns.
  void refine(std::span<const Candidate> group, const GroupNumbering& by,
              std::span<const std::int32_t> partner) {
    const std::int32_t n = by.n_rows(), m = by.n_columns();
    own_.assign(n, 0);
    sum_.assign(n + m, 0);
    worst_.assign(n, 0);
    for (std::size_t e = 0; e < group.size(); ++e) {
      const std::int32_t i = by.row_of[e], j = n + by.column_of[e];
      if (partner[i] == j) {
        own_[i] = w_[e];
        continue;
      }
      sum_[i] += w_[e] * high_[j];
      sum_[j] += w_[e] * high_[i];
      worst_[i] = std::max(worst_[i], w_[e] * (1 / a_[j] - high_[j]));
    }
    for (std::int32_t i = 0; i < n; ++i) low_[i] = 1 / (a_[i] + sum_[i] + worst_[i]);
    for (std::int32_t j = n; j < n + m; ++j) low_[j] = 1 / (a_[j] + sum_[j]);
    for (std::int32_t i = 0; i < n; ++i) {
      if (partner[i] < 0) continue;
      high_[i] = 1 / (a_[i] + own_[i] * low_[partner[i]]);
      high_[partner[i]] = 1 / (a_[partner[i]] + own_[i] * low_[i]);
    }
  }

  std::vector<double> bound_, w_;        // by link
  std::vector<double> a_;                // by vertex
  std::vector<double> high_, low_;       // by vertex
  std::vector<double> own_, sum_, worst_;
};

}  // namespace asterism
