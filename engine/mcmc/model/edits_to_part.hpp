// The edits of a partition that replace some of its tracks by those of a part.
#pragma once

#include <cstdint>
#include <span>
#include <unordered_map>
#include <utility>
#include <vector>

#include "mcmc/model/edits.hpp"
#include "mcmc/model/partition.hpp"

namespace asterism {

// `part` was taken of these tracks (Partition::take_part), and has changed since.
template <typename Filter>
std::vector<Edit<Filter>> edits_to_part(const Partition<Filter>& whole,
                                        const Partition<Filter>& part,
                                        std::span<const std::int32_t> tracks) {
  const auto first_open = [&](std::int32_t k) {
    const PartitionTrack& t = whole.track(k);
    return t.nodes[t.first_open()];
  };
  std::unordered_map<std::int32_t, std::int32_t> by_first;
  for (const std::int32_t k : tracks) by_first[first_open(k)] = k;
  std::vector<Edit<Filter>> edits;
  for (const std::int32_t p : part.tracks().items()) {
    const auto& nodes = part.track(p).nodes;
    Edit<Filter> edit;
    std::size_t same = 0;
    if (const auto at = by_first.find(part.origin(nodes.front())); at != by_first.end()) {
      edit.track = at->second;
      const PartitionTrack& own = whole.track(edit.track);
      edit.keep = own.first_open();
      while (same < nodes.size() && edit.keep < own.size() &&
             own.nodes[edit.keep] == part.origin(nodes[same])) {
        ++same;
        ++edit.keep;
      }
      by_first.erase(at);
      if (same == nodes.size() && edit.keep == own.size()) continue;
    }
    for (; same < nodes.size(); ++same) {
      edit.tail.nodes.push_back(part.origin(nodes[same]));
      whole.filter().adopt(edit.tail.states.emplace_back(part.state(nodes[same])));
      edit.tail.scores.push_back(part.score(nodes[same]));
    }
    edits.push_back(std::move(edit));
  }
  for (const std::int32_t k : tracks)
    if (by_first.contains(first_open(k))) edits.emplace_back().track = k;
  return edits;
}

}  // namespace asterism
