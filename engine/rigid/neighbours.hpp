// The rigid neighbours of each marker: estimates which other markers keep a stable distance to it.
//
// Means over the last frames give every frame a weight of at least 1/kMemory, so that old frames
// are forgotten.
#pragma once

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "base/flat_map.hpp"
#include "base/scratch.hpp"
#include "base/shared_copy.hpp"
#include "filter/kalman.hpp"
#include "rigid/marker_bonds.hpp"

namespace asterism {

// A marker detected in a frame.
struct MarkerPoint {
  std::int32_t marker = 0;
  Point at{};
};

// The detected markers of a frame, by increasing number.
struct MarkerFrame {
  std::vector<MarkerPoint> seen;

  const Point* find(std::int32_t marker) const {
    const auto at =
        first_from(seen.begin(), seen.size(), marker, [](const MarkerPoint& one) { return one.marker; });
    return at != seen.end() && at->marker == marker ? &at->at : nullptr;
  }
};

// Positions of the markers of a frame, by number. An open hash table makes time and memory depend
// on the number of markers and not on the largest number.
class Places {
 public:
  void clear() {
    std::fill(slots_.begin(), slots_.end(), MarkerPoint{kEmpty, {}});
    n_ = 0;
  }
  // Makes room for so many markers at once.
  void reserve(std::size_t n) {
    if (2 * n > slots_.size()) grow(2 * n);
  }
  void set(std::int32_t marker, const Point& at) {
    if (2 * (n_ + 1) > slots_.size()) grow(2 * (n_ + 1));
    MarkerPoint& slot = slots_[place(marker)];
    n_ += slot.marker == kEmpty;
    slot = {marker, at};
  }
  const Point* find(std::int32_t marker) const {
    if (slots_.empty()) return nullptr;
    const MarkerPoint& slot = slots_[place(marker)];
    return slot.marker == marker ? &slot.at : nullptr;
  }
  std::size_t size() const { return n_; }
  std::size_t capacity() const { return slots_.size(); }

 private:
  static constexpr std::int32_t kEmpty = -1;

  // The slot of a marker, or the empty slot where it would be inserted.
  std::size_t place(std::int32_t marker) const {
    const std::size_t last = slots_.size() - 1;  // a power of two minus one
    std::size_t at = static_cast<std::uint32_t>(marker) * 0x9e3779b1u & last;
    while (slots_[at].marker != kEmpty && slots_[at].marker != marker) at = (at + 1) & last;
    return at;
  }
  void grow(std::size_t n_slots) {
    const std::vector<MarkerPoint> old = std::move(slots_);
    slots_.assign(std::bit_ceil(std::max<std::size_t>(n_slots, 32)), MarkerPoint{kEmpty, {}});
    for (const MarkerPoint& one : old)
      if (one.marker != kEmpty) slots_[place(one.marker)] = one;
  }

  std::vector<MarkerPoint> slots_;
  std::size_t n_ = 0;
};

// Inserts into a sorted list of the `n_max` smallest elements. For short lists this is faster than
// a heap.
template <typename T>
void keep_smallest(std::vector<T>& all, std::size_t n_max, const T& one) {
  if (all.size() == n_max) {
    if (!(one < all.back())) return;
    all.pop_back();
  }
  all.insert(std::upper_bound(all.begin(), all.end(), one), one);
}

class Neighbours {
 public:
  // `r` is the variance of a measured coordinate.
  Neighbours(int D, double r) : D_(D), r_(r) {}

  int n_axes() const { return D_; }

  // Adds the markers detected in a frame.
  void add(std::span<const MarkerPoint> seen) {
    ++n_frames_;
    places_.clear();
    places_.reserve(seen.size());
    for (const MarkerPoint& one : seen) places_.set(one.marker, one.at);
    for (const MarkerPoint& one : seen) {
      SharedCopy<MarkerBonds>& shared = bonds_[one.marker];
      if (!shared.has_value()) shared = SharedCopy<MarkerBonds>(MarkerBonds{});
      MarkerBonds& bonds = shared.own();
      if (bonds.size() == 0 || (n_frames_ + one.marker) % kLookEvery == 0) look_around(seen, one, bonds);
      bonds.update(r_, [&](std::int32_t other) {
        const Point* at = places_.find(other);
        return at == nullptr ? -1.0 : squared_distance(one.at, *at);
      });
    }
  }

  // Removes a marker that will not be detected again.
  void forget(std::int32_t marker) {
    bonds_.erase(marker);
    for (auto& [own, bonds] : bonds_)
      if (bonds->contains(marker)) bonds.own().remove(marker);
  }

  // The bonds of a marker, by increasing variance and then by the number of the other marker.
  auto of(std::int32_t marker) const {
    static const MarkerBonds kNone;
    const SharedCopy<MarkerBonds>* bonds = bonds_.find(marker);
    return (bonds == nullptr ? kNone : **bonds).all();
  }
  double variance(const Bond& bond) const { return predictive_variance(bond, r_); }

 private:
  static constexpr std::int64_t kLookEvery = 32;  // frames
  static constexpr std::size_t kNearest = 12;
  static constexpr std::int64_t kTrial = 60;  // frames before a neighbour may be replaced

  // Adds the nearest markers as neighbours. If the list is full, a new one replaces the neighbour
  // with the largest variance.
  void look_around(std::span<const MarkerPoint> seen, const MarkerPoint& one, MarkerBonds& bonds) {
    near_.clear();
    for (const MarkerPoint& other : seen)
      if (other.marker != one.marker)
        near_.push_back({squared_distance(one.at, other.at), other.marker});
    const std::size_t n = std::min(bonds.size() == 0 ? MarkerBonds::kMost : kNearest, near_.size());
    std::partial_sort(near_.begin(), near_.begin() + static_cast<std::ptrdiff_t>(n), near_.end());
    for (std::size_t i = 0; i < n; ++i) {
      const auto [squared, other] = near_[i];
      if (bonds.contains(other)) continue;
      if (bonds.size() < MarkerBonds::kMost) {
        bonds.add(other);
        continue;
      }
      std::size_t worst = 0;
      for (std::size_t k = 1; k < bonds.size(); ++k)
        if (variance(bonds[k]) > variance(bonds[worst])) worst = k;
      const Bond bond = bonds[worst];
      if (bond.n >= kTrial && bond.mean * bond.mean > squared) bonds.replace(worst, other);
    }
  }

  int D_;
  double r_;
  std::int64_t n_frames_ = 0;
  FlatMap<std::int32_t, SharedCopy<MarkerBonds>> bonds_;  // copies share those of markers not detected
  Scratch<Places> places_;
  std::vector<std::pair<double, std::int32_t>> near_;
};

}  // namespace asterism
