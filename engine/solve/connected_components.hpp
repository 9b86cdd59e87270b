// Connected components of a bipartite graph. Components share no candidate or resource and can be
// solved separately.
#pragma once

#include <cstdint>
#include <numeric>
#include <span>
#include <vector>

#include "math/union_find.hpp"

namespace asterism {

// A possible pairing of a track (row) with a detection (column).
struct Candidate {
  std::int32_t row = 0, column = 0;
  double gain = 0;       // log-likelihood ratio of the pairing against leaving both unassigned
  double distance2 = 0;  // squared distance of prediction and detection
};

// Candidates ordered by group, and groups by their first row. Group g is
// order[starts[g]:starts[g+1]]; `sources` are the indices of its candidates in the input list.
struct Groups {
  std::vector<Candidate> order;
  std::vector<std::int32_t> sources, starts;

  std::size_t size() const { return starts.size() - 1; }
  std::span<const Candidate> operator[](std::size_t g) const {
    return {order.data() + starts[g], order.data() + starts[g + 1]};
  }
};

// `candidates` must be ordered by row.
inline Groups connected_groups(std::span<const Candidate> candidates, std::int32_t n_rows,
                               std::int32_t n_columns) {
  UnionFind sets(n_rows + n_columns);
  for (const Candidate& c : candidates) sets.join(c.row, n_rows + c.column);
  // The root of a component is its smallest row, so counting by root also orders the groups.
  std::vector<std::int32_t> group_of(n_rows, -1), counts;
  for (const Candidate& c : candidates) {
    std::int32_t& g = group_of[sets.find(c.row)];
    if (g < 0) {
      g = static_cast<std::int32_t>(counts.size());
      counts.push_back(0);
    }
    ++counts[g];
  }
  Groups groups;
  groups.starts.assign(counts.size() + 1, 0);
  std::partial_sum(counts.begin(), counts.end(), groups.starts.begin() + 1);
  std::vector<std::int32_t> fill(groups.starts.begin(), groups.starts.end() - 1);
  groups.order.resize(candidates.size());
  groups.sources.resize(candidates.size());
  for (std::size_t e = 0; e < candidates.size(); ++e) {
    const std::int32_t at = fill[group_of[sets.find(candidates[e].row)]]++;
    groups.order[at] = candidates[e];
    groups.sources[at] = static_cast<std::int32_t>(e);
  }
  return groups;
}

// The connected groups of what remains of `groups` without some of its candidates, marked by their
// places in `groups.order`.
inline Groups groups_without(const Groups& groups, std::span<const char> is_cut, std::int32_t n_rows,
                             std::int32_t n_columns) {
  std::vector<std::int32_t> at(groups.order.size()), kept;  // by source
  for (std::size_t k = 0; k < at.size(); ++k) at[groups.sources[k]] = static_cast<std::int32_t>(k);
  std::vector<Candidate> candidates;
  for (std::size_t e = 0; e < at.size(); ++e)
    if (!is_cut[at[e]]) {
      kept.push_back(static_cast<std::int32_t>(e));
      candidates.push_back(groups.order[at[e]]);
    }
  Groups out = connected_groups(candidates, n_rows, n_columns);
  for (std::int32_t& source : out.sources) source = kept[source];
  return out;
}

// Groups items that share a resource, directly or through other items. Each group is increasing,
// and groups are ordered by their first item. `each_use(item, visit)` calls visit(resource) for
// each resource of an item.
template <typename EachUse>
std::vector<std::vector<std::int32_t>> connected_sets(std::size_t n_items, std::size_t n_resources,
                                                      EachUse&& each_use) {
  UnionFind sets(n_items);
  std::vector<std::int32_t> owner(n_resources, -1);
  for (std::int32_t i = 0; i < static_cast<std::int32_t>(n_items); ++i)
    each_use(i, [&](auto r) {
      if (owner[r] < 0) owner[r] = i;
      sets.join(owner[r], i);
    });
  std::vector<std::vector<std::int32_t>> out(n_items);
  for (std::int32_t i = 0; i < static_cast<std::int32_t>(n_items); ++i) out[sets.find(i)].push_back(i);
  std::erase_if(out, [](const auto& set) { return set.empty(); });
  return out;
}

}  // namespace asterism
