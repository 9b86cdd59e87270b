// Bindings of cameras, occluding surfaces and depth images.
#include <nanobind/stl/array.h>
#include <nanobind/stl/vector.h>

#include "camera/z_buffer.hpp"
#include "python/arrays.hpp"
#include "python/bindings.hpp"

using namespace nb::literals;
using namespace asterism;

namespace {

using Rows = In<double>;

std::size_t rows(const Rows& array, std::size_t columns, const char* what) {
  require(array.ndim() == 2 && array.shape(1) == columns, what);
  return array.shape(0);
}

Affine2 affine(const Rows& m) {
  require(rows(m, 3, "an affine map: shape (2, 3)") == 2, "an affine map: shape (2, 3)");
  const double* const p = m.data();
  return {p[0], p[1], p[2], p[3], p[4], p[5]};
}

template <typename T>
std::vector<T> copied(const In<T>& array) {
  return {array.data(), array.data() + array.size()};
}

Vec3 vec3(const double* p) { return {p[0], p[1], p[2]}; }

// Triangles and capsules of a static scene (one moment) or of a moving one.
struct Surfaces {
  std::size_t n_moments, n_vertices, n_capsules;
  std::vector<double> vertices, ends, radii;
  std::vector<std::int32_t> faces, face_owners, capsule_owners;

  Surfaces(const In<double>& vertices_, const In<std::int32_t>& faces_,
           const In<std::int32_t>& face_owners_, const In<double>& ends_, const In<double>& radii_,
           const In<std::int32_t>& capsule_owners_)
      : vertices(copied(vertices_)),
        ends(copied(ends_)),
        radii(copied(radii_)),
        faces(copied(faces_)),
        face_owners(copied(face_owners_)),
        capsule_owners(copied(capsule_owners_)) {
    require(vertices_.ndim() == 3 && vertices_.shape(2) == 3, "vertices: shape (moments, V, 3)");
    require(faces_.ndim() == 2 && faces_.shape(1) == 3, "faces: shape (F, 3)");
    require(face_owners_.size() == faces_.shape(0), "face_owners: shape (F,)");
    require(ends_.ndim() == 4 && ends_.shape(0) == vertices_.shape(0) && ends_.shape(2) == 2 &&
                ends_.shape(3) == 3,
            "ends: shape (moments, M, 2, 3)");
    require(radii_.size() == ends_.shape(1) && capsule_owners_.size() == ends_.shape(1),
            "radii and capsule_owners: shape (M,)");
    n_moments = vertices_.shape(0), n_vertices = vertices_.shape(1), n_capsules = ends_.shape(1);
    for (const std::int32_t i : faces)
      require(i >= 0 && static_cast<std::size_t>(i) < n_vertices, "faces: indices of vertices");
  }

  // The surfaces at a moment, with every point transformed by `place`.
  template <typename Place>
  Scene at(std::size_t moment, const Place& place) const {
    Scene scene;
    const double* const v = vertices.data() + moment * n_vertices * 3;
    for (std::size_t f = 0; f < face_owners.size(); ++f) {
      auto corner = [&](std::size_t k) { return place(vec3(v + 3 * static_cast<std::size_t>(faces[3 * f + k]))); };
      scene.triangles.push_back({corner(0), corner(1), corner(2), face_owners[f]});
    }
    const double* const e = ends.data() + moment * n_capsules * 6;
    for (std::size_t k = 0; k < n_capsules; ++k)
      scene.capsules.push_back({place(vec3(e + 6 * k)), place(vec3(e + 6 * k + 3)), radii[k], capsule_owners[k]});
    return scene;
  }
};

Scene standing(const Surfaces& surfaces, std::size_t moment) {
  Scene scene = surfaces.at(moment, [](Vec3 p) { return p; });
  scene.build();
  return scene;
}

// Projects points (T, K, 3) through every camera, with occlusion by static and moving surfaces.
nb::tuple project(const std::vector<const Camera*>& cameras, const In<double>& points,
                  const std::vector<const Surfaces*>& surfaces, double clearance) {
  require(points.ndim() == 3 && points.shape(2) == 3, "points: shape (T, K, 3)");
  const std::size_t C = cameras.size(), T = points.shape(0), K = points.shape(1), n = T * K;
  for (const Surfaces* s : surfaces)
    require(s->n_moments == 1 || s->n_moments == T, "surfaces: one moment or T");
  Owned<double> pixels(C * n * 2), depth(C * n);
  std::vector<Reason> reason(C * n);
  std::vector<std::int32_t> occluded_by(C * n, -1);
  {
    nb::gil_scoped_release release;
    std::vector<Vec3> centers;
    for (std::size_t c = 0; c < C; ++c) {
      cameras[c]->project({points.data(), 3 * n}, {pixels.data.get() + 2 * c * n, 2 * n},
                          {depth.data.get() + c * n, n}, {reason.data() + c * n, n});
      centers.push_back(cameras[c]->center());
    }
    std::vector<Scene> scenes(surfaces.size());
    for (std::size_t t = 0; t < T && !surfaces.empty(); ++t) {
      for (std::size_t i = 0; i < surfaces.size(); ++i)
        if (t == 0 || surfaces[i]->n_moments > 1) scenes[i] = standing(*surfaces[i], t);
      for (std::size_t c = 0; c < C; ++c)
        for (std::size_t k = t * K; k < (t + 1) * K; ++k) {
          if (reason[c * n + k] != Reason::visible) continue;
          const Vec3 d = vec3(points.data() + 3 * k) - centers[c];
          const double until = 1 - clearance / std::sqrt(dot(d, d));
          Hit first;
          for (const Scene& scene : scenes)
            if (const Hit hit = scene.first_hit(centers[c], d, until); hit.owner >= 0) first.keep(hit.s, hit.owner);
          if (first.owner < 0) continue;
          reason[c * n + k] = Reason::occluded;
          occluded_by[c * n + k] = first.owner;
        }
    }
  }
  return nb::make_tuple(pixels.give({C, T, K, 2}), depth.give({C, T, K}),
                        array_of<std::uint8_t>(reason, {C, T, K}),
                        array_of<std::int32_t>(occluded_by, {C, T, K}));
}

nb::tuple give_image(const RayGrid& grid, const auto& draw) {
  const auto w = static_cast<std::size_t>(grid.width()), h = static_cast<std::size_t>(grid.height());
  Owned<double> depth(w * h);
  Owned<std::int32_t> owner(w * h);
  {
    nb::gil_scoped_release release;
    const DepthImage image{{depth.data.get(), w * h}, {owner.data.get(), w * h}};
    image.begin();
    draw(image);
    image.end();
  }
  return nb::make_tuple(depth.give({h, w}), owner.give({h, w}));
}

nb::tuple depth_image(const RayGrid& grid, const Camera& camera,
                      const std::vector<const Surfaces*>& surfaces, std::size_t moment) {
  for (const Surfaces* s : surfaces)
    require(s->n_moments == 1 || moment < s->n_moments, "moment: one that the surfaces have");
  return give_image(grid, [&](DepthImage image) {
    for (const Surfaces* s : surfaces) {
      const Scene scene = s->at(s->n_moments > 1 ? moment : 0, [&](Vec3 p) { return camera.to_camera(p); });
      grid.draw_nearest(scene.triangles, scene.capsules, image);
    }
  });
}

// Draws triangles (F, 3, 3) in camera coordinates in the given order.
nb::tuple paint(const RayGrid& grid, const In<double>& corners, const In<std::int32_t>& owners) {
  require(corners.ndim() == 3 && corners.shape(1) == 3 && corners.shape(2) == 3 &&
              owners.size() == corners.shape(0),
          "corners: shape (F, 3, 3), owners: shape (F,)");
  std::vector<Triangle> triangles;
  for (std::size_t f = 0; f < owners.size(); ++f) {
    const double* const p = corners.data() + 9 * f;
    triangles.push_back({vec3(p), vec3(p + 3), vec3(p + 6), owners.data()[f]});
  }
  return give_image(grid, [&](DepthImage image) { grid.paint(triangles, image); });
}

// Applies a map between image and normalised plane to points.
template <void (Camera::*map)(std::span<const double>, std::span<double>) const>
Out<double> mapped(const Camera& camera, const Rows& points) {
  const std::size_t n = rows(points, 2, "points: shape (n, 2)");
  Owned<double> out(2 * n);
  (camera.*map)(flat(points), {out.data.get(), 2 * n});
  return out.give({n, 2});
}

Out<double> jacobian(const Camera& camera, const Rows& points) {
  const std::size_t n = rows(points, 3, "points: shape (n, 3)");
  Owned<double> J(6 * n);
  for (std::size_t i = 0; i < n; ++i) {
    const std::array<double, 6> j = camera.jacobian(vec3(points.data() + 3 * i));
    std::copy(j.begin(), j.end(), J.data.get() + 6 * i);
  }
  return J.give({n, 2, 3});
}

}  // namespace

void bind_camera(nb::module_& module) {
  nb::enum_<Lens::Kind>(module, "LensKind")
      .value("none", Lens::Kind::none)
      .value("radial", Lens::Kind::radial)
      .value("quadratic", Lens::Kind::quadratic);
  nb::class_<Camera>(module, "Camera")
      .def(
          "__init__",
          [](Camera* self, const Rows& R, const In<double>& t, const Rows& A, const Rows& B,
             Lens::Kind lens_kind, bool is_backward, const In<double>& coefficients, double r_end,
             double q_table, std::array<double, 2> start, double near, double far,
             std::int32_t width, std::int32_t height) {
            require(rows(R, 3, "R: shape (3, 3)") == 3 && t.size() == 3, "R: (3, 3), t: (3,)");
            const std::size_t needed[] = {0, 5, 10};
            require(coefficients.size() == needed[static_cast<int>(lens_kind)], "coefficients: as the kind needs");
            require(width > 0 && height > 0, "a size above 0");
            new (self) Camera(flat(R), flat(t), affine(A), affine(B),
                              Lens(lens_kind, is_backward, flat(coefficients), r_end, q_table,
                                   Plane{start[0], start[1]}),
                              near, far, width, height);
          },
          nb::kw_only(), "R"_a, "t"_a, "A"_a, "B"_a, "lens_kind"_a, "is_backward"_a,
          "coefficients"_a, "r_end"_a, "q_table"_a, "start"_a, "near"_a, "far"_a, "width"_a,
          "height"_a)
      .def("undistort", &mapped<&Camera::undistort>, "pixels"_a)
      .def("distort", &mapped<&Camera::distort>, "normalised"_a)
      .def("jacobian", &jacobian, "points"_a);

  nb::class_<Surfaces>(module, "Surfaces")
      .def(nb::init<const In<double>&, const In<std::int32_t>&, const In<std::int32_t>&,
                    const In<double>&, const In<double>&, const In<std::int32_t>&>(),
           nb::kw_only(), "vertices"_a, "faces"_a, "face_owners"_a, "ends"_a, "radii"_a,
           "capsule_owners"_a);

  nb::class_<RayGrid>(module, "RayGrid")
      .def(nb::init<const Camera&>(), "camera"_a, nb::call_guard<nb::gil_scoped_release>())
      .def("depth_image", &depth_image, "camera"_a, "surfaces"_a, "moment"_a)
      .def("paint", &paint, "corners"_a, "owners"_a);

  module.def("project", &project, "cameras"_a, "points"_a, "surfaces"_a, "clearance"_a);
}
