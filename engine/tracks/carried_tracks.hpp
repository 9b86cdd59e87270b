// Uses rigid neighbours in frame-by-frame tracking. Occluded confirmed tracks are predicted from
// their neighbours, and bonds contribute to ambiguous associations.
//
// In each frame, after prediction and before association:
//
//   1  All tracks are gated by their own predictions. A track that was detected in the last frame
//      and has no clear candidate now may have an alternative, in which that detection is missed.
//      Bonds decide jointly which detections they have in this frame (rigid/joint_places.hpp),
//      which fixes the positions of their markers.
//   2  Occluded tracks are predicted from these positions. The predicted position is fused with the
//      track's own prediction (rigid/carried_state.hpp).
//   3  Occluded tracks are gated by the fused or by their own prediction, whichever gives the
//      higher likelihood. Bonds then add a log-likelihood ratio to ambiguous candidates.
//
// A detection near an occluded marker may be a ghost, anywhere within about half the distance to
// its nearest neighbour. A detection that is more likely a ghost than the marker is refused.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>
#include <optional>
#include <span>
#include <type_traits>
#include <vector>

#include "base/scratch.hpp"
#include "rigid/carried_state.hpp"
#include "rigid/carrier.hpp"
#include "rigid/joint_places.hpp"
#include "tracks/live_tracks.hpp"

namespace asterism {

struct CarryOptions {
  bool is_on = false;
  std::int32_t max_carried = 0;  // frames
};

class CarriedTracks {
 public:
  CarriedTracks(const MotionModel& m, const ScoreModel& score, const CarryOptions& options)
      : opt_(options), max_gap_(score.max_gap), carrier_(m.axis.D, m.axis.r) {}

  struct NoAlternatives {};
  // Predicts every track to a frame and lists its candidates (see LiveTracks::list). The last
  // `n_open` frames before it have not been passed to `learn`. add_alternative(i) may add a row in
  // which the last detection of track i is missed; it is called for the tracks that were detected
  // then and have no clear candidate now.
  template <typename MinLogLikelihood, typename Gain, typename AddAlternative = NoAlternatives>
  void list(LiveTracks<>& live, double time, const MotionStep& step, std::span<const Point> points,
            double min_gain, MinLogLikelihood&& min_log_likelihood, Gain&& gain,
            std::vector<Candidate>& out, FrameStats& stats, std::int64_t n_open = 0,
            [[maybe_unused]] const AddAlternative& add_alternative = {}) {
    live.predict_all(step);
    out.clear();
    // Bonds can raise a gain, so the threshold is lowered.
    const auto list = [&](auto&& is_selected, std::vector<Candidate>& to) {
      live.list(time, points, opt_.is_on ? min_gain - kReach : min_gain, is_selected,
                min_log_likelihood, gain, to);
    };
    if (!opt_.is_on) return list([](std::size_t) { return true; }, out);
    list([&](std::size_t i) { return live[i].gap == 0; }, out);
    s_.all = out;
    list([&](std::size_t i) { return live[i].gap > 0; }, s_.all);
    constexpr bool has_alternatives = !std::is_same_v<AddAlternative, NoAlternatives>;
    if constexpr (has_alternatives) {
      find_clear(live, points, min_gain);
      const std::size_t n = live.size();
      for (std::size_t i = 0; i < n; ++i)
        if (live[i].gap == 0 && live[i].is_confirmed() && !s_.is_clear[i]) add_alternative(i);
      live.predict_all(step, n);
      list([&](std::size_t i) { return i >= n; }, s_.all);
    }
    fix_positions(live, points);
    predict_occluded(live, n_open);
    s_.alone.clear();
    list([&](std::size_t i) { return s_.is_carried[i] != 0; }, s_.alone);
    s_.own.resize(live.size());
    for (std::size_t i = 0; i < live.size(); ++i)
      if (s_.is_carried[i]) {
        s_.own[i] = live.prediction(i);
        live.expect(i, Prediction(live.m, s_.fused[i]));
      }
    list([&](std::size_t i) { return live[i].gap > 0; }, out);
    std::ranges::stable_sort(out, {}, &Candidate::row);
    add_alone(out);
    weigh(live, points, min_gain, has_alternatives, out, stats);
    count_refused(min_gain, out, stats);
  }

  // Completes the update of track i: with a detection at y, or without one.
  void take(LiveTracks<>& live, std::size_t i, const Point& y, FrameStats& stats) const {
    if (!is_carried(i)) return;
    ++stats.n_returned;
    std::array<double, kMaxModes> each{};
    if (s_.own[i].log_likelihood(y, each) > live.prediction(i).log_likelihood(y, each))
      live.expect(i, s_.own[i]);
    else
      live[i].state = s_.fused[i];
  }
  void miss(LiveTrack<>& track, std::size_t i, FrameStats& stats) const {
    if (opt_.is_on && s_.replaced_by[i] >= 0) track.gap = max_gap_ + track.carried;
    track.place = is_carried(i) ? s_.place[i] : Carried{};
    if (!is_carried(i) || s_.is_uncertain[i] || track.gap > opt_.max_carried) return;
    ++track.carried;
    ++stats.n_carried;
  }
  bool is_carried(std::size_t i) const { return opt_.is_on && s_.is_carried[i]; }

  // Results of `list` for track i: its carried position, whether that position is too uncertain to
  // keep the track alive, the reappearing track in whose favour it is deleted (or -1), and the
  // contributions of bonds to its ambiguous candidates.
  struct BondGain {
    std::int32_t row = 0, column = 0;
    double nats = 0;
  };
  const Carried& place(std::size_t i) const { return s_.place[i]; }
  bool is_uncertain(std::size_t i) const { return s_.is_uncertain[i] != 0; }
  std::int32_t replaced_by(std::size_t i) const { return s_.replaced_by[i]; }
  std::span<const BondGain> bond_gains() const { return s_.bond_gains; }

  // Updates the bonds after a frame.
  template <typename More>
  void learn(const LiveTracks<More>& live) {
    if (!opt_.is_on) return;
    s_.seen.clear();
    s_.known.clear();
    for (const LiveTrack<More>& track : live.tracks) {
      if (!track.is_confirmed()) continue;
      s_.known.push_back(number(track));
      if (track.gap == 0) s_.seen.push_back({number(track), track.last});
    }
    std::sort(s_.known.begin(), s_.known.end());
    std::sort(s_.seen.begin(), s_.seen.end(),
              [](const MarkerPoint& a, const MarkerPoint& b) { return a.marker < b.marker; });
    for (const std::int32_t marker : known_)
      if (!std::binary_search(s_.known.begin(), s_.known.end(), marker)) carrier_.forget(marker);
    known_.assign(s_.known.begin(), s_.known.end());
    carrier_.see(s_.seen);
  }

 private:
  static constexpr double kNever = -std::numeric_limits<double>::infinity();
  static constexpr double kReach = 2;  // nats below the threshold where bonds may list a candidate
  // A position is uncertain if its standard deviation exceeds this fraction of the distance to the
  // nearest neighbour.
  static constexpr double kUncertain = 0.25;

  template <typename More>
  static std::int32_t number(const LiveTrack<More>& track) {
    return static_cast<std::int32_t>(track.id);
  }

  // Counts the tracks of each detection and the detections of each track among candidates.
  void count_rivals(std::span<const Candidate> all, std::size_t n_tracks, std::size_t n_points) {
    s_.n_rows.assign(n_points, 0);
    s_.n_columns.assign(n_tracks, 0);
    for (const Candidate& c : all) {
      ++s_.n_rows[c.column];
      ++s_.n_columns[c.row];
    }
  }
  bool is_ambiguous(const Candidate& c, double min_gain) const {
    return s_.n_rows[c.column] > 1 || s_.n_columns[c.row] > 1 || c.gain - kReach <= min_gain;
  }
  // Finds the tracks with a clear candidate, which has a high gain and no rivals by the tracks' own
  // predictions.
  void find_clear(const LiveTracks<>& live, std::span<const Point> points, double min_gain) {
    count_rivals(s_.all, live.size(), points.size());
    s_.is_clear.assign(live.size(), 0);
    for (const Candidate& c : s_.all) s_.is_clear[c.row] = !is_ambiguous(c, min_gain);
  }

  // Decides jointly where the confirmed tracks are.
  void fix_positions(const LiveTracks<>& live, std::span<const Point> points) {
    s_.tracks.clear();
    for (std::size_t i = 0; i < live.size(); ++i) {
      if (!live[i].is_confirmed()) continue;
      const Prediction& prediction = live.prediction(i);
      s_.tracks.push_back({static_cast<std::int32_t>(i), number(live[i]), prediction.center,
                           prediction.variance()});
    }
    s_.joint.begin(s_.tracks, live.size(), carrier_.n_axes(),
                   [&](std::int32_t marker) { return carrier_.distances(marker); });
    std::erase_if(s_.all, [&](const Candidate& c) { return !live[c.row].is_confirmed(); });
    std::ranges::stable_sort(s_.all, {}, &Candidate::row);
    s_.joint.decide(points, s_.all);
    s_.places.clear();
    s_.owner.assign(points.size(), -1);
    for (std::size_t i = 0; i < live.size(); ++i) {
      const Point* place = s_.joint.place(i);
      if (place == nullptr) continue;
      s_.places.set(number(live[i]), *place);
      if (live[i].gap == 0) s_.owner[place - points.data()] = static_cast<std::int32_t>(i);
    }
  }

  void predict_occluded(const LiveTracks<>& live, std::int64_t n_open) {
    s_.is_carried.assign(live.size(), 0);
    s_.is_uncertain.assign(live.size(), 0);
    s_.place.resize(live.size());
    s_.fused.resize(live.size());
    s_.ghosts.assign(live.size(), 0);
    Carriage found;
    for (std::size_t i = 0; i < live.size(); ++i) {
      const LiveTrack<>& track = live[i];
      if (track.gap == 0 || !track.is_confirmed()) continue;
      if (!carrier_.carry(number(track), s_.places, found, n_open)) continue;
      const std::optional<MotionState> fused =
          fuse(live.m, track.state, live.prediction(i), found.place);
      if (!fused) continue;
      s_.fused[i] = *fused;
      s_.place[i] = found.place;
      const double max_deviation = kUncertain * found.nearest;
      s_.is_uncertain[i] = !(found.place.variance < max_deviation * max_deviation);
      s_.is_carried[i] = 1;
      // A ghost is given the likelihood of the marker itself, spread over its neighbourhood.
      const int D = live.m.axis.D;
      const double radius = 0.5 * found.nearest;
      s_.ghosts[i] = softplus(-0.5 * D * std::log(2 * std::numbers::pi * radius * radius) -
                              live.sm.log_clutter);
    }
  }

  // Index of the same pairing in candidates ordered by row, or their number if it is absent.
  static std::size_t find_same(std::span<const Candidate> all, const Candidate& one) {
    const auto row = std::ranges::equal_range(all, one.row, {}, &Candidate::row);
    const auto at = std::ranges::find(row, one.column, &Candidate::column);
    return at == row.end() ? all.size() : static_cast<std::size_t>(&*at - all.data());
  }
  // Adds candidates from the tracks' own predictions. The neighbours of an occluded track can be
  // wrong while its own motion is right.
  void add_alone(std::vector<Candidate>& out) {
    s_.added.clear();
    for (const Candidate& own : s_.alone) {
      if (!(own.gain + kReach > s_.ghosts[own.row])) continue;
      const std::size_t same = find_same(out, own);
      if (same == out.size())
        s_.added.push_back(own);
      else if (own.gain > out[same].gain)
        out[same] = own;
    }
    out.insert(out.end(), s_.added.begin(), s_.added.end());
    std::ranges::stable_sort(out, {}, &Candidate::row);
  }
  // Applies ghosts and bonds to the gains of the candidates. Where tracks have alternatives, bonds
  // count for clear candidates too: they compare branches over several frames.
  void weigh(const LiveTracks<>& live, std::span<const Point> points, double min_gain,
             bool has_alternatives, std::vector<Candidate>& out, FrameStats& stats) {
    count_rivals(out, live.size(), points.size());
    s_.bond_gains.clear();
    for (Candidate& c : out) {
      if (!live[c.row].is_confirmed()) continue;
      const bool was_listed = c.gain > min_gain;
      if (has_alternatives || is_ambiguous(c, min_gain)) {
        const double nats = s_.joint.gain(c.row, points[c.column]);
        if (nats != 0) s_.bond_gains.push_back({c.row, c.column, nats});
        c.gain += nats;
      }
      if (is_carried(c.row) && (!(c.gain > s_.ghosts[c.row]) || !may_take(live, c))) c.gain = kNever;
      // Occluded tracks are counted in count_refused, against their own predictions.
      stats.n_refused += was_listed && !is_carried(c.row) && !(c.gain > min_gain);
    }
    replace_reappeared(live, out);
    std::erase_if(out, [&](const Candidate& c) { return !(c.gain > min_gain); });
  }
  bool may_take(const LiveTracks<>& live, const Candidate& c) const {
    const std::int32_t owner = s_.owner[c.column];
    return owner < 0 || live[owner].first_time > live[c.row].last_time;
  }
  // If a new track is an occluded track reappearing, the new track is deleted and the old one
  // continues.
  void replace_reappeared(const LiveTracks<>& live, std::vector<Candidate>& out) {
    s_.replaced_by.assign(live.size(), -1);
    for (std::int32_t e = 0; e < static_cast<std::int32_t>(out.size()); ++e) {
      const Candidate& c = out[e];
      if (!is_carried(c.row) || c.gain == kNever || s_.owner[c.column] < 0) continue;
      std::int32_t& replaced_by = s_.replaced_by[s_.owner[c.column]];
      if (replaced_by < 0 || c.gain > out[replaced_by].gain) replaced_by = e;
    }
    for (std::int32_t& replaced_by : s_.replaced_by)
      if (replaced_by >= 0) replaced_by = out[replaced_by].row;
    for (Candidate& c : out)
      if (s_.replaced_by[c.row] >= 0) c.gain = kNever;
  }

  // Counts detections that an occluded track would have taken by its own prediction.
  void count_refused(double min_gain, std::span<const Candidate> out, FrameStats& stats) const {
    for (const Candidate& own : s_.alone)
      if (own.gain > min_gain) stats.n_refused += find_same(out, own) == out.size();
  }

  struct Memory {
    std::vector<char> is_carried, is_uncertain, is_clear;
    std::vector<Carried> place;
    std::vector<BondGain> bond_gains;
    std::vector<MotionState> fused;
    std::vector<Prediction> own;
    std::vector<double> ghosts;  // log(1 + density of ghosts / density of clutter), by track
    std::vector<std::int32_t> owner, replaced_by, n_rows, n_columns;
    std::vector<Candidate> all, alone, added;
    std::vector<JointPlaces::Track> tracks;
    JointPlaces joint;
    std::vector<MarkerPoint> seen;
    std::vector<std::int32_t> known;
    Places places;
  };

  CarryOptions opt_;
  std::int32_t max_gap_;
  RigidCarrier carrier_;
  std::vector<std::int32_t> known_;
  Scratch<Memory> s_;
};

}  // namespace asterism
