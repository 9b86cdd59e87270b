// Building blocks of moves: one detection taken out of a track, put into it, or put in the place of
// another, and what that gains.
#pragma once

#include <cstdint>

#include "mcmc/model/partition.hpp"
#include "mcmc/moves/change.hpp"

namespace asterism {

template <typename Filter>
class Splices {
 public:
  explicit Splices(const Partition<Filter>& partition) : p_(partition) {}

  // What a drawn change gains.
  void weigh(Change<Filter>& q) const {
    q.gain = 0;
    for (const Edit<Filter>& e : q.all())
      q.gain += p_.score_of(e) - (e.track >= 0 ? p_.score_of(e.track) : 0);
  }
  // What a track has from a place on.
  void append(Edit<Filter>& edit, std::int32_t track, std::int32_t from) const {
    const auto& nodes = p_.track(track).nodes;
    for (std::size_t n = from; n < nodes.size(); ++n) p_.append(edit, nodes[n]);
  }
  // Whether what is left without x is a track.
  bool may_go(std::int32_t x) const {
    const std::int32_t i = p_.before(x), j = p_.after(x);
    return p_.track(p_.track_of(x)).whole_size() >= 3 &&
           (i < 0 || j < 0 || p_.window().is_linkable(i, j));
  }
  // A track without x.
  void take_out(std::int32_t x, Change<Filter>& q) const {
    const std::int32_t k = p_.track_of(x);
    append(q.edit(k, p_.place_of(x)), k, p_.place_of(x) + 1);
  }
  // A track with y at a place of its own, before what had it.
  void put_in(std::int32_t y, std::int32_t track, std::int32_t place, Change<Filter>& q) const {
    Edit<Filter>& e = q.edit(track, place);
    p_.append(e, y);
    append(e, track, place);
  }
  // A free detection in the place of another; false where its neighbours forbid it.
  bool replace(std::int32_t x, std::int32_t y, Change<Filter>& q) const {
    if (!fits_in_place_of(y, x)) return false;
    put_in_place_of(y, x, q);
    return true;
  }
  // Each of two detections of one frame in the place of the other; false where neighbours forbid it.
  bool exchange(std::int32_t x, std::int32_t y, Change<Filter>& q) const {
    if (!fits_in_place_of(y, x) || !fits_in_place_of(x, y)) return false;
    put_in_place_of(y, x, q);
    put_in_place_of(x, y, q);
    return true;
  }

 private:
  bool fits_in_place_of(std::int32_t y, std::int32_t x) const {
    const DetectionWindow& window = p_.window();
    const std::int32_t i = p_.before(x), j = p_.after(x);
    return (i < 0 || window.is_linkable(i, y)) && (j < 0 || window.is_linkable(y, j));
  }
  void put_in_place_of(std::int32_t y, std::int32_t x, Change<Filter>& q) const {
    const std::int32_t k = p_.track_of(x);
    Edit<Filter>& e = q.edit(k, p_.place_of(x));
    p_.append(e, y);
    append(e, k, p_.place_of(x) + 1);
  }

  const Partition<Filter>& p_;
};

}  // namespace asterism
