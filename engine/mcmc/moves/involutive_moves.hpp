// Moves at given detections that are their own inverses. As long as the list of moves is fixed, ω →
// ω' and ω' → ω are proposed with the same probability. The acceptance ratio is then the posterior
// ratio alone.
//
//   trade     x and y, at least one of them in a track, exchange their places
//   swap      two tracks exchange their tails, from x and from y on
//   relocate  y moves from after c to after a, or back
//   transfer  the tail from y on moves from after c to after a, one of which ends a track; or back
//   begin     a becomes the first detection of the track that began with y, or of a new track of
//             both; or back
//   skip      y between a and c is removed, or inserted; without c, y is the last
#pragma once

#include <cstdint>
#include <limits>

#include "mcmc/model/edit_filter.hpp"
#include "mcmc/model/partition.hpp"
#include "mcmc/moves/change.hpp"
#include "mcmc/moves/track_edits.hpp"

namespace asterism {

struct Toggle {
  enum class Kind { trade, swap, relocate, transfer, begin, skip };
  Kind kind = Kind::trade;
  std::int32_t y = 0, a = 0, c = 0;  // in the first two kinds, a stands for x
};

template <typename Filter>
class Toggles {
 public:
  explicit Toggles(const Partition<Filter>& partition) : p_(partition), edits_(partition) {}

  // Returns false if the move is impossible. It must then be weighed.
  bool propose(const Toggle& t, Change<Filter>& out) const {
    out.n_edits = 0;
    out.log_forward = out.log_reverse = 0;
    return draw(t, out) && keeps_continuations<Filter>(p_, out.all());
  }
  // Computes the gain of the proposed move. Returns false if it does not exceed out.min_gain.
  bool weigh(Change<Filter>& out) const { return edits_.weigh(out); }
  // The same with an estimate of the gain (mcmc/moves/track_edits.hpp).
  bool estimate(Change<Filter>& out) const { return edits_.estimate(out); }

 private:
  bool draw(const Toggle& t, Change<Filter>& out) const {
    switch (t.kind) {
      case Toggle::Kind::trade: return trade(t.a, t.y, out);
      case Toggle::Kind::swap: return swap(t.a, t.y, out);
      case Toggle::Kind::relocate: return relocate(t.y, other(t), out);
      case Toggle::Kind::transfer: return transfer(t.y, other(t), out);
      case Toggle::Kind::begin: return begin(t.a, t.y, out);
      case Toggle::Kind::skip: return skip(t.y, t.a, t.c, out);
    }
    return false;
  }
  bool is_taken(std::int32_t i) const { return p_.taken().has(i); }

  bool trade(std::int32_t x, std::int32_t y, Change<Filter>& q) const {
    if (is_taken(x) && is_taken(y))
      return p_.track_of(x) != p_.track_of(y) && edits_.exchange(x, y, q);
    // A settled detection is neither taken nor free, and does not move.
    if (is_taken(x) && p_.is_free(y)) return edits_.replace(x, y, q);
    if (is_taken(y) && p_.is_free(x)) return edits_.replace(y, x, q);
    return false;
  }

  bool swap(std::int32_t x, std::int32_t y, Change<Filter>& q) const {
    if (!is_taken(x) || !is_taken(y)) return false;
    const std::int32_t k = p_.track_of(x), l = p_.track_of(y);
    if (k == l || !goes_on(y, x) || !goes_on(x, y)) return false;
    edits_.append(q.edit(k, p_.place_of(x)), l, p_.place_of(y));
    edits_.append(q.edit(l, p_.place_of(y)), k, p_.place_of(x));
    return true;
  }
  // Whether a track may continue with y in place of x. If y becomes its first detection, y must not
  // be its last.
  bool goes_on(std::int32_t y, std::int32_t x) const {
    const std::int32_t i = p_.before(x);
    return i < 0 ? p_.after(y) >= 0 : p_.window().is_linkable(i, y);
  }

  // The detection after which y would be placed by the move; -1 if y follows neither a nor c, or if
  // both are in the same track.
  std::int32_t other(const Toggle& t) const {
    if (!is_taken(t.y)) return -1;
    const std::int32_t now = p_.before(t.y);
    const std::int32_t to = now == t.c ? t.a : now == t.a ? t.c : -1;
    if (to < 0 || p_.track_of(to) < 0 || p_.track_of(to) == p_.track_of(t.y)) return -1;
    return p_.window().is_linkable(to, t.y) ? to : -1;
  }

  bool relocate(std::int32_t y, std::int32_t to, Change<Filter>& q) const {
    if (to < 0 || !edits_.may_go(y)) return false;
    const std::int32_t next = p_.after(to);
    if (next >= 0 && !p_.window().is_linkable(y, next)) return false;
    edits_.take_out(y, q);
    edits_.put_in(y, p_.track_of(to), p_.place_of(to) + 1, q);
    return true;
  }

  bool transfer(std::int32_t y, std::int32_t to, Change<Filter>& q) const {
    const std::int32_t k = p_.track_of(y);
    if (to < 0 || p_.after(to) >= 0 || p_.track(k).n_gone + p_.place_of(y) < 2) return false;
    q.edit(k, p_.place_of(y));
    edits_.append(q.edit(p_.track_of(to), p_.place_of(to) + 1), k, p_.place_of(y));
    return true;
  }

  bool begin(std::int32_t a, std::int32_t y, Change<Filter>& q) const {
    if (p_.is_free(a)) {
      if (p_.is_free(y)) {
        Edit<Filter>& e = q.edit(-1, 0);
        e.tail.nodes = {a, y};
        return true;
      }
      if (!is_taken(y) || !is_first(y)) return false;
      Edit<Filter>& e = q.edit(p_.track_of(y), 0);
      e.tail.nodes.push_back(a);
      edits_.append(e, e.track, 0);
      return true;
    }
    if (!is_taken(a) || !is_first(a) || p_.after(a) != y) return false;
    const std::int32_t k = p_.track_of(a);
    Edit<Filter>& e = q.edit(k, 0);
    if (p_.track(k).size() > 2) edits_.append(e, k, 1);
    return true;
  }

  bool skip(std::int32_t y, std::int32_t a, std::int32_t c, Change<Filter>& q) const {
    if (is_taken(y)) {
      if (p_.before(y) != a || p_.after(y) != c || !edits_.may_go(y)) return false;
      edits_.take_out(y, q);
      return true;
    }
    const std::int32_t k = p_.track_of(a);
    if (!p_.is_free(y) || k < 0 || p_.after(a) != c || !p_.window().is_linkable(a, y) ||
        (c >= 0 && !p_.window().is_linkable(y, c)))
      return false;
    edits_.put_in(y, k, p_.place_of(a) + 1, q);
    return true;
  }

  bool is_first(std::int32_t i) const {
    return p_.place_of(i) == 0 && p_.track(p_.track_of(i)).n_gone == 0;
  }

  const Partition<Filter>& p_;
  TrackEdits<Filter> edits_;
};

}  // namespace asterism
