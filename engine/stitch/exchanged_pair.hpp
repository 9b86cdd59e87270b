// The stretches of frames in which two tracks have each other's marker, by the distances that both
// keep to other tracks and by their motion.
//
// Where two tracks are exchanged, their distances to a third marker are exchanged too. If these
// differ, their difference changes its sign, so that the frames of a pair fall into two groups
// whichever group is right; the larger one counts as right. If too few differ, the tracks may still
// differ in how steady their distances are, and the search begins without an exchange. With the
// medians m and the spreads s of the distances d of both tracks, frame by frame,
//
//   e = w Σ_r [ t(d_ar; m_br, s_br) + t(d_br; m_ar, s_ar) - t(d_ar; m_ar, s_ar) - t(d_br; m_br, s_br) ]
//
// is the evidence that they are exchanged: t is the log density of Student's t, each difference is
// bounded, and w is small because the errors of neighbours and of successive frames are alike. The
// stretches are those of the most probable sequence of states. An edge is moved to where the
// exchange fits the motion best, and the log-likelihood ratio of the motion there counts as well.
//
// With exchanges that fit the motion better than none, the sequence of states gains their ratios as
// well, and one distance that differs is evidence too.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <span>
#include <utility>
#include <vector>

#include "confidence/exchanges.hpp"
#include "stitch/usual_distances.hpp"

namespace asterism {

struct ExchangedStretch {
  std::array<std::int32_t, 2> track{};
  std::int64_t first = 0, end = 0;  // frames
  double gain = 0;                  // log odds of the exchange
};

// The search in one pair of tracks after another.
class ExchangedPair {
 public:
  // `noise` is the standard deviation of a coordinate. Without `by_spreads` and `by_motion`, pairs
  // whose distances do not differ are left out.
  ExchangedPair(const UsualDistances& all, const MotionModel& m, const Timeline& line,
                double p_detection, double noise, bool by_spreads, bool by_motion)
      : all_(all), m_(m), line_(line), p_detection_(p_detection),
        floor2_(2 * std::max(noise * noise, kMinNoise * kMinNoise)),
        by_spreads_(by_spreads || by_motion), by_motion_(by_motion) {}

  // Appends the stretches of a pair, with its exchanges by the motion.
  void find(std::int32_t a, std::int32_t b, std::span<const Exchange> exchanges,
            std::vector<ExchangedStretch>& found) {
    one_ = a, other_ = b;
    if (!choose_references() || !separate()) return;
    weigh_changes(exchanges);
    for (int n = 0; n < (by_middles_ ? kRounds : kMoreRounds); ++n) {
      before_ = is_exchanged_;
      if (!weigh()) return;
      if (is_exchanged_ == before_) break;  // another round would learn the same
    }
    if (std::ranges::count(is_exchanged_, 1) == 0) return;
    ExchangeSearch motion(m_, line_, p_detection_);
    for (const std::int32_t k : {a, b}) motion.add(all_.points(k), all_.frames(k));
    const std::size_t U = frames_.size();
    sums_.assign(U + 1, 0);
    for (std::size_t u = 0; u < U; ++u) sums_[u + 1] = sums_[u] + evidence_[u];
    for (std::size_t first = 0; first < U; ++first) {
      if (!is_exchanged_[first]) continue;
      std::size_t end = first;
      while (end < U && is_exchanged_[end]) ++end;
      offer(motion, first, end, found);
      first = end;
    }
  }

 private:
  static constexpr std::size_t kReferences = 8, kCandidates = 16, kMinReferences = 2;
  static constexpr std::size_t kSampled = 600;  // frames from which medians are taken
  static constexpr std::size_t kMinKnown = 10;  // frames
  static constexpr double kMinPresent = 0.5;    // share of the frames in which a reference is present
  static constexpr double kMinContrast = 2;     // smallest difference of medians, in deviations
  static constexpr double kMinDivergence = 1;   // smallest one of the distances of both tracks, nats
  static constexpr double kMinTogether = 0.25;  // share of a stretch with both tracks, if by spreads
  static constexpr std::size_t kMinFrames = 4;  // of a stretch by motion
  static constexpr int kRounds = 2;             // of learning the distances, at most
  static constexpr int kMoreRounds = 5;         // the same by spreads, from no exchange on
  static constexpr double kMinNoise = 2e-3;     // metres
  static constexpr double kBend = 0.02;         // spread of a distance as a share of it
  static constexpr double kBound = 5;           // of the evidence of one distance
  static constexpr double kWeight = 1.0 / 40;   // w
  static constexpr double kChange = 4;          // cost of each edge of a stretch
  static constexpr double kMinGain = 6;
  static constexpr double kMinMotion = -30;     // smallest log-likelihood ratio of the motion
  static constexpr double kJoin = -1;           // that of an edge at a gap of one of both tracks
  static constexpr std::int64_t kLongGap = 4;   // frames, beyond which it is such a gap
  static constexpr std::size_t kMoved = 10;     // frames by which an edge is moved
  static constexpr double kInfinite = std::numeric_limits<double>::infinity();

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
  struct Edge {
    std::size_t at = 0;  // index of the frame before which the tracks are exchanged
    double motion = 0;
  };

  // Chooses the tracks to which distances are taken: the nearest ones to both that are present
  // for long.
  bool choose_references() {
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
    return references_.size() > kMinReferences;
  }

  // Separates the frames by the sign of the differences of the distances. Returns whether there may
  // be an exchange.
  bool separate() {
    const std::span a = all_.frames(one_), b = all_.frames(other_);
    frames_.clear();
    together_.clear();
    if (a.empty() || b.empty()) return false;
    const std::int64_t last = std::max(a.back(), b.back());
    for (std::int64_t t = std::min(a.front(), b.front()); t <= last; ++t) {
      const bool has_one = all_.find(one_, t) != nullptr;
      const bool has_other = all_.find(other_, t) != nullptr;
      if (has_one && has_other) together_.push_back(frames_.size());
      if (has_one || has_other) frames_.push_back(t);
    }
    is_exchanged_.assign(frames_.size(), 0);
    if (together_.size() < UsualDistances::kMinTogether) return false;
    find_contrasts();
    by_middles_ = contrasts_.size() >= kMinReferences;
    if (!by_middles_) return by_spreads_;
    references_.clear();
    for (const Contrast& c : contrasts_) references_.push_back(c.track);
    const std::vector<double> direction = main_direction();
    std::size_t n_negative = 0;
    for (const std::size_t u : together_) {
      scale_differences(frames_[u]);
      double sum = 0;
      for (std::size_t r = 0; r < contrasts_.size(); ++r) sum += direction[r] * scaled_[r];
      is_exchanged_[u] = sum <= 0;
      n_negative += sum <= 0;
    }
    if (2 * n_negative > together_.size())
      for (const std::size_t u : together_) is_exchanged_[u] = !is_exchanged_[u];
    return n_negative > 0 && n_negative < together_.size();  // most pairs have one side only
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

  // Computes the evidence of each frame by the medians of the present states, and the states that
  // are most probable by it.
  bool weigh() {
    learn();
    if (known_.size() < kMinReferences && !by_motion_) return false;
    evidence_.assign(frames_.size(), 0);
    for (std::size_t u = 0; u < frames_.size(); ++u) {
      const Point *a = all_.find(one_, frames_[u]), *b = all_.find(other_, frames_[u]);
      double sum = 0;
      for (const Known& k : known_) {
        const Point* at = all_.find(k.track, frames_[u]);
        if (at == nullptr) continue;
        Usual one = k.of_one, other = k.of_other;
        // Of a track alone, any odd distance fits the looser one of both better.
        if (a == nullptr || b == nullptr)
          one.variance = other.variance = std::max(one.variance, other.variance);
        if (a != nullptr) sum += ratio(all_.between(*a, *at), other, one);
        if (b != nullptr) sum += ratio(all_.between(*b, *at), one, other);
      }
      evidence_[u] = kWeight * sum;
    }
    decode();
    const auto n = static_cast<std::size_t>(std::ranges::count(is_exchanged_, 1));
    if (2 * n > frames_.size())
      for (std::size_t u = 0; u < frames_.size(); ++u) {
        is_exchanged_[u] = !is_exchanged_[u];
        evidence_[u] = -evidence_[u];
      }
    return true;
  }
  // Log density ratio of a distance of two tracks: Student's t with four degrees of freedom.
  static double ratio(double d, const Usual& one, const Usual& other) {
    const double x = (d - one.middle) * (d - one.middle) / one.variance,
                 y = (d - other.middle) * (d - other.middle) / other.variance;
    return std::clamp(2.5 * std::log((4 + y) / (4 + x)) + std::log(other.variance / one.variance) / 2,
                      -kBound, kBound);
  }
  // Learns the distances of both tracks, as exchanged so far.
  void learn() {
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
            values[side ^ static_cast<std::size_t>(is_exchanged_[u])].push_back(all_.between(*p, *at));
      }
      if (values[0].size() < kMinKnown || values[1].size() < kMinKnown) continue;
      Usual a = usual(values[0]), b = usual(values[1]);
      if (by_middles_) a.variance = b.variance = std::max(a.variance, b.variance);
      // The divergence of normal distributions, from each to the other.
      const double off2 = (a.middle - b.middle) * (a.middle - b.middle);
      const double divergence =
          ((a.variance + off2) / b.variance + (b.variance + off2) / a.variance) / 2 - 1;
      if (divergence > (by_middles_ ? kMinContrast * kMinContrast : kMinDivergence))
        known_.push_back({-divergence, r, a, b});
    }
    std::ranges::sort(known_, {}, [](const Known& k) { return std::pair(k.negated, k.track); });
    known_.resize(std::min(known_.size(), kReferences));
  }
  Usual usual(std::vector<double>& values) const {
    const MiddleAndSpread own = middle_and_spread(values);
    const double bend = kBend * own.middle;
    return {own.middle, own.spread * own.spread + floor2_ + bend * bend};
  }
  // What a change of the state before each frame adds. Often the frames around an exchange fit it as
  // well; that which fits best counts.
  void weigh_changes(std::span<const Exchange> exchanges) {
    const std::size_t U = frames_.size();
    fits_.assign(U, 0);
    for (const Exchange& one : exchanges) {
      bool is_linked = true;
      for (const int side : {0, 1}) {
        const auto n = static_cast<std::int64_t>(all_.frames(one.track[side]).size());
        is_linked = is_linked && one.tail[side] > 0 && one.tail[side] < n;
      }
      if (is_linked) fits_[std::ranges::lower_bound(frames_, one.frame) - frames_.begin()] = one.gain;
    }
    changes_.assign(U, -kChange);
    for (std::size_t u = 0; u < U; ++u) {
      const auto near = std::span(fits_).subspan(u - std::min(u, kMinFrames - 1));
      const std::size_t n = std::min(near.size(), std::min(u, kMinFrames - 1) + kMinFrames);
      if (fits_[u] > 0 && fits_[u] == std::ranges::max(near.first(n))) changes_[u] += fits_[u];
    }
  }
  // The most probable sequence of states (Viterbi), each change of which has a cost.
  void decode() {
    const std::size_t U = frames_.size();
    came_from_.assign(U, {0, 1});
    double kept = 0, exchanged = 0;
    for (std::size_t u = 0; u < U; ++u) {
      const double stays_kept = kept, stays_exchanged = exchanged;
      if (stays_exchanged + changes_[u] > stays_kept) {
        kept = stays_exchanged + changes_[u];
        came_from_[u][0] = 1;
      }
      if (stays_kept + changes_[u] > stays_exchanged) {
        exchanged = stays_kept + changes_[u];
        came_from_[u][1] = 0;
      }
      exchanged += evidence_[u];
    }
    char state = exchanged > kept;
    for (std::size_t u = U; u-- > 0;) {
      is_exchanged_[u] = state;
      state = came_from_[u][static_cast<std::size_t>(state)];
    }
  }

  // Adds a stretch with the edges that fit the motion best.
  void offer(const ExchangeSearch& motion, std::size_t first, std::size_t end,
             std::vector<ExchangedStretch>& found) {
    if (!by_middles_ && n_together(first, end) < kMinTogether * static_cast<double>(end - first))
      return;
    const std::vector<Edge> begins = edges(motion, first), ends = edges(motion, end);
    ExchangedStretch best;
    best.gain = -kInfinite;
    std::size_t n_frames = 0;
    for (const Edge& from : begins)
      for (const Edge& to : ends) {
        const double gain = sums_[to.at] - sums_[from.at] + from.motion + to.motion;
        if (to.at <= from.at || !(gain > best.gain)) continue;
        const std::int64_t stop = to.at < frames_.size() ? frames_[to.at] : frames_.back() + 1;
        best = {{one_, other_}, frames_[from.at], stop, gain};
        n_frames = to.at - from.at;
      }
    if (best.gain > kMinGain && (!by_motion_ || n_frames >= kMinFrames)) found.push_back(best);
  }
  // Number of frames with both tracks.
  double n_together(std::size_t first, std::size_t end) const {
    return static_cast<double>(std::ranges::lower_bound(together_, end) -
                               std::ranges::lower_bound(together_, first));
  }
  std::vector<Edge> edges(const ExchangeSearch& motion, std::size_t at) const {
    const std::size_t U = frames_.size();
    if (at == 0 || at == U) return {{at, 0}};
    std::vector<Edge> found;
    const std::size_t low = at > kMoved ? at - kMoved : 1, high = std::min(at + kMoved, U - 1);
    for (std::size_t u = low; u <= high; ++u)
      if (const double ratio = motion_ratio(motion, frames_[u]); ratio > kMinMotion)
        found.push_back({u, ratio});
    return found;
  }
  // Log-likelihood ratio of the exchange of the tails from frame t on.
  double motion_ratio(const ExchangeSearch& motion, std::int64_t t) const {
    std::array<bool, 2> is_linked{};
    std::int64_t gap = 0;
    const std::array<std::int32_t, 2> own{one_, other_};
    for (std::size_t side = 0; side < 2; ++side) {
      const std::span of = all_.frames(own[side]);
      const auto next = std::ranges::lower_bound(of, t);
      is_linked[side] = next != of.begin() && next != of.end();
      if (is_linked[side]) gap = *next - *(next - 1);
    }
    if (is_linked[0] && is_linked[1]) return motion.ratio(t);
    if (!is_linked[0] && !is_linked[1]) return 0;
    return gap > kLongGap ? kJoin : -kInfinite;
  }

  const UsualDistances& all_;
  const MotionModel& m_;
  const Timeline& line_;
  double p_detection_, floor2_;
  bool by_spreads_, by_motion_;
  std::int32_t one_ = 0, other_ = 0;
  std::vector<std::int64_t> frames_;     // with a detection of at least one track
  std::vector<std::size_t> together_;    // indices of those with both
  std::vector<char> is_exchanged_, before_;  // in each of `frames`, and before a round
  std::vector<double> evidence_, sums_, fits_, changes_;  // of each of them, and before each
  std::vector<std::int32_t> references_;
  bool by_middles_ = true;  // whether the middles of the distances differ enough
  std::vector<Known> known_;
  // Scratch.
  std::vector<std::pair<double, std::int32_t>> near_;
  std::vector<Contrast> contrasts_;
  std::vector<double> apart_, both_, scaled_;
  std::array<std::vector<double>, 2> of_sides_;
  std::vector<std::array<char, 2>> came_from_;
};

}  // namespace asterism
