// Models and frames, from Python's arrays.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "filter/imm.hpp"
#include "filter/track_filter.hpp"
#include "python/arrays.hpp"

namespace asterism {

// F and Q of every mode, one mode after the other.
inline MotionStep motion_step(const MotionModel& m, const double* F, const double* Q) {
  MotionStep step;
  const int nn = m.axis.n * m.axis.n;
  for (int b = 0; b < m.M; ++b) {
    std::copy_n(F + b * nn, nn, step.mode[b].F.begin());
    std::copy_n(Q + b * nn, nn, step.mode[b].Q.begin());
  }
  return step;
}

inline std::vector<MotionStep> motion_steps(const MotionModel& m, const In<double>& F,
                                            const In<double>& Q) {
  const auto n = static_cast<std::size_t>(m.axis.n), M = static_cast<std::size_t>(m.M);
  require(F.ndim() == 4 && F.shape(1) == M && F.shape(2) == n && F.shape(3) == n,
          "F: shape (kinds, modes, n, n)");
  require(Q.ndim() == 4 && Q.shape(0) == F.shape(0) && Q.shape(1) == M && Q.shape(2) == n &&
              Q.shape(3) == n,
          "Q: shape (kinds, modes, n, n)");
  std::vector<MotionStep> steps;
  for (std::size_t i = 0; i < F.shape(0); ++i)
    steps.push_back(motion_step(m, F.data() + i * M * n * n, Q.data() + i * M * n * n));
  return steps;
}

inline Timeline timeline(const MotionModel& m, const In<double>& times,
                         const In<std::int32_t>& kind, const In<double>& F, const In<double>& Q) {
  require(times.ndim() == 1 && kind.ndim() == 1 && times.shape(0) == kind.shape(0),
          "times and kind: shape (T,)");
  Timeline line{{times.data(), times.shape(0)}, {kind.data(), kind.shape(0)}, motion_steps(m, F, Q)};
  // The first frame has no step to it where it is the first of all, which is said by -1.
  const auto n_kinds = static_cast<std::int64_t>(line.steps.size());
  for (std::size_t t = 0; t < line.kind.size(); ++t)
    require(line.kind[t] >= (t == 0 ? -1 : 0) && line.kind[t] < n_kinds, "kind: an index into F");
  return line;
}

// A column more than there are axes is the variance of each point's coordinates beyond the sensor's.
inline std::vector<Point> to_points(const In<double>& array, int D) {
  const auto n_axes = static_cast<std::size_t>(D);
  require(array.ndim() == 2 && (array.shape(1) == n_axes || array.shape(1) == n_axes + 1),
          "points: shape (N, D) or (N, D + 1)");
  const std::size_t width = array.shape(1);
  std::vector<Point> points(array.shape(0), Point{});
  for (std::size_t i = 0; i < points.size(); ++i) {
    std::copy_n(array.data() + i * width, D, points[i].begin());
    if (width > n_axes) points[i].r = array.data()[i * width + n_axes];
  }
  return points;
}

// The points of many tracks, one track after the other, and where each begins.
struct TrackPoints {
  std::vector<Point> points;
  std::span<const std::int64_t> frames, offsets;

  TrackPoints(const In<double>& p, const In<std::int64_t>& f, const In<std::int64_t>& o, int D,
              std::size_t n_frames)
      : points(to_points(p, D)), frames(f.data(), f.size()), offsets(o.data(), o.size()) {
    require(f.ndim() == 1 && frames.size() == points.size(), "frames: shape (N,)");
    require(o.ndim() == 1 && !offsets.empty() && offsets.front() == 0 &&
                offsets.back() == static_cast<std::int64_t>(points.size()),
            "offsets: from 0 to N");
    for (std::size_t k = 0; k + 1 < offsets.size(); ++k) {
      require(offsets[k] <= offsets[k + 1], "offsets: rising");
      for (std::int64_t i = offsets[k]; i < offsets[k + 1]; ++i)
        require(frames[i] >= 0 && frames[i] < static_cast<std::int64_t>(n_frames) &&
                    (i == offsets[k] || frames[i] > frames[i - 1]),
                "frames: rising within a track");
    }
  }
  std::size_t n_tracks() const { return offsets.size() - 1; }
  std::span<const Point> points_of(std::size_t k) const {
    return std::span(points).subspan(offsets[k], offsets[k + 1] - offsets[k]);
  }
  std::span<const std::int64_t> frames_of(std::size_t k) const {
    return frames.subspan(offsets[k], offsets[k + 1] - offsets[k]);
  }
};

}  // namespace asterism
