// Joint association events of tracks and detections: marginals, total weight and the best event.
//
//   w_ij  weight of track i with detection j, w_i0 of a miss;
//         an event gives every track one of them and uses no detection twice
//   g_ij = log w_ij - log w_i0   the gain of a pairing over a miss
//   u_i + p_j ≥ log w_ij, u_i ≥ log w_i0, p_j ≥ 0   dual prices; equal on the best event
//
// Divided by the prices, every factor is at most 1 and the best event weighs exactly 1. Plain
// doubles therefore suffice: a term that underflows is negligible against the total.
//
// On request, a group that needs too many states is first divided: links whose marginal is provably
// negligible are cut (solve/negligible_links.hpp), and count in the bound.
#pragma once

#include <cstdint>
#include <limits>
#include <span>
#include <stdexcept>
#include <vector>

#include "solve/assignment.hpp"
#include "solve/connected_components.hpp"
#include "solve/joint_exact.hpp"
#include "solve/negligible_links.hpp"

namespace asterism {

struct FrontierLimit : std::runtime_error {
  using std::runtime_error::runtime_error;
};

struct JointSummary {
  double log_total = 0, bound = 0;
  // Largest number of states of a layer; groups that were not solved exactly; links cut.
  std::int64_t n_states = 1, n_beams = 0, n_cut = 0;
};

class JointEvents {
 public:
  // Pairings ordered by row, each with its gain. `log_weights` are the log w of the pairings,
  // passed separately because a gain loses digits if the logs are large. In groups that need more
  // than `max_states`, links are cut if their marginal is at most `negligible`.
  JointEvents(std::span<const Candidate> pairings, std::span<const double> log_weights,
              std::span<const double> log_miss, std::int32_t n_columns, std::int64_t max_states,
              double negligible = 0)
      : log_weights_(log_weights),
        log_miss_(log_miss),
        max_states_(max_states),
        negligible_(negligible),
        n_(static_cast<std::int32_t>(log_miss.size())),
        n_columns_(n_columns),
        groups_(connected_groups(pairings, n_, n_columns)) {}

  // Writes the marginals of the pairings, 0 for cut ones, and of each row's miss. `best` receives
  // the column of each row, -1 for a miss.
  JointSummary solve(std::span<double> marginals, std::span<double> missed,
                     std::span<std::int32_t> best);

  // Upper bounds of the marginals of the pairings, by which links are cut.
  std::vector<double> marginal_bounds();

  // After `solve`, the groups without the cut links.
  const Groups& groups() const { return groups_; }

 private:
  static constexpr std::int32_t kUnlimited = std::numeric_limits<std::int32_t>::max();

  // Finds the prices of the best event of a group, and its links.
  void price(std::size_t g);
  std::int32_t max_frontier() const;
  // Marks the negligible links of the priced group. Returns the bound of the omitted mass.
  double cut(std::size_t g, std::span<char> is_cut);

  double log_weight(std::size_t g, std::size_t e) const {
    return log_weights_[groups_.sources[groups_.starts[g] + e]];
  }
  double& marginal(std::size_t g, std::size_t e) {
    return marginals_[groups_.sources[groups_.starts[g] + e]];
  }

  bool is_single(std::size_t g) const { return groups_[g].front().row == groups_[g].back().row; }

  // A track that competes with no other has one of its detections or none.
  void solve_single(std::size_t g);
  // The priced group.
  double solve_group(std::size_t g, const Elimination& elimination);
  MatchingMarginals sum(const Elimination& elimination, std::int32_t n);

  std::span<const double> log_weights_, log_miss_;
  std::int64_t max_states_;
  double negligible_;
  std::int32_t n_, n_columns_;
  Groups groups_;
  Assignment assignment_;
  std::span<double> marginals_, missed_;
  std::span<std::int32_t> best_;
  JointSummary summary_;
  // The priced group.
  GroupNumbering by_;
  std::vector<std::int32_t> partner_;  // of the rows, then of the columns; -1 for none
  std::vector<double> left_, price_;
  MatchingGraph graph_;
  EliminationOrder order_;
  JointExact exact_;
};

}  // namespace asterism
