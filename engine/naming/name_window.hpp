// Tracks in the last frames of a stream, and the names that they should have.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "naming/window_scores.hpp"

namespace asterism {

class NameWindow {
 public:
  // positions: (F, A, 3), NaN without a detection; marker: of each track, -1 for none.
  NameWindow(std::int32_t F, std::vector<double> positions, std::vector<std::int32_t> marker,
             const NeighbourTables& tables)
      : F_(F), positions_(std::move(positions)), marker_(std::move(marker)), tables_(tables),
        holder_(tables.M, -1) {
    for (std::int32_t k = 0; k < n_tracks(); ++k)
      if (marker_[k] >= 0) holder_[marker_[k]] = k;
  }

  // The track that is examined in this turn, of those with a name and of those without one that
  // exist in all frames; -1 for none, and without two tracks, between which there is a distance.
  std::int32_t turn_of_named(std::int64_t turn) const {
    return in_turn(turn, [&](std::int32_t k) { return marker_[k] >= 0; });
  }
  std::int32_t turn_of_new(std::int64_t turn) const {
    return in_turn(turn, [&](std::int32_t k) { return marker_[k] < 0 && is_whole(k); });
  }
  std::int32_t marker(std::int32_t k) const { return marker_[k]; }
  std::int32_t holder(std::int32_t m) const { return holder_[m]; }
  std::int32_t n_tracks() const { return static_cast<std::int32_t>(marker_.size()); }
  std::int32_t n_markers() const { return tables_.M; }

  struct Choice {
    std::int32_t marker;
    double gain, probability;
  };

  // The best marker that no track has, its lead in log odds over others and over no name, and its
  // probability.
  Choice best_free(std::int32_t k, double none, double temperature) const {
    std::vector<double> odds = scores(k);
    for (std::int32_t m = 0; m < tables_.M; ++m)
      if (holder_[m] >= 0) odds[m] = kTaken;
    const auto best = std::ranges::max_element(odds);
    const double score = *best;
    *best = none;
    double others = 0;
    for (const double x : odds) others += std::exp((x - score) / temperature);
    return {static_cast<std::int32_t>(best - odds.begin()), score - std::ranges::max(odds),
            1 / (1 + others)};
  }

  // The marker that a named track should have, -1 for none, and what that would gain if a holder of
  // that marker got the name of the track.
  Choice better(std::int32_t k, double none) const {
    const std::vector<double> odds = scores(k);
    const std::int32_t own = marker_[k];
    const auto m = static_cast<std::int32_t>(std::ranges::max_element(odds) - odds.begin());
    if (odds[m] < none) return {-1, none - odds[own], 0};
    double gain = odds[m] - odds[own];
    if (m != own && holder_[m] >= 0) {
      const std::vector<double> back = scores(holder_[m]);
      gain += back[own] - back[m];
    }
    return {m, gain, 0};
  }

 private:
  std::vector<double> scores(std::int32_t k) const {
    std::vector<double> out(tables_.M);
    window_scores(positions_, F_, n_tracks(), {&k, 1}, holder_, tables_, out);
    return out;
  }

  bool is_whole(std::int32_t k) const {
    for (std::int32_t f = 0; f < F_; ++f)
      if (std::isnan(positions_[3 * (static_cast<std::size_t>(f) * n_tracks() + k)])) return false;
    return true;
  }

  template <typename Condition>
  std::int32_t in_turn(std::int64_t turn, Condition&& condition) const {
    std::vector<std::int32_t> found;
    if (n_tracks() < 2) return -1;
    for (std::int32_t k = 0; k < n_tracks(); ++k)
      if (condition(k)) found.push_back(k);
    return found.empty() ? -1 : found[static_cast<std::size_t>(turn) % found.size()];
  }

  static constexpr double kTaken = -99;

  std::int32_t F_;
  std::vector<double> positions_;
  std::vector<std::int32_t> marker_;
  NeighbourTables tables_;
  std::vector<std::int32_t> holder_;  // track of each marker, -1 for none
};

// Adds the distances between markers in a frame to their number, sum and sum of squares, (3, M, M).
// pose: (M, 3), NaN without a detection.
inline void add_distances(std::span<const double> pose, std::span<double> sums) {
  const std::size_t M = pose.size() / 3;
  for (std::size_t i = 0; i < M; ++i) {
    const double* p = pose.data() + 3 * i;
    if (std::isnan(p[0])) continue;
    double* row = sums.data() + i * M;
    for (std::size_t j = 0; j < M; ++j) {
      const double *q = pose.data() + 3 * j, x = p[0] - q[0], y = p[1] - q[1], z = p[2] - q[2];
      const double squared = x * x + y * y + z * z;
      if (std::isnan(squared)) continue;
      row[j] += 1;
      row[M * M + j] += std::sqrt(squared);
      row[2 * M * M + j] += squared;
    }
  }
}

}  // namespace asterism
