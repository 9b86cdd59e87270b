// Exchanges of two tracks over runs of frames, the most probable of each pair.
//
// Two tracks that are exchanged for some frames fit each other in each of them: their motion is
// that of the neighbours, which are exchanged too. All frames of a pair are therefore decided at
// once, given all other tracks. Motion at a frame depends on two detections before and after it,
// and the Viterbi algorithm finds the exact maximum over the states of four successive frames.
//
//   x_n     whether the tracks are exchanged in frame n of those in which one of them is
//   score   Σ_n x_n distances_n + motion_n(x_n-2 … x_n+2) - change at each start of a run,
//           relative to none exchanged
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdlib>
#include <limits>
#include <tuple>
#include <vector>

#include "confidence/assignment_score.hpp"

namespace asterism {

class RunExchanges {
 public:
  explicit RunExchanges(AssignmentScore& score) : score_(score) {}

  void run() {
    for (std::int64_t a = 0; a < score_.n_tracks(); ++a)
      for (std::int64_t b = a + 1; b < score_.n_tracks(); ++b)
        if (collect(a, b)) decide(a, b);
  }

 private:
  static constexpr unsigned kStates = 16;
  static constexpr double kMaxLoss = 3;  // by distances, of a frame that may be exchanged
  static constexpr double kImpossible = -std::numeric_limits<double>::infinity();

  // A frame in which one of the two tracks is, or both.
  struct Frame {
    std::int64_t t = 0;
    std::array<std::int32_t, 2> point{-1, -1};
    double gain = kImpossible;  // of an exchange, by distances
  };

  // Returns whether the tracks can be exchanged in any frame.
  bool collect(std::int64_t a, std::int64_t b) {
    frames_.clear();
    bool is_possible = false;
    for (std::int64_t t = 0; t < score_.n_frames(); ++t) {
      Frame one{t, {score_.at(t, a), score_.at(t, b)}};
      if (one.point[0] < 0 && one.point[1] < 0) continue;
      if (score_.is_near(t, a) && score_.is_near(t, b)) one.gain = by_distances(one, a, b);
      is_possible |= one.gain > kImpossible;
      frames_.push_back(one);
    }
    return is_possible;
  }
  double by_distances(const Frame& one, std::int64_t a, std::int64_t b) {
    const auto [i, j] = one.point;
    const auto is_open = score_.all().is_open;
    if ((i >= 0 && !is_open[i]) || (j >= 0 && !is_open[j])) return kImpossible;
    double gain = 0;
    if (i >= 0) gain -= score_.own_distances(one.t, i, b);
    if (j >= 0) gain -= score_.own_distances(one.t, j, a);
    if (gain == -kImpossible) return kImpossible;
    const double most = score_.max_distances(b);
    if (j >= 0) gain += score_.distances(one.t, j, a, b, -kMaxLoss - gain - most);
    if (gain + most <= -kMaxLoss) return kImpossible;
    if (i >= 0) gain += score_.distances(one.t, i, b, a, -kMaxLoss - gain);
    return gain > -kMaxLoss ? gain : kImpossible;
  }

  // Exchanges the tracks in the best frames.
  void decide(std::int64_t a, std::int64_t b) {
    const std::size_t n = frames_.size();
    from_.resize(n + 2);
    std::array<double, kStates> best{}, next{};
    best.fill(kImpossible);
    best[0] = 0;
    // A state holds the last four frames, the newest in the lowest bit.
    for (std::size_t m = 0; m < n + 2; ++m) {
      next.fill(kImpossible);
      double unchanged = 0;
      bool is_known = false;
      for (unsigned state = 0; state < kStates; ++state) {
        if (best[state] == kImpossible) continue;
        for (const unsigned x : {0U, 1U}) {
          if (x == 1 && (m >= n || frames_[m].gain == kImpossible)) continue;
          const unsigned window = 2 * state + x, to = window % kStates;
          double score = best[state];
          if (x == 1) score += frames_[m].gain - (state % 2 == 0 ? score_.all().change : 0);
          if (window != 0 && m >= 2) {
            if (!is_known) unchanged = motion(m - 2, 0, a, b);
            is_known = true;
            score += motion(m - 2, window, a, b) - unchanged;
          }
          if (score > next[to]) {
            next[to] = score;
            from_[m][to] = state;
          }
        }
      }
      best = next;
    }
    unsigned state = 0;
    for (const unsigned end : {4U, 8U, 12U})
      if (best[end] > best[state]) state = end;
    for (std::size_t m = n + 2; m-- > 0; state = from_[m][state])
      if (m < n && state % 2 == 1) {
        const auto& [t, point, gain] = frames_[m];
        score_.put(t, a, point[1]);
        score_.put(t, b, point[0]);
      }
  }

  // Motion of both tracks at frame n, exchanged in the frames around it as the bits of a window
  // say, the newest in the lowest.
  double motion(std::size_t n, unsigned window, std::int64_t a, std::int64_t b) const {
    double sum = 0;
    for (const unsigned side : {0U, 1U}) {
      const auto point = [&](std::size_t m) {
        return frames_[m].point[side ^ (window >> (n + 2 - m) & 1U)];
      };
      if (point(n) < 0) continue;
      NearDetections around;
      for (std::size_t m = n < 2 ? 0 : n - 2; m < std::min(n + 3, frames_.size()); ++m) {
        const std::int64_t gap = frames_[m].t - frames_[n].t;
        if (m != n && point(m) >= 0 && std::abs(gap) <= score_.all().max_gap)
          around.add(point(m), gap);
      }
      sum += score_.motion(point(n), score_.between(side == 0 ? a : b, around));
    }
    return sum;
  }

  AssignmentScore& score_;
  // Of the two tracks.
  std::vector<Frame> frames_;
  std::vector<std::array<unsigned, kStates>> from_;  // best state before each
};

}  // namespace asterism
