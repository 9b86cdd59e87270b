// Enumerates the joint events of a group and keeps the best permutation for each set of tracks and
// detections. This prevents track coalescence in JPDA (JPDA*, Blom & Bloem 2000).
//
// Averaging over events that permute the same tracks and detections draws neighbouring tracks
// together until they coincide. The best permutations still give the probabilities of clutter and
// of missed detections, and they cause no such bias.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <span>
#include <tuple>
#include <vector>

#include "solve/dual_prices.hpp"
#include "solve/group_numbering.hpp"

namespace asterism {

class BestPermutations {
 public:
  static constexpr std::size_t kMaxEvents = 20'000;
  // Nats below the best event; events further below are ignored.
  static constexpr double kNegligible = 20.7;

  // Computes the weights of the group's pairings after pruning. Returns false if the group has too
  // many events. `match` is the best event.
  bool solve(std::span<const Candidate> group, std::span<const std::int32_t> match,
             std::vector<double>& weights) {
    group_ = group;
    by_.number(group);
    if (by_.n_rows() > 64 || by_.n_columns() > 64) return false;
    find_losses(match);
    best_ = 0;
    for (const Candidate& c : group)
      if (match[c.row] == c.column) best_ += c.gain;
    events_.clear();
    choices_.clear();
    chosen_.assign(by_.rows.size(), -1);
    n_visits_ = 0;
    if (!visit(0, 0, 0, 0, 0)) return false;
    std::sort(events_.begin(), events_.end(), [](const Event& a, const Event& b) {
      return std::tuple(a.tracks, a.columns, -a.gain, a.first) <
             std::tuple(b.tracks, b.columns, -b.gain, b.first);
    });
    weights.assign(group.size(), 0);
    double total = 0;
    for (std::size_t k = 0; k < events_.size(); ++k) {
      const Event& event = events_[k];
      if (k > 0 && event.tracks == events_[k - 1].tracks &&
          event.columns == events_[k - 1].columns)
        continue;
      const double weight = std::exp(event.gain - best_);
      total += weight;
      for (std::size_t r = 0; r < chosen_.size(); ++r)
        if (choices_[event.first + r] >= 0) weights[choices_[event.first + r]] += weight;
    }
    for (double& weight : weights) weight /= total;
    return true;
  }

 private:
  struct Event {
    std::uint64_t tracks, columns;
    double gain;
    std::size_t first;  // index of its first choice
  };

  // The loss of each choice against the best event at its dual prices, and a lower bound of the
  // losses of each row and all rows after it, which is zero up to rounding.
  void find_losses(std::span<const std::int32_t> match) {
    const std::int32_t n = by_.n_rows();
    list_partners(group_, by_, match, partner_);
    missed_loss_.assign(n, 0);
    price_.assign(by_.n_columns(), 0);
    find_prices(group_, by_, partner_, missed_loss_, price_);
    loss_.resize(group_.size());
    for (std::size_t e = 0; e < group_.size(); ++e)
      loss_[e] = missed_loss_[by_.row_of[e]] + price_[by_.column_of[e]] - group_[e].gain;
    min_loss_.assign(n + 1, 0);
    for (std::int32_t r = n; r-- > 0;)
      min_loss_[r] = min_loss_[r + 1] + std::min(missed_loss_[r], least(r));
  }

  double least(std::int32_t r) const {
    return *std::min_element(loss_.begin() + by_.first[r], loss_.begin() + by_.first[r + 1]);
  }

  // Lists the events with the given choices of the rows before r, which lose `loss` at the prices.
  // Returns false if there are too many.
  bool visit(std::size_t r, std::uint64_t tracks, std::uint64_t columns, double gain, double loss) {
    if (++n_visits_ > 4 * kMaxEvents || events_.size() > kMaxEvents) return false;
    if (r == chosen_.size()) {
      if (gain < best_ - kNegligible) return true;
      events_.push_back({tracks, columns, gain, choices_.size()});
      choices_.insert(choices_.end(), chosen_.begin(), chosen_.end());
      return true;
    }
    const double limit = kNegligible - min_loss_[r + 1] - loss;
    chosen_[r] = -1;
    if (missed_loss_[r] <= limit && !visit(r + 1, tracks, columns, gain, loss + missed_loss_[r]))
      return false;
    for (std::int32_t e = by_.first[r]; e < by_.first[r + 1]; ++e) {
      const std::uint64_t bit = std::uint64_t{1} << by_.column_of[e];
      if (columns & bit || loss_[e] > limit) continue;
      chosen_[r] = e;
      if (!visit(r + 1, tracks | std::uint64_t{1} << r, columns | bit, gain + group_[e].gain,
                 loss + loss_[e]))
        return false;
    }
    return true;
  }

  std::span<const Candidate> group_;
  GroupNumbering by_;
  std::vector<std::int32_t> chosen_, choices_, partner_;
  std::vector<double> loss_;  // by candidate
  std::vector<double> missed_loss_, min_loss_, price_;
  std::vector<Event> events_;
  std::size_t n_visits_ = 0;
  double best_ = 0;
};

}  // namespace asterism
