// Decides jointly where the markers of bodies are in a frame, by the distances of their bonds.
//
//   g_i(j)   gain of track i from detection j; 0 without a detection
//   d, V     distance of a bond and the squared scale of its next value, which has a Student's t
//            distribution with four degrees of freedom
//   ŷ, S     predicted position of a track and its variance along an axis, with the sensor's noise
//   r        variance of a detection in addition to that of the sensor
//   p(j, l)  effect of a bond of tracks i and k with detections j and l, which is the likelihood of
//            their distance against what the predictions expect of it:
//              log t_4(|y_j - y_l|; d, V) - log t_4(|ŷ_i - ŷ_k|; d, V + S_i + r_j + S_k + r_l)
//
// The sum of all g and p is maximised by messages between bonded tracks (max-product). They are
// damped and end after a few rounds, so that the maximum is approximate where bonds form cycles.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <tuple>
#include <utility>
#include <vector>

#include "base/flat_map.hpp"
#include "math/logarithm.hpp"
#include "rigid/bond.hpp"
#include "rigid/neighbours.hpp"
#include "solve/connected_components.hpp"

namespace asterism {

class JointPlaces {
 public:
  // A track: its marker, and the prediction of its next detection.
  struct Track {
    std::int32_t row = 0, marker = 0;
    Point center{};
    double variance = 0;
  };

  // Begins a frame, with tracks ordered by row. `bonds_of(marker)` are the distances known of a
  // marker.
  template <typename BondsOf>
  void begin(std::span<const Track> tracks, std::size_t n_rows, int D,
             BondsOf&& bonds_of) {
    D_ = D;
    tracks_.assign(tracks.begin(), tracks.end());
    at_row_.assign(n_rows, kNone);
    numbers_.clear();
    for (std::int32_t a = 0; a < static_cast<std::int32_t>(tracks_.size()); ++a) {
      at_row_[tracks_[a].row] = a;
      numbers_.push_back({tracks_[a].marker, a});
    }
    std::ranges::sort(numbers_);
    links_.clear();
    of_track_.resize(std::max(of_track_.size(), tracks_.size()));
    for (std::vector<std::int32_t>& links : of_track_) links.clear();
    for (std::int32_t a = 0; a < static_cast<std::int32_t>(tracks_.size()); ++a) {
      near_.clear();
      for (const Bond& bond : bonds_of(tracks_[a].marker)) add_known(a, bond);
      for (const Known& one : near_) add_link(one);
    }
    for (Link& link : links_) link.ratio = ratio(link, 0);
    place_.assign(tracks_.size(), nullptr);
  }

  // Decides the detection of each track. `candidates` are those of the tracks, ordered by row.
  void decide(std::span<const Point> points, std::span<const Candidate> candidates) {
    first_.assign(tracks_.size() + 1, 0);
    for (const Candidate& c : candidates) ++first_[at_row_[c.row] + 1];
    for (std::size_t a = 0; a < tracks_.size(); ++a) first_[a + 1] += first_[a];
    beliefs_.clear();
    for (const Candidate& c : candidates) beliefs_.push_back(c.gain);
    set_up(points, candidates);
    for (int round = 0; round < kRounds; ++round) exchange(candidates, round == 0 ? 1 : kDamping);
    order_.resize(candidates.size());
    for (std::size_t c = 0; c < order_.size(); ++c) order_[c] = static_cast<std::int32_t>(c);
    std::ranges::sort(order_, {}, [&](std::int32_t c) { return std::pair(-beliefs_[c], c); });
    is_taken_.assign(points.size(), 0);
    for (const std::int32_t c : order_) {
      const Point*& place = place_[at_row_[candidates[c].row]];
      const std::int32_t column = candidates[c].column;
      if (beliefs_[c] <= 0 || place != nullptr || is_taken_[column]) continue;
      place = &points[column];
      is_taken_[column] = 1;
    }
  }

  // The detection of a row's track, nullptr if it has none.
  const Point* place(std::size_t row) const {
    const std::int32_t a = at_row_[row];
    return a == kNone ? nullptr : place_[a];
  }
  // Sum of p over the bonds of a row's track to others that have a place, for a detection at `y`.
  // All bonds of a marker may break at once, so that the sum has the bound of one bond.
  double gain(std::size_t row, const Point& y) const {
    const std::int32_t a = at_row_[row];
    double sum = 0;
    if (a == kNone) return sum;
    for (const std::int32_t e : of_track_[a]) {
      const Link& link = links_[e];
      const Point* other = place_[link.a == a ? link.b : link.a];
      if (other != nullptr) sum += effect(link, *other, y);
    }
    return std::clamp(sum, kLeast, kMost);
  }

 private:
  static constexpr std::int32_t kNone = -1;
  static constexpr std::int64_t kMinFrames = 10;
  static constexpr std::size_t kMaxLinks = 8;  // of a track
  static constexpr double kMaxSpread = 0.05;  // largest √V as a fraction of the distance
  static constexpr double kPriorFrames = 2;
  static constexpr int kRounds = 4;
  static constexpr double kDamping = 0.5;
  // Bounds of the effect of a bond, nats. A bond may break, and both predictions may be wrong.
  static constexpr double kLeast = -3, kMost = 8;
  static inline const double kLeastSquared = std::exp(2 * kLeast), kMostSquared = std::exp(2 * kMost);
  // Bound of a message, nats, and the loss if both tracks of a bond have the same detection. It is
  // finite, so that the other bonds of a track can outweigh a wrong message.
  static constexpr double kMaxMessage = 20;
  static constexpr double kFreedom = 4;

  // A distance between two tracks, a < b.
  struct Known {
    std::int32_t a = 0, b = 0;
    double distance = 0, V = 0;
    bool operator<(const Known& other) const {
      return std::tuple(V, a, b) < std::tuple(other.V, other.a, other.b);
    }
  };
  struct Link : Known {
    double ratio = 0;
    std::size_t effects = 0, to_a = 0, to_b = 0;  // where those begin in the arrays of a frame
  };

  std::int32_t find(std::int32_t marker) const {
    const auto at = first_from(numbers_.begin(), numbers_.size(), marker,
                               [](const auto& number) { return number.first; });
    return at != numbers_.end() && at->first == marker ? at->second : kNone;
  }
  // Adds a bond of track a to `near_` if it is among the kMaxLinks steadiest. The other marker is
  // looked up last, because most bonds are refused before.
  void add_known(std::int32_t a, const Bond& bond) {
    if (bond.n < kMinFrames) return;
    const double n = static_cast<double>(std::min(bond.n, kMemory)), prior = kSteady * bond.mean;
    const double V = (n * bond.variance + prior * prior * kPriorFrames) / (n + kPriorFrames);
    if (!(V < kMaxSpread * kMaxSpread * bond.mean * bond.mean)) return;
    if (near_.size() == kMaxLinks && V > near_.back().V) return;
    const std::int32_t b = find(bond.other);
    if (b != kNone) keep_smallest(near_, kMaxLinks, {std::min(a, b), std::max(a, b), bond.mean, V});
  }
  // Adds a distance as a link. Where both markers list a pair, the steadier distance is used.
  void add_link(const Known& one) {
    for (const std::int32_t e : of_track_[one.a]) {
      Known& same = links_[e];
      if (same.a != one.a || same.b != one.b) continue;
      same = std::min(same, one);
      return;
    }
    for (const std::int32_t end : {one.a, one.b})
      of_track_[end].push_back(static_cast<std::int32_t>(links_.size()));
    links_.push_back({one});
  }
  double distance(const Point& x, const Point& y) const {
    return std::sqrt(squared_distance(x, y, D_));
  }
  // The square of the likelihood ratio of the bond's own distance. `noise` is the variance of the
  // two detections beyond that of the sensor.
  double ratio(const Known& link, double noise) const {
    const Track &a = tracks_[link.a], &b = tracks_[link.b];
    const double spread = link.V + a.variance + b.variance + noise;
    return spread / link.V * tail(distance(a.center, b.center) - link.distance, spread);
  }
  // Density of t at the mean over that at `off`, squared: (1 + x² / ν s²)^(ν + 1).
  static double tail(double off, double variance) {
    const double base = 1 + off * off / (kFreedom * variance);
    return base * base * base * base * base;
  }
  // Most pairs of detections have an effect at a bound, for which no logarithm is needed.
  double effect(const Link& link, const Point& x, const Point& y) const {
    const double noise = x.r + y.r;
    const double squared = (noise > 0 ? ratio(link, noise) : link.ratio) /
                           tail(distance(x, y) - link.distance, link.V);
    if (squared <= kLeastSquared) return kLeast;
    if (squared >= kMostSquared) return kMost;
    return 0.5 * logarithm(squared);
  }
  std::size_t n_of(std::int32_t a) const { return first_[a + 1] - first_[a]; }

  void set_up(std::span<const Point> points, std::span<const Candidate> candidates) {
    effects_.clear();
    std::size_t n = 0;
    for (Link& link : links_) {
      link.effects = effects_.size();
      link.to_a = n;
      link.to_b = n += n_of(link.a);
      n += n_of(link.b);
      for (std::size_t j = first_[link.a]; j < first_[link.a + 1]; ++j)
        for (std::size_t l = first_[link.b]; l < first_[link.b + 1]; ++l) {
          const std::int32_t own = candidates[j].column, other = candidates[l].column;
          effects_.push_back(own == other ? -kMaxMessage : effect(link, points[own], points[other]));
        }
    }
    messages_.assign(n, 0);
    next_.assign(n, 0);
  }

  // One round of messages, all computed from those of the round before.
  void exchange(std::span<const Candidate> candidates, double share) {
    for (const Link& link : links_) {
      const std::size_t n_a = n_of(link.a), n_b = n_of(link.b);
      send(link.b, n_b, link.to_b, n_a, link.to_a, share, [&](std::size_t j, std::size_t l) {
        return effects_[link.effects + j * n_b + l];
      });
      send(link.a, n_a, link.to_a, n_b, link.to_b, share, [&](std::size_t j, std::size_t l) {
        return effects_[link.effects + l * n_b + j];
      });
    }
    std::swap(messages_, next_);
    for (std::size_t c = 0; c < candidates.size(); ++c) beliefs_[c] = candidates[c].gain;
    for (const Link& link : links_) {
      for (std::size_t j = 0; j < n_of(link.a); ++j) beliefs_[first_[link.a] + j] += messages_[link.to_a + j];
      for (std::size_t l = 0; l < n_of(link.b); ++l) beliefs_[first_[link.b] + l] += messages_[link.to_b + l];
    }
  }
  // The message of track `from` about the n detections of another track. What that track has sent
  // about the detections of `from` begins at `received` and is left out. The message begins at
  // `sent`. Without a detection of either track the bond has no effect.
  template <typename Effect>
  void send(std::int32_t from, std::size_t n_from, std::size_t received, std::size_t n,
            std::size_t sent, double share, Effect&& effect_of) {
    double none = 0;
    for (std::size_t l = 0; l < n_from; ++l)
      none = std::max(none, beliefs_[first_[from] + l] - messages_[received + l]);
    for (std::size_t j = 0; j < n; ++j) {
      double best = 0;
      for (std::size_t l = 0; l < n_from; ++l)
        best = std::max(best, effect_of(j, l) + beliefs_[first_[from] + l] - messages_[received + l]);
      const double message = std::clamp(best - none, -kMaxMessage, kMaxMessage);
      next_[sent + j] = messages_[sent + j] + share * (message - messages_[sent + j]);
    }
  }

  int D_ = 3;
  std::vector<Track> tracks_;
  std::vector<std::int32_t> at_row_, order_;
  std::vector<std::pair<std::int32_t, std::int32_t>> numbers_;  // markers and their tracks
  std::vector<Known> near_;
  std::vector<Link> links_;
  std::vector<std::vector<std::int32_t>> of_track_;
  std::vector<std::size_t> first_;  // candidate of each track
  std::vector<double> beliefs_, effects_, messages_, next_;
  std::vector<const Point*> place_;
  std::vector<char> is_taken_;
};

}  // namespace asterism
