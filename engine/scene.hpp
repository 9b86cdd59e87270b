// Surfaces that hide points: triangles and capsules, and a tree of boxes over them.
//
//   c, d      a ray c + s d; d leads from the camera to the point in question, so s = 1 there
//   a, b, e   corners of a triangle as seen from c
//   s         where the ray meets a surface
//
// A triangle is met if d lies on one side of the three planes through c and its edges. An edge
// that two triangles share gives both the same number with opposite signs, so no ray slips through.
#pragma once

#include <numeric>

#include "camera.hpp"

namespace asterism {

struct Hit {
  double s = std::numeric_limits<double>::infinity();
  std::int32_t owner = -1;
  // Of two at the same place the lower number, so that the order of the tests does not matter.
  void keep(double other, std::int32_t who) {
    if (other < s || (other == s && who < owner)) s = other, owner = who;
  }
};

struct Triangle {
  Vec3 a, b, e;
  std::int32_t owner;

  // Where the ray meets the triangle, infinity if it does not.
  double meet(Vec3 c, Vec3 d) const { return meet_seen(a - c, b - c, e - c, d); }

  static double meet_seen(Vec3 a, Vec3 b, Vec3 e, Vec3 d) {
    const Vec3 n = cross(b - a, e - a);
    const double u = dot(d, cross(b, e)), v = dot(d, cross(e, a)), w = dot(d, cross(a, b));
    const bool is_inside = (u >= 0 && v >= 0 && w >= 0) || (u <= 0 && v <= 0 && w <= 0);
    const double along = dot(d, n);
    if (!is_inside || along == 0) return std::numeric_limits<double>::infinity();  // or edge on
    const double s = dot(a, n) / along;
    return s > 0 ? s : std::numeric_limits<double>::infinity();
  }
};

struct Capsule {
  Vec3 a, b;
  double r;
  std::int32_t owner;

  // The nearest crossing of its skin in front of the camera.
  double meet(Vec3 c, Vec3 d) const { return meet_seen(a - c, b - c, d); }

  double meet_seen(Vec3 p, Vec3 q, Vec3 d) const {
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
    for (const bool is_far : {false, true}) {  // the half spheres beyond them
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

// Triangles and capsules of one moment.
class Scene {
 public:
  std::vector<Triangle> triangles;
  std::vector<Capsule> capsules;

  std::size_t size() const { return triangles.size() + capsules.size(); }

  // To be called when the surfaces are in place, before `first_hit`.
  void build() {
    order_.resize(size());
    std::iota(order_.begin(), order_.end(), 0);
    boxes_.resize(size());
    for (std::size_t i = 0; i < triangles.size(); ++i) {
      Box b;
      b.add(triangles[i].a), b.add(triangles[i].b), b.add(triangles[i].e);
      boxes_[i] = b;
    }
    for (std::size_t i = 0; i < capsules.size(); ++i) {
      const Capsule& k = capsules[i];
      const Vec3 r{k.r, k.r, k.r};
      Box b;
      b.add(k.a - r), b.add(k.a + r), b.add(k.b - r), b.add(k.b + r);
      boxes_[triangles.size() + i] = b;
    }
    nodes_.clear();
    if (size() > 0) split(0, static_cast<std::int32_t>(size()));
  }

  // The first surface on the way from `c` to c + s d, for s below `until`.
  Hit first_hit(Vec3 c, Vec3 d, double until) const {
    Hit hit;
    hit.s = until;
    if (nodes_.empty()) return Hit{};
    // A ray within a face of a box: 0 times something huge bounds rightly, 0 times infinity not.
    auto inverted = [](double x) { return 1 / (x == 0 ? 1e-300 : x); };
    const Vec3 inverse{inverted(d.x), inverted(d.y), inverted(d.z)};
    std::array<std::int32_t, 64> stack;
    std::size_t top = 0;
    stack[top++] = 0;
    while (top > 0) {
      const std::int32_t at = stack[--top];
      const Node& node = nodes_[static_cast<std::size_t>(at)];
      if (!enters(node.box, c, inverse, hit.s)) continue;
      if (node.n == 0) {
        const std::int32_t near = at + 1, far = node.first;
        const bool is_swapped = component(d, node.axis) < 0;
        stack[top++] = is_swapped ? near : far;
        stack[top++] = is_swapped ? far : near;
        continue;
      }
      for (std::int32_t k = 0; k < node.n; ++k)
        test(order_[static_cast<std::size_t>(node.first + k)], c, d, hit);
    }
    return hit.owner < 0 ? Hit{} : hit;
  }

 private:
  struct Node {
    Box box;
    std::int32_t first;  // of its surfaces, or its second child: the first one follows it
    std::int32_t n;      // of surfaces, 0 for a node with children
    std::int32_t axis;
  };

  static double component(Vec3 p, int axis) { return axis == 0 ? p.x : axis == 1 ? p.y : p.z; }

  void test(std::int32_t i, Vec3 c, Vec3 d, Hit& hit) const {
    const auto n = static_cast<std::int32_t>(triangles.size());
    if (i < n) {
      const Triangle& t = triangles[static_cast<std::size_t>(i)];
      hit.keep(t.meet(c, d), t.owner);
    } else {
      const Capsule& k = capsules[static_cast<std::size_t>(i - n)];
      hit.keep(k.meet(c, d), k.owner);
    }
  }

  // Never refuses a box that the ray touches: the margin outweighs the rounding.
  static bool enters(const Box& b, Vec3 c, Vec3 inverse, double until) {
    double from = 0, to = until;
    for (int k = 0; k < 3; ++k) {
      const double o = component(c, k), i = component(inverse, k);
      const double s = (component(b.low, k) - o) * i, t = (component(b.high, k) - o) * i;
      from = std::max(from, std::min(s, t)), to = std::min(to, std::max(s, t));
    }
    return from <= to + 1e-12 * (1 + std::abs(to));
  }

  // Halves by the median of the longest axis of the middles; at most four surfaces in a leaf.
  std::int32_t split(std::int32_t first, std::int32_t last) {
    const auto at = static_cast<std::int32_t>(nodes_.size());
    Box box, middles;
    for (std::int32_t k = first; k < last; ++k) {
      const Box& b = boxes_[static_cast<std::size_t>(order_[static_cast<std::size_t>(k)])];
      box.add(b), middles.add(b.middle());
    }
    nodes_.push_back({box, first, last - first, 0});
    if (last - first <= 4) return at;
    const Vec3 size = middles.high - middles.low;
    const int axis = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
    const std::int32_t half = (first + last) / 2;
    std::nth_element(order_.begin() + first, order_.begin() + half, order_.begin() + last,
                     [&](std::int32_t i, std::int32_t j) {
                       const double a = component(boxes_[static_cast<std::size_t>(i)].middle(), axis);
                       const double b = component(boxes_[static_cast<std::size_t>(j)].middle(), axis);
                       return a < b || (a == b && i < j);
                     });
    split(first, half);
    const std::int32_t second = split(half, last);
    nodes_[static_cast<std::size_t>(at)].first = second;
    nodes_[static_cast<std::size_t>(at)].n = 0;
    nodes_[static_cast<std::size_t>(at)].axis = axis;
    return at;
  }

  std::vector<std::int32_t> order_;
  std::vector<Box> boxes_;
  std::vector<Node> nodes_;
};

}  // namespace asterism
