// A set of small integers with O(1) insertion, removal and random choice. The members are stored
// contiguously.
#pragma once

#include <cstdint>
#include <vector>

namespace asterism {

class IndexSet {
 public:
  void reserve_up_to(std::int32_t n) {
    if (static_cast<std::int32_t>(where_.size()) < n) where_.resize(n, -1);
  }
  void clear() {
    for (const std::int32_t i : items_) where_[i] = -1;
    items_.clear();
  }
  std::int32_t size() const { return static_cast<std::int32_t>(items_.size()); }
  std::int32_t operator[](std::int32_t k) const { return items_[k]; }
  bool has(std::int32_t i) const { return where_[i] >= 0; }
  const std::vector<std::int32_t>& items() const { return items_; }

  void add(std::int32_t i) {
    if (has(i)) return;
    where_[i] = size();
    items_.push_back(i);
  }
  void remove(std::int32_t i) {
    const std::int32_t at = where_[i];
    if (at < 0) return;
    const std::int32_t last = items_.back();
    items_[at] = last;
    where_[last] = at;
    items_.pop_back();
    where_[i] = -1;
  }

 private:
  std::vector<std::int32_t> items_, where_;
};

}  // namespace asterism
