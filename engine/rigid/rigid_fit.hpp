// Least-squares rigid motion between two point sets (in space by quaternions, Horn 1987), of four
// pairs of sets at once.
//
//   b = R (a - from) + to
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <span>
#include <vector>

#include "math/lanes.hpp"
#include "math/point.hpp"

namespace asterism {

struct RigidPair {
  Point a{}, b{};
  double weight = 1;
};

// A rotation needs three pairs in space, two in the plane. With fewer, the fit is a translation.
inline std::size_t min_for_rotation(int D) { return static_cast<std::size_t>(std::max(D, 1)); }

namespace rigid {

using LanePoint = std::array<Lanes, kMaxAxes>;
using LaneMatrix4 = std::array<std::array<Lanes, 4>, 4>;
using Matrix4 = std::array<std::array<double, 4>, 4>;

struct LanePair {
  LanePoint a{}, b{};
  Lanes weight;
};

ASTERISM_INLINED Lanes squared_distance(const LanePoint& a, const LanePoint& b, int D) {
  Lanes sum;
  for (int d = 0; d < D; ++d) sum += (a[d] - b[d]) * (a[d] - b[d]);
  return sum;
}

// The pairs of each lane. A lane with fewer pairs than another has further ones of weight 0, and a
// lane without any has those of the first.
class LanePairs {
 public:
  std::size_t n_lanes() const { return n_lanes_; }
  std::span<const LanePair> rows() const { return rows_; }
  const Lanes& n_pairs() const { return n_pairs_; }
  void clear() {
    rows_.clear();
    n_lanes_ = 0;
  }
  // Fills the next lane.
  void add(std::span<const RigidPair> pairs) {
    const std::size_t lane = n_lanes_++;
    if (lane == 0) {
      n_pairs_ = static_cast<double>(pairs.size());
      for (const RigidPair& p : pairs)
        rows_.push_back({{p.a[0], p.a[1], p.a[2]}, {p.b[0], p.b[1], p.b[2]}, p.weight});
      return;
    }
    n_pairs_.at[lane] = static_cast<double>(pairs.size());
    while (rows_.size() < pairs.size()) {
      rows_.push_back(rows_.front());
      rows_.back().weight = 0.0;
    }
    for (std::size_t k = 0; k < rows_.size(); ++k) {
      const RigidPair& p = pairs[k < pairs.size() ? k : 0];
      for (int d = 0; d < kMaxAxes; ++d) {
        rows_[k].a[d].at[lane] = p.a[d];
        rows_[k].b[d].at[lane] = p.b[d];
      }
      rows_[k].weight.at[lane] = k < pairs.size() ? p.weight : 0;
    }
  }

 private:
  std::vector<LanePair> rows_;
  Lanes n_pairs_;
  std::size_t n_lanes_ = 0;
};

// The rows of M other than `row`.
ASTERISM_INLINED std::array<std::array<Lanes, 4>, 3> other_rows(const LaneMatrix4& M,
                                                                const Lanes& row) {
  std::array<std::array<Lanes, 4>, 3> rows;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 4; ++j) rows[i][j] = where(row - i, M[i][j], M[i + 1][j]);
  return rows;
}
// Cofactor of a matrix whose other rows these are, but for the sign of the row.
ASTERISM_INLINED Lanes cofactor(const std::array<std::array<Lanes, 4>, 3>& rows, int column) {
  const auto& [a, b, c] = rows;
  const int p = column == 0 ? 1 : 0, q = column <= 1 ? 2 : 1, r = column <= 2 ? 3 : 2;
  const Lanes det = a[p] * (b[q] * c[r] - b[r] * c[q]) - a[q] * (b[p] * c[r] - b[r] * c[p]) +
                    a[r] * (b[p] * c[q] - b[q] * c[p]);
  return column % 2 == 0 ? det : -det;
}

// The same as `top_vector` in the lanes where the largest eigenvalue is simple, but ten times
// faster: Newton's method on the characteristic polynomial of a matrix of trace 0, from an upper
// bound that is close if the fit is good (Theobald 2005). Returns 0 in a lane where it does not
// converge, 1 elsewhere.
ASTERISM_INLINED Lanes top_vectors_from(const Lanes& bound, const LaneMatrix4& M,
                                        std::array<Lanes, 4>& v) {
  Lanes squares, cubes, det;  // tr M², tr M³
  for (int i = 0; i < 4; ++i)
    for (int j = 0; j < 4; ++j) {
      squares += M[i][j] * M[i][j];
      Lanes product;
      for (int k = 0; k < 4; ++k) product += M[j][k] * M[k][i];
      cubes += M[i][j] * product;
    }
  const auto below_first = other_rows(M, 0.0);
  for (int j = 0; j < 4; ++j) det += M[0][j] * cofactor(below_first, j);
  const Lanes c2 = -0.5 * squares, c1 = -cubes / 3;
  Lanes x = bound, step = bound, converges = 1.0;
  for (int n = 0; n < 30; ++n) {
    const Lanes moves = where(absolute(step) - 1e-15 * bound, converges, 0.0);
    if (!(moves.at[0] + moves.at[1] + moves.at[2] + moves.at[3] > 0)) break;
    const Lanes slope = (4 * x * x + 2 * c2) * x + c1;
    converges = where(moves, where(slope, converges, 0.0), converges);
    step = where(moves, (((x * x + c2) * x + c1) * x + det) / slope, step);
    x = where(moves, x - step, x);
  }
  LaneMatrix4 shifted = M;
  for (int i = 0; i < 4; ++i) shifted[i][i] = shifted[i][i] - x;
  // The cofactors of each row are multiples of the vector.
  Lanes best, max_cofactor;
  for (int i = 0; i < 4; ++i) {
    const Lanes own = absolute(cofactor(other_rows(shifted, i), i));
    best = where(own - max_cofactor, i, best);
    max_cofactor = maximum(own, max_cofactor);
  }
  const auto rows = other_rows(shifted, best);
  Lanes length2, left2;
  for (int i = 0; i < 4; ++i) {
    v[i] = cofactor(rows, i);
    length2 += v[i] * v[i];
  }
  for (int i = 0; i < 4; ++i) {
    Lanes left;
    for (int j = 0; j < 4; ++j) left += shifted[i][j] * v[j];
    left2 += left * left;
  }
  const Lanes length = square_root(length2);
  for (Lanes& each : v) each = each / length;
  const Lanes is_vector = where(length2, where(left2 - 1e-26 * bound * bound * length2, 0.0, 1.0), 0.0);
  return converges * is_vector;
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

ASTERISM_INLINED std::array<Lanes, 9> rotation(const std::array<Lanes, 4>& q) {
  const auto& [w, x, y, z] = q;
  return {w * w + x * x - y * y - z * z, 2 * (x * y - w * z),           2 * (x * z + w * y),
          2 * (x * y + w * z),           w * w - x * x + y * y - z * z, 2 * (y * z - w * x),
          2 * (x * z - w * y),           2 * (y * z + w * x),           w * w - x * x - y * y + z * z};
}

// The rotations of the lanes where `is_needed` is above 0, from S = Σ w a' b'ᵀ and
// ½ Σ w (|a'|² + |b'|²).
ASTERISM_INLINED std::array<Lanes, 9> rotation_in_space(const Lanes (&S)[3][3], const Lanes& size,
                                                        const Lanes& is_needed) {
  const Lanes yz = S[1][2] - S[2][1], zx = S[2][0] - S[0][2], xy = S[0][1] - S[1][0];
  const LaneMatrix4 M{{{S[0][0] + S[1][1] + S[2][2], yz, zx, xy},
                       {yz, S[0][0] - S[1][1] - S[2][2], S[0][1] + S[1][0], S[2][0] + S[0][2]},
                       {zx, S[0][1] + S[1][0], S[1][1] - S[0][0] - S[2][2], S[1][2] + S[2][1]},
                       {xy, S[2][0] + S[0][2], S[1][2] + S[2][1], S[2][2] - S[0][0] - S[1][1]}}};
  std::array<Lanes, 4> q;
  const Lanes is_found = top_vectors_from(size, M, q);
  for (int lane = 0; lane < kLanes; ++lane) {
    if (is_found.at[lane] > 0 || !(is_needed.at[lane] > 0)) continue;
    Matrix4 own;
    for (int i = 0; i < 4; ++i)
      for (int j = 0; j < 4; ++j) own[i][j] = M[i][j].at[lane];
    const std::array<double, 4> top = top_vector(own);
    for (int i = 0; i < 4; ++i) q[i].at[lane] = top[i];
  }
  return rotation(q);
}

}  // namespace rigid

struct LaneFit {
  std::array<Lanes, 9> R{1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0};
  rigid::LanePoint from{}, to{};
  Lanes all;       // Σ of the weights
  Lanes can_turn;  // 1 in the lanes with a rotation, 0 elsewhere
  Lanes rms;       // residual per axis, corrected for the degrees of freedom of the fit

  ASTERISM_INLINED rigid::LanePoint operator()(const rigid::LanePoint& a) const {
    rigid::LanePoint b = to;
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) b[i] += R[3 * i + j] * (a[j] - from[j]);
    return b;
  }
};

// The number of axes is a constant of the compiler, which unrolls the loops over them.
template <int D>
ASTERISM_INLINED LaneFit fit_rigid_in(const rigid::LanePairs& pairs) {
  LaneFit fit;
  for (const rigid::LanePair& p : pairs.rows()) {
    fit.all += p.weight;
    for (int d = 0; d < D; ++d) {
      fit.from[d] += p.weight * p.a[d];
      fit.to[d] += p.weight * p.b[d];
    }
  }
  for (int d = 0; d < D; ++d) {
    fit.from[d] = fit.from[d] / fit.all;
    fit.to[d] = fit.to[d] / fit.all;
  }
  if constexpr (D > 1) {
    Lanes S[3][3], size;
    for (const rigid::LanePair& p : pairs.rows())
      for (int i = 0; i < D; ++i) {
        const Lanes a = p.a[i] - fit.from[i], b = p.b[i] - fit.to[i];
        size += 0.5 * p.weight * (a * a + b * b);
        for (int j = 0; j < D; ++j) S[i][j] += p.weight * a * (p.b[j] - fit.to[j]);
      }
    const Lanes excess = pairs.n_pairs() - (static_cast<double>(min_for_rotation(D)) - 1);
    std::array<Lanes, 9> R = fit.R;
    if constexpr (D == 2) {
      for (int lane = 0; lane < kLanes; ++lane) {
        const double angle = std::atan2(S[0][1].at[lane] - S[1][0].at[lane],
                                        S[0][0].at[lane] + S[1][1].at[lane]);
        R[0].at[lane] = R[4].at[lane] = std::cos(angle);
        R[3].at[lane] = std::sin(angle);
        R[1].at[lane] = -R[3].at[lane];
      }
    } else {
      R = rigid::rotation_in_space(S, size, excess);
    }
    fit.can_turn = where(excess, 1.0, 0.0);
    for (int i = 0; i < 9; ++i) fit.R[i] = where(excess, R[i], fit.R[i]);
  }
  Lanes left;
  for (const rigid::LanePair& p : pairs.rows())
    left += p.weight * rigid::squared_distance(fit(p.a), p.b, D);
  const Lanes n = pairs.n_pairs() * D;
  const Lanes free = n - where(fit.can_turn, 0.5 * D * (D + 1), D);
  fit.rms = square_root(left / fit.all / D * n / maximum(free, 1.0));
  return fit;
}

}  // namespace asterism
