// The continuations (“ways”) of every branch of every tree in a new frame.
#pragma once

#include <algorithm>
#include <cstdint>
#include <utility>
#include <vector>

#include "trees/hypothesis_window.hpp"

namespace asterism {

// The continuations of branch b are first[b] to first[b + 1]; the last is the missed detection.
struct Ways {
  std::vector<Branch> branches;
  std::vector<std::int32_t> first;
  std::vector<double> log_ratio;  // of each continuation; 0 for a single detection

  std::int32_t miss(std::int32_t branch) const { return first[branch + 1] - 1; }
};

class FrameWays {
 public:
  Ways& operator[](std::size_t tree) { return ways_[tree]; }
  const Ways& operator[](std::size_t tree) const { return ways_[tree]; }

  // Index of a tree in the window by its key. Keys increase with the index.
  bool has(std::int64_t key) const {
    return std::binary_search(keys_.begin(), keys_.end(), key);
  }
  std::size_t index_of(std::int64_t key) const {
    return std::lower_bound(keys_.begin(), keys_.end(), key) - keys_.begin();
  }
  void list_keys(const HypothesisWindow& open) {
    keys_.clear();
    for (std::size_t i = 0; i < open.n_all(); ++i) keys_.push_back(open.tree(i).more.key);
  }

  // Splits all branches over the newest frame of the window, and initiates a tree at each of its
  // detections.
  void grow(HypothesisWindow& open, TreeStats& stats) {
    const BranchGrower grower(open.live, open.branches);
    ways_.assign(open.n_all(), {});
    for (std::size_t i = 0; i < open.n_all(); ++i) {
      LiveTrack<Tree>& tree = open.tree(i);
      Ways& ways = ways_[i];
      ways.first.push_back(0);
      for (Branch& parent : tree.more.branches) {
        grower.split(*open.frames.back(), tree, parent, ways.branches, stats);
        ways.first.push_back(static_cast<std::int32_t>(ways.branches.size()));
      }
      for (const Branch& b : ways.branches)
        ways.log_ratio.push_back(open.is_lone(i, b) ? 0 : grower.log_ratio(b));
    }
    open.begin_trees();
    for (std::size_t i = ways_.size(); i < open.n_all(); ++i)
      ways_.push_back({open.tree(i).more.branches, {0, 1}, {0}});
    list_keys(open);
  }

  // Calls visit(continuation, gain over the missed detection) for each detection that a branch may
  // take.
  template <typename Visit>
  void each_hit(std::size_t tree, std::int32_t branch, Visit&& visit) const {
    const Ways& ways = ways_[tree];
    const std::int32_t miss = ways.miss(branch);
    for (std::int32_t w = ways.first[branch]; w < miss; ++w)
      visit(w, ways.log_ratio[w] - ways.log_ratio[miss]);
  }

 private:
  std::vector<std::int64_t> keys_;
  std::vector<Ways> ways_;
};

}  // namespace asterism
