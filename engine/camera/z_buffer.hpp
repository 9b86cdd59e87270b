// The z-buffer: the surface that each pixel shows, and its depth.
//
//   (x, y)   normalised coordinates of a pixel's ray (x, y, 1), after undistortion
//
// The rays of all pixels are stored, so that surfaces are drawn exactly through any lens: each
// pixel is tested by its own ray. A pyramid of tiles with the extents of their rays limits the
// pixels to be tested.
#pragma once

#include "camera/bvh.hpp"

namespace asterism {

struct DepthImage {
  std::span<double> depth;        // row by row, infinity if no surface is hit
  std::span<std::int32_t> owner;  // -1 if no surface is hit

  // During drawing `depth` holds its inverse, which is linear in the image and needs no division.
  void begin() const {
    std::fill(depth.begin(), depth.end(), 0.0);
    std::fill(owner.begin(), owner.end(), -1);
  }
  void end() const {
    for (double& d : depth) d = 1 / d;
  }
  void see(std::size_t i, double inverse, std::int32_t who) const {
    if (inverse > depth[i] || (inverse == depth[i] && who < owner[i])) put(i, inverse, who);
  }
  void put(std::size_t i, double inverse, std::int32_t who) const {
    depth[i] = inverse, owner[i] = who;
  }
};

class RayGrid {
 public:
  explicit RayGrid(const Camera& camera) : w_(camera.width()), h_(camera.height()) {
    const auto n = static_cast<std::size_t>(w_) * static_cast<std::size_t>(h_);
    std::vector<double> pixels(2 * static_cast<std::size_t>(w_)), rays(pixels.size());
    x_.resize(n), y_.resize(n);
    for (std::int32_t v = 0; v < h_; ++v) {
      for (std::int32_t u = 0; u < w_; ++u) pixels[2 * static_cast<std::size_t>(u)] = u, pixels[2 * static_cast<std::size_t>(u) + 1] = v;
      camera.undistort(pixels, rays);
      for (std::int32_t u = 0; u < w_; ++u) {
        x_[index(u, v)] = rays[2 * static_cast<std::size_t>(u)];
        y_[index(u, v)] = rays[2 * static_cast<std::size_t>(u) + 1];
      }
    }
    build();
  }

  std::int32_t width() const { return w_; }
  std::int32_t height() const { return h_; }

  // Draws the nearest surface of every pixel. Triangles and capsules are in camera coordinates. It
  // must be called between `begin` and `end` of the image.
  void draw_nearest(std::span<const Triangle> triangles, std::span<const Capsule> capsules,
                    DepthImage image) const {
    for (const Triangle& t : triangles) draw<true>(t, image);
    for (const Capsule& k : capsules) draw(k, image);
  }

  // Draws every triangle over the existing image, without a depth test (painter's algorithm).
  void paint(std::span<const Triangle> triangles, DepthImage image) const {
    for (const Triangle& t : triangles) draw<false>(t, image);
  }

 private:
  static constexpr std::int32_t kTile = 8;

  struct Extent {
    double x0 = Box::kInf, x1 = -Box::kInf, y0 = Box::kInf, y1 = -Box::kInf;
    void add(const Extent& e) {
      x0 = std::min(x0, e.x0), x1 = std::max(x1, e.x1);
      y0 = std::min(y0, e.y0), y1 = std::max(y1, e.y1);
    }
    bool meets(const Extent& e) const { return x0 <= e.x1 && e.x0 <= x1 && y0 <= e.y1 && e.y0 <= y1; }
  };

  // A level of the pyramid; a tile covers 2 x 2 tiles of the level below.
  struct Level {
    std::int32_t w, h;
    std::vector<Extent> tiles;
    const Extent& at(std::int32_t i, std::int32_t j) const {
      return tiles[static_cast<std::size_t>(j) * static_cast<std::size_t>(w) + static_cast<std::size_t>(i)];
    }
  };

  std::size_t index(std::int32_t u, std::int32_t v) const {
    return static_cast<std::size_t>(v) * static_cast<std::size_t>(w_) + static_cast<std::size_t>(u);
  }

  void build() {
    Level first{(w_ + kTile - 1) / kTile, (h_ + kTile - 1) / kTile, {}};
    for (std::int32_t j = 0; j < first.h; ++j)
      for (std::int32_t i = 0; i < first.w; ++i) {
        Extent e;
        for (std::int32_t v = j * kTile; v < std::min(h_, (j + 1) * kTile); ++v)
          for (std::int32_t u = i * kTile; u < std::min(w_, (i + 1) * kTile); ++u)
            if (const double x = x_[index(u, v)], y = y_[index(u, v)]; std::isfinite(x)) e.add({x, x, y, y});
        first.tiles.push_back(e);
      }
    levels_.push_back(std::move(first));
    while (levels_.back().tiles.size() > 1) {
      const Level& below = levels_.back();
      Level level{(below.w + 1) / 2, (below.h + 1) / 2, {}};
      for (std::int32_t j = 0; j < level.h; ++j)
        for (std::int32_t i = 0; i < level.w; ++i) {
          Extent e;
          for (std::int32_t q = 2 * j; q < std::min(below.h, 2 * j + 2); ++q)
            for (std::int32_t p = 2 * i; p < std::min(below.w, 2 * i + 2); ++p) e.add(below.at(p, q));
          level.tiles.push_back(e);
        }
      levels_.push_back(std::move(level));
    }
  }

  // Visits the rows of the tiles that `may_meet` does not exclude.
  template <typename MayMeet, typename Row>
  void visit(std::size_t level, std::int32_t i, std::int32_t j, const MayMeet& may_meet, const Row& row) const {
    const Level& l = levels_[level];
    if (!may_meet(l.at(i, j))) return;
    if (level == 0) {
      const std::int32_t u0 = i * kTile, n = std::min(w_, u0 + kTile) - u0;
      for (std::int32_t v = j * kTile; v < std::min(h_, (j + 1) * kTile); ++v) row(index(u0, v), n);
      return;
    }
    const Level& below = levels_[level - 1];
    for (std::int32_t q = 2 * j; q < std::min(below.h, 2 * j + 2); ++q)
      for (std::int32_t p = 2 * i; p < std::min(below.w, 2 * i + 2); ++p)
        visit(level - 1, p, q, may_meet, row);
  }

  static void widen(Extent& e) {
    for (double* low : {&e.x0, &e.y0}) *low -= 1e-12 * (1 + std::abs(*low));
    for (double* high : {&e.x1, &e.y1}) *high += 1e-12 * (1 + std::abs(*high));
  }

  template <bool kIsTested>
  void draw(const Triangle& t, DepthImage image) const {
    const Vec3 a = t.a, b = t.b, e = t.e;
    if (a.z <= 0 && b.z <= 0 && e.z <= 0) return;
    const Vec3 normal = cross(b - a, e - a);
    const double volume = dot(a, normal);
    if (volume == 0) return;  // edge on
    const Vec3 n = (1 / volume) * normal;  // n . (x, y, 1) is the inverse depth of the plane
    const double sign = volume > 0 ? 1 : -1;
    const Vec3 U = sign * cross(b, e), V = sign * cross(e, a), W = sign * cross(a, b);
    Extent extent{-Box::kInf, Box::kInf, -Box::kInf, Box::kInf};
    if (a.z > 0 && b.z > 0 && e.z > 0) {
      extent = {};
      for (const Vec3 p : {a, b, e}) extent.add({p.x / p.z, p.x / p.z, p.y / p.z, p.y / p.z});
      widen(extent);
    }
    auto max_over = [](Vec3 N, const Extent& x) {
      return std::max(N.x * x.x0, N.x * x.x1) + std::max(N.y * x.y0, N.y * x.y1) + N.z;
    };
    auto may_meet = [&](const Extent& x) {
      return extent.meets(x) && max_over(U, x) >= 0 && max_over(V, x) >= 0 && max_over(W, x) >= 0;
    };
    auto row = [&](std::size_t at, std::int32_t count) {
      const double* const x = x_.data() + at;
      const double* const y = y_.data() + at;
      // Two passes, the first without a branch, because most pixels of most tiles are outside.
      std::array<double, kTile> min_side;
      for (std::int32_t i = 0; i < count; ++i) {
        const double u = x[i] * U.x + y[i] * U.y + U.z, v = x[i] * V.x + y[i] * V.y + V.z;
        const double w = x[i] * W.x + y[i] * W.y + W.z, uv = u < v ? u : v;
        min_side[static_cast<std::size_t>(i)] = uv < w ? uv : w;
      }
      for (std::int32_t i = 0; i < count; ++i) {
        if (!(min_side[static_cast<std::size_t>(i)] >= 0)) continue;
        const double inverse = x[i] * n.x + y[i] * n.y + n.z;
        if (!(inverse > 0)) continue;
        const std::size_t k = at + static_cast<std::size_t>(i);
        kIsTested ? image.see(k, inverse, t.owner) : image.put(k, inverse, t.owner);
      }
    };
    visit(levels_.size() - 1, 0, 0, may_meet, row);
  }

  void draw(const Capsule& k, DepthImage image) const {
    const Extent extent = extent_of(k);
    auto row = [&](std::size_t at, std::int32_t count) {
      for (std::size_t i = at; i < at + static_cast<std::size_t>(count); ++i) {
        if (!std::isfinite(x_[i])) continue;
        image.see(i, 1 / k.meet_relative(k.a, k.b, {x_[i], y_[i], 1}), k.owner);
      }
    };
    visit(levels_.size() - 1, 0, 0, [&](const Extent& x) { return extent.meets(x); }, row);
  }

  // The extent of the two end spheres, or unbounded if one of them reaches behind the camera.
  static Extent extent_of(const Capsule& k) {
    Extent extent;
    for (const Vec3 c : {k.a, k.b}) {
      if (c.z <= k.r) return {-Box::kInf, Box::kInf, -Box::kInf, Box::kInf};
      auto span = [&](double p, double& low, double& high) {
        const double middle = std::atan2(p, c.z), half = std::asin(k.r / std::hypot(p, c.z));
        const double right = 0.5 * 3.14159265358979323846;
        low = middle - half > -right ? std::tan(middle - half) : -Box::kInf;
        high = middle + half < right ? std::tan(middle + half) : Box::kInf;
      };
      Extent e;
      span(c.x, e.x0, e.x1), span(c.y, e.y0, e.y1);
      extent.add(e);
    }
    widen(extent);
    return extent;
  }

  std::int32_t w_, h_;
  std::vector<double> x_, y_;
  std::vector<Level> levels_;
};

}  // namespace asterism
