// What distance bonds say of a partition: a term of its log posterior.
//
//   B(ω) = Σ_t Σ b_AC(|y_A(t) − y_C(t)|)      over the bonded markers A, C that are both seen in t
//
// t are the frames that are open. A track is the marker that its first detection of any that are known
// is known for: the settled ones of a stream, one of each marker in a whole take. So a track keeps its
// name when its tail is another's, and its tail takes the name of whom it follows; what is known for
// nobody has no bonds. While a walk lasts neither bonds nor what is known change, so that B is a
// function of ω alone.
//
// Who is seen where is kept in a table, frames × markers, of detections: a move changes few of its
// cells, and only the pairs of these are weighed. Detections have their numbers in the whole
// partition, and so has a part of it in its table everyone else who is bonded, as they are when its
// walk begins.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "mcmc/model/partition.hpp"
#include "rigid/bond_graph.hpp"

namespace asterism {

template <typename Filter>
class BondTerm {
 public:
  // None, which says nothing.
  BondTerm() = default;
  // `known`: by detection of the whole the marker that it is known for, -1 for none; each marker once.
  BondTerm(BondGraph graph, std::vector<std::int32_t> known)
      : graph_(std::make_shared<const BondGraph>(std::move(graph))),
        known_(std::make_shared<const std::vector<std::int32_t>>(std::move(known))) {}

  bool is_on() const { return graph_ != nullptr; }
  const BondGraph& graph() const { return *graph_; }

  // The whole partition, to begin at; it has to outlast the term.
  void read(const Partition<Filter>& whole) {
    if (!is_on()) return;
    window_ = &whole.window();
    D_ = whole.motion().axis.D;
    first_ = whole.frozen() + 1;
    const std::int64_t n = (window_->now() - first_ + 1) * graph_->n_markers();
    seen_.assign(static_cast<std::size_t>(std::max<std::int64_t>(n, 0)), kNobody);
    place_.assign(seen_.size(), kNotMoved);
    moved_.clear();
    for (const std::int32_t k : whole.tracks().items()) {
      const auto& nodes = whole.track(k).nodes;
      const std::int32_t marker = marker_of(whole, nodes);
      for (const std::int32_t i : nodes)
        if (const std::int64_t at = cell(whole, i, marker); at >= 0) seen_[at] = whole.origin(i);
    }
  }

  // What edits of the partition, or of a part of it, move; returns the most that this may gain.
  double look_at(const Partition<Filter>& p, std::span<const Edit<Filter>> edits) {
    if (!is_on()) return 0;
    for (const Moved& m : moved_) place_[m.cell] = kNotMoved;
    moved_.clear();
    for (const Edit<Filter>& e : edits) {
      if (e.track < 0) continue;
      const auto& nodes = p.track(e.track).nodes;
      const std::int32_t marker = marker_of(p, nodes);
      for (std::size_t n = marker == marker_after(p, e) ? e.keep : 0; n < nodes.size(); ++n)
        move(p, nodes[n], marker, kNobody);
    }
    for (const Edit<Filter>& e : edits) {
      const std::int32_t marker = marker_after(p, e);
      if (e.track >= 0 && marker != marker_of(p, p.track(e.track).nodes))
        for (std::int32_t n = 0; n < e.keep; ++n) {
          const std::int32_t i = p.track(e.track).nodes[n];
          move(p, i, marker, p.origin(i));
        }
      for (const std::int32_t i : e.tail.nodes) move(p, i, marker, p.origin(i));
    }
    double most = 0;
    std::erase_if(moved_, [&](const Moved& m) {
      if (m.other == seen_[m.cell]) {
        place_[m.cell] = kNotMoved;
        return true;
      }
      most += graph_->reach(m.marker) * ((m.other != kNobody) + (seen_[m.cell] != kNobody));
      return false;
    });
    return most;
  }
  // What it gains.
  double gain() {
    if (moved_.empty()) return 0;
    const double before = around_moved();
    change();
    const double after = around_moved();
    change();
    return after - before;
  }
  // It is carried out, or taken back.
  void change() {
    for (Moved& m : moved_) std::swap(m.other, seen_[m.cell]);
  }

  // B.
  double total() const {
    if (!is_on()) return 0;
    double sum = 0;
    for (std::int64_t t = first_; t <= window_->now(); ++t) sum += total(t);
    return sum;
  }
  // What bonds say of one frame.
  double total(std::int64_t frame) const {
    double sum = 0;
    const std::int64_t row = (frame - first_) * graph_->n_markers();
    for (std::int32_t a = 0; a < graph_->n_markers(); ++a)
      for (const BondGraph::Bond& bond : graph_->of(a))
        if (bond.other < a) sum += weigh(row, a, bond);
    return sum;
  }

 private:
  static constexpr std::int32_t kNobody = -1, kNotMoved = -1;
  struct Moved {
    std::int64_t cell = 0;
    std::int32_t marker = 0;
    std::int32_t other = kNobody;  // who is there after the change, or was before it
  };

  std::int32_t marker_of(const Partition<Filter>& p, std::span<const std::int32_t> nodes) const {
    for (const std::int32_t i : nodes)
      if (const std::int32_t marker = (*known_)[p.origin(i)]; marker >= 0) return marker;
    return kNobody;
  }
  std::int32_t marker_after(const Partition<Filter>& p, const Edit<Filter>& e) const {
    std::int32_t marker = kNobody;
    if (e.track >= 0)
      marker = marker_of(p, std::span(p.track(e.track).nodes).first(e.keep));
    return marker >= 0 ? marker : marker_of(p, e.tail.nodes);
  }
  // Where a detection is in the table, -1 where it is of nobody, or settled.
  std::int64_t cell(const Partition<Filter>& p, std::int32_t i, std::int32_t marker) const {
    const std::int64_t t = p.window()[i].frame - first_;
    return marker < 0 || t < 0 ? -1 : t * graph_->n_markers() + marker;
  }
  void move(const Partition<Filter>& p, std::int32_t i, std::int32_t marker, std::int32_t to) {
    const std::int64_t at = cell(p, i, marker);
    if (at < 0) return;
    if (place_[at] == kNotMoved) {
      place_[at] = static_cast<std::int32_t>(moved_.size());
      moved_.push_back({at, marker, to});
    } else {
      moved_[place_[at]].other = to;
    }
  }

  double weigh(std::int64_t row, std::int32_t a, const BondGraph::Bond& bond) const {
    const std::int32_t i = seen_[row + a], j = seen_[row + bond.other];
    if (i == kNobody || j == kNobody) return 0;
    return bond.says(std::sqrt(squared_distance((*window_)[i].y, (*window_)[j].y, D_)));
  }
  // What is said of those that move; of two that both move once.
  double around_moved() const {
    double sum = 0;
    for (const Moved& m : moved_) {
      const std::int64_t row = m.cell - m.marker;
      for (const BondGraph::Bond& bond : graph_->of(m.marker))
        if (place_[row + bond.other] == kNotMoved || bond.other > m.marker)
          sum += weigh(row, m.marker, bond);
    }
    return sum;
  }

  std::shared_ptr<const BondGraph> graph_;
  std::shared_ptr<const std::vector<std::int32_t>> known_;
  const DetectionWindow* window_ = nullptr;  // of the whole
  int D_ = 3;
  std::int64_t first_ = 0;
  std::vector<std::int32_t> seen_;  // detection, by frame from `first_` on and marker
  // Cells that the edits looked at last move, and of each its place among them as they were listed.
  std::vector<Moved> moved_;
  std::vector<std::int32_t> place_;
};

}  // namespace asterism
