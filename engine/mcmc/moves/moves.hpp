// The moves of MCMC data association (Oh, Russell & Sastry 2009; §4.2 of the report) and six more.
//
// A move draws a partition ω' from ω. `log_forward` is the proposal probability log q(ω → ω'), and
// `log_reverse` that of the inverse move in ω'. Both exclude the probability ξ of the kind of move.
// Some moves reach the same ω' by several auxiliary draws, such as the number kept in an update or
// the link in a switch. Both probabilities are then those for the same auxiliary draw, and detailed
// balance holds for each.
//
//   K  tracks      F  free detections      N  detections in tracks      L  links
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "math/random.hpp"
#include "mcmc/model/edit_filter.hpp"
#include "mcmc/model/partition.hpp"
#include "mcmc/moves/change.hpp"
#include "mcmc/moves/growth.hpp"
#include "mcmc/moves/track_edits.hpp"

namespace asterism {

template <typename Filter>
class Moves {
 public:
  Moves(const Partition<Filter>& partition, const GrowthOptions& growth)
      : p_(partition), edits_(partition), growth_(partition, growth) {}

  // Draws ω'. Returns false if the draw is impossible, so that the chain stays. It must then be
  // weighed.
  bool propose(Move move, Random& random, Change<Filter>& out) {
    out.move = move;
    out.n_edits = 0;
    out.log_forward = 0;
    out.with = -1;
    return draw(random, out) && keeps_continuations<Filter>(p_, out.all()) &&
           out.log_forward > Growth<Filter>::kNever;
  }
  // Computes the gain of the proposed move. Returns false if it does not exceed out.min_gain.
  bool weigh(Change<Filter>& out) const { return edits_.weigh(out); }

  double log_reverse(const Change<Filter>& q) {
    if (q.n_edits == 0) return q.log_forward;  // the reverse move has the same probability
    const Edit<Filter>& first = q.edits[0];
    const auto n_tail = static_cast<std::int32_t>(first.tail.nodes.size());
    const std::int32_t n_new = first.keep + n_tail;
    switch (q.move) {
      case Move::birth:
        return -log(p_.young().size() + 1);
      case Move::death:
        return -log(p_.free().size() + p_.track(first.track).size()) +
               growth_.log_probability(first.track, 1, true);
      case Move::split:
        return -log(p_.tracks().size() + 1) - log(n_starts_after(before(p_, first, 0)) + 1);
      case Move::merge:
        return -log(p_.tracks().size() - 1) - log(n_new - 1 - min_kept(first.track));
      case Move::extension:
        return -log(p_.tracks().size()) - log(n_new - min_kept(first.track));
      case Move::reduction:
        return -log(p_.tracks().size()) + growth_.log_probability(first.track, first.keep, true);
      case Move::update:
        return -log(p_.tracks().size()) - log(n_new + 1 - min_updated(first.track)) +
               growth_.log_probability(first.track, first.keep, must_grow(first.track, first.keep));
      case Move::switch_tails:
        return -log(p_.linked().size()) - log(n_partners_after(q));
      case Move::insertion:
        return -log(p_.taken().size() + 1);
      case Move::deletion:
        list_slots(q.with);
        return -log(p_.free().size() + 1) - log(slots_.size());
      case Move::transfer:
      case Move::replacement:
      case Move::exchange:
      case Move::relocation:
        return q.log_forward;
    }
    return Growth<Filter>::kNever;
  }

 private:
  // Logarithms of counts; small ones are tabulated.
  template <typename Count>
  static double log(Count n) {
    static const auto table = [] {
      std::array<double, 512> logs{};
      for (std::size_t k = 0; k < logs.size(); ++k) logs[k] = std::log(static_cast<double>(k));
      return logs;
    }();
    const auto at = static_cast<std::size_t>(n);
    return at < table.size() ? table[at] : std::log(static_cast<double>(n));
  }
  // Smallest number of detections that a track keeps when it is cut, or in an update.
  std::int32_t min_kept(std::int32_t track) const {
    return std::max(2 - p_.track(track).n_gone, p_.track(track).n_frozen);
  }
  std::int32_t min_updated(std::int32_t track) const {
    return std::max(1, p_.track(track).n_frozen);
  }
  // Whether a track that keeps so many detections must grow, because a single detection is no
  // track.
  bool must_grow(std::int32_t track, std::int32_t keep) const {
    return p_.track(track).n_gone + keep == 1;
  }

  bool draw(Random& random, Change<Filter>& q) {
    switch (q.move) {
      case Move::birth: return draw_birth(random, q);
      case Move::death: return draw_death(random, q);
      case Move::split: return draw_split(random, q);
      case Move::merge: return draw_merge(random, q);
      case Move::extension: return draw_extension(random, q);
      case Move::reduction: return draw_reduction(random, q);
      case Move::update: return draw_update(random, q);
      case Move::switch_tails: return draw_switch(random, q);
      case Move::insertion: return draw_insertion(random, q);
      case Move::deletion: return draw_deletion(random, q);
      case Move::transfer: return draw_transfer(random, q);
      case Move::replacement: return draw_replacement(random, q);
      case Move::exchange: return draw_exchange(random, q);
      case Move::relocation: return draw_relocation(random, q);
    }
    return false;
  }

  // Draws a member of a set uniformly; -1 if the set is empty.
  std::int32_t draw_one(const IndexSet& set, Random& random, Change<Filter>& q) const {
    if (set.size() == 0) return -1;
    q.log_forward -= log(set.size());
    return set[random.below(set.size())];
  }
  template <typename T>
  T draw_one(const std::vector<T>& list, Random& random, Change<Filter>& q) const {
    q.log_forward -= log(list.size());
    return list[random.below(static_cast<std::int32_t>(list.size()))];
  }

  bool draw_birth(Random& random, Change<Filter>& q) {
    const std::int32_t i = draw_one(p_.free(), random, q);
    if (i < 0) return false;
    Edit<Filter>& e = q.edit(-1, 0);
    append(p_, e, i);
    q.log_forward += growth_.grow(e, true, random);
    return e.tail.nodes.size() > 1;
  }

  bool draw_death(Random& random, Change<Filter>& q) {
    const std::int32_t k = draw_one(p_.young(), random, q);
    if (k < 0) return false;
    q.edit(k, 0);
    return true;
  }

  bool draw_split(Random& random, Change<Filter>& q) {
    const std::int32_t k = draw_one(p_.tracks(), random, q);
    if (k < 0) return false;
    const std::int32_t n_cuts = p_.track(k).size() - 1 - min_kept(k);
    if (n_cuts < 1) return false;
    const std::int32_t keep = min_kept(k) + random.below(n_cuts);
    q.log_forward -= log(n_cuts);
    q.edit(k, keep);
    edits_.append(q.edit(-1, 0), k, keep);
    return true;
  }

  bool draw_merge(Random& random, Change<Filter>& q) {
    const std::int32_t k = draw_one(p_.tracks(), random, q);
    if (k < 0) return false;
    starts_.clear();
    each_start_after(p_.last(k), [&](std::int32_t other) { starts_.push_back(other); });
    if (starts_.empty()) return false;
    const std::int32_t other = draw_one(starts_, random, q);
    edits_.append(q.edit(k, p_.track(k).size()), other, 0);
    q.edit(other, 0);
    return true;
  }
  // Calls visit for the tracks without settled detections whose first detection may follow i.
  template <typename Visit>
  void each_start_after(std::int32_t i, Visit&& visit) const {
    const std::int64_t frame = p_.window()[i].frame;
    for (const std::int32_t k : p_.young().items())
      if (p_.first_frame(k) > frame && p_.window().is_linkable(i, p_.first(k))) visit(k);
  }
  std::int32_t n_starts_after(std::int32_t i) const {
    std::int32_t n = 0;
    each_start_after(i, [&](std::int32_t) { ++n; });
    return n;
  }

  bool draw_extension(Random& random, Change<Filter>& q) {
    const std::int32_t k = draw_one(p_.tracks(), random, q);
    if (k < 0) return false;
    Edit<Filter>& e = q.edit(k, p_.track(k).size());
    q.log_forward += growth_.grow(e, true, random);
    return !e.tail.nodes.empty();
  }

  bool draw_reduction(Random& random, Change<Filter>& q) {
    const std::int32_t k = draw_one(p_.tracks(), random, q);
    if (k < 0) return false;
    const std::int32_t n_cuts = p_.track(k).size() - min_kept(k);
    if (n_cuts < 1) return false;
    q.log_forward -= log(n_cuts);
    q.edit(k, min_kept(k) + random.below(n_cuts));
    return true;
  }

  bool draw_update(Random& random, Change<Filter>& q) {
    const std::int32_t k = draw_one(p_.tracks(), random, q);
    if (k < 0) return false;
    const std::int32_t n_cuts = p_.track(k).size() + 1 - min_updated(k);
    q.log_forward -= log(n_cuts);
    q.with = min_updated(k) + random.below(n_cuts);
    Edit<Filter>& e = q.edit(k, q.with);
    q.log_forward += growth_.grow(e, must_grow(k, q.with), random);
    if (is_as_it_is(e)) q.n_edits = 0;
    return true;
  }

  bool is_as_it_is(const Edit<Filter>& e) const {
    const auto& nodes = p_.track(e.track).nodes;
    return e.keep + e.tail.nodes.size() == nodes.size() &&
           std::equal(e.tail.nodes.begin(), e.tail.nodes.end(), nodes.begin() + e.keep);
  }

  // The link is a → b. Another track's detection d follows a in ω', and b takes the place of d. If
  // d has a predecessor c, b must be able to follow it. Otherwise b becomes the first detection of
  // its track and must have a successor.
  bool draw_switch(Random& random, Change<Filter>& q) {
    const std::int32_t b = draw_one(p_.linked(), random, q);
    if (b < 0) return false;
    const std::int32_t a = p_.before(b), own = p_.track_of(b);
    partners_.clear();
    const bool has_tail = p_.after(b) >= 0;
    each_rival(a, b, [&](std::int32_t d) {
      const std::int32_t c = p_.before(d);
      if (p_.track_of(d) != own && (c < 0 ? has_tail : p_.window().is_linkable(c, b)))
        partners_.push_back(d);
    });
    if (partners_.empty()) return false;
    const std::int32_t d = draw_one(partners_, random, q), other = p_.track_of(d);
    q.with = b;
    edits_.append(q.edit(own, p_.place_of(b)), other, p_.place_of(d));
    edits_.append(q.edit(other, p_.place_of(d)), own, p_.place_of(b));
    return true;
  }
  // Calls visit for every open detection of a track that may follow a, and whose predecessor lies
  // before b: those not later than b, those after a gap that contains the frame of b, and first
  // detections of tracks.
  template <typename Visit>
  void each_rival(std::int32_t a, std::int32_t b, Visit&& visit) const {
    const DetectionWindow& window = p_.window();
    const std::int64_t last = window[b].frame;
    for (std::int64_t t = std::max(window[a].frame, p_.frozen()) + 1; t <= last; ++t)
      window.each_after(a, t, [&](std::int32_t d) {
        if (p_.taken().has(d)) visit(d);
      });
    for (const std::int32_t d : p_.leapt().items())
      if (window[d].frame > last && window[p_.before(d)].frame < last && window.is_linkable(a, d))
        visit(d);
    for (const std::int32_t k : p_.young().items())
      if (p_.first_frame(k) > last && window.is_linkable(a, p_.first(k))) visit(p_.first(k));
  }
  // The number of partners of the link a → d in ω', after the exchange of the tails.
  std::int32_t n_partners_after(const Change<Filter>& q) const {
    const DetectionWindow& window = p_.window();
    const std::int32_t b = q.with, a = p_.before(b), own = q.edits[0].track, other = q.edits[1].track;
    const std::int32_t d = q.edits[0].tail.nodes.front(), c = p_.before(d);
    const bool has_tail = q.edits[0].tail.nodes.size() > 1;
    std::int32_t n = 0;
    const auto count = [&](std::int32_t e) {
      std::int32_t track = p_.track_of(e);
      if (track == own && p_.place_of(e) >= q.edits[0].keep)
        track = other;
      else if (track == other && p_.place_of(e) >= q.edits[1].keep)
        track = own;
      const std::int32_t before = e == b ? c : p_.before(e);
      if (track != own) n += before < 0 ? has_tail : window.is_linkable(before, d);
    };
    each_rival(a, d, count);
    return n;
  }

  // A place in a track for a detection: the track, and the number of detections before it.
  struct Slot {
    std::int32_t track = 0, keep = 0;
  };
  // Lists the slots of x, as if it were free: in a gap that contains its frame, after the end of a
  // track, and before its beginning.
  void list_slots(std::int32_t x) {
    const DetectionWindow& window = p_.window();
    const std::int64_t frame = window[x].frame;
    const std::int32_t own = p_.track_of(x) >= 0 ? p_.track_of(x) : -1;
    slots_.clear();
    const auto offer = [&](std::int32_t k, std::int32_t keep, std::int32_t i, std::int32_t j) {
      if ((i < 0 || window.is_linkable(i, x)) && (j < 0 || window.is_linkable(x, j)))
        slots_.push_back({k, keep});
    };
    for (const std::int32_t j : p_.leapt().items()) {
      const std::int32_t i = p_.before(j);
      if (window[j].frame > frame && window[i].frame < frame)
        offer(p_.track_of(j), p_.place_of(j), i, j);
    }
    for (const std::int32_t k : p_.tracks().items())
      if (p_.last_frame(k) < frame && k != own)
        offer(k, p_.track(k).size(), p_.last(k), -1);
    for (const std::int32_t k : p_.young().items())
      if (p_.first_frame(k) > frame && k != own) offer(k, 0, -1, p_.first(k));
    if (own >= 0) offer(own, p_.place_of(x), p_.before(x), p_.after(x));
  }
  bool draw_insertion(Random& random, Change<Filter>& q) {
    const std::int32_t x = draw_one(p_.free(), random, q);
    if (x < 0) return false;
    list_slots(x);
    if (slots_.empty()) return false;
    const Slot slot = draw_one(slots_, random, q);
    q.with = x;
    edits_.put_in(x, slot.track, slot.keep, q);
    return true;
  }

  bool draw_deletion(Random& random, Change<Filter>& q) {
    const std::int32_t x = draw_one(p_.taken(), random, q);
    if (x < 0) return false;
    if (!edits_.may_go(x)) return false;
    q.with = x;
    edits_.take_out(x, q);
    return true;
  }

  bool draw_transfer(Random& random, Change<Filter>& q) {
    const std::int32_t b = draw_one(p_.linked(), random, q);
    if (b < 0) return false;
    const std::int32_t own = p_.track_of(b);
    if (p_.track(own).n_gone + p_.place_of(b) < 2) return false;
    starts_.clear();
    const std::int64_t frame = p_.window()[b].frame;
    for (const std::int32_t k : p_.tracks().items())
      if (p_.last_frame(k) < frame && k != own && p_.window().is_linkable(p_.last(k), b))
        starts_.push_back(k);
    if (starts_.empty()) return false;
    const std::int32_t other = draw_one(starts_, random, q);
    q.with = b;
    q.edit(own, p_.place_of(b));
    edits_.append(q.edit(other, p_.track(other).size()), own, p_.place_of(b));
    return true;
  }

  bool draw_replacement(Random& random, Change<Filter>& q) {
    const std::int32_t x = draw_one(p_.taken(), random, q);
    if (x < 0) return false;
    const DetectionWindow& window = p_.window();
    starts_.clear();
    for (const std::int32_t y : window.frame(window[x].frame).ids)
      if (p_.is_free(y)) starts_.push_back(y);
    if (starts_.empty()) return false;
    const std::int32_t y = draw_one(starts_, random, q);
    q.with = x;
    return edits_.replace(x, y, q);
  }

  // Without x, ω and ω' are the same partition and have the same slots.
  bool draw_relocation(Random& random, Change<Filter>& q) {
    const std::int32_t x = draw_one(p_.taken(), random, q);
    if (x < 0 || !edits_.may_go(x)) return false;
    list_slots(x);
    slots_.pop_back();  // its present slot
    if (slots_.empty()) return false;
    const Slot slot = draw_one(slots_, random, q);
    q.with = x;
    edits_.take_out(x, q);
    edits_.put_in(x, slot.track, slot.keep, q);
    return true;
  }

  bool draw_exchange(Random& random, Change<Filter>& q) {
    const std::int32_t x = draw_one(p_.taken(), random, q);
    if (x < 0) return false;
    starts_.clear();
    for (const std::int32_t y : p_.window().frame(p_.window()[x].frame).ids)
      if (y != x && p_.taken().has(y)) starts_.push_back(y);
    if (starts_.empty()) return false;
    q.with = x;
    return edits_.exchange(x, draw_one(starts_, random, q), q);
  }

  const Partition<Filter>& p_;
  TrackEdits<Filter> edits_;
  Growth<Filter> growth_;
  std::vector<std::int32_t> starts_, partners_;
  std::vector<Slot> slots_;
};

}  // namespace asterism
