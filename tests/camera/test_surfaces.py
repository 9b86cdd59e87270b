"""What hides what: rays against oracles, the z-buffer and the painter against rays."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from matplotlib.path import Path as Outline

import asterism as am
from tests.references.cameras import capsule_entry, first_triangle

K = am.camera.intrinsics(focal_length=300.0, principal_point=(159.5, 119.5))
SIZE = (320, 240)
LENSES = [
    None,
    am.camera.BrownConrady(k1=-0.25, k2=0.08, p1=0.002),
    am.camera.ReportRadial(a1=-0.2),
]


def camera(lens=None, position=(0.0, -4.0, 1.0)):
    return am.Camera.look_at(position, (0.0, 0.0, 1.0), K=K, size_px=SIZE, lens=lens)


def cloud(rng, n):
    return rng.uniform([-1.5, -1.5, -0.5], [1.5, 1.5, 2.5], (n, 3))


def triangles_of(rng, n, size=0.6):
    return cloud(rng, n)[:, None] + rng.normal(0, size, (n, 3, 3))


def loose_mesh(triangles):
    faces = np.arange(3 * len(triangles)).reshape(-1, 3)
    return am.camera.Mesh(vertices=triangles.reshape(-1, 3), faces=faces)


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
    in_image = np.isin(as_polygons.reason, (am.camera.Reason.VISIBLE, am.camera.Reason.HIDDEN))
    assert (expected[in_image] >= 0).any()
    np.testing.assert_array_equal(as_polygons.hidden_by[in_image], expected[in_image])
    np.testing.assert_array_equal(
        as_polygons.reason == am.camera.Reason.HIDDEN, as_polygons.hidden_by >= 0
    )
    np.testing.assert_array_equal(as_mesh.hidden_by[in_image], np.minimum(expected[in_image], 0))


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
    in_image = np.isin(found.reason, (am.camera.Reason.VISIBLE, am.camera.Reason.HIDDEN))
    np.testing.assert_array_equal(found.hidden_by[in_image], np.array(expected)[in_image])


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
    in_image = np.isin(found.reason, (am.camera.Reason.VISIBLE, am.camera.Reason.HIDDEN))
    np.testing.assert_array_equal((found.hidden_by == 0)[in_image], inside[in_image])
    before = c.project(c.center + 0.9 * (targets - c.center), [am.camera.Polygon(corners=corners)])
    assert (before.hidden_by == -1).all()


def test_a_polygon_in_the_shape_of_a_u_lets_points_through_its_gap():
    u = [[-1, 0], [1, 0], [1, 2], [0.5, 2], [0.5, 0.5], [-0.5, 0.5], [-0.5, 2], [-1, 2]]
    curtain = am.camera.Polygon(corners=[[x, 0, z] for x, z in u], name="u")
    behind = camera().project(
        [[0, 0.01, 1.5], [0.75, 0.01, 1.5], [0, 0.01, 0.25], [0.75, -0.01, 1.5]], [curtain]
    )
    assert behind.hidden_by.tolist() == [-1, 0, 0, -1]


@pytest.mark.parametrize("seed", range(8))
def test_capsules_hide_as_marching_says(seed):
    rng = np.random.default_rng(seed)
    c = camera()
    capsules = [am.camera.Capsule(ends=cloud(rng, 2), radius=r) for r in (0.3, 0.15)]
    capsules.append(am.camera.Capsule(ends=np.tile(cloud(rng, 1), (2, 1)), radius=0.4))  # a ball
    points = cloud(rng, 60)
    found = c.project(points, capsules)
    for p, who, reason in zip(points, found.hidden_by, found.reason, strict=True):
        if reason not in (am.camera.Reason.VISIBLE, am.camera.Reason.HIDDEN):
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
        seen = np.isin(found.reason, (am.camera.Reason.VISIBLE, am.camera.Reason.HIDDEN))
        assert (found.hidden_by[seen] == 0).all()


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
        np.testing.assert_array_equal(together.hidden_by[:, t], alone.hidden_by)
        np.testing.assert_array_equal(together.reason[:, t], alone.reason)
        image = rig[0].depth_image(moving, moment=t)
        np.testing.assert_array_equal(image.surface, rig[0].depth_image(standing).surface)
    assert set(np.unique(together.hidden_by)) == {-1, 0, 1, 2, 3}


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
    assert (far.hidden_by != image.surface[reached]).mean() < 1e-4
    met = np.isfinite(image.depth[reached])
    assert met.mean() > 0.1
    depth = image.depth[reached][met][:, None]
    just_before = c.project(c.center + (depth - 1e-3) * rays[met], surfaces)
    just_behind = c.project(c.center + (depth + 1e-3) * rays[met], surfaces)
    assert (just_before.hidden_by != -1).mean() < 1e-4
    assert (just_behind.hidden_by == -1).mean() < 1e-4
    assert (image.surface[~reached] == -1).all()


@pytest.mark.parametrize("lens", LENSES, ids=repr)
def test_the_z_buffer_hides_points_as_rays_do_away_from_edges(lens):
    rng = np.random.default_rng(11)
    c, surfaces = camera(lens), scene_of(rng)
    image = c.depth_image(surfaces)
    projection = c.project(cloud(rng, 4000), surfaces)
    exact = projection.reason == am.camera.Reason.HIDDEN
    # Away from edges: all pixels around are of one surface, whose depth hardly changes.
    in_image = np.isin(projection.reason, (am.camera.Reason.VISIBLE, am.camera.Reason.HIDDEN))
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


def test_the_painter_tells_of_faces_that_pass_through_each_other():
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


def test_of_two_surfaces_at_one_place_the_first_is_named():
    rng = np.random.default_rng(8)
    wall = am.camera.Polygon(corners=[[-1, 0, 0], [1, 0, 0], [0, 0, 2.0]])
    ball = am.camera.Capsule(ends=[[0, 2, 1], [0, 2, 1]], radius=0.5)
    others = [am.camera.Polygon(corners=t + np.array([0, 9, 0])) for t in triangles_of(rng, 20)]
    surfaces = [*others[:10], wall, wall, ball, ball, *others[10:], wall, ball]
    points = [[0.1, 0.5, 1], [0.0, 4, 1.0]]
    assert camera().project(points, surfaces).hidden_by.tolist() == [10, 10]
    without = [s for s in surfaces if s is not wall]
    assert camera().project(points, without).hidden_by.tolist() == [-1, 10]
    named = np.unique(camera().depth_image(surfaces).surface)
    assert not set(named) & {11, 13, 24, 25}


def test_a_surface_around_the_camera_hides_everything():
    c = camera()
    ball = am.camera.Capsule(ends=np.tile(c.center, (2, 1)), radius=0.1)
    found = c.project([[0, 0, 1], [0, 0.5, 1.2]], [ball])
    assert (found.reason == am.camera.Reason.HIDDEN).all()
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
    hidden = c.project([[0, 2, -0.5], [0, 2, 0.5]], [floor])
    assert hidden.hidden_by.tolist() == [0, -1]


def test_edge_on_hides_nothing_and_both_sides_hide():
    c = camera()
    edge_on = am.camera.Polygon(corners=[[0, -1, 0], [0, 1, 0], [0, 1, 2], [0, -1, 2]])
    assert c.project([[0.001, 0.5, 1], [-0.001, 0.5, 1]], [edge_on]).visible.all()
    corners = np.array([[-1, 0, 0], [1, 0, 0], [0, 0, 2.0]])
    for one in (corners, corners[::-1]):
        assert c.project([0, 1, 1], [am.camera.Polygon(corners=one)]).hidden_by == 0


def test_clearance():
    wall = am.camera.Polygon(corners=[[-1, 0, 0], [1, 0, 0], [0, 0, 2.0]])
    just_behind = [0, 0.01, 1]
    assert camera().project(just_behind, [wall]).hidden_by == 0
    assert camera().project(just_behind, [wall], clearance=0.02).visible


SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 0, 1], [0, 0, 1.0]])


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
