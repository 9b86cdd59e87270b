// Bindings of stitching and of rigid neighbours.
#include <nanobind/stl/optional.h>
#include <nanobind/stl/tuple.h>

#include <algorithm>
#include <limits>
#include <optional>
#include <tuple>

#include "python/arrays.hpp"
#include "python/bindings.hpp"
#include "python/motion_arrays.hpp"
#include "python/stitched.hpp"
#include "rigid/joint_places.hpp"
#include "stitch/distance_exchanges.hpp"

using namespace nb::literals;
using namespace asterism;

namespace {

// A pass through a capture, which is given in parts so that no part need fit in memory twice.
struct StitcherPass {
  Stitcher stitcher;
  std::vector<Decision> decisions;  // by tracklet

  StitcherPass(const MotionModel& m, const StitchOptions& options) : stitcher(m, options) {}

  auto decide() {
    return [this](const Decision& d) {
      const auto n = static_cast<std::size_t>(d.tracklet) + 1;
      if (n > decisions.size()) decisions.resize(n);
      decisions[n - 1] = d;
    };
  }
};

// Processes the next frames and returns the tracklet of each point.
Out<std::int32_t> run_stitcher(StitcherPass& pass, const In<double>& times,
                               const In<std::int32_t>& kind, const In<double>& F,
                               const In<double>& Q, const In<std::int64_t>& offsets,
                               const In<double>& points, const In<std::int64_t>& labels) {
  const FrameRun frames(pass.stitcher.motion(), times, kind, F, Q, offsets, points);
  require(labels.size() == frames.points.size(), "labels: one for each point");
  std::vector<std::int32_t> tracklet_of(labels.size(), -1);
  frames.each([&](std::size_t t, std::size_t from, std::span<const Point> frame) {
    pass.stitcher.step(frames.line.step(t), frame, flat(labels).subspan(from, frame.size()),
                       std::span(tracklet_of).subspan(from, frame.size()), pass.decide());
  });
  return array_of<std::int32_t>(tracklet_of);
}

// Returns for each tracklet its marker, the previous tracklet, and the probability.
nb::tuple finish_stitcher(StitcherPass& pass) {
  pass.stitcher.finish(pass.decide());
  return nb::make_tuple(array_of<std::int32_t>(pass.decisions, &Decision::marker),
                        array_of<std::int32_t>(pass.decisions, &Decision::after),
                        array_of<double>(pass.decisions, &Decision::probability));
}

// Processes one frame of a stream in place: (markers, earlier detections whose marker changes, their
// markers).
nb::tuple step_stitcher(LiveStitcher& stitcher, const In<double>& F, const In<double>& Q,
                        const In<double>& points, const In<std::int64_t>& labels,
                        const In<std::int64_t>& revised, const In<std::int64_t>& revised_labels) {
  const MotionStep step = motion_step(stitcher.motion(), F, Q);
  const std::vector<Point> frame = to_points(points, stitcher.motion().axis.D);
  require(labels.ndim() == 1 && labels.size() == frame.size(), "labels: one for each point");
  require(revised.ndim() == 1 && revised_labels.ndim() == 1 &&
              revised.size() == revised_labels.size(),
          "revised_labels: one for each of revised");
  std::vector<Decided> now(frame.size()), changes(revised.size());
  for (std::size_t i = 0; i < now.size(); ++i) now[i].id = labels.data()[i];
  for (std::size_t i = 0; i < changes.size(); ++i) {
    changes[i] = {revised.data()[i], revised_labels.data()[i]};
    require(changes[i].detection >= 0 && changes[i].detection < stitcher.n_seen(),
            "revised: detections of earlier frames");
  }
  {
    nb::gil_scoped_release release;
    stitch(stitcher, stitcher, step, frame, now, changes);
  }
  return nb::make_tuple(array_of<std::int64_t>(now, &Decided::id),
                        array_of<std::int64_t>(changes, &Decided::detection),
                        array_of<std::int64_t>(changes, &Decided::id));
}

// The states of the markers, from those of the tracklets.
nb::tuple states_of_markers(LiveStitcher& self, const In<std::int64_t>& labels,
                            const In<std::int64_t>& gaps, const In<double>& log_odds,
                            const In<double>& means, const In<double>& covariances) {
  const std::size_t K = labels.size(), D = self.motion().axis.D, n = self.motion().axis.n;
  require(labels.ndim() == 1 && gaps.size() == K && log_odds.size() == K,
          "gaps and log_odds: one for each label");
  require(means.size() == K * D * n && covariances.size() == K * n * n,
          "means and covariances: shape (K, D, n) and (K, n, n)");
  std::vector<TrackNow> tracklets(K);
  for (std::size_t k = 0; k < K; ++k) {
    AxisState state;
    for (std::size_t d = 0; d < D; ++d)
      std::copy_n(means.data() + (k * D + d) * n, n, state.x[d].begin());
    std::copy_n(covariances.data() + k * n * n, n * n, state.P.begin());
    tracklets[k] = {labels.data()[k], gaps.data()[k], log_odds.data()[k], state};
  }
  return marker_states(self, tracklets);
}

// Returns the stretches in which tracks have each other's marker, of all pairs with a track that
// `is_examined`: tracks (n, 2), first frame and end (n, 2), log odds.
nb::tuple exchanged_stretches(const MotionModel& m, const In<double>& times,
                              const In<std::int32_t>& kind, const In<double>& F,
                              const In<double>& Q, const In<double>& points,
                              const In<std::int64_t>& frames, const In<std::int64_t>& offsets,
                              const In<bool>& is_examined, double p_detection, double noise,
                              ExchangeEvidence evidence) {
  require(p_detection >= 0 && p_detection < 1, "p_detection: from 0 to below 1");
  require(noise >= 0, "noise: at least 0");
  require(std::ranges::all_of(flat(points), [](double x) { return std::isfinite(x); }),
          "points: finite");
  const Timeline line = timeline(m, times, kind, F, Q);
  const TrackPoints tracks(points, frames, offsets, m.axis.D, line.times.size());
  require(is_examined.ndim() == 1 && is_examined.size() == tracks.n_tracks(),
          "is_examined: one for each track");
  const std::vector<char> examined(is_examined.data(), is_examined.data() + is_examined.size());
  std::vector<ExchangedStretch> found;
  {
    nb::gil_scoped_release release;
    UsualDistances distances(static_cast<std::int64_t>(line.times.size()), m.axis.D);
    for (std::size_t k = 0; k < tracks.n_tracks(); ++k)
      distances.add(tracks.points_of(k), tracks.frames_of(k));
    distances.measure();
    found = stretches_of_pairs(distances, m, line, p_detection, noise, evidence, examined);
  }
  Owned<std::int64_t> own(2 * found.size()), stretch(2 * found.size());
  for (std::size_t i = 0; i < found.size(); ++i) {
    for (const int side : {0, 1}) own.data[2 * i + side] = found[i].track[side];
    stretch.data[2 * i] = found[i].first;
    stretch.data[2 * i + 1] = found[i].end;
  }
  return nb::make_tuple(own.give({found.size(), 2}), stretch.give({found.size(), 2}),
                        array_of<double>(found, &ExchangedStretch::gain));
}

// Background log density of each point of a frame, given earlier points.
Out<double> background_densities(const In<double>& before, const In<double>& points, double noise,
                                double ghost_radius) {
  require(points.ndim() == 2 && points.shape(1) >= 1 && points.shape(1) <= kMaxAxes,
          "points: shape (n, D)");
  const auto D = static_cast<int>(points.shape(1));
  BackgroundDensity background(D, noise, ghost_radius);
  for (const Point& y : to_points(before, D)) background.add(y);
  Frame frame;
  for (const Point& y : to_points(points, D))
    frame.seen.push_back({static_cast<std::int32_t>(frame.seen.size()), y});
  std::vector<double> peaks;
  background.sum_peaks(frame, peaks);
  return array_of<double>(peaks, [&](double sum) { return background.log_density(sum, frame); });
}

// The markers of a frame, by increasing number.
std::vector<MarkerPoint> to_seen(const In<std::int64_t>& markers, const In<double>& points, int D) {
  const std::vector<Point> at = to_points(points, D);
  require(markers.size() == at.size(), "markers: one for each point");
  std::vector<MarkerPoint> seen;
  for (std::size_t k = 0; k < at.size(); ++k) {
    const std::int64_t marker = markers.data()[k];
    require(marker >= 0 && marker < std::int64_t{1} << 30, "markers: 0 to 2^30");
    require(k == 0 || markers.data()[k - 1] < marker, "markers: rising");
    seen.push_back({static_cast<std::int32_t>(marker), at[k]});
  }
  return seen;
}

// Returns (position, its variance, number of neighbours used) or None.
std::optional<std::tuple<Out<double>, double, std::int32_t>> carry(
    RigidCarrier& self, std::int32_t marker, const In<std::int64_t>& markers,
    const In<double>& points) {
  require(marker >= 0, "marker: 0 to 2^30");
  Places places;
  for (const MarkerPoint& one : to_seen(markers, points, self.n_axes()))
    places.set(one.marker, one.at);
  Carriage found;
  if (!self.carry(marker, places, found)) return std::nullopt;
  const std::span place(found.place.at.begin(), self.n_axes());
  return std::tuple(array_of<double>(place), found.place.variance, found.n_neighbours);
}

// Returns (other markers, frames seen together, mean distances, their variances, predictive
// variances).
// Returns the detection of each track in one frame, -1 for none. `ends`, shape (bonds, 2), are the
// tracks of each bond; `n`, `means` and `variances` its frames and its distance.
Out<std::int32_t> decide_jointly(const In<double>& centers, const In<double>& track_variances,
                                 const In<std::int32_t>& ends, const In<std::int64_t>& n,
                                 const In<double>& means, const In<double>& variances,
                                 const In<double>& points, const In<std::int32_t>& rows,
                                 const In<std::int32_t>& columns, const In<double>& gains) {
  require(centers.ndim() == 2 && points.ndim() == 2 && points.shape(1) == centers.shape(1),
          "centers and points: shape (n, D)");
  require(track_variances.size() == centers.shape(0), "track_variances: one for each track");
  require(ends.size() == 2 * n.size() && means.size() == n.size() && variances.size() == n.size(),
          "ends, n, means and variances: one for each bond");
  require(columns.size() == rows.size() && gains.size() == rows.size(),
          "rows, columns and gains: one for each candidate");
  const int D = static_cast<int>(centers.shape(1));
  const std::vector<Point> at = to_points(centers, D), detections = to_points(points, D);
  std::vector<JointPlaces::Track> tracks;
  for (std::size_t i = 0; i < at.size(); ++i) {
    const auto row = static_cast<std::int32_t>(i);
    tracks.push_back({row, row, at[i], track_variances.data()[i]});
  }
  std::vector<std::vector<Bond>> bonds(at.size());
  for (std::size_t e = 0; e < n.size(); ++e)
    for (const std::size_t end : {2 * e, 2 * e + 1})
      bonds.at(ends.data()[end]).push_back(
          {ends.data()[end ^ 1], n.data()[e], means.data()[e], variances.data()[e]});
  std::vector<Candidate> candidates;
  for (std::size_t c = 0; c < rows.size(); ++c) {
    require(std::cmp_less(rows.data()[c], at.size()) && std::cmp_less(columns.data()[c], detections.size()),
            "rows and columns: of tracks and points");
    candidates.push_back({rows.data()[c], columns.data()[c], gains.data()[c], 0});
  }
  JointPlaces joint;
  joint.begin(tracks, at.size(), D, [&](std::int32_t marker) -> std::span<const Bond> { return bonds[marker]; });
  joint.decide(detections, candidates);
  std::vector<std::int32_t> found;
  for (std::size_t i = 0; i < at.size(); ++i) {
    const Point* place = joint.place(i);
    found.push_back(place == nullptr ? -1 : static_cast<std::int32_t>(place - detections.data()));
  }
  return array_of<std::int32_t>(found);
}

nb::tuple bonds_of(const Neighbours& neighbours, std::int32_t marker) {
  std::vector<Bond> bonds;
  for (const Bond& bond : neighbours.of(marker)) bonds.push_back(bond);
  return nb::make_tuple(
      array_of<std::int64_t>(bonds, &Bond::other), array_of<std::int64_t>(bonds, &Bond::n),
      array_of<double>(bonds, &Bond::mean), array_of<double>(bonds, &Bond::variance),
      array_of<double>(bonds, [&](const Bond& bond) { return neighbours.variance(bond); }));
}

// Returns (predictive variances, whether each is a bond) for distances without measurement noise.
nb::tuple judge_distances(const In<double>& means, const In<double>& variances,
                          const In<std::int64_t>& frames) {
  const std::size_t n = means.size();
  require(means.ndim() == 1 && variances.size() == n && frames.size() == n,
          "means, variances and frames: shape (n,)");
  std::vector<Bond> bonds;
  for (std::size_t k = 0; k < n; ++k)
    bonds.push_back({0, frames.data()[k], means.data()[k], variances.data()[k]});
  return nb::make_tuple(
      array_of<double>(bonds, [](const Bond& bond) { return predictive_variance(bond, 0); }),
      array_of<bool>(bonds, [](const Bond& bond) { return is_bond(bond, 0); }));
}

}  // namespace

void asterism::stitch(LiveStitcher& stitcher, const LiveStitcher& before, const MotionStep& step,
                      std::span<const Point> frame, std::vector<Decided>& now,
                      std::vector<Decided>& revised) {
  std::vector<std::int64_t> labels;
  for (const Decided& one : now) labels.push_back(one.id);
  std::vector<std::pair<std::int64_t, std::int64_t>> changes;
  for (const Decided& one : revised) changes.emplace_back(one.detection, one.id);
  revised.clear();
  if (stitcher.contradicts(changes)) stitcher = before;
  const std::int64_t first = stitcher.n_seen();
  stitcher.step(step, frame, labels, changes, [&](std::int64_t detection, std::int64_t marker) {
    if (detection < first)
      revised.push_back({detection, marker});
    else
      now[detection - first].id = marker;
  });
}

nb::tuple asterism::marker_states(LiveStitcher& stitcher, std::span<const TrackNow> tracklets) {
  const MotionModel& m = stitcher.motion();
  std::vector<std::int64_t> labels;
  for (const TrackNow& one : tracklets) labels.push_back(one.id);
  const std::vector<std::int32_t> markers = stitcher.markers_of(labels);
  Places present;
  std::vector<std::int32_t> known;
  for (std::size_t k = 0; k < tracklets.size(); ++k) {
    if (markers[k] < 0) continue;
    known.push_back(markers[k]);
    if (tracklets[k].gap == 0) present.set(markers[k], observed(m.axis, tracklets[k].state));
  }
  std::sort(known.begin(), known.end());
  const std::vector<LiveStitcher::UnseenMarker> unseen = stitcher.unseen(present, known);
  TrackArrays out(m, known.size() + unseen.size());
  for (std::size_t k = 0; k < tracklets.size(); ++k)
    if (markers[k] >= 0)
      out.add(markers[k], tracklets[k].gap, tracklets[k].log_odds, tracklets[k].state);
  for (const LiveStitcher::UnseenMarker& one : unseen)
    out.add(one.marker, one.gap, std::numeric_limits<double>::quiet_NaN(), one.state);
  return out.give();
}

void bind_stitcher(nb::module_& module) {
  module.attr("BEND") = kBend;
  module.attr("MIN_TOGETHER") = kMinTogether;
  module.def("judge_distances", &judge_distances, "means"_a, "variances"_a, "frames"_a);
  module.def("background_densities", &background_densities, "before"_a, "points"_a, nb::kw_only(),
             "noise"_a, "ghost_radius"_a);
  nb::class_<Neighbours>(module, "Neighbours")
      .def(nb::init<int, double>(), "n_axes"_a, "r"_a)
      .def(
          "add",
          [](Neighbours& self, const In<std::int64_t>& markers, const In<double>& points) {
            self.add(to_seen(markers, points, self.n_axes()));
          },
          "markers"_a, "points"_a)
      .def("of", &bonds_of, "marker"_a);
  module.def("decide_jointly", &decide_jointly, nb::kw_only(), "centers"_a, "track_variances"_a,
             "ends"_a, "n"_a, "means"_a, "variances"_a, "points"_a, "rows"_a, "columns"_a,
             "gains"_a);
  nb::class_<RigidCarrier>(module, "RigidCarrier")
      .def(
          "__init__",
          [](RigidCarrier* self, int n_axes, double noise_sigma) {
            require(n_axes == 2 || n_axes == 3, "n_axes: 2 or 3");
            require(noise_sigma > 0, "noise_sigma: above 0");
            new (self) RigidCarrier(n_axes, noise_sigma * noise_sigma);
          },
          nb::kw_only(), "n_axes"_a, "noise_sigma"_a)
      .def(
          "see",
          [](RigidCarrier& self, const In<std::int64_t>& markers, const In<double>& points) {
            self.see(to_seen(markers, points, self.n_axes()));
          },
          "markers"_a, "points"_a)
      .def("carry", &carry, "marker"_a, "markers"_a, "points"_a)
      .def(
          "n_bonds",
          [](const RigidCarrier& self, std::int32_t marker) {
            std::int64_t n = 0;
            for (const Bond& bond : self.distances(marker)) n += is_bond(bond, self.noise());
            return n;
          },
          "marker"_a)
      .def("forget", &RigidCarrier::forget, "marker"_a);
  nb::class_<StitchOptions>(module, "StitchOptions")
      .def(nb::init<double, double, std::int64_t, std::int64_t, std::int64_t, bool>(),
           nb::kw_only(), "noise"_a, "ghost_radius"_a, "confirm"_a, "max_gap"_a, "max_occlusion"_a,
           "may_cut"_a);
  nb::class_<StitcherPass>(module, "Stitcher")
      .def(nb::init<const MotionModel&, const StitchOptions&>(), "motion"_a, "options"_a)
      .def_prop_ro_static("ODDS_FACTOR", [](nb::handle) { return TrackletAssignment::kOddsFactor; })
      .def("run", &run_stitcher, "times"_a, "kind"_a, "F"_a, "Q"_a, "offsets"_a, "points"_a,
           "labels"_a)
      .def("finish", &finish_stitcher)
      .def(
          "advise",
          [](StitcherPass& self, const In<std::int64_t>& labels, const In<std::int64_t>& before,
             const In<double>& weights) {
            require(labels.ndim() == 1 && before.size() == labels.size() &&
                        weights.size() == labels.size(),
                    "labels, before and weights: shape (n,)");
            for (std::size_t i = 0; i < labels.size(); ++i)
              self.stitcher.advise(labels.data()[i], {before.data()[i], weights.data()[i]});
          },
          "labels"_a, "before"_a, "weights"_a)
      .def_prop_ro("n_cuts", [](const StitcherPass& self) { return self.stitcher.n_cuts(); })
      .def_prop_ro("n_markers", [](const StitcherPass& self) { return self.stitcher.n_markers(); });
  nb::enum_<ExchangeEvidence>(module, "ExchangeEvidence")
      .value("medians", ExchangeEvidence::medians)
      .value("spreads", ExchangeEvidence::spreads)
      .value("motion", ExchangeEvidence::motion);
  module.def("exchanged_stretches", &exchanged_stretches, "motion"_a, "times"_a, "kind"_a, "F"_a, "Q"_a,
             "points"_a, "frames"_a, "offsets"_a, "is_examined"_a, nb::kw_only(), "p_detection"_a,
             "noise"_a, "evidence"_a);
  nb::class_<LiveStitcher>(module, "LiveStitcher")
      .def(nb::init<const MotionModel&, const StitchOptions&, std::int64_t>(), "motion"_a,
           "options"_a, nb::kw_only(), "lag"_a)
      .def("step", &step_stitcher, "F"_a, "Q"_a, "points"_a, "labels"_a, "revised"_a,
           "revised_labels"_a)
      .def("copy", [](const LiveStitcher& self) { return LiveStitcher(self); })
      .def("look_ahead", &LiveStitcher::look_ahead)
      .def("states", &states_of_markers, "labels"_a, "gaps"_a, "log_odds"_a, "means"_a,
           "covariances"_a)
      .def_prop_ro("n_seen", &LiveStitcher::n_seen)
      .def_prop_ro("n_joins", &LiveStitcher::n_joins)
      .def_prop_ro("n_ghosts", &LiveStitcher::n_ghosts)
      .def_prop_ro("n_cuts", [](const LiveStitcher& self) { return self.stitcher().n_cuts(); })
      .def_prop_ro("n_markers", [](const LiveStitcher& self) { return self.stitcher().n_markers(); })
      .def_prop_ro("n_remembered",
                   [](const LiveStitcher& self) { return self.stitcher().n_remembered(); });
}
