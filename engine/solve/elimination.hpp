// Chooses the order in which vertices are summed out of the weighted matchings of a graph.
//
//   Z = Σ over matchings  Π_{matched edges} weight_e · Π_{unmatched vertices} alone_v
//
// A vertex is summed out over its partners among the remaining neighbours and over being unmatched.
// The state between two steps is the set of used vertices of the *frontier*: the remaining vertices
// that have an eliminated neighbour. There are at most 2^frontier states. Both sides of the graph
// are treated alike, so three tracks with forty detections need 2^3 states and not 2^40.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numeric>
#include <vector>

namespace asterism {

struct Link {
  std::int32_t to = 0, edge = 0;
};

struct MatchingGraph {
  std::vector<std::vector<Link>> links;  // of each vertex
  std::vector<double> weight;            // of each edge
  std::vector<double> alone;             // of each vertex

  std::int32_t size() const { return static_cast<std::int32_t>(links.size()); }
};

struct EliminationStep {
  std::int32_t vertex = 0;
  bool is_active = false;              // in the frontier before the step
  std::vector<Link> links;             // to the remaining vertices, whose bits the step may set
  std::vector<std::int32_t> entering;  // vertices that the step adds to the frontier
};

struct Elimination {
  std::vector<EliminationStep> steps;
  std::int32_t peak = 0;  // size of the largest frontier
  double work = 0;        // multiplications of one pass
};

class EliminationOrder {
 public:
  explicit EliminationOrder(const MatchingGraph& graph) : graph_(graph) {}

  // Whether the frontier of one of these orders always has at most so many vertices. The trials are
  // short where it grows further.
  bool may_fit(std::int32_t max_frontier) {
    for (const std::int32_t start : starts())
      if (greedy(start, max_frontier).peak <= max_frontier) return true;
    return false;
  }
  // The cheapest of several greedy orders, each from another promising first vertex.
  Elimination best() {
    Elimination best;
    for (const std::int32_t start : starts()) {
      Elimination e = greedy(start);
      if (best.steps.empty() || e.work < best.work) best = std::move(e);
      if (best.peak <= kSmallFrontier) break;  // more trials would cost more than they save
    }
    return best;
  }

 private:
  static constexpr std::int32_t kSmallFrontier = 6, kManyStarts = 16;

  // First vertices to try: an end of the graph, vertices of low degree, and one of high degree.
  std::vector<std::int32_t> starts() const {
    std::vector<std::int32_t> all(graph_.size());
    std::iota(all.begin(), all.end(), 0);
    std::stable_sort(all.begin(), all.end(), [&](std::int32_t a, std::int32_t b) {
      return graph_.links[a].size() < graph_.links[b].size();
    });
    all.insert(all.begin(), farthest(farthest(0)));
    const std::int32_t last = all.back();
    if (static_cast<std::int32_t>(all.size()) > kManyStarts) {
      all.resize(kManyStarts);
      all.push_back(last);
    }
    return all;
  }

  // The last vertex that a breadth-first search reaches.
  std::int32_t farthest(std::int32_t from) const {
    std::vector<std::int32_t> queue{from};
    std::vector<char> is_visited(graph_.size(), 0);
    is_visited[from] = 1;
    for (std::size_t k = 0; k < queue.size(); ++k)
      for (const Link& l : graph_.links[queue[k]])
        if (!is_visited[l.to]) {
          is_visited[l.to] = 1;
          queue.push_back(l.to);
        }
    return queue.back();
  }

  // Always eliminates the vertex that leaves the smallest frontier. Ties go to the vertex that was
  // met first. Stops where the frontier has more than `max_frontier` vertices.
  Elimination greedy(std::int32_t start,
                     std::int32_t max_frontier = std::numeric_limits<std::int32_t>::max()) {
    const std::int32_t n = graph_.size();
    is_gone_.assign(n, 0);
    is_active_.assign(n, 0);
    is_near_.assign(n, 0);
    n_outside_.resize(n);
    for (std::int32_t v = 0; v < n; ++v)
      n_outside_[v] = static_cast<std::int32_t>(graph_.links[v].size());
    near_.clear();
    Elimination e;
    std::int32_t frontier = 0, v = start;
    for (;;) {
      EliminationStep step;
      step.vertex = v;
      step.is_active = is_active_[v];
      for (const Link& l : graph_.links[v]) {
        if (is_gone_[l.to]) continue;
        step.links.push_back(l);
        if (!is_active_[l.to]) step.entering.push_back(l.to);
      }
      is_gone_[v] = 1;
      if (!is_active_[v]) enter(v);  // only to update the counts of its neighbours
      for (const std::int32_t u : step.entering) enter(u);
      frontier += static_cast<std::int32_t>(step.entering.size()) - step.is_active;
      e.peak = std::max(e.peak, frontier);
      if (frontier > max_frontier) return e;
      e.work += std::ldexp(static_cast<double>(step.links.size() + 1), std::min(frontier, 900));
      e.steps.push_back(std::move(step));
      if (static_cast<std::int32_t>(e.steps.size()) == n) return e;
      v = next();
    }
  }

  void enter(std::int32_t u) {
    is_active_[u] = 1;
    if (!is_near_[u]) {
      is_near_[u] = 1;
      near_.push_back(u);
    }
    for (const Link& l : graph_.links[u]) {
      --n_outside_[l.to];
      if (!is_near_[l.to]) {
        is_near_[l.to] = 1;
        near_.push_back(l.to);
      }
    }
  }

  // The graph is connected, so some remaining vertex is always near.
  std::int32_t next() {
    std::size_t kept = 0;
    std::int32_t best = -1, min_growth = 0;
    for (const std::int32_t u : near_) {
      if (is_gone_[u]) continue;
      near_[kept++] = u;
      const std::int32_t growth = n_outside_[u] - is_active_[u];
      if (best < 0 || growth < min_growth) {
        best = u;
        min_growth = growth;
      }
    }
    near_.resize(kept);
    return best;
  }

  const MatchingGraph& graph_;
  std::vector<char> is_gone_, is_active_, is_near_;
  // Number of neighbours that are neither in the frontier nor eliminated.
  std::vector<std::int32_t> n_outside_;
  std::vector<std::int32_t> near_;   // candidates: the frontier and its neighbours
};

}  // namespace asterism
