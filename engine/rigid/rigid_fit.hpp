// Least-squares rigid motion between two point sets (in space by quaternions, Horn 1987).
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <span>

#include "filter/kalman.hpp"
#include "math/symmetric3.hpp"

namespace asterism {

// b = R (a - from) + to
struct RigidFit {
  std::array<double, 9> R{1, 0, 0, 0, 1, 0, 0, 0, 1};
  Point from{}, to{};
  double rms = 0;  // residual per axis, corrected for the degrees of freedom of the fit

  Point operator()(const Point& a) const {
    Point b = to;
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) b[i] += R[3 * i + j] * (a[j] - from[j]);
    return b;
  }
};

struct RigidPair {
  Point a{}, b{};
  double weight = 1;
};

// A rotation needs three pairs in space, two in the plane. With fewer, the fit is a translation.
inline std::size_t min_for_rotation(int D) { return static_cast<std::size_t>(std::max(D, 1)); }

namespace rigid {

using Matrix4 = std::array<std::array<double, 4>, 4>;

// Signed cofactor of M.
inline double cofactor(const Matrix4& M, int row, int column) {
  const int i = row == 0 ? 1 : 0, j = row <= 1 ? 2 : 1, k = row <= 2 ? 3 : 2;
  const int p = column == 0 ? 1 : 0, q = column <= 1 ? 2 : 1, r = column <= 2 ? 3 : 2;
  const double det = M[i][p] * (M[j][q] * M[k][r] - M[j][r] * M[k][q]) -
                     M[i][q] * (M[j][p] * M[k][r] - M[j][r] * M[k][p]) +
                     M[i][r] * (M[j][p] * M[k][q] - M[j][q] * M[k][p]);
  return (row + column) % 2 == 0 ? det : -det;
}

// The same as `top_vector` if the largest eigenvalue is simple, but ten times faster: Newton's
// method on the characteristic polynomial of a matrix of trace 0, from an upper bound that is close
// if the fit is good (Theobald 2005). Returns false if it does not converge.
inline bool top_vector_from(double bound, const Matrix4& M, std::array<double, 4>& v) {
  double squares = 0, cubes = 0;  // tr M², tr M³
  for (int i = 0; i < 4; ++i)
    for (int j = 0; j < 4; ++j) {
      squares += M[i][j] * M[i][j];
      double product = 0;
      for (int k = 0; k < 4; ++k) product += M[j][k] * M[k][i];
      cubes += M[i][j] * product;
    }
  double det = 0;
  for (int j = 0; j < 4; ++j) det += M[0][j] * cofactor(M, 0, j);
  const double c2 = -0.5 * squares, c1 = -cubes / 3;
  double x = bound, step = bound;
  for (int n = 0; n < 30 && std::abs(step) > 1e-15 * bound; ++n) {
    const double slope = (4 * x * x + 2 * c2) * x + c1;
    if (!(slope > 0)) return false;
    step = (((x * x + c2) * x + c1) * x + det) / slope;
    x -= step;
  }
  Matrix4 shifted = M;
  for (int i = 0; i < 4; ++i) shifted[i][i] -= x;
  int best = 0;  // of four columns that are multiples of the vector
  double max_cofactor = 0;
  for (int i = 0; i < 4; ++i)
    if (const double own = std::abs(cofactor(shifted, i, i)); own > max_cofactor) {
      max_cofactor = own;
      best = i;
    }
  double length2 = 0, left2 = 0;
  for (int i = 0; i < 4; ++i) {
    v[i] = cofactor(shifted, best, i);
    length2 += v[i] * v[i];
  }
  for (int i = 0; i < 4; ++i) {
    double left = 0;
    for (int j = 0; j < 4; ++j) left += shifted[i][j] * v[j];
    left2 += left * left;
  }
  if (!(length2 > 0 && left2 <= 1e-26 * bound * bound * length2)) return false;
  for (double& each : v) each /= std::sqrt(length2);
  return true;
}

// The unit vector that maximises vᵀ M v, by Jacobi rotations.
inline std::array<double, 4> top_vector(Matrix4 M) {
  Matrix4 V{};
  for (int i = 0; i < 4; ++i) V[i][i] = 1;
  for (int sweep = 0; sweep < 12; ++sweep) {
    double off = 0, on = 0;
    for (int i = 0; i < 4; ++i) {
      on += M[i][i] * M[i][i];
      for (int j = i + 1; j < 4; ++j) off += M[i][j] * M[i][j];
    }
    if (off <= 1e-30 * on) break;
    for (int p = 0; p < 3; ++p)
      for (int q = p + 1; q < 4; ++q) {
        if (M[p][q] == 0) continue;
        const double theta = (M[q][q] - M[p][p]) / (2 * M[p][q]);
        const double t = std::copysign(1 / (std::abs(theta) + std::sqrt(theta * theta + 1)), theta);
        const double c = 1 / std::sqrt(t * t + 1), s = t * c;
        for (int k = 0; k < 4; ++k) {
          const double x = M[k][p], y = M[k][q];
          M[k][p] = c * x - s * y;
          M[k][q] = s * x + c * y;
        }
        for (int k = 0; k < 4; ++k) {
          const double x = M[p][k], y = M[q][k];
          M[p][k] = c * x - s * y;
          M[q][k] = s * x + c * y;
          const double v = V[k][p], w = V[k][q];
          V[k][p] = c * v - s * w;
          V[k][q] = s * v + c * w;
        }
      }
  }
  int best = 0;
  for (int i = 1; i < 4; ++i)
    if (M[i][i] > M[best][best]) best = i;
  return {V[0][best], V[1][best], V[2][best], V[3][best]};
}

inline std::array<double, 9> rotation(const std::array<double, 4>& q) {
  const auto [w, x, y, z] = q;
  return {w * w + x * x - y * y - z * z, 2 * (x * y - w * z),           2 * (x * z + w * y),
          2 * (x * y + w * z),           w * w - x * x + y * y - z * z, 2 * (y * z - w * x),
          2 * (x * z - w * y),           2 * (y * z + w * x),           w * w - x * x - y * y + z * z};
}

}  // namespace rigid

// The number of axes is a constant of the compiler, which unrolls the loops over them.
template <int D>
RigidFit fit_rigid_in(std::span<const RigidPair> pairs) {
  RigidFit fit;
  double all = 0;
  for (const RigidPair& p : pairs) {
    all += p.weight;
    for (int d = 0; d < D; ++d) {
      fit.from[d] += p.weight * p.a[d];
      fit.to[d] += p.weight * p.b[d];
    }
  }
  for (int d = 0; d < D; ++d) {
    fit.from[d] /= all;
    fit.to[d] /= all;
  }
  const bool can_turn = D > 1 && pairs.size() >= min_for_rotation(D);
  if (can_turn) {
    double S[3][3] = {}, size = 0;
    for (const RigidPair& p : pairs)
      for (int i = 0; i < D; ++i) {
        const double a = p.a[i] - fit.from[i], b = p.b[i] - fit.to[i];
        size += 0.5 * p.weight * (a * a + b * b);
        for (int j = 0; j < D; ++j) S[i][j] += p.weight * a * (p.b[j] - fit.to[j]);
      }
    if constexpr (D == 2) {
      const double angle = std::atan2(S[0][1] - S[1][0], S[0][0] + S[1][1]);
      const double c = std::cos(angle), s = std::sin(angle);
      fit.R = {c, -s, 0, s, c, 0, 0, 0, 1};
    } else {
      const double yz = S[1][2] - S[2][1], zx = S[2][0] - S[0][2], xy = S[0][1] - S[1][0];
      const rigid::Matrix4 M{
          {{S[0][0] + S[1][1] + S[2][2], yz, zx, xy},
           {yz, S[0][0] - S[1][1] - S[2][2], S[0][1] + S[1][0], S[2][0] + S[0][2]},
           {zx, S[0][1] + S[1][0], S[1][1] - S[0][0] - S[2][2], S[1][2] + S[2][1]},
           {xy, S[2][0] + S[0][2], S[1][2] + S[2][1], S[2][2] - S[0][0] - S[1][1]}}};
      std::array<double, 4> q{};
      if (!rigid::top_vector_from(size, M, q)) q = rigid::top_vector(M);
      fit.R = rigid::rotation(q);
    }
  }
  double left = 0;
  for (const RigidPair& p : pairs) left += p.weight * squared_distance(fit(p.a), p.b, D);
  const double n = static_cast<double>(pairs.size()) * D;
  const double free = n - (can_turn ? 0.5 * D * (D + 1) : D);
  fit.rms = std::sqrt(left / all / D * n / std::max(free, 1.0));
  return fit;
}

inline RigidFit fit_rigid(std::span<const RigidPair> pairs, int D) {
  return D == 3 ? fit_rigid_in<3>(pairs) : D == 2 ? fit_rigid_in<2>(pairs) : fit_rigid_in<1>(pairs);
}

// tr([d]× J⁻¹ [d]×ᵀ); infinite for collinear points.
inline double turning_variance(std::span<const RigidPair> pairs, const Point& mean, const Point& d,
                               int D) {
  constexpr double never = std::numeric_limits<double>::infinity();
  Symmetric3 S;  // Σ b' b'ᵀ / v
  for (const RigidPair& p : pairs)
    S.add({p.b[0] - mean[0], p.b[1] - mean[1], D > 2 ? p.b[2] - mean[2] : 0.0}, p.weight);
  const double all = S.trace();
  const Vec3 arm{d[0], d[1], D > 2 ? d[2] : 0.0};
  const double arm2 = arm.x * arm.x + arm.y * arm.y + arm.z * arm.z;
  if (!(all > 0)) return never;
  if (D == 2) return arm2 / all;
  const Symmetric3 J{all - S.xx, -S.xy, -S.xz, all - S.yy, -S.yz, all - S.zz};
  if (!(J.determinant() > 1e-9 * all * all * all)) return never;
  const Symmetric3 turn = J.inverse();
  const Vec3 turned = turn * arm;
  return turn.trace() * arm2 - (turned.x * arm.x + turned.y * arm.y + turned.z * arm.z);
}

}  // namespace asterism
