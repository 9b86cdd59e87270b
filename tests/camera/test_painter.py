"""The z-buffer and the painter against rays."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import asterism as am
from tests.camera.meshes import SIZE, SQUARE, camera, cloud, triangles_of

LENSES = [
    None,
    am.camera.BrownConrady(k1=-0.25, k2=0.08, p1=0.002),
    am.camera.ReportRadial(a1=-0.2),
]


def scene_of(rng, n=12):
    surfaces = [am.camera.Polygon(corners=t) for t in triangles_of(rng, n)]
    surfaces.append(am.camera.Capsule(ends=cloud(rng, 2), radius=0.25))
    surfaces.append(
        am.camera.Mesh(
            vertices=triangles_of(rng, 4).reshape(-1, 3), faces=np.arange(12).reshape(4, 3)
        )
    )
    return surfaces


@pytest.mark.parametrize("lens", LENSES, ids=repr)
@pytest.mark.parametrize("seed", range(4))
def test_the_z_buffer_is_exact_at_the_centre_of_every_pixel(lens, seed):
    c = camera(lens)
    surfaces = scene_of(np.random.default_rng(seed))
    image = c.depth_image(surfaces)
    pixels = np.stack(np.meshgrid(np.arange(SIZE[0]), np.arange(SIZE[1])), axis=-1)
    n = c.undistort(pixels)
    reached = np.isfinite(n).all(axis=-1)
    rays = (
        np.concatenate([n, np.ones((*n.shape[:-1], 1))], axis=-1)[reached]
        @ c.T_camera_world[:3, :3]
    )
    far = c.project(c.center + 50 * rays, surfaces)
    # Edges pass by some pixel centres within the rounding of another way to the same number.
    assert (far.occluded_by != image.surface[reached]).mean() < 1e-4
    met = np.isfinite(image.depth[reached])
    assert met.mean() > 0.1
    depth = image.depth[reached][met][:, None]
    just_before = c.project(c.center + (depth - 1e-3) * rays[met], surfaces)
    just_behind = c.project(c.center + (depth + 1e-3) * rays[met], surfaces)
    assert (just_before.occluded_by != -1).mean() < 1e-4
    assert (just_behind.occluded_by == -1).mean() < 1e-4
    assert (image.surface[~reached] == -1).all()


@pytest.mark.parametrize("lens", LENSES, ids=repr)
def test_the_z_buffer_hides_points_as_rays_do_away_from_edges(lens):
    rng = np.random.default_rng(11)
    c, surfaces = camera(lens), scene_of(rng)
    image = c.depth_image(surfaces)
    projection = c.project(cloud(rng, 4000), surfaces)
    exact = projection.reason == am.camera.Reason.OCCLUDED
    # Away from edges: all pixels around are of one surface, whose depth hardly changes.
    in_image = np.isin(projection.reason, (am.camera.Reason.VISIBLE, am.camera.Reason.OCCLUDED))
    v, u = np.rint(projection.pixels[in_image][:, ::-1]).astype(int).T
    inner = (u > 0) & (v > 0) & (u < SIZE[0] - 1) & (v < SIZE[1] - 1)
    around = np.array(
        [image.surface[v[inner] + i, u[inner] + j] for i in (-1, 0, 1) for j in (-1, 0, 1)]
    )
    depths = np.array(
        [image.depth[v[inner] + i, u[inner] + j] for i in (-1, 0, 1) for j in (-1, 0, 1)]
    )
    one = (around == around[0]).all(axis=0)
    spread = np.where(around[0] >= 0, depths.max(axis=0), 0) - np.where(
        around[0] >= 0, depths.min(axis=0), 0
    )
    margin = np.abs(projection.depth[in_image][inner] - depths[4]) > spread + 1e-6
    away = one & margin
    assert away.mean() > 0.7
    found = image.hides(projection)[in_image][inner]
    np.testing.assert_array_equal(found[away], exact[in_image][inner][away])


def bars(n=3, lift=0.3):
    """Bars around a centre, each over the next at one end and under the one before at the other."""
    result = []
    for k in range(n):
        a, b = 2 * np.pi * k / n, 2 * np.pi * (k + 1) / n
        p = np.array([np.cos(a), -lift, 1 + np.sin(a)])
        q = np.array([np.cos(b), lift, 1 + np.sin(b)])
        p, q = p - 0.25 * (q - p), q + 0.25 * (q - p)
        side = np.cross(q - p, [0, 1, 0])
        side *= 0.12 / np.linalg.norm(side)
        result.append(am.camera.Polygon(corners=[p - side, p + side, q + side, q - side]))
    return result


@pytest.mark.parametrize("lens", LENSES, ids=repr)
@pytest.mark.parametrize("n", [3, 4])
def test_the_painter_fails_on_a_cycle_and_says_so(lens, n):
    c = camera(lens)
    painting, truth = c.paint(bars(n)), c.depth_image(bars(n))
    assert [{face.surface for face in cycle} for cycle in painting.cycles] == [set(range(n))]
    wrong = painting.surface != truth.surface
    assert wrong.any()
    # any one bar less, and there is an order
    for k in range(n):
        rest = [b for i, b in enumerate(bars(n)) if i != k]
        painting, truth = c.paint(rest), c.depth_image(rest)
        assert painting.cycles == ()
        np.testing.assert_array_equal(painting.surface, truth.surface)
        np.testing.assert_array_equal(painting.depth, truth.depth)


def test_the_painter_reports_faces_that_pass_through_each_other():
    one = am.camera.Polygon(
        corners=[[-1, -0.5, 0.5], [1, 0.5, 0.5], [1, 0.5, 1.5], [-1, -0.5, 1.5]]
    )
    other = am.camera.Polygon(
        corners=[[-1, 0.5, 0.6], [1, -0.5, 0.6], [1, -0.5, 1.6], [-1, 0.5, 1.6]]
    )
    assert len(camera().paint([one, other]).cycles) == 1


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), n=st.integers(0, 14))
def test_the_painter_is_right_wherever_there_is_an_order(seed, n):
    rng = np.random.default_rng(seed)
    surfaces = [am.camera.Polygon(corners=t) for t in triangles_of(rng, n, size=0.3)]
    surfaces.append(
        am.camera.Mesh(
            vertices=triangles_of(rng, 2, size=0.3).reshape(-1, 3), faces=[[0, 1, 2], [3, 4, 5]]
        )
    )
    c = camera()
    painting, truth = c.paint(surfaces), c.depth_image(surfaces)
    assert sorted(painting.order) == sorted([(i, 0) for i in range(n)] + [(n, 0), (n, 1)])
    if not painting.cycles:
        np.testing.assert_array_equal(painting.surface, truth.surface)


def test_what_stands_behind_the_camera_hides_nothing():
    behind = am.camera.Polygon(corners=[[-9, -5, -9], [9, -5, -9], [0, -5, 9]])
    before = am.camera.Polygon(corners=[[0.5, -5, 0], [0.5, 3, 0], [0.5, 3, 2]])
    for surfaces in ([behind], [behind, before]):
        found = camera().project([[0, 0, 1], [-0.5, 1, 0.5]], surfaces)
        assert found.visible.all()
        assert (camera().depth_image(surfaces).surface != 0).all()


def test_a_polygon_that_bends_while_moving_is_refused():
    arrow = np.array([[0, 0, 0], [1, 0, 1], [0, 0, 2], [0.4, 0, 1.0]])
    inside_out = arrow.copy()
    inside_out[
        3, 0
    ] = -0.5  # the notch becomes a corner: the triangles chosen first do not cover it
    am.camera.Polygon(corners=np.stack([arrow, arrow + 1]))
    with pytest.raises(am.ParameterError, match=r"turned over"):
        am.camera.Polygon(corners=np.stack([inside_out, arrow]))


def test_too_many_faces_for_the_painter():
    faces = np.tile([[0, 1, 2]], (2001, 1))
    with pytest.raises(am.SolverLimit, match="2001"):
        camera().paint([am.camera.Mesh(vertices=SQUARE, faces=faces)])
