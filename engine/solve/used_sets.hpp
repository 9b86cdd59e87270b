// Hashable sets of used vertices, for frontiers whose sets are too many for an array.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace asterism {

// The used vertices of the frontier, by slot.
template <std::size_t W>
struct UsedSet {
  std::array<std::uint64_t, W> words{};

  bool has(std::int32_t slot) const { return words[slot >> 6] >> (slot & 63) & 1; }
  void flip(std::int32_t slot) { words[slot >> 6] ^= std::uint64_t{1} << (slot & 63); }
  bool operator==(const UsedSet&) const = default;
  auto operator<=>(const UsedSet&) const = default;
  std::size_t hash() const {
    std::uint64_t h = 0;
    for (const std::uint64_t word : words) {
      h = (h ^ word) * 0x9e3779b97f4a7c15u;
      h ^= h >> 32;
    }
    return static_cast<std::size_t>(h);
  }
};

// Sets in the order of insertion, each found by its value (open addressing).
template <std::size_t W>
class SetIndex {
 public:
  void reset(std::vector<UsedSet<W>>& sets) {
    sets_ = &sets;
    table_.assign(std::bit_ceil(std::max<std::size_t>(2 * sets.size(), 16)), -1);
    for (std::size_t i = 0; i < sets.size(); ++i)
      table_[place(sets[i])] = static_cast<std::int32_t>(i);
  }
  std::int32_t find(const UsedSet<W>& set) const { return table_[place(set)]; }
  std::int32_t find_or_add(const UsedSet<W>& set) {
    const std::size_t at = place(set);
    if (table_[at] >= 0) return table_[at];
    const auto i = static_cast<std::int32_t>(sets_->size());
    sets_->push_back(set);
    table_[at] = i;
    if (2 * sets_->size() > table_.size()) reset(*sets_);
    return i;
  }

 private:
  std::size_t place(const UsedSet<W>& set) const {
    std::size_t at = set.hash() & (table_.size() - 1);
    while (table_[at] >= 0 && (*sets_)[table_[at]] != set) at = (at + 1) & (table_.size() - 1);
    return at;
  }

  std::vector<UsedSet<W>>* sets_ = nullptr;
  std::vector<std::int32_t> table_;
};

}  // namespace asterism
