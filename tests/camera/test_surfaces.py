"""What hides what: rays against oracles, the z-buffer and the painter against rays."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.path import Path as Outline

import asterism as am
from tests.camera.meshes import SIZE, SQUARE, K, camera, cloud, triangles_of
from tests.references.cameras import capsule_entry, first_triangle


@pytest.mark.parametrize("seed", range(6))
def test_triangles_hide_as_the_oracle_says(seed):
    rng = np.random.default_rng(seed)
    corners = triangles_of(rng, rng.integers(1, 40))
    points = cloud(rng, 300)
    c = camera()
    as_polygons = c.project(points, [am.camera.Polygon(corners=t) for t in corners])
    mesh = am.camera.Mesh(
        vertices=corners.reshape(-1, 3), faces=np.arange(3 * len(corners)).reshape(-1, 3)
    )
    as_mesh = c.project(points, [mesh])
    expected = np.array([first_triangle(c.center, p, corners) for p in points])
    in_image = np.isin(as_polygons.reason, (am.camera.Reason.VISIBLE, am.camera.Reason.OCCLUDED))
    assert (expected[in_image] >= 0).any()
    np.testing.assert_array_equal(as_polygons.occluded_by[in_image], expected[in_image])
    np.testing.assert_array_equal(
        as_polygons.reason == am.camera.Reason.OCCLUDED, as_polygons.occluded_by >= 0
    )
    np.testing.assert_array_equal(as_mesh.occluded_by[in_image], np.minimum(expected[in_image], 0))


@pytest.mark.parametrize("far_away", [0.0, 1e3, 1e5])
def test_a_thousand_triangles_far_from_the_origin(far_away):
    # The tree of boxes works in single precision: it may cost time, never a hit.
    rng = np.random.default_rng(9)
    corners = triangles_of(rng, 1000, size=0.05)
    points = cloud(rng, 40)
    shift = np.array([far_away, -far_away, far_away])
    stand, target = shift + np.array([0.0, -4.0, 1.0]), shift + np.array([0.0, 0.0, 1.0])
    c = am.Camera.look_at(stand, target, K=K, size_px=SIZE)
    found = c.project(points + shift, [am.camera.Polygon(corners=t + shift) for t in corners])
    expected = [first_triangle(c.center, p + shift, corners + shift) for p in points]
    in_image = np.isin(found.reason, (am.camera.Reason.VISIBLE, am.camera.Reason.OCCLUDED))
    np.testing.assert_array_equal(found.occluded_by[in_image], np.array(expected)[in_image])


def star(n, rng):
    angles = np.sort(rng.uniform(0, 2 * np.pi, n))
    gaps = np.diff(np.append(angles, angles[0] + 2 * np.pi))
    if gaps.max() > 3:  # the centre must be inside
        angles = 2 * np.pi * np.arange(n) / n
    r = rng.uniform(0.3, 1.5, n)
    return np.column_stack([r * np.cos(angles), r * np.sin(angles)])


@pytest.mark.parametrize("seed", range(25))
def test_concave_polygons_hide_what_lies_within_their_outline(seed):
    rng = np.random.default_rng(seed)
    outline = star(int(rng.integers(3, 15)), rng)
    corners = np.column_stack([outline[:, 0], np.zeros(len(outline)), 1 + outline[:, 1]])
    c = camera()
    on_plane = rng.uniform(-1.4, 1.4, (400, 2))
    targets = np.column_stack([on_plane[:, 0], np.zeros(400), 1 + on_plane[:, 1]])
    points = c.center + 1.5 * (targets - c.center)
    found = c.project(points, [am.camera.Polygon(corners=corners)])
    inside = Outline(outline).contains_points(on_plane)
    in_image = np.isin(found.reason, (am.camera.Reason.VISIBLE, am.camera.Reason.OCCLUDED))
    np.testing.assert_array_equal((found.occluded_by == 0)[in_image], inside[in_image])
    before = c.project(c.center + 0.9 * (targets - c.center), [am.camera.Polygon(corners=corners)])
    assert (before.occluded_by == -1).all()


def test_a_polygon_in_the_shape_of_a_u_lets_points_through_its_gap():
    u = [[-1, 0], [1, 0], [1, 2], [0.5, 2], [0.5, 0.5], [-0.5, 0.5], [-0.5, 2], [-1, 2]]
    curtain = am.camera.Polygon(corners=[[x, 0, z] for x, z in u], name="u")
    behind = camera().project(
        [[0, 0.01, 1.5], [0.75, 0.01, 1.5], [0, 0.01, 0.25], [0.75, -0.01, 1.5]], [curtain]
    )
    assert behind.occluded_by.tolist() == [-1, 0, 0, -1]


@pytest.mark.parametrize("seed", range(8))
def test_capsules_hide_as_marching_says(seed):
    rng = np.random.default_rng(seed)
    c = camera()
    capsules = [am.camera.Capsule(ends=cloud(rng, 2), radius=r) for r in (0.3, 0.15)]
    capsules.append(am.camera.Capsule(ends=np.tile(cloud(rng, 1), (2, 1)), radius=0.4))  # a ball
    points = cloud(rng, 60)
    found = c.project(points, capsules)
    for p, who, reason in zip(points, found.occluded_by, found.reason, strict=True):
        if reason not in (am.camera.Reason.VISIBLE, am.camera.Reason.OCCLUDED):
            continue
        entries = [
            capsule_entry(c.center, p - c.center, k.ends[0], k.radius, 1.0) for k in capsules
        ]
        nearest = int(np.argmin(entries))
        gap = np.abs(np.sort(entries)[0] - 1)
        assert who == (nearest if entries[nearest] < 1 - 1e-6 else -1) or gap < 1e-5


def test_markers_lie_on_the_skin_of_a_capsule():
    capsule = am.camera.Capsule(ends=[[0, 0, 0.5], [0, 0, 1.5]], radius=0.2)
    angles = 2 * np.pi * np.arange(16) / 16
    on_skin = np.column_stack([0.2 * np.cos(angles), 0.2 * np.sin(angles), np.full(16, 1.0)])
    found = camera().project(on_skin, [capsule])
    faces_us = (on_skin[:, :2] @ [0, -1]) > 0.2 * 0.2 / 4.0  # above the tangent from 4 m away
    np.testing.assert_array_equal(found.visible, faces_us)


def test_no_ray_slips_through_the_seams_of_a_mesh():
    n = 12
    x, z = np.meshgrid(np.linspace(-1, 1, n), np.linspace(0, 2, n))
    rng = np.random.default_rng(0)
    vertices = np.column_stack([x.ravel(), rng.normal(0, 0.05, n * n), z.ravel()])
    i = np.arange(n * n).reshape(n, n)
    quads = np.stack([i[:-1, :-1], i[1:, :-1], i[1:, 1:], i[:-1, 1:]], axis=-1).reshape(-1, 4)
    faces = np.concatenate([quads[:, :3], quads[:, [0, 2, 3]]])
    mesh = am.camera.Mesh(vertices=vertices, faces=faces)
    edges = faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    s = rng.uniform(size=(len(edges), 1))
    on_seams = vertices[edges[:, 0]] * (1 - s) + vertices[edges[:, 1]] * s
    inner = (np.abs(on_seams[:, 0]) < 0.99) & (np.abs(on_seams[:, 2] - 1) < 0.99)
    c = camera()
    for targets in (on_seams[inner], vertices[i[1:-1, 1:-1].ravel()]):
        found = c.project(c.center + 1.3 * (targets - c.center), [mesh])
        seen = np.isin(found.reason, (am.camera.Reason.VISIBLE, am.camera.Reason.OCCLUDED))
        assert (found.occluded_by[seen] == 0).all()


def test_surfaces_that_move_equal_those_that_stand_frame_by_frame():
    rng = np.random.default_rng(4)
    T = 12
    points = rng.uniform([-1, -1, 0], [1, 2, 2], (T, 100, 3))
    shift = rng.normal(0, 0.3, (T, 1, 3))
    base = triangles_of(rng, 8, size=0.2)
    wall = am.camera.Polygon(corners=[[-1, -1, 0], [0, -1, 0], [0, -1, 1]])
    moving = [
        wall,
        am.camera.Mesh(vertices=base.reshape(-1, 3) + shift, faces=np.arange(24).reshape(-1, 3)),
        am.camera.Polygon(corners=base[0] + [0.1, -0.1, 0] + shift),
        am.camera.Capsule(ends=rng.normal(size=(2, 3)) + shift, radius=0.2),
    ]
    rig = am.Rig((camera(), camera(position=(3.0, -2.0, 2.0))))
    together = rig.project(points, moving)
    for t in range(T):
        standing = [
            wall,
            am.camera.Mesh(vertices=moving[1].vertices[t], faces=moving[1].faces),
            am.camera.Polygon(corners=moving[2].corners[t]),
            am.camera.Capsule(ends=moving[3].ends[t], radius=0.2),
        ]
        alone = rig.project(points[t], standing)
        np.testing.assert_array_equal(together.occluded_by[:, t], alone.occluded_by)
        np.testing.assert_array_equal(together.reason[:, t], alone.reason)
        image = rig[0].depth_image(moving, moment=t)
        np.testing.assert_array_equal(image.surface, rig[0].depth_image(standing).surface)
    assert set(np.unique(together.occluded_by)) == {-1, 0, 1, 2, 3}


def test_of_two_surfaces_at_one_place_the_first_is_named():
    rng = np.random.default_rng(8)
    wall = am.camera.Polygon(corners=[[-1, 0, 0], [1, 0, 0], [0, 0, 2.0]])
    ball = am.camera.Capsule(ends=[[0, 2, 1], [0, 2, 1]], radius=0.5)
    others = [am.camera.Polygon(corners=t + np.array([0, 9, 0])) for t in triangles_of(rng, 20)]
    surfaces = [*others[:10], wall, wall, ball, ball, *others[10:], wall, ball]
    points = [[0.1, 0.5, 1], [0.0, 4, 1.0]]
    assert camera().project(points, surfaces).occluded_by.tolist() == [10, 10]
    without = [s for s in surfaces if s is not wall]
    assert camera().project(points, without).occluded_by.tolist() == [-1, 10]
    named = np.unique(camera().depth_image(surfaces).surface)
    assert not set(named) & {11, 13, 24, 25}


def test_a_surface_around_the_camera_hides_everything():
    c = camera()
    ball = am.camera.Capsule(ends=np.tile(c.center, (2, 1)), radius=0.1)
    found = c.project([[0, 0, 1], [0, 0.5, 1.2]], [ball])
    assert (found.reason == am.camera.Reason.OCCLUDED).all()
    image = c.depth_image([ball])
    np.testing.assert_array_equal(image.surface, 0)
    assert image.depth.min() > 0


def test_a_floor_that_passes_under_the_camera():
    floor = am.camera.Polygon(corners=[[-50, -50, 0], [50, -50, 0], [50, 50, 0], [-50, 50, 0]])
    c = camera()
    image = c.depth_image([floor])
    below = np.arange(SIZE[1]) > K[1, 2] + 300 * 1 / 50  # rays that reach the floor before its end
    np.testing.assert_array_equal(image.surface[below], 0)
    np.testing.assert_array_equal(image.surface[~below][:-7], -1)
    row = SIZE[1] - 1
    np.testing.assert_allclose(image.depth[row], 300 / (row - K[1, 2]), rtol=1e-12)
    occluded = c.project([[0, 2, -0.5], [0, 2, 0.5]], [floor])
    assert occluded.occluded_by.tolist() == [0, -1]


def test_edge_on_hides_nothing_and_both_sides_hide():
    c = camera()
    edge_on = am.camera.Polygon(corners=[[0, -1, 0], [0, 1, 0], [0, 1, 2], [0, -1, 2]])
    assert c.project([[0.001, 0.5, 1], [-0.001, 0.5, 1]], [edge_on]).visible.all()
    corners = np.array([[-1, 0, 0], [1, 0, 0], [0, 0, 2.0]])
    for one in (corners, corners[::-1]):
        assert c.project([0, 1, 1], [am.camera.Polygon(corners=one)]).occluded_by == 0


def test_clearance():
    wall = am.camera.Polygon(corners=[[-1, 0, 0], [1, 0, 0], [0, 0, 2.0]])
    just_behind = [0, 0.01, 1]
    assert camera().project(just_behind, [wall]).occluded_by == 0
    assert camera().project(just_behind, [wall], clearance=0.02).visible


MOVING = am.camera.Polygon(corners=np.stack([SQUARE] * 4))
BAD = [
    (lambda: am.camera.Polygon(corners=SQUARE[:2]), "at least 3"),
    (lambda: am.camera.Polygon(corners=SQUARE + 0.01 * np.eye(4)[:, 3:] * [0, 1, 0]), "plane"),
    (lambda: am.camera.Polygon(corners=SQUARE[[0, 1, 3, 2]]), "area|cross"),
    (lambda: am.camera.Polygon(corners=[[0, 0, 0], [2, 0, 2], [2, 0, 0], [0, 0, 1]]), "cross"),
    (lambda: am.camera.Polygon(corners=[[0, 0, 0], [1, 0, 0], [2, 0, 0]]), "area"),
    (lambda: am.camera.Polygon(corners=np.zeros((4, 3))), "area"),
    (lambda: am.camera.Polygon(corners=SQUARE * np.nan), "finite"),
    (lambda: am.camera.Polygon(corners=SQUARE[:, :2]), "shape"),
    (lambda: am.camera.Polygon(corners=np.stack([SQUARE, SQUARE * 0])), "area.*moment 1"),
    (lambda: am.camera.Polygon(corners=np.empty((0, 4, 3))), "moment"),
    (lambda: am.camera.Mesh(vertices=SQUARE, faces=[[0, 1, 4]]), "face 0"),
    (lambda: am.camera.Mesh(vertices=SQUARE, faces=[[0, 1, -1]]), "faces"),
    (lambda: am.camera.Mesh(vertices=SQUARE, faces=[[0.5, 1, 2]]), "faces"),
    (lambda: am.camera.Mesh(vertices=SQUARE, faces=[[0, 1]]), "shape"),
    (lambda: am.camera.Capsule(ends=SQUARE[:2], radius=0.0), "radius"),
    (lambda: am.camera.Capsule(ends=SQUARE[:3], radius=1.0), "shape"),
    (lambda: am.camera.Capsule(ends=SQUARE[:2] + np.inf, radius=1.0), "finite"),
    (lambda: camera().project([0, 0, 0], ["wall"]), r"surfaces\[0\]"),
    (
        lambda: camera().project(np.zeros((5, 2, 3)), [MOVING]),
        "5 moments",
    ),
    (
        lambda: camera().project(np.zeros(3), [MOVING]),
        "one moment",
    ),
    (lambda: camera().depth_image([am.camera.Polygon(corners=SQUARE)], moment=1), "moment"),
    (lambda: camera().paint([am.camera.Capsule(ends=SQUARE[:2], radius=0.1)]), "flat faces"),
]


@pytest.mark.parametrize(("make", "word"), BAD)
def test_bad_surfaces_are_told(make, word):
    with pytest.raises(am.ParameterError, match=word):
        make()
