// The stretches of frames in which two tracks have each other's marker, by the distances that both
// keep to other tracks (stitch/pair_distances.hpp) and by their motion.
//
// The search begins with the frames that the distances separate, or without an exchange. The
// stretches are those of the most probable sequence of states, by the evidence of the distances in
// each frame and of the motion at each change; the distances are learnt once more from these states.
// An edge is moved to where the exchange fits the motion best, and the log-likelihood ratio of the
// motion there counts as well.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "confidence/exchanges.hpp"
#include "stitch/pair_distances.hpp"
#include "stitch/usual_distances.hpp"

namespace asterism {

// Evidence of an exchange. Each value includes those above it.
enum class ExchangeEvidence {
  medians,  // of the distances, if at least two differ
  spreads,  // of the distances, if two differ in their medians or spreads
  motion,   // where the state changes, whatever differs
};

struct ExchangedStretch {
  std::array<std::int32_t, 2> track{};
  std::int64_t first = 0, end = 0;  // frames
  double gain = 0;                  // log odds of the exchange
};

// The search in one pair of tracks after another.
class ExchangedPair {
 public:
  // `noise` is the standard deviation of a coordinate.
  ExchangedPair(const UsualDistances& all, const MotionModel& m, const Timeline& line,
                double p_detection, double noise, ExchangeEvidence evidence)
      : all_(all), m_(m), line_(line), p_detection_(p_detection), by_(evidence), of_(all, noise) {}

  // Appends the stretches of a pair. `exchanges` are those that fit its motion.
  void find(std::int32_t a, std::int32_t b, std::span<const Exchange> exchanges,
            std::vector<ExchangedStretch>& found) {
    one_ = a, other_ = b;
    if (!of_.begin(a, b)) return;
    is_exchanged_.assign(frames().size(), 0);
    if (of_.by_medians()) {
      of_.separate(is_exchanged_);
      if (std::ranges::count(is_exchanged_, 1) == 0) return;  // as for most pairs
    } else if (by_ == ExchangeEvidence::medians) {
      return;
    }
    weigh_changes(exchanges);
    for (int n = 0; n < (of_.by_medians() ? kRounds : kMoreRounds); ++n) {
      before_ = is_exchanged_;
      if (!weigh()) return;
      if (is_exchanged_ == before_) break;  // another round would learn the same
    }
    if (std::ranges::count(is_exchanged_, 1) == 0) return;
    ExchangeSearch motion(m_, line_, p_detection_);
    for (const std::int32_t k : {a, b}) motion.add(all_.points(k), all_.frames(k));
    const std::size_t U = frames().size();
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
  static constexpr double kMinTogether = 0.25;  // share of a stretch with both tracks, if by spreads
  static constexpr std::size_t kMinFrames = 4;  // of a stretch by motion
  static constexpr int kRounds = 2;             // of learning the distances, at most
  static constexpr int kMoreRounds = 5;         // the same from no exchange on
  static constexpr double kChange = 4;          // cost of each edge of a stretch
  static constexpr double kMinGain = 6;
  static constexpr double kMinMotion = -30;     // smallest log-likelihood ratio of the motion
  static constexpr double kJoin = -1;           // that of an edge at a gap of one of both tracks
  static constexpr std::int64_t kLongGap = 4;   // frames, beyond which it is such a gap
  static constexpr std::size_t kMoved = 10;     // frames by which an edge is moved
  static constexpr double kInfinite = std::numeric_limits<double>::infinity();

  struct Edge {
    std::size_t at = 0;  // index of the frame before which the tracks are exchanged
    double motion = 0;
  };

  std::span<const std::int64_t> frames() const { return of_.frames(); }
  bool by_motion() const { return by_ == ExchangeEvidence::motion; }

  // Computes the evidence of each frame by the distances in the present states, and the states that
  // are most probable by it.
  bool weigh() {
    if (of_.learn(is_exchanged_) < PairDistances::kMinReferences && !by_motion()) return false;
    evidence_.clear();
    for (const std::int64_t t : frames()) evidence_.push_back(of_.evidence(t));
    decode();
    const auto n = static_cast<std::size_t>(std::ranges::count(is_exchanged_, 1));
    if (2 * n > frames().size())
      for (std::size_t u = 0; u < frames().size(); ++u) {
        is_exchanged_[u] = !is_exchanged_[u];
        evidence_[u] = -evidence_[u];
      }
    return true;
  }
  // Computes what a change of the state before each frame adds: a cost, and the log-likelihood ratio
  // of an exchange there. Of those in neighbouring frames only the largest counts, because they are
  // of the same exchange.
  void weigh_changes(std::span<const Exchange> exchanges) {
    const std::size_t U = frames().size();
    fits_.assign(U, 0);
    for (const Exchange& one : exchanges) {
      bool is_linked = true;
      for (const int side : {0, 1}) {
        const auto n = static_cast<std::int64_t>(all_.frames(one.track[side]).size());
        is_linked = is_linked && one.tail[side] > 0 && one.tail[side] < n;
      }
      if (is_linked) fits_[std::ranges::lower_bound(frames(), one.frame) - frames().begin()] = one.gain;
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
    const std::size_t U = frames().size();
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
    if (!of_.by_medians() && n_together(first, end) < kMinTogether * static_cast<double>(end - first))
      return;
    const std::vector<Edge> begins = edges(motion, first), ends = edges(motion, end);
    ExchangedStretch best;
    best.gain = -kInfinite;
    std::size_t n_frames = 0;
    for (const Edge& from : begins)
      for (const Edge& to : ends) {
        const double gain = sums_[to.at] - sums_[from.at] + from.motion + to.motion;
        if (to.at <= from.at || !(gain > best.gain)) continue;
        const std::int64_t stop = to.at < frames().size() ? frames()[to.at] : frames().back() + 1;
        best = {{one_, other_}, frames()[from.at], stop, gain};
        n_frames = to.at - from.at;
      }
    if (best.gain > kMinGain && (!by_motion() || n_frames >= kMinFrames)) found.push_back(best);
  }
  // Number of frames with both tracks.
  double n_together(std::size_t first, std::size_t end) const {
    return static_cast<double>(std::ranges::lower_bound(of_.together(), end) -
                               std::ranges::lower_bound(of_.together(), first));
  }
  std::vector<Edge> edges(const ExchangeSearch& motion, std::size_t at) const {
    const std::size_t U = frames().size();
    if (at == 0 || at == U) return {{at, 0}};
    std::vector<Edge> found;
    const std::size_t low = at > kMoved ? at - kMoved : 1, high = std::min(at + kMoved, U - 1);
    for (std::size_t u = low; u <= high; ++u)
      if (const double ratio = motion_ratio(motion, frames()[u]); ratio > kMinMotion)
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
  double p_detection_;
  ExchangeEvidence by_;
  PairDistances of_;
  std::int32_t one_ = 0, other_ = 0;
  std::vector<char> is_exchanged_, before_;  // in each frame, and before a round
  std::vector<double> evidence_, sums_, fits_, changes_;  // of each frame, and before each
  std::vector<std::array<char, 2>> came_from_;
};

}  // namespace asterism
