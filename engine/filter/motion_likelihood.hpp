// Likelihood of tracks for motion models that differ only in the size of their process noise.
// Parameter fits evaluate it hundreds of times. The filter is that of imm.hpp, specialised to two
// states per axis and vectorised over tracks.
//
//   x, v    position and velocity of a mode       p = [p00 p01; p01 p11] covariance on each axis
//   w       probability of a mode                 q    process noise of a step at level 1
//   S       innovation variance p00 + r           T    transition probabilities of the modes
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <numbers>
#include <numeric>
#include <span>
#include <vector>

#include "filter/imm.hpp"
#include "math/lanes.hpp"

namespace asterism {

// The step between two frames at level 1: F = [1 dt; 0 1] and its process noise. A random walk has
// dt = 0 and no velocity noise.
struct UnitStep {
  double dt = 0, q00 = 0, q01 = 0, q11 = 0;
};

struct LeveledMotion {
  int M = 1;
  std::array<double, kMaxModes> squares{};  // squared levels
  std::array<double, kMaxModes * kMaxModes> T{1.0};  // row stride M
  std::array<double, kMaxModes> w0{1.0};
  double r = 0;                  // variance of a measured coordinate
  double velocity_variance = 0;  // prior
};

class MotionLikelihood {
 public:
  // The points and frames of all tracks, one track after the other. `kind[t]` is the index in
  // `steps` of the step that leads to frame t.
  MotionLikelihood(int D, std::span<const Point> points, std::span<const std::int64_t> frames,
                   std::span<const std::int64_t> offsets, std::span<const std::int32_t> kind,
                   std::vector<UnitStep> steps)
      : D_(D), steps_(std::move(steps)) {
    const auto length = [&](std::int64_t k) {
      return offsets[k] < offsets[k + 1] ? frames[offsets[k + 1] - 1] - frames[offsets[k]] : 0;
    };
    std::vector<std::int64_t> order(offsets.size() - 1);
    std::iota(order.begin(), order.end(), 0);
    // Tracks of similar length share a group, so that few lanes are idle.
    std::ranges::stable_sort(order, std::greater<>(), length);
    for (std::size_t begin = 0; begin < order.size() && length(order[begin]) > 0; begin += kLanes) {
      const std::size_t end = std::min(order.size(), begin + kLanes);
      Group group;
      group.steps.resize(length(order[begin]));
      for (std::size_t i = begin; i < end; ++i)
        if (length(order[i]) > 0)
          fill(group, i - begin, points, frames, kind, offsets[order[i]], offsets[order[i] + 1]);
      groups_.push_back(std::move(group));
    }
  }

  // Returns the sum of the log densities of all detections, each given the earlier detections of
  // its track.
  double sum(const LeveledMotion& m) const {
#if defined(__GNUC__) && defined(__x86_64__)
    if (__builtin_cpu_supports("avx2")) return sum_by_four(m);
#endif
    return sum_of_all(m);
  }

 private:
  struct Observation {
    std::array<Lanes, kMaxAxes> y{};
    Lanes r, detected;                          // 1 where there is a detection
    std::array<std::int32_t, kLanes> kind{};
  };
  struct Group {
    std::array<Lanes, kMaxAxes> first{};
    Lanes first_r;
    std::array<double, kLanes> n_linked{};  // detections after the first
    std::vector<Observation> steps;
  };
  template <int M>
  struct Modes {
    std::array<Lanes, M> w{}, p00{}, p01{}, p11{};
    std::array<std::array<Lanes, kMaxAxes>, M> x{}, v{};
  };

  static void fill(Group& group, std::size_t lane, std::span<const Point> points,
                   std::span<const std::int64_t> frames, std::span<const std::int32_t> kind,
                   std::int64_t begin, std::int64_t end) {
    for (int d = 0; d < kMaxAxes; ++d) group.first[d].at[lane] = points[begin][d];
    group.first_r.at[lane] = points[begin].r;
    for (std::int64_t i = begin + 1; i < end; ++i) {
      Observation& o = group.steps[frames[i] - frames[begin] - 1];
      for (int d = 0; d < kMaxAxes; ++d) o.y[d].at[lane] = points[i][d];
      o.r.at[lane] = points[i].r;
      o.detected.at[lane] = 1;
    }
    group.n_linked[lane] = static_cast<double>(end - begin - 1);
    for (std::int64_t t = frames[begin] + 1; t <= frames[end - 1]; ++t)
      group.steps[t - frames[begin] - 1].kind[lane] = kind[t];
  }

#if defined(__GNUC__) && defined(__x86_64__)
  // The same for processors with registers of four doubles, with the same result.
  [[gnu::target("avx2")]] double sum_by_four(const LeveledMotion& m) const { return sum_of_all(m); }
#endif
  ASTERISM_INLINED double sum_of_all(const LeveledMotion& m) const {
    double total = 0;
    for (const Group& group : groups_)
      total += m.M == 1 ? sum_of<1>(m, group) : m.M == 2 ? sum_of<2>(m, group) : sum_of<3>(m, group);
    return total;
  }

  template <int M>
  ASTERISM_INLINED double sum_of(const LeveledMotion& m, const Group& group) const {
    Modes<M> s;
    for (int b = 0; b < M; ++b) {
      s.w[b] = m.w0[b];
      s.x[b] = group.first;
      s.p00[b] = Lanes(m.r) + group.first_r;
      s.p11[b] = m.velocity_variance;
    }
    LogProduct factors;
    Lanes exponents;
    for (const Observation& o : group.steps) {
      if constexpr (M > 1) mix(m, s);
      predict(m, o, s);
      update(o, m.r, s, factors, exponents);
    }
    const double constant = -0.5 * D_ * std::log(2 * std::numbers::pi);
    double total = 0;
    for (int i = 0; i < kLanes; ++i)
      if (group.n_linked[i] > 0)
        total += group.n_linked[i] * constant + factors.log(i) - exponents.at[i];
    return total;
  }

  // Replaces the state of each mode by the mixture of the modes that can lead to it. Means and
  // covariances are summed relative to the first mode, which limits cancellation between similar
  // modes.
  template <int M>
  ASTERISM_INLINED void mix(const LeveledMotion& m, Modes<M>& s) const {
    const Modes<M> before = s;
    Modes<M> e;  // of each mode minus the first; covariances include the spread of the means
    const Lanes axes = 1.0 / D_;
    const auto spread = [&](const auto& x, const auto& v, Lanes& xx, Lanes& xv,
                            Lanes& vv) ASTERISM_INLINED_LAMBDA {
      xx = xv = vv = 0.0;
      for (int d = 0; d < kMaxAxes; ++d) {
        xx = xx + x[d] * x[d];
        xv = xv + x[d] * v[d];
        vv = vv + v[d] * v[d];
      }
      xx = xx * axes;
      xv = xv * axes;
      vv = vv * axes;
    };
    for (int a = 1; a < M; ++a) {
      for (int d = 0; d < kMaxAxes; ++d) {
        e.x[a][d] = before.x[a][d] - before.x[0][d];
        e.v[a][d] = before.v[a][d] - before.v[0][d];
      }
      spread(e.x[a], e.v[a], e.p00[a], e.p01[a], e.p11[a]);
      e.p00[a] = e.p00[a] + before.p00[a];
      e.p01[a] = e.p01[a] + before.p01[a];
      e.p11[a] = e.p11[a] + before.p11[a];
    }
    for (int b = 0; b < M; ++b) {
      std::array<Lanes, M> share;
      Lanes sum;
      for (int a = 0; a < M; ++a) sum = sum + (share[a] = before.w[a] * m.T[a * M + b]);
      const Lanes inverse = Lanes(1.0) / sum;
      s.w[b] = sum;
      std::array<Lanes, kMaxAxes> dx{}, dv{};
      const Lanes own = share[0] * inverse;
      Lanes p00 = own * before.p00[0], p01 = own * before.p01[0], p11 = own * before.p11[0];
      for (int a = 1; a < M; ++a) {
        const Lanes part = share[a] * inverse;
        for (int d = 0; d < kMaxAxes; ++d) {
          dx[d] = dx[d] + part * e.x[a][d];
          dv[d] = dv[d] + part * e.v[a][d];
        }
        p00 = p00 + part * e.p00[a];
        p01 = p01 + part * e.p01[a];
        p11 = p11 + part * e.p11[a];
      }
      Lanes xx, xv, vv;
      spread(dx, dv, xx, xv, vv);
      for (int d = 0; d < kMaxAxes; ++d) {
        s.x[b][d] = before.x[0][d] + dx[d];
        s.v[b][d] = before.v[0][d] + dv[d];
      }
      s.p00[b] = p00 - xx;
      s.p01[b] = p01 - xv;
      s.p11[b] = p11 - vv;
    }
  }

  template <int M>
  ASTERISM_INLINED void predict(const LeveledMotion& m, const Observation& o, Modes<M>& s) const {
    Lanes dt, q00, q01, q11;
    for (int i = 0; i < kLanes; ++i) {
      const UnitStep& step = steps_[o.kind[i]];
      dt.at[i] = step.dt;
      q00.at[i] = step.q00;
      q01.at[i] = step.q01;
      q11.at[i] = step.q11;
    }
    for (int b = 0; b < M; ++b) {
      for (int d = 0; d < kMaxAxes; ++d) s.x[b][d] = s.x[b][d] + dt * s.v[b][d];
      const Lanes moved = s.p01[b] + dt * s.p11[b];
      s.p00[b] = s.p00[b] + dt * (s.p01[b] + moved) + q00 * m.squares[b];
      s.p01[b] = moved + q01 * m.squares[b];
      s.p11[b] = s.p11[b] + q11 * m.squares[b];
    }
  }

  // Updates the state with the detections of a step. The density of each is a constant times
  // exp(-e) times a factor; the factors are multiplied, the e are summed.
  template <int M>
  ASTERISM_INLINED void update(const Observation& o, double variance, Modes<M>& s,
                               LogProduct& factors, Lanes& exponents) const {
    const Lanes r = Lanes(variance) + o.r;
    std::array<Lanes, M> inverse, half;  // 1/S, half the NIS
    std::array<std::array<Lanes, kMaxAxes>, M> innovation;
    for (int b = 0; b < M; ++b) {
      inverse[b] = Lanes(1.0) / (s.p00[b] + r);
      Lanes square;
      for (int d = 0; d < kMaxAxes; ++d) {
        innovation[b][d] = o.y[d] - s.x[b][d];
        square = square + innovation[b][d] * innovation[b][d];
      }
      half[b] = square * inverse[b] * 0.5;
    }
    Lanes nearest = half[0], sum;
    for (int b = 1; b < M; ++b) nearest = minimum(nearest, half[b]);
    std::array<Lanes, M> each;
    for (int b = 0; b < M; ++b) {
      each[b] = inverse[b];
      if (D_ == 3) each[b] = each[b] * square_root(inverse[b]);
      if constexpr (M > 1) each[b] = each[b] * s.w[b] * exp_of_negative(nearest - half[b]);
      sum = sum + each[b];
    }
    factors.multiply(where(o.detected, sum, 1.0));
    exponents = exponents + where(o.detected, nearest, 0.0);
    const Lanes share = Lanes(1.0) / sum;
    for (int b = 0; b < M; ++b) {
      if constexpr (M > 1) s.w[b] = where(o.detected, maximum(each[b] * share, 1e-300), s.w[b]);
      const Lanes gain = inverse[b] * o.detected;
      const Lanes k0 = s.p00[b] * gain, k1 = s.p01[b] * gain;
      for (int d = 0; d < kMaxAxes; ++d) {
        s.x[b][d] = s.x[b][d] + k0 * innovation[b][d];
        s.v[b][d] = s.v[b][d] + k1 * innovation[b][d];
      }
      s.p11[b] = s.p11[b] - k1 * s.p01[b];
      const Lanes left = Lanes(1.0) - k0;
      s.p00[b] = s.p00[b] * left;
      s.p01[b] = s.p01[b] * left;
    }
  }

  int D_;
  std::vector<UnitStep> steps_;
  std::vector<Group> groups_;
};

}  // namespace asterism
