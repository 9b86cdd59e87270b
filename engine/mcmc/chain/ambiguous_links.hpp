// The ambiguous links of a window: pairs of detections that are plausible alternatives to the
// present links.
#pragma once

#include <cstdint>
#include <deque>
#include <vector>

namespace asterism {

class AmbiguousLinks {
 public:
  struct Link {
    std::int32_t from = 0, to = 0;
    bool operator==(const Link&) const = default;
  };

  void add_frame() { frames_.emplace_back(); }
  // Adds a link that leads into the newest frame.
  void add(std::int32_t from, std::int32_t to) { frames_.back().push_back({from, to}); }
  // Removes all but the newest frames.
  void keep(std::size_t n_frames) {
    while (frames_.size() > n_frames) frames_.pop_front();
  }

  // Calls visit for the links into the newest frame.
  template <typename Visit>
  void each_new(Visit&& visit) const {
    for (const Link& link : frames_.back()) visit(link.from, link.to);
  }
  template <typename Visit>
  void each(Visit&& visit) const {
    for (const std::vector<Link>& links : frames_)
      for (const Link& link : links) visit(link.from, link.to);
  }

 private:
  std::deque<std::vector<Link>> frames_;
};

}  // namespace asterism
