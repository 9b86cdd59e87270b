// The pin-hole camera with its lens, vectorised over points.
//
//   X_c = R X + t                         camera frame, looking along +z
//   (x, y) = (X_c / Z_c, Y_c / Z_c)       normalised coordinates
//   l = A (x, y, 1)                       coordinates of the lens model
//   (u, v) = B (l_d, 1)                   pixels, origin at the centre of the top left one
#pragma once

#include "camera/lens.hpp"
#include "math/vectors.hpp"

namespace asterism {

// The names are those of `camera/projection.py`.
enum class Reason : std::uint8_t { visible, absent, behind, near, far, lens, outside, occluded };

struct Affine2 {
  double a, b, c, d, e, f;  // (a x + b y + c, d x + e y + f)
  Plane operator()(Plane p) const { return {a * p.x + b * p.y + c, d * p.x + e * p.y + f}; }
  Plane inverse(Plane p) const {
    const double det = a * e - b * d, x = p.x - c, y = p.y - f;
    return {(e * x - b * y) / det, (a * y - d * x) / det};
  }
};

class Camera {
 public:
  Camera(std::span<const double> R, std::span<const double> t, Affine2 A, Affine2 B, Lens lens,
         double near, double far, std::int32_t width, std::int32_t height)
      : A_(A), B_(B), lens_(std::move(lens)), near_(near), far_(far), width_(width),
        height_(height), is_plain_(A.a == 1 && A.b == 0 && A.c == 0 && A.d == 0 && A.e == 1 && A.f == 0) {
    std::copy_n(R.begin(), 9, R_.begin());
    std::copy_n(t.begin(), 3, t_.begin());
    // A depth below the rounding error does not count as in front of the camera.
    min_z_ = 1e-14 * std::sqrt(t_[0] * t_[0] + t_[1] * t_[1] + t_[2] * t_[2]);
  }

  std::int32_t width() const { return width_; }
  std::int32_t height() const { return height_; }

  Vec3 center() const {
    return {-(R_[0] * t_[0] + R_[3] * t_[1] + R_[6] * t_[2]),
            -(R_[1] * t_[0] + R_[4] * t_[1] + R_[7] * t_[2]),
            -(R_[2] * t_[0] + R_[5] * t_[1] + R_[8] * t_[2])};
  }
  Vec3 to_camera(Vec3 p) const {
    return {R_[0] * p.x + R_[1] * p.y + R_[2] * p.z + t_[0],
            R_[3] * p.x + R_[4] * p.y + R_[5] * p.z + t_[1],
            R_[6] * p.x + R_[7] * p.y + R_[8] * p.z + t_[2]};
  }

  // Projects `points` (n, 3) to `pixels` (n, 2), `depth` and `reason` (n), without occlusion.
  void project(std::span<const double> points, std::span<double> pixels, std::span<double> depth,
               std::span<Reason> reason) const {
    constexpr std::size_t kBlock = 256;
    std::array<double, kBlock> x, y;
    const double right = width_ - 0.5, bottom = height_ - 0.5;
    for (std::size_t at = 0; at < depth.size(); at += kBlock) {
      const std::size_t n = std::min(kBlock, depth.size() - at);
      const double* const p = points.data() + 3 * at;
      double* const z = depth.data() + at;
      double* const out = pixels.data() + 2 * at;
      Reason* const why = reason.data() + at;
      for (std::size_t i = 0; i < n; ++i) {
        const double a = p[3 * i], b = p[3 * i + 1], c = p[3 * i + 2];
        z[i] = R_[6] * a + R_[7] * b + R_[8] * c + t_[2];
        const double scale = 1 / z[i];
        x[i] = (R_[0] * a + R_[1] * b + R_[2] * c + t_[0]) * scale;
        y[i] = (R_[3] * a + R_[4] * b + R_[5] * c + t_[1]) * scale;
      }
      const std::span<double> xs(x.data(), n), ys(y.data(), n);
      if (!is_plain_) transform(A_, xs, ys);
      lens_.distort(xs, ys);
      for (std::size_t i = 0; i < n; ++i) {
        const double u = B_.a * x[i] + B_.b * y[i] + B_.c, v = B_.d * x[i] + B_.e * y[i] + B_.f;
        out[2 * i] = u, out[2 * i + 1] = v;
        const bool inside = (u >= -0.5) & (u < right) & (v >= -0.5) & (v < bottom);
        const bool in_range = (z[i] > min_z_) & (z[i] >= near_) & (z[i] <= far_);
        why[i] = inside & in_range ? Reason::visible : Reason::outside;
      }
      for (std::size_t i = 0; i < n; ++i)
        if (why[i] != Reason::visible) why[i] = why_not(z[i], out + 2 * i);
    }
  }

  // Maps `pixels` (n, 2) to normalised coordinates (n, 2), NaN outside the domain of the lens
  // model.
  void undistort(std::span<const double> pixels, std::span<double> normalised) const {
    for (std::size_t i = 0; i < pixels.size() / 2; ++i) {
      Plane l = B_.inverse({pixels[2 * i], pixels[2 * i + 1]});
      lens_.undistort({&l.x, 1}, {&l.y, 1});
      const Plane n = is_plain_ ? l : A_.inverse(l);
      normalised[2 * i] = n.x, normalised[2 * i + 1] = n.y;
    }
  }

  // Maps normalised coordinates (n, 2) to pixels (n, 2), also outside the image.
  void distort(std::span<const double> normalised, std::span<double> pixels) const {
    for (std::size_t i = 0; i < pixels.size() / 2; ++i) {
      Plane l = A_({normalised[2 * i], normalised[2 * i + 1]});
      lens_.distort({&l.x, 1}, {&l.y, 1});
      const Plane p = B_(l);
      pixels[2 * i] = p.x, pixels[2 * i + 1] = p.y;
    }
  }

  // Row k of R.
  Vec3 row(std::size_t k) const { return {R_[3 * k], R_[3 * k + 1], R_[3 * k + 2]}; }

  // Derivative of a pixel by its normalised coordinates, B D A; NaN if there is no pixel.
  Jacobian2 slope(Plane n) const {
    const Plane ideal = A_(n);
    Plane bent = ideal;
    lens_.distort({&bent.x, 1}, {&bent.y, 1});
    if (!std::isfinite(bent.x)) return {kNaN, kNaN, kNaN, kNaN};
    const Jacobian2 D = lens_.distort_slope(ideal, bent);
    const double m00 = D.xx * A_.a + D.xy * A_.d, m01 = D.xx * A_.b + D.xy * A_.e;
    const double m10 = D.yx * A_.a + D.yy * A_.d, m11 = D.yx * A_.b + D.yy * A_.e;
    return {B_.a * m00 + B_.b * m10, B_.a * m01 + B_.b * m11, B_.d * m00 + B_.e * m10,
            B_.d * m01 + B_.e * m11};
  }

  // Derivative of a point's pixel by its world coordinates, row by row; NaN if it has no pixel.
  std::array<double, 6> jacobian(Vec3 point) const {
    const Vec3 c = to_camera(point);
    std::array<double, 6> J;
    J.fill(kNaN);
    if (!(c.z > min_z_)) return J;
    const Plane n{c.x / c.z, c.y / c.z};
    const Jacobian2 G = slope(n);
    if (!std::isfinite(G.xx)) return J;
    for (std::size_t k = 0; k < 3; ++k) {
      const double dx = (R_[k] - n.x * R_[6 + k]) / c.z, dy = (R_[3 + k] - n.y * R_[6 + k]) / c.z;
      J[k] = G.xx * dx + G.xy * dy;
      J[3 + k] = G.yx * dx + G.yy * dy;
    }
    return J;
  }

 private:
  static void transform(const Affine2& M, std::span<double> x, std::span<double> y) {
    for (std::size_t i = 0; i < x.size(); ++i) {
      const Plane m = M({x[i], y[i]});
      x[i] = m.x, y[i] = m.y;
    }
  }

  Reason why_not(double z, double* pixel) const {
    Reason why = Reason::outside;
    if (!std::isfinite(z))
      why = Reason::absent;
    else if (z <= min_z_)
      why = Reason::behind;
    else if (!std::isfinite(pixel[0]) || !std::isfinite(pixel[1]))
      why = Reason::lens;
    if (why != Reason::outside) pixel[0] = pixel[1] = kNaN;
    if (why == Reason::outside || why == Reason::lens) {
      if (z < near_) why = Reason::near;
      if (z > far_) why = Reason::far;
    }
    return why;
  }

  std::array<double, 9> R_;
  std::array<double, 3> t_;
  Affine2 A_, B_;
  Lens lens_;
  double near_, far_, min_z_ = 0;
  std::int32_t width_, height_;
  bool is_plain_;
};

}  // namespace asterism
