// Where its neighbours carry a marker that is not seen, and how sure that is.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <span>

#include "kalman.hpp"
#include "rigid_fit.hpp"

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
// when one rigid motion is fitted to them is how far it may be off.
inline Carried carry(std::span<const RigidPair> neighbours, const Point& then, int D, double noise) {
  const RigidFit fit = fit_rigid(neighbours, D);
  Carried out{fit(then), noise + 0.8 * fit.rms, D};
  const std::size_t least = least_for_rotation(D);
  if (neighbours.size() < least)  // moved along, not turned: the farther off, the worse
    out.scale += 0.3 * std::sqrt(squared_distance(then, fit.from, D));
  else if (neighbours.size() == least)
    out.scale = 1.5 * out.scale + 2 * noise;
  return out;
}

}  // namespace asterism
