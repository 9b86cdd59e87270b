#include "rigid/carrier.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace asterism {

const Carriage& middle(std::span<const Carriage> ways, int D) {
  std::size_t best = 0;
  double min_sum = std::numeric_limits<double>::infinity();
  for (std::size_t a = 0; a < ways.size(); ++a) {
    double sum = 0;
    for (const Carriage& other : ways)
      sum += std::sqrt(squared_distance(ways[a].place.at, other.place.at, D));
    if (sum < min_sum) {
      min_sum = sum;
      best = a;
    }
  }
  return ways[best];
}

Carried Carrier::place(const RigidPrediction& found, const Accuracy& accuracy, std::int64_t frames,
                       double r) const {
  const double bent = static_cast<double>(frames) / kLag;
  return found.place(r, std::max(bent * accuracy.kappa(r_), Accuracy::kMinKappa));
}

void RigidCarrier::see(std::span<const MarkerPoint> seen) {
  frames_.push_back({{seen.begin(), seen.end()}});
  if (static_cast<std::int64_t>(frames_.size()) > Carrier::kLag + 1) frames_.pop_front();
  ++n_frames_;
  for (const MarkerPoint& one : seen) mark_detected(one.marker);
  carrier_.learn(seen);
  if (frames_.size() > 1)
    for (const MarkerPoint& one : frames_[frames_.size() - 2].seen)
      if (frames_.back().find(one.marker) == nullptr) mark_occluded(one.marker);
  if (static_cast<std::int64_t>(frames_.size()) <= Carrier::kLag) return;
  carrier_.assess(seen, frames_.front(), frames_.back(),
                 [](const MarkerPoint&, const RigidPrediction&, const Accuracy&) {});
}

void RigidCarrier::forget(std::int32_t marker) {
  carrier_.forget(marker);
  occluded_.erase(marker);
}

bool RigidCarrier::carry(std::int32_t marker, const Places& now, Carriage& out,
                         std::int64_t n_open) {
  if (!carrier_.is_assessed(marker)) return false;
  const auto occlusion = occluded_.find(marker);
  if (occlusion == occluded_.end()) {
    s_.anchors.clear();
    if (n_open > 0) remember(marker, 0, s_.anchors);
  }
  s_.ways.clear();
  carrier_.carry(
      marker, occlusion == occluded_.end() ? s_.anchors : occlusion->second.anchors, now, noise(),
      [&](const Anchor& anchor) { return n_frames_ + n_open + 1 - anchor.frame; },
      [&](const Anchor&, const Carriage& way) { s_.ways.push_back(way); });
  if (s_.ways.empty()) return false;
  out = middle(s_.ways, n_axes());
  return true;
}

void RigidCarrier::mark_detected(std::int32_t marker) {
  const auto occlusion = occluded_.find(marker);
  if (occlusion == occluded_.end()) return;
  if (++occlusion->second.n_back > Carrier::kAnchors.back()) occluded_.erase(occlusion);
}

void RigidCarrier::mark_occluded(std::int32_t marker) {
  if (const auto occlusion = occluded_.find(marker); occlusion != occluded_.end()) {
    occlusion->second.n_back = 0;
    return;
  }
  std::vector<Anchor>& anchors = occluded_[marker].anchors;
  remember(marker, 1, anchors);
  if (anchors.empty()) occluded_.erase(marker);
}

void RigidCarrier::remember(std::int32_t marker, std::int64_t back, std::vector<Anchor>& anchors) {
  const auto n = static_cast<std::int64_t>(frames_.size());
  for (const std::int64_t before : Carrier::kAnchors) {
    const std::int64_t ago = back + before;
    if (ago < n)
      carrier_.remember(marker, frames_[static_cast<std::size_t>(n - 1 - ago)], n_frames_ - ago, anchors);
  }
}

}  // namespace asterism
