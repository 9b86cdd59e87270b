// The fixed continuations of the tracks of a block in the longer capture. The *continuation* of a
// track is its first detection after the block. It and the detections after it stay together,
// whatever precedes them.
#pragma once

#include <cstdint>
#include <memory>
#include <unordered_map>
#include <utility>
#include <vector>

#include "mcmc/model/detection_window.hpp"
#include "mcmc/model/path_filter.hpp"

namespace asterism {

struct LaterPoint {
  std::int64_t frame = 0;
  Point y{};
};
using LaterPoints = std::shared_ptr<const std::vector<LaterPoint>>;

template <typename Filter>
class Continuations {
 public:
  using State = typename Filter::State;

  void clear() { later_.clear(); }
  const LaterPoints& of(std::int32_t i) const { return later_.at(i); }
  void set(std::int32_t i, LaterPoints later) { later_[i] = std::move(later); }

  // Advances the state at continuation i over all later detections. Returns their contribution to
  // the score without gap terms, which do not change.
  double advance(const MotionModel& m, const DetectionWindow& window, Filter& filter,
                 std::int32_t i, State& state) const {
    double gain = 0;
    std::int64_t frame = window[i].frame;
    typename Filter::Expected expected{};
    for (const LaterPoint& next : *of(i)) {
      const State from = state;
      filter.expect(m, window, from, frame, static_cast<int>(next.frame - frame), expected);
      gain += filter.weigh(m, expected, next.y);
      filter.take(m, expected, next.y, state);
      frame = next.frame;
    }
    return gain;
  }
  // A bound of what `advance` returns.
  double max_gain(const DetectionWindow& window, std::int32_t i) const {
    double gain = 0;
    for (const LaterPoint& next : *of(i)) gain += window.frame(next.frame).steps->log_peak;
    return gain;
  }

 private:
  std::unordered_map<std::int32_t, LaterPoints> later_;  // by continuation
};

}  // namespace asterism
