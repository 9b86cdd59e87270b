// Search for the most probable names of tracks: from a start to an assignment that none of the
// moves below improves. Exact search is out of reach (a quadratic assignment); the moves are those
// that the symmetry of bodies asks for.
//
//   settle    all tracks at once, each by the names of the others: one exact assignment a round
//   swaps     two tracks exchange their names, or one takes the other's, which then has none
//   cycles    three near tracks exchange theirs in turn, or the last name is left free
//   regroup   a group of markers and of their partners on the other side: the sides are exchanged,
//             or the group is left without names and named anew from its surroundings outwards
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <set>
#include <span>
#include <tuple>
#include <utility>
#include <vector>

#include "naming/name_evidence.hpp"
#include "solve/assignment.hpp"

namespace asterism {

struct NamedState {
  Names names;
  double score = 0;
};

class NameSearch {
 public:
  // Groups of markers, largest first; partner[m] is the marker of the other side, -1 for a marker
  // without a side, or `kOneSide` for one whose partner is not in the set. `near` holds for each track the tracks with which it may exchange names in turn.
  NameSearch(const NameEvidence& evidence, std::vector<std::vector<std::int32_t>> groups,
             std::vector<std::int32_t> partner, std::vector<std::vector<std::int32_t>> near)
      : evidence_(evidence), groups_(std::move(groups)), partner_(std::move(partner)),
        near_(std::move(near)), all_(evidence.n_tracks()) {
    std::iota(all_.begin(), all_.end(), 0);
  }

  const NameEvidence& evidence() const { return evidence_; }

  NamedState settled(Names names) { return settled(std::move(names), all_, kRounds); }

  // Names the tracks of `rows` only, by the markers that no other track has.
  NamedState settled(Names names, std::span<const std::int32_t> rows, int rounds) {
    std::set<Names> seen;
    for (int round = 0; round < rounds; ++round) {
      Names next = assigned(names, rows, evidence_.none());
      const bool is_known = next == names || !seen.insert(next).second;
      names = std::move(next);
      if (is_known) break;
    }
    const double score = evidence_.total(names);
    return {std::move(names), score};
  }

  // The same for tracks without names, from those next to named ones outwards: a track waits until
  // its neighbours give it a high score.
  NamedState grown(Names names, std::span<const std::int32_t> rows) {
    for (const double least : {12.0, 6.0, 2.0})
      for (int round = 0; round < kGrown; ++round) {
        Names next = assigned(names, rows, least);
        const bool is_same = next == names;
        names = std::move(next);
        if (is_same) break;
      }
    return settled(std::move(names), rows, kGrown);
  }

  void swaps(NamedState& state) {
    improve(state, kSwaps, [&](const Names& names) {
      std::vector<Change> changes;
      const auto gain = [&](std::int32_t k, std::int32_t m) { return at(k, m) - at(k, names[k]); };
      for (std::int32_t i = 0; i < n(); ++i)
        for (std::int32_t j = i + 1; j < n(); ++j) {
          if (names[i] < 0 && names[j] < 0) continue;
          changes.push_back({gain(i, names[j]) + gain(j, names[i]), {i, j, -1}});
          if (names[i] < 0 || names[j] < 0) continue;
          changes.push_back({gain(i, -1) + gain(j, names[i]), {i, j, -1}, true});
          changes.push_back({gain(j, -1) + gain(i, names[j]), {j, i, -1}, true});
        }
      return changes;
    });
  }

  void cycles(NamedState& state) {
    improve(state, kCycles, [&](const Names& names) {
      std::vector<Change> changes;
      for (std::int32_t x = 0; x < n(); ++x)
        for (const std::int32_t y : near_[x])
          for (const std::int32_t z : near_[x])
            if (y != z && (names[x] >= 0) + (names[y] >= 0) + (names[z] >= 0) >= 2) {
              const double gain = at(y, names[z]) + at(z, names[x]) - at(x, names[x]) -
                                  at(y, names[y]) - at(z, names[z]);
              changes.push_back({gain + at(x, names[y]), {x, y, z}});
              if (names[y] >= 0) changes.push_back({gain + at(x, -1), {x, y, z}, true});
            }
      return changes;
    });
  }

  void regroup(NamedState& state) {
    for (int round = 0; round < kRegroups; ++round) {
      NamedState best = state;
      for (const auto& group : groups_) {
        std::vector<std::int32_t> track(evidence_.n_markers(), -1);
        for (std::int32_t k = 0; k < n(); ++k)
          if (state.names[k] >= 0) track[state.names[k]] = k;
        Names exchanged = state.names, open = state.names;
        std::vector<std::int32_t> rows;
        for (const std::int32_t m : group)
          for (const auto& [own, other] : {std::pair{m, partner_[m]}, std::pair{partner_[m], m}})
            if (own >= 0 && track[own] >= 0) {
              exchanged[track[own]] = other >= 0 ? other : other == kOneSide ? -1 : own;
              open[track[own]] = -1;
              rows.push_back(track[own]);
            }
        // What follows from the exchange of a small group does not make good such a loss; a whole
        // body may have been named as its mirror image.
        if (2 * rows.size() >= all_.size() ||
            evidence_.total(exchanged) > state.score - kHopelessShare * std::abs(state.score))
          keep_better(best, settled(std::move(exchanged), all_, 3));
        std::ranges::sort(rows);
        if (rows.size() >= 3) keep_better(best, grown(std::move(open), rows));
      }
      if (!(best.score > state.score + kGain)) return;
      state = std::move(best);
    }
  }

  // The best of a start and everything that the moves make of it.
  NamedState improved(Names start) {
    NamedState state = settled(std::move(start));
    swaps(state);
    regroup(state);
    cycles(state);
    swaps(state);
    return state;
  }

 private:
  struct Change {
    double gain = 0;  // to first order: as if the others were not exchanged
    std::int32_t tracks[3] = {-1, -1, -1};
    bool frees = false;  // the first track has no name afterwards
  };

  std::int32_t n() const { return evidence_.n_tracks(); }
  double at(std::int32_t k, std::int32_t m) const {
    return m < 0 ? evidence_.none() : scores_[static_cast<std::size_t>(k) * evidence_.n_markers() + m];
  }

  static void keep_better(NamedState& best, NamedState other) {
    if (other.score > best.score + kGain) best = std::move(other);
  }

  // Names by one exact assignment, each track's score given the names of all others; a score of at
  // most `least` gives none.
  Names assigned(const Names& names, std::span<const std::int32_t> rows, double least) {
    evidence_.scores(names, rows, scores_);
    Names out = names;
    for (const std::int32_t k : rows) out[k] = -1;
    std::vector<char> is_taken(evidence_.n_markers(), 0);
    for (const std::int32_t m : out)
      if (m >= 0) is_taken[m] = 1;
    candidates_.clear();
    for (const std::int32_t k : rows)
      for (std::int32_t m = 0; m < evidence_.n_markers(); ++m)
        if (const double gain = at(k, m) - least; gain > 0 && !is_taken[m])
          candidates_.push_back({k, m, gain, 0});
    assignment_.solve(candidates_, out);
    return out;
  }

  // Carries out the best of the `most` most promising changes until none improves the score.
  template <typename Propose>
  void improve(NamedState& state, std::size_t most, Propose&& propose) {
    for (int round = 0; round < kRounds; ++round) {
      evidence_.scores(state.names, all_, scores_);
      std::vector<Change> changes = propose(state.names);
      const auto kept = changes.begin() + static_cast<std::ptrdiff_t>(std::min(most, changes.size()));
      std::partial_sort(changes.begin(), kept, changes.end(), [](const Change& a, const Change& b) {
        if (a.gain != b.gain) return a.gain > b.gain;
        return std::ranges::lexicographical_compare(a.tracks, b.tracks);
      });
      NamedState best = state;
      for (auto change = changes.begin(); change != kept; ++change) {
        NamedState next{state.names, 0};
        const auto [x, y, z] = std::tuple{change->tracks[0], change->tracks[1], change->tracks[2]};
        next.names[x] = state.names[y];
        next.names[y] = state.names[z < 0 ? x : z];
        if (z >= 0) next.names[z] = state.names[x];
        if (change->frees) next.names[x] = -1;
        next.score = evidence_.total(next.names);
        keep_better(best, std::move(next));
      }
      if (!(best.score > state.score + kGain)) return;
      state = std::move(best);
    }
  }

  static constexpr std::int32_t kOneSide = -2;
  static constexpr int kRounds = 30;
  static constexpr int kRegroups = 4;
  static constexpr int kGrown = 8;  // rounds with one smallest score
  static constexpr std::size_t kSwaps = 20, kCycles = 30;  // changes whose exact score is computed
  static constexpr double kGain = 1e-6;
  static constexpr double kHopelessShare = 0.15;

  const NameEvidence& evidence_;
  std::vector<std::vector<std::int32_t>> groups_;
  std::vector<std::int32_t> partner_;
  std::vector<std::vector<std::int32_t>> near_;
  std::vector<std::int32_t> all_;  // all tracks
  Assignment assignment_;
  std::vector<double> scores_;
  std::vector<Candidate> candidates_;
};

}  // namespace asterism
