// The image points of one camera in one frame, undistorted once for all uses.
//
//   n = (x, y)   normalised coordinates, X_c / Z_c and Y_c / Z_c
//   D            derivative of the pixel by n, at the point
//   W            information of n: Dᵀ D / σ², so that eᵀ W e is the squared distance in pixels over
//                σ², to first order in the distance
//   J            derivative of n by the world coordinates of a position
#pragma once

#include <span>
#include <vector>

#include "camera/camera.hpp"
#include "math/symmetric3.hpp"

namespace asterism {

// The image model of a camera. Densities are per pixel².
struct ImageSense {
  double sigma;  // px, each axis
  double gain;   // gain of a view in the log-likelihood ratio of a point, without its distance
  double miss;   // log probability of no view where the camera could see the point

  // `clutter`: density of false image points.
  ImageSense(double sigma_px, double p_detection, double clutter)
      : sigma(sigma_px),
        gain(std::log(p_detection / (clutter * 6.283185307179586 * sigma_px * sigma_px))),
        miss(std::log1p(-p_detection)) {}
};

struct ImagePoint {
  Plane n;
  double wxx, wxy, wyy;  // W
  double vxx, vxy, vyy;  // its inverse
  double spread;         // largest standard deviation of n
  double gain;           // gain in the log-likelihood ratio, without its distance
  std::int32_t number;   // in the frame, over all cameras
  bool is_shared = false;

  double squared(Plane e) const { return wxx * e.x * e.x + 2 * wxy * e.x * e.y + wyy * e.y * e.y; }
};

// A position in the coordinates of a camera.
struct ProjectedPlace {
  Plane n;
  Vec3 jx, jy;  // rows of J
  double depth;
};

class ImagePoints {
 public:
  ImagePoints(const Camera& of, const ImageSense& known)
      : camera(&of), sense(known), center(of.center()), r0_(of.row(0)), r1_(of.row(1)),
        r2_(of.row(2)) {}

  // Sets the image points of a frame, except those outside the domain of the lens model.
  void take(std::span<const double> pixels, std::int32_t first) {
    points.clear();
    normalised_.resize(pixels.size());
    camera->undistort(pixels, normalised_);
    const double w = 1 / (sense.sigma * sense.sigma);
    for (std::size_t i = 0; i < pixels.size() / 2; ++i) {
      const Plane n{normalised_[2 * i], normalised_[2 * i + 1]};
      if (!std::isfinite(n.x) || !std::isfinite(n.y)) continue;
      const Jacobian2 D = camera->slope(n);
      if (!std::isfinite(D.xx)) continue;
      ImagePoint p{n, w * (D.xx * D.xx + D.yx * D.yx), w * (D.xx * D.xy + D.yx * D.yy),
                   w * (D.xy * D.xy + D.yy * D.yy), 0, 0, 0, 0, sense.gain,
                   first + static_cast<std::int32_t>(i)};
      const double det = p.wxx * p.wyy - p.wxy * p.wxy;
      p.vxx = p.wyy / det, p.vxy = -p.wxy / det, p.vyy = p.wxx / det;
      const double half = (p.vxx + p.vyy) / 2, apart = (p.vxx - p.vyy) / 2;
      p.spread = std::sqrt(half + std::sqrt(apart * apart + p.vxy * p.vxy));
      points.push_back(p);
    }
    n_free = points.size();
    std::sort(points.begin(), points.end(), [](const ImagePoint& a, const ImagePoint& b) {
      return a.n.x != b.n.x ? a.n.x < b.n.x : a.n.y < b.n.y;
    });
    make_table();
    dx.resize(points.size()), dy.resize(points.size()), dz.resize(points.size());
    widest = 0;
    for (std::size_t i = 0; i < points.size(); ++i) {
      const Plane n = points[i].n;
      const double s = 1 / std::sqrt(n.x * n.x + n.y * n.y + 1);
      const Vec3 d = s * n.x * r0_ + s * n.y * r1_ + s * r2_;
      dx[i] = d.x, dy[i] = d.y, dz[i] = d.z;
      widest = std::max(widest, points[i].spread);
    }
  }

  // Lets a further point in space share an image point that is already taken, because two images
  // may have merged. This explains why the point has no image of its own, and locates it to within
  // sigma pixels. The image point is explained already, so it adds no gain.
  void share(const std::vector<char>& is_taken, double sigma) {
    const double wider = sigma / sense.sigma;
    n_free = points.size();
    for (ImagePoint& p : points) {
      if (!is_taken[p.number]) continue;
      p.is_shared = true, p.gain = 0;
      --n_free;
      p.wxx /= wider * wider, p.wxy /= wider * wider, p.wyy /= wider * wider;
      p.vxx *= wider * wider, p.vxy *= wider * wider, p.vyy *= wider * wider;
      p.spread *= wider;
      widest = std::max(widest, p.spread);
    }
  }

  // An image point before which all others are left of x, with few between it and x.
  std::vector<ImagePoint>::const_iterator right_of(double x) const {
    const double at = (x - left_) * cells_;
    if (!(at > 0)) return points.begin();
    if (at >= static_cast<double>(starts_.size())) return points.end();
    return points.begin() + starts_[static_cast<std::size_t>(at)];
  }

  Vec3 ray(std::size_t i) const { return {dx[i], dy[i], dz[i]}; }

  ProjectedPlace project(Vec3 X) const {
    const Vec3 c = camera->to_camera(X);
    const Plane n{c.x / c.z, c.y / c.z};
    const double s = 1 / c.z;
    return {n, s * (r0_ - n.x * r2_), s * (r1_ - n.y * r2_), c.z};
  }

  // Whether the camera could see the position: in range, in the image, and in the domain of the
  // lens model.
  bool could_see(Vec3 X) const {
    const double place[3] = {X.x, X.y, X.z};
    double pixel[2], depth[1];
    Reason reason[1];
    camera->project(place, pixel, depth, reason);
    return reason[0] == Reason::visible;
  }

  const Camera* camera;
  ImageSense sense;
  Vec3 center;
  std::vector<ImagePoint> points;   // ordered by n.x
  std::vector<double> dx, dy, dz;   // unit vectors of their rays in world coordinates
  double widest = 0;                // largest spread
  std::size_t n_free = 0;           // number of points that are not shared

 private:
  // Stores the index of the first point in each of many strips of equal width.
  void make_table() {
    starts_.clear();
    if (points.empty()) return;
    left_ = points.front().n.x;
    const double width = points.back().n.x - left_;
    const auto n = 4 * points.size();
    cells_ = width > 0 ? static_cast<double>(n) / width : 0;
    std::int32_t at = 0;
    for (std::size_t cell = 0; cell <= n; ++cell) {
      while (at < static_cast<std::int32_t>(points.size()) &&
             (points[at].n.x - left_) * cells_ < static_cast<double>(cell))
        ++at;
      starts_.push_back(at);
    }
  }

  Vec3 r0_, r1_, r2_;
  std::vector<std::int32_t> starts_;
  double left_ = 0, cells_ = 0;
  std::vector<double> normalised_;
};

}  // namespace asterism
