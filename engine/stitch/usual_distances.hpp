// Distances between tracks: in a frame, and the usual one of each pair.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "math/point.hpp"

namespace asterism {

struct MiddleAndSpread {
  double middle = 0, spread = 0;  // the spread is that of a normal distribution
};
// The median of the values, which it changes, and the median deviation from it.
inline MiddleAndSpread middle_and_spread(std::vector<double>& values) {
  const auto middle_of = [&] {
    const auto at = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::ranges::nth_element(values, at);
    return *at;
  };
  MiddleAndSpread found;
  found.middle = middle_of();
  for (double& value : values) value = std::abs(value - found.middle);
  found.spread = 1.4826 * middle_of();
  return found;
}

class UsualDistances {
 public:
  static constexpr double kUnknown = std::numeric_limits<double>::infinity();
  static constexpr std::size_t kMinTogether = 20;  // frames of tracks that are compared

  // Capture of T frames with D coordinates.
  UsualDistances(std::int64_t T, int D) : T_(T), D_(D) {}

  // The tracks are given as points and rising frames of each, and must not change.
  void add(std::span<const Point> points, std::span<const std::int64_t> frames) {
    Track& own = tracks_.emplace_back(Track{points, frames, {}});
    if (frames.empty()) return;
    own.at.assign(static_cast<std::size_t>(frames.back() - frames.front()) + 1, -1);
    for (std::size_t i = 0; i < frames.size(); ++i)
      own.at[static_cast<std::size_t>(frames[i] - frames.front())] = static_cast<std::int32_t>(i);
  }

  // Takes the usual distances of all pairs of the added tracks, from frames spread over the capture.
  void measure() {
    const std::int64_t n = std::min(T_, kFrames);
    const std::int32_t K = n_tracks();
    usual_.assign(tracks_.size() * tracks_.size(), kUnknown);
    std::vector<double> values;
    // Fragments are compared with nothing, however many there are.
    for (std::int32_t a = 0; a < K; ++a)
      for (std::int32_t b = a + 1; b < K && is_long(a); ++b) {
        if (!is_long(b)) continue;
        values.clear();
        for (std::int64_t s = 0; s < n; ++s) {
          const Point* one = find(a, s * T_ / n);
          const Point* other = one == nullptr ? nullptr : find(b, s * T_ / n);
          if (other != nullptr) values.push_back(squared_distance(*one, *other, D_));
        }
        if (values.size() < kMinKnown) continue;
        const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
        std::ranges::nth_element(values, middle);
        usual_[place(a, b)] = usual_[place(b, a)] = std::sqrt(*middle);
      }
  }
  // Whether a track is long enough to be compared.
  bool is_long(std::int32_t k) const { return tracks_[k].frames.size() >= kMinTogether; }
  std::int32_t n_tracks() const { return static_cast<std::int32_t>(tracks_.size()); }
  std::int64_t n_frames() const { return T_; }
  std::span<const Point> points(std::int32_t k) const { return tracks_[k].points; }
  std::span<const std::int64_t> frames(std::int32_t k) const { return tracks_[k].frames; }
  // Null without a detection in the frame.
  const Point* find(std::int32_t k, std::int64_t t) const {
    const Track& own = tracks_[k];
    if (own.frames.empty() || t < own.frames.front() || t > own.frames.back()) return nullptr;
    const std::int32_t i = own.at[static_cast<std::size_t>(t - own.frames.front())];
    return i < 0 ? nullptr : &own.points[static_cast<std::size_t>(i)];
  }
  double between(const Point& a, const Point& b) const {
    return std::sqrt(squared_distance(a, b, D_));
  }
  // Median distance of two tracks, `kUnknown` if they were hardly seen together.
  double usual(std::int32_t a, std::int32_t b) const { return usual_[place(a, b)]; }

 private:
  static constexpr std::int64_t kFrames = 150;  // from which usual distances are taken
  static constexpr std::size_t kMinKnown = 5;   // of these frames, with both

  struct Track {
    std::span<const Point> points;
    std::span<const std::int64_t> frames;
    std::vector<std::int32_t> at;  // index of the point in each frame from the first on, or -1
  };
  std::size_t place(std::int32_t a, std::int32_t b) const {
    return static_cast<std::size_t>(a) * tracks_.size() + static_cast<std::size_t>(b);
  }

  std::int64_t T_;
  int D_;
  std::vector<Track> tracks_;
  std::vector<double> usual_;
};

}  // namespace asterism
