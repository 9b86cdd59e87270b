// Joint association events of tracks and detections: marginals, total weight and the best event.
//
//   w_ij  weight of track i with detection j, w_i0 of a miss;
//         an event gives every track one of them and uses no detection twice
//   g_ij = log w_ij - log w_i0   the gain of a pairing over a miss
//   u_i + p_j ≥ log w_ij, u_i ≥ log w_i0, p_j ≥ 0   dual prices; equal on the best event
//
// Divided by the prices, every factor is at most 1 and the best event weighs exactly 1. Plain
// doubles therefore suffice: a term that underflows is negligible against the total.
#pragma once

#include <cstdint>
#include <span>
#include <stdexcept>

#include "solve/assignment.hpp"
#include "solve/connected_components.hpp"

namespace asterism {

struct MatchingGraph;
struct MatchingMarginals;

struct FrontierLimit : std::runtime_error {
  using std::runtime_error::runtime_error;
};

struct JointSummary {
  double log_total = 0, bound = 0;
  // Largest number of states of a layer; groups that were not solved exactly.
  std::int64_t n_states = 1, n_beams = 0;
};

class JointEvents {
 public:
  // Pairings ordered by row, each with its gain. `log_weights` are the log w of the pairings,
  // passed separately because a gain loses digits if the logs are large.
  JointEvents(std::span<const Candidate> pairings, std::span<const double> log_weights,
              std::span<const double> log_miss, std::int32_t n_columns, std::int64_t max_states)
      : log_weights_(log_weights),
        log_miss_(log_miss),
        max_states_(max_states),
        n_(static_cast<std::int32_t>(log_miss.size())),
        groups_(connected_groups(pairings, n_, n_columns)) {}

  // Writes the marginals of the pairings and of each row's miss. `best` receives the column of each
  // row, -1 for a miss.
  JointSummary solve(std::span<double> marginals, std::span<double> missed,
                     std::span<std::int32_t> best);

  const Groups& groups() const { return groups_; }

 private:
  double log_weight(std::size_t g, std::size_t e) const {
    return log_weights_[groups_.sources[groups_.starts[g] + e]];
  }
  double& marginal(std::size_t g, std::size_t e) {
    return marginals_[groups_.sources[groups_.starts[g] + e]];
  }

  bool is_single(std::size_t g) const { return groups_[g].front().row == groups_[g].back().row; }

  // A track that competes with no other has one of its detections or none.
  double solve_single(std::size_t g);
  double solve_group(std::size_t g);
  MatchingMarginals sum(const MatchingGraph& graph, std::int32_t n,
                        std::span<const std::int32_t> partner) const;

  std::span<const double> log_weights_, log_miss_;
  std::int64_t max_states_;
  std::int32_t n_;
  Groups groups_;
  Assignment assignment_;
  std::span<double> marginals_, missed_;
  std::span<std::int32_t> best_;
  JointSummary summary_;
};

}  // namespace asterism
