// The part of the log posterior by which markers of a segment accelerate together
// (rigid/shared_acceleration.hpp), in a part of a partition.
//
// Each track is of the marker whose label the first of its labelled detections was given. The term of
// a detection depends on the detections of neighbours in its frame, in that of the detection before
// it, and in the frame before that; of the first detection of a track, in its frame alone. A change
// of tracks changes the terms of
//
//   own detections from the first change on, because it changes their filter
//   other markers that have one of theirs as a neighbour in one of these frames
//
// Once the filter has forgotten the change, the terms of later own detections are taken to be the
// same.
//
// Tracks of the whole partition that are not in the part are fixed, as are its fixed places: the term
// is conditional on them.
// A marker with detections of two tracks in a frame has no place there.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <tuple>
#include <utility>
#include <vector>

#include "mcmc/model/edit_filter.hpp"
#include "mcmc/model/edits.hpp"
#include "mcmc/model/partition.hpp"
#include "rigid/marker_places.hpp"
#include "rigid/shared_acceleration.hpp"

namespace asterism {

template <typename Filter>
class SharedTerm {
 public:
  // Begins a part, which was taken of these tracks. Without labels the term is 0.
  void begin(const Partition<Filter>& whole, const Partition<Filter>& part,
             std::span<const std::int32_t> tracks) {
    whole_ = &whole;
    part_ = &part;
    is_on_ = false;
    if (!whole.is_shared()) return;
    shared_ = whole.given()->shared.get();
    first_ = whole.window().first();
    n_frames_ = whole.window().now() - first_ + 1;
    places_.begin(shared_->size(), first_, n_frames_);
    outside_.resize(std::max(outside_.size(), shared_->size()));
    for (std::vector<std::int32_t>& of : outside_) of.clear();
    is_inside_.assign(is_inside_.size(), 0);
    for (const std::int32_t k : tracks) {
      if (static_cast<std::size_t>(k) >= is_inside_.size()) is_inside_.resize(k + 1, 0);
      is_inside_[k] = 1;
      const std::int32_t marker = whole.marker(k);
      is_on_ = is_on_ || (marker >= 0 && shared_->has_neighbours(marker));
    }
    if (!is_on_) return;
    known_inside_.assign(part.window().n_ids(), kUnknown);
    known_outside_.assign(whole.window().n_ids(), kUnknown);
    for (const FixedPlace& one : whole.fixed()) places_.add(one.marker, one.frame, one.at);
    for (const std::int32_t k : whole.tracks().items()) {
      const std::int32_t marker = whole.marker(k);
      if (marker < 0) continue;
      for (const std::int32_t i : whole.track(k).nodes)
        places_.add(marker, whole.window()[i].frame, whole.window()[i].y);
      const auto at = static_cast<std::size_t>(k);
      if (at >= is_inside_.size() || !is_inside_[at]) outside_[marker].push_back(k);
    }
  }
  bool is_on() const { return is_on_; }
  // Nats by which it may outweigh the own scores.
  double reach() const { return is_on_ ? GivenLabels::kReach : 0; }

  // Whether edits are excluded, because a detection in which a track leaves the frames would be of
  // another marker. What that costs later is not in the score; and where markers have the same
  // distances to others, their exchange costs nothing later. This is for searches: it is not
  // symmetric.
  bool excludes(std::span<const Edit<Filter>> edits) const {
    if (!is_on_ || !part_->keeps_last_markers()) return false;
    const DetectionWindow& window = part_->window();
    for (const Edit<Filter>& edit : edits) {
      if (edit.tail.nodes.empty()) continue;
      const std::int32_t i = edit.tail.nodes.back(), k = part_->track_of(i);
      const std::int32_t marker = k < 0 ? -1 : part_->marker(k);
      const bool leaves =
          part_->is_continuation(i) || window.now() - window[i].frame < window.max_gap();
      if (leaves && marker >= 0 && marker != new_marker(edit)) return true;
    }
    return false;
  }
  // The change of the term by edits, which must be filtered.
  double gain(std::span<const Edit<Filter>> edits) {
    list_changes(edits);
    list_dependent(edits);
    double sum = 0;
    for (const Edit<Filter>& edit : edits)
      if (edit.track >= 0) sum -= own_terms(edit);
    for (const Node& one : dependent_) sum -= known(one);
    move_places();
    for (const Edit<Filter>& edit : edits) sum += new_terms(edit);
    for (const Node& one : dependent_) sum += term(one);
    move_places(true);
    return sum;
  }
  // Follows edits that are about to be applied to the part.
  void apply(std::span<const Edit<Filter>> edits) {
    list_changes(edits);
    list_dependent(edits);
    for (const Node& one : dependent_) known_at(one) = kUnknown;
    for (const Edit<Filter>& edit : edits) {
      for (std::int32_t n = first_changed(edit); n < edit.keep; ++n)
        known_inside_[part_->track(edit.track).nodes[n]] = kUnknown;
      for (const std::int32_t i : edit.tail.nodes) known_inside_[i] = kUnknown;
    }
    move_places();
  }

 private:
  static constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

  // A detection that a marker gets or loses.
  struct Changed {
    std::int32_t marker = 0;
    std::int64_t frame = 0;
    std::int32_t detection = 0;
    bool is_new = false;
    auto key() const { return std::tuple(marker, frame, detection); }
  };
  // A detection of a track, of the part or of the whole partition.
  struct Node {
    std::int32_t track = 0, place = 0;
    bool is_outside = false;
    auto operator<=>(const Node&) const = default;
  };

  // The marker of an edited track after the edit.
  std::int32_t new_marker(const Edit<Filter>& edit) const {
    if (edit.keep > 0) {
      const PartitionTrack& track = part_->track(edit.track);
      if (track.n_gone + track.n_frozen > 0) return track.marker;
      const std::int32_t kept =
          part_->marker_of(std::span(track.nodes).first(static_cast<std::size_t>(edit.keep)));
      if (kept >= 0) return kept;
    }
    return part_->marker_of(edit.tail.nodes);
  }
  // The place in an edited track from which on its own terms change: after the detections that are
  // kept, or the beginning if the marker changes.
  std::int32_t first_changed(const Edit<Filter>& edit) const {
    return edit.keep > 0 && part_->marker(edit.track) != new_marker(edit) ? 0 : edit.keep;
  }

  void list_changes(std::span<const Edit<Filter>> edits) {
    all_.clear();
    changed_.clear();
    const DetectionWindow& window = part_->window();
    for (const Edit<Filter>& edit : edits) {
      if (edit.track >= 0)
        if (const std::int32_t marker = part_->marker(edit.track); marker >= 0) {
          const auto& nodes = part_->track(edit.track).nodes;
          for (std::size_t n = first_changed(edit); n < nodes.size(); ++n)
            all_.push_back({marker, window[nodes[n]].frame, nodes[n], false});
        }
      if (const std::int32_t marker = new_marker(edit); marker >= 0) {
        for (std::int32_t n = first_changed(edit); n < edit.keep; ++n) {
          const std::int32_t i = part_->track(edit.track).nodes[n];
          all_.push_back({marker, window[i].frame, i, true});
        }
        for (const std::int32_t i : edit.tail.nodes)
          all_.push_back({marker, window[i].frame, i, true});
      }
    }
    std::ranges::sort(all_, {}, &Changed::key);
    for (std::size_t n = 0; n < all_.size(); ++n)
      if (n + 1 < all_.size() && all_[n].key() == all_[n + 1].key())
        ++n;  // lost and got again
      else
        changed_.push_back(all_[n]);
  }
  // Moves the places of markers to those after the listed changes, and back.
  void move_places(bool is_back = false) {
    for (const Changed& one : changed_) {
      const Point& y = part_->window()[one.detection].y;
      if (one.is_new != is_back)
        places_.add(one.marker, one.frame, y);
      else
        places_.remove(one.marker, one.frame, y);
    }
  }

  // Lists the detections that are not edited and have a changed one as a neighbour.
  void list_dependent(std::span<const Edit<Filter>> edits) {
    dependent_.clear();
    if (changed_.empty()) return;
    list_inside(edits);
    is_changed_.resize(static_cast<std::size_t>(n_frames_));
    for (auto from = changed_.begin(); from != changed_.end();) {
      const std::int32_t marker = from->marker;
      const auto to = std::find_if(from, changed_.end(),
                                   [&](const Changed& one) { return one.marker != marker; });
      const auto mark = [&](char value) {
        for (auto one = from; one != to; ++one)
          is_changed_[static_cast<std::size_t>(one->frame - first_)] = value;
      };
      mark(1);
      for (const std::int32_t other : (*shared_)[marker].after) {
        for (const std::int32_t k : outside_[other])
          list_dependent({k, whole_->track(k).size(), true}, other, marker, from->frame);
        for (const Node& kept : inside_[other]) list_dependent(kept, other, marker, from->frame);
      }
      mark(0);
      from = to;
    }
    std::ranges::sort(dependent_);
    const auto rest = std::ranges::unique(dependent_);
    dependent_.erase(rest.begin(), rest.end());
  }
  // Lists the tracks of the part by marker, each with the number of detections whose terms change by
  // their neighbours alone.
  void list_inside(std::span<const Edit<Filter>> edits) {
    inside_.resize(shared_->size());
    for (std::vector<Node>& of : inside_) of.clear();
    for (const std::int32_t k : part_->tracks().items())
      if (const std::int32_t marker = part_->marker(k); marker >= 0)
        inside_[marker].push_back({k, part_->track(k).size(), false});
    for (const Edit<Filter>& edit : edits)
      if (edit.track >= 0)
        if (const std::int32_t marker = part_->marker(edit.track); marker >= 0)
          std::ranges::find(inside_[marker], edit.track, &Node::track)->place = first_changed(edit);
  }
  // Those of the first detections of a track, up to `end.place`, that have one of the neighbour's
  // changed ones as a neighbour. None of these is before frame `first`.
  void list_dependent(const Node& end, std::int32_t marker, std::int32_t neighbour,
                      std::int64_t first) {
    const Partition<Filter>& p = end.is_outside ? *whole_ : *part_;
    const auto& nodes = p.track(end.track).nodes;
    const auto is_changed = [&](std::int64_t frame) {
      return frame >= first && is_changed_[static_cast<std::size_t>(frame - first_)] != 0;
    };
    for (std::int32_t at = end.place - 1; at >= first_with_term(p.track(end.track)); --at) {
      const std::int64_t to = p.window()[nodes[at]].frame;
      const std::int64_t from = at == 0 ? to : p.window()[nodes[at - 1]].frame;
      if (to < first) return;
      const bool has_three = to == from + 1;  // the frames of an acceleration
      if (is_changed(to) || is_changed(from) || (has_three && is_changed(from - 1)))
        if (may_see(marker, neighbour, from, to)) dependent_.push_back({end.track, at, end.is_outside});
    }
  }
  // Whether a neighbour can be among the steadiest of a marker that are detected in both frames.
  // Steadier ones may be changed as well: then the detection is listed for the first of them.
  bool may_see(std::int32_t marker, std::int32_t neighbour, std::int64_t from, std::int64_t to) {
    std::size_t n_pairs = 0, n_shape = 0;
    for (const auto& other : (*shared_)[marker].before) {
      if (other.marker == neighbour) return true;
      if (places_(other.marker, to) == nullptr) continue;
      n_pairs += places_(other.marker, from) != nullptr;
      n_shape += !std::isnan(other.shape[0]);
      if (std::min(n_pairs, n_shape) >= kSteadiest) return false;
    }
    return true;
  }

  double& known_at(const Node& one) {
    return one.is_outside ? known_outside_[whole_->track(one.track).nodes[one.place]]
                          : known_inside_[part_->track(one.track).nodes[one.place]];
  }
  // The term of a detection in the present state of the part.
  double known(const Node& one) {
    double& value = known_at(one);
    if (std::isnan(value)) value = term(one);
    return value;
  }
  // The first place in a track whose term may change. A detection after one that has left the window
  // is settled.
  static std::int32_t first_with_term(const PartitionTrack& track) { return track.n_gone > 0; }
  double term(const Node& one) {
    const Partition<Filter>& p = one.is_outside ? *whole_ : *part_;
    return term(p, p.marker(one.track), p.track(one.track), one.place);
  }
  // The term of the detection at a place in a track, as if the track were of this marker.
  double term(const Partition<Filter>& p, std::int32_t marker, const PartitionTrack& track,
              std::int32_t at) {
    const std::int32_t j = track.nodes[at];
    if (at == 0) return begin_term(p, marker, j);
    const std::int32_t i = track.nodes[at - 1];
    return term(p, marker, p.state(i), i, j, track.n_gone + at);
  }
  double own_terms(const Edit<Filter>& edit) {
    const auto& nodes = part_->track(edit.track).nodes;
    double sum = 0;
    if (part_->marker(edit.track) < 0) return sum;
    const std::int32_t first = first_with_term(part_->track(edit.track));
    for (std::int32_t n = std::max(first_changed(edit), first);
         n < static_cast<std::int32_t>(nodes.size()); ++n)
      sum += known({edit.track, n, false});
    return sum;
  }
  double new_terms(const Edit<Filter>& edit) {
    const std::int32_t marker = new_marker(edit);
    if (marker < 0) return 0;
    const Tail<Filter>& tail = edit.tail;
    const std::int32_t n_kept = edit.track < 0 ? 0 : part_->track(edit.track).n_gone + edit.keep;
    mark_changed_neighbours(marker);
    double sum = 0;
    if (edit.keep > 0) {
      const PartitionTrack& track = part_->track(edit.track);
      for (std::int32_t n = std::max(first_changed(edit), first_with_term(track)); n < edit.keep; ++n)
        sum += term(*part_, marker, track, n);
    }
    for (std::size_t n = 0; n < tail.nodes.size(); ++n) {
      if (edit.keep == 0 && n == 0) {
        sum += begin_term(*part_, marker, tail.nodes[0]);
        continue;
      }
      const std::int32_t i = before(*part_, edit, n);
      const std::int32_t j = tail.nodes[n];
      const auto& state = n == 0 ? part_->state(i) : tail.states[n - 1];
      sum += stays(marker, state, i, j)
                 ? known({part_->track_of(j), part_->place_of(j), false})
                 : term(*part_, marker, state, i, j, n_kept + static_cast<std::int32_t>(n));
    }
    return sum;
  }
  // Marks the frames in which a neighbour of a marker has changed.
  void mark_changed_neighbours(std::int32_t marker) {
    is_near_changed_.assign(static_cast<std::size_t>(n_frames_), 0);
    const auto& neighbours = (*shared_)[marker].before;
    for (const Changed& one : changed_)
      if (std::ranges::find(neighbours, one.marker, &SharedAcceleration::Neighbour::marker) !=
          neighbours.end())
        is_near_changed_[static_cast<std::size_t>(one.frame - first_)] = 1;
  }
  // Whether the term of detection j after detection i, with this filter state, is the same as before:
  // it follows i already, for the same marker, in practically the same state, and the neighbours are
  // the same in all frames on which the term depends.
  bool stays(std::int32_t marker, const typename Filter::State& state, std::int32_t i,
             std::int32_t j) const {
    const std::int32_t k = part_->track_of(j), at = part_->place_of(j);
    if (k < 0 || at == 0 || part_->track(k).nodes[at - 1] != i) return false;
    const auto has_changed = [&](std::int64_t frame) {
      return frame >= first_ && is_near_changed_[static_cast<std::size_t>(frame - first_)] != 0;
    };
    const std::int64_t from = part_->window()[i].frame, to = part_->window()[j].frame;
    return !has_changed(to) && !has_changed(from) && !has_changed(from - 1) &&
           Filter::is_close(part_->motion(), state, part_->state(i)) && part_->marker(k) == marker;
  }
  // The term of the first detection of a track.
  double begin_term(const Partition<Filter>& p, std::int32_t marker, std::int32_t j) {
    if ((*shared_)[marker].before.empty()) return 0;
    const auto& at = p.window()[j];
    return shared_->begin_gain(
        marker, shared_->begin_densities(
                    marker, at.frame, at.y, p.motion().axis.r, places_, memory_));
  }
  // The term of detection j after detection i, which follows `n_before` - 1 others of its track and
  // has this filter state.
  double term(const Partition<Filter>& p, std::int32_t marker, const typename Filter::State& state,
              std::int32_t i, std::int32_t j, std::int32_t n_before) {
    if ((*shared_)[marker].before.empty()) return 0;
    const DetectionWindow& window = p.window();
    const auto &from = window[i], &to = window[j];
    const auto gap = static_cast<int>(to.frame - from.frame);
    p.filter().expect(p.motion(), window, state, from.frame, gap, expected_);
    shared_->predict(Filter::own_prediction(p.motion(), expected_),
                     {marker, from.frame, to.frame, from.y, to.y, n_before > 1}, places_, memory_,
                     mixture_);
    return shared_->gain(marker, shared_->densities(mixture_, to.y));
  }

  const Partition<Filter>*whole_ = nullptr, *part_ = nullptr;
  const SharedAcceleration* shared_ = nullptr;
  bool is_on_ = false;
  std::int64_t first_ = 0, n_frames_ = 0;
  MarkerPlaces places_;
  std::vector<std::vector<std::int32_t>> outside_;  // tracks of the whole partition by marker
  std::vector<std::vector<Node>> inside_;           // kept parts of the tracks of the part by marker
  std::vector<char> is_inside_, is_changed_, is_near_changed_;  // tracks, and frames
  std::vector<Changed> all_, changed_;
  std::vector<Node> dependent_;
  // Terms in the present state, by detection of the part and of the whole partition.
  std::vector<double> known_inside_, known_outside_;
  typename Filter::Expected expected_{};
  SharedAcceleration::Mixture mixture_;
  SharedAcceleration::Memory memory_;
};

}  // namespace asterism
