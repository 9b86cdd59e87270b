#include "rigid/carried.hpp"

#include <cassert>
#include <limits>

namespace asterism {

namespace {

constexpr double kOffset = 0.3;  // error of a kept offset as a fraction of its length

// tr([d]× J⁻¹ [d]×ᵀ) of the points b about `mean`; infinite for collinear points.
template <int D>
ASTERISM_INLINED Lanes turning_variance(std::span<const rigid::LanePair> pairs,
                                        const rigid::LanePoint& mean, const rigid::LanePoint& d) {
  const Lanes never = std::numeric_limits<double>::infinity();
  Lanes xx, xy, xz, yy, yz, zz;  // Σ b' b'ᵀ / v
  for (const rigid::LanePair& p : pairs) {
    const Lanes x = p.b[0] - mean[0], y = p.b[1] - mean[1], z = p.b[2] - mean[2];
    xx += p.weight * x * x, xy += p.weight * x * y, xz += p.weight * x * z;
    yy += p.weight * y * y, yz += p.weight * y * z, zz += p.weight * z * z;
  }
  const Lanes all = xx + yy + zz, arm2 = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
  if (D == 2) return where(all, arm2 / all, never);
  // J = Σ (|b'|² 1 - b' b'ᵀ) / v
  xx = all - xx, yy = all - yy, zz = all - zz, xy = -xy, xz = -xz, yz = -yz;
  const Lanes det =
      xx * (yy * zz - yz * yz) - xy * (xy * zz - yz * xz) + xz * (xy * yz - yy * xz);
  const Lanes s = 1 / det;
  const Lanes ixx = s * (yy * zz - yz * yz), ixy = s * (xz * yz - xy * zz),
              ixz = s * (xy * yz - xz * yy), iyy = s * (xx * zz - xz * xz),
              iyz = s * (xy * xz - xx * yz), izz = s * (xx * yy - xy * xy);
  const Lanes x = ixx * d[0] + ixy * d[1] + ixz * d[2], y = ixy * d[0] + iyy * d[1] + iyz * d[2],
              z = ixz * d[0] + iyz * d[1] + izz * d[2];
  const Lanes turn = (ixx + iyy + izz) * arm2 - (x * d[0] + y * d[1] + z * d[2]);
  return where(all, where(det - 1e-9 * all * all * all, turn, never), never);
}

struct LanePrediction {
  rigid::LanePoint turned{}, moved{};
  Lanes nearest2, offset2, left, expected, mean, turn;
};

template <int D>
ASTERISM_INLINED void predict_in(const rigid::LanePairs& pairs, const rigid::LanePoint& then,
                                 double noise, LanePrediction& out) {
  const LaneFit fit = fit_rigid_in<D>(pairs);
  const Lanes n = pairs.n_pairs();
  out.turned = fit(then);
  out.moved = then;
  rigid::LanePoint arm{};
  for (int d = 0; d < D; ++d) {
    arm[d] = out.turned[d] - fit.to[d];
    out.moved[d] += fit.to[d] - fit.from[d];
  }
  out.nearest2 = std::numeric_limits<double>::infinity();
  for (const rigid::LanePair& p : pairs.rows())
    out.nearest2 = minimum(rigid::squared_distance(p.a, then, D), out.nearest2);
  out.offset2 = kOffset * kOffset * rigid::squared_distance(then, fit.from, D);
  out.left = maximum(fit.rms * fit.rms - 2 * noise, 0.0) / 3;
  out.expected = n / fit.all;
  out.mean = 1 + 1 / n;
  out.turn = std::numeric_limits<double>::infinity();
  if (D > 1) {
    const Lanes turn = fit.all / n * turning_variance<D>(pairs.rows(), fit.to, arm) / D;
    out.turn = where(fit.can_turn, turn, out.turn);
  }
}
ASTERISM_INLINED void predict_lanes(const rigid::LanePairs& pairs, const rigid::LanePoint& then,
                                    int D, double noise, LanePrediction& out) {
  assert(D >= 1 && D <= kMaxAxes);
  if (D == 3)
    predict_in<3>(pairs, then, noise, out);
  else if (D == 2)
    predict_in<2>(pairs, then, noise, out);
  else
    predict_in<1>(pairs, then, noise, out);
}
#if defined(__GNUC__) && defined(__x86_64__)
// The same for processors with registers of four doubles, with the same result.
[[gnu::target("avx2")]] void predict_by_four(const rigid::LanePairs& pairs,
                                             const rigid::LanePoint& then, int D, double noise,
                                             LanePrediction& out) {
  predict_lanes(pairs, then, D, noise, out);
}
#endif

}  // namespace

void RigidPredictions::add(std::span<const RigidPair> pairs, const Point& then) {
  const std::size_t lane = pairs_.n_lanes();
  pairs_.add(pairs);
  for (int d = 0; d < kMaxAxes; ++d) then_[d].at[lane] = then[d];
}

void RigidPredictions::solve(int D, double noise) {
  LanePrediction all;
  const auto solve_lanes = [&] {
#if defined(__GNUC__) && defined(__x86_64__)
    if (__builtin_cpu_supports("avx2")) return predict_by_four(pairs_, then_, D, noise, all);
#endif
    predict_lanes(pairs_, then_, D, noise, all);
  };
  solve_lanes();
  for (std::size_t lane = 0; lane < pairs_.n_lanes(); ++lane) {
    RigidPrediction& found = found_[lane];
    for (int d = 0; d < kMaxAxes; ++d) {
      found.turned_[d] = all.turned[d].at[lane];
      found.moved_[d] = all.moved[d].at[lane];
    }
    found.nearest2_ = all.nearest2.at[lane];
    found.offset2_ = all.offset2.at[lane];
    found.left_ = all.left.at[lane];
    found.expected_ = all.expected.at[lane];
    found.mean_ = all.mean.at[lane];
    found.turn_ = all.turn.at[lane];
    found.n_ = static_cast<std::int32_t>(pairs_.n_pairs().at[lane]);
  }
}

RigidFit fit_rigid(std::span<const RigidPair> pairs, int D) {
  rigid::LanePairs one;
  one.add(pairs);
  const LaneFit fit =
      D == 3 ? fit_rigid_in<3>(one) : D == 2 ? fit_rigid_in<2>(one) : fit_rigid_in<1>(one);
  RigidFit found;
  for (int i = 0; i < 9; ++i) found.R[i] = fit.R[i].at[0];
  for (int d = 0; d < kMaxAxes; ++d) {
    found.from[d] = fit.from[d].at[0];
    found.to[d] = fit.to[d].at[0];
  }
  found.rms = fit.rms.at[0];
  return found;
}

}  // namespace asterism
