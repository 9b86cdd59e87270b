// A map in one sorted vector, whose copies take one allocation.
//
// Keys that are inserted in increasing order are appended. An insertion or removal invalidates
// references to the values.
#pragma once

#include <algorithm>
#include <cassert>
#include <utility>
#include <vector>

namespace asterism {

// The first of n entries, sorted by their keys, whose key is not smaller. The search has no branch
// that depends on the keys: the processor would predict every second one wrongly.
template <typename Iterator, typename Key, typename KeyOf>
Iterator first_from(Iterator at, std::size_t n, const Key& key, KeyOf&& key_of) {
  while (n > 0) {
    const std::size_t half = n - n / 2;
    at += static_cast<std::ptrdiff_t>((key_of(at[static_cast<std::ptrdiff_t>(half) - 1]) < key) * half);
    n -= half;
  }
  return at;
}

template <typename Key, typename Value>
class FlatMap {
 public:
  using Entry = std::pair<Key, Value>;

  auto begin() { return entries_.begin(); }
  auto end() { return entries_.end(); }
  auto begin() const { return entries_.begin(); }
  auto end() const { return entries_.end(); }
  std::size_t size() const { return entries_.size(); }

  // Null if there is no such key.
  Value* find(const Key& key) {
    const auto at = place_of(key);
    return at != entries_.end() && at->first == key ? &at->second : nullptr;
  }
  const Value* find(const Key& key) const { return const_cast<FlatMap*>(this)->find(key); }
  Value& at(const Key& key) {
    Value* found = find(key);
    assert(found != nullptr);
    return *found;
  }
  const Value& at(const Key& key) const { return const_cast<FlatMap*>(this)->at(key); }
  // Inserts a default value if there is no such key.
  Value& operator[](const Key& key) {
    if (entries_.empty() || entries_.back().first < key)
      return entries_.emplace_back(key, Value{}).second;
    const auto at = place_of(key);
    if (at->first == key) return at->second;
    return entries_.emplace(at, key, Value{})->second;
  }
  void clear() { entries_.clear(); }
  void erase(const Key& key) {
    const auto at = place_of(key);
    if (at != entries_.end() && at->first == key) entries_.erase(at);
  }
  // Removes the entries for which is_gone(entry) holds.
  template <typename IsGone>
  void erase_if(IsGone&& is_gone) {
    std::erase_if(entries_, is_gone);
  }

 private:
  auto place_of(const Key& key) {
    return first_from(entries_.begin(), entries_.size(), key, [](const Entry& e) { return e.first; });
  }

  std::vector<Entry> entries_;
};

// Calls visit(item, value) for the items of a sorted range whose key is in the map.
template <typename Items, typename KeyOf, typename Map, typename Visit>
void for_each_known(Items& items, KeyOf key_of, Map& map, Visit&& visit) {
  auto at = map.begin();
  for (auto& item : items) {
    while (at != map.end() && at->first < item.*key_of) ++at;
    if (at == map.end()) return;
    if (at->first == item.*key_of) visit(item, at->second);
  }
}

}  // namespace asterism
