// The bonds of one marker, by increasing predictive variance. They are stored as columns in one piece
// of memory: a frame updates four at once, and the next state of a stream clones them.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <ranges>

#include "math/lanes.hpp"
#include "rigid/bond.hpp"

namespace asterism {

class MarkerBonds {
 public:
  static constexpr std::size_t kMost = 24;

  std::size_t size() const { return n_; }
  Bond operator[](std::size_t k) const {
    return {other_[k], static_cast<std::int64_t>(at(frames_, k)), at(mean_, k), at(variance_, k)};
  }
  auto all() const {
    return std::views::iota(std::size_t{0}, n_) |
           std::views::transform([this](std::size_t k) { return (*this)[k]; });
  }
  bool contains(std::int32_t other) const {
    return std::find(other_.begin(), other_.begin() + n_, other) != other_.begin() + n_;
  }
  // Adds a bond that has no distance yet, or puts it in the place of another.
  void add(std::int32_t other) { set(n_++, {other}); }
  void replace(std::size_t k, std::int32_t other) { set(k, {other}); }
  void remove(std::int32_t other) {
    std::size_t kept = 0;
    for (std::size_t k = 0; k < n_; ++k)
      if (other_[k] != other) move(k, kept++);
    n_ = kept;
  }
  // Adds the distances of a frame, and sorts the bonds. squared_distance(other) is negative if that
  // marker is not detected. `r` is the variance of a measured coordinate.
  template <typename SquaredDistance>
  void update(double r, SquaredDistance&& squared_distance) {
    Columns squared, predicted;
    squared.fill(-1.0);
    for (std::size_t k = 0; k < n_; ++k) put(squared, k, squared_distance(other_[k]));
    add(r, squared, predicted);
    sort(predicted);
  }

 private:
  using Columns = std::array<Lanes, kMost / kLanes>;

  // Adds the distances of a frame, given their squares, and computes the predictive variances.
  void add(double r, const Columns& squared, Columns& predicted) {
#if defined(__GNUC__) && defined(__x86_64__)
    if (__builtin_cpu_supports("avx2")) return add_by_four(r, squared, predicted);
#endif
    add_all(r, squared, predicted);
  }
#if defined(__GNUC__) && defined(__x86_64__)
  // The same for processors with registers of four doubles, with the same result.
  [[gnu::target("avx2")]] void add_by_four(double r, const Columns& squared, Columns& predicted) {
    add_all(r, squared, predicted);
  }
#endif
  // As Bond::add and predictive_variance do.
  ASTERISM_INLINED void add_all(double r, const Columns& squared, Columns& predicted) {
    for (std::size_t c = 0; kLanes * c < n_; ++c) {
      const Lanes is_absent = Lanes(0.0) - squared[c];
      frames_[c] = where(is_absent, frames_[c], frames_[c] + 1.0);
      const Lanes share = 1.0 / minimum(maximum(frames_[c], 1.0), static_cast<double>(kMemory));
      const Lanes distance = square_root(maximum(squared[c], 0.0)), off = distance - mean_[c];
      const Lanes mean = mean_[c] + share * off;
      const Lanes variance = variance_[c] + share * (off * (distance - mean) - variance_[c]);
      mean_[c] = where(is_absent, mean_[c], mean);
      variance_[c] = where(is_absent, variance_[c], variance);
      const Lanes unobserved = mean_[c] * (kBend + 1.0 / maximum(frames_[c], 1.0));
      predicted[c] = maximum(variance_[c], 2 * r) + unobserved * unobserved;
    }
  }

  static double at(const Columns& column, std::size_t k) {
    return column[k / kLanes].at[static_cast<int>(k % kLanes)];
  }
  static void put(Columns& column, std::size_t k, double value) {
    column[k / kLanes].at[static_cast<int>(k % kLanes)] = value;
  }
  void set(std::size_t k, const Bond& bond) {
    other_[k] = bond.other;
    put(frames_, k, static_cast<double>(bond.n));
    put(mean_, k, bond.mean);
    put(variance_, k, bond.variance);
  }
  void move(std::size_t from, std::size_t to) {
    if (from != to) set(to, (*this)[from]);
  }
  // Variances change little from frame to frame, so an insertion sort is fast.
  void sort(Columns& predicted) {
    for (std::size_t k = 1; k < n_; ++k) {
      const double own = at(predicted, k);
      const std::int32_t other = other_[k];
      const auto is_before = [&](std::size_t than) {
        const double its = at(predicted, than);
        return own < its || (own == its && other < other_[than]);
      };
      if (!is_before(k - 1)) continue;
      const Bond bond = (*this)[k];
      std::size_t to = k;
      for (; to > 0 && is_before(to - 1); --to) {
        move(to - 1, to);
        put(predicted, to, at(predicted, to - 1));
      }
      set(to, bond);
      put(predicted, to, own);
    }
  }

  std::size_t n_ = 0;
  std::array<std::int32_t, kMost> other_{};
  Columns frames_, mean_, variance_;
};

}  // namespace asterism
