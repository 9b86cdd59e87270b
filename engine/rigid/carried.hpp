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
#include <cstdint>
#include <limits>
#include <iterator>
#include <numbers>
#include <span>

#include "rigid/rigid_fit.hpp"

namespace asterism {

struct Carried {
  Point at{};
  double variance = std::numeric_limits<double>::infinity();  // per coordinate

  bool operator==(const Carried&) const = default;

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

// The position of a marker that was at some point, predicted from its neighbours.
class RigidPrediction {
 public:
  bool may_turn() const { return std::isfinite(turn_); }
  const Point& turned() const { return turned_; }
  double turned_variance(double r, double kappa) const {
    const double u = std::max(left_, kappa * expected_);
    return r + u * mean_ + std::max(u, r) * turn_;
  }
  double nearest2() const { return nearest2_; }  // squared distance of the nearest neighbour
  std::int32_t n_neighbours() const { return n_; }
  // Returns the prediction with the smaller variance: rotated, or translated only.
  Carried place(double r, double kappa) const {
    const double V = turned_variance(r, kappa);
    return V < r + offset2_ ? Carried{turned_, V} : Carried{moved_, r + offset2_};
  }

 private:
  friend class RigidPredictions;

  Point turned_{}, moved_{};
  double nearest2_ = 0, offset2_ = 0, left_ = 0, expected_ = 0, mean_ = 1, turn_ = 0;
  std::int32_t n_ = 0;
};

// Computes predictions four at a time.
class RigidPredictions {
 public:
  // Calls use(item, prediction) for each of some items. `pairs_of(item, then)` returns the pairs of
  // an item, with the weights 1/v_k, and sets the point where its marker was. Items without pairs
  // are left out. `noise` is the variance of a measured coordinate.
  template <typename Items, typename PairsOf, typename Use>
  void each(int D, double noise, Items&& items, PairsOf&& pairs_of, Use&& use) {
    std::array<decltype(&*std::begin(items)), kLanes> waiting{};
    Point then;
    const auto use_waiting = [&] {
      if (pairs_.n_lanes() > 0) solve(D, noise);
      for (std::size_t lane = 0; lane < pairs_.n_lanes(); ++lane) use(*waiting[lane], found_[lane]);
      pairs_.clear();
    };
    for (auto& item : items) {
      const std::span<const RigidPair> pairs = pairs_of(item, then);
      if (pairs.empty()) continue;
      waiting[pairs_.n_lanes()] = &item;
      add(pairs, then);
      if (pairs_.n_lanes() == kLanes) use_waiting();
    }
    use_waiting();
  }

 private:
  void add(std::span<const RigidPair> pairs, const Point& then);
  // Predicts in all lanes.
  void solve(int D, double noise);

  rigid::LanePairs pairs_;
  rigid::LanePoint then_{};
  std::array<RigidPrediction, kLanes> found_;
};

// The rigid motion between two point sets.
struct RigidFit {
  std::array<double, 9> R{};
  Point from{}, to{};
  double rms = 0;
};
RigidFit fit_rigid(std::span<const RigidPair> pairs, int D);

}  // namespace asterism
