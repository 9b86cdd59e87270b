#include "rigid/shared_acceleration.hpp"

#include <numbers>
#include <utility>

#include "math/logarithm.hpp"

namespace asterism {

namespace {

constexpr int kTerms = 1 + kMaxAxes;  // of an affine field along an axis
using FieldMatrix = std::array<std::array<double, kTerms>, kTerms>;

// Solves A c = e₀ for a symmetric positive definite matrix of size n, by A = L Lᵀ in place.
std::array<double, kTerms> solve_first(FieldMatrix& A, int n) {
  std::array<double, kTerms> c{1};
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j <= i; ++j) {
      double sum = A[i][j];
      for (int k = 0; k < j; ++k) sum -= A[i][k] * A[j][k];
      A[i][j] = i == j ? std::sqrt(sum) : sum / A[j][j];
    }
    for (int k = 0; k < i; ++k) c[i] -= A[i][k] * c[k];
    c[i] /= A[i][i];
  }
  for (int i = n; i-- > 0;) {
    for (int k = i + 1; k < n; ++k) c[i] -= A[k][i] * c[k];
    c[i] /= A[i][i];
  }
  return c;
}

// Subtracts the logarithm of the sum of exponentials, and returns it.
double normalise(std::span<double> logs) {
  const double highest = *std::ranges::max_element(logs);
  double sum = 0;
  for (const double x : logs) sum += std::exp(x - highest);
  const double all = highest + std::log(sum);
  for (double& x : logs) x -= all;
  return all;
}

}  // namespace

void SharedAcceleration::with_neighbours(const PredictionByMode& own, const Link& link,
                                         const Sight& sight, Memory& memory, Mixture& out) const {
  const std::size_t n_min = min_for_rotation(D_);
  PredictionByMode wide = own;
  for (int m = 0; m < own.M; ++m) wide.P[m] += (kWide - 1) * (own.P[m] + own.r);
  out.set(kWideAt, wide);
  if (sight.n_arms > 0) {
    const double n = static_cast<double>(sight.n_arms);
    const Field found = field({sight.arms.data(), sight.n_arms}, sight.squares / n, own.r);
    Point place = own.center;
    for (int d = 0; d < D_; ++d) place[d] += found.acceleration[d];
    for (std::size_t k = 0; k < kField.size(); ++k) {
      const double variance = kField[k] * own.S;
      out.set(1 + k, combined(own, own.center, variance));
      out.set(kStart + k, combined(own, place, found.noise + variance));
    }
  }
  // Both rigid motions are fitted at once.
  struct Motion {
    std::span<const RigidPair> pairs;
    const Point* was;
    Carried* found;
  };
  Carried rigid, shape;
  std::array<Motion, 2> motions;
  std::size_t n = 0;
  if (sight.n >= n_min) motions[n++] = {{sight.pairs.data(), sight.n}, &link.then, &rigid};
  const bool has_shape = sight.n_shape >= n_min;
  if (has_shape)
    motions[n++] = {{sight.shape.data(), sight.n_shape}, &markers_[link.marker].shape, &shape};
  memory.predictions.each(
      D_, own.r, std::span(motions).first(n),
      [](const Motion& one, Point& was) {
        was = *one.was;
        return one.pairs;
      },
      [&](const Motion& one, const RigidPrediction& prediction) {
        *one.found = prediction.place(own.r, 1);
      });
  const auto add_rigid = [&](const PredictionByMode& before, std::size_t first) {
    if (sight.n < n_min) return;
    for (std::size_t k = 0; k < kRigid.size(); ++k)
      out.set(first + k, combined(before, rigid.at, kRigid[k] * rigid.variance));
  };
  add_rigid(own, kTurn);
  if (!has_shape) return;
  const PredictionByMode shaped = combined(own, shape.at, shape.variance);
  out.set(kShape, shaped);
  add_rigid(shaped, kShape + 1);
}

SharedAcceleration::Densities SharedAcceleration::densities(const Mixture& mixture,
                                                            const Point& y) const {
  Densities out;
  for (std::size_t c = 0; c < kComponents; ++c)
    out[c] = mixture.has[c] ? density(mixture.each[c], y) : kNever;
  return out;
}

SharedAcceleration::Moments SharedAcceleration::moments(std::int32_t marker,
                                                        const Mixture& mixture) const {
  Moments out;
  double total = 0, squares = 0;
  const auto each = [&](auto&& use) {
    for (std::size_t c = 0; c < kComponents; ++c)
      for (int m = 0; mixture.has[c] && m < mixture.each[c].M; ++m)
        use(mixture.each[c], m, std::exp(markers_[marker].log_weight[c] + mixture.each[c].log_w[m]));
  };
  each([&](const PredictionByMode& one, int m, double w) {
    total += w;
    for (int d = 0; d < D_; ++d) out.at[d] += w * one.at[m][d];
  });
  for (int d = 0; d < D_; ++d) out.at[d] /= total;
  each([&](const PredictionByMode& one, int m, double w) {
    squares += w * (one.P[m] + one.r + squared_distance(one.at[m], out.at, D_) / D_);
  });
  out.variance = squares / total;
  return out;
}

SharedAcceleration::Densities SharedAcceleration::begin_densities(std::int32_t marker,
                                                                  const Sight& sight, const Point& y,
                                                                  double r, Memory& memory) const {
  Densities out;
  out.fill(kNever);
  out[0] = -log_volume_;
  if (sight.n_shape < min_for_rotation(D_)) return out;
  const std::span pairs(sight.shape.data(), sight.n_shape);
  memory.predictions.each(
      D_, r, std::span(&pairs, 1),
      [&](const auto& one, Point& was) {
        was = markers_[marker].shape;
        return one;
      },
      [&](const auto&, const RigidPrediction& prediction) {
        const Carried place = prediction.place(r, 1);
        out[kShape] = density(PredictionByMode(place.at, kBegin * place.variance + r, r), y);
      });
  return out;
}

double SharedAcceleration::gain(const Densities& log_weight, const Densities& each) {
  Densities weight{}, joint{};
  std::size_t n = 0;
  for (std::size_t c = 0; c < kComponents; ++c) {
    if (!(each[c] > kNever)) continue;
    weight[n] = log_weight[c];
    joint[n] = weight[n] + each[c];
    ++n;
  }
  if (n == 1) return 0;
  return normalise(std::span(joint).first(n)) - normalise(std::span(weight).first(n)) - each[0];
}

SharedAcceleration::Field SharedAcceleration::field(std::span<const Arm> arms,
                                                    double squared_length, double r) const {
  const double scale = 1 / std::sqrt(2 * squared_length);
  const int n = 1 + D_;
  const auto row = [&](const Arm& one) {
    std::array<double, kTerms> b{1};
    for (int d = 0; d < D_; ++d) b[1 + d] = one.x[d] * scale;
    return b;
  };
  FieldMatrix A{};
  for (int i = 0; i < n; ++i) A[i][i] = kRidge;
  for (const Arm& one : arms) {
    const auto b = row(one);
    for (int i = 0; i < n; ++i)
      for (int j = 0; j <= i; ++j) A[i][j] += b[i] * b[j];
  }
  const auto c = solve_first(A, n);
  Field out;
  double squares = 0;
  for (const Arm& one : arms) {
    const auto b = row(one);
    double w = 0;
    for (int i = 0; i < n; ++i) w += b[i] * c[i];
    squares += w * w;
    for (int d = 0; d < D_; ++d) out.acceleration[d] += w * one.a[d];
  }
  out.noise = 6 * r * squares;
  return out;
}

double SharedAcceleration::density(const PredictionByMode& own, const Point& y) const {
  std::array<double, kMaxModes> logs{};
  for (int m = 0; m < own.M; ++m) {
    const double S = own.P[m] + own.r + y.r;
    logs[m] = own.log_w[m] - 0.5 * (squared_distance(y, own.at[m], D_) / S + D_ * logarithm(S));
  }
  constexpr double log_2pi = 1.8378770664093454836;
  return normalise(std::span(logs).first(static_cast<std::size_t>(own.M))) - 0.5 * D_ * log_2pi;
}

PredictionByMode SharedAcceleration::combined(const PredictionByMode& own, const Point& place,
                                              double variance) const {
  PredictionByMode out = own;
  for (int m = 0; m < own.M; ++m) {
    const double spread = own.P[m] + variance, share = own.P[m] / spread;
    const double off2 = squared_distance(place, own.at[m], D_);
    out.log_w[m] -= 0.5 * (off2 / spread + D_ * logarithm(spread));
    for (int d = 0; d < D_; ++d) out.at[m][d] += share * (place[d] - own.at[m][d]);
    out.P[m] = share * variance;
  }
  normalise(std::span(out.log_w).first(static_cast<std::size_t>(own.M)));
  return out;
}

}  // namespace asterism
