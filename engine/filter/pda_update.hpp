// Probabilistic data association: updates a state with several detections at once, weighted by
// their association probabilities, and approximates the mixture by one Gaussian (Bar-Shalom & Tse
// 1975).
//
//   u_j, u_0  association probability of detection j and of a miss; they sum to 1     ν_j = y_j - ŷ
//   a_j       factor of the gain for a detection with its own variance, else 1
//   x = x̂ + K Σ u_j a_j ν_j
//   P = u_0 P̂ + (1 - u_0) P⁺ + K Kᵀ ((Σ u_j |a_j ν_j|² - |Σ u_j a_j ν_j|²) / D + S Σ u_j (1 - a_j))
//
// The axes share one covariance, so the spread of the innovations is averaged over them. Each mode
// of the motion model has its own association probabilities.
#pragma once

#include <cmath>
#include <span>
#include <vector>

#include "filter/imm.hpp"

namespace asterism {

struct WeightedPoint {
  Point y{};
  double weight = 0;
};

inline void update_axis(const AxisModel& m, std::span<const WeightedPoint> points, double missed,
                        AxisState& s) {
  const KalmanGain gain(m, s);
  const Point predicted = observed(m, s);
  Point mean{};
  double square = 0, wider = 0;
  for (const auto& [y, weight] : points) {
    const double share = gain.share(y);
    for (int d = 0; d < m.D; ++d) mean[d] += weight * share * (y[d] - predicted[d]);
    square += weight * share * share * squared_distance(y, predicted, m.D);
    wider += weight * gain.S * (1 - share);
  }
  for (int d = 0; d < m.D; ++d) square -= mean[d] * mean[d];
  const double spread = std::max(square, 0.0) / m.D + wider;
  for (int d = 0; d < m.D; ++d)
    for (int i = 0; i < m.n; ++i) s.x[d][i] += gain.K[i] * mean[d];
  for (int i = 0; i < m.n; ++i)
    for (int j = 0; j < m.n; ++j) {
      double& P = s.P[i * m.n + j];
      P = missed * P + (1 - missed) * gain.P[i * m.n + j] + gain.K[i] * gain.K[j] * spread;
    }
}

// `p` must be the prediction from this state.
inline void update_by_all(const MotionModel& m, const Prediction& p,
                          std::span<const WeightedPoint> points, double missed, MotionState& s) {
  std::vector<WeightedPoint> own(points.begin(), points.end());
  std::vector<std::array<double, kMaxModes>> each(points.size());
  std::vector<double> total(points.size());
  for (std::size_t j = 0; j < points.size(); ++j)
    total[j] = p.log_likelihood(points[j].y, each[j]);
  for (int b = 0; b < m.M; ++b) {
    const double own_missed = m.M > 1 ? missed * s.w[b] : missed;
    double w = own_missed;
    for (std::size_t j = 0; j < points.size(); ++j)
      w += own[j].weight = points[j].weight * std::exp(each[j][b] - total[j]);
    // A mode whose weight vanishes keeps its prediction.
    if (w > 1e-300) {
      for (WeightedPoint& point : own) point.weight /= w;
      update_axis(m.axis, own, own_missed / w, s.mode[b]);
    }
    if (m.M > 1) s.w[b] = std::max(w, 1e-300);
  }
}

}  // namespace asterism
