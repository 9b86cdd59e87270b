// Where its neighbours carry a hidden marker, as a Gaussian whose variance is meant: least squares with
// the variances of its bonds, and what the geometry makes of them.
//
//   a_k, b_k  neighbour k in the frame in which the marker was at a, and now
//   v_k       variance of b_k about R a_k + t, along an axis; W = Σ 1/v_k
//   d         R a + t less the weighted mean of the b_k
//   J         their inertia, Σ (|b'|² 1 - b' b'ᵀ) / v_k about that mean
//
//   V = r + κ s² (1/W + tr([d]× J⁻¹ [d]×ᵀ) / D)     s² = max(1, χ² of the fit / its freedom)
//
// κ is how far off such places were in the past, against what was expected of them.
//
// A covariance that is not the same along all axes is shared out evenly among them, as everywhere here.
// Neighbours in one line have no J⁻¹, and fewer than determine a rotation have none to tell: there the
// marker keeps its offset, with the variance that this offset was seen to have.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <span>

#include "rigid/rigid_fit.hpp"

namespace asterism {

struct CarriedPlace {
  Point at{};
  double variance = std::numeric_limits<double>::infinity();  // of a coordinate of the marker's place
};

// `pairs` have the weights 1/v_k, the steadiest first. `r`: of a measured coordinate. `shifted`: what
// the offset from that first one changes by, squared, along an axis.
inline CarriedPlace carried_place(std::span<const RigidPair> pairs, const Point& then, int D, double r,
                                  double kappa, double shifted) {
  CarriedPlace kept{then, shifted};
  for (int d = 0; d < D; ++d) kept.at[d] += pairs.front().b[d] - pairs.front().a[d];
  kept.at.r = 0;
  if (D < 2 || pairs.size() < least_for_rotation(D)) return kept;
  const RigidFit fit = fit_rigid(pairs, D);
  double all = 0;
  for (const RigidPair& p : pairs) all += p.weight;
  CarriedPlace out{fit(then), 0};
  Point arm{};
  for (int d = 0; d < D; ++d) arm[d] = out.at[d] - fit.to[d];
  const double left = fit.rms * fit.rms * all / static_cast<double>(pairs.size());
  out.variance = r + kappa * std::max(left, 1.0) *
                         (1 / all + turning_variance(pairs, fit.to, arm, D) / D);
  return out.variance < kept.variance ? out : kept;
}

}  // namespace asterism
