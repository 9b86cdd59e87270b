// Evidence of the distances to other tracks for the identity of a part of a track.
//
// A track that stays on one marker keeps its distances to the other markers of the segment. The
// profile of a track holds the median and the spread of its distances to the longest tracks, over
// frames spread through the capture. A part of a track is compared with the profile of its own
// track, with those of tracks that are absent meanwhile, and with an unknown marker.
//
//   d    distance of the part to another track, the median of a few frames
//   m, s median and spread of that distance in a profile
//   log density: Student's t of (d - m) / s, in the mean over the steadiest distances
//
// Posture changes some distances by many spreads for seconds, as those of a shoulder to a hand. An
// unknown marker is therefore compared a second time by the range of most deviations, with weights
// by how much a range differs from that of an unknown marker.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <numeric>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "confidence/learnt_distance.hpp"
#include "confidence/track_parts.hpp"
#include "math/point.hpp"

namespace asterism {

class DistanceProfiles {
 public:
  // `noise` is the standard deviation of a coordinate.
  DistanceProfiles(const LabelledFrames& all, double noise)
      : all_(all), floor2_(2 * std::max(noise * noise, kMinNoise * kMinNoise)) {
    choose_references();
    sample();
  }

  // Log density ratio of two tracks being of one marker against two, by the steadiest distances that
  // both have; -inf without enough of them.
  double agreement(std::int32_t a, std::int32_t b) {
    steady_.clear();
    for (std::size_t r = 0; r < references_.size(); ++r) {
      if (references_[r] == a || references_[r] == b) continue;
      const LearntDistance &of_a = distance(a, r), &of_b = distance(b, r);
      if (of_a.is_known() && of_b.is_known())
        steady_.push_back({std::hypot(of_a.spread, of_b.spread), r});
    }
    if (steady_.size() < kMinAgreeing) return -std::numeric_limits<double>::infinity();
    keep_steadiest(steady_);
    double sum = 0;
    for (const auto& [spread, r] : steady_) {
      const double off = distance(a, r).median - distance(b, r).median;
      sum += log_t(off, spread) - log_t(off, std::hypot(spread, kUnknownSpread));
    }
    return sum / static_cast<double>(steady_.size());
  }

  PartEvidence compare(const TrackPart& part) {
    PartEvidence found;
    if (!choose_steady(part)) return found;
    found.is_known = true;
    found.unknown = unknown(part.track);
    found.in_range = unknown_in_range(part.track);
    for (std::int32_t k = 0; k < static_cast<std::int32_t>(all_.n_tracks); ++k) {
      if (k == part.track) continue;
      const bool is_partner = std::ranges::find(part.partners, k) != part.partners.end();
      if (!is_partner && kMaxPresent * static_cast<double>(n_measured_) < n_present_[k]) continue;
      if (may_be_same(part.track, k)) continue;
      offer(found, k, density(part.track, k));
    }
    return found;
  }

  // Log densities of the distances of a part by the profiles of other tracks, relative to its own; 0
  // where too few distances are known. The last is that of an unknown marker.
  std::vector<double> densities(const TrackPart& part, std::span<const std::int64_t> others) {
    std::vector<double> found(others.size() + 1, 0);
    if (!choose_steady(part)) return found;
    for (std::size_t i = 0; i < others.size(); ++i) {
      const double other = density(part.track, static_cast<std::int32_t>(others[i]));
      if (std::isfinite(other)) found[i] = other;
    }
    found.back() = unknown(part.track);
    return found;
  }

  // Log density of the distances of one detection to others of its frame by the profile of a track,
  // relative to an unknown marker.
  struct Support {
    double value = -std::numeric_limits<double>::infinity();
    std::int32_t reach = 0;  // steady distances that were looked at, 0 where too few are there
  };
  // Without the distances to one other track. at(other) is the index in `points` of a track in the
  // frame, -1 for none. A support below `least` may be returned as one without distances.
  template <typename At>
  Support support(std::int64_t track, const Point& y, std::span<const Point> points, At&& at,
                  std::int64_t without, double least) {
    constexpr double kBeyondRounding = 1 - 1e-9;
    const std::vector<Steady>& all = steadiest(track);
    if (all.size() < kMinNeighbours) return {};
    // No mean of log ratios is above the first, and each factor of the ratio is at most 1.
    const double least_ratio =
        kBeyondRounding * std::exp(kNeighbours / 2.0 * (least - all.front().log_ratio));
    double ratio = 1, sum = 0;
    std::size_t n = 0, r = 0;
    while (r < all.size() && n < kNeighbours) {
      const Steady& own = all[r++];
      if (own.reference == without) continue;
      const std::int32_t point = at(own.reference);
      if (point < 0) continue;
      const double off = std::sqrt(squared_distance(y, points[point], all_.D)) - own.median;
      ratio *= (1 + off * off * own.per_unknown) / (1 + off * off * own.per_spread);
      if (ratio < least_ratio) return {};
      sum += own.log_ratio;
      ++n;
    }
    if (n < kMinNeighbours) return {};
    return {(sum + 2 * std::log(ratio)) / static_cast<double>(n), static_cast<std::int32_t>(r)};
  }
  // Whether a support that looked at so many distances of a track has used that to another.
  bool uses(std::int64_t track, std::int32_t reach, std::int64_t other) {
    const auto all = std::span(steadiest(track)).first(static_cast<std::size_t>(reach));
    return std::ranges::find(all, other, &Steady::reference) != all.end();
  }
  // No detection has a larger support in a track.
  double max_support(std::int64_t track) {
    return steadiest(track).empty() ? 0 : steadiest(track).front().log_ratio;
  }

 private:
  static constexpr std::size_t kReferences = 128;  // longest tracks, to which distances are taken
  static constexpr std::size_t kNeighbours = 6, kMinNeighbours = 2, kMinAgreeing = 3;
  static constexpr double kMinNoise = 1e-3;     // metres
  static constexpr double kUnknownSpread = 0.1;  // metres
  static constexpr double kSame = -0.5;  // log density of the difference of equal profiles
  static constexpr double kMaxPresent = 0.2;  // share of a part in which an alternative is present

  // Measures the distances of a part, and chooses the steadiest ones of its own track. Returns
  // whether there are enough.
  bool choose_steady(const TrackPart& part) {
    measure(part);
    steady_.clear();
    for (std::size_t r = 0; r < references_.size(); ++r) {
      if (distances_[r] < 0) continue;
      if (const LearntDistance* own = steady(part.track, r)) steady_.push_back({own->spread, r});
    }
    if (steady_.size() < kMinNeighbours) return false;
    ranges_.clear();
    for (const auto& [spread, r] : steady_) ranges_.push_back({distance(part.track, r).range, r});
    keep_steadiest(steady_);
    keep_steadiest(ranges_);
    return true;
  }
  using BySpread = std::vector<std::pair<double, std::size_t>>;
  static void keep_steadiest(BySpread& all) {
    const std::size_t n = std::min(all.size(), kNeighbours);
    std::partial_sort(all.begin(), all.begin() + static_cast<std::ptrdiff_t>(n), all.end());
    all.resize(n);
  }
  // Log density of the chosen distances for an unknown marker, relative to the own track.
  double unknown(std::int32_t own) {
    double of_own = 0, of_unknown = 0;
    for (const auto& [spread, r] : steady_) {
      const double off = distances_[r] - distance(own, r).median;
      of_own += log_t(off, spread);
      of_unknown += log_t(off, std::hypot(spread, kUnknownSpread));
    }
    return (of_unknown - of_own) / static_cast<double>(steady_.size());
  }
  // The same by the ranges of the distances.
  double unknown_in_range(std::int32_t own) {
    double sum = 0, weights = 0;
    for (const auto& [range, r] : ranges_) {
      const double off = distances_[r] - distance(own, r).median;
      const double of_unknown = std::hypot(range, kUnknownSpread);
      const double weight = std::log(of_unknown / range);
      sum += weight * (log_t(off, of_unknown) - log_t(off, range));
      weights += weight;
    }
    return sum / weights;
  }
  // Log density of the chosen distances by the profile of another track, relative to the own; -inf
  // without enough of them.
  double density(std::int32_t own, std::int32_t other) {
    double sum = 0;
    std::size_t n_common = 0;
    for (const auto& [spread, r] : steady_) {
      const LearntDistance& of_other = distance(other, r);
      if (!of_other.is_known()) continue;
      ++n_common;
      sum += log_t(distances_[r] - of_other.median, of_other.spread) -
             log_t(distances_[r] - distance(own, r).median, spread);
    }
    return n_common >= kMinNeighbours ? sum / static_cast<double>(n_common)
                                      : -std::numeric_limits<double>::infinity();
  }
  // Student's t with three degrees of freedom, without its constant.
  static double log_t(double off, double spread) {
    return -2 * std::log1p(off * off / (3 * spread * spread)) - std::log(spread);
  }
  // Whether two tracks may be of one marker: they are never present together, and their profiles
  // agree in the steady distances.
  bool may_be_same(std::int32_t own, std::int32_t other) {
    if (has_both(own, other)) return false;
    double sum = 0;
    std::size_t n = 0;
    for (const auto& [spread, r] : steady_) {
      const LearntDistance &a = distance(own, r), &b = distance(other, r);
      if (!b.is_known()) continue;
      const double both = std::hypot(a.spread, b.spread);
      sum += log_t(a.median - b.median, both) - log_t(0, both);
      ++n;
    }
    return n >= kMinNeighbours && sum > kSame * static_cast<double>(n);
  }
  bool has_both(std::int32_t a, std::int32_t b) const {
    const std::span<const Sample> of_a = samples_of(a), of_b = samples_of(b);
    for (std::size_t i = 0, j = 0; i < of_a.size() && j < of_b.size();) {
      if (of_a[i].frame == of_b[j].frame) return true;
      of_a[i].frame < of_b[j].frame ? ++i : ++j;
    }
    return false;
  }
  static void offer(PartEvidence& found, std::int32_t track, double density) {
    for (std::size_t i = 0; i < PartEvidence::kMost; ++i)
      if (density > found.density[i]) {
        std::swap(density, found.density[i]);
        std::swap(track, found.track[i]);
      }
  }
  void choose_references() {
    std::vector<std::int64_t> length(all_.n_tracks, 0);
    for (const std::int64_t k : all_.labels)
      if (k >= 0) ++length[k];
    references_.resize(all_.n_tracks);
    std::iota(references_.begin(), references_.end(), 0);
    std::ranges::stable_sort(references_, std::greater<>(),
                             [&](std::int32_t k) { return length[k]; });
    references_.resize(std::min(references_.size(), kReferences));
    reference_of_.assign(all_.n_tracks, -1);
    for (std::size_t r = 0; r < references_.size(); ++r)
      reference_of_[references_[r]] = static_cast<std::int32_t>(r);
    distances_.resize(references_.size());
    n_present_.resize(all_.n_tracks);
  }

  // Calls take(track, index of its point) for the detections of a frame that are in tracks.
  template <typename Take>
  void each_in(std::int64_t frame, Take&& take) const {
    for (std::int64_t i = all_.offsets[frame]; i < all_.offsets[frame + 1]; ++i)
      if (const std::int64_t k = all_.labels[i]; k >= 0)
        take(static_cast<std::int32_t>(k), i);
  }

  // A detection of a track in one of the sampled frames.
  struct Sample {
    std::int32_t frame = 0, point = 0;
  };
  std::span<const Sample> samples_of(std::int32_t track) const {
    return std::span(samples_).subspan(begin_[track], begin_[track + 1] - begin_[track]);
  }
  // Collects the detections of the sampled frames.
  void sample() {
    begin_.assign(all_.n_tracks + 1, 0);
    for (const std::int64_t frame : all_.samples)
      each_in(frame, [&](std::int32_t k, std::int64_t) { ++begin_[k + 1]; });
    std::partial_sum(begin_.begin(), begin_.end(), begin_.begin());
    samples_.resize(begin_.back());
    std::vector<std::size_t> next(begin_.begin(), begin_.end() - 1);
    at_.assign(all_.samples.size() * references_.size(), -1);
    for (std::size_t s = 0; s < all_.samples.size(); ++s)
      each_in(all_.samples[s], [&](std::int32_t k, std::int64_t i) {
        const auto point = static_cast<std::int32_t>(i);
        samples_[next[k]++] = {static_cast<std::int32_t>(s), point};
        if (const std::int32_t r = reference_of_[k]; r >= 0) at_[r * all_.samples.size() + s] = point;
      });
    profiles_.resize(all_.n_tracks);
  }

  // The distance of a track to a reference, which is computed when it is first needed.
  const LearntDistance& distance(std::int32_t track, std::size_t r) {
    LearntDistance& own = kept(track, r);
    if (own.median == LearntDistance::kLater || own.median == LearntDistance::kLoose)
      own = learn(track, r, false);
    return own;
  }
  // The same if it is steady, null otherwise. Most distances between segments are not, which takes
  // less time to find out than their spread.
  const LearntDistance* steady(std::int32_t track, std::size_t r) {
    LearntDistance& own = kept(track, r);
    if (own.median == LearntDistance::kLater) own = learn(track, r, true);
    return own.is_known() && own.spread < LearntDistance::kSteady ? &own : nullptr;
  }
  // A steady distance, with what its density relative to an unknown marker needs.
  struct Steady {
    std::int32_t reference = 0;  // track
    double median = 0, spread = 0, per_spread = 0, per_unknown = 0, log_ratio = 0;
  };
  // The steady distances of a track, by rising spread.
  const std::vector<Steady>& steadiest(std::int64_t track) {
    steadiest_.resize(profiles_.size());
    if (steadiest_[track]) return *steadiest_[track];
    std::vector<Steady>& found = steadiest_[track].emplace();
    for (std::size_t r = 0; r < references_.size(); ++r)
      if (const LearntDistance* own = steady(static_cast<std::int32_t>(track), r)) {
        const double s2 = own->spread * own->spread, u2 = s2 + kUnknownSpread * kUnknownSpread;
        found.push_back({references_[r], own->median, own->spread, 1 / (3 * s2), 1 / (3 * u2),
                         std::log(u2 / s2) / 2});
      }
    std::ranges::stable_sort(found, {}, &Steady::spread);
    return found;
  }
  LearntDistance& kept(std::int32_t track, std::size_t r) {
    std::vector<LearntDistance>& profile = profiles_[track];
    if (profile.empty()) profile.assign(references_.size(), {LearntDistance::kLater});
    return profile[r];
  }
  LearntDistance learn(std::int32_t track, std::size_t r, bool only_steady) {
    if (references_[r] == track) return {};
    of_samples_.clear();
    const std::int32_t* of_reference = at_.data() + r * all_.samples.size();
    for (const auto& [s, point] : samples_of(track))
      if (const std::int32_t other = of_reference[s]; other >= 0)
        of_samples_.push_back(squared_distance(all_.points[point], all_.points[other], all_.D));
    return learn_distance(of_samples_, floor2_, only_steady);
  }
  // The median distances of a part to the references, -1 where there is none.
  void measure(const TrackPart& part) {
    const std::size_t R = references_.size();
    n_measured_ = part.frames.size();
    std::ranges::fill(n_present_, 0);
    values_.resize(R * n_measured_);
    counts_.assign(R, 0);
    for (const std::int64_t frame : part.frames) {
      Point own;
      each_in(frame, [&](std::int32_t k, std::int64_t i) {
        n_present_[k] += 1;
        if (k == part.track) own = all_.points[i];
      });
      each_in(frame, [&](std::int32_t k, std::int64_t i) {
        if (const std::int32_t r = reference_of_[k]; r >= 0)
          values_[r * n_measured_ + counts_[r]++] = squared_distance(own, all_.points[i], all_.D);
      });
    }
    for (std::size_t r = 0; r < R; ++r) {
      distances_[r] = -1;
      if (counts_[r] == 0) continue;
      const auto begin = values_.begin() + static_cast<std::ptrdiff_t>(r * n_measured_);
      std::nth_element(begin, begin + counts_[r] / 2, begin + counts_[r]);
      distances_[r] = std::sqrt(*(begin + counts_[r] / 2));
    }
  }

  LabelledFrames all_;
  double floor2_;
  std::vector<std::int32_t> references_, reference_of_;
  std::vector<Sample> samples_;  // one track after the other
  std::vector<std::size_t> begin_;  // of each track in `samples_`
  std::vector<std::int32_t> at_;  // point of each reference in the sampled frames, -1 for none
  std::vector<std::vector<LearntDistance>> profiles_;  // of each track, empty until it is needed
  std::vector<std::optional<std::vector<Steady>>> steadiest_;
  std::vector<double> of_samples_;
  // Of the part that is compared.
  std::size_t n_measured_ = 0;
  std::vector<double> values_, distances_, n_present_;
  std::vector<std::ptrdiff_t> counts_;
  BySpread steady_, ranges_;
};

}  // namespace asterism
