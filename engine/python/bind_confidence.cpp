// Bindings of the confidence of links and identities.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

#include "confidence/distance_profiles.hpp"
#include "confidence/exchanges.hpp"
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

// The frame of each point, -1 for points that are in none.
std::vector<std::int64_t> frames_of(std::span<const std::int64_t> offsets, std::size_t n_points) {
  std::vector<std::int64_t> frame(n_points, -1);
  for (std::size_t t = 0; t + 1 < offsets.size(); ++t)
    std::fill(frame.begin() + offsets[t], frame.begin() + offsets[t + 1],
              static_cast<std::int64_t>(t));
  return frame;
}

// Returns (frames, tracks a, tracks b, log-likelihood ratios) of the possible exchanges.
nb::tuple exchanges(const MotionModel& m, const In<double>& times, const In<std::int32_t>& kind,
                    const In<double>& F, const In<double>& Q, const In<double>& points,
                    const In<std::int64_t>& frames, const In<std::int64_t>& offsets,
                    double p_detection) {
  require(p_detection >= 0 && p_detection < 1, "p_detection: from 0 to below 1");
  require_finite(points);
  const Timeline line = timeline(m, times, kind, F, Q);
  const TrackPoints tracks(points, frames, offsets, m.axis.D, line.times.size());
  std::vector<Exchange> found;
  {
    nb::gil_scoped_release release;
    ExchangeSearch search(m, line, p_detection);
    for (std::size_t k = 0; k < tracks.n_tracks(); ++k)
      search.add(tracks.points_of(k), tracks.frames_of(k));
    found = search.find();
  }
  return nb::make_tuple(array_of<std::int64_t>(found, &Exchange::frame),
                        array_of<std::int32_t>(found, &Exchange::a),
                        array_of<std::int32_t>(found, &Exchange::b),
                        array_of<double>(found, &Exchange::gain),
                        array_of<bool>(found, &Exchange::is_mutual));
}

// Compares the parts of tracks with the distance profiles. The range of a part is that of its
// detections, which are in the frames of `offsets`, in `detections`. Returns (whether the distances of a part are known, log density
// of an unknown marker relative to the own track, other tracks by falling density (P, 3), their
// densities (P, 3)).
nb::tuple compare_parts(const In<double>& points, const In<std::int64_t>& labels,
                        const In<std::int64_t>& offsets, std::int64_t n_tracks, double noise,
                        const In<std::int64_t>& tracks, const In<std::int64_t>& detections,
                        const In<std::int64_t>& ranges, const In<std::int64_t>& partners) {
  require(points.ndim() == 2 && points.shape(1) >= 1 && points.shape(1) <= kMaxAxes,
          "points: shape (N, D)");
  const auto D = static_cast<int>(points.shape(1));
  const std::vector<Point> at = to_points(points, D);
  const std::size_t n_parts = tracks.size();
  require_finite(points);
  require(noise >= 0, "noise: at least 0");
  require(n_tracks >= 0, "n_tracks: at least 0");
  require(labels.size() == at.size(), "labels: one for each point");
  for (const std::int64_t k : flat(labels)) require(k >= -1 && k < n_tracks, "labels: below K");
  require_offsets(flat(offsets), at.size(), "offsets: rising, within the points");
  const std::vector<std::int64_t> frame = frames_of(flat(offsets), at.size());
  std::vector<std::int64_t> last(n_tracks, -1);
  for (std::size_t i = 0; i < at.size(); ++i) {
    if (frame[i] < 0 || flat(labels)[i] < 0) continue;
    std::int64_t& before = last[flat(labels)[i]];
    require(before < frame[i], "labels: at most one point of a track in a frame");
    before = frame[i];
  }
  require(ranges.size() == 2 * n_parts && partners.size() == 2 * n_parts,
          "tracks, ranges and partners: of each part");
  std::vector<std::int64_t> frames;
  for (const std::int64_t i : flat(detections)) {
    require(i >= 0 && i < static_cast<std::int64_t>(at.size()) && frame[i] >= 0,
            "detections: within the frames");
    frames.push_back(frame[i]);
  }
  const auto range = [&](std::size_t p) {
    const std::int64_t *own = ranges.data() + 2 * p, n = own[1] - own[0];
    require(own[0] >= 0 && n > 0 && own[1] <= static_cast<std::int64_t>(frames.size()),
            "ranges: within the detections");
    for (const std::int64_t i : flat(detections).subspan(own[0], n))
      require(flat(labels)[i] == tracks.data()[p], "detections: of the track of each part");
    return std::span<const std::int64_t>(frames).subspan(own[0], n);
  };
  const LabelledFrames all{at, flat(labels), flat(offsets), n_tracks, D};
  for (const std::int64_t k : flat(tracks)) require(k >= 0 && k < n_tracks, "tracks: below K");
  std::vector<TrackPart> parts;
  for (std::size_t p = 0; p < n_parts; ++p)
    parts.push_back({static_cast<std::int32_t>(tracks.data()[p]), range(p),
                     {static_cast<std::int32_t>(partners.data()[2 * p]),
                      static_cast<std::int32_t>(partners.data()[2 * p + 1])}});
  std::vector<PartEvidence> found;
  {
    nb::gil_scoped_release release;
    DistanceProfiles profiles(all, noise);
    for (const TrackPart& part : parts) found.push_back(profiles.compare(part));
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
                        others.give({n_parts, n_most}), densities.give({n_parts, n_most}));
}

}  // namespace

void bind_confidence(nb::module_& module) {
  module.def("exchanges", &exchanges, "motion"_a, "times"_a, "kind"_a, "F"_a, "Q"_a, "points"_a,
             "frames"_a, "offsets"_a, nb::kw_only(), "p_detection"_a);
  module.def("compare_parts", &compare_parts, "points"_a, "labels"_a, "offsets"_a, "n_tracks"_a,
             "noise"_a, "tracks"_a, "detections"_a, "ranges"_a, "partners"_a);
}
