// The k best assignments in order (Murty 1968), with the improvements of Miller, Stone & Cox 1997.
// A subproblem starts from the solution and the duals of its parent and needs one shortest
// augmenting path. Until it is first in the queue, a lower bound stands for its cost.
//
//   c_ij    cost, square N × N; two solutions differ if they assign the first n rows differently,
//           the other rows are padding of cost zero
//   u, v    duals with c_ij - u_i - v_j ≥ 0, = 0 on assigned pairs
#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <vector>

namespace asterism {

class KBest {
 public:
  static constexpr double kForbidden = std::numeric_limits<double>::infinity();

  // `cost` is row-major, n × N; all further rows are zero.
  KBest(std::span<const double> cost, std::int32_t n, std::int32_t N) : c_(cost), n_(n), N_(N) {}

  // Advances to the next best assignment. Returns false if there is none.
  bool next() {
    if (current_.solution)
      split(current_);
    else
      begin();
    current_ = {};
    while (!queue_.empty()) {
      std::pop_heap(queue_.begin(), queue_.end());
      Node node = std::move(queue_.back());
      queue_.pop_back();
      if (node.is_solved) {
        current_ = std::move(node);
        return true;
      }
      settle(node);
    }
    return false;
  }

  // Cost of the current assignment, and the column of each of the n rows.
  double current_cost() const { return current_.cost; }
  std::span<const std::int32_t> columns() const {
    return std::span<const std::int32_t>(current_.solution->column).first(n_);
  }

 private:
  struct Solution {
    std::vector<std::int32_t> column, row;  // of each row, of each column; -1 if free
    std::vector<double> u, v;
    explicit Solution(std::int32_t N) : column(N, -1), row(N, -1), u(N, 0), v(N, 0) {}
  };

  // Rows before `n_fixed` keep their columns of the solution. Row n_fixed may not take a
  // `forbidden` column.
  struct Node {
    double cost = 0;  // of its best solution, or a lower bound
    std::int64_t number = 0;
    std::shared_ptr<const Solution> solution;  // its own if solved, else that of its parent
    std::int32_t n_fixed = 0;
    std::vector<std::int32_t> forbidden;
    bool is_solved = false;

    bool operator<(const Node& other) const {
      return cost != other.cost ? cost > other.cost : number > other.number;
    }
  };

  void begin() {
    auto first = std::make_shared<Solution>(N_);
    for (std::int32_t i = 0; i < n_; ++i) {
      const double min_cost = *std::min_element(&c_[static_cast<std::size_t>(i) * N_],
                                             &c_[static_cast<std::size_t>(i) * N_] + N_);
      first->u[i] = min_cost < kForbidden ? min_cost : 0;
    }
    std::vector<char> is_open(N_, 1);
    for (std::int32_t i = 0; i < N_; ++i)
      if (!augment(*first, i, {}, is_open)) return;
    push({cost_of(*first), 0, first, 0, {}, true});
  }

  double cost(std::int32_t i, std::int32_t j) const {
    return i < n_ ? c_[static_cast<std::size_t>(i) * N_ + j] : 0;
  }
  static bool is_forbidden(std::int32_t j, std::span<const std::int32_t> forbidden) {
    return std::find(forbidden.begin(), forbidden.end(), j) != forbidden.end();
  }
  double reduced(const Solution& s, std::int32_t i, std::int32_t j) const {
    return std::max(cost(i, j) - s.u[i] - s.v[j], 0.0);
  }
  double cost_of(const Solution& s) const {
    double sum = 0;
    for (std::int32_t i = 0; i < n_; ++i) sum += cost(i, s.column[i]);
    return sum;
  }

  void push(Node node) {
    node.number = n_nodes_++;
    queue_.push_back(std::move(node));
    std::push_heap(queue_.begin(), queue_.end());
  }

  // Finds the shortest augmenting path from row `start` to a free column, over open columns, and
  // applies it. `start` may not take a `forbidden` column. Returns false if there is no path.
  bool augment(Solution& s, std::int32_t start, std::span<const std::int32_t> forbidden,
               const std::vector<char>& is_open) {
    distance_.assign(N_, kForbidden);
    from_.assign(N_, -1);
    is_done_.assign(N_, 0);
    std::int32_t i = start, sink = -1;
    double reached = 0;
    while (sink < 0) {
      const double left = reached - s.u[i];
      std::int32_t nearest = -1;
      double min_cost = kForbidden;
      for (std::int32_t j = 0; j < N_; ++j) {
        if (!is_open[j] || is_done_[j]) continue;
        const double d = std::max(left + cost(i, j) - s.v[j], reached);
        if (d < distance_[j] && !(i == start && is_forbidden(j, forbidden))) {
          distance_[j] = d;
          from_[j] = i;
        }
        if (distance_[j] < min_cost) {
          min_cost = distance_[j];
          nearest = j;
        }
      }
      if (nearest < 0) return false;
      reached = distance_[nearest];
      is_done_[nearest] = 1;
      if (s.row[nearest] < 0)
        sink = nearest;
      else
        i = s.row[nearest];
    }
    for (std::int32_t j = 0; j < N_; ++j)
      if (is_done_[j] && j != sink) {
        s.u[s.row[j]] += reached - distance_[j];
        s.v[j] -= reached - distance_[j];
      }
    s.u[start] += reached;
    for (std::int32_t j = sink; j >= 0;) {
      const std::int32_t r = from_[j], next = s.column[r];
      s.row[j] = r;
      s.column[r] = j;
      j = r == start ? -1 : next;
    }
    return true;
  }

  // Solves a node that has reached the front of the queue.
  void settle(Node& node) {
    auto own = std::make_shared<Solution>(*node.solution);
    std::vector<char> is_open(N_, 1);
    for (std::int32_t r = 0; r < node.n_fixed; ++r) is_open[own->column[r]] = 0;
    own->row[own->column[node.n_fixed]] = -1;
    own->column[node.n_fixed] = -1;
    if (!augment(*own, node.n_fixed, node.forbidden, is_open)) return;
    const double cost = cost_of(*own);
    push({cost, 0, std::move(own), node.n_fixed, std::move(node.forbidden), true});
  }

  // Partitions all solutions of a node except its best: in part r, rows before r keep their columns
  // and row r changes its column.
  void split(const Node& node) {
    const Solution& s = *node.solution;
    std::vector<char> is_open(N_, 1);
    for (std::int32_t r = 0; r < node.n_fixed; ++r) is_open[s.column[r]] = 0;
    for (std::int32_t r = node.n_fixed; r < n_; ++r) {
      std::vector<std::int32_t> forbidden;
      if (r == node.n_fixed) forbidden = node.forbidden;
      forbidden.push_back(s.column[r]);
      const double more = min_increase(s, r, forbidden, is_open);
      if (more < kForbidden)
        push({node.cost + more, 0, node.solution, r, std::move(forbidden), false});
      is_open[s.column[r]] = 0;
    }
  }

  // A lower bound of the cost of changing row r: the row must take another column, and another row
  // must take its column.
  double min_increase(const Solution& s, std::int32_t r, std::span<const std::int32_t> forbidden,
                    const std::vector<char>& is_open) const {
    double out = kForbidden, in = kForbidden;
    for (std::int32_t j = 0; j < N_; ++j)
      if (is_open[j] && cost(r, j) < kForbidden &&
          !is_forbidden(j, forbidden))
        out = std::min(out, reduced(s, r, j));
    for (std::int32_t i = r + 1; i < N_; ++i)
      if (cost(i, s.column[r]) < kForbidden) in = std::min(in, reduced(s, i, s.column[r]));
    return out + in;
  }

  std::span<const double> c_;
  std::int32_t n_, N_;
  std::int64_t n_nodes_ = 0;
  Node current_;
  std::vector<Node> queue_;  // a heap with the lowest cost on top
  std::vector<double> distance_;
  std::vector<std::int32_t> from_;
  std::vector<char> is_done_;
};

}  // namespace asterism
