// Conversion of models and frames from NumPy arrays.
#pragma once

#include <algorithm>
#include <cassert>
#include <chrono>
#include <cstdint>
#include <span>
#include <utility>
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
inline MotionStep motion_step(const MotionModel& m, const In<double>& F, const In<double>& Q) {
  const std::size_t size = static_cast<std::size_t>(m.M) * m.axis.n * m.axis.n;
  require(F.size() == size && Q.size() == size, "F and Q: shape (modes, n, n)");
  return motion_step(m, F.data(), Q.data());
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
  Timeline line{flat(times), flat(kind), motion_steps(m, F, Q)};
  // The first frame of a capture has no step; its kind is then -1.
  const auto n_kinds = static_cast<std::int64_t>(line.steps.size());
  for (std::size_t t = 0; t < line.kind.size(); ++t)
    require(line.kind[t] >= (t == 0 ? -1 : 0) && line.kind[t] < n_kinds, "kind: an index into F");
  return line;
}

// An additional column is the variance of each point's coordinates in addition to the sensor's.
inline std::vector<Point> to_points(const In<double>& array, int D) {
  const auto n_axes = static_cast<std::size_t>(D);
  require(array.ndim() == 2 && (array.shape(1) == n_axes || array.shape(1) == n_axes + 1),
          "points: shape (N, D) or (N, D + 1)");
  const std::size_t width = array.shape(1);
  std::vector<Point> points(array.shape(0), Point{});
  for (std::size_t i = 0; i < points.size(); ++i) {
    // A loop of fixed length, because a call to copy three numbers takes longer than that.
    for (int d = 0; d < kMaxAxes; ++d) points[i][d] = d < D ? array.data()[i * width + d] : 0;
    if (width > n_axes) points[i].r = array.data()[i * width + n_axes];
  }
  return points;
}

// The points of many tracks, one track after the other, and the start of each.
struct TrackPoints {
  std::vector<Point> points;
  std::span<const std::int64_t> frames, offsets;

  TrackPoints(const In<double>& p, const In<std::int64_t>& f, const In<std::int64_t>& o, int D,
              std::size_t n_frames)
      : points(to_points(p, D)), frames(flat(f)), offsets(flat(o)) {
    require(frames.size() == points.size(), "frames: shape (N,)");
    require_offsets(offsets, points.size(), "offsets: rising, from 0 to N");
    require(offsets.front() == 0 && offsets.back() == static_cast<std::int64_t>(points.size()),
            "offsets: from 0 to N");
    for (std::size_t k = 0; k < n_tracks(); ++k)
      for (std::int64_t i = offsets[k]; i < offsets[k + 1]; ++i)
        require(frames[i] >= 0 && frames[i] < static_cast<std::int64_t>(n_frames) &&
                    (i == offsets[k] || frames[i] > frames[i - 1]),
                "frames: rising within a track");
  }
  std::size_t n_tracks() const { return offsets.size() - 1; }
  std::span<const Point> points_of(std::size_t k) const {
    return std::span(points).subspan(offsets[k], offsets[k + 1] - offsets[k]);
  }
  std::span<const std::int64_t> frames_of(std::size_t k) const {
    return frames.subspan(offsets[k], offsets[k + 1] - offsets[k]);
  }
};

// (means (K, D, n), covariances (K, n, n))
inline std::pair<Out<double>, Out<double>> state_arrays(const MotionModel& m,
                                                        std::span<const AxisState> states) {
  const std::size_t K = states.size(), D = m.axis.D, n = m.axis.n;
  Owned<double> means(K * D * n), covariances(K * n * n);
  for (std::size_t k = 0; k < K; ++k) {
    for (std::size_t d = 0; d < D; ++d)
      std::copy_n(states[k].x[d].begin(), n, means.data.get() + (k * D + d) * n);
    std::copy_n(states[k].P.begin(), n * n, covariances.data.get() + k * n * n);
  }
  return {means.give({K, D, n}), covariances.give({K, n, n})};
}

// The states of K tracks, in two blocks of memory: one array for each would take longer than the
// states themselves.
class TrackArrays {
 public:
  TrackArrays(const MotionModel& m, std::size_t K)
      : D_(m.axis.D), n_(m.axis.n), K_(K), whole_(2 * K), real_(K * (1 + D_ * n_ + n_ * n_)) {}

  void add(std::int64_t id, std::int64_t gap, double log_odds, const AxisState& state) {
    for (std::size_t d = 0; d < D_; ++d)
      std::copy_n(state.x[d].begin(), n_, means() + (k_ * D_ + d) * n_);
    std::copy_n(state.P.begin(), n_ * n_, covariances() + k_ * n_ * n_);
    whole_.data[k_] = id;
    whole_.data[K_ + k_] = gap;
    real_.data[k_++] = log_odds;
  }
  // Returns (ids, gaps, log odds, means (K, D, n), covariances (K, n, n)).
  nb::tuple give() {
    assert(k_ == K_);
    const auto owner = [](auto* raw) {
      return nb::capsule(raw, [](void* p) noexcept { delete[] static_cast<decltype(raw)>(p); });
    };
    double *mean = means(), *covariance = covariances();
    std::int64_t* ids = whole_.data.release();
    double* log_odds = real_.data.release();
    const nb::capsule whole = owner(ids), real = owner(log_odds);
    return nb::make_tuple(Out<std::int64_t>(ids, {K_}, whole), Out<std::int64_t>(ids + K_, {K_}, whole),
                          Out<double>(log_odds, {K_}, real), Out<double>(mean, {K_, D_, n_}, real),
                          Out<double>(covariance, {K_, n_, n_}, real));
  }

 private:
  double* means() { return real_.data.get() + K_; }
  double* covariances() { return means() + K_ * D_ * n_; }

  std::size_t D_, n_, K_, k_ = 0;
  Owned<std::int64_t> whole_;
  Owned<double> real_;
};

// Consecutive frames: their steps and points.
struct FrameRun {
  Timeline line;
  std::vector<Point> points;
  std::span<const std::int64_t> offsets;

  FrameRun(const MotionModel& m, const In<double>& times, const In<std::int32_t>& kind,
           const In<double>& F, const In<double>& Q, const In<std::int64_t>& starts,
           const In<double>& all)
      : line(timeline(m, times, kind, F, Q)), points(to_points(all, m.axis.D)), offsets(flat(starts)) {
    require(offsets.size() == size() + 1, "offsets: shape (T + 1,)");
    require(size() == 0 || line.kind[0] >= 0, "kind: an index into F");
    require_offsets(offsets, points.size(), "offsets: rising, within the points");
  }
  std::size_t size() const { return line.times.size(); }
  std::int64_t n_points() const { return offsets.back() - offsets.front(); }

  // Calls take(frame, number of its first point, its points) without the GIL. Regularly checks for
  // an interrupt.
  template <typename Take>
  void each(Take&& take) const {
    using Clock = std::chrono::steady_clock;
    constexpr std::chrono::milliseconds look_every{50};
    nb::gil_scoped_release release;
    auto next_look = Clock::now() + look_every;
    for (std::size_t t = 0; t < size(); ++t) {
      if (Clock::now() > next_look) {
        nb::gil_scoped_acquire acquire;
        if (PyErr_CheckSignals() != 0) throw nb::python_error();
        next_look = Clock::now() + look_every;
      }
      const auto from = static_cast<std::size_t>(offsets[t]);
      take(t, from, std::span(points).subspan(from, offsets[t + 1] - offsets[t]));
    }
  }
};

}  // namespace asterism
