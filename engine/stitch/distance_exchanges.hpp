// Finds stretches of frames in which two tracks have each other's marker, by the distances that
// markers keep to others.
//
// Where two tracks are exchanged, their distances to a third marker are exchanged too. The
// difference of both distances then changes its sign, so that the frames of a pair fall into two
// groups whichever group is right; the larger one counts as right. With the medians
// m of the distances d of both tracks, frame by frame,
//
//   e = w Σ_r [ t(d_ar; m_br) + t(d_br; m_ar) - t(d_ar; m_ar) - t(d_br; m_br) ]
//
// is the evidence that they are exchanged: t is the log density of Student's t, each difference is
// bounded, and w is small because the errors of neighbours and of successive frames are alike. The
// stretches are those of the most probable sequence of states. An edge is moved to where the
// exchange fits the motion best, and the log-likelihood ratio of the motion there counts as well.
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

namespace asterism {

struct ExchangedStretch {
  std::array<std::int32_t, 2> track{};
  std::int64_t first = 0, end = 0;  // frames
  double gain = 0;                  // log odds of the exchange
};

class DistanceExchanges {
 public:
  // `noise` is the standard deviation of a coordinate.
  DistanceExchanges(const MotionModel& m, const Timeline& line, double p_detection, double noise)
      : m_(m), line_(line), p_detection_(p_detection),
        floor2_(2 * std::max(noise * noise, kMinNoise * kMinNoise)) {}

  // The tracks are given as points and rising frames of each, and must not change.
  void add(std::span<const Point> points, std::span<const std::int64_t> frames) {
    Track& own = tracks_.emplace_back(Track{points, frames, {}});
    if (frames.empty()) return;
    own.at.assign(static_cast<std::size_t>(frames.back() - frames.front()) + 1, -1);
    for (std::size_t i = 0; i < frames.size(); ++i)
      own.at[static_cast<std::size_t>(frames[i] - frames.front())] = static_cast<std::int32_t>(i);
  }

  // The stretches of all pairs of near tracks, at least one of which `is_examined`.
  std::vector<ExchangedStretch> find(std::span<const char> is_examined) {
    measure();
    std::vector<ExchangedStretch> found;
    Pair pair(*this);
    const auto K = static_cast<std::int32_t>(tracks_.size());
    for (std::int32_t a = 0; a < K; ++a)
      for (std::int32_t b = a + 1; b < K; ++b)
        if ((is_examined[a] || is_examined[b]) && usual(a, b) < kNear) pair.find(a, b, found);
    return found;
  }

 private:
  static constexpr double kNear = 0.3;        // usual distance of tracks that are compared, metres
  static constexpr std::size_t kReferences = 8, kCandidates = 16, kMinReferences = 2;
  static constexpr std::int64_t kUsual = 150;  // frames from which usual distances are taken
  static constexpr std::size_t kSampled = 600;  // frames from which medians are taken
  static constexpr std::size_t kMinTogether = 20, kMinKnown = 10, kMinUsual = 5;  // frames
  static constexpr double kMinPresent = 0.5;  // share of the frames in which a reference is present
  static constexpr double kMinContrast = 2;   // smallest difference of medians, in deviations
  static constexpr double kMinNoise = 2e-3;   // metres
  static constexpr double kBend = 0.02;       // spread of a distance as a share of it
  static constexpr double kBound = 5;         // of the evidence of one distance
  static constexpr double kWeight = 1.0 / 40;  // w
  static constexpr double kChange = 4;        // cost of each edge of a stretch
  static constexpr double kMinGain = 6;
  static constexpr double kMinMotion = -30;   // smallest log-likelihood ratio of the motion
  static constexpr double kJoin = -1;         // that of an edge at a gap of one of both tracks
  static constexpr std::int64_t kLongGap = 4;  // frames, beyond which it is such a gap
  static constexpr std::size_t kMoved = 10;   // frames by which an edge is moved
  static constexpr double kInfinite = std::numeric_limits<double>::infinity();

  struct Track {
    std::span<const Point> points;
    std::span<const std::int64_t> frames;
    std::vector<std::int32_t> at;  // index of the point in each frame from the first on, or -1

    // Null without a detection in the frame.
    const Point* find(std::int64_t t) const {
      if (frames.empty() || t < frames.front() || t > frames.back()) return nullptr;
      const std::int32_t i = at[static_cast<std::size_t>(t - frames.front())];
      return i < 0 ? nullptr : &points[static_cast<std::size_t>(i)];
    }
  };
  struct Median {
    double middle = 0, spread = 0;  // the spread is that of a normal distribution
  };
  static Median median(std::vector<double>& values) {
    const auto middle_of = [&] {
      const auto at = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
      std::ranges::nth_element(values, at);
      return *at;
    };
    Median found;
    found.middle = middle_of();
    for (double& value : values) value = std::abs(value - found.middle);
    found.spread = 1.4826 * middle_of();
    return found;
  }
  double distance(const Point& a, const Point& b) const {
    return std::sqrt(squared_distance(a, b, m_.axis.D));
  }

  double& usual(std::int32_t a, std::int32_t b) {
    return usual_[static_cast<std::size_t>(a) * tracks_.size() + static_cast<std::size_t>(b)];
  }
  double usual(std::int32_t a, std::int32_t b) const {
    return usual_[static_cast<std::size_t>(a) * tracks_.size() + static_cast<std::size_t>(b)];
  }
  // Takes the usual distances of all pairs from frames spread over the capture.
  void measure() {
    const auto T = static_cast<std::int64_t>(line_.times.size());
    const std::int64_t n = std::min(T, kUsual);
    const auto K = static_cast<std::int32_t>(tracks_.size());
    usual_.assign(tracks_.size() * tracks_.size(), kInfinite);
    std::vector<double> values;
    // Fragments are compared with nothing, however many there are.
    const auto is_long = [&](std::int32_t k) { return tracks_[k].frames.size() >= kMinTogether; };
    for (std::int32_t a = 0; a < K; ++a)
      for (std::int32_t b = a + 1; b < K && is_long(a); ++b) {
        if (!is_long(b)) continue;
        values.clear();
        for (std::int64_t s = 0; s < n; ++s) {
          const Point* one = tracks_[a].find(s * T / n);
          const Point* other = one == nullptr ? nullptr : tracks_[b].find(s * T / n);
          if (other != nullptr) values.push_back(squared_distance(*one, *other, m_.axis.D));
        }
        if (values.size() < kMinUsual) continue;
        const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
        std::ranges::nth_element(values, middle);
        usual(a, b) = usual(b, a) = std::sqrt(*middle);
      }
  }

  // The search in a pair of tracks.
  struct Pair {
    explicit Pair(const DistanceExchanges& all) : s(all) {}

    void find(std::int32_t a, std::int32_t b, std::vector<ExchangedStretch>& found) {
      one = a, other = b;
      if (!choose_references() || !separate()) return;
      for (int n = 0; n < 2; ++n)
        if (!weigh()) return;
      if (std::ranges::count(is_exchanged, 1) == 0) return;
      ExchangeSearch motion(s.m_, s.line_, s.p_detection_);
      for (const std::int32_t k : {a, b}) motion.add(s.tracks_[k].points, s.tracks_[k].frames);
      const std::size_t U = frames.size();
      sums.assign(U + 1, 0);
      for (std::size_t u = 0; u < U; ++u) sums[u + 1] = sums[u] + evidence[u];
      for (std::size_t first = 0; first < U; ++first) {
        if (!is_exchanged[first]) continue;
        std::size_t end = first;
        while (end < U && is_exchanged[end]) ++end;
        offer(motion, first, end, found);
        first = end;
      }
    }

    // Chooses the tracks to which distances are taken: the nearest ones to both that are present
    // for long.
    bool choose_references() {
      const auto K = static_cast<std::int32_t>(s.tracks_.size());
      const double least = kMinPresent * static_cast<double>(s.line_.times.size());
      near.clear();
      for (std::int32_t r = 0; r < K; ++r) {
        const double far = std::max(s.usual(one, r), s.usual(other, r));
        const auto n = static_cast<double>(s.tracks_[r].frames.size());
        if (r != one && r != other && far < kInfinite && n > least) near.emplace_back(far, r);
      }
      std::ranges::sort(near);
      near.resize(std::min(near.size(), kCandidates));
      references.clear();
      for (const auto& [far, r] : near) references.push_back(r);
      return references.size() > kMinReferences;
    }

    // Separates the frames by the sign of the differences of the distances.
    bool separate() {
      const Track &a = s.tracks_[one], &b = s.tracks_[other];
      frames.clear();
      together.clear();
      if (a.frames.empty() || b.frames.empty()) return false;
      const std::int64_t last = std::max(a.frames.back(), b.frames.back());
      for (std::int64_t t = std::min(a.frames.front(), b.frames.front()); t <= last; ++t) {
        const bool has_one = a.find(t) != nullptr, has_other = b.find(t) != nullptr;
        if (has_one && has_other) together.push_back(frames.size());
        if (has_one || has_other) frames.push_back(t);
      }
      is_exchanged.assign(frames.size(), 0);
      if (together.size() < kMinTogether) return false;
      keep_contrasting();
      if (references.size() < kMinReferences) return false;
      const std::vector<double> direction = main_direction();
      std::size_t n_negative = 0;
      for (const std::size_t u : together) {
        scale_differences(frames[u]);
        double sum = 0;
        for (std::size_t r = 0; r < references.size(); ++r) sum += direction[r] * scaled[r];
        is_exchanged[u] = sum <= 0;
        n_negative += sum <= 0;
      }
      if (2 * n_negative > together.size())
        for (const std::size_t u : together) is_exchanged[u] = !is_exchanged[u];
      return n_negative > 0 && n_negative < together.size();  // most pairs have one side only
    }
    // Keeps the references whose distances differ most, without regard to the sign.
    void keep_contrasting() {
      contrasts.clear();
      const std::size_t n = std::min(together.size(), kSampled);
      for (const std::int32_t r : references) {
        apart.clear();
        both.clear();
        for (std::size_t k = 0; k < n; ++k) {
          const std::int64_t t = frames[together[k * together.size() / n]];
          const Point* at = s.tracks_[r].find(t);
          if (at == nullptr) continue;
          const double x = s.distance(*s.tracks_[one].find(t), *at),
                       y = s.distance(*s.tracks_[other].find(t), *at);
          apart.push_back(std::abs(x - y));
          both.push_back(x + y);
        }
        if (apart.size() < std::max(kMinKnown, n / 2)) continue;
        const Median difference = median(apart), sum = median(both);
        const double bend = kBend * difference.middle;
        const double deviation =
            std::sqrt(difference.spread * difference.spread + sum.spread * sum.spread / 4 +
                      s.floor2_ + bend * bend);
        if (difference.middle > kMinContrast * deviation)
          contrasts.push_back({-difference.middle / deviation, r, deviation});
      }
      std::ranges::sort(contrasts, {}, [](const Contrast& c) { return std::pair(c.negated, c.track); });
      contrasts.resize(std::min(contrasts.size(), kReferences));
      references.clear();
      deviations.clear();
      for (const Contrast& c : contrasts) {
        references.push_back(c.track);
        deviations.push_back(c.deviation);
      }
    }
    // Differences of the distances to each reference in deviations, 0 where it is absent.
    void scale_differences(std::int64_t t) {
      const Point &a = *s.tracks_[one].find(t), &b = *s.tracks_[other].find(t);
      scaled.assign(references.size(), 0);
      for (std::size_t r = 0; r < references.size(); ++r)
        if (const Point* at = s.tracks_[references[r]].find(t); at != nullptr)
          scaled[r] = std::clamp((s.distance(a, *at) - s.distance(b, *at)) / deviations[r], -10.0, 10.0);
    }
    // The direction in which the differences vary most, by power iteration.
    std::vector<double> main_direction() {
      const std::size_t R = references.size(), n = std::min(together.size(), kSampled);
      std::vector<double> moments(R * R, 0), direction(R, 0), next(R);
      for (std::size_t k = 0; k < n; ++k) {
        scale_differences(frames[together[k * together.size() / n]]);
        for (std::size_t i = 0; i < R; ++i)
          for (std::size_t j = 0; j < R; ++j) moments[i * R + j] += scaled[i] * scaled[j];
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
      if (known.size() < kMinReferences) return false;
      evidence.assign(frames.size(), 0);
      for (std::size_t u = 0; u < frames.size(); ++u) {
        const Point *a = s.tracks_[one].find(frames[u]), *b = s.tracks_[other].find(frames[u]);
        double sum = 0;
        for (const Known& k : known) {
          const Point* at = s.tracks_[k.track].find(frames[u]);
          if (at == nullptr) continue;
          if (a != nullptr) sum += ratio(s.distance(*a, *at), k.of_other, k.of_one, k.variance);
          if (b != nullptr) sum += ratio(s.distance(*b, *at), k.of_one, k.of_other, k.variance);
        }
        evidence[u] = kWeight * sum;
      }
      decode();
      const auto n = static_cast<std::size_t>(std::ranges::count(is_exchanged, 1));
      if (2 * n > frames.size())
        for (std::size_t u = 0; u < frames.size(); ++u) {
          is_exchanged[u] = !is_exchanged[u];
          evidence[u] = -evidence[u];
        }
      return true;
    }
    // Log density ratio of a distance under two medians: Student's t with four degrees of freedom.
    static double ratio(double d, double middle, double against, double variance) {
      const double x = (d - middle) * (d - middle), y = (d - against) * (d - against);
      return std::clamp(2.5 * std::log((4 * variance + y) / (4 * variance + x)), -kBound, kBound);
    }
    // Learns the distances of both tracks, as exchanged so far.
    void learn() {
      known.clear();
      const std::size_t n = std::min(frames.size(), kSampled);
      for (const std::int32_t r : references) {
        std::array<std::vector<double>, 2>& values = of_sides;
        for (auto& each : values) each.clear();
        for (std::size_t k = 0; k < n; ++k) {
          const std::size_t u = k * frames.size() / n;
          const Point* at = s.tracks_[r].find(frames[u]);
          if (at == nullptr) continue;
          const std::array<std::int32_t, 2> own{one, other};
          for (std::size_t side = 0; side < 2; ++side)
            if (const Point* p = s.tracks_[own[side]].find(frames[u]); p != nullptr)
              values[side ^ static_cast<std::size_t>(is_exchanged[u])].push_back(s.distance(*p, *at));
        }
        if (values[0].size() < kMinKnown || values[1].size() < kMinKnown) continue;
        const Median a = median(values[0]), b = median(values[1]);
        const double variance = std::max(variance_of(a), variance_of(b));
        const double contrast = std::abs(a.middle - b.middle) / std::sqrt(variance);
        if (contrast > kMinContrast) known.push_back({-contrast, r, a.middle, b.middle, variance});
      }
      std::ranges::sort(known, {}, [](const Known& k) { return std::pair(k.negated, k.track); });
      known.resize(std::min(known.size(), kReferences));
    }
    double variance_of(const Median& own) const {
      const double bend = kBend * own.middle;
      return own.spread * own.spread + s.floor2_ + bend * bend;
    }
    // The most probable sequence of states (Viterbi), each change of which has a cost.
    void decode() {
      const std::size_t U = frames.size();
      came_from.assign(U, {0, 1});
      double kept = 0, exchanged = 0;
      for (std::size_t u = 0; u < U; ++u) {
        const double stays_kept = kept, stays_exchanged = exchanged;
        if (stays_exchanged - kChange > stays_kept) {
          kept = stays_exchanged - kChange;
          came_from[u][0] = 1;
        }
        if (stays_kept - kChange > stays_exchanged) {
          exchanged = stays_kept - kChange;
          came_from[u][1] = 0;
        }
        exchanged += evidence[u];
      }
      char state = exchanged > kept;
      for (std::size_t u = U; u-- > 0;) {
        is_exchanged[u] = state;
        state = came_from[u][static_cast<std::size_t>(state)];
      }
    }

    struct Edge {
      std::size_t at = 0;  // index of the frame before which the tracks are exchanged
      double motion = 0;
    };
    // Adds a stretch with the edges that fit the motion best.
    void offer(const ExchangeSearch& motion, std::size_t first, std::size_t end,
               std::vector<ExchangedStretch>& found) {
      const std::vector<Edge> begins = edges(motion, first), ends = edges(motion, end);
      ExchangedStretch best;
      best.gain = -kInfinite;
      for (const Edge& from : begins)
        for (const Edge& to : ends) {
          const double gain = sums[to.at] - sums[from.at] + from.motion + to.motion;
          if (to.at <= from.at || !(gain > best.gain)) continue;
          const std::int64_t stop = to.at < frames.size() ? frames[to.at] : frames.back() + 1;
          best = {{one, other}, frames[from.at], stop, gain};
        }
      if (best.gain > kMinGain) found.push_back(best);
    }
    std::vector<Edge> edges(const ExchangeSearch& motion, std::size_t at) const {
      const std::size_t U = frames.size();
      if (at == 0 || at == U) return {{at, 0}};
      std::vector<Edge> found;
      const std::size_t low = at > kMoved ? at - kMoved : 1, high = std::min(at + kMoved, U - 1);
      for (std::size_t u = low; u <= high; ++u)
        if (const double ratio = by_motion(motion, frames[u]); ratio > kMinMotion)
          found.push_back({u, ratio});
      return found;
    }
    // Log-likelihood ratio of the exchange of the tails from frame t on.
    double by_motion(const ExchangeSearch& motion, std::int64_t t) const {
      std::array<bool, 2> is_linked{};
      std::int64_t gap = 0;
      const std::array<std::int32_t, 2> own{one, other};
      for (std::size_t side = 0; side < 2; ++side) {
        const auto of = s.tracks_[own[side]].frames;
        const auto next = std::ranges::lower_bound(of, t);
        is_linked[side] = next != of.begin() && next != of.end();
        if (is_linked[side]) gap = *next - *(next - 1);
      }
      if (is_linked[0] && is_linked[1]) return motion.ratio(t);
      if (!is_linked[0] && !is_linked[1]) return 0;
      return gap > kLongGap ? kJoin : -kInfinite;
    }

    struct Contrast {
      double negated = 0;
      std::int32_t track = 0;
      double deviation = 0;
    };
    struct Known {
      double negated = 0;  // contrast
      std::int32_t track = 0;
      double of_one = 0, of_other = 0, variance = 0;
    };

    const DistanceExchanges& s;
    std::int32_t one = 0, other = 0;
    std::vector<std::int64_t> frames;     // with a detection of at least one track
    std::vector<std::size_t> together;    // indices of those with both
    std::vector<char> is_exchanged;       // in each of `frames`
    std::vector<double> evidence, sums;   // of each of them, and before each
    std::vector<std::int32_t> references;
    std::vector<double> deviations;       // of the differences of their distances
    std::vector<Known> known;
    // Scratch.
    std::vector<std::pair<double, std::int32_t>> near;
    std::vector<Contrast> contrasts;
    std::vector<double> apart, both, scaled;
    std::array<std::vector<double>, 2> of_sides;
    std::vector<std::array<char, 2>> came_from;
  };

  const MotionModel& m_;
  const Timeline& line_;
  double p_detection_, floor2_;
  std::vector<Track> tracks_;
  std::vector<double> usual_;  // median distance of each pair, infinite if unknown
};

}  // namespace asterism
