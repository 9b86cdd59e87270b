// Bindings of the tracker of large scenes. Its state is held in Python as plain arrays.
#include <nanobind/stl/tuple.h>

#include <algorithm>
#include <cstdint>
#include <limits>
#include <span>
#include <tuple>
#include <vector>

#include "base/parallel.hpp"
#include "large/packed_states.hpp"
#include "large/starts.hpp"
#include "large/tile.hpp"
#include "python/bindings.hpp"
#include "python/motion_arrays.hpp"

using namespace nb::literals;
using namespace asterism;

namespace {

constexpr std::int64_t kTracksATask = 4096;

// Calls task(i) for every i below n on several threads, with the GIL released.
template <typename Task>
void each_on_threads(std::size_t n, std::int32_t n_threads, Task&& task) {
  nb::gil_scoped_release release;
  const auto size = static_cast<std::int64_t>(n);
  in_parallel((size + kTracksATask - 1) / kTracksATask, n_threads, [&](std::int32_t, std::int64_t k) {
    for (std::int64_t i = k * kTracksATask; i < std::min(size, (k + 1) * kTracksATask); ++i)
      task(static_cast<std::size_t>(i));
  });
}

// Predicted states, and the regions (centre, radius) of W frames: (K, W, D + 1).
auto predict_tracks(const MotionModel& m, double gate, const In<double>& F, const In<double>& Q,
                    const In<double>& states, std::int32_t n_threads) {
  const std::size_t width = packed_width(m), D = m.axis.D;
  require(states.ndim() == 2 && states.shape(1) == width, "states: shape (K, width)");
  const std::size_t n = states.shape(0);
  const std::vector<MotionStep> steps = motion_steps(m, F, Q);
  Owned<double> predicted(n * width), regions(n * steps.size() * (D + 1));
  each_on_threads(n, n_threads, [&](std::size_t i) {
    MotionState s = unpack(m, states.data() + i * width);
    double* region = regions.data.get() + i * steps.size() * (D + 1);
    for (std::size_t f = 0; f < steps.size(); ++f) {
      predict(m, steps[f], s);
      if (f == 0) pack(m, s, predicted.data.get() + i * width);
      const Prediction prediction(m, s);
      region = std::copy_n(prediction.center.begin(), D, region);
      *region++ = prediction.radius(gate, -std::numeric_limits<double>::infinity(), 0);
    }
  });
  return std::tuple(predicted.give({n, width}), regions.give({n, steps.size(), D + 1}));
}

auto counts_of(const TileResult& found) {
  return std::tuple(found.n_candidates, found.n_groups, found.largest_group);
}

auto solve_one_tile(const MotionModel& m, const ScoreModel& score, double gate,
                    std::int64_t max_candidates, const In<double>& times, const In<double>& F,
                    const In<double>& Q, const In<double>& states, const In<double>& regions,
                    const In<double>& last, const In<double>& last_times,
                    const In<double>& scores, const In<std::int32_t>& gaps,
                    const In<std::uint8_t>& is_confirmed, const In<std::int64_t>& offsets,
                    const In<double>& points, const In<std::uint8_t>& is_shared) {
  const std::size_t width = packed_width(m), D = m.axis.D, W = times.size();
  require(states.ndim() == 2 && states.shape(1) == width, "states: shape (K, width)");
  const std::size_t n = states.shape(0);
  require(last_times.size() == n && scores.size() == n && gaps.size() == n &&
              is_confirmed.size() == n,
          "tracks: arrays of the same length");
  require(regions.size() == n * W * (D + 1), "regions: shape (K, W, D + 1)");
  require(W >= 1 && offsets.size() == W + 1, "offsets: shape (W + 1,)");
  const std::vector<Point> from = to_points(last, m.axis.D), all = to_points(points, m.axis.D);
  require(from.size() == n, "last: shape (K, D)");
  require_offsets(flat(offsets), all.size(), "offsets: rising, within the points");
  const std::vector<MotionStep> steps = motion_steps(m, F, Q);
  require(steps.size() == W, "F: one for every frame");
  std::vector<TileFrame> frames(W);
  for (std::size_t f = 0; f < W; ++f)
    frames[f] = {times.data()[f], steps[f],
                 {all.begin() + offsets.data()[f], all.begin() + offsets.data()[f + 1]}};
  require(is_shared.size() == frames[0].points.size(), "is_shared: one for every point");
  TileResult found;
  {
    nb::gil_scoped_release release;
    std::vector<TileTrack> tracks(n);
    for (std::size_t i = 0; i < n; ++i)
      tracks[i] = {unpack(m, states.data() + i * width), from[i], last_times.data()[i],
                   scores.data()[i], gaps.data()[i], is_confirmed.data()[i] != 0};
    std::vector<Region> places(n * W);
    for (std::size_t k = 0; k < places.size(); ++k) {
      const double* row = regions.data() + k * (D + 1);
      std::copy_n(row, D, places[k].center.begin());
      places[k].radius = row[D];
    }
    found = solve_tile(m, PairingGains{score}, gate, max_candidates, tracks, places,
                       std::move(frames), flat(is_shared));
  }
  return std::tuple(array_of<std::int32_t>(found.match),
                    array_of<std::int32_t>(found.candidates, &Candidate::row),
                    array_of<std::int32_t>(found.candidates, &Candidate::column),
                    array_of<double>(found.candidates, &Candidate::gain), counts_of(found));
}

auto solve_joined_groups(const In<std::int32_t>& rows, const In<std::int32_t>& columns,
                         const In<double>& gains, std::int64_t n_tracks, std::int64_t n_points) {
  require(columns.size() == rows.size() && gains.size() == rows.size(),
          "candidates: arrays of the same length");
  std::vector<Candidate> candidates(rows.size());
  for (std::size_t e = 0; e < candidates.size(); ++e) {
    candidates[e] = {rows.data()[e], columns.data()[e], gains.data()[e], 0};
    require(candidates[e].row >= 0 && candidates[e].row < n_tracks && candidates[e].column >= 0 &&
                candidates[e].column < n_points,
            "candidates: rows and columns in range");
  }
  TileResult found;
  {
    nb::gil_scoped_release release;
    found = solve_joined(candidates, n_tracks, n_points);
  }
  return std::tuple(array_of<std::int32_t>(found.match), counts_of(found));
}

// The states and scores after a frame, from the predicted ones.
auto update_tracks(const MotionModel& m, const ScoreModel& score, const In<double>& states,
                   const In<double>& scores, const In<std::int32_t>& gaps,
                   const In<std::int32_t>& match, const In<double>& points,
                   std::int32_t n_threads) {
  const std::size_t width = packed_width(m);
  require(states.ndim() == 2 && states.shape(1) == width, "states: shape (K, width)");
  const std::size_t n = states.shape(0);
  require(scores.size() == n && gaps.size() == n && match.size() == n,
          "tracks: arrays of the same length");
  const std::vector<Point> frame = to_points(points, m.axis.D);
  for (const std::int32_t j : flat(match))
    require(j < static_cast<std::int32_t>(frame.size()), "match: a point or -1");
  const PairingGains gains{score};
  Owned<double> updated(n * width), sums(n);
  each_on_threads(n, n_threads, [&](std::size_t i) {
    const double* before = states.data() + i * width;
    double* after = updated.data.get() + i * width;
    const std::int32_t j = match.data()[i], gap = gaps.data()[i];
    if (j < 0) {
      std::copy_n(before, width, after);
      sums.data.get()[i] = scores.data()[i] + gains.miss(gap);
      return;
    }
    MotionState s = unpack(m, before);
    const double log_likelihood = update(m, Prediction(m, s), frame[j], s);
    pack(m, s, after);
    sums.data.get()[i] = scores.data()[i] + gains.hit(gap) + log_likelihood;
  });
  return std::tuple(updated.give({n, width}), sums.give({n}));
}

// Paths (K, W), states, scores and gaps of the tracks that start.
auto find_all_starts(const MotionModel& m, const ScoreModel& score, const StartOptions& options,
                     const In<double>& times, const In<double>& F, const In<double>& Q,
                     const In<std::int64_t>& offsets, const In<double>& points,
                     std::int32_t n_threads) {
  const std::size_t W = times.size(), width = packed_width(m);
  require(W >= 1 && W <= kMaxStartFrames, "times: 1 to 8 frames");
  require(offsets.size() == W + 1, "offsets: shape (W + 1,)");
  const std::vector<MotionStep> steps = motion_steps(m, F, Q);
  require(steps.size() == W, "F: one for every frame");
  const std::vector<Point> all = to_points(points, m.axis.D);
  require_offsets(flat(offsets), all.size(), "offsets: rising, within the points");
  std::vector<StartFrame> frames(W);
  for (std::size_t f = 0; f < W; ++f)
    frames[f] = {times.data()[f], steps[f],
                 {all.begin() + offsets.data()[f], all.begin() + offsets.data()[f + 1]}};
  std::vector<StartChain> chains;
  const PairingGains gains{score};
  {
    nb::gil_scoped_release release;
    chains = find_starts(m, gains, options, frames, n_threads);
  }
  const std::size_t K = chains.size();
  Owned<std::int32_t> paths(K * W), gaps(K);
  Owned<double> states(K * width), scores(K);
  each_on_threads(K, n_threads, [&](std::size_t k) {
    const StartChain& chain = chains[k];
    MotionState s = begin_state(m, frames[0].points[chain.path[0]]);
    std::int32_t gap = 0;
    for (std::size_t f = 0; f < W; ++f) {
      const std::int32_t j = chain.path[f];
      paths.data.get()[k * W + f] = j;
      if (f == 0) continue;
      predict(m, frames[f].step, s);
      gap = j < 0 ? gap + 1 : 0;
      if (j >= 0) update(m, Prediction(m, s), frames[f].points[j], s);
    }
    pack(m, s, states.data.get() + k * width);
    scores.data.get()[k] = chain.score;
    gaps.data.get()[k] = gap;
  });
  return std::tuple(paths.give({K, W}), states.give({K, width}), scores.give({K}), gaps.give({K}));
}

}  // namespace

void bind_large(nb::module_& module) {
  nb::class_<StartOptions>(module, "StartOptions")
      .def(nb::init<double, int, int, double, std::int64_t>(), nb::kw_only(), "gate"_a,
           "min_detections"_a, "max_missed"_a, "min_score"_a, "max_chains"_a);
  module.def("packed_width", &packed_width, "model"_a);
  module.def("predict_tracks", &predict_tracks, "model"_a, nb::kw_only(), "gate"_a, "F"_a, "Q"_a,
             "states"_a, "n_threads"_a);
  module.def("solve_tile", &solve_one_tile, "model"_a, "score"_a, nb::kw_only(), "gate"_a,
             "max_candidates"_a, "times"_a, "F"_a, "Q"_a, "states"_a, "regions"_a, "last"_a,
             "last_times"_a, "scores"_a, "gaps"_a, "is_confirmed"_a, "offsets"_a, "points"_a,
             "is_shared"_a);
  module.def("solve_joined", &solve_joined_groups, nb::kw_only(), "rows"_a, "columns"_a, "gains"_a,
             "n_tracks"_a, "n_points"_a);
  module.def("update_tracks", &update_tracks, "model"_a, "score"_a, nb::kw_only(), "states"_a,
             "scores"_a, "gaps"_a, "match"_a, "points"_a, "n_threads"_a);
  module.def("find_starts", &find_all_starts, "model"_a, "score"_a, "options"_a, nb::kw_only(),
             "times"_a, "F"_a, "Q"_a, "offsets"_a, "points"_a, "n_threads"_a);
}
