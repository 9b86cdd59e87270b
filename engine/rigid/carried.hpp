// Where neighbours carry a marker, and the variance of that place.
//
//   a_k, b_k   neighbour k in the frame in which the marker was seen, and now
//   v_k        predictive variance of its bond, W = Σ 1/v_k
//   R a + t    the rigid motion of the n neighbours (least squares, weights 1/v_k)
//   u          variance of a neighbour about that motion, along an axis: the larger of κ n / W, which
//              bonds expect, and a third of what this one fit leaves beyond the noise of both ends, as
//              it has few degrees of freedom
//   d          R a + t less the weighted mean of the b_k
//   J          their inertia about that mean, Σ (|b'|² 1 - b' b'ᵀ) / v_k
//
//   V = r + u (1 + 1/n) + max(u, r) W/n tr([d]× J⁻¹ [d]×ᵀ) / D
//
// The 1 is the marker itself, which moves about the body as its neighbours do. κ is the squared error
// of earlier places against what was expected of them. Noise alone turns neighbours that are nearly in
// one line, so that the last term holds at least r. Neighbours in one line have no J⁻¹, and too few do
// not determine a rotation. There the marker keeps its offset from the neighbours' mean,
// to a share of that offset.
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
  double variance = std::numeric_limits<double>::infinity();  // of a coordinate of the marker's place

  // Student's t with 3 degrees of freedom, its squared scale the variance: bodies bend, and now and
  // then much, and their neighbours' errors are alike.
  double log_density(const Point& y, int D) const {
    constexpr double freedom = 3;
    return log_unit_peaks()[D] - 0.5 * D * std::log(variance) -
           0.5 * (freedom + D) * std::log1p(squared_distance(y, at, D) / (freedom * variance));
  }

 private:
  // Of a scale of 1, by the number of axes.
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

// What neighbours say of a marker that was at `then`. `pairs` have the weights 1/v_k. `noise`: variance of
// a measured coordinate.
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
    if (D > 1 && pairs.size() >= least_for_rotation(D))
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
  // The one with the smaller variance.
  Carried place(double r, double kappa) const {
    const double V = turned_variance(r, kappa);
    return V < r + offset2_ ? Carried{turned_, V} : Carried{moved_, r + offset2_};
  }

 private:
  static constexpr double kOffset = 0.3;  // share of the distance from the neighbours' mean

  Point turned_{}, moved_{};
  double nearest2_ = std::numeric_limits<double>::infinity(), offset2_ = 0;
  double left_ = 0, expected_ = 0, mean_ = 1, turn_ = std::numeric_limits<double>::infinity();
};

}  // namespace asterism
