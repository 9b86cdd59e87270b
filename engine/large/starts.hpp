// New tracks of a large scene: chains of detections through the last few frames that no track has.
//
// From one position follows no velocity, so the nearest detection of the next frame is often
// another marker's. A start is therefore decided over several frames at once. A chain begins at a
// detection of the oldest frame and takes at most one detection of each later frame, within the gate
// of its own Kalman prediction. Its score is the log odds of one marker against clutter
// (tracks/live_tracks.hpp). Of two chains that share a detection the one with the higher score is
// selected, the best of all first. Whether a chain is selected depends only on chains with which it
// is connected by shared detections, and not on the number of threads.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "base/parallel.hpp"
#include "filter/gating.hpp"
#include "filter/imm.hpp"
#include "filter/track_filter.hpp"
#include "large/spatial_order.hpp"
#include "large/tile.hpp"
#include "tracks/live_tracks.hpp"

namespace asterism {

inline constexpr int kMaxStartFrames = 8;

struct StartOptions {
  double gate = 0;              // χ² gate of a link
  int min_detections = 3;
  int max_missed = 1;           // frames without a detection
  double min_score = 0;
  std::int64_t max_chains = 0;  // of one detection; the best are kept
};

// A frame of the window, with the step that leads to it and the detections that no track has.
struct StartFrame {
  double time = 0;
  MotionStep step;
  std::vector<Point> points;
};

struct StartChain {
  double score = 0;
  std::array<std::int32_t, kMaxStartFrames> path{};  // point in each frame of the window, or -1
};

class ChainSearch {
 public:
  ChainSearch(const MotionModel& m, const PairingGains& gains, const StartOptions& options,
              std::span<const StartFrame> frames)
      : m_(m), gains_(gains), opt_(options), frames_(frames), grids_(frames.size()) {
    for (std::size_t f = 1; f < frames.size(); ++f)
      grids_[f].build(frames[f].points, m.axis.D, cell(frames[f].time - frames[f - 1].time));
    // The largest gain of a detection, at the centre of the narrowest prediction.
    const double peak = log_density(m.axis.D, m.axis.r, 0);
    max_gain_ = std::max(gains.hit(0), gains.hit(1)) + peak;
  }

  // Adds the chains from one detection of the first frame, best first.
  void from(std::int32_t a, std::vector<StartChain>& out) const {
    Memory memory;
    StartChain chain;
    chain.path.fill(-1);
    chain.path[0] = a;
    const Point& y = frames_[0].points[a];
    chain.score = gains_.sm.log_birth + gains_.sm.log_detect - gains_.sm.log_clutter;
    const std::size_t first = out.size();
    extend(1, 1, 0, y, frames_[0].time, begin_state(m_, y), chain, memory, out);
    const auto begin = out.begin() + static_cast<std::ptrdiff_t>(first);
    std::sort(begin, out.end(), is_better);
    if (out.end() - begin > opt_.max_chains) out.resize(first + opt_.max_chains);
  }

  static bool is_better(const StartChain& a, const StartChain& b) {
    return a.score != b.score ? a.score > b.score : a.path < b.path;
  }

 private:
  // The states of each depth of the search.
  struct Memory {
    std::array<MotionState, kMaxStartFrames> predicted, updated;
  };

  // Cells a little wider than a typical displacement, which bounds the number of cells in a gate.
  double cell(double dt) const {
    const double sigma = std::sqrt(m_.axis.P0[m_.axis.n > 1 ? m_.axis.n + 1 : 0]);
    return 2 * std::max(sigma * (m_.axis.n > 1 ? dt : 1), std::sqrt(m_.axis.r));
  }

  void extend(std::size_t f, int n_taken, int n_missed, const Point& last, double last_time,
              const MotionState& from, StartChain& chain, Memory& memory,
              std::vector<StartChain>& out) const {
    if (f == frames_.size()) {
      if (n_taken >= opt_.min_detections && chain.score > opt_.min_score) out.push_back(chain);
      return;
    }
    const auto n_left = static_cast<int>(frames_.size() - f);
    if (n_taken + n_left < opt_.min_detections) return;
    if (chain.score + n_left * max_gain_ < opt_.min_score) return;
    MotionState& state = memory.predicted[f];
    copy_state(m_, from, state);
    predict(m_, frames_[f].step, state);
    const Prediction prediction(m_, state);
    const double before = chain.score, hit = gains_.hit(n_missed);
    const double dt = frames_[f].time - last_time;
    const double reach = gains_.sm.max_speed * dt + gains_.sm.speed_margin;
    // A link that leaves no hope for the score is not followed.
    const double least = opt_.min_score - before - (n_left - 1) * max_gain_ - hit;
    const double radius = prediction.radius(opt_.gate, least, grids_[f].max_r());
    std::array<double, kMaxModes> each{};
    if (radius >= 0)
      grids_[f].within(prediction.center, std::min(radius, reach_from(prediction, last, reach)),
                       [&](std::int32_t j, double) {
        const Point& y = frames_[f].points[j];
        if (squared_distance(last, y, m_.axis.D) > reach * reach) return;
        if (!prediction.is_gated(y, opt_.gate)) return;
        const double log_likelihood = prediction.log_likelihood(y, each);
        if (!(log_likelihood >= least)) return;
        MotionState& next = memory.updated[f];
        copy_state(m_, state, next);
        update(m_, each, log_likelihood, y, next);
        chain.path[f] = j;
        chain.score = before + hit + log_likelihood;
        extend(f + 1, n_taken + 1, 0, y, frames_[f].time, next, chain, memory, out);
      });
    chain.path[f] = -1;
    chain.score = before + gains_.miss(n_missed);
    // After a missed second frame the third one has most of the search and few of the tracks. Such
    // a track starts one frame later.
    if (f > 1 && static_cast<int>(f) - n_taken < opt_.max_missed)
      extend(f + 1, n_taken, n_missed + 1, last, last_time, state, chain, memory, out);
    chain.score = before;
  }
  // Every point that the track can have reached lies this close to the prediction.
  double reach_from(const Prediction& prediction, const Point& last, double reach) const {
    return reach + std::sqrt(squared_distance(prediction.center, last, m_.axis.D));
  }

  const MotionModel& m_;
  const PairingGains& gains_;
  const StartOptions& opt_;
  std::span<const StartFrame> frames_;
  std::vector<PointGrid> grids_;
  double max_gain_ = 0;
};

// The selected chains, ordered by their first detection.
inline std::vector<StartChain> find_starts(const MotionModel& m, const PairingGains& gains,
                                      const StartOptions& options,
                                      std::vector<StartFrame> frames, std::int32_t n_threads) {
  constexpr std::int64_t per_task = 1024;
  std::vector<std::vector<std::int32_t>> order;
  const double cell = cell_of(frames[0].points, m.axis.D);
  for (StartFrame& frame : frames) order.push_back(sort_in_space(frame.points, m.axis.D, cell));
  const ChainSearch search(m, gains, options, frames);
  const auto n = static_cast<std::int64_t>(frames[0].points.size());
  std::vector<std::vector<StartChain>> found((n + per_task - 1) / per_task);
  in_parallel(static_cast<std::int64_t>(found.size()), n_threads, [&](std::int32_t, std::int64_t k) {
    for (std::int64_t a = k * per_task; a < std::min(n, (k + 1) * per_task); ++a)
      search.from(static_cast<std::int32_t>(a), found[k]);
    for (StartChain& chain : found[k])
      for (std::size_t f = 0; f < frames.size(); ++f)
        if (chain.path[f] >= 0) chain.path[f] = order[f][chain.path[f]];
  });
  std::vector<StartChain> all;
  for (std::vector<StartChain>& part : found) {
    all.insert(all.end(), part.begin(), part.end());
    part = {};
  }
  std::sort(all.begin(), all.end(), ChainSearch::is_better);
  std::vector<std::vector<char>> is_taken;
  for (const StartFrame& frame : frames) is_taken.emplace_back(frame.points.size(), 0);
  std::vector<StartChain> selected;
  for (const StartChain& chain : all) {
    bool is_free = true;
    for (std::size_t f = 0; f < frames.size() && is_free; ++f)
      is_free = chain.path[f] < 0 || !is_taken[f][chain.path[f]];
    if (!is_free) continue;
    for (std::size_t f = 0; f < frames.size(); ++f)
      if (chain.path[f] >= 0) is_taken[f][chain.path[f]] = 1;
    selected.push_back(chain);
  }
  std::sort(selected.begin(), selected.end(),
            [](const StartChain& a, const StartChain& b) { return a.path[0] < b.path[0]; });
  return selected;
}

}  // namespace asterism
