// Consecutive numbers for the rows and columns of a group of candidates.
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include "solve/connected_components.hpp"

namespace asterism {

struct GroupNumbering {
  std::vector<std::int32_t> rows, columns;      // of the caller, by number, increasing
  std::vector<std::int32_t> first;  // the candidates of row i are first[i] to first[i + 1]
  std::vector<std::int32_t> row_of, column_of;  // numbers, by candidate

  std::int32_t n_rows() const { return static_cast<std::int32_t>(rows.size()); }
  std::int32_t n_columns() const { return static_cast<std::int32_t>(columns.size()); }

  // `group` must be ordered by row.
  void number(std::span<const Candidate> group) {
    for (std::vector<std::int32_t>* all : {&rows, &columns, &first, &row_of, &column_of}) all->clear();
    for (const Candidate& c : group) columns.push_back(c.column);
    std::sort(columns.begin(), columns.end());
    columns.erase(std::unique(columns.begin(), columns.end()), columns.end());
    for (const Candidate& c : group) {
      if (rows.empty() || rows.back() != c.row) {
        rows.push_back(c.row);
        first.push_back(static_cast<std::int32_t>(row_of.size()));
      }
      row_of.push_back(n_rows() - 1);
      const auto at = std::lower_bound(columns.begin(), columns.end(), c.column);
      column_of.push_back(static_cast<std::int32_t>(at - columns.begin()));
    }
    first.push_back(static_cast<std::int32_t>(row_of.size()));
  }
};

}  // namespace asterism
