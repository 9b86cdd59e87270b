// The distances of two tracks to others, by which the two are distinguished.
//
// Where two tracks are exchanged, their distances to a third one are exchanged too. If the medians of
// enough distances differ, the difference of the distances changes its sign there, so that the frames
// fall into two groups. Otherwise the tracks may still differ in how steady their distances are. With
// the medians m and the spreads s of the distances d of both tracks, frame by frame,
//
//   e = w Σ_r [ t(d_ar; m_br, s_br) + t(d_br; m_ar, s_ar) - t(d_ar; m_ar, s_ar) - t(d_br; m_br, s_br) ]
//
// is the evidence that they are exchanged: t is the log density of Student's t, each difference is
// bounded, and w is small because the errors of neighbours and of successive frames are alike.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "stitch/usual_distances.hpp"

namespace asterism {

class PairDistances {
 public:
  static constexpr std::size_t kMinReferences = 2;

  // `noise` is the standard deviation of a coordinate.
  PairDistances(const UsualDistances& all, double noise)
      : all_(all), floor2_(2 * std::max(noise * noise, kMinNoise * kMinNoise)) {}

  // Begins with two tracks. Returns whether they are compared: both are present together for long
  // enough, and so are enough others.
  bool begin(std::int32_t a, std::int32_t b) {
    one_ = a, other_ = b;
    choose_references();
    list_frames();
    if (references_.size() <= kMinReferences || together_.size() < UsualDistances::kMinTogether)
      return false;
    find_contrasts();
    by_medians_ = contrasts_.size() >= kMinReferences;
    if (!by_medians_) return true;
    references_.clear();
    for (const Contrast& c : contrasts_) references_.push_back(c.track);
    return true;
  }
  // Whether the medians of enough distances differ.
  bool by_medians() const { return by_medians_; }
  // The frames with a detection of at least one track, and the indices of those with both.
  std::span<const std::int64_t> frames() const { return frames_; }
  std::span<const std::size_t> together() const { return together_; }

  // Separates the frames by the sign of the differences, if the medians differ; the smaller group is
  // exchanged.
  void separate(std::vector<char>& is_exchanged) {
    const std::vector<double> direction = main_direction();
    std::size_t n_negative = 0;
    for (const std::size_t u : together_) {
      scale_differences(frames_[u]);
      double sum = 0;
      for (std::size_t r = 0; r < contrasts_.size(); ++r) sum += direction[r] * scaled_[r];
      is_exchanged[u] = sum <= 0;
      n_negative += sum <= 0;
    }
    if (2 * n_negative > together_.size())
      for (const std::size_t u : together_) is_exchanged[u] = !is_exchanged[u];
  }
  // Learns the distances of both tracks, as exchanged so far. Returns how many differ, at most
  // kReferences.
  std::size_t learn(const std::vector<char>& is_exchanged) {
    known_.clear();
    const std::size_t n = std::min(frames_.size(), kSampled);
    for (const std::int32_t r : references_) {
      std::array<std::vector<double>, 2>& values = of_sides_;
      for (auto& each : values) each.clear();
      for (std::size_t k = 0; k < n; ++k) {
        const std::size_t u = k * frames_.size() / n;
        const Point* at = all_.find(r, frames_[u]);
        if (at == nullptr) continue;
        const std::array<std::int32_t, 2> own{one_, other_};
        for (std::size_t side = 0; side < 2; ++side)
          if (const Point* p = all_.find(own[side], frames_[u]); p != nullptr)
            values[side ^ static_cast<std::size_t>(is_exchanged[u])].push_back(all_.between(*p, *at));
      }
      if (values[0].size() < kMinKnown || values[1].size() < kMinKnown) continue;
      Usual a = usual(values[0]), b = usual(values[1]);
      if (by_medians_) a.variance = b.variance = std::max(a.variance, b.variance);
      // The divergence of normal distributions, from each to the other.
      const double off2 = (a.middle - b.middle) * (a.middle - b.middle);
      const double divergence =
          ((a.variance + off2) / b.variance + (b.variance + off2) / a.variance) / 2 - 1;
      if (divergence > (by_medians_ ? kMinContrast * kMinContrast : kMinDivergence))
        known_.push_back({-divergence, r, a, b});
    }
    std::ranges::sort(known_, {}, [](const Known& k) { return std::pair(k.negated, k.track); });
    known_.resize(std::min(known_.size(), kReferences));
    return known_.size();
  }
  // The evidence in a frame by the distances learnt.
  double evidence(std::int64_t t) const {
    const Point *a = all_.find(one_, t), *b = all_.find(other_, t);
    double sum = 0;
    for (const Known& k : known_) {
      const Point* at = all_.find(k.track, t);
      if (at == nullptr) continue;
      Usual one = k.of_one, other = k.of_other;
      // Of a track alone, any odd distance fits the looser one of both better.
      if (a == nullptr || b == nullptr)
        one.variance = other.variance = std::max(one.variance, other.variance);
      if (a != nullptr) sum += ratio(all_.between(*a, *at), other, one);
      if (b != nullptr) sum += ratio(all_.between(*b, *at), one, other);
    }
    return kWeight * sum;
  }

 private:
  static constexpr std::size_t kReferences = 8, kCandidates = 16;
  static constexpr std::size_t kSampled = 600;  // frames from which medians are taken
  static constexpr std::size_t kMinKnown = 10;  // frames
  static constexpr double kMinPresent = 0.5;    // share of the frames in which a reference is present
  static constexpr double kMinContrast = 2;     // smallest difference of medians, in deviations
  static constexpr double kMinDivergence = 1;   // smallest one of the distances of both tracks, nats
  static constexpr double kMinNoise = 2e-3;     // metres
  static constexpr double kBend = 0.02;         // spread of a distance as a share of it
  static constexpr double kBound = 5;           // of the evidence of one distance
  static constexpr double kWeight = 1.0 / 40;   // w

  struct Contrast {
    double negated = 0;
    std::int32_t track = 0;
    double deviation = 0;
  };
  // The distances of both tracks to a third one.
  struct Usual {
    double middle = 0, variance = 0;
  };
  struct Known {
    double negated = 0;  // divergence of both
    std::int32_t track = 0;
    Usual of_one, of_other;
  };

  // Chooses the tracks to which distances are taken: the nearest ones to both that are present
  // for long.
  void choose_references() {
    const std::int32_t K = all_.n_tracks();
    const double least = kMinPresent * static_cast<double>(all_.n_frames());
    near_.clear();
    double beyond = UsualDistances::kUnknown;  // of what is not among the nearest
    for (std::int32_t r = 0; r < K; ++r) {
      const double far = std::max(all_.usual(one_, r), all_.usual(other_, r));
      if (!(far < beyond) || r == one_ || r == other_) continue;
      if (static_cast<double>(all_.frames(r).size()) <= least) continue;
      near_.insert(std::ranges::upper_bound(near_, std::pair(far, r)), {far, r});
      if (near_.size() <= kCandidates) continue;
      near_.pop_back();
      beyond = near_.back().first;
    }
    references_.clear();
    for (const auto& [far, r] : near_) references_.push_back(r);
  }
  void list_frames() {
    const std::span a = all_.frames(one_), b = all_.frames(other_);
    frames_.clear();
    together_.clear();
    if (a.empty() || b.empty()) return;
    const std::int64_t last = std::max(a.back(), b.back());
    for (std::int64_t t = std::min(a.front(), b.front()); t <= last; ++t) {
      const bool has_one = all_.find(one_, t) != nullptr;
      const bool has_other = all_.find(other_, t) != nullptr;
      if (has_one && has_other) together_.push_back(frames_.size());
      if (has_one || has_other) frames_.push_back(t);
    }
  }
  // Finds the references whose distances differ most, without regard to the sign.
  void find_contrasts() {
    contrasts_.clear();
    const std::size_t n = std::min(together_.size(), kSampled);
    for (const std::int32_t r : references_) {
      apart_.clear();
      both_.clear();
      for (std::size_t k = 0; k < n; ++k) {
        const std::int64_t t = frames_[together_[k * together_.size() / n]];
        const Point* at = all_.find(r, t);
        if (at == nullptr) continue;
        const double x = all_.between(*all_.find(one_, t), *at),
                     y = all_.between(*all_.find(other_, t), *at);
        apart_.push_back(std::abs(x - y));
        both_.push_back(x + y);
      }
      if (apart_.size() < std::max(kMinKnown, n / 2)) continue;
      const MiddleAndSpread difference = middle_and_spread(apart_), sum = middle_and_spread(both_);
      const double bend = kBend * difference.middle;
      const double deviation =
          std::sqrt(difference.spread * difference.spread + sum.spread * sum.spread / 4 +
                    floor2_ + bend * bend);
      if (difference.middle > kMinContrast * deviation)
        contrasts_.push_back({-difference.middle / deviation, r, deviation});
    }
    std::ranges::sort(contrasts_, {},
                      [](const Contrast& c) { return std::pair(c.negated, c.track); });
    contrasts_.resize(std::min(contrasts_.size(), kReferences));
  }
  // Differences of the distances to each of these in deviations, 0 where it is absent.
  void scale_differences(std::int64_t t) {
    const Point &a = *all_.find(one_, t), &b = *all_.find(other_, t);
    scaled_.assign(contrasts_.size(), 0);
    for (std::size_t r = 0; r < contrasts_.size(); ++r)
      if (const Point* at = all_.find(contrasts_[r].track, t); at != nullptr)
        scaled_[r] = std::clamp(
            (all_.between(a, *at) - all_.between(b, *at)) / contrasts_[r].deviation, -10.0, 10.0);
  }
  // The direction in which the differences vary most, by power iteration.
  std::vector<double> main_direction() {
    const std::size_t R = contrasts_.size(), n = std::min(together_.size(), kSampled);
    std::vector<double> moments(R * R, 0), direction(R, 0), next(R);
    for (std::size_t k = 0; k < n; ++k) {
      scale_differences(frames_[together_[k * together_.size() / n]]);
      for (std::size_t i = 0; i < R; ++i)
        for (std::size_t j = 0; j < R; ++j) moments[i * R + j] += scaled_[i] * scaled_[j];
    }
    std::size_t largest = 0;
    for (std::size_t i = 1; i < R; ++i)
      if (moments[i * R + i] > moments[largest * R + largest]) largest = i;
    direction[largest] = 1;
    for (int step = 0; step < 100; ++step) {
      double length2 = 0;
      for (std::size_t i = 0; i < R; ++i) {
        next[i] = 0;
        for (std::size_t j = 0; j < R; ++j) next[i] += moments[i * R + j] * direction[j];
        length2 += next[i] * next[i];
      }
      if (!(length2 > 0)) break;
      for (std::size_t i = 0; i < R; ++i) direction[i] = next[i] / std::sqrt(length2);
    }
    return direction;
  }
  // Log density ratio of a distance of two tracks: Student's t with four degrees of freedom.
  static double ratio(double d, const Usual& one, const Usual& other) {
    const double x = (d - one.middle) * (d - one.middle) / one.variance,
                 y = (d - other.middle) * (d - other.middle) / other.variance;
    return std::clamp(2.5 * std::log((4 + y) / (4 + x)) + std::log(other.variance / one.variance) / 2,
                      -kBound, kBound);
  }
  Usual usual(std::vector<double>& values) const {
    const MiddleAndSpread own = middle_and_spread(values);
    const double bend = kBend * own.middle;
    return {own.middle, own.spread * own.spread + floor2_ + bend * bend};
  }

  const UsualDistances& all_;
  double floor2_;
  std::int32_t one_ = 0, other_ = 0;
  std::vector<std::int64_t> frames_;
  std::vector<std::size_t> together_;
  std::vector<std::int32_t> references_;
  bool by_medians_ = true;
  std::vector<Known> known_;
  // Scratch.
  std::vector<std::pair<double, std::int32_t>> near_;
  std::vector<Contrast> contrasts_;
  std::vector<double> apart_, both_, scaled_;
  std::array<std::vector<double>, 2> of_sides_;
};

}  // namespace asterism
