// The state prediction of an occluded track, from its own motion and from its rigid neighbours.
//
// The position predicted from neighbours is fused with the track's own prediction as if it were a
// measurement. Its errors are correlated from frame to frame, so it must not enter the filter
// repeatedly. The fused state is therefore used for one frame only, and the track's own state stays
// unchanged until the marker is detected.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "filter/imm.hpp"
#include "rigid/carried.hpp"

namespace asterism {

// Largest squared difference per axis between the two predictions, relative to its expected value.
// If it is exceeded, the covariance of the track's own prediction is inflated.
inline constexpr double kAgreed = 4;

// Fuses a state and its prediction `own` with a carried position. Returns nothing if the track's
// own prediction has the smaller variance.
inline std::optional<MotionState> fuse(const MotionModel& m, const MotionState& state,
                                       const Prediction& own, const Carried& place) {
  const int D = m.axis.D;
  double S = 0;
  for (int b = 0; b < m.M; ++b) S += own.w[b] * own.S[b];
  const double V = place.variance;
  const double apart = squared_distance(place.at, own.center, D) / (D * kAgreed);
  if (!(V < S)) return std::nullopt;
  MotionState fused = state;
  if (apart > S + V)
    for (int b = 0; b < m.M; ++b)
      for (double& P : fused.mode[b].P) P *= apart / S;
  Point carried = place.at;
  carried.r = std::max(V - m.axis.r, 0.0);
  update(m, Prediction(m, fused), carried, fused);
  return fused;
}

// The prediction of one track in a frame. `place` is the position predicted from its neighbours, or
// null.
class Expected {
 public:
  Expected(const MotionModel& m, const MotionState& state, const Carried* place)
      : own_(m, state) {
    if (place == nullptr) return;
    if (const std::optional<MotionState> fused = fuse(m, state, own_, *place); fused)
      carried_ = {*fused, Prediction(m, *fused)};
  }

  bool is_carried() const { return carried_.has_value(); }
  // The prediction before any detection is considered: the fused one if there is one.
  const Prediction& prediction() const { return carried_ ? carried_->prediction : own_; }
  // The prediction under which the detection y is more likely. The neighbours of a track can be
  // wrong while its own motion is right.
  const Prediction& of(const Point& y) const { return is_own(y) ? own_ : carried_->prediction; }
  // Replaces a predicted state by the one in which the detection y is used.
  void choose(const Point& y, MotionState& state) const {
    if (!is_own(y)) state = carried_->state;
  }

 private:
  struct Fused {
    MotionState state;
    Prediction prediction;
  };

  bool is_own(const Point& y) const {
    if (!carried_) return true;
    std::array<double, kMaxModes> each{};
    return own_.log_likelihood(y, each) > carried_->prediction.log_likelihood(y, each);
  }

  Prediction own_;
  std::optional<Fused> carried_;
};

// Information from rigid neighbours on a confirmed track in one frame. It is computed once, when
// the frame arrives.
struct NeighbourAdvice {
  std::int64_t track = 0;    // key of the track
  // The occluded track is predicted at `place` and may only take a detection of `may_take`.
  bool is_carried = false;
  bool is_uncertain = false;  // the variance of `place` is too large to keep the track alive
  // The track is an occluded track reappearing, and is deleted in favour of the old one.
  bool is_reappearance = false;
  Carried place;
  std::vector<std::int32_t> may_take;
  // Log-likelihood ratio from bonds, by detection.
  std::vector<std::pair<std::int32_t, double>> bond_gains;

  double of(std::int32_t column) const {
    for (const auto& [j, nats] : bond_gains)
      if (j == column) return nats;
    return 0;
  }
};

}  // namespace asterism
