// Lens models: distort an ideal image, and undistort it.
//
//   (x, y)    lens coordinates, mostly normalised: X_c / Z_c and Y_c / Z_c
//   q         x^2 + y^2
//   m(x, y)   the polynomial map of the model; "forward" if it takes undistorted to distorted
//             coordinates (Brown-Conrady), "backward" if it takes distorted to undistorted ones
//   radial    m = x (1 + k1 q + k2 q^2 + k3 q^3), plus the tangential p1, p2
//   quadratic m = x + e . (x, y, x^2, y^2, xy), each axis with its own e
//
// One direction is the polynomial, and the other is solved for. A map is used only where it
// stretches by at least kMinStretch in every direction. This domain is convex, and the map is
// injective on it.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

namespace asterism {

inline constexpr double kMinStretch = 1e-2;
inline constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

struct Plane {
  double x, y;
};

// Symmetric for the radial and tangential terms, general for the quadratic ones.
struct Jacobian2 {
  double xx, xy, yx, yy;
  Plane solve(Plane b) const {
    const double det = xx * yy - xy * yx;
    return {(yy * b.x - xy * b.y) / det, (xx * b.y - yx * b.x) / det};
  }
  Jacobian2 inverse() const {
    const double det = xx * yy - xy * yx;
    return {yy / det, -xy / det, -yx / det, xx / det};
  }
};

class Lens {
 public:
  enum class Kind { none, radial, quadratic };

  Lens() = default;
  // `r_end`: radius of the domain of a radial map. `q_table`: squared image radius, in the
  // coordinates from which the lens solves, up to which a table gives the initial guess. `start`: a
  // point of the domain.
  Lens(Kind kind, bool is_backward, std::span<const double> c, double r_end, double q_table,
       Plane start)
      : kind_(kind), is_backward_(is_backward), r_end_(r_end), start_(start) {
    if (kind == Kind::radial) {
      std::copy_n(c.begin(), 3, k_.begin());
      p1_ = c[3], p2_ = c[4];
      s_end_ = std::isfinite(r_end) ? r_end * stretch(r_end * r_end) : r_end;
      make_table(q_table);
    } else if (kind == Kind::quadratic) {
      std::copy_n(c.begin(), 10, e_.begin());
    }
  }

  Kind kind() const { return kind_; }

  // From ideal to distorted coordinates and back, in place; NaN outside the domain of the model.
  void distort(std::span<double> x, std::span<double> y) const {
    is_backward_ ? solve(x, y) : apply(x, y);
  }
  void undistort(std::span<double> x, std::span<double> y) const {
    is_backward_ ? apply(x, y) : solve(x, y);
  }

  // Derivative of distorted by ideal coordinates, at the distorted coordinates `d` of the ideal
  // ones `i`.
  Jacobian2 distort_slope(Plane i, Plane d) const {
    if (kind_ == Kind::none) return {1, 0, 0, 1};
    return is_backward_ ? slope(d).inverse() : slope(i);
  }

 private:
  double stretch(double q) const { return 1 + q * (k_[0] + q * (k_[1] + q * k_[2])); }
  double stretch_slope(double q) const { return k_[0] + q * (2 * k_[1] + q * 3 * k_[2]); }

  Plane map(Plane a) const {
    if (kind_ == Kind::quadratic) {
      const double u = a.x, v = a.y;
      return {u + e_[0] * u + e_[1] * v + e_[2] * u * u + e_[3] * v * v + e_[4] * u * v,
              v + e_[5] * u + e_[6] * v + e_[7] * u * u + e_[8] * v * v + e_[9] * u * v};
    }
    const double q = a.x * a.x + a.y * a.y, g = stretch(q), w = 2 * (p1_ * a.y + p2_ * a.x);
    return {a.x * g + a.x * w + p2_ * q, a.y * g + a.y * w + p1_ * q};
  }

  Jacobian2 slope(Plane a) const {
    if (kind_ == Kind::quadratic) {
      const double u = a.x, v = a.y;
      return {1 + e_[0] + 2 * e_[2] * u + e_[4] * v, e_[1] + 2 * e_[3] * v + e_[4] * u,
              e_[5] + 2 * e_[7] * u + e_[9] * v, 1 + e_[6] + 2 * e_[8] * v + e_[9] * u};
    }
    const double q = a.x * a.x + a.y * a.y, g = stretch(q), h = 2 * stretch_slope(q);
    const double cross = h * a.x * a.y + 2 * (p1_ * a.x + p2_ * a.y);
    return {g + h * a.x * a.x + 2 * p1_ * a.y + 6 * p2_ * a.x, cross, cross,
            g + h * a.y * a.y + 6 * p1_ * a.y + 2 * p2_ * a.x};
  }

  // Whether `a` is in the domain of the map.
  bool reaches(Plane a) const {
    if (kind_ == Kind::radial) return a.x * a.x + a.y * a.y < r_end_ * r_end_;
    const Jacobian2 J = slope(a);
    const double A = J.xx - kMinStretch, B = J.yy - kMinStretch, C = 0.5 * (J.xy + J.yx);
    return A > 0 && A * B > C * C;
  }

  void apply(std::span<double> x, std::span<double> y) const {
    if (kind_ == Kind::none) return;
    if (kind_ == Kind::quadratic) {
      for (std::size_t i = 0; i < x.size(); ++i) {
        const Plane a{x[i], y[i]}, b = reaches(a) ? map(a) : Plane{kNaN, kNaN};
        x[i] = b.x, y[i] = b.y;
      }
      return;
    }
    const double k1 = k_[0], k2 = k_[1], k3 = k_[2], p1 = p1_, p2 = p2_, end = r_end_ * r_end_;
    double* const px = x.data();
    double* const py = y.data();
    for (std::size_t i = 0, n = x.size(); i < n; ++i) {
      const double a = px[i], b = py[i], q = a * a + b * b;
      const double g = 1 + q * (k1 + q * (k2 + q * k3)) + 2 * (p1 * b + p2 * a);
      const double inside = q < end ? 0.0 : kNaN;
      px[i] = a * g + p2 * q + inside;
      py[i] = b * g + p1 * q + inside;
    }
  }

  void solve(std::span<double> x, std::span<double> y) const {
    if (kind_ == Kind::none) return;
    const bool is_radial = kind_ == Kind::radial && p1_ == 0 && p2_ == 0;
    if (!is_radial) {
      for (std::size_t i = 0; i < x.size(); ++i) {
        const Plane a = solve_plane({x[i], y[i]});
        x[i] = a.x, y[i] = a.y;
      }
      return;
    }
    for (std::size_t i = 0; i < x.size(); ++i) {
      const double w = factor(x[i] * x[i] + y[i] * y[i]);
      x[i] *= w, y[i] *= w;
    }
  }

  // A fast version of `solve_factor`. The table's guess and one Newton step are accurate to the
  // last digit nearly everywhere. If the step is not small, `solve_factor` is used.
  double factor(double q) const {
    const double at = q * to_cell_;
    if (!(at < n_cells_)) return solve_factor(q);
    const auto j = static_cast<std::size_t>(at);
    const double f = at - static_cast<double>(j);
    const double* const c = table_.data() + 4 * j;
    const double w = c[0] + f * (c[1] + f * (c[2] + f * c[3]));
    const double u = q * w * w;
    const double h = 1 + u * (3 * k_[0] + u * (5 * k_[1] + u * 7 * k_[2]));
    const double step = (w * stretch(u) - 1) / h;
    return std::abs(step) < 1e-9 ? w - step : solve_factor(q);
  }

  // r / s with r (1 + k1 r^2 + ...) = s = sqrt(q) and r in the domain; NaN if there is none.
  double solve_factor(double q) const {
    if (q == 0) return 1;
    const double s = std::sqrt(q);
    if (!(s < s_end_)) return kNaN;
    double low = 0, high = r_end_;
    if (!std::isfinite(high))
      for (high = s; high * stretch(high * high) < s; low = high, high *= 2)
        if (!std::isfinite(high)) return kNaN;
    double r = std::clamp(s, low, high);
    for (int i = 0; i < 200; ++i) {
      const double t = r * r, value = r * stretch(t) - s;
      (value > 0 ? high : low) = r;
      double next = r - value / (stretch(t) + 2 * t * stretch_slope(t));
      if (!(next > low && next < high)) next = 0.5 * (low + high);
      if (std::abs(next - r) <= 1e-16 * r) break;
      r = next;
    }
    return r / s;
  }

  // Solves m(a) = b for a in the domain; NaN if there is none. The radial and tangential map is the
  // gradient of a potential that is convex on the domain, and the quadratic map is monotone there.
  // Newton steps that are shortened until the residual falls therefore converge.
  Plane solve_plane(Plane b) const {
    if (!std::isfinite(b.x) || !std::isfinite(b.y)) return {kNaN, kNaN};
    Plane a{0, 0};
    if (kind_ == Kind::radial) {
      const double w = factor(b.x * b.x + b.y * b.y);
      if (std::isfinite(w)) a = {b.x * w, b.y * w};
      if (!reaches(a)) a = start_;
    } else {
      a = reaches(b) ? b : start_;
    }
    Plane r = minus(map(a), b);
    double size = squared(r);
    const double scale = squared(b), enough = 1e-31 * scale;
    for (int i = 0; i < 100 && size > enough; ++i) {
      const Plane step = slope(a).solve(r);
      double part = 1;
      for (; part > 1e-12; part *= 0.5) {
        const Plane c{a.x - part * step.x, a.y - part * step.y};
        if (!reaches(c)) continue;
        const Plane rc = minus(map(c), b);
        if (squared(rc) < size) {
          a = c, r = rc, size = squared(rc);
          break;
        }
      }
      if (part <= 1e-12) break;  // limited by rounding, or at the edge of the domain
    }
    return size <= 1e-24 * (1e-6 + scale) ? a : Plane{kNaN, kNaN};
  }

  static Plane minus(Plane a, Plane b) { return {a.x - b.x, a.y - b.y}; }
  static double squared(Plane a) { return a.x * a.x + a.y * a.y; }

  // Tabulates the factor r / s as a function of q = s^2, in cubic Hermite pieces.
  void make_table(double q_table) {
    if (!(q_table > 0)) return;
    // The table ends before the domain, where the factor changes too fast for cubic pieces.
    const double q_end = std::min(q_table, 0.999 * s_end_ * s_end_);
    const std::size_t n = 1024;
    const double width = q_end / static_cast<double>(n);
    auto value = [&](double q) { return solve_factor(q); };
    auto slope_at = [&](double q, double w) {
      const double u = q * w * w, g = stretch_slope(u);
      return -w * w * w * g / (stretch(u) + 2 * u * g) * width;
    };
    table_.resize(4 * n);
    for (std::size_t j = 0; j < n; ++j) {
      const double q0 = static_cast<double>(j) * width, q1 = static_cast<double>(j + 1) * width;
      const double w0 = value(q0), w1 = value(q1), d0 = slope_at(q0, w0), d1 = slope_at(q1, w1);
      table_[4 * j] = w0;
      table_[4 * j + 1] = d0;
      table_[4 * j + 2] = 3 * (w1 - w0) - 2 * d0 - d1;
      table_[4 * j + 3] = 2 * (w0 - w1) + d0 + d1;
    }
    n_cells_ = static_cast<double>(n);
    to_cell_ = 1 / width;
  }

  Kind kind_ = Kind::none;
  bool is_backward_ = false;
  std::array<double, 3> k_{};
  double p1_ = 0, p2_ = 0;
  std::array<double, 10> e_{};
  double r_end_ = 0, s_end_ = 0;
  Plane start_{0, 0};
  std::vector<double> table_;
  double n_cells_ = 0, to_cell_ = 0;
};

}  // namespace asterism
