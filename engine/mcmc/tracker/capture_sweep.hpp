// MCMC data association over a whole capture: chains run in overlapping blocks of frames,
// conditional on the tracks before and after the block.
//
//   ....ffff|oooooooooooooooo|cccccc....
//           a              b
//
//   o  open: the frames a to b of the block, in which the chains may change all links
//   f  for each track, the last detection before the block with its filter state
//   c  for each track that continues, its next detection after the block; the score includes it and
//      the detections of the kAfter frames that follow (Partition::continue_with)
//
// The effect of a detection on the filter vanishes within kAfter frames. The change of the
// capture's log posterior by a move is therefore that of its block. Blocks overlap by half, so each
// link is well inside one of them. The cost of a move does not depend on the length of the capture.
//
// With given labels of markers that accelerate together, the detections of markers before and after
// the block, which are not in it, are fixed places. Terms of detections after the block are not in its
// score. A search therefore keeps the marker of each track that leaves the block
// (Partition::keep_last_markers).
//
// Tracks are stored as links between detections, which are numbered in order of arrival.
#pragma once

#include <algorithm>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <unordered_map>
#include <utility>
#include <vector>

#include "mcmc/chain/ambiguous_links.hpp"
#include "mcmc/chain/budgets.hpp"
#include "mcmc/chain/split.hpp"
#include "mcmc/model/edit_filter.hpp"
#include "mcmc/model/partition.hpp"

namespace asterism {

template <typename Filter>
class CaptureSweep {
 public:
  using Link = AmbiguousLinks::Link;
  // The open frames of a block.
  struct Block {
    std::int64_t first = 0, last = 0, next = 0;  // `next`: first frame of the next block
    bool is_first = true, is_last = true;
  };
  // A block as a partition. Its detections have local numbers; `numbers` are those in the capture.
  struct Part {
    Partition<Filter> partition;
    AmbiguousLinks ambiguous;
    std::vector<std::int32_t> numbers;
  };

  // Blocks have `n_frames` frames, or more if tracks have long gaps.
  CaptureSweep(std::int64_t n_frames, int max_gap)
      : n_block_(std::max<std::int64_t>(n_frames, 4 * std::int64_t{max_gap})), max_gap_(max_gap) {}

  void add_frame(double time, const MotionStep& step, std::span<const Point> points) {
    frames_.push_back({time, step, n_points()});
    points_.insert(points_.end(), points.begin(), points.end());
    labels_.resize(points_.size(), -1);
    ambiguous_.emplace_back();
  }
  // Adds an ambiguous link that leads into the newest frame. Detections are given by number.
  void add_ambiguous(std::int64_t from, std::int64_t to) {
    ambiguous_.back().push_back({static_cast<std::int32_t>(from), static_cast<std::int32_t>(to)});
  }
  // Sets labels by which tracks are of markers that accelerate together.
  void give(std::shared_ptr<const GivenLabels> given) { given_ = std::move(given); }
  void set_label(std::int64_t detection, std::int64_t label) { labels_[detection] = label; }

  // Links the detections according to the labels.
  void link_labels() {
    before_.assign(points_.size(), kNone);
    after_.assign(points_.size(), kNone);
    std::unordered_map<std::int64_t, std::int32_t> last;
    for (std::int32_t i = 0; i < n_points(); ++i) {
      if (labels_[i] < 0) continue;
      const auto [at, is_new] = last.try_emplace(labels_[i], i);
      if (!is_new) link(std::exchange(at->second, i), i);
    }
  }

  std::vector<Block> blocks() const {
    const auto T = static_cast<std::int64_t>(frames_.size());
    std::vector<Block> out;
    for (std::int64_t first = 0;;) {
      Block& block = out.emplace_back();
      block.first = first;
      block.last = std::min(first + n_block_, T) - 1;
      block.is_first = first == 0;
      block.is_last = block.last == T - 1;
      block.next = block.is_last ? T : first + n_block_ / 2;
      if (block.is_last) return out;
      first = block.next;
    }
  }
  // The number of open detections of all blocks per detection of the capture. A detection may be in
  // two blocks.
  double overlap() const {
    double all = 0;
    for (const Block& block : blocks()) all += static_cast<double>(n_between(block.first, block.last));
    return n_points() == 0 ? 1 : all / static_cast<double>(n_points());
  }

  // Returns the block with its present links. Blocks must be taken in order, because each starts
  // from the filter states of the one before.
  Part take(const Partition<Filter>& empty, const Block& block) {
    Part part{empty.empty(), {}, {}};
    Partition<Filter>& p = part.partition;
    const auto T = static_cast<std::int64_t>(frames_.size());
    const std::int64_t from = std::max<std::int64_t>(block.first - max_gap_, 0);
    const std::int64_t to = std::min(block.last + std::max<std::int64_t>(kAfter, max_gap_), T - 1);
    p.close_after(block.is_last ? T : block.last - from, T - 1 - to);
    local_.clear();
    if (given_ != nullptr) give_labels(block, from, to, p);
    std::vector<std::int32_t> some;
    std::vector<Point> places;
    for (std::int64_t t = from; t <= to; ++t) {
      some.clear();
      places.clear();
      for (std::int32_t i = frames_[t].begin; i < end_of(t); ++i)
        if (belongs(block, t, i)) {
          some.push_back(i);
          places.push_back(points_[i]);
        }
      const auto ids = p.add_frame(frames_[t].time, frames_[t].step, places, part.numbers.size());
      for (std::size_t n = 0; n < some.size(); ++n) {
        local_[some[n]] = ids[n];
        part.numbers.push_back(some[n]);
      }
    }
    add_tracks(block, from, to, part);
    for (std::int64_t t = block.first; t <= std::min(block.last + max_gap_, T - 1); ++t) {
      part.ambiguous.add_frame();
      for (const Link& link : ambiguous_[t]) {
        const auto a = local_.find(link.from), y = local_.find(link.to);
        if (a != local_.end() && y != local_.end()) part.ambiguous.add(a->second, y->second);
      }
    }
    return part;
  }

  // Stores the links of a block, and the filter states from which the next one starts.
  void put_back(const Block& block, const Part& part) {
    const Partition<Filter>& p = part.partition;
    for (std::int32_t i = 0; i < p.window().n_ids(); ++i) {
      const std::int32_t own = part.numbers[i];
      if (!p.is_frozen(i)) before_[own] = kNone;
      if (!p.is_continuation(i)) after_[own] = kNone;
    }
    for (const std::int32_t k : p.tracks().items()) {
      const auto& nodes = p.track(k).nodes;
      for (std::size_t n = 1; n < nodes.size(); ++n)
        link(part.numbers[nodes[n - 1]], part.numbers[nodes[n]]);
    }
    keep_states(block, part);
  }
  void keep_states(const Block& block, const Part& part) {
    states_.clear();
    const Partition<Filter>& p = part.partition;
    const std::int64_t next = block.next - (block.first - std::min<std::int64_t>(block.first, max_gap_));
    for (const std::int32_t k : p.tracks().items())
      for (const std::int32_t i : p.track(k).nodes)
        if (p.window()[i].frame < next && p.window()[i].frame >= next - max_gap_)
          states_.insert_or_assign(part.numbers[i], p.state(i));
  }

  // Labels the tracks in order of their first detections. Returns their number.
  std::int64_t read_labels() {
    std::int64_t n = 0;
    found_.resize(points_.size());
    for (std::int32_t i = 0; i < n_points(); ++i)
      found_[i] = before_[i] != kNone ? found_[before_[i]] : after_[i] != kNone ? n++ : -1;
    return n;
  }
  // The labels of the last `read_labels`.
  std::span<const std::int64_t> labels() const { return found_; }
  std::int32_t before(std::int64_t i) const { return before_[i]; }
  std::int32_t after(std::int64_t i) const { return after_[i]; }
  std::int64_t frame_of(std::int64_t i) const {
    const auto at = std::ranges::upper_bound(frames_, i, {}, &Frame::begin);
    return at - frames_.begin() - 1;
  }

 private:
  static constexpr std::int32_t kNone = -1;
  static constexpr std::int64_t kAfter = 50;  // frames

  struct Frame {
    double time = 0;
    MotionStep step;
    std::int32_t begin = 0;  // number of its first detection
  };

  // Sets the labels of a block's detections, in their order, and the fixed places. Before the block
  // the label is that of the marker.
  void give_labels(const Block& block, std::int64_t from, std::int64_t to, Partition<Filter>& p) {
    // Links from the first half of the block before on may have changed.
    list_markers(std::max<std::int64_t>(block.first - n_block_ / 2, 0), to);
    GivenLabels own{0, {}, given_->shared};
    std::vector<FixedPlace> fixed;
    for (std::int64_t t = from; t <= to; ++t)
      for (std::int32_t i = frames_[t].begin; i < end_of(t); ++i)
        if (belongs(block, t, i))
          own.labels.push_back(t < block.first ? markers_[i] : given_->of(i));
        else if (markers_[i] != kNone)
          fixed.push_back({markers_[i], t - from, points_[i]});
    p.give(std::make_shared<const GivenLabels>(std::move(own)));
    p.fix(std::move(fixed));
  }
  // Lists the markers of tracks in frames; those of earlier ones are known.
  void list_markers(std::int64_t first, std::int64_t last) {
    markers_.resize(points_.size(), kNone);
    for (std::int32_t i = frames_[first].begin; i < end_of(last); ++i)
      markers_[i] = before_[i] != kNone  ? markers_[before_[i]]
                    : after_[i] != kNone ? first_label(i)
                                         : kNone;
  }
  // The first label given to a detection and those after it in its track.
  std::int32_t first_label(std::int32_t i) const {
    for (; i != kNone; i = after_[i])
      if (const std::int64_t label = given_->of(i); label >= 0) return static_cast<std::int32_t>(label);
    return kNone;
  }
  std::int32_t n_points() const { return static_cast<std::int32_t>(points_.size()); }
  std::int32_t end_of(std::int64_t t) const {
    return t + 1 < static_cast<std::int64_t>(frames_.size()) ? frames_[t + 1].begin : n_points();
  }
  std::int64_t n_between(std::int64_t first, std::int64_t last) const {
    return end_of(last) - frames_[first].begin;
  }
  void link(std::int32_t i, std::int32_t j) {
    after_[i] = j;
    before_[j] = i;
  }
  // Whether a detection belongs to a block: all of the open frames, and the neighbouring detections
  // of tracks before and after.
  bool belongs(const Block& block, std::int64_t t, std::int32_t i) const {
    if (t < block.first)
      return states_.contains(i) && (after_[i] == kNone || after_[i] >= frames_[block.first].begin);
    if (t <= block.last) return true;
    return before_[i] != kNone && before_[i] < end_of(block.last);
  }
  void add_tracks(const Block& block, std::int64_t from, std::int64_t to, Part& part) {
    Partition<Filter>& p = part.partition;
    std::vector<Edit<Filter>> edits;
    const auto follow = [&](Edit<Filter>& edit, std::int32_t i) {
      for (; i != kNone && local_.contains(i); i = after_[i]) {
        if (i >= end_of(block.last)) p.continue_with(local_.at(i), later_points(i, from, to));
        append(p, edit, local_.at(i));
      }
    };
    // In order of their first detections.
    for (std::int32_t i = frames_[from].begin; i < frames_[block.first].begin; ++i) {
      const auto at = local_.find(i);
      if (at == local_.end()) continue;
      const std::int32_t k = p.add_settled(at->second, states_.at(i), before_[i] != kNone);
      p.set_id(k, labels_[i]);
    }
    p.freeze(block.first - 1 - from);
    for (const std::int32_t k : p.tracks().items()) {
      Edit<Filter>& edit = edits.emplace_back();
      edit.track = k;
      edit.keep = 1;
      follow(edit, after_[part.numbers[p.last(k)]]);
    }
    const std::size_t n_settled = edits.size();
    for (std::int32_t i = frames_[block.first].begin; i < end_of(block.last); ++i)
      if (before_[i] == kNone && after_[i] != kNone) follow(edits.emplace_back(), i);
    p.apply(edits);
    for (std::size_t e = n_settled; e < edits.size(); ++e)
      p.set_id(edits[e].track, labels_[part.numbers[edits[e].tail.nodes.front()]]);
  }
  // The detections after a continuation, until the filter has forgotten the block.
  LaterPoints later_points(std::int32_t i, std::int64_t from, std::int64_t to) const {
    auto later = std::make_shared<std::vector<LaterPoint>>();
    for (i = after_[i]; i != kNone && i < end_of(to); i = after_[i])
      later->push_back({frame_of(i) - from, points_[i]});
    return later;
  }

  std::int64_t n_block_;
  int max_gap_;
  std::vector<Frame> frames_;
  std::vector<Point> points_;
  std::vector<std::int64_t> labels_, found_;  // initial and final
  std::vector<std::vector<Link>> ambiguous_;  // by the frame they lead into
  std::vector<std::int32_t> before_, after_;
  std::shared_ptr<const GivenLabels> given_;
  std::vector<std::int32_t> markers_;  // by detection, -1 for none
  // At the start of the next block.
  std::unordered_map<std::int32_t, typename Filter::State> states_;
  std::unordered_map<std::int32_t, std::int32_t> local_;  // local numbers, while the block is taken
};

}  // namespace asterism
