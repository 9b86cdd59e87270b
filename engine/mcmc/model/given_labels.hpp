// Labels given to detections, from which the tracks of a partition start.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "rigid/shared_acceleration.hpp"

namespace asterism {

// Labels by number of arrival, from `first` on, -1 for none. With `shared` they are also those of
// the markers that accelerate together.
struct GivenLabels {
  std::int64_t first = 0;
  std::vector<std::int64_t> labels;
  std::shared_ptr<const SharedAcceleration> shared;

  std::int64_t of(std::int64_t number) const {
    const std::int64_t at = number - first;
    return at >= 0 && at < static_cast<std::int64_t>(labels.size()) ? labels[at] : -1;
  }
};

}  // namespace asterism
