// Reconstructs the points of one frame from many views: groups image points and locates each group.
#pragma once

#include "multiview/candidate_choice.hpp"

namespace asterism {

struct FoundPoint {
  Vec3 X;
  double score;
  std::vector<std::int32_t> uses;  // numbers of its image points, increasing
};

struct FrameSummary {
  std::int64_t n_candidates = 0;
  ChoiceSummary choice;
};

class ManyViews {
 public:
  ManyViews(std::span<const Camera> cameras, std::span<const ImageSense> senses,
            const CandidateOptions& options)
      : options_(options) {
    for (std::size_t c = 0; c < cameras.size(); ++c) images_.emplace_back(cameras[c], senses[c]);
  }

  // `pixels` are those of all cameras; camera c has those from offsets[c] to offsets[c + 1],
  // counted from offsets[0]. After the best choice of points, merge > 0 adds points whose images
  // have merged with others. `merge` is the standard deviation in pixels of such an image.
  std::vector<FoundPoint> solve(std::span<const double> pixels, std::span<const std::int64_t> offsets,
                                std::span<const ExpectedPlace> expected, double merge, std::int64_t max_nodes,
                                FrameSummary& summary) {
    for (std::size_t c = 0; c < images_.size(); ++c) {
      const auto from = static_cast<std::size_t>(offsets[c] - offsets[0]);
      const auto n = static_cast<std::size_t>(offsets[c + 1] - offsets[c]);
      images_[c].take(pixels.subspan(2 * from, 2 * n), static_cast<std::int32_t>(from));
    }
    std::vector<FoundPoint> found;
    std::vector<char> is_taken(pixels.size() / 2, 0);
    choose(expected, is_taken.size(), max_nodes, summary, found);
    for (const FoundPoint& p : found)
      for (const std::int32_t use : p.uses) is_taken[use] = 1;
    const bool is_any_left = std::find(is_taken.begin(), is_taken.end(), 0) != is_taken.end();
    if (merge > 0 && !found.empty() && is_any_left) {
      for (ImagePoints& camera : images_) camera.share(is_taken, std::max(merge, camera.sense.sigma));
      choose(expected, is_taken.size(), max_nodes, summary, found);
    }
    std::sort(found.begin(), found.end(), [](const FoundPoint& a, const FoundPoint& b) {
      return a.X.x != b.X.x ? a.X.x < b.X.x : a.X.y < b.X.y;
    });
    return found;
  }

 private:
  void choose(std::span<const ExpectedPlace> expected, std::size_t n_points, std::int64_t max_nodes,
              FrameSummary& summary, std::vector<FoundPoint>& found) const {
    const std::vector<PointCandidate> all = PointCandidates(images_, options_, expected).find();
    std::vector<std::vector<std::int32_t>> used;
    std::vector<double> scores;
    for (const PointCandidate& c : all) {
      used.emplace_back();
      for (const View v : c.views) used.back().push_back(images_[v.camera].points[v.point].number);
      scores.push_back(c.score);
    }
    summary.n_candidates += static_cast<std::int64_t>(all.size());
    CandidateChoice choice(used, scores, n_points);
    for (const std::int32_t k : choice.solve(max_nodes, summary.choice))
      found.push_back({all[k].X, all[k].score, std::move(used[k])});
  }

  CandidateOptions options_;
  std::vector<ImagePoints> images_;
};

}  // namespace asterism
