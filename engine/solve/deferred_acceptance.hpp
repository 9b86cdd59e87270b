// Stable marriage with unequal numbers and unacceptable partners (Gale & Shapley 1962).
//
// The list of a proposer is ranked, best first, and ends where partners become unacceptable. A
// receiver prefers the proposer with the lower cost, and at equal cost the one with the lower
// number. The result is the proposer-optimal stable matching, whatever the order of the proposals.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace asterism {

struct Proposal {
  std::int32_t receiver = 0;
  double cost = 0;  // the receiver prefers the lowest cost
};

// Proposer p may propose to lists[first[p]:first[p+1]] in that order. Fills partner_of_proposer (-1
// if unmatched) and returns the number of proposals made.
inline std::int64_t deferred_acceptance(std::span<const Proposal> lists,
                                        std::span<const std::int64_t> first,
                                        std::int32_t n_receivers,
                                        std::span<std::int32_t> partner_of_proposer) {
  const auto n_proposers = static_cast<std::int32_t>(partner_of_proposer.size());
  std::vector<std::int32_t> fiance(n_receivers, -1);
  std::vector<double> cost(n_receivers, 0);
  std::vector<std::int64_t> next(first.begin(), first.end() - 1);
  std::int64_t n_proposals = 0;
  for (std::int32_t p = 0; p < n_proposers; ++p) {
    partner_of_proposer[p] = -1;
    // Follow the chain of rejections that p's proposals cause, until a rejected proposer has no
    // further proposal or finds a free receiver.
    std::int32_t suitor = p;
    while (suitor >= 0 && next[suitor] < first[suitor + 1]) {
      const Proposal& offer = lists[next[suitor]++];
      ++n_proposals;
      std::int32_t& holder = fiance[offer.receiver];
      const bool accepts =
          holder < 0 || offer.cost < cost[offer.receiver] ||
          (offer.cost == cost[offer.receiver] && suitor < holder);
      if (!accepts) continue;
      const std::int32_t rejected = holder;
      holder = suitor;
      cost[offer.receiver] = offer.cost;
      partner_of_proposer[suitor] = offer.receiver;
      if (rejected >= 0) partner_of_proposer[rejected] = -1;
      suitor = rejected;
    }
  }
  return n_proposals;
}

}  // namespace asterism
