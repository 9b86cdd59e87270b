// Predicts the position of an occluded marker from its rigid neighbours, with the variance of that
// position.
//
//   a_k, b_k   position of neighbour k in the frame of the marker's last detection, and now
//   v_k        predictive variance of its bond, W = Σ 1/v_k
//   R a + t    rigid motion of the n neighbours (least squares, weights 1/v_k)
//   u          variance of a neighbour about that motion along an axis: the larger of κ n / W,
//              which follows from the bonds, and a third of the residual of this fit beyond the
//              noise of both ends; only a third, because the fit has few degrees of freedom
//   d          R a + t minus the weighted mean of the b_k
//   J          inertia of the b_k about that mean, Σ (|b'|² 1 - b' b'ᵀ) / v_k
//
//   V = r + u (1 + 1/n) + max(u, r) W/n tr([d]× J⁻¹ [d]×ᵀ) / D
//
// The term 1 is the marker's own motion relative to the segment, which has the variance of its
// neighbours. κ is the ratio of squared errors of earlier predictions to their expected values.
// Measurement noise alone rotates nearly collinear neighbours, so the last term contains at least
// r. The rotation is undetermined for collinear neighbours, where J is singular, and for too few.
// The marker then keeps its offset from the mean of its neighbours, with an error proportional to
// that offset.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numbers>
#include <span>

#include "rigid/rigid_fit.hpp"

namespace asterism {

struct Carried {
  Point at{};
  double variance = std::numeric_limits<double>::infinity();  // per coordinate

  // Student's t distribution with 3 degrees of freedom, whose squared scale is the variance. The
  // heavy tails allow for occasional large deformation and for correlated errors of the neighbours.
  double log_density(const Point& y, int D) const {
    constexpr double freedom = 3;
    return log_unit_peaks()[D] - 0.5 * D * std::log(variance) -
           0.5 * (freedom + D) * std::log1p(squared_distance(y, at, D) / (freedom * variance));
  }

 private:
  // Log density at the mode for a scale of 1, by the number of axes.
  static const std::array<double, 4>& log_unit_peaks() {
    static const std::array<double, 4> peaks = [] {
      std::array<double, 4> all{};
      for (int d = 1; d < 4; ++d)
        all[d] = std::lgamma(0.5 * (3 + d)) - std::lgamma(1.5) - d * 0.5 * std::log(3 * std::numbers::pi);
      return all;
    }();
    return peaks;
  }
};

// The position of a marker that was at `then`, predicted from its neighbours. `pairs` have the
// weights 1/v_k; `noise` is the variance of a measured coordinate.
class RigidPrediction {
 public:
  RigidPrediction(std::span<const RigidPair> pairs, const Point& then, int D, double noise) {
    const RigidFit fit = fit_rigid(pairs, D);
    const auto n = static_cast<double>(pairs.size());
    turned_ = fit(then);
    moved_ = then;
    moved_.r = 0;
    Point arm{};
    for (int d = 0; d < D; ++d) {
      arm[d] = turned_[d] - fit.to[d];
      moved_[d] += fit.to[d] - fit.from[d];
    }
    double all = 0;
    for (const RigidPair& p : pairs) {
      all += p.weight;
      nearest2_ = std::min(nearest2_, squared_distance(p.a, then, D));
    }
    offset2_ = kOffset * kOffset * squared_distance(then, fit.from, D);
    left_ = std::max(fit.rms * fit.rms - 2 * noise, 0.0) / 3;
    expected_ = n / all;
    if (D > 1 && pairs.size() >= min_for_rotation(D))
      turn_ = all / n * turning_variance(pairs, fit.to, arm, D) / D;
    mean_ = 1 + 1 / n;
  }

  bool may_turn() const { return std::isfinite(turn_); }
  const Point& turned() const { return turned_; }
  double turned_variance(double r, double kappa) const {
    const double u = std::max(left_, kappa * expected_);
    return r + u * mean_ + std::max(u, r) * turn_;
  }
  double nearest2() const { return nearest2_; }  // squared distance of the nearest neighbour
  // Returns the prediction with the smaller variance: rotated, or translated only.
  Carried place(double r, double kappa) const {
    const double V = turned_variance(r, kappa);
    return V < r + offset2_ ? Carried{turned_, V} : Carried{moved_, r + offset2_};
  }

 private:
  static constexpr double kOffset = 0.3;  // error of a kept offset as a fraction of its length

  Point turned_{}, moved_{};
  double nearest2_ = std::numeric_limits<double>::infinity(), offset2_ = 0;
  double left_ = 0, expected_ = 0, mean_ = 1, turn_ = std::numeric_limits<double>::infinity();
};

}  // namespace asterism
