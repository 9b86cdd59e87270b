// What a hidden track expects of a frame: by its own motion, and where its neighbours carry it.
//
// The carried place is fused with the track's own prediction as a measurement of it would be. Places
// that are carried frame after frame err alike, so that this is for one frame alone: the own state goes
// on untouched until the marker is seen.
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

// The carried place and the track's own may differ by so much, squared and along an axis, against what
// is expected. Where they differ more, the track is less sure of its own than it says.
inline constexpr double kAgreed = 4;

// `state` and its prediction `own`, told of a place; none where the track knows better itself.
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

// Of a state that was predicted to the frame; `place` where its neighbours tell one.
class Expected {
 public:
  Expected(const MotionModel& m, const MotionState& state, const Carried* place)
      : own_(m, state) {
    if (place == nullptr) return;
    if (const std::optional<MotionState> fused = fuse(m, state, own_, *place); fused)
      carried_ = {*fused, Prediction(m, *fused)};
  }

  bool is_carried() const { return carried_.has_value(); }
  // Without looking: where neighbours tell it, as they do.
  const Prediction& prediction() const { return carried_ ? carried_->prediction : own_; }
  // By which a point is likelier. A track may be right by itself where its neighbours are not.
  const Prediction& of(const Point& y) const { return is_own(y) ? own_ : carried_->prediction; }
  // Brings a state as it was predicted to the one in which the point is taken.
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

// What its neighbours say of a believed track in a frame, by what all expected when it came.
struct NeighbourAdvice {
  std::int64_t track = 0;    // its key
  bool is_carried = false;   // where it is hidden it is at `place`, and takes none but one of `may_take`
  bool is_doubtful = false;  // that place is not known well enough to live by
  bool gives_way = false;    // where it was seen it is a hidden one come back: so far it goes, no further
  Carried place;
  std::vector<std::int32_t> may_take;
  std::vector<std::pair<std::int32_t, double>> says;  // of a detection so many nats

  double of(std::int32_t column) const {
    for (const auto& [j, nats] : says)
      if (j == column) return nats;
    return 0;
  }
};

}  // namespace asterism
