// Evidence of the distance between two tracks for the two markers that they may be.
//
//   p(d) = Σ_c w_c t₄(d; g_c D, v_c)      v_c = a_c² + (b_c D)² + u_c B² + v_move
//   v_move = s²/4 + W²/2,  or s² if W is unknown
//
//   d, s      median and spread of the distance between the tracks, metres
//   D, W, B   distance of the markers in the marker set, its variation by movement within a
//             subject, and between subjects
//   t₄        density of Student's t with four degrees of freedom, location and scale √v
//   g         1, or the size of the subject relative to the marker set
//
// The four components: the markers were kept in place since the set was learnt; they were attached
// again, or the subject is another; the body is in another posture; the distance is loose. A
// marker set of a single posture does not know which pairs are rigid (W is NaN). Then near pairs
// count as rigid rather than far ones.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

namespace asterism {

inline constexpr int kFits = 4;
using FitWeights = std::array<double, kFits>;

struct FitKind {
  double fixed, share;  // a, b
  bool is_scaled, varies;
};
inline constexpr std::array<FitKind, kFits> kFitKinds{{
    {0.004, 0.01, false, false},
    {0.008, 0.05, true, true},
    {0.03, 0.15, true, true},
    {0.05, 0.40, true, true},
}};
inline constexpr double kRange = 2.0;       // range of the distances of wrong pairs, metres
inline constexpr double kNear = 0.3;        // distance up to which markers share a segment, metres
inline constexpr double kFarShare = 0.15;   // weight of the rigid components for far pairs
inline constexpr double kLooseShare = 0.1;  // weight of the loose component if W is known
inline constexpr double kMinOdds = -4, kMaxOdds = 6;
// Distances that vary by movement or between subjects vary together with those of their neighbours,
// so that each counts less. Spread at which one counts half as much, metres, and the least weight.
inline constexpr double kLooseSpread = 0.012, kMinWeight = 0.25;

inline double loose_weight(double variance) {
  return kMinWeight + (1 - kMinWeight) / (1 + variance / (kLooseSpread * kLooseSpread));
}

// Weights of the four components for a pair of markers at distance d.
inline FitWeights weights_at(const FitWeights& weights, double d, bool knows_movement) {
  FitWeights out = weights;
  if (knows_movement) {
    out[3] *= kLooseShare;
    return out;
  }
  const double near = std::exp(-d * d / (kNear * kNear));
  for (const int c : {0, 1}) out[c] *= kFarShare + (1 - kFarShare) * near;
  for (const int c : {2, 3}) out[c] *= 1 + 2 * (1 - near);
  return out;
}

// Bounded log odds of a distance whose probability density is `density`, against a uniform
// distribution over kRange.
inline float bounded_log_odds(float density) {
  constexpr float kMinRatio = 0.0183f;  // below exp(kMinOdds): most pairs need no logarithm
  const float ratio = density * static_cast<float>(kRange);
  if (ratio < kMinRatio) return static_cast<float>(kMinOdds);
  return std::clamp(std::log(ratio), static_cast<float>(kMinOdds), static_cast<float>(kMaxOdds));
}

// What the density of a distance needs of all pairs of M markers.
class PairDensities {
 public:
  // distance, movement, variation: (M, M), NaN where unknown.
  PairDensities(std::int32_t M, std::span<const double> distance, std::span<const double> movement,
                std::span<const double> variation, double size)
      : M_(M), known_(distance.size()) {
    for (int c = 0; c < kFits; ++c) {
      const FitKind& kind = kFitKinds[c];
      location_[c].resize(distance.size());
      variance_[c].resize(distance.size());
      for (std::size_t i = 0; i < distance.size(); ++i) {
        const double a = kind.fixed, b = kind.share * distance[i], W = movement[i];
        known_[i] = !std::isnan(W);
        location_[c][i] = static_cast<float>((kind.is_scaled ? size : 1) * distance[i]);
        variance_[c][i] =
            static_cast<float>(a * a + b * b + (kind.varies ? variation[i] * variation[i] : 0) +
                               (known_[i] > 0 ? W * W / 2 : 0));
      }
    }
  }

  // Writes the densities of a distance d of spread s for marker a and every other one.
  void densities(std::int32_t a, double d, double s, const FitWeights& known,
                 const FitWeights& unknown, float* out) const {
    const std::size_t row = static_cast<std::size_t>(a) * M_;
    const float squared = static_cast<float>(s * s), distance = static_cast<float>(d);
    for (std::int32_t b = 0; b < M_; ++b) out[b] = 0;
    for (int c = 0; c < kFits; ++c) {
      const float *location = location_[c].data() + row, *variance = variance_[c].data() + row;
      const float* is_known = known_.data() + row;
      const auto with = static_cast<float>(0.375 * known[c]);
      const auto without = static_cast<float>(0.375 * unknown[c]);
      for (std::int32_t b = 0; b < M_; ++b) {
        const float v = variance[b] + squared * (is_known[b] > 0 ? 0.25f : 1.0f);
        const float off = distance - location[b], y = 1 + off * off / (4 * v);
        out[b] += (is_known[b] > 0 ? with : without) / (std::sqrt(v * y) * y * y);
      }
    }
  }

 private:
  std::int32_t M_;
  std::vector<float> known_;  // 1 or 0: whether the movement is known
  std::array<std::vector<float>, kFits> location_, variance_;
};

}  // namespace asterism
