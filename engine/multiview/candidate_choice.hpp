// Selects the compatible candidates with the largest total score, such that no image point is used
// twice. This is weighted set packing.
//
// A greedy choice comes first. The score of each chosen candidate is divided equally into prices of
// its image points. At these prices, every choice has a total score of at most
//     Σ prices + Σ_candidates max(0, score - prices of its points).
// The greedy choice is therefore optimal if the points of every candidate cost at least its score.
// This is the usual case, because the score per view rises with the number of views. A candidate
// whose points cost more than its score by over the remaining gap is in no optimal choice. The
// connected components of the remaining candidates are solved separately by `SetPacking`.
#pragma once

#include "multiview/point_candidates.hpp"
#include "solve/connected_components.hpp"
#include "solve/set_packing.hpp"

namespace asterism {

struct ChoiceSummary {
  std::int64_t n_packed = 0;      // components that had to be searched
  std::int64_t n_inexact = 0;     // components whose search reached the node limit
  double gap = 0;                 // bound of the score by which the best choice is better
};

class CandidateChoice {
 public:
  // `uses`: the numbers of the image points of each candidate, below n_points.
  CandidateChoice(std::span<const std::vector<std::int32_t>> uses, std::span<const double> scores,
                  std::size_t n_points)
      : uses_(uses), scores_(scores), n_points_(n_points) {}

  // Numbers of the chosen candidates, increasing.
  std::vector<std::int32_t> solve(std::int64_t max_nodes, ChoiceSummary& summary) {
    std::vector<std::int32_t> all(scores_.size());
    for (std::size_t i = 0; i < all.size(); ++i) all[i] = static_cast<std::int32_t>(i);
    std::vector<std::int32_t> chosen;
    for (const std::vector<std::int32_t>& part : parts(all)) solve_part(part, max_nodes, summary, chosen);
    std::sort(chosen.begin(), chosen.end());
    return chosen;
  }

 private:
  using Numbers = std::vector<std::int32_t>;

  std::vector<Numbers> parts(const Numbers& members) const {
    std::vector<Numbers> out =
        connected_sets(members.size(), n_points_, [&](std::int32_t i, auto&& visit) {
          for (const std::int32_t p : uses_[members[i]]) visit(p);
        });
    for (Numbers& part : out)
      for (std::int32_t& i : part) i = members[i];
    return out;
  }

  void solve_part(const Numbers& part, std::int64_t max_nodes, ChoiceSummary& summary, Numbers& chosen) {
    if (part.size() == 1) {
      chosen.push_back(part[0]);
      return;
    }
    const Numbers greedy = greedy_choice(part);
    std::unordered_map<std::int32_t, double> price;
    for (const std::int32_t c : greedy)
      for (const std::int32_t p : uses_[c])
        price[p] = scores_[c] / static_cast<double>(uses_[c].size());
    std::vector<double> left(part.size());  // price of its points minus its score
    double open = 0;
    for (std::size_t i = 0; i < part.size(); ++i) {
      left[i] = -scores_[part[i]];
      for (const std::int32_t p : uses_[part[i]])
        if (const auto at = price.find(p); at != price.end()) left[i] += at->second;
      open += std::max(-left[i], 0.0);
    }
    if (open <= 1e-9) {
      chosen.insert(chosen.end(), greedy.begin(), greedy.end());
      return;
    }
    Numbers kept;
    for (std::size_t i = 0; i < part.size(); ++i)
      if (left[i] <= open + 1e-9) kept.push_back(part[i]);
    if (kept.size() < part.size()) {
      for (const Numbers& smaller : parts(kept)) solve_part(smaller, max_nodes, summary, chosen);
      return;
    }
    pack(part, max_nodes, summary, chosen);
  }

  Numbers greedy_choice(const Numbers& part) const {
    Numbers order = part, out;
    std::stable_sort(order.begin(), order.end(),
                     [this](std::int32_t a, std::int32_t b) { return scores_[a] > scores_[b]; });
    std::unordered_map<std::int32_t, bool> is_used;
    for (const std::int32_t c : order) {
      if (std::any_of(uses_[c].begin(), uses_[c].end(),
                      [&](std::int32_t p) { return is_used.count(p) > 0; }))
        continue;
      for (const std::int32_t p : uses_[c]) is_used[p] = true;
      out.push_back(c);
    }
    return out;
  }

  // Candidates that share an image point exclude each other and form one tree; the points with the
  // most candidates come first.
  void pack(const Numbers& part, std::int64_t max_nodes, ChoiceSummary& summary, Numbers& chosen) const {
    std::unordered_map<std::int32_t, Numbers> holders;
    Numbers resources;
    for (const std::int32_t c : part)
      for (const std::int32_t p : uses_[c]) {
        if (holders.find(p) == holders.end()) resources.push_back(p);
        holders[p].push_back(c);
      }
    std::stable_sort(resources.begin(), resources.end(), [&](std::int32_t a, std::int32_t b) {
      return holders[a].size() > holders[b].size();
    });
    std::unordered_map<std::int32_t, std::int32_t> number;
    for (const std::int32_t p : resources) number.emplace(p, static_cast<std::int32_t>(number.size()));
    std::unordered_map<std::int32_t, bool> is_placed;
    std::vector<std::vector<PackingOption>> trees;
    Numbers numbered;  // resources of all options
    std::size_t n_uses = 0;
    for (const std::int32_t c : part) n_uses += uses_[c].size();
    numbered.reserve(n_uses);  // so that the spans stay valid
    std::vector<Numbers> members;
    for (const std::int32_t p : resources) {
      std::vector<PackingOption> tree;
      Numbers own;
      for (const std::int32_t c : holders[p]) {
        if (!is_placed.emplace(c, true).second) continue;
        const std::size_t begin = numbered.size();
        for (const std::int32_t q : uses_[c]) numbered.push_back(number[q]);
        tree.push_back({scores_[c], std::span<const std::int32_t>(numbered).subspan(begin)});
        own.push_back(c);
      }
      if (tree.empty()) continue;
      tree.push_back({0, {}});
      own.push_back(-1);
      trees.push_back(std::move(tree));
      members.push_back(std::move(own));
    }
    ++summary.n_packed;
    double score = 0;
    const PackingSummary found = SetPacking(trees).solve(
        1, std::numeric_limits<double>::infinity(), max_nodes,
        [&](std::span<const std::int32_t> options, double total) {
          score = total;
          for (std::size_t i = 0; i < options.size(); ++i)
            if (const std::int32_t c = members[i][options[i]]; c >= 0) chosen.push_back(c);
        });
    if (!found.is_exact) {
      ++summary.n_inexact;
      summary.gap += std::max(found.bound - score, 0.0);
    }
  }

  std::span<const Numbers> uses_;
  std::span<const double> scores_;
  std::size_t n_points_;
};

}  // namespace asterism
