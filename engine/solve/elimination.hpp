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
#include <span>
#include <vector>

namespace asterism {

struct Link {
  std::int32_t to = 0, edge = 0;
};

struct MatchingGraph {
  std::vector<Link> links;          // by vertex
  std::vector<std::int32_t> first;  // the links of vertex v are first[v] to first[v + 1]
  std::vector<double> weight;       // of each edge
  std::vector<double> alone;        // of each vertex

  std::int32_t size() const { return static_cast<std::int32_t>(first.size()) - 1; }
  std::int32_t degree(std::int32_t v) const { return first[v + 1] - first[v]; }
  std::span<const Link> links_of(std::int32_t v) const {
    return std::span(links).subspan(first[v], degree(v));
  }
};

struct EliminationStep {
  std::int32_t vertex = 0;
  bool is_active = false;           // in the frontier before the step
  std::span<const Link> links;      // to the remaining vertices, whose bits the step may set
  std::span<const Link> entering;   // of these, to vertices that the step adds to the frontier
};

struct Elimination {
  std::vector<std::int32_t> order;  // of the vertices; empty if none was found
  std::int32_t peak = 0;            // size of the largest frontier
  double work = 0;                  // multiplications of one pass

  // The steps in that order. They refer to `links`, which receives the links of all steps.
  std::vector<EliminationStep> steps(const MatchingGraph& graph, std::vector<Link>& links) const {
    std::vector<char> is_gone(graph.size(), 0), is_active(graph.size(), 0);
    std::vector<EliminationStep> out;
    out.reserve(order.size());
    links.clear();
    links.reserve(graph.links.size());  // so that the spans stay valid
    for (const std::int32_t v : order) {
      EliminationStep step{v, is_active[v] != 0, {}, {}};
      is_gone[v] = 1;
      const auto collect = [&](auto&& is_included) {
        const std::size_t begin = links.size();
        for (const Link& l : graph.links_of(v))
          if (!is_gone[l.to] && is_included(l.to)) links.push_back(l);
        return std::span<const Link>(links).subspan(begin);
      };
      step.links = collect([](std::int32_t) { return true; });
      step.entering = collect([&](std::int32_t u) { return !is_active[u]; });
      for (const Link& l : step.entering) is_active[l.to] = 1;
      out.push_back(step);
    }
    return out;
  }
};

// Its working memory serves many graphs.
class EliminationOrder {
 public:
  // The cheapest of several greedy orders, each from another promising first vertex, whose frontier
  // always has at most so many vertices. A trial stops where it is no longer the cheapest.
  const Elimination& best(const MatchingGraph& graph, std::int32_t max_frontier) {
    graph_ = &graph;
    best_.order.clear();
    best_.work = std::numeric_limits<double>::infinity();
    try_from(farthest(farthest(0)), max_frontier);
    // With a small frontier, more trials would cost more than they save.
    if (best_.order.empty() || best_.peak > kSmallFrontier) try_others(max_frontier);
    return best_;
  }

 private:
  static constexpr std::int32_t kSmallFrontier = 6, kManyStarts = 15;

  // Further first vertices: those of low degree, and one of high degree.
  void try_others(std::int32_t max_frontier) {
    starts_.resize(graph_->size());
    std::iota(starts_.begin(), starts_.end(), 0);
    std::stable_sort(starts_.begin(), starts_.end(), [&](std::int32_t a, std::int32_t b) {
      return graph_->degree(a) < graph_->degree(b);
    });
    if (static_cast<std::int32_t>(starts_.size()) > kManyStarts) {
      starts_[kManyStarts] = starts_.back();
      starts_.resize(kManyStarts + 1);
    }
    for (const std::int32_t start : starts_) {
      try_from(start, max_frontier);
      if (!best_.order.empty() && best_.peak <= kSmallFrontier) return;
    }
  }
  void try_from(std::int32_t start, std::int32_t max_frontier) {
    if (greedy(start, max_frontier)) std::swap(best_, trial_);
  }

  // The last vertex that a breadth-first search reaches.
  std::int32_t farthest(std::int32_t from) {
    near_.assign(1, from);
    is_near_.assign(graph_->size(), 0);
    is_near_[from] = 1;
    for (std::size_t k = 0; k < near_.size(); ++k)
      for (const Link& l : graph_->links_of(near_[k])) add_near(l.to);
    return near_.back();
  }

  // Always eliminates the vertex that leaves the smallest frontier. Ties go to the vertex that was
  // met first. Returns false if the frontier becomes too large or the order is not cheaper than the
  // best.
  bool greedy(std::int32_t start, std::int32_t max_frontier) {
    const std::int32_t n = graph_->size();
    is_gone_.assign(n, 0);
    is_active_.assign(n, 0);
    is_near_.assign(n, 0);
    n_outside_.resize(n);
    for (std::int32_t v = 0; v < n; ++v) n_outside_[v] = graph_->degree(v);
    near_.clear();
    trial_.order.clear();
    trial_.peak = 0;
    trial_.work = 0;
    for (std::int32_t v = start, frontier = 0;; v = next()) {
      const bool was_active = is_active_[v];
      is_gone_[v] = 1;
      if (!was_active) enter(v);  // only to update the counts of its neighbours
      std::int32_t n_links = 0, n_entering = 0;
      for (const Link& l : graph_->links_of(v)) {
        if (is_gone_[l.to]) continue;
        ++n_links;
        if (is_active_[l.to]) continue;
        ++n_entering;
        enter(l.to);
      }
      frontier += n_entering - was_active;
      trial_.peak = std::max(trial_.peak, frontier);
      trial_.work += std::ldexp(static_cast<double>(n_links + 1), std::min(frontier, 900));
      if (frontier > max_frontier || !(trial_.work < best_.work)) return false;
      trial_.order.push_back(v);
      if (static_cast<std::int32_t>(trial_.order.size()) == n) return true;
    }
  }

  void add_near(std::int32_t u) {
    if (is_near_[u]) return;
    is_near_[u] = 1;
    near_.push_back(u);
  }
  void enter(std::int32_t u) {
    is_active_[u] = 1;
    add_near(u);
    for (const Link& l : graph_->links_of(u)) {
      --n_outside_[l.to];
      add_near(l.to);
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

  const MatchingGraph* graph_ = nullptr;
  Elimination best_, trial_;
  std::vector<std::int32_t> starts_;
  std::vector<char> is_gone_, is_active_, is_near_;
  // Number of neighbours that are neither in the frontier nor eliminated.
  std::vector<std::int32_t> n_outside_;
  std::vector<std::int32_t> near_;   // candidates: the frontier and its neighbours
};

}  // namespace asterism
