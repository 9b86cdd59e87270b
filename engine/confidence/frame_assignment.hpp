// Assignment of the open detections of one frame after the other to the tracks.
//
// All other detections stay on their tracks. In each frame the assignment with the largest sum of
// gains is found exactly, given the labels of the other frames.
//
//   s_ik     log odds of open detection i being of track k instead of clutter: those of its
//            distances to the other tracks of the frame, and of the motion around the frame;
//            where it has no distances, a detection stays where it is
//   gain_ik  s_ik, with `change` in favour of what i has now, a track or none
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <span>
#include <vector>

#include "confidence/distance_profiles.hpp"
#include "math/point.hpp"
#include "solve/assignment.hpp"

namespace asterism {

// Detections by frame, with those that may change their track.
struct OpenFrames {
  std::span<const Point> points;
  std::span<const std::int64_t> offsets;
  std::span<const std::uint8_t> is_open;
  std::span<const double> ghost;  // log odds of each detection being a ghost
  std::span<const double> sigma;  // of each track, deviation of a coordinate from smooth motion
  double log_clutter = 0;         // log density of clutter
  double change = 0;              // log odds that a change must gain
  std::int64_t max_gap = 0;       // frames that motion predicts over
  int D = 3;
};

class FrameAssignment {
 public:
  FrameAssignment(const OpenFrames& all, DistanceProfiles& profiles, std::span<std::int64_t> labels)
      : all_(all), profiles_(profiles), labels_(labels), first_(all.sigma.size(), n_frames()),
        last_(all.sigma.size(), -1), around_(all.sigma.size()), is_held_(all.sigma.size()),
        at_(profiles.n_references()) {}

  void run() {
    for (std::int64_t t = 0; t < n_frames(); ++t)
      for (std::int64_t i = all_.offsets[t]; i < all_.offsets[t + 1]; ++i)
        if (const std::int64_t k = labels_[i]; k >= 0) {
          first_[k] = std::min(first_[k], t);
          last_[k] = t;
        }
    for (std::int64_t t = 0; t < n_frames(); ++t) {
      const auto begin = all_.is_open.begin();
      if (std::find(begin + all_.offsets[t], begin + all_.offsets[t + 1], 1) !=
          begin + all_.offsets[t + 1])
        assign(t);
    }
  }

 private:
  static constexpr double kDistances = 1.5;  // weight of the mean of the distances
  static constexpr double kMaxDistances = 4, kMaxMotion = 2;  // bounds of both kinds of evidence
  static constexpr double kUnaccelerated = 9, kUnmoved = 100;  // growth of the variance of motion

  // The nearest two detections of a track before and after a frame, by frames from it.
  struct Around {
    std::array<std::int64_t, 2> before{-1, -1}, after{-1, -1};
    std::array<double, 2> n_before{}, n_after{};
  };

  void assign(std::int64_t t) {
    look_around(t);
    std::ranges::fill(at_, nullptr);
    std::ranges::fill(is_held_, 0);
    for (std::int64_t i = all_.offsets[t]; i < all_.offsets[t + 1]; ++i)
      if (const std::int64_t k = labels_[i]; k >= 0) {
        if (const std::int32_t r = profiles_.reference_of(k); r >= 0) at_[r] = &all_.points[i];
        is_held_[k] |= !all_.is_open[i];
      }
    const std::int64_t first = all_.offsets[t];
    candidates_.clear();
    match_.assign(all_.offsets[t + 1] - first, -1);
    for (std::int64_t i = first; i < all_.offsets[t + 1]; ++i)
      if (all_.is_open[i]) offer(t, i, static_cast<std::int32_t>(i - first));
    assignment_.solve_groups(candidates_, static_cast<std::int32_t>(all_.sigma.size()), match_);
    for (std::int64_t i = first; i < all_.offsets[t + 1]; ++i)
      if (all_.is_open[i]) labels_[i] = match_[i - first];
  }

  std::int64_t n_frames() const { return static_cast<std::int64_t>(all_.offsets.size()) - 1; }

  void offer(std::int64_t t, std::int64_t i, std::int32_t row) {
    const std::int64_t now = labels_[i];
    for (std::int32_t k = 0; k < static_cast<std::int32_t>(all_.sigma.size()); ++k) {
      if (is_held_[k]) continue;
      // Long before or after a track, another track may be of its marker.
      if (t < first_[k] - all_.max_gap || t > last_[k] + all_.max_gap) continue;
      const auto own = static_cast<std::int32_t>(now);
      const auto distances = profiles_.support(k, all_.points[i], at_, own);
      if (k != now && !distances) continue;
      double gain = k == now ? all_.change : 0;
      if (distances) {
        gain += kDistances * std::clamp(*distances, -kMaxDistances, kMaxDistances);
        if (around_[k].before[0] >= 0 || around_[k].after[0] >= 0)
          gain += std::clamp(motion(i, k) - all_.log_clutter, -kMaxMotion, kMaxMotion);
      }
      if (now < 0) gain -= all_.change + all_.ghost[i];
      if (gain > 0) candidates_.push_back({row, k, gain});
    }
  }

  void look_around(std::int64_t t) {
    std::ranges::fill(around_, Around{});
    for (std::int64_t n = 1; n <= all_.max_gap; ++n) {
      const auto far = static_cast<double>(n);
      if (t - n >= 0) enter(t - n, far, &Around::before, &Around::n_before);
      if (t + n < n_frames()) enter(t + n, far, &Around::after, &Around::n_after);
    }
  }
  void enter(std::int64_t t, double n, std::array<std::int64_t, 2> Around::* side,
             std::array<double, 2> Around::* distance) {
    for (std::int64_t i = all_.offsets[t]; i < all_.offsets[t + 1]; ++i)
      if (labels_[i] >= 0) {
        Around& own = around_[labels_[i]];
        const int slot = (own.*side)[0] < 0 ? 0 : 1;
        if ((own.*side)[slot] >= 0) continue;
        (own.*side)[slot] = i;
        (own.*distance)[slot] = n;
      }
  }

  // Log density of a detection between those of a track around it: Student's t around the
  // polynomial through them, or around straight motion where they are on one side.
  double motion(std::int64_t i, std::int32_t k) const {
    const Around& own = around_[k];
    std::array<std::int64_t, 4> points{};
    std::array<double, 4> when{};
    std::size_t n = 0;
    for (const std::size_t s : {0, 1}) {
      if (own.before[s] >= 0) points[n] = own.before[s], when[n++] = -own.n_before[s];
      if (own.after[s] >= 0) points[n] = own.after[s], when[n++] = own.n_after[s];
    }
    const double sigma2 = all_.sigma[k] * all_.sigma[k];
    double variance = 0;
    if (own.before[0] >= 0 && own.after[0] >= 0) {
      const double half = (own.n_before[0] + own.n_after[0]) / 2;
      const auto order = static_cast<double>(std::min<std::size_t>(n, 3));
      variance = sigma2 * (1 + std::pow(half, 2 * order) / 4);
    } else {
      const double gap2 = when[0] * when[0];
      variance = sigma2 * (n == 2 ? 4 + kUnaccelerated * gap2 * gap2 : kUnmoved * gap2);
    }
    std::array<double, kMaxAxes> off{};
    for (int d = 0; d < all_.D; ++d) off[d] = all_.points[i][d];
    for (std::size_t a = 0; a < n; ++a) {
      double weight = 1;
      for (std::size_t b = 0; b < n; ++b)
        if (b != a) weight *= -when[b] / (when[a] - when[b]);
      for (int d = 0; d < all_.D; ++d) off[d] -= weight * all_.points[points[a]][d];
    }
    double off2 = 0;
    for (const double x : off) off2 += x * x;
    return -(3 + all_.D) / 2.0 * std::log1p(off2 / (3 * variance)) -
           all_.D / 2.0 * std::log(2 * std::numbers::pi * variance);
  }

  OpenFrames all_;
  DistanceProfiles& profiles_;
  std::span<std::int64_t> labels_;
  std::vector<std::int64_t> first_, last_;  // frames of each track before the assignment
  // Of the frame that is assigned.
  std::vector<Around> around_;
  std::vector<std::uint8_t> is_held_;  // tracks of detections that stay
  std::vector<const Point*> at_;       // of each reference of the profiles, null for none
  std::vector<Candidate> candidates_;
  std::vector<std::int32_t> match_;
  Assignment assignment_;
};

}  // namespace asterism
