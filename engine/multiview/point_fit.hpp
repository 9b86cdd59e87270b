// Fits a point in space to image points of several cameras: its position, information and score.
//
//   X, Λ     position and its information, Σ Jᵀ W J
//   r²       squared distance of an image point from the projection of X, in standard deviations
//   score    log-likelihood ratio of "one point, of density ρ" against "clutter", with the position
//            integrated out (Laplace); ρ is higher at expected positions:
//            log ρ + log((2π)^{3/2} |Λ|^{-1/2}) + Σ_seen (log(P_d / (λ 2πσ²)) - r²/2)
//              + Σ_{could see, did not} log(1 - P_d)
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

#include "multiview/image_points.hpp"

namespace asterism {

struct View {
  std::int32_t camera, point;  // index in `ImagePoints::points`
  bool operator==(const View&) const = default;
};

struct PointCandidate {
  std::vector<View> views;  // ordered by camera
  Vec3 X{};
  Symmetric3 information;
  double squared = 0;  // Σ r²
  double score = 0;
};

// An expected position from a tracker: an isotropic Gaussian.
struct ExpectedPlace {
  Vec3 X;
  double variance;
};

class PointFit {
 public:
  // `log_density`: log ρ, points per m³. In addition, each expected position may have a point.
  PointFit(std::span<const ImagePoints> cameras, double log_density,
           std::span<const ExpectedPlace> expected)
      : cameras_(cameras), log_density_(log_density), expected_(expected) {}

  // Optimises the position of a candidate by Gauss–Newton from its present one. Returns false on
  // failure.
  bool fit(PointCandidate& c) const {
    for (int round = 0; round < 8; ++round) {
      Symmetric3 A;
      Vec3 g{0, 0, 0};
      c.squared = 0;
      for (const View v : c.views) {
        const ImagePoints& camera = cameras_[v.camera];
        const ImagePoint& p = camera.points[v.point];
        const ProjectedPlace s = camera.project(c.X);
        if (!(s.depth > 0)) return false;
        add(p, s, A, g);
        c.squared += p.squared({p.n.x - s.n.x, p.n.y - s.n.y});
      }
      if (!is_regular(A)) return false;
      const Vec3 step = A.inverse() * g;
      c.information = A;
      c.X = c.X + step;
      const double gained = dot(step, g);  // first-order decrease of the squared residuals
      if (!std::isfinite(gained)) return false;
      if (gained < 1e-4) {
        c.squared = std::max(c.squared - gained, 0.0);
        return true;
      }
    }
    return false;
  }
  // Computes the information of a seed's position. Returns false if its two rays do not determine
  // the depth.
  bool inform(PointCandidate& c) const {
    Vec3 g{0, 0, 0};
    for (const View v : c.views) {
      const ProjectedPlace s = cameras_[v.camera].project(c.X);
      if (!(s.depth > 0)) return false;
      add(cameras_[v.camera].points[v.point], s, c.information, g);
    }
    if (!is_regular(c.information)) return false;
    c.X = c.X + c.information.inverse() * g;
    return true;
  }
  // One Gauss–Newton step for a new view, projected to `s`; the other views are at their minimum.
  static void step(PointCandidate& c, const ImagePoint& p, const ProjectedPlace& s) {
    Vec3 g{0, 0, 0};
    add(p, s, c.information, g);
    c.X = c.X + c.information.inverse() * g;
  }

  double squared_of(const PointCandidate& c, View v) const {
    const ImagePoints& camera = cameras_[v.camera];
    const ProjectedPlace s = camera.project(c.X);
    const ImagePoint& p = camera.points[v.point];
    return p.squared({p.n.x - s.n.x, p.n.y - s.n.y});
  }
  double score(const PointCandidate& c) const {
    double s = log_density(c) + 1.5 * kLogTwoPi -
               0.5 * std::log(c.information.determinant()) - c.squared / 2;
    for (const View v : c.views) s += cameras_[v.camera].points[v.point].gain;
    if (s <= 0) return s;  // missing views only lower it
    std::size_t at = 0;
    for (std::size_t k = 0; k < cameras_.size() && s > 0; ++k) {
      if (at < c.views.size() && c.views[at].camera == static_cast<std::int32_t>(k))
        ++at;
      else if (cameras_[k].could_see(c.X))
        s += cameras_[k].sense.miss;
    }
    return s;
  }

 private:
  static constexpr double kLogTwoPi = 1.8378770664093453;
  static constexpr double kThere = 0.9;  // probability that an expected point exists
  static constexpr double kFar = 6;      // standard deviations

  // log of ρ + Σ 0.9 N(X; expected position, its variance + Λ⁻¹), with the position integrated out.
  double log_density(const PointCandidate& c) const {
    if (expected_.empty()) return log_density_;
    const Symmetric3 own = c.information.inverse();
    double sum = std::exp(log_density_);
    for (const ExpectedPlace& e : expected_) {
      const Vec3 off{c.X.x - e.X.x, c.X.y - e.X.y, c.X.z - e.X.z};
      if (dot(off, off) > kFar * kFar * (e.variance + own.trace())) continue;
      Symmetric3 S = own;
      S.xx += e.variance, S.yy += e.variance, S.zz += e.variance;
      const double squared = dot(off, S.inverse() * off);
      sum += kThere * std::exp(-1.5 * kLogTwoPi - 0.5 * std::log(S.determinant()) - squared / 2);
    }
    return std::log(sum);
  }
  static void add(const ImagePoint& p, const ProjectedPlace& s, Symmetric3& A, Vec3& g) {
    const double ex = p.n.x - s.n.x, ey = p.n.y - s.n.y;
    A.add(s.jx, p.wxx), A.add(s.jy, p.wyy), A.add(s.jx, s.jy, p.wxy);
    g = g + (p.wxx * ex + p.wxy * ey) * s.jx + (p.wxy * ex + p.wyy * ey) * s.jy;
  }
  static bool is_regular(const Symmetric3& A) {
    const double size = A.trace();
    return A.determinant() > 1e-12 * size * size * size;
  }

  std::span<const ImagePoints> cameras_;
  double log_density_;
  std::span<const ExpectedPlace> expected_;
};

}  // namespace asterism
