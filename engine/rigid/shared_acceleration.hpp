// Markers of one segment accelerate together: the density of a detection, given the detections of
// bonded markers in the same frame.
//
// The markers are ordered. The joint density of the detections of a frame is the product of one
// conditional density each, given the past and the markers before it. That of a marker is a mixture
// of kComponents predictions, with weights that are learnt for each marker:
//
//   own    by the marker's own motion: ŷ_m with variance P_m + r in mode m
//   still  own, and the place ŷ with the variance β S, for two β: no acceleration. Where neighbours
//          tell nothing, these are as good as the next ones.
//   wide   own, with the variance kWide (P_m + r): jolts of a marker that its neighbours do not share
//   field  own, and the acceleration of the segment at the marker. That of neighbour j is
//          a_j = y_j(t) - 2 y_j(t-1) + y_j(t-2). An affine field is fitted to them:
//            a(x) = c₀ + C x / (l √2),  Σ_j |a_j - a(x_j)|² + λ (|c₀|² + |C|²) minimal
//          x_j  position of neighbour j relative to the marker, in frame t-1
//          l    root mean square of their distances
//          At the marker it is Σ w_j a_j. The place ŷ + Σ w_j a_j has the variance
//          6 r Σ w_j² + β S, where S is the variance of the own prediction.
//   rigid  own, and the place to which the rigid motion of the neighbours since the marker's last
//          detection carries it (rigid/carried.hpp), with its variance times two factors
//   shape  own and rigid, and the place that the marker has in the shape of the segment: the rigid
//          motion is that of the neighbours from a frame in which the distances were usual
//
// A place is combined with the own prediction of every mode like a measurement. The neighbours are
// the kSteadiest markers before it with the steadiest bonds that are detected in both frames.
//
// The first detection of a track is anywhere in the volume, or at the place that the marker has in
// the shape, with kBegin times its variance. The weights of both are learnt for each marker as well.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "filter/imm.hpp"
#include "rigid/bond.hpp"
#include "rigid/carried.hpp"

namespace asterism {

// A prediction of a marker: a Gaussian for each mode of its own motion, alone or combined with a
// place to which neighbours lead.
struct PredictionByMode {
  std::array<double, kMaxModes> log_w{}, P{};  // P: without the variance of the sensor
  std::array<Point, kMaxModes> at{};
  Point center{};
  double S = 0;  // variance of a measured coordinate
  double r = 0;  // that of the sensor
  int M = 1;

  PredictionByMode() = default;
  PredictionByMode(const Prediction& p, double noise)
      : center(p.center), S(p.variance()), r(noise), M(p.M) {
    for (int m = 0; m < M; ++m) {
      log_w[m] = std::log(p.w[m]);
      P[m] = p.S[m] - r;
      at[m] = p.y[m];
    }
  }
  PredictionByMode(const Point& only, double variance, double noise)
      : center(only), S(variance), r(noise) {
    P[0] = S - r;
    at[0] = only;
  }
};

class SharedAcceleration {
 public:
  static constexpr std::array<double, 2> kField{0.1, 0.5};   // β
  static constexpr std::array<double, 2> kRigid{0.25, 1};    // factors of the variance
  static constexpr double kWide = 8, kBegin = 4;             // factors of the variance
  // Own, still, wide, field and rigid; then own and rigid with the shape.
  static constexpr std::size_t kWideAt = 1 + kField.size(), kStart = kWideAt + 1;
  static constexpr std::size_t kTurn = kStart + kField.size();
  static constexpr std::size_t kShape = kTurn + kRigid.size();
  static constexpr std::size_t kComponents = kShape + 1 + kRigid.size();
  using Densities = std::array<double, kComponents>;

  // A marker before another one in the order, with a bond to it.
  struct Neighbour {
    std::int32_t marker = 0;
    double weight = 0;  // 1 / predictive variance of the distance
    double distance = 0;
    Point shape{};  // where it is in the shape, NaN if that is not known
  };
  struct Marker {
    std::vector<Neighbour> before;    // by increasing variance
    std::vector<std::int32_t> after;  // the markers that have it as a neighbour
    Point shape{};
    Densities log_weight{}, log_begin{};  // log_begin: of the first detection of a track
  };
  // A detection of a marker in a frame, and the one before it.
  struct Link {
    std::int32_t marker = 0;
    std::int64_t from = 0, to = 0;  // frames
    Point then{}, now{};
    bool is_moving = false;  // whether there is a detection before both, and so a velocity
  };
  struct Memory {
    RigidPredictions predictions;
  };
  // The predictions of a detection by the components that there are.
  struct Mixture {
    std::array<PredictionByMode, kComponents> each;
    std::array<bool, kComponents> has{};

    void set(std::size_t c, const PredictionByMode& prediction) {
      each[c] = prediction;
      has[c] = true;
    }
  };
  struct Moments {
    Point at{};
    double variance = 0;  // of a measured coordinate
  };

  SharedAcceleration(int D, double volume, std::vector<Marker> markers)
      : D_(D), log_volume_(std::log(volume)), markers_(std::move(markers)) {
    for (std::size_t k = 0; k < markers_.size(); ++k)
      for (const Neighbour& other : markers_[k].before)
        markers_[other.marker].after.push_back(static_cast<std::int32_t>(k));
  }

  int n_axes() const { return D_; }
  std::size_t size() const { return markers_.size(); }
  const Marker& operator[](std::int32_t marker) const { return markers_[marker]; }
  bool has_neighbours(std::int32_t marker) const {
    return !markers_[marker].before.empty() || !markers_[marker].after.empty();
  }

  // Predicts a detection. `place_of(marker, frame)` is the detection of another marker, or null.
  template <typename PlaceOf>
  void predict(const PredictionByMode& own, const Link& link, PlaceOf&& place_of, Memory& memory,
               Mixture& out) const {
    out.has.fill(false);
    out.set(0, own);
    Sight sight;
    for (const Neighbour& other : markers_[link.marker].before) {
      const Point* now = place_of(other.marker, link.to);
      if (now == nullptr) continue;
      if (sight.n_shape < kSteadiest && !std::isnan(other.shape[0]))
        sight.shape[sight.n_shape++] = {other.shape, *now, other.weight};
      const Point* then = sight.n == kSteadiest ? nullptr : place_of(other.marker, link.from);
      if (then == nullptr) continue;
      sight.pairs[sight.n++] = {*then, *now, other.weight};
      if (!link.is_moving || link.to != link.from + 1) continue;
      const Point* earlier = place_of(other.marker, link.from - 1);
      if (earlier == nullptr) continue;
      sight.squares += other.distance * other.distance;
      sight.arms[sight.n_arms++] = arm(link.then, *earlier, *then, *now);
    }
    if (sight.n + sight.n_shape > 0) with_neighbours(own, link, sight, memory, out);
  }

  // The log density of a detection by each component, -inf for one that there is not.
  Densities densities(const Mixture& mixture, const Point& y) const;
  // The same for the first detection of a track: "own" is that of the volume. `r` is the variance of
  // the sensor.
  template <typename PlaceOf>
  Densities begin_densities(std::int32_t marker, std::int64_t frame, const Point& y, double r,
                            PlaceOf&& place_of, Memory& memory) const {
    Sight sight;
    for (const Neighbour& other : markers_[marker].before) {
      if (sight.n_shape == kSteadiest) break;
      if (std::isnan(other.shape[0])) continue;
      if (const Point* now = place_of(other.marker, frame); now != nullptr)
        sight.shape[sight.n_shape++] = {other.shape, *now, other.weight};
    }
    return begin_densities(marker, sight, y, r, memory);
  }
  // The log density by the mixture, less that of its first component.
  double gain(std::int32_t marker, const Densities& each) const {
    return gain(markers_[marker].log_weight, each);
  }
  double begin_gain(std::int32_t marker, const Densities& each) const {
    return gain(markers_[marker].log_begin, each);
  }
  Moments moments(std::int32_t marker, const Mixture& mixture) const;

 private:
  static constexpr double kNever = -std::numeric_limits<double>::infinity();
  static constexpr double kRidge = 0.05;  // λ

  // A neighbour's position relative to the marker, and its acceleration in a step.
  struct Arm {
    Point x{}, a{};
  };
  // What is seen of the neighbours.
  struct Sight {
    std::array<RigidPair, kSteadiest> pairs, shape;
    std::array<Arm, kSteadiest> arms;
    std::size_t n = 0, n_shape = 0, n_arms = 0;
    double squares = 0;  // sum of the squared distances of the arms
  };
  struct Field {
    Point acceleration{};
    double noise = 0;
  };

  Arm arm(const Point& marker, const Point& earlier, const Point& then, const Point& now) const {
    Arm out;
    for (int d = 0; d < D_; ++d) {
      out.x[d] = then[d] - marker[d];
      out.a[d] = now[d] - 2 * then[d] + earlier[d];
    }
    return out;
  }
  void with_neighbours(const PredictionByMode& own, const Link& link, const Sight& sight,
                       Memory& memory, Mixture& out) const;
  Densities begin_densities(std::int32_t marker, const Sight& sight, const Point& y, double r,
                            Memory& memory) const;
  static double gain(const Densities& log_weight, const Densities& each);
  Field field(std::span<const Arm> arms, double squared_length, double r) const;
  double density(const PredictionByMode& prediction, const Point& y) const;
  // The own prediction, with a place as a measurement of this variance.
  PredictionByMode combined(const PredictionByMode& own, const Point& place, double variance) const;

  int D_;
  double log_volume_;
  std::vector<Marker> markers_;
};

}  // namespace asterism
