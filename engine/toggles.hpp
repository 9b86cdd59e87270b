// Moves at given detections that are their own inverses: as long as a list of them stays, each is drawn
// as often in ω as in ω', and the gain alone decides.
//
//   trade     x and y, of one frame, of which one at least is in a track, in each other's place
//   swap      two tracks change what they have from x and from y on
//   relocate  y stands after a instead of after c, or back
//   transfer  all from y on stands after a instead of after c, one of which is a track's last; or back
#pragma once

#include <cstdint>
#include <limits>

#include "moves.hpp"
#include "partition.hpp"

namespace asterism {

struct Toggle {
  enum class Kind { trade, swap, relocate, transfer };
  Kind kind = Kind::trade;
  std::int32_t y = 0, a = 0, c = 0;  // for the first two a stands for x
};

template <typename Filter>
class Toggles {
 public:
  Toggles(const Partition<Filter>& partition, const Moves<Filter>& moves)
      : p_(partition), moves_(moves) {}

  // False where it leads nowhere.
  bool propose(const Toggle& t, Change<Filter>& out) const {
    out.n_edits = 0;
    out.log_forward = out.log_reverse = 0;
    if (!draw(t, out)) return false;
    moves_.weigh(out);
    return true;
  }

 private:
  bool draw(const Toggle& t, Change<Filter>& out) const {
    switch (t.kind) {
      case Toggle::Kind::trade: return trade(t.a, t.y, out);
      case Toggle::Kind::swap: return swap(t.a, t.y, out);
      case Toggle::Kind::relocate: return relocate(t.y, other(t), out);
      case Toggle::Kind::transfer: return transfer(t.y, other(t), out);
    }
    return false;
  }
  bool is_taken(std::int32_t i) const { return p_.taken().has(i); }

  bool trade(std::int32_t x, std::int32_t y, Change<Filter>& q) const {
    if (is_taken(x) && is_taken(y)) return moves_.exchange(x, y, q);
    if (!is_taken(x) && !is_taken(y)) return false;
    return is_taken(x) ? moves_.replace(x, y, q) : moves_.replace(y, x, q);
  }

  bool swap(std::int32_t x, std::int32_t y, Change<Filter>& q) const {
    if (!is_taken(x) || !is_taken(y)) return false;
    const std::int32_t k = p_.track_of(x), l = p_.track_of(y);
    if (k == l || !goes_on(y, x) || !goes_on(x, y)) return false;
    moves_.append(q.edit(k, p_.place_of(x)), l, p_.place_of(y));
    moves_.append(q.edit(l, p_.place_of(y)), k, p_.place_of(x));
    return true;
  }
  // Whether a track may go on with y in place of x; as its first y must not be its last.
  bool goes_on(std::int32_t y, std::int32_t x) const {
    const std::int32_t i = p_.before(x);
    return i < 0 ? p_.after(y) >= 0 : p_.window().is_linkable(i, y);
  }

  // After whom y stands if it does not after whom it does now; -1 where that is neither, or in the
  // same track.
  std::int32_t other(const Toggle& t) const {
    if (!is_taken(t.y)) return -1;
    const std::int32_t now = p_.before(t.y);
    const std::int32_t to = now == t.c ? t.a : now == t.a ? t.c : -1;
    if (to < 0 || p_.track_of(to) < 0 || p_.track_of(to) == p_.track_of(t.y)) return -1;
    return p_.window().is_linkable(to, t.y) ? to : -1;
  }

  bool relocate(std::int32_t y, std::int32_t to, Change<Filter>& q) const {
    if (to < 0 || !moves_.may_go(y)) return false;
    const std::int32_t next = p_.after(to);
    if (next >= 0 && !p_.window().is_linkable(y, next)) return false;
    moves_.take_out(y, q);
    const std::int32_t k = p_.track_of(to);
    Edit<Filter>& e = q.edit(k, p_.place_of(to) + 1);
    p_.append(e, y);
    moves_.append(e, k, p_.place_of(to) + 1);
    return true;
  }

  bool transfer(std::int32_t y, std::int32_t to, Change<Filter>& q) const {
    const std::int32_t k = p_.track_of(y);
    if (to < 0 || p_.after(to) >= 0 || p_.track(k).n_gone + p_.place_of(y) < 2) return false;
    q.edit(k, p_.place_of(y));
    moves_.append(q.edit(p_.track_of(to), p_.place_of(to) + 1), k, p_.place_of(y));
    return true;
  }

  const Partition<Filter>& p_;
  const Moves<Filter>& moves_;
};

}  // namespace asterism
