// Evidence for the names of tracks: distances between tracks, and heights of tracks over the planes
// of three others, against those of a marker set.
//
//   score of an assignment = Σ_pairs T[p, m_i, m_j] + Σ_quads H(height) + Σ_named (prior_km - none)
//
//   T      log odds of a distance for all pairs of markers (`distance_evidence.hpp`)
//   quad   a marker and three reference markers; the sign of its height over their plane tells a
//          body from its mirror image
//   prior  log odds of a marker for a track, by its presence and place; none: those of no name
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <iterator>
#include <span>
#include <vector>

#include "naming/distance_evidence.hpp"

namespace asterism {

using Names = std::vector<std::int32_t>;  // marker of each track, -1 for none

struct MarkerTables {
  std::int32_t M = 0;
  std::vector<double> distance, movement, variation;  // (M, M), NaN where unknown
};

struct Quad {
  std::int32_t marker;
  std::int32_t reference[3];
  double height, variance, weight;
};

struct TrackPairs {
  std::int32_t K = 0;
  std::vector<std::int32_t> first, second;  // (P,), tracks whose distance counts
  std::vector<double> distance, spread;     // (P,), metres
};

// Positions of all tracks in some frames, NaN where a track has no detection, and the spread of
// every distance between two tracks, NaN for two without a common frame.
struct TrackPoses {
  std::int32_t F = 0;
  std::vector<double> positions;  // (F, K, 3)
  std::vector<double> spread;     // (K, K)
};

class NameEvidence {
 public:
  NameEvidence(MarkerTables markers, std::vector<Quad> quads, TrackPairs pairs, TrackPoses poses,
               std::vector<double> prior, double size, const FitWeights& weights, double none)
      : M_(markers.M), K_(pairs.K), size_(size), none_(none), prior_(std::move(prior)),
        markers_(std::move(markers)), quads_(std::move(quads)), pairs_(std::move(pairs)),
        poses_(std::move(poses)),
        densities_(M_, markers_.distance, markers_.movement, markers_.variation, size) {
    const std::size_t P = pairs_.first.size();
    row_of_.assign(P * M_, -1);
    for (std::size_t p = 0; p < P; ++p) {
      weights_known_.push_back(weights_at(weights, pairs_.distance[p], true));
      weights_unknown_.push_back(weights_at(weights, pairs_.distance[p], false));
    }
    planes_.resize(quads_.size());
    own_quads_.resize(M_);
    for (std::size_t q = 0; q < quads_.size(); ++q)
      own_quads_[quads_[q].marker].push_back(static_cast<std::int32_t>(q));
    own_pairs_.resize(K_);
    for (std::size_t p = 0; p < P; ++p) {
      own_pairs_[pairs_.first[p]].push_back(static_cast<std::int32_t>(p));
      own_pairs_[pairs_.second[p]].push_back(static_cast<std::int32_t>(p));
    }
  }

  std::int32_t n_tracks() const { return K_; }
  std::int32_t n_markers() const { return M_; }
  double none() const { return none_; }

  // Writes the log odds of each marker for each track of `rows`, (K, M), given the names of the
  // others; other rows are left as they are.
  void scores(const Names& names, std::span<const std::int32_t> rows,
              std::vector<double>& out) const {
    out.resize(static_cast<std::size_t>(K_) * M_);
    for (const std::int32_t k : rows) {
      double* row = out.data() + static_cast<std::size_t>(k) * M_;
      std::copy_n(prior_.begin() + static_cast<std::ptrdiff_t>(k) * M_, M_, row);
      for (const std::int32_t p : own_pairs_[k]) {
        const std::int32_t other = names[pairs_.first[p] == k ? pairs_.second[p] : pairs_.first[p]];
        if (other < 0) continue;
        const float* t = row_of(p, other);
        for (std::int32_t m = 0; m < M_; ++m) row[m] += t[m];
      }
    }
    track_of(names);
    for (std::int32_t m = 0; m < M_; ++m) {
      if (own_quads_[m].empty()) continue;
      // Heights cannot make up for a lower score, so that they are not computed.
      const auto is_open = [&](std::int32_t k) {
        return out[static_cast<std::size_t>(k) * M_ + m] >= none_ - kHopeless;
      };
      open_.clear();
      std::ranges::copy_if(rows, std::back_inserter(open_), is_open);
      for (const std::int32_t q : own_quads_[m]) {
        if (!find_plane(q)) continue;
        for (const std::int32_t k : open_)
          if (is_open(k) && !std::ranges::count(planes_[q].track, k))
            out[static_cast<std::size_t>(k) * M_ + m] += height_log_odds(q, k);
      }
    }
  }

  double total(const Names& names) const {
    double sum = 0;
    for (std::size_t p = 0; p < pairs_.first.size(); ++p) {
      const std::int32_t a = names[pairs_.first[p]], b = names[pairs_.second[p]];
      if (a >= 0 && b >= 0) sum += row_of(p, a)[b];
    }
    for (std::int32_t k = 0; k < K_; ++k)
      if (names[k] >= 0) sum += prior_[static_cast<std::size_t>(k) * M_ + names[k]] - none_;
    track_of(names);
    for (std::size_t q = 0; q < quads_.size(); ++q) {
      const std::int32_t k = track_[quads_[q].marker];
      if (k >= 0 && find_plane(q)) sum += height_log_odds(q, k);
    }
    return sum;
  }

 private:
  // Plane of the references of a quad, kept because most assignments of a search share it.
  struct Plane {
    std::int32_t track[3] = {-1, -1, -1};
    std::vector<double> frames;    // (F, 4), normal and offset
    double widest = 0;             // spread of the distances between the references
    std::vector<double> log_odds;  // of the height of each track, NaN if not computed
  };

  // Log odds of the distance of a pair if one of its tracks has marker a, for all markers of the
  // other. They are computed when they are first needed: a search meets few of them.
  const float* row_of(std::size_t p, std::int32_t a) const {
    std::int32_t& row = row_of_[p * M_ + a];
    if (row < 0) row = computed(p, a);
    return table_.data() + static_cast<std::size_t>(row) * M_;
  }

  std::int32_t computed(std::size_t p, std::int32_t a) const {
    const std::size_t begin = table_.size();
    table_.resize(begin + M_);
    float* row = table_.data() + begin;
    const double d = pairs_.distance[p], s = pairs_.spread[p];
    densities_.densities(a, d, s, weights_known_[p], weights_unknown_[p], row);
    for (std::int32_t b = 0; b < M_; ++b) {
      const std::size_t at = static_cast<std::size_t>(a) * M_ + b;
      const double B = markers_.variation[at];
      row[b] = std::isnan(markers_.distance[at])
                   ? 0
                   : static_cast<float>(loose_weight(s * s + B * B)) * bounded_log_odds(row[b]);
    }
    row[a] = static_cast<float>(kMinOdds);
    return static_cast<std::int32_t>(begin / M_);
  }

  void track_of(const Names& names) const {
    track_.assign(M_, -1);
    for (std::int32_t k = 0; k < K_; ++k)
      if (names[k] >= 0) track_[names[k]] = k;
  }

  // Finds the plane of the references of a quad in each frame; false if one of them has no track.
  bool find_plane(std::size_t at) const {
    const Quad& q = quads_[at];
    Plane& found = planes_[at];
    std::int32_t track[3];
    for (int i = 0; i < 3; ++i)
      if (track[i] = track_[q.reference[i]]; track[i] < 0) return false;
    if (std::ranges::equal(track, found.track)) return true;
    std::ranges::copy(track, found.track);
    found.frames.assign(4 * static_cast<std::size_t>(poses_.F), NAN);
    for (std::int32_t f = 0; f < poses_.F; ++f) {
      const double *a = point(f, track[0]), *b = point(f, track[1]), *c = point(f, track[2]);
      const double u[3] = {b[0] - a[0], b[1] - a[1], b[2] - a[2]};
      const double v[3] = {c[0] - a[0], c[1] - a[1], c[2] - a[2]};
      double n[3] = {u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2],
                     u[0] * v[1] - u[1] * v[0]};
      const double length = std::sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
      if (!(length > 1e-12)) continue;  // NaN too
      double* out = found.frames.data() + 4 * static_cast<std::size_t>(f);
      for (int x = 0; x < 3; ++x) out[x] = n[x] / length;
      out[3] = out[0] * a[0] + out[1] * a[1] + out[2] * a[2];
    }
    found.widest = std::max(
        {spread(track[0], track[1]), spread(track[0], track[2]), spread(track[1], track[2])});
    found.log_odds.assign(K_, NAN);
    return true;
  }

  // Bounded log odds of the mean height of a track over the plane that was found.
  double height_log_odds(std::size_t at, std::int32_t k) const {
    double& known = planes_[at].log_odds[k];
    if (std::isnan(known)) known = compute_height_log_odds(quads_[at], planes_[at], k);
    return known;
  }

  double compute_height_log_odds(const Quad& q, const Plane& found, std::int32_t k) const {
    double sum = 0, squares = 0;
    int n = 0;
    for (std::int32_t f = 0; f < poses_.F; ++f) {
      const double* plane = found.frames.data() + 4 * static_cast<std::size_t>(f);
      const double* x = point(f, k);
      const double h = plane[0] * x[0] + plane[1] * x[1] + plane[2] * x[2] - plane[3];
      if (std::isnan(h)) continue;
      sum += h;
      squares += h * h;
      ++n;
    }
    if (n == 0) return 0;
    const double mean = sum / n, varied = std::max(squares / n - mean * mean, 0.0);
    const double v = varied / 4 + q.variance, off = mean - size_ * q.height;
    const double y = 1 + off * off / (4 * v);
    const double odds =
        std::clamp(std::log(0.375 * kHeights / (std::sqrt(v * y) * y * y) + 0.02), -4.0, 3.0);
    double widest = found.widest;
    for (const std::int32_t a : found.track) widest = std::max(widest, spread(k, a));
    return q.weight * odds / (1 + widest * widest / (kLooseSpread * kLooseSpread));
  }

  const double* point(std::int32_t f, std::int32_t k) const {
    return poses_.positions.data() + 3 * (static_cast<std::size_t>(f) * K_ + k);
  }
  double spread(std::int32_t a, std::int32_t b) const {
    const double s = poses_.spread[static_cast<std::size_t>(a) * K_ + b];
    return std::isnan(s) ? 1e3 : s;
  }

  static constexpr double kHopeless = 24;  // largest sum of the heights of a marker's quads
  static constexpr double kHeights = 0.3;  // range of the heights of wrong tracks, metres

  std::int32_t M_, K_;
  double size_, none_;
  std::vector<double> prior_;  // (K, M)
  MarkerTables markers_;
  std::vector<Quad> quads_;
  TrackPairs pairs_;
  TrackPoses poses_;
  PairDensities densities_;
  std::vector<FitWeights> weights_known_, weights_unknown_;  // (P,)
  mutable std::vector<std::int32_t> row_of_;          // (P, M), row of the table, -1 for none yet
  mutable std::vector<float> table_;                  // (rows, M)
  std::vector<std::vector<std::int32_t>> own_pairs_;  // of each track
  std::vector<std::vector<std::int32_t>> own_quads_;  // of each marker
  mutable std::vector<std::int32_t> open_;            // tracks whose heights are wanted
  mutable std::vector<std::int32_t> track_;           // of each marker, -1 for none
  mutable std::vector<Plane> planes_;                 // of each quad, as last found
};

}  // namespace asterism
