// Elementary edits of moves: remove, insert or replace one detection of a track; and the gain of an
// edit.
#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>
#include <vector>

#include "mcmc/model/edit_filter.hpp"
#include "mcmc/model/partition.hpp"
#include "mcmc/moves/change.hpp"

namespace asterism {

template <typename Filter>
class TrackEdits {
 public:
  explicit TrackEdits(const Partition<Filter>& partition) : p_(partition) {}

  // Computes the gain of a proposed change, whose edits may be planned. Returns false as soon as the
  // gain cannot exceed `min_gain`, even if each of the remaining detections had its largest gain.
  bool weigh(Change<Filter>& q) const { return weigh_first(q, kAll); }
  // Estimates the gain from the first detections of each tail. The others count as if they added to
  // the score what they add at present.
  bool estimate(Change<Filter>& q) const { return weigh_first(q, kEstimated); }
  // Plans the detections of a track from an index on.
  void append(Edit<Filter>& edit, std::int32_t track, std::int32_t from) const {
    const auto& nodes = p_.track(track).nodes;
    edit.tail.nodes.insert(edit.tail.nodes.end(), nodes.begin() + from, nodes.end());
  }
  // Whether the track without x is still valid.
  bool may_go(std::int32_t x) const {
    const std::int32_t i = p_.before(x), j = p_.after(x);
    return p_.track(p_.track_of(x)).whole_size() >= 3 &&
           (i < 0 || j < 0 || p_.window().is_linkable(i, j));
  }
  // Removes x from its track.
  void take_out(std::int32_t x, Change<Filter>& q) const {
    const std::int32_t k = p_.track_of(x);
    append(q.edit(k, p_.place_of(x)), k, p_.place_of(x) + 1);
  }
  // Inserts y into a track at an index.
  void put_in(std::int32_t y, std::int32_t track, std::int32_t place, Change<Filter>& q) const {
    Edit<Filter>& e = q.edit(track, place);
    e.tail.nodes.push_back(y);
    append(e, track, place);
  }
  // Replaces a detection by a free one. Returns false if a link would be impossible.
  bool replace(std::int32_t x, std::int32_t y, Change<Filter>& q) const {
    if (!fits_in_place_of(y, x)) return false;
    put_in_place_of(y, x, q);
    return true;
  }
  // Exchanges two detections of one frame between their tracks. Returns false if a link would be
  // impossible.
  bool exchange(std::int32_t x, std::int32_t y, Change<Filter>& q) const {
    if (!fits_in_place_of(y, x) || !fits_in_place_of(x, y)) return false;
    put_in_place_of(y, x, q);
    put_in_place_of(x, y, q);
    return true;
  }

 private:
  static constexpr std::size_t kAll = std::numeric_limits<std::size_t>::max();
  // In every involutive move, the detections of a tail from the second on are consecutive already.
  static constexpr std::size_t kEstimated = 2;

  bool weigh_first(Change<Filter>& q, std::size_t n_filtered) const {
    double most = 0;  // an upper bound of the gain
    std::size_t n_last = 0;
    for (const Edit<Filter>& e : q.all()) {
      most += max_score_of(p_, e, n_filtered) - (e.track >= 0 ? p_.score_of(e.track) : 0);
      n_last = std::max(n_last, std::min(e.tail.nodes.size(), n_filtered));
    }
    if (!(most > q.min_gain - kRounding)) return false;
    for (std::size_t n = 0; n < n_last; ++n)
      for (Edit<Filter>& e : q.all()) {
        if (n < e.tail.states.size() || n >= e.tail.nodes.size()) continue;
        const double highest = max_gain(p_, e, n);
        const auto goes_on = [&](double gain) {
          most += gain - highest;
          return most > q.min_gain - kRounding;
        };
        if (!filter_next(p_, e, goes_on)) return false;
      }
    q.gain = 0;
    for (const Edit<Filter>& e : q.all())
      q.gain += max_score_of(p_, e, n_filtered) - (e.track >= 0 ? p_.score_of(e.track) : 0);
    return q.gain > q.min_gain;
  }
  bool fits_in_place_of(std::int32_t y, std::int32_t x) const {
    const DetectionWindow& window = p_.window();
    const std::int32_t i = p_.before(x), j = p_.after(x);
    return (i < 0 || window.is_linkable(i, y)) && (j < 0 || window.is_linkable(y, j));
  }
  void put_in_place_of(std::int32_t y, std::int32_t x, Change<Filter>& q) const {
    const std::int32_t k = p_.track_of(x);
    Edit<Filter>& e = q.edit(k, p_.place_of(x));
    e.tail.nodes.push_back(y);
    append(e, k, p_.place_of(x) + 1);
  }

  static constexpr double kRounding = 1e-6;  // far above the rounding of a sum of scores

  const Partition<Filter>& p_;
};

}  // namespace asterism
