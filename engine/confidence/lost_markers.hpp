// Detections of markers that their tracks have lost, found by the distances to others in the frame.
//
//   d, s     learnt distance of two tracks and its standard deviation, infinite without a bond
//   odds     log odds of detection i being of track k: mean over its steadiest bonds to tracks in the
//            frame, of log t_3(|y_i - y|; d, s²) - log t_3(|y_i - y|; d, s² + (kUnknown d)²), times
//            the number of these bonds, at most kFree
//
// A point has three free distances, and the fourth one checks them; more only make the mean robust.
// The clearest pair of a track and a detection is decided first: its odds exceed those of all other
// detections of the track, and those of all other tracks. Then its track helps to find the others.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "math/point.hpp"

namespace asterism {

class LostMarkers {
 public:
  // Distances and spreads of all pairs of K tracks, (K, K).
  LostMarkers(std::span<const double> distances, std::span<const double> spreads, std::size_t K)
      : distances_(distances), spreads_(spreads), K_(K), bonds_(K), at_(K) {
    for (std::size_t k = 0; k < K; ++k) {
      for (std::size_t j = 0; j < K; ++j)
        if (j != k && std::isfinite(spread(k, j))) bonds_[k].push_back(static_cast<std::int32_t>(j));
      std::ranges::stable_sort(bonds_[k], {}, [&](std::int32_t j) { return spread(k, j); });
    }
  }

  // Gives detections of a frame without a label one of a track that has none there.
  void find(std::span<const Point> points, std::span<std::int64_t> labels) {
    std::ranges::fill(at_, nullptr);
    free_.clear();
    for (std::size_t i = 0; i < points.size(); ++i)
      if (labels[i] < 0) free_.push_back(i); else at_[labels[i]] = &points[i];
    lost_.clear();
    for (std::size_t k = 0; k < K_ && !free_.empty(); ++k)
      if (at_[k] == nullptr && !bonds_[k].empty()) lost_.push_back(static_cast<std::int32_t>(k));
    odds_.assign(lost_.size() * free_.size(), kNone);
    for (std::size_t a = 0; a < lost_.size(); ++a) compare(a, points);
    while (const Pair clear = clearest()) {
      const std::int32_t k = lost_[clear.a];
      const std::size_t i = free_[clear.u];
      labels[i] = k;
      at_[k] = &points[i];
      for (std::size_t u = 0; u < free_.size(); ++u) odds(clear.a, u) = kNone;
      for (std::size_t a = 0; a < lost_.size(); ++a)
        if (at_[lost_[a]] == nullptr && std::isfinite(spread(lost_[a], k))) compare(a, points);
      for (std::size_t u = 0; u < free_.size(); ++u)
        if (labels[free_[u]] >= 0)
          for (std::size_t a = 0; a < lost_.size(); ++a) odds(a, u) = kNone;
    }
  }

 private:
  static constexpr std::size_t kBonds = 5, kFree = 4;
  static constexpr double kUnknown = 1.0 / 3;  // spread about a distance, as a share of it
  static constexpr double kEnough = 6, kLead = 3;  // nats; kEnough as for a body that returns
  static constexpr double kNone = -std::numeric_limits<double>::infinity();

  struct Pair {
    std::size_t a = 0, u = 0;
    double odds = kNone;
    explicit operator bool() const { return odds > kNone; }
  };

  double spread(std::size_t k, std::size_t j) const { return spreads_[k * K_ + j]; }
  double& odds(std::size_t a, std::size_t u) { return odds_[a * free_.size() + u]; }

  // Compares a lost track with all free detections.
  void compare(std::size_t a, std::span<const Point> points) {
    const std::size_t k = lost_[a];
    used_.clear();
    for (const std::int32_t j : bonds_[k])
      if (at_[j] != nullptr && used_.size() < kBonds) used_.push_back(j);
    if (used_.empty()) return;
    const auto n = static_cast<double>(std::min(used_.size(), kFree));
    for (std::size_t u = 0; u < free_.size(); ++u) {
      double sum = 0;
      for (const std::int32_t j : used_) {
        const double d = distances_[k * K_ + j], s2 = spread(k, j) * spread(k, j);
        const double off = std::sqrt(squared_distance(points[free_[u]], *at_[j])) - d;
        sum += log_t(off, s2) - log_t(off, s2 + kUnknown * kUnknown * d * d);
      }
      odds(a, u) = sum / static_cast<double>(used_.size()) * n;
    }
  }
  // Log density of Student's t with three degrees of freedom, but for a constant.
  static double log_t(double off, double s2) {
    return -2 * std::log1p(off * off / (3 * s2)) - std::log(s2) / 2;
  }

  // The most probable pair that no other one rivals.
  Pair clearest() {
    Pair best;
    for (std::size_t a = 0; a < lost_.size(); ++a)
      for (std::size_t u = 0; u < free_.size(); ++u)
        if (const double own = odds(a, u); own >= kEnough && own > best.odds && has_lead(a, u))
          best = {a, u, own};
    return best;
  }
  bool has_lead(std::size_t a, std::size_t u) {
    const double least = odds(a, u) - kLead;
    for (std::size_t v = 0; v < free_.size(); ++v)
      if (v != u && odds(a, v) > least) return false;
    for (std::size_t b = 0; b < lost_.size(); ++b)
      if (b != a && odds(b, u) > least) return false;
    return true;
  }

  std::span<const double> distances_, spreads_;
  std::size_t K_ = 0;
  std::vector<std::vector<std::int32_t>> bonds_;  // of each track, the steadiest first
  std::vector<const Point*> at_;  // of each track in the frame
  std::vector<std::size_t> free_;
  std::vector<std::int32_t> lost_, used_;
  std::vector<double> odds_;  // of each lost track and free detection
};

}  // namespace asterism
