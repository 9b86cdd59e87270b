// MCMC data association on a stream: a window of frames in which the chain may still change its mind,
// and behind it what is settled.
//
// Per frame: the exact assignment of its detections to what the tracks expect, as a start; the chain;
// the best partition met; and the frame that leaves the window is settled by it. Of what is settled only
// the filter states are needed, so that frames older than the longest gap are forgotten.
#pragma once

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "assignment.hpp"
#include "fresh.hpp"
#include "live_tracks.hpp"
#include "sampler.hpp"

namespace asterism {

struct McmcOptions {
  std::int32_t window = 1;        // frames until one is settled
  double moves = 0;               // in each frame, for each of its detections or for each track
  double deadline = 0;            // seconds from the frame's arrival; 0: none
  bool has_assignment = true;     // start from the exact assignment; else from no change
};

template <typename Filter>
class McmcTracker {
 public:
  McmcTracker(const MotionModel& m, const ScoreModel& sm, const ChainOptions& chain,
              const McmcOptions& options, std::uint64_t seed)
      : sampler_(m, sm, chain, seed), opt_(options) {}

  template <typename Label>
  FrameStats step(double time, const MotionStep& step, std::span<const Point> points, Label&& label) {
    const FrameStats stats = add(time, step, points);
    name_new();
    tell(label);
    settle();
    return stats;
  }

  // Many frames whose labels are asked for at the end alone.
  template <typename Label>
  FrameStats pass(double time, const MotionStep& step, std::span<const Point> points, Label&& label) {
    const FrameStats stats = add(time, step, points);
    name_new();
    if (oldest_open() <= partition().window().now() - opt_.window) tell(label, oldest_open());
    settle();
    return stats;
  }
  template <typename Label>
  void end_pass(Label&& label) {
    name_new();
    tell(label);
  }

  bool has_confidence() const { return false; }
  std::int64_t n_frames() const { return n_frames_; }
  std::int64_t n_seen() const { return n_seen_; }
  double last_time() const { return last_time_; }
  FrameStats total() const { return total_; }
  const Partition<Filter>& partition() const { return sampler_.partition(); }

  const MotionModel& motion() const { return partition().motion(); }
  std::int64_t n_ids() const { return next_id_ + n_named_; }
  // The tracks as they would be settled now.
  LiveTracks<> live() const {
    const Partition<Filter>& p = partition();
    LiveTracks<> live(p.motion(), p.model(), {});
    live.next_id = n_ids();
    for (const std::int32_t k : p.tracks().items()) {
      const std::int32_t i = p.last(k);
      LiveTrack<NoMore>& track = live.tracks.emplace_back();
      track.id = id_of(k);
      track.gap = static_cast<std::int32_t>(p.window().now() - p.window()[i].frame);
      track.score = p.score(i);
      track.state = state_now(i);
    }
    std::sort(live.tracks.begin(), live.tracks.end(),
              [](const auto& a, const auto& b) { return a.id < b.id; });
    return live;
  }

 private:
  struct Memory {
    std::vector<Candidate> candidates;
    std::vector<std::int32_t> match;
    std::vector<Edit<Filter>> edits;
    Assignment assignment;
  };

  FrameStats add(double time, const MotionStep& step, std::span<const Point> points) {
    const auto arrival = std::chrono::steady_clock::now();
    Partition<Filter>& p = sampler_.partition();
    p.add_frame(time, step, points, n_seen_);
    n_seen_ += static_cast<std::int64_t>(points.size());
    last_time_ = time;
    ++n_frames_;
    FrameStats stats;
    if (opt_.has_assignment) assign(stats);
    run(arrival, stats);
    stats.n_confirmed = p.tracks().size();
    stats.n_pending = p.free().size() + p.taken().size();
    total_.add(stats);
    return stats;
  }

  // The newest frame's detections to the tracks, for the greatest gain in the log posterior.
  void assign(FrameStats& stats) {
    Partition<Filter>& p = sampler_.partition();
    const DetectionWindow& window = p.window();
    const auto& ids = window.frame(window.now()).ids;
    s_.candidates.clear();
    const DetectionWindow::Places& places = *window.frame(window.now()).places;
    std::vector<std::int32_t> rows;
    Expected<typename Filter::State> expected;
    for (const std::int32_t k : p.tracks().items()) {
      const std::int32_t i = p.last(k);
      const std::int64_t gap = window.now() - window[i].frame;
      if (gap < 1 || gap > window.max_gap()) continue;
      Filter::expect(p.motion(), window, p.state(i), window[i].frame, static_cast<int>(gap), expected);
      const double base = p.gap_score(static_cast<int>(gap)) - p.end_score(i);
      const double radius =
          expected.prediction.radius(std::numeric_limits<double>::infinity(), -base);
      if (radius < 0) continue;
      places.grid.within(expected.prediction.center, radius, [&](std::int32_t j, double) {
        const double gain = base + Filter::log_likelihood(expected.prediction, places.points[j]);
        if (gain > 0 && window.is_linkable(i, ids[j]))
          s_.candidates.push_back({static_cast<std::int32_t>(rows.size()), j, gain, 0});
      });
      rows.push_back(k);
    }
    stats.n_candidates = static_cast<std::int64_t>(s_.candidates.size());
    const Groups groups =
        connected_groups(s_.candidates, static_cast<std::int32_t>(rows.size()),
                         static_cast<std::int32_t>(ids.size()));
    stats.n_groups = static_cast<std::int64_t>(groups.size());
    s_.match.assign(rows.size(), -1);
    for (std::size_t g = 0; g < groups.size(); ++g) {
      s_.assignment.solve(groups[g], s_.match);
      stats.largest_group = std::max<std::int64_t>(stats.largest_group, groups[g].size());
    }
    s_.edits.clear();
    for (std::size_t r = 0; r < rows.size(); ++r) {
      if (s_.match[r] < 0) continue;
      Edit<Filter>& edit = s_.edits.emplace_back();
      edit.track = rows[r];
      edit.keep = p.track(rows[r]).size();
      p.append(edit, ids[s_.match[r]]);
    }
    p.apply(s_.edits);
  }

  void run(std::chrono::steady_clock::time_point arrival, FrameStats& stats) {
    const Partition<Filter>& p = partition();
    const auto n_points = static_cast<std::int64_t>(p.window().frame(p.window().now()).ids.size());
    const double n_markers = static_cast<double>(std::max<std::int64_t>(n_points, p.tracks().size()));
    // A deadline alone sets no end to them.
    const double wanted = std::min(std::ceil(opt_.moves * n_markers), 1e15);
    const auto most = static_cast<std::int64_t>(wanted);
    const std::chrono::duration<double> allowed(opt_.deadline);
    sampler_.begin_best();
    std::int64_t n = 0;
    for (; n < most; ++n) {
      if (opt_.deadline > 0 && n % 16 == 0 && std::chrono::steady_clock::now() - arrival > allowed)
        break;
      stats.n_taken += sampler_.step();
    }
    stats.n_moves = n;
    sampler_.restore_best();
  }

  std::int64_t oldest_open() const { return partition().frozen() + 1; }

  // Tracks of which nothing is settled get the numbers that they would be settled with.
  void name_new() {
    Partition<Filter>& p = sampler_.partition();
    std::vector<std::pair<std::int64_t, std::int32_t>> unnamed;  // first detection, track
    for (const std::int32_t k : p.young().items())
      unnamed.emplace_back(p.window()[p.track(k).nodes.front()].number, k);
    std::sort(unnamed.begin(), unnamed.end());
    n_named_ = static_cast<std::int64_t>(unnamed.size());
    for (std::int64_t n = 0; n < n_named_; ++n) p.set_id(unnamed[n].second, next_id_ + n);
  }
  std::int64_t id_of(std::int32_t track) const { return partition().track(track).id; }

  // Tells the labels of the open frames that are not what was told.
  template <typename Label>
  void tell(Label&& label, std::int64_t last = std::numeric_limits<std::int64_t>::max()) {
    const Partition<Filter>& p = partition();
    const DetectionWindow& window = p.window();
    if (static_cast<std::int32_t>(said_.size()) < window.n_ids()) said_.resize(window.n_ids(), -1);
    for (std::int64_t t = oldest_open(); t <= std::min(last, window.now()); ++t)
      for (const std::int32_t i : window.frame(t).ids) {
        const std::int32_t k = p.track_of(i);
        const std::int64_t id = k < 0 ? -1 : id_of(k);
        if (id == said_[i]) continue;
        said_[i] = id;
        label(window[i].number, id, 0.0);
      }
  }

  // Settles what is older than the window, and forgets what nothing can follow any more.
  void settle() {
    Partition<Filter>& p = sampler_.partition();
    const DetectionWindow& window = p.window();
    const std::int64_t settled = window.now() - opt_.window;
    if (settled < oldest_open()) return;
    p.freeze(settled);
    // Numbers of tracks that are settled now are theirs.
    for (const std::int32_t k : p.tracks().items())
      if (p.track(k).n_frozen > 0) next_id_ = std::max(next_id_, id_of(k) + 1);
    while (window.first() + window.max_gap() <= settled) {
      for (const std::int32_t i : window.frame(window.first()).ids)
        if (i < static_cast<std::int32_t>(said_.size())) said_[i] = -1;
      p.drop_frame();
    }
  }

  MotionState state_now(std::int32_t i) const {
    const Partition<Filter>& p = partition();
    const DetectionWindow& window = p.window();
    const int gap = static_cast<int>(window.now() - window[i].frame);
    MotionState out{};
    if constexpr (std::is_same_v<Filter, OneMotion>) {
      out.mode[0] = p.state(i);
      out.w[0] = 1;
    } else {
      out = p.state(i);
    }
    for (int d = 1; d <= gap; ++d) predict(p.motion(), window.frame(window[i].frame + d).step, out);
    return out;
  }

  Sampler<Filter> sampler_;
  McmcOptions opt_;
  std::vector<std::int64_t> said_;  // by detection of the window
  std::int64_t next_id_ = 0, n_named_ = 0;
  FrameStats total_;
  std::int64_t n_frames_ = 0, n_seen_ = 0;
  double last_time_ = -std::numeric_limits<double>::infinity();
  Fresh<Memory> s_;
};

}  // namespace asterism
