// Where its neighbours carry a marker that is not seen, and how sure that is.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <span>

#include "filter/kalman.hpp"
#include "rigid/rigid_fit.hpp"

namespace asterism {

// Student's t with 3 degrees of freedom about a point, the same along every axis: bodies bend, and now
// and then they bend much.
struct Carried {
  Point at{};
  double scale = 0;
  int D = 3;

  double log_density(const Point& y) const {
    return log_peak() - 0.5 * (kFreedom + D) *
                            std::log1p(squared_distance(y, at, D) / (kFreedom * scale * scale));
  }
  double log_peak() const { return log_unit_peaks()[D] - D * std::log(scale); }

 private:
  static constexpr double kFreedom = 3;

  // Of a scale of 1, by the number of axes.
  static const std::array<double, 4>& log_unit_peaks() {
    static const std::array<double, 4> peaks = [] {
      std::array<double, 4> all{};
      for (int d = 1; d < 4; ++d)
        all[d] = std::lgamma(0.5 * (kFreedom + d)) - std::lgamma(0.5 * kFreedom) -
                 d * 0.5 * std::log(kFreedom * std::numbers::pi);
      return all;
    }();
    return peaks;
  }
};

// From where the neighbours were and are, to where the marker is that was at `then`. What they leave
// when one rigid motion is fitted to them is how far it may be off. Neighbours near one line do not
// determine how far they turned about it: where their noise alone moves the marker by more than kMoved
// of its distance from them, they move it along without turning it, as too few neighbours do.
inline Carried carry(std::span<const RigidPair> neighbours, const Point& then, int D, double noise) {
  constexpr double kMoved = 0.3;
  const std::size_t least = least_for_rotation(D);
  RigidFit fit = fit_rigid(neighbours, D);
  Point arm{};
  double all = 0;
  for (int d = 0; d < D; ++d) arm[d] = fit(then)[d] - fit.to[d];
  for (const RigidPair& p : neighbours) all += p.weight;
  const double far = std::sqrt(squared_distance(then, fit.from, D));
  bool is_turned = neighbours.size() >= least;
  if (D > 1 && is_turned) {
    const double weight = all / static_cast<double>(neighbours.size());
    const double spread2 = weight * turning_variance(neighbours, fit.to, arm, D) / D;
    is_turned = noise * noise * spread2 <= kMoved * kMoved * far * far;
    if (!is_turned) fit = fit_rigid(neighbours, D, false);
  }
  Carried out{fit(then), noise + 0.8 * fit.rms, D};
  if (!is_turned)
    out.scale += kMoved * far;
  else if (neighbours.size() == least)
    out.scale = 1.5 * out.scale + 2 * noise;
  return out;
}

}  // namespace asterism
