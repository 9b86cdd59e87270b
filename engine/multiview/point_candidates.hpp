// Generates candidates: groups of image points of different cameras that may show one point in
// space.
//
// Pairs of rays that meet within the gate are seeds. The position of a seed is projected into the
// other cameras. First, cameras with a single image point in the gate are added, then those where
// the nearest of several is taken. A pair within a found candidate of three or more views is not
// used as a seed again.
#pragma once

#include <cmath>
#include <unordered_map>
#include <vector>

#include "multiview/image_points.hpp"
#include "multiview/point_fit.hpp"

namespace asterism {

struct CandidateOptions {
  double log_density = 0;    // log ρ, points per m³
  double gate = 4;           // standard deviations
  std::int32_t min_views = 2;
  std::array<double, 3> low{}, high{};  // bounds of the volume
};

class PointCandidates {
 public:
  PointCandidates(std::span<const ImagePoints> cameras, const CandidateOptions& options,
                  std::span<const ExpectedPlace> expected)
      : cameras_(cameras),
        options_(options),
        expected_(expected),
        fit_(cameras, options.log_density, expected),
        gate2_(options.gate * options.gate) {
    std::size_t n = 0;
    for (const ImagePoints& c : cameras_)
      for (const ImagePoint& p : c.points) n = std::max<std::size_t>(n, p.number + 1);
    strong_of_.resize(n);
    for (std::size_t k = 0; k < cameras_.size(); ++k) all_.push_back(static_cast<std::int32_t>(k));
  }

  // All candidates that are more likely than clutter.
  std::vector<PointCandidate> find() {
    for (const ExpectedPlace& e : expected_) grow_from_place(e.X);
    find_seeds();
    for (const Seed& seed : seeds_) {
      if (is_known(seed)) continue;
      PointCandidate c;
      c.views = {{seed.a, seed.i}, {seed.b, seed.j}};
      c.X = seed.X;
      if (fit_.inform(c)) grow(c);
    }
    add_remainders();
    return std::move(found_);
  }

 private:
  struct Seed {
    std::int32_t a, i, b, j;  // cameras and points
    double squared;           // normalised squared distance of the rays, for ordering
    Vec3 X;
  };

  std::int32_t number(View v) const { return cameras_[v.camera].points[v.point].number; }

  bool is_inside(Vec3 X) const {
    const auto& [lx, ly, lz] = options_.low;
    const auto& [hx, hy, hz] = options_.high;
    return X.x >= lx && X.x <= hx && X.y >= ly && X.y <= hy && X.z >= lz && X.z <= hz;
  }

  void find_seeds() {
    const auto C = static_cast<std::int32_t>(cameras_.size());
    std::vector<double> height;
    for (std::int32_t a = 0; a < C; ++a)
      for (std::int32_t b = a + 1; b < C; ++b) {
        const ImagePoints &A = cameras_[a], &B = cameras_[b];
        const Vec3 base = B.center - A.center;
        height.resize(B.points.size());
        for (std::size_t i = 0; i < A.points.size(); ++i) {
          if (A.points[i].is_shared && B.n_free == 0) continue;
          // Distances of the rays of b from the plane of this ray and the base line.
          const Vec3 d = A.ray(i), m = cross(base, d);
          const double m2 = dot(m, m);
          for (std::size_t j = 0; j < height.size(); ++j)
            height[j] = m.x * B.dx[j] + m.y * B.dy[j] + m.z * B.dz[j];
          // A coarse gate, which assumes that neither ray is more than kReach times as long as the
          // other.
          constexpr double kReach = 5;
          const double coarse = options_.gate * (B.widest + kReach * A.points[i].spread);
          const double max_squared = coarse * coarse * m2;
          for (std::size_t j = 0; j < height.size(); ++j)
            if (height[j] * height[j] <= max_squared) try_seed(a, i, b, j, base, height[j], m2);
        }
      }
    std::sort(seeds_.begin(), seeds_.end(), [this](const Seed& s, const Seed& t) {
      if (s.squared != t.squared) return s.squared < t.squared;
      const std::int32_t p = number({s.a, s.i}), q = number({t.a, t.i});
      return p != q ? p < q : number({s.b, s.j}) < number({t.b, t.j});
    });
  }

  void try_seed(std::int32_t a, std::size_t i, std::int32_t b, std::size_t j, Vec3 base,
                double height, double m2) {
    const ImagePoints &A = cameras_[a], &B = cameras_[b];
    if (A.points[i].is_shared && B.points[j].is_shared) return;
    const Vec3 d = A.ray(i), e = B.ray(j);
    const double de = dot(d, e), sine2 = 1 - de * de;
    if (!(sine2 > 1e-9)) return;
    // Distances along the rays to their closest approach.
    const double bd = dot(base, d), be = dot(base, e);
    const double s = (bd - de * be) / sine2, t = (de * bd - be) / sine2;
    if (!(s > 0 && t > 0)) return;
    const double ratio = s / t, sa = ratio * A.points[i].spread, sb = B.points[j].spread;
    const double squared = height * height / (m2 * (sa * sa + sb * sb));
    if (squared > gate2_) return;
    const double u = t * t * sb * sb, v = s * s * A.points[i].spread * A.points[i].spread;
    const Vec3 p = A.center + s * d, q = B.center + t * e;
    const Vec3 X = 1 / (u + v) * (u * p + v * q);
    if (!is_inside(X)) return;
    seeds_.push_back({a, static_cast<std::int32_t>(i), b, static_cast<std::int32_t>(j), squared, X});
  }

  // Whether a candidate of three or more views contains both points.
  bool is_known(const Seed& seed) const {
    const auto &p = strong_of_[number({seed.a, seed.i})], &q = strong_of_[number({seed.b, seed.j})];
    auto i = p.begin();
    auto j = q.begin();
    while (i != p.end() && j != q.end()) {
      if (*i == *j) return true;
      *i < *j ? ++i : ++j;
    }
    return false;
  }

  void grow(PointCandidate& c) {
    open_cameras_ = all_;
    extend(c, open_cameras_, false);
    extend(c, open_cameras_, true);
    prune(c);
    if (c.views.size() >= 3 && c.views.size() < all_.size()) {
      // The position is more accurate now, which may bring further views into the gate.
      const std::size_t n = c.views.size();
      open_cameras_ = all_;
      extend(c, open_cameras_, true);
      if (c.views.size() > n) prune(c);
    }
    keep(c);
  }

  // Starts a candidate at an expected position, with the nearest image point of each camera.
  void grow_from_place(Vec3 X) {
    PointCandidate c;
    c.X = X;
    for (std::size_t k = 0; k < cameras_.size(); ++k) {
      const ProjectedPlace s = cameras_[k].project(X);
      if (!(s.depth > 0)) continue;
      const std::vector<ImagePoint>& points = cameras_[k].points;
      std::int32_t best = -1;
      double min_squared = kFar * kFar;
      for (std::size_t i = 0; i < points.size(); ++i) {
        const double r2 = points[i].squared({points[i].n.x - s.n.x, points[i].n.y - s.n.y});
        if (r2 < min_squared) min_squared = r2, best = static_cast<std::int32_t>(i);
      }
      if (best >= 0) c.views.push_back({static_cast<std::int32_t>(k), best});
    }
    if (c.views.size() < 2 || !fit_.fit(c)) return;
    prune(c);
    if (c.views.size() < 2) return;
    grow(c);
  }

  // Adds a view for each camera in `open` that has none and has an image point in the gate.
  // Cameras with several such points stay in `open`, unless `takes_nearest` is set.
  void extend(PointCandidate& c, std::vector<std::int32_t>& open, bool takes_nearest) const {
    Symmetric3 P = c.information.inverse();
    std::size_t n_left = 0;
    for (const std::int32_t k : open) {
      const auto at = std::lower_bound(c.views.begin(), c.views.end(), k,
                                       [](View v, std::int32_t camera) { return v.camera < camera; });
      if (at != c.views.end() && at->camera == k) continue;
      const ImagePoints& camera = cameras_[k];
      const ProjectedPlace s = camera.project(c.X);
      if (!(s.depth > 0)) continue;
      const Vec3 px = P * s.jx, py = P * s.jy;
      const double sxx = dot(s.jx, px), sxy = dot(s.jx, py), syy = dot(s.jy, py);
      const double width2 = camera.widest * camera.widest;
      const double reach = options_.gate * std::sqrt(sxx + width2), height2 = gate2_ * (syy + width2);
      const auto from = camera.right_of(s.n.x - reach);
      std::int32_t best = -1, n_inside = 0;
      double min_squared = gate2_;
      for (auto p = from; p != camera.points.end() && p->n.x <= s.n.x + reach; ++p) {
        const double ex = p->n.x - s.n.x, ey = p->n.y - s.n.y;
        if (ey * ey > height2) continue;
        const double cxx = sxx + p->vxx, cxy = sxy + p->vxy, cyy = syy + p->vyy;
        const double r2 =
            (cyy * ex * ex - 2 * cxy * ex * ey + cxx * ey * ey) / (cxx * cyy - cxy * cxy);
        if (r2 > gate2_) continue;
        ++n_inside;
        if (r2 > min_squared) continue;
        min_squared = r2, best = static_cast<std::int32_t>(p - camera.points.begin());
      }
      if (best < 0) continue;
      if (n_inside > 1 && !takes_nearest) {
        open[n_left++] = k;
        continue;
      }
      c.views.insert(at, {k, best});
      PointFit::step(c, camera.points[best], s);
      P = c.information.inverse();
    }
    open.resize(n_left);
  }

  // Removes the worst view while it is outside the gate.
  void prune(PointCandidate& c) const {
    while (c.views.size() >= 2) {
      if (!fit_.fit(c)) {
        c.views.clear();
        return;
      }
      double max_squared = gate2_;
      std::size_t worst = c.views.size();
      for (std::size_t i = 0; i < c.views.size(); ++i)
        if (const double r2 = fit_.squared_of(c, c.views[i]); r2 > max_squared)
          max_squared = r2, worst = i;
      if (worst == c.views.size()) return;
      c.views.erase(c.views.begin() + static_cast<std::ptrdiff_t>(worst));
    }
  }

  // Stores a fitted candidate, unless it is a duplicate.
  void keep(PointCandidate& c) {
    if (static_cast<std::int32_t>(c.views.size()) < std::max(options_.min_views, 2)) return;
    const bool is_own = std::any_of(c.views.begin(), c.views.end(), [this](View v) {
      return !cameras_[v.camera].points[v.point].is_shared;
    });
    if (!is_own || !is_inside(c.X)) return;
    c.score = fit_.score(c);
    if (!(c.score > 0)) return;
    std::uint64_t hash = 1469598103934665603u;
    for (const View v : c.views) hash = (hash ^ static_cast<std::uint64_t>(number(v))) * 1099511628211u;
    const auto [from, to] = by_hash_.equal_range(hash);
    for (auto it = from; it != to; ++it)
      if (found_[it->second].views == c.views) return;
    const auto own = static_cast<std::int32_t>(found_.size());
    by_hash_.emplace(hash, own);
    if (c.views.size() >= 3)
      for (const View v : c.views) strong_of_[number(v)].push_back(own);
    found_.push_back(std::move(c));
  }

  // If two candidates share an image point, adds each of them without the views of the other,
  // provided that both together could have a higher score than either alone.
  void add_remainders() {
    std::size_t from = 0;
    for (int round = 0; round < 2; ++round) {
      const std::size_t to = found_.size();
      std::vector<std::vector<std::int32_t>> holders(strong_of_.size());
      for (std::size_t i = 0; i < to; ++i)
        for (const View v : found_[i].views) holders[number(v)].push_back(static_cast<std::int32_t>(i));
      std::vector<std::int32_t> met(to, -1);
      for (std::size_t i = 0; i < to; ++i) {
        std::vector<std::int32_t> rivals;
        for (const View v : found_[i].views)
          for (const std::int32_t r : holders[number(v)])
            if (r != static_cast<std::int32_t>(i) && met[r] != static_cast<std::int32_t>(i)) {
              met[r] = static_cast<std::int32_t>(i);
              if (i >= from || static_cast<std::size_t>(r) >= from) rivals.push_back(r);
            }
        for (const std::int32_t r : rivals) add_remainder(i, static_cast<std::size_t>(r));
      }
      from = to;
      if (found_.size() == to) break;
    }
  }

  void add_remainder(std::size_t i, std::size_t rival) {
    // The position is less certain without the views, which the estimate neglects.
    constexpr double kMargin = 6;
    PointCandidate rest;
    rest.X = found_[i].X;
    double lost = 0;
    for (const View v : found_[i].views) {
      if (std::ranges::find(found_[rival].views, v) != found_[rival].views.end()) {
        const ImagePoints& camera = cameras_[v.camera];
        lost += camera.points[v.point].gain - camera.sense.miss - fit_.squared_of(found_[i], v) / 2;
      } else {
        rest.views.push_back(v);
      }
    }
    if (static_cast<std::int32_t>(rest.views.size()) < std::max(options_.min_views, 2)) return;
    if (found_[rival].score - lost < -kMargin) return;
    if (fit_.fit(rest)) keep(rest);
  }

  // Standard deviations, of an image point from its expected position.
  static constexpr double kFar = 30;
  std::span<const ImagePoints> cameras_;
  CandidateOptions options_;
  std::span<const ExpectedPlace> expected_;
  PointFit fit_;
  double gate2_;
  std::vector<std::int32_t> all_, open_cameras_;  // cameras
  std::vector<Seed> seeds_;
  std::vector<PointCandidate> found_;
  std::unordered_multimap<std::uint64_t, std::int32_t> by_hash_;
  // Candidates of three or more views, increasing.
  std::vector<std::vector<std::int32_t>> strong_of_;
};

}  // namespace asterism
