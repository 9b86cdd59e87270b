// Symmetric 3 × 3 matrices, for the information and the covariance of a position.
#pragma once

#include "math/vectors.hpp"

namespace asterism {

struct Symmetric3 {
  double xx = 0, xy = 0, xz = 0, yy = 0, yz = 0, zz = 0;

  // Adds a aᵀ w.
  void add(Vec3 a, double w) {
    xx += w * a.x * a.x, xy += w * a.x * a.y, xz += w * a.x * a.z;
    yy += w * a.y * a.y, yz += w * a.y * a.z, zz += w * a.z * a.z;
  }
  // Adds (a bᵀ + b aᵀ) w.
  void add(Vec3 a, Vec3 b, double w) {
    xx += 2 * w * a.x * b.x, xy += w * (a.x * b.y + a.y * b.x), xz += w * (a.x * b.z + a.z * b.x);
    yy += 2 * w * a.y * b.y, yz += w * (a.y * b.z + a.z * b.y), zz += 2 * w * a.z * b.z;
  }
  double trace() const { return xx + yy + zz; }
  double determinant() const {
    return xx * (yy * zz - yz * yz) - xy * (xy * zz - yz * xz) + xz * (xy * yz - yy * xz);
  }
  Symmetric3 inverse() const {
    const double s = 1 / determinant();
    return {s * (yy * zz - yz * yz), s * (xz * yz - xy * zz), s * (xy * yz - xz * yy),
            s * (xx * zz - xz * xz), s * (xy * xz - xx * yz), s * (xx * yy - xy * xy)};
  }
  friend Vec3 operator*(const Symmetric3& m, Vec3 v) {
    return {m.xx * v.x + m.xy * v.y + m.xz * v.z, m.xy * v.x + m.yy * v.y + m.yz * v.z,
            m.xz * v.x + m.yz * v.y + m.zz * v.z};
  }
};

}  // namespace asterism
