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

// Bounded log odds of the distance against a uniform distribution over kRange.
inline float distance_log_odds(double d, double s, double D, double W, double B, double size,
                               const FitWeights& known, const FitWeights& unknown) {
  const bool knows_movement = !std::isnan(W);
  const FitWeights& w = knows_movement ? known : unknown;
  const float move = static_cast<float>(knows_movement ? s * s / 4 + W * W / 2 : s * s);
  float density = 0;
  for (int c = 0; c < kFits; ++c) {
    const FitKind& kind = kFitKinds[c];
    const double a = kind.fixed, b = kind.share * D;
    const float v = static_cast<float>(a * a + b * b + (kind.varies ? B * B : 0)) + move;
    const float off = static_cast<float>(d - (kind.is_scaled ? size : 1) * D);
    const float y = 1 + off * off / (4 * v);
    density += static_cast<float>(w[c]) * 0.375f / (std::sqrt(v * y) * y * y);
  }
  const float odds = std::log(density * static_cast<float>(kRange) + 1e-9f);
  return std::clamp(odds, static_cast<float>(kMinOdds), static_cast<float>(kMaxOdds));
}

}  // namespace asterism
