// Counts how often a chain visits each partition.
#pragma once

#include <cstdint>
#include <unordered_map>
#include <utility>
#include <vector>

#include "mcmc/chain/sampler.hpp"

namespace asterism {

// A partition is the set of its links. Its key is the sum of the keys of its links, which can be
// summed in any order.
inline std::uint64_t link_key(std::int64_t a, std::int64_t b) {
  std::uint64_t z = static_cast<std::uint64_t>(a) * 0x9e3779b97f4a7c15u +
                    static_cast<std::uint64_t>(b) * 0xd1342543de82ef95u + 1;
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
  return z ^ (z >> 31);
}

template <typename Filter>
std::uint64_t key_of(const Partition<Filter>& p) {
  std::uint64_t key = 0;
  for (const std::int32_t k : p.tracks().items()) {
    const auto& nodes = p.track(k).nodes;
    for (std::size_t n = 1; n < nodes.size(); ++n)
      key += link_key(p.window()[nodes[n - 1]].number, p.window()[nodes[n]].number);
  }
  return key;
}

// Track of each detection in the window, from the oldest frame on: -1 for none, tracks numbered by
// their first detection.
template <typename Filter>
std::vector<std::int64_t> labels_of(const Partition<Filter>& p) {
  std::vector<std::int64_t> labels;
  std::unordered_map<std::int32_t, std::int64_t> names;
  const DetectionWindow& window = p.window();
  for (std::int64_t t = window.first(); t <= window.now(); ++t)
    for (const std::int32_t i : window.frame(t).ids) {
      const std::int32_t k = p.track_of(i);
      labels.push_back(
          k < 0 ? -1 : names.try_emplace(k, static_cast<std::int64_t>(names.size())).first->second);
    }
  return labels;
}

struct Visited {
  std::int64_t count = 0;
  std::vector<std::int64_t> labels;
};

// Runs a chain and counts the moves after which it was in each partition.
template <typename Filter>
std::unordered_map<std::uint64_t, Visited> tally(Sampler<Filter>& sampler, std::int64_t n_moves) {
  std::unordered_map<std::uint64_t, Visited> visited;
  std::uint64_t key = key_of(sampler.partition());
  Visited* here = nullptr;
  const auto arrive = [&] {
    here = &visited[key];
    if (here->count == 0) here->labels = labels_of(sampler.partition());
  };
  arrive();
  for (std::int64_t n = 0; n < n_moves; ++n) {
    if (sampler.step()) {
      key = key_of(sampler.partition());
      arrive();
    }
    ++here->count;
  }
  return visited;
}

}  // namespace asterism
