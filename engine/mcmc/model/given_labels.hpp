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
  // Nats by which a shared term may outweigh the own scores. Changes beyond are rejected at once.
  static constexpr double kReach = 30;

  std::int64_t first = 0;
  std::vector<std::int64_t> labels;
  std::shared_ptr<const SharedAcceleration> shared;

  bool covers(std::int64_t number) const {
    return number >= first && number - first < static_cast<std::int64_t>(labels.size());
  }
  std::int64_t of(std::int64_t number) const { return covers(number) ? labels[number - first] : -1; }
};

// A detection of a marker that is not in the partition and does not change.
struct FixedPlace {
  std::int32_t marker = 0;
  std::int64_t frame = 0;
  Point at{};
};

}  // namespace asterism
