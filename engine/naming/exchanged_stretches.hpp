// Stretches of frames in which two tracks have each other's marker, found by their distances to
// near tracks: an exchange in the right stretch makes these distances steadier.
//
//   gain of a stretch = mean over both tracks and all near tracks of log s - log s'
//
//   s, s'   spread of a distance in all frames, as it is and with both tracks exchanged in the
//           stretch
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <numeric>
#include <span>
#include <tuple>
#include <utility>
#include <vector>

namespace asterism {

// Largest gain, and the first frame of the stretch and the one after its last.
struct SteadiestStretch {
  double gain = -std::numeric_limits<double>::infinity();
  std::int32_t first = 0, end = 0;
};

class ExchangedStretches {
 public:
  // positions: (F, K, 3), NaN without a detection. `min_frames` is the smallest number of frames of
  // a stretch, of the rest, and of a distance in each.
  ExchangedStretches(std::span<const double> positions, std::int32_t F, std::int32_t K,
                     std::int32_t min_frames)
      : F_(F), K_(K), min_frames_(min_frames), distance_(static_cast<std::size_t>(K) * K * F),
        n_common_(static_cast<std::size_t>(K) * K),
        middle_(n_common_.size(), std::numeric_limits<double>::infinity()),
        spread_(n_common_.size()) {
    for (std::int32_t i = 0; i < K; ++i)
      for (std::int32_t j = i + 1; j < K; ++j) measure(positions, i, j);
  }

  // Pairs of tracks with the stretch in which they are exchanged (first frame, and the one after
  // the last), the largest gain first; each track in one pair only.
  std::vector<std::tuple<std::int32_t, std::int32_t, std::int32_t, std::int32_t>> found() {
    std::vector<std::tuple<double, std::int32_t, std::int32_t, std::int32_t, std::int32_t>> all;
    for (std::int32_t a = 0; a < K_; ++a)
      for (std::int32_t b = a + 1; b < K_; ++b) {
        if (!(middle_[at(a, b)] < kMaxDistance) || !has_neighbours(a, b)) continue;
        const SteadiestStretch best = steadiest(a, b);
        if (best.gain > kMinGain) all.emplace_back(best.gain, a, b, best.first, best.end);
      }
    std::ranges::sort(all, std::greater<>());
    std::vector<std::tuple<std::int32_t, std::int32_t, std::int32_t, std::int32_t>> result;
    std::vector<char> is_done(K_, 0);
    for (const auto& [gain, a, b, first, end] : all) {
      if (is_done[a] || is_done[b]) continue;
      is_done[a] = is_done[b] = 1;
      result.emplace_back(a, b, first, end);
    }
    return result;
  }

 private:
  std::size_t at(std::int32_t i, std::int32_t j) const {
    return static_cast<std::size_t>(i) * K_ + j;
  }
  const double* series(std::int32_t i, std::int32_t j) const {
    return distance_.data() + at(i, j) * F_;
  }

  void measure(std::span<const double> positions, std::int32_t i, std::int32_t j) {
    known_.clear();
    for (std::int32_t f = 0; f < F_; ++f) {
      const double *p = positions.data() + 3 * (static_cast<std::size_t>(f) * K_ + i),
                   *q = positions.data() + 3 * (static_cast<std::size_t>(f) * K_ + j);
      const double x = p[0] - q[0], y = p[1] - q[1], z = p[2] - q[2];
      const double d = std::sqrt(x * x + y * y + z * z);
      distance_[at(i, j) * F_ + f] = distance_[at(j, i) * F_ + f] = d;
      if (!std::isnan(d)) known_.push_back(d);
    }
    const std::size_t n = known_.size();
    n_common_[at(i, j)] = n_common_[at(j, i)] = static_cast<std::int32_t>(n);
    if (n < static_cast<std::size_t>(2 * min_frames_)) return;
    const double mean = std::accumulate(known_.begin(), known_.end(), 0.0) / static_cast<double>(n);
    double squares = 0;
    for (const double d : known_) squares += (d - mean) * (d - mean);
    const auto half = known_.begin() + static_cast<std::ptrdiff_t>(n / 2);
    std::nth_element(known_.begin(), half, known_.end());
    const double below = n % 2 ? *half : *std::max_element(known_.begin(), half);
    middle_[at(i, j)] = middle_[at(j, i)] = (below + *half) / 2;
    spread_[at(i, j)] = spread_[at(j, i)] = std::sqrt(squares / static_cast<double>(n));
  }

  // Lists the near tracks that exist beside both; false if they are few, or all distances steady.
  bool has_neighbours(std::int32_t a, std::int32_t b) {
    near_.clear();
    for (std::int32_t c = 0; c < K_; ++c) {
      const double far = std::max(middle_[at(a, c)], middle_[at(b, c)]);
      const std::int32_t n = std::min(n_common_[at(a, c)], n_common_[at(b, c)]);
      if (std::isfinite(far) && n >= kMinCommon * n_common_[at(a, b)]) near_.emplace_back(far, c);
    }
    std::ranges::sort(near_);
    near_.resize(std::min(near_.size(), kNeighbours));
    return near_.size() >= kMinNeighbours && std::ranges::any_of(near_, [&](const auto& one) {
      return std::max(spread_[at(a, one.second)], spread_[at(b, one.second)]) >= kMinSpread;
    });
  }

  // Sums over the frames before each frame, of one near track: frames with both distances, and what
  // an exchange adds to the distances of the first track and to their squares.
  struct Sums {
    double n, move, squares;
  };
  // The same in all frames, with the sums of the distances x and y of both tracks.
  struct Column {
    double n = 0, x = 0, y = 0, x2 = 0, y2 = 0, share = 0;  // share: 1 / n

    double spreads(const Sums& moved) const {
      return variance(x + moved.move, x2 + moved.squares) *
             variance(y - moved.move, y2 - moved.squares);
    }
    double variance(double sum, double squares) const {
      const double mean = sum * share;
      return std::max(squares * share - mean * mean, 0.0) + kNoise * kNoise;
    }
  };

  SteadiestStretch steadiest(std::int32_t a, std::int32_t b) {
    const std::size_t C = near_.size();
    std::vector<Column> columns(C);
    std::vector<Sums> sums(C * (F_ + 1), {0, 0, 0});  // (F + 1, C)
    for (std::size_t c = 0; c < C; ++c) {
      const double *x = series(a, near_[c].second), *y = series(b, near_[c].second);
      Column& own = columns[c];
      for (std::int32_t f = 0; f < F_; ++f) {
        Sums next = sums[f * C + c];
        if (!std::isnan(x[f]) && !std::isnan(y[f])) {
          const double a2 = x[f] * x[f], b2 = y[f] * y[f];
          next = {next.n + 1, next.move + (y[f] - x[f]), next.squares + (b2 - a2)};
          own = {own.n + 1, own.x + x[f], own.y + y[f], own.x2 + a2, own.y2 + b2, 0};
        }
        sums[(f + 1) * C + c] = next;
      }
    }
    // One logarithm of the product of all variances, of which there are at most 16 above kNoise².
    for (Column& own : columns) own.share = 1 / own.n;
    double least = std::numeric_limits<double>::infinity();
    SteadiestStretch best;
    for (std::int32_t first = 0; first < F_; ++first)
      for (std::int32_t end = first + min_frames_; end <= F_; ++end) {
        const Sums *from = &sums[first * C], *to = &sums[end * C];
        bool is_long = true;
        for (std::size_t c = 0; c < C; ++c) {
          const double inside = to[c].n - from[c].n;
          is_long &= std::min(inside, columns[c].n - inside) >= min_frames_;
        }
        if (!is_long) continue;
        double product = 1;
        for (std::size_t c = 0; c < C; ++c)
          product *= columns[c].spreads(
              {0, to[c].move - from[c].move, to[c].squares - from[c].squares});
        if (product < least) least = product, best.first = first, best.end = end;
      }
    double before = 1;
    for (const Column& own : columns) before *= own.spreads({0, 0, 0});
    best.gain = (std::log(before) - std::log(least)) / (4 * static_cast<double>(C));
    return best;
  }

  static constexpr std::size_t kNeighbours = 8, kMinNeighbours = 3;
  static constexpr double kMaxDistance = 0.3;  // of two tracks that may be exchanged, metres
  static constexpr double kNoise = 0.005;      // spread of a distance that never changes, metres
  // Smallest share of the frames with both tracks in which a near track exists too.
  static constexpr double kMinCommon = 0.7;
  static constexpr double kMinSpread = 0.015;  // of some distance of exchanged tracks, metres
  static constexpr double kMinGain = 0.3;      // spreads are then 0.74 of what they were

  std::int32_t F_, K_, min_frames_;
  std::vector<double> distance_;       // (K, K, F), NaN without a detection of both
  std::vector<std::int32_t> n_common_;  // (K, K)
  std::vector<double> middle_, spread_;  // (K, K); the median is infinite for too few frames
  std::vector<double> known_;
  std::vector<std::pair<double, std::int32_t>> near_;
};

}  // namespace asterism
