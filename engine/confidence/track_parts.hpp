// What the distances of a part of a track are compared with, and the result.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>

#include "math/point.hpp"

namespace asterism {

// Detections by frame, with the track of each, -1 for none.
struct LabelledFrames {
  std::span<const Point> points;
  std::span<const std::int64_t> labels, offsets;
  std::span<const std::int64_t> samples;  // frames from which profiles are learnt, rising
  std::int64_t n_tracks = 0;
  int D = 3;
};

// Frames of a part of a track, and tracks that may have exchanged their later parts with it.
struct TrackPart {
  std::int32_t track = 0;
  std::span<const std::int64_t> frames;  // some of those of its detections
  std::array<std::int32_t, 2> partners{-1, -1};
};

// Log densities of the distances of a part, relative to its own track.
struct PartEvidence {
  static constexpr std::size_t kMost = 3;
  // Of the tracks that fit best, by falling density; unused ones have the density -inf.
  std::array<std::int32_t, kMost> track{-1, -1, -1};
  std::array<double, kMost> density{-kInfinite, -kInfinite, -kInfinite};
  double unknown = 0;     // density of an unknown marker
  double in_range = 0;    // the same by the ranges of most deviations from the profile
  bool is_known = false;  // whether the part has enough steady distances

 private:
  static constexpr double kInfinite = std::numeric_limits<double>::infinity();
};

}  // namespace asterism
