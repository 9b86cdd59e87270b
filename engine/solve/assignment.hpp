// Exact sparse assignment: finds the pairing with the largest sum of gains. Rows and columns may
// stay unassigned.
//
// Successive shortest augmenting paths (Jonker & Volgenant 1987) over the candidates alone. Every
// row has a dummy column of cost 0, which stands for no assignment. A perfect matching of the rows
// therefore always exists, and no candidate without a positive gain is taken.
//
//   c_ij = -gain   u_i, v_j  potentials with c_ij - u_i - v_j ≥ 0, = 0 on matched pairs
#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>
#include <queue>
#include <span>
#include <utility>
#include <vector>

#include "solve/group_numbering.hpp"

namespace asterism {

class Assignment {
 public:
  // Sets match[row] to the column of each assigned row of `group`, which must be ordered by row.
  // Unassigned rows are left unchanged.
  void solve(std::span<const Candidate> group, std::span<std::int32_t> match) {
    if (group.size() == 1) {
      if (group[0].gain > 0) match[group[0].row] = group[0].column;
      return;
    }
    group_ = group;
    by_.number(group);
    const std::int32_t n_rows = by_.n_rows();
    u_.assign(n_rows, 0);
    v_.assign(by_.n_columns(), 0);
    column_of_.assign(n_rows, kAlone);
    row_of_.assign(by_.n_columns(), -1);
    distance_.assign(v_.size(), kUnreached);
    from_.assign(v_.size(), -1);
    is_done_.assign(v_.size(), 0);
    reached_.clear();
    for (std::size_t e = 0; e < group.size(); ++e)
      u_[by_.row_of[e]] = std::min(u_[by_.row_of[e]], -group[e].gain);
    for (std::int32_t i = 0; i < n_rows; ++i) augment(i);
    for (std::int32_t i = 0; i < n_rows; ++i)
      if (column_of_[i] != kAlone) match[by_.rows[i]] = by_.columns[column_of_[i]];
  }

  // Solves group by group. match[row] stays -1 for an unassigned row.
  void solve_groups(std::span<const Candidate> candidates, std::int32_t n_columns,
                    std::vector<std::int32_t>& match) {
    const Groups groups =
        connected_groups(candidates, static_cast<std::int32_t>(match.size()), n_columns);
    for (std::size_t g = 0; g < groups.size(); ++g) solve(groups[g], match);
  }

  // Also writes the dual price of each column of the group. No pairing has a larger sum of gains
  // than Σ price_j + Σ_i max(0, max_j gain_ij - price_j); the best pairing attains it.
  void solve(std::span<const Candidate> group, std::span<std::int32_t> match,
             std::span<double> price) {
    solve(group, match);
    if (group.size() == 1) {
      price[group[0].column] = 0;
      return;
    }
    for (std::size_t j = 0; j < v_.size(); ++j) price[by_.columns[j]] = -v_[j];
  }

 private:
  static constexpr std::int32_t kAlone = -1;
  static constexpr double kUnreached = std::numeric_limits<double>::infinity();

  void augment(std::int32_t start) {
    // Only the columns that the last path has reached are reset. In a large group that is a small
    // part of all columns.
    for (const std::int32_t j : reached_) {
      distance_[j] = kUnreached;
      is_done_[j] = 0;
    }
    reached_.clear();
    scanned_.clear();
    while (!heap_.empty()) heap_.pop();

    double best_end = kUnreached;  // length of the shortest path to any end found so far
    std::int32_t end_row = -1, end_column = kAlone;
    std::int32_t row = start;
    double length = 0;
    for (;;) {
      scanned_.push_back({row, length});
      if (length - u_[row] < best_end) {  // end at the row's own dummy
        best_end = length - u_[row];
        end_row = row;
        end_column = kAlone;
      }
      for (std::int32_t e = by_.first[row]; e < by_.first[row + 1]; ++e) {
        const std::int32_t j = by_.column_of[e];
        if (is_done_[j]) continue;
        const double d = length - group_[e].gain - u_[row] - v_[j];
        if (d < distance_[j]) {
          if (distance_[j] == kUnreached) reached_.push_back(j);
          distance_[j] = d;
          from_[j] = row;
          heap_.push({d, j});
        }
      }
      std::int32_t j = -1;
      while (!heap_.empty()) {
        const auto [d, k] = heap_.top();
        heap_.pop();
        if (!is_done_[k] && d == distance_[k]) {
          j = k;
          break;
        }
      }
      if (j < 0 || distance_[j] >= best_end) break;
      is_done_[j] = 1;
      if (row_of_[j] < 0) {
        best_end = distance_[j];
        end_row = from_[j];
        end_column = j;
        break;
      }
      row = row_of_[j];
      length = distance_[j];
    }
    for (const auto& [r, d] : scanned_) {
      if (d >= best_end) continue;
      u_[r] += best_end - d;
    }
    for (const std::int32_t j : reached_)
      if (is_done_[j] && distance_[j] < best_end) v_[j] -= best_end - distance_[j];
    flip(start, end_row, end_column);
  }

  // Augments: each row on the path takes the column that it reached and releases its old one.
  void flip(std::int32_t start, std::int32_t row, std::int32_t column) {
    for (;;) {
      const std::int32_t old = column_of_[row];
      column_of_[row] = column;
      if (column != kAlone) row_of_[column] = row;
      if (row == start) break;
      column = old;
      row = from_[column];
    }
  }

  using HeapItem = std::pair<double, std::int32_t>;
  std::span<const Candidate> group_;  // of the current solve
  GroupNumbering by_;
  std::vector<std::int32_t> column_of_, row_of_, from_;
  std::vector<double> u_, v_, distance_;
  std::vector<char> is_done_;
  std::vector<std::int32_t> reached_;  // columns with a distance
  std::vector<std::pair<std::int32_t, double>> scanned_;
  std::priority_queue<HeapItem, std::vector<HeapItem>, std::greater<>> heap_;
};

}  // namespace asterism
