// Surfaces that occlude points: triangles and capsules, and a bounding volume hierarchy (BVH) over
// them.
//
//   c, d      a ray c + s d; d leads from the camera to the point in question, so s = 1 there
//   s         intersection of the ray with a surface
//   a, b, e   corners of a triangle
//   u, v, w   signs tell on which side of the triangle's edges the ray passes
#pragma once

#include <bit>
#include <numeric>

#include "camera/camera.hpp"
#include "math/float4.hpp"

namespace asterism {

struct Hit {
  double s = std::numeric_limits<double>::infinity();
  std::int32_t owner = -1;
  // Equal distances are resolved by the lower number, so that the result does not depend on the
  // order of the tests.
  void keep(double other, std::int32_t who) {
    if (other < s || (other == s && who < owner)) s = other, owner = who;
  }
};

// A ray, and sheared coordinates relative to its origin in which it is an axis: (x - Sx z, y - Sy
// z), where z is the longest component of its direction.
struct Ray {
  Vec3 c, d;
  std::int32_t axis;
  double Sx, Sy, Sz;

  Ray(Vec3 origin, Vec3 direction) : c(origin), d(direction) {
    const double x = std::abs(d.x), y = std::abs(d.y), z = std::abs(d.z);
    axis = x >= y && x >= z ? 0 : y >= z ? 1 : 2;
    const Vec3 turned = axis == 0 ? turn<0>(d) : axis == 1 ? turn<1>(d) : turn<2>(d);
    Sx = turned.x / turned.z, Sy = turned.y / turned.z, Sz = 1 / turned.z;
  }
  template <int kAxis>
  static Vec3 turn(Vec3 p) {
    if constexpr (kAxis == 0) return {p.y, p.z, p.x};
    if constexpr (kAxis == 1) return {p.z, p.x, p.y};
    return p;
  }
  template <int kAxis>
  Vec3 place(Vec3 p) const {
    const Vec3 q = turn<kAxis>(p - c);
    return {q.x - Sx * q.z, q.y - Sy * q.z, q.z};
  }
};

struct Triangle {
  Vec3 a, b, e;
  std::int32_t owner;

  // Distance along the ray to the triangle, infinity if it misses. Adjacent triangles compute a
  // shared edge or corner from the same numbers, so no ray passes between them (S. Woop, C.
  // Benthin, I. Wald, Watertight ray/triangle intersection, JCGT 2, 2013).
  double meet(const Ray& ray) const {
    return ray.axis == 0 ? meet<0>(ray) : ray.axis == 1 ? meet<1>(ray) : meet<2>(ray);
  }

 private:
  template <int kAxis>
  double meet(const Ray& ray) const {
    constexpr double kNo = std::numeric_limits<double>::infinity();
    const Vec3 p = ray.place<kAxis>(a), q = ray.place<kAxis>(b), r = ray.place<kAxis>(e);
    const double u = r.x * q.y - r.y * q.x, v = p.x * r.y - p.y * r.x;
    if ((u > 0 && v < 0) || (u < 0 && v > 0)) return kNo;
    const double w = q.x * p.y - q.y * p.x;
    const bool is_inside = (u >= 0 && v >= 0 && w >= 0) || (u <= 0 && v <= 0 && w <= 0);
    const double all = u + v + w;
    if (!is_inside || all == 0) return kNo;  // misses it, or the triangle is edge on
    const double s = ray.Sz * (u * p.z + v * q.z + w * r.z) / all;
    return s > 0 ? s : kNo;
  }
};

struct Capsule {
  Vec3 a, b;
  double r;
  std::int32_t owner;

  // Distance to the nearest intersection with the surface in front of the camera.
  double meet(const Ray& ray) const { return meet_relative(a - ray.c, b - ray.c, ray.d); }

  double meet_relative(Vec3 p, Vec3 q, Vec3 d) const {
    const Vec3 axis = q - p;
    const double aa = dot(axis, axis), dd = dot(d, d), ad = dot(axis, d);
    double first = std::numeric_limits<double>::infinity();
    auto take = [&](double s) {
      if (s > 0) first = std::min(first, s);
    };
    if (aa > 0) {  // the cylinder between the ends
      const double ap = dot(axis, p), dp = dot(d, p);
      const double A = aa * dd - ad * ad, B = ad * ap - aa * dp;
      const double C = aa * (dot(p, p) - r * r) - ap * ap;
      const double D = B * B - A * C;
      if (A > 0 && D >= 0)
        for (const double s : {(-B - std::sqrt(D)) / A, (-B + std::sqrt(D)) / A})
          if (const double y = s * ad - ap; y >= 0 && y <= aa) take(s);
    }
    for (const bool is_far : {false, true}) {  // the half spheres at the ends
      const Vec3 m = is_far ? q : p;
      const double B = dot(d, m), D = B * B - dd * (dot(m, m) - r * r);
      if (D < 0) continue;
      for (const double s : {(B - std::sqrt(D)) / dd, (B + std::sqrt(D)) / dd}) {
        const double y = dot(axis, s * d - p);
        if (aa == 0 || (is_far ? y >= aa : y <= 0)) take(s);
      }
    }
    return first;
  }
};

struct Box {
  Vec3 low{kInf, kInf, kInf}, high{-kInf, -kInf, -kInf};
  static constexpr double kInf = std::numeric_limits<double>::infinity();
  void add(Vec3 p) {
    low = {std::min(low.x, p.x), std::min(low.y, p.y), std::min(low.z, p.z)};
    high = {std::max(high.x, p.x), std::max(high.y, p.y), std::max(high.z, p.z)};
  }
  void add(const Box& b) { add(b.low), add(b.high); }
  Vec3 middle() const { return 0.5 * (low + high); }
};

// The triangles and capsules of one moment.
class Scene {
 public:
  std::vector<Triangle> triangles;
  std::vector<Capsule> capsules;

  std::size_t size() const { return triangles.size() + capsules.size(); }

  // Builds the hierarchy. It must be called after the surfaces are set and before `first_hit`.
  void build() {
    order_.resize(size());
    std::iota(order_.begin(), order_.end(), 0);
    boxes_.resize(size());
    for (std::size_t i = 0; i < triangles.size(); ++i) {
      boxes_[i] = {};
      for (const Vec3 p : {triangles[i].a, triangles[i].b, triangles[i].e}) boxes_[i].add(p);
    }
    for (std::size_t i = 0; i < capsules.size(); ++i) {
      const Capsule& k = capsules[i];
      const Vec3 r{k.r, k.r, k.r};
      Box& box = boxes_[triangles.size() + i] = {};
      for (const Vec3 p : {k.a - r, k.a + r, k.b - r, k.b + r}) box.add(p);
    }
    Box all;
    for (const Box& box : boxes_) all.add(box);
    middle_ = all.middle();
    radius_ = 0.5 * std::sqrt(dot(all.high - all.low, all.high - all.low));
    nodes_.clear();
    if (size() > 0) grow(0, size());
  }

  // The first surface on the ray c + s d with s below `until`.
  Hit first_hit(Vec3 c, Vec3 d, double until) const {
    if (nodes_.empty()) return {};
    Hit hit{until, -1};
    const Ray ray(c, d);
    const Feeler feeler(c - middle_, d, radius_);
    struct Visit {
      std::int32_t node;
      float from;
    };
    // A node leaves at most three children on the stack, and the tree's depth is a quarter of the
    // number of bits of its size.
    std::array<Visit, 128> stack;
    std::size_t top = 0;
    stack[top++] = {0, 0};
    while (top > 0) {
      const Visit at = stack[--top];
      if (at.from > feeler.reach(hit.s)) continue;
      const Node& node = nodes_[static_cast<std::size_t>(at.node)];
      Float4 from;
      const std::size_t first = top;
      for (unsigned met = feeler.enters(node, hit.s, from); met != 0; met &= met - 1) {
        const auto k = static_cast<std::size_t>(std::countr_zero(met));
        for (std::int32_t i = 0; i < node.n[k]; ++i)
          test(order_[static_cast<std::size_t>(node.first[k] + i)], ray, hit);
        if (node.n[k] > 0) continue;
        // The nearest child is on top of the stack.
        std::size_t place = top++;
        for (; place > first && stack[place - 1].from < from[k]; --place)
          stack[place] = stack[place - 1];
        stack[place] = {node.first[k], from[k]};
      }
    }
    return hit.owner < 0 ? Hit{} : hit;
  }

 private:
  // Four boxes in parallel lanes, which one ray tests at once. Coordinates are in single precision
  // relative to the centre of the scene. A margin above the rounding error causes some extra tests
  // but never misses a hit.
  struct Node {
    std::array<std::array<Float4, 3>, 2> bound;  // low and high, axis; four boxes
    std::array<std::int32_t, 4> first;  // of its surfaces, or the child node
    std::array<std::int32_t, 4> n;      // of surfaces, 0 for a child node, -1 for none
  };

  // A ray in single precision, for tests against boxes.
  struct Feeler {
    std::array<float, 3> c, inverse;
    std::array<std::size_t, 3> is_backward;
    float margin;

    // `origin` is relative to the centre of a scene of the given radius.
    Feeler(Vec3 origin, Vec3 d, double radius)
        : c{as_float(origin.x), as_float(origin.y), as_float(origin.z)},
          margin(as_float(1e-6 * (1 + (radius + std::sqrt(dot(origin, origin))) / std::sqrt(dot(d, d))))) {
      // The inverse must be finite, because 0 times infinity would reject points in a face of the
      // box.
      auto inverted = [](double x) { return as_float(1 / (std::abs(x) < 1e-30 ? 1e-30 : x)); };
      inverse = {inverted(d.x), inverted(d.y), inverted(d.z)};
      for (std::size_t k = 0; k < 3; ++k) is_backward[k] = inverse[k] < 0;
    }
    static float as_float(double x) { return static_cast<float>(x); }
    float reach(double s) const { return as_float(std::min(s, 1e30)) * (1 + 1e-6F) + margin; }

    // Computes where the ray enters each box. A bit of the result is set if the ray enters before
    // it leaves.
    unsigned enters(const Node& node, double until, Float4& from) const {
      Float4 to = filled(reach(until));
      from = filled(0);
      for (std::size_t d = 0; d < 3; ++d) {
        from = maximum(from, (node.bound[is_backward[d]][d] - c[d]) * inverse[d]);
        to = minimum(to, (node.bound[1 - is_backward[d]][d] - c[d]) * inverse[d]);
      }
      return bits_not_above(from, to * (1 + 1e-6F) + margin);
    }
  };

  static double component(Vec3 p, std::size_t axis) { return axis == 0 ? p.x : axis == 1 ? p.y : p.z; }

  void test(std::int32_t i, const Ray& ray, Hit& hit) const {
    const auto n = static_cast<std::int32_t>(triangles.size());
    if (i < n) {
      const Triangle& t = triangles[static_cast<std::size_t>(i)];
      hit.keep(t.meet(ray), t.owner);
    } else {
      const Capsule& k = capsules[static_cast<std::size_t>(i - n)];
      hit.keep(k.meet(ray), k.owner);
    }
  }

  const Box& box_of(std::size_t place) const {
    return boxes_[static_cast<std::size_t>(order_[place])];
  }

  // Partitions the surfaces at the median of their centres along the longest axis. Returns the
  // first index of the second half.
  std::size_t halve(std::size_t first, std::size_t last) {
    Box middles;
    for (std::size_t k = first; k < last; ++k) middles.add(box_of(k).middle());
    const Vec3 size = middles.high - middles.low;
    const std::size_t axis = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
    const std::size_t half = (first + last) / 2;
    auto at = [&](std::size_t place) { return order_.begin() + static_cast<std::ptrdiff_t>(place); };
    std::nth_element(at(first), at(half), at(last), [&](std::int32_t i, std::int32_t j) {
      const double a = component(boxes_[static_cast<std::size_t>(i)].middle(), axis);
      const double b = component(boxes_[static_cast<std::size_t>(j)].middle(), axis);
      return a < b || (a == b && i < j);
    });
    return half;
  }

  std::int32_t grow(std::size_t first, std::size_t last) {
    const std::size_t at = nodes_.size();
    nodes_.emplace_back();
    std::array<std::size_t, 5> cut{first, last, last, last, last};
    if (last - first > kLeaf) {
      const std::size_t half = halve(first, last);
      cut = {first, half, half, last, last};
      if (half - first > 1) cut[1] = halve(first, half);
      if (last - half > 1) cut[3] = halve(half, last);
    }
    for (std::size_t k = 0; k < 4; ++k) {
      Box box;  // an empty box is inverted, so that no ray enters it
      for (std::size_t i = cut[k]; i < cut[k + 1]; ++i) box.add(box_of(i));
      const std::size_t n = cut[k + 1] - cut[k];
      const std::int32_t child = n > kLeaf ? grow(cut[k], cut[k + 1]) : static_cast<std::int32_t>(cut[k]);
      Node& node = nodes_[at];
      for (std::size_t d = 0; d < 3; ++d) {
        node.bound[0][d][k] = Feeler::as_float(component(box.low, d) - component(middle_, d));
        node.bound[1][d][k] = Feeler::as_float(component(box.high, d) - component(middle_, d));
      }
      node.first[k] = child;
      node.n[k] = n == 0 ? -1 : n > kLeaf ? 0 : static_cast<std::int32_t>(n);
    }
    return static_cast<std::int32_t>(at);
  }

  static constexpr std::size_t kLeaf = 2;
  Vec3 middle_{0, 0, 0};
  double radius_ = 0;
  std::vector<std::int32_t> order_;
  std::vector<Box> boxes_;
  std::vector<Node> nodes_;
};

}  // namespace asterism
