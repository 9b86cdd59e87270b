"""One camera and many: what is seen, why not, and bad input."""

from __future__ import annotations

import math

import numpy as np
import pytest

import asterism as am
from tests.references.cameras import random_pose

K = am.camera.intrinsics(focal_length=800.0, principal_point=(639.5, 511.5))
SIZE = (1280, 1024)


def camera(**changes):
    options = {"K": K, "size_px": SIZE}
    return am.Camera.look_at((0.0, -4.0, 1.0), (0.0, 0.0, 1.0), **(options | changes))


REASONS = [
    ((0, 0, 1), am.camera.Reason.VISIBLE, "on the axis"),
    ((np.nan, 0, 1), am.camera.Reason.ABSENT, "one coordinate missing"),
    ((np.nan, np.nan, np.nan), am.camera.Reason.ABSENT, "all missing"),
    ((np.inf, 0, 1), am.camera.Reason.ABSENT, "nowhere"),
    ((0, -4.5, 1), am.camera.Reason.BEHIND, "behind"),
    ((0, -4, 1), am.camera.Reason.BEHIND, "at the optical centre"),
    ((0, -4, 3), am.camera.Reason.BEHIND, "in the plane of the camera"),
    ((0, -3.6, 1), am.camera.Reason.NEAR, "nearer than 0.5 m"),
    ((5, -3.6, 1), am.camera.Reason.NEAR, "near comes before outside"),
    ((0, 5, 1), am.camera.Reason.FAR, "farther than 8 m"),
    ((0, 5, 99), am.camera.Reason.FAR, "far comes before outside"),
    ((3.5, 0, 1), am.camera.Reason.OUTSIDE, "right of the image"),
    ((0, 0, 4), am.camera.Reason.OUTSIDE, "above it"),
]


@pytest.mark.parametrize(("point", "reason", "why"), REASONS, ids=[r[2] for r in REASONS])
def test_reasons(point, reason, why):
    projection = camera(near=0.5, far=8.0).project(point)
    assert projection.reason == reason
    assert projection.visible == (reason == am.camera.Reason.VISIBLE)
    assert projection.occluded_by == -1
    has_pixel = reason not in (am.camera.Reason.ABSENT, am.camera.Reason.BEHIND)
    assert np.isfinite(projection.pixels).all() == has_pixel


def test_beyond_the_lens_is_a_reason_of_its_own():
    projection = camera(lens=am.camera.BrownConrady(k1=-0.3)).project([[1, 0, 1], [6, 0, 1]])
    assert projection.reason.tolist() == [am.camera.Reason.VISIBLE, am.camera.Reason.LENS]
    assert projection.counts()[am.camera.Reason.LENS] == 1


def test_the_image_ends_half_a_pixel_beyond_the_outer_centres():
    c = camera()
    across = c.rays([[-0.4999, 0], [-0.5001, 0], [1279.4999, 0], [1279.5001, 0]])
    down = c.rays([[0, -0.4999], [0, -0.5001], [0, 1023.4999], [0, 1023.5001]])
    for rays in (across, down):
        assert c.project(c.center + 3 * rays).visible.tolist() == [True, False] * 2


def test_pixels_have_their_origin_at_the_top_left():
    c = camera()
    left_up = c.project([-1.0, 0, 2.0]).pixels
    assert left_up[0] < K[0, 2]
    assert left_up[1] < K[1, 2]
    np.testing.assert_allclose(c.center, [0, -4, 1], atol=1e-12)
    np.testing.assert_allclose(c.axis, [0, 1, 0], atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(c.T_camera_world[:3, :3]), 1)


@pytest.mark.parametrize("shape", [(3,), (5, 3), (2, 5, 3), (2, 3, 5, 3), (0, 3), (4, 0, 3)])
def test_any_shape_of_points(shape):
    points = np.random.default_rng(0).normal(size=shape)
    rig = am.Rig.ring(3, radius=4, height=2)
    projection = rig.project(points)
    assert projection.pixels.shape == (3, *shape[:-1], 2)
    assert projection.reason.shape == projection.depth.shape == (3, *shape[:-1])
    alone = rig[1].project(points)
    np.testing.assert_array_equal(projection[1].pixels, alone.pixels)
    assert rig[1].jacobian(points).shape == (*shape[:-1], 2, 3)


@pytest.mark.parametrize("seed", range(5))
def test_moving_everything_changes_nothing(seed):
    rng = np.random.default_rng(seed)
    M = random_pose(rng)
    points = rng.normal(size=(200, 3)) * 2
    lens = am.camera.BrownConrady(k1=-0.2, k2=0.03, p1=0.002)
    one = camera(lens=lens)
    moved = one.replace(T_camera_world=one.T_camera_world @ np.linalg.inv(M))
    surfaces = [
        am.camera.Polygon(corners=rng.normal(size=(3, 3))),
        am.camera.Capsule(ends=rng.normal(size=(2, 3)), radius=0.3),
    ]
    there = [
        am.camera.Polygon(corners=surfaces[0].corners[0] @ M[:3, :3].T + M[:3, 3]),
        am.camera.Capsule(ends=surfaces[1].ends[0] @ M[:3, :3].T + M[:3, 3], radius=0.3),
    ]
    a = one.project(points, surfaces)
    b = moved.project(points @ M[:3, :3].T + M[:3, 3], there)
    np.testing.assert_array_equal(a.reason, b.reason)
    np.testing.assert_array_equal(a.occluded_by, b.occluded_by)
    assert (a.reason == am.camera.Reason.OCCLUDED).any()
    np.testing.assert_allclose(a.pixels, b.pixels, atol=1e-8)


@pytest.mark.parametrize(
    "lens",
    [
        None,
        am.camera.BrownConrady(k1=-0.2, k2=0.05, p1=0.003, p2=-0.004),
        am.camera.ReportRadial(a1=0.2, a2=0.1),
        am.camera.ViconRadial(k1=3e-8),
        am.camera.QuadraticCorrection(ex=(0.01, 0.02, 0.03, 0, 0.01), ey=(0, 0, 0.02, 0.01, 0)),
    ],
    ids=repr,
)
@pytest.mark.parametrize(
    "K_lens", [None, am.camera.intrinsics(focal_length=700.0, principal_point=(600, 500))]
)
def test_jacobian_equals_differences(lens, K_lens):
    c = camera(lens=lens, K_lens=K_lens)
    points = np.random.default_rng(2).uniform([-1, -1, 0], [1, 1, 2], (20, 3))
    step = 1e-6
    differences = np.stack(
        [
            (c.project(points + step * e).pixels - c.project(points - step * e).pixels) / (2 * step)
            for e in np.eye(3)
        ],
        axis=-1,
    )
    np.testing.assert_allclose(c.jacobian(points), differences, rtol=1e-5, atol=1e-4)


@pytest.mark.parametrize("seed", range(5))
def test_a_projection_matrix_comes_apart(seed):
    rng = np.random.default_rng(seed)
    skewed = K + np.array([[0, 5.0, 0], [0, 20, 0], [0, 0, 0]])
    T = random_pose(rng)
    P = rng.choice([-3.0, 0.001]) * skewed @ T[:3]
    back = am.Camera.from_matrix(P, size_px=SIZE)
    np.testing.assert_allclose(back.K, skewed, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(back.T_camera_world, T, atol=1e-9)


def test_coverage_of_two_cameras_at_right_angles():
    # At depth z one camera tells two coordinates to sigma z / f: the third comes from the other.
    f, z, sigma = 1000.0, 4.0, 0.5
    K = am.camera.intrinsics(focal_length=f, principal_point=(639.5, 511.5))
    rig = am.Rig(
        (
            am.Camera.look_at((0, -z, 0), (0, 0, 0), K=K, size_px=SIZE),
            am.Camera.look_at((z, 0, 0), (0, 0, 0), K=K, size_px=SIZE),
        )
    )
    coverage = rig.coverage([[0.0, 0, 0], [0, -9, 0], [0, 1.6, 2.5]], sigma_px=sigma)
    assert coverage.n_cameras.tolist() == [2, 0, 1]
    s = sigma * z / f
    np.testing.assert_allclose(
        coverage.covariance[0], np.diag([s**2, s**2, s**2 / 2]), rtol=1e-9, atol=1e-18
    )
    np.testing.assert_allclose(coverage.error[0], s * math.sqrt(2.5))
    assert np.isnan(coverage.error[1:]).all()


def test_coverage_gives_the_error_of_triangulated_points():
    rng = np.random.default_rng(5)
    rig = am.Rig.ring(4, radius=3, height=2, target=(0, 0, 1))
    place, sigma = np.array([0.3, -0.2, 1.1]), 0.3
    coverage = rig.coverage(place, sigma_px=sigma)
    J = np.concatenate([c.jacobian(place) for c in rig])
    noise = rng.normal(0, sigma, (20_000, len(J)))
    moved = noise @ np.linalg.pinv(J).T  # one Gauss-Newton step: exact for small noise
    np.testing.assert_allclose(np.cov(moved.T), coverage.covariance, atol=0.05 * coverage.error**2)


def test_one_line_has_no_depth():
    c = camera()
    rig = am.Rig(
        (
            c,
            c.replace(
                T_camera_world=c.T_camera_world
                + np.array([[0.0] * 4, [0] * 4, [0, 0, 0, 1], [0] * 4])
            ),
        )
    )
    coverage = rig.coverage(c.center + 3 * c.axis)
    assert coverage.n_cameras == 2
    assert np.isnan(coverage.covariance).all()


def test_coverage_is_lost_behind_a_wall():
    rig = am.Rig.ring(8, radius=4, height=2)
    wall = am.camera.Polygon(corners=[[1, -9, -9], [1, 9, -9], [1, 9, 9], [1, -9, 9]])
    place = [0.0, 0.0, 1.0]
    assert rig.coverage(place).n_cameras == 8
    assert rig.coverage(place, [wall]).n_cameras == 5  # three of the eight stand beyond x = 1


def test_rings_and_walls_look_at_their_target():
    target = (0.5, 1.0, 0.7)
    for rig in (
        am.Rig.ring(7, radius=3, height=2.2, target=target),
        am.Rig.wall(5, width=6, height=2, distance=4, target=target),
    ):
        centre = (np.array(SIZE) - 1) / 2
        pixels = rig.project(target).pixels
        np.testing.assert_allclose(pixels, np.broadcast_to(centre, pixels.shape), atol=1e-9)
        assert rig.project(np.add(target, (0, 0, 0.1))).pixels[:, 1].max() < centre[1]  # upright
    ring = am.Rig.ring(4, radius=3, height=2)
    np.testing.assert_allclose([np.hypot(*c.center[:2]) for c in ring], 3)
    assert ring.names == ("cam1", "cam2", "cam3", "cam4")
    assert ring["cam3"] is ring[2]
    assert len(ring[1:]) == 3
    wall = am.Rig.wall(3, width=4, height=2, distance=4, target=(0, 0, 1))
    np.testing.assert_allclose(
        [c.center for c in wall], [[2, -4, 2], [0, -4, 2], [-2, -4, 2]], atol=1e-12
    )


def good(**changes):
    return am.Camera(**({"K": K, "T_camera_world": np.eye(4), "size_px": SIZE} | changes))


def pose(**at):
    T = np.eye(4)
    for key, value in at.items():
        T[int(key[1]), int(key[2])] = value
    return T


BAD = [
    (lambda: good(K=np.zeros((3, 3))), "K: expected focal lengths > 0"),
    (lambda: good(K=np.diag([800.0, 0.0, 1.0])), "focal lengths > 0"),
    (lambda: good(K=np.diag([-800.0, 800.0, 1.0])), "focal lengths > 0"),
    (lambda: good(K=K * np.nan), "K: expected finite"),
    (lambda: good(K=K[:2]), "shape"),
    (lambda: good(K=2 * K), r"\[0, 0, 1\]"),
    (lambda: good(T_camera_world=pose(_00=2.0)), "rotation"),
    (lambda: good(T_camera_world=pose(_00=-1.0)), "reflection"),
    (lambda: good(T_camera_world=pose(_30=1.0)), "last row"),
    (lambda: good(T_camera_world=pose(_03=np.nan)), "finite"),
    (lambda: good(T_camera_world=np.eye(3)), "shape"),
    (lambda: good(size_px=(0, 1024)), "width"),
    (lambda: good(size_px=(1280, -1)), "height"),
    (lambda: good(size_px=(1280.5, 1024)), "whole"),
    (lambda: good(size_px=(1280,)), "width and height"),
    (lambda: good(near=-1.0), "near"),
    (lambda: good(near=2.0, far=1.0), "far"),
    (lambda: good(far=np.nan), "far"),
    (lambda: good(lens=0.1), "lens"),
    (lambda: good(K_lens=np.zeros((3, 3))), "K_lens"),
    (lambda: good().project([[1.0, 2.0]]), r"points: expected an array of shape \(\.\.\., 3\)"),
    (lambda: good().project([["a", "b", "c"]]), "points"),
    (lambda: good().project([0, 0, 1], clearance=-1), "clearance"),
    (lambda: good().undistort([1.0, 2, 3]), "pixels"),
    (lambda: am.Camera.look_at((0, 0, 1), (0, 0, 1), K=K, size_px=SIZE), "target"),
    (lambda: am.Camera.look_at((0, 0, 1), (0, 0, 0), K=K, size_px=SIZE), "up"),
    (lambda: am.Camera.from_matrix(np.ones((3, 4)), size_px=SIZE), "P"),
    (lambda: am.Camera.from_matrix(np.full((3, 4), np.nan), size_px=SIZE), "P"),
    (lambda: am.camera.intrinsics(focal_length=0, principal_point=(1, 1)), "focal_length"),
    (
        lambda: am.camera.intrinsics(focal_length=1, principal_point=(1, 1), pixels_per_metre=0),
        "pixels_per",
    ),
    (lambda: am.Rig(()), "at least one"),
    (lambda: am.Rig((1,)), "Camera"),
    (lambda: am.Rig((good(name="a"), good(name="a"))), "more than once"),
    (lambda: am.Rig((good(name="a"),))["b"], "expected a, found"),
    (lambda: am.Rig.ring(0, radius=1, height=1), "n:"),
    (lambda: am.Rig.ring(3, radius=0, height=1), "radius"),
    (lambda: am.camera.volume_grid((0, 0, 0), (1, 1, -1), 0.1), "high"),
    (lambda: am.camera.volume_grid((0, 0, 0), (1, 1, 1), 1e-5), "spacing"),
    (lambda: am.Rig.ring(3, radius=1, height=1).coverage([0, 0, 0], sigma_px=0), "sigma_px"),
]


@pytest.mark.parametrize(("make", "word"), BAD)
def test_bad_input_is_told(make, word):
    with pytest.raises(am.ParameterError, match=word):
        make()


def test_a_camera_does_not_change_with_the_arrays_it_was_made_from():
    K2, T = K.copy(), np.eye(4)
    c = am.Camera(K=K2, T_camera_world=T, size_px=SIZE)
    K2[0, 0] = T[0, 3] = 5.0
    assert c.K[0, 0] == 800.0
    assert c.T_camera_world[0, 3] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        c.K[0, 0] = 1.0


def test_the_optical_centre_is_never_seen():
    rng = np.random.default_rng(1)
    for _ in range(500):
        place, target = rng.normal(size=(2, 3)) * rng.choice([0.1, 1.0, 1000.0])
        c = am.Camera.look_at(place, target, K=K, size_px=SIZE, up=rng.normal(size=3))
        assert c.project(c.center).reason == am.camera.Reason.BEHIND
        assert c.project(c.center + 1e-3 * c.axis).visible


def test_masked_points_are_absent_and_ragged_ones_refused():
    points = np.ma.array([[0.0, 0, 1], [9999.0] * 3], mask=[[0] * 3, [1] * 3])
    assert camera().project(points).reason.tolist() == [
        am.camera.Reason.VISIBLE,
        am.camera.Reason.ABSENT,
    ]
    with pytest.raises(am.ParameterError, match="points"):
        camera().project([[0, 0, 1], [0, 0]])


def test_rigs_are_pickled_and_copied_before_and_after_their_first_use():
    import copy
    import pickle

    rig = am.Rig.ring(3, radius=3, height=2, lens=am.camera.BrownConrady(k1=-0.1))
    points = np.random.default_rng(0).normal(size=(20, 3))
    expected = rig.project(points).pixels
    rig[0].depth_image([])
    for other in (pickle.loads(pickle.dumps(rig)), copy.deepcopy(rig)):
        np.testing.assert_array_equal(other.project(points).pixels, expected)


@pytest.mark.parametrize(
    ("make", "word"),
    [
        (lambda: am.Rig((good(name="2"), good())), "more than once"),
        (lambda: good(name=5), "name"),
        (lambda: good(far="x"), "far"),
        (lambda: good(size_px=None), "size_px"),
        (lambda: am.Rig.ring(2, radius=1, height="x"), "height"),
        (lambda: am.Rig.ring(2, radius=1, height=1, size_px=1280), "size_px"),
        (lambda: am.Rig.ring(2, radius=1, height=1, name="x"), "name"),
        (lambda: good().project([0, 0, 1], None), "surfaces"),
        (lambda: am.Camera.look_at((0, 0, 1), (0, 0, 0), K=K, size_px=SIZE, up=(0, 0, 0)), "up"),
    ],
)
def test_wrong_kinds_of_arguments_are_told(make, word):
    with pytest.raises(am.ParameterError, match=word):
        make()


def test_whole_numbers_may_come_as_floats():
    assert len(am.Rig.ring(3.0, radius=1, height=1)) == 3
