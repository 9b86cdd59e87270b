// Bindings of the confidence of links and identities.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "base/parallel.hpp"
#include "confidence/distance_profiles.hpp"
#include "confidence/exchanges.hpp"
#include "confidence/frame_assignment.hpp"
#include "confidence/lost_markers.hpp"
#include "confidence/run_exchanges.hpp"
#include "python/arrays.hpp"
#include "python/bindings.hpp"
#include "python/motion_arrays.hpp"

using namespace nb::literals;
using namespace asterism;

namespace {

void require_finite(const In<double>& points) {
  require(std::ranges::all_of(flat(points), [](double x) { return std::isfinite(x); }),
          "points: finite");
}

// Returns the possible exchanges: the last points before (n, 2), the first points after (n, 2), both
// -1 for none, the log-likelihood ratios, and their frames.
nb::tuple exchanges(const MotionModel& m, const In<double>& times, const In<std::int32_t>& kind,
                    const In<double>& F, const In<double>& Q, const In<double>& points,
                    const In<std::int64_t>& frames, const In<std::int64_t>& offsets,
                    double p_detection, std::int32_t n_threads) {
  require(p_detection >= 0 && p_detection < 1, "p_detection: from 0 to below 1");
  require(n_threads >= 1, "n_threads: at least 1");
  require_finite(points);
  const Timeline line = timeline(m, times, kind, F, Q);
  const TrackPoints tracks(points, frames, offsets, m.axis.D, line.times.size());
  std::vector<Exchange> found;
  {
    nb::gil_scoped_release release;
    ExchangeSearch search(m, line, p_detection);
    for (std::size_t k = 0; k < tracks.n_tracks(); ++k)
      search.add(tracks.points_of(k), tracks.frames_of(k));
    found = search.find(n_threads);
  }
  Owned<std::int64_t> before(2 * found.size()), after(2 * found.size());
  for (std::size_t i = 0; i < found.size(); ++i)
    for (const int side : {0, 1}) {
      const std::int64_t k = found[i].track[side], at = tracks.offsets[k] + found[i].tail[side];
      before.data[2 * i + side] = at > tracks.offsets[k] ? at - 1 : -1;
      after.data[2 * i + side] = at < tracks.offsets[k + 1] ? at : -1;
    }
  return nb::make_tuple(before.give({found.size(), 2}), after.give({found.size(), 2}),
                        array_of<double>(found, &Exchange::gain),
                        array_of<std::int64_t>(found, &Exchange::frame));
}

// Returns the log-likelihood ratios of the exchanges of two tracks at some frames.
Out<double> exchange_ratios(const MotionModel& m, const In<double>& times,
                            const In<std::int32_t>& kind, const In<double>& F, const In<double>& Q,
                            const In<double>& points, const In<std::int64_t>& frames,
                            const In<std::int64_t>& offsets, const In<std::int64_t>& cuts,
                            double p_detection) {
  require(p_detection >= 0 && p_detection < 1, "p_detection: from 0 to below 1");
  require_finite(points);
  const Timeline line = timeline(m, times, kind, F, Q);
  const TrackPoints tracks(points, frames, offsets, m.axis.D, line.times.size());
  require(tracks.n_tracks() == 2, "offsets: of two tracks");
  ExchangeSearch search(m, line, p_detection);
  for (std::size_t k = 0; k < 2; ++k) search.add(tracks.points_of(k), tracks.frames_of(k));
  std::vector<double> found;
  for (const std::int64_t t : flat(cuts)) {
    for (std::size_t k = 0; k < 2; ++k) {
      const auto own = tracks.frames_of(k);
      require(!own.empty() && own.front() < t && own.back() >= t, "cuts: inside both tracks");
    }
    found.push_back(search.ratio(t));
  }
  return array_of<double>(found);
}

// Profiles with the arrays from which they are learnt.
class Profiles {
 public:
  Profiles(const In<double>& points, const In<std::int64_t>& labels,
           const In<std::int64_t>& offsets, const In<std::int64_t>& samples, std::int64_t n_tracks,
           double noise)
      : labels_(flat(labels).begin(), flat(labels).end()),
        offsets_(flat(offsets).begin(), flat(offsets).end()),
        samples_(flat(samples).begin(), flat(samples).end()) {
    require(points.ndim() == 2 && points.shape(1) >= 1 && points.shape(1) <= kMaxAxes,
            "points: shape (N, D)");
    require_finite(points);
    require(n_tracks >= 0, "n_tracks: at least 0");
    require(noise >= 0, "noise: at least 0");
    const auto D = static_cast<int>(points.shape(1));
    points_ = to_points(points, D);
    require(labels_.size() == points_.size(), "labels: one for each point");
    for (const std::int64_t k : labels_) require(k >= -1 && k < n_tracks, "labels: below K");
    require_offsets(offsets_, points_.size(), "offsets: rising, within the points");
    for (const std::int64_t t : samples_) require_frame(t);
    std::vector<std::int64_t> last(n_tracks, -1);
    for (std::int64_t t = 0; t + 1 < static_cast<std::int64_t>(offsets_.size()); ++t)
      for (std::int64_t i = offsets_[t]; i < offsets_[t + 1]; ++i)
        if (labels_[i] >= 0)
          require(std::exchange(last[labels_[i]], t) < t, "labels: a track once in a frame");
    const LabelledFrames all{points_, labels_, offsets_, samples_, n_tracks, D};
    profiles_ = std::make_unique<DistanceProfiles>(all, noise);
    n_tracks_ = n_tracks;
  }

  // For pairs of tracks (n, 2), the log density ratio of one marker against two.
  Out<double> agreements(const In<std::int64_t>& pairs) {
    require(pairs.ndim() == 2 && pairs.shape(1) == 2, "pairs: shape (n, 2)");
    for (const std::int64_t k : flat(pairs)) require_track(k);
    std::vector<double> found(pairs.shape(0));
    for (std::size_t i = 0; i < found.size(); ++i)
      found[i] = profiles_->agreement(static_cast<std::int32_t>(pairs.data()[2 * i]),
                                      static_cast<std::int32_t>(pairs.data()[2 * i + 1]));
    return array_of<double>(found);
  }

  // For parts of tracks, each in some frames: (whether their distances are known, log density of an
  // unknown marker relative to the own track, the same by ranges, other tracks by falling density
  // (P, 3), their densities (P, 3)).
  nb::tuple compare(const In<std::int64_t>& tracks, const In<std::int64_t>& frames,
                    const In<std::int64_t>& offsets, const In<std::int64_t>& partners,
                    std::int32_t n_threads) {
    const std::size_t n_parts = tracks.size();
    require(partners.size() == 2 * n_parts, "partners: two of each part");
    require(n_threads >= 1, "n_threads: at least 1");
    std::vector<TrackPart> parts = parts_of(tracks, frames, offsets);
    for (std::size_t p = 0; p < n_parts; ++p)
      parts[p].partners = {static_cast<std::int32_t>(partners.data()[2 * p]),
                           static_cast<std::int32_t>(partners.data()[2 * p + 1])};
    std::vector<PartEvidence> found(n_parts);
    {
      nb::gil_scoped_release release;
      // Each thread learns the profiles that its parts need in a copy of its own.
      const auto n_blocks = static_cast<std::int64_t>((n_parts + kBlock - 1) / kBlock);
      const auto n_copies = std::min<std::int64_t>(n_threads, n_blocks);
      std::vector<DistanceProfiles> copies(n_copies, *profiles_);
      in_parallel(n_blocks, n_threads, [&](std::int32_t worker, std::int64_t block) {
        const auto first = static_cast<std::size_t>(block) * kBlock;
        for (std::size_t p = first; p < std::min(first + kBlock, n_parts); ++p)
          found[p] = copies[worker].compare(parts[p]);
      });
    }
    constexpr std::size_t n_most = PartEvidence::kMost;
    Owned<std::int64_t> others(n_parts * n_most);
    Owned<double> densities(n_parts * n_most);
    for (std::size_t p = 0; p < n_parts; ++p) {
      std::copy_n(found[p].track.begin(), n_most, others.data.get() + p * n_most);
      std::copy_n(found[p].density.begin(), n_most, densities.data.get() + p * n_most);
    }
    return nb::make_tuple(array_of<bool>(found, &PartEvidence::is_known),
                          array_of<double>(found, &PartEvidence::unknown),
                          array_of<double>(found, &PartEvidence::in_range),
                          others.give({n_parts, n_most}), densities.give({n_parts, n_most}));
  }

  // For parts of tracks, as for `compare`: log densities of n other tracks, and of an unknown marker,
  // relative to the own track (P, n + 1).
  Out<double> densities(const In<std::int64_t>& tracks, const In<std::int64_t>& frames,
                        const In<std::int64_t>& offsets, const In<std::int64_t>& others) {
    for (const std::int64_t k : flat(others)) require_track(k);
    const std::size_t n = others.size() + 1;
    Owned<double> found(tracks.size() * n);
    double* to = found.data.get();
    for (const TrackPart& part : parts_of(tracks, frames, offsets))
      to = std::ranges::copy(profiles_->densities(part, flat(others)), to).out;
    return found.give({tracks.size(), n});
  }

  // Assigns the open detections of one frame after the other, then exchanges pairs of tracks over
  // runs of frames, and returns the track of each detection.
  Out<std::int64_t> assigned(const In<double>& points, const In<std::int64_t>& labels,
                             const In<std::int64_t>& offsets, const In<bool>& is_open,
                             const In<double>& ghost, const In<double>& sigma, double log_clutter,
                             double change, std::int64_t max_gap) {
    std::vector<std::int64_t> own(flat(labels).begin(), flat(labels).end());
    score(points, own, offsets, is_open, ghost, sigma, log_clutter, change, max_gap,
          [](AssignmentScore& found) {
            FrameAssignment(found).run();
            RunExchanges(found).run();
          });
    return array_of<std::int64_t>(own);
  }

  // Log odds of each asked detection being of its track instead of clutter, by its distances and
  // motion; 0 for one without a track.
  Out<double> supports(const In<double>& points, const In<std::int64_t>& labels,
                       const In<std::int64_t>& offsets, const In<bool>& is_asked,
                       const In<double>& ghost, const In<double>& sigma, double log_clutter,
                       std::int64_t max_gap) {
    std::vector<std::int64_t> own(flat(labels).begin(), flat(labels).end());
    std::vector<double> found(own.size(), 0);
    score(points, own, offsets, is_asked, ghost, sigma, log_clutter, 0, max_gap,
          [&](AssignmentScore& of) {
            FrameAssignment frames(of);
            for (std::int64_t t = 0; t < of.n_frames(); ++t)
              for (std::int64_t i = of.all().offsets[t]; i < of.all().offsets[t + 1]; ++i)
                if (of.all().is_open[i] && own[i] >= 0) found[i] = frames.support(t, i);
          });
    return array_of<double>(found);
  }

 private:
  // Uses the score of an assignment, without the lock of Python.
  template <typename Use>
  void score(const In<double>& points, std::vector<std::int64_t>& labels,
             const In<std::int64_t>& offsets, const In<bool>& is_open, const In<double>& ghost,
             const In<double>& sigma, double log_clutter, double change, std::int64_t max_gap,
             Use&& use) {
    require(points.ndim() == 2 && points.shape(1) >= 1 && points.shape(1) <= kMaxAxes,
            "points: shape (N, D)");
    require_finite(points);
    const std::size_t n = points.shape(0);
    require(labels.size() == n && is_open.size() == n && ghost.size() == n,
            "labels, is_open and ghost: one for each point");
    require(static_cast<std::int64_t>(sigma.size()) == n_tracks_, "sigma: one for each track");
    require_offsets(flat(offsets), n, "offsets: rising, within the points");
    for (const std::int64_t k : labels) require(k >= -1 && k < n_tracks_, "labels: below K");
    const auto D = static_cast<int>(points.shape(1));
    const std::vector<Point> at = to_points(points, D);
    const std::vector<std::uint8_t> open(flat(is_open).begin(), flat(is_open).end());
    nb::gil_scoped_release release;
    const OpenFrames all{at,          flat(offsets), open,    flat(ghost), flat(sigma),
                         log_clutter, change,        max_gap, D};
    AssignmentScore found(all, *profiles_, labels);
    use(found);
  }

  static constexpr std::size_t kBlock = 64;  // parts that a thread takes at a time

  std::vector<TrackPart> parts_of(const In<std::int64_t>& tracks, const In<std::int64_t>& frames,
                                  const In<std::int64_t>& offsets) const {
    require(offsets.size() == tracks.size() + 1, "tracks and offsets: of each part");
    require_offsets(flat(offsets), frames.size(), "offsets: rising, within the frames");
    for (const std::int64_t t : flat(frames)) require_frame(t);
    std::vector<TrackPart> parts;
    for (std::size_t p = 0; p < tracks.size(); ++p) {
      const std::int64_t k = tracks.data()[p], first = offsets.data()[p];
      require_track(k);
      const auto own = flat(frames).subspan(first, offsets.data()[p + 1] - first);
      for (const std::int64_t t : own)
        require(std::find(labels_.begin() + offsets_[t], labels_.begin() + offsets_[t + 1], k) !=
                    labels_.begin() + offsets_[t + 1],
                "frames: with a detection of the track");
      parts.push_back({static_cast<std::int32_t>(k), own});
    }
    return parts;
  }
  void require_track(std::int64_t k) const { require(k >= 0 && k < n_tracks_, "tracks: below K"); }
  void require_frame(std::int64_t t) const {
    require(t >= 0 && t + 1 < static_cast<std::int64_t>(offsets_.size()), "frames: below T");
  }

  std::vector<Point> points_;
  std::vector<std::int64_t> labels_, offsets_, samples_;
  std::int64_t n_tracks_ = 0;
  std::unique_ptr<DistanceProfiles> profiles_;
};

// Labels of all detections, those of lost markers among them.
Out<std::int64_t> find_lost(const In<double>& points, const In<std::int64_t>& labels,
                            const In<std::int64_t>& offsets, const In<double>& distances,
                            const In<double>& spreads) {
  require(points.ndim() == 2 && points.shape(1) >= 1 && points.shape(1) <= kMaxAxes,
          "points: shape (N, D)");
  require_finite(points);
  const std::size_t n = points.shape(0), K = distances.ndim() == 2 ? distances.shape(0) : 0;
  require(distances.size() == K * K && spreads.size() == K * K, "distances and spreads: shape (K, K)");
  require(labels.size() == n, "labels: one for each point");
  require_offsets(flat(offsets), n, "offsets: rising, within the points");
  for (const std::int64_t k : flat(labels))
    require(k >= -1 && k < static_cast<std::int64_t>(K), "labels: below K");
  const std::vector<Point> at = to_points(points, static_cast<int>(points.shape(1)));
  std::vector<std::int64_t> own(flat(labels).begin(), flat(labels).end());
  {
    nb::gil_scoped_release release;
    LostMarkers lost(flat(distances), flat(spreads), K);
    for (std::size_t t = 0; t + 1 < offsets.size(); ++t) {
      const auto first = static_cast<std::size_t>(offsets.data()[t]);
      const std::size_t size = static_cast<std::size_t>(offsets.data()[t + 1]) - first;
      lost.find(std::span(at).subspan(first, size), std::span(own).subspan(first, size));
    }
  }
  return array_of<std::int64_t>(own);
}

}  // namespace

void bind_confidence(nb::module_& module) {
  module.def("exchanges", &exchanges, "motion"_a, "times"_a, "kind"_a, "F"_a, "Q"_a, "points"_a,
             "frames"_a, "offsets"_a, nb::kw_only(), "p_detection"_a, "n_threads"_a);
  module.def("exchange_ratios", &exchange_ratios, "motion"_a, "times"_a, "kind"_a, "F"_a, "Q"_a,
             "points"_a, "frames"_a, "offsets"_a, "cuts"_a, nb::kw_only(), "p_detection"_a);
  module.def("find_lost", &find_lost, "points"_a, "labels"_a, "offsets"_a, "distances"_a,
             "spreads"_a);
  nb::class_<Profiles>(module, "DistanceProfiles")
      .def(nb::init<const In<double>&, const In<std::int64_t>&, const In<std::int64_t>&,
                    const In<std::int64_t>&, std::int64_t, double>(),
           "points"_a, "labels"_a, "offsets"_a, "samples"_a, nb::kw_only(), "n_tracks"_a, "noise"_a)
      .def("agreements", &Profiles::agreements, "pairs"_a)
      .def("assigned", &Profiles::assigned, "points"_a, "labels"_a, "offsets"_a, "is_open"_a,
           "ghost"_a, "sigma"_a, nb::kw_only(), "log_clutter"_a, "change"_a, "max_gap"_a)
      .def("compare", &Profiles::compare, "tracks"_a, "frames"_a, "offsets"_a, "partners"_a,
           nb::kw_only(), "n_threads"_a)
      .def("densities", &Profiles::densities, "tracks"_a, "frames"_a, "offsets"_a, "others"_a)
      .def("supports", &Profiles::supports, "points"_a, "labels"_a, "offsets"_a, "is_asked"_a,
           "ghost"_a, "sigma"_a, nb::kw_only(), "log_clutter"_a, "max_gap"_a);
}
