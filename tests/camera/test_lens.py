"""Lenses: each its own definition, its exact inverse, and no fold in the image."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import asterism as am
from tests.references.cameras import matrix_product, random_pose, report_radial

SIZE = (1280, 1024)
K = am.camera.intrinsics(focal_length=900.0, principal_point=(630.0, 500.0))

# Mild, strong, both signs, folding inside and outside the image, and what never folds.
LENSES = [
    None,
    am.camera.BrownConrady(k1=-0.05, k2=0.01),
    am.camera.BrownConrady(k1=-0.4, k2=0.15, p1=0.003, p2=-0.002, k3=0.02),
    am.camera.BrownConrady(k1=-0.35),
    am.camera.BrownConrady(k1=0.4, k2=0.2),
    am.camera.BrownConrady(p1=0.05, p2=-0.03),
    am.camera.ReportRadial(a1=0.4, a2=0.2),
    am.camera.ReportRadial(a1=2.0),
    am.camera.ReportRadial(a1=-0.3),
    am.camera.ReportRadial(a1=-0.2, a2=-0.1),
    am.camera.ReportRadial(a1=-0.5, a2=0.4),
    am.camera.ViconRadial(k1=3.5e-8, k2=-2e-14),
    am.camera.ViconRadial(k1=-2e-7, k2=1e-14, k3=1e-20),
    am.camera.QuadraticCorrection(
        ex=(0.01, 0.02, 0.03, -0.02, 0.01), ey=(-0.01, 0.0, 0.05, 0.03, 0.02)
    ),
    am.camera.QuadraticCorrection(ex=(0.0, 0.0, 0.9, 0.1, 0.2), ey=(0.0, 0.0, 0.0, 0.6, -0.1)),
]


def camera_of(lens, **changes):
    options = {"K": K, "size_px": SIZE, "lens": lens}
    return am.Camera.look_at((0.0, -4.0, 1.5), (0.0, 0.0, 1.0), **(options | changes))


def whole_image():
    u = np.concatenate([np.linspace(-0.5, SIZE[0] - 0.501, 61), [K[0, 2]]])
    v = np.concatenate([np.linspace(-0.5, SIZE[1] - 0.501, 51), [K[1, 2]]])
    return np.stack(np.meshgrid(u, v), axis=-1)


@pytest.mark.parametrize("lens", LENSES, ids=repr)
@pytest.mark.parametrize("skew", [0.0, 3.0])
def test_round_trip_over_the_whole_image(lens, skew):
    camera = camera_of(lens, K=K + skew * np.eye(3)[[0]].T @ np.eye(3)[[1]])
    pixels = whole_image()
    rays = camera.rays(pixels)
    reached = np.isfinite(rays).all(axis=-1)
    assert reached[len(reached) // 2, reached.shape[1] // 2]
    for distance in (0.1, 1.0, 50.0):
        back = camera.project(camera.center + distance * rays[reached]).pixels
        np.testing.assert_allclose(back, pixels[reached], rtol=0, atol=1e-9)
    again = camera.distort(camera.undistort(pixels))
    np.testing.assert_allclose(again[reached], pixels[reached], rtol=0, atol=1e-9)


@pytest.mark.parametrize("lens", LENSES, ids=repr)
def test_what_lands_in_the_image_came_from_there(lens):
    # The property that no fold breaks: the pixel of a visible point looks back at the point.
    camera = camera_of(lens)
    points = np.random.default_rng(1).uniform([-9, -3.99, -7], [9, 6, 9], (20_000, 3))
    projection = camera.project(points)
    seen = projection.visible
    assert seen.sum() > 500
    towards = points[seen] - camera.center
    towards /= np.linalg.norm(towards, axis=1, keepdims=True)
    np.testing.assert_allclose(camera.rays(projection.pixels[seen]), towards, rtol=0, atol=1e-9)


coefficient = st.floats(-2, 2)


@settings(max_examples=150, deadline=None)
@given(
    lens=st.one_of(
        st.builds(am.camera.BrownConrady, coefficient, coefficient, st.floats(-0.2, 0.2),
                  st.floats(-0.2, 0.2), coefficient),
        st.builds(am.camera.ReportRadial, coefficient, coefficient),
        st.builds(am.camera.ViconRadial, st.floats(-1e-6, 1e-6), st.floats(-1e-12, 1e-12)),
    ),
    seed=st.integers(0, 2**32 - 1),
)  # fmt: skip
def test_no_lens_folds_points_into_the_image(lens, seed):
    camera = camera_of(lens)
    rng = np.random.default_rng(seed)
    x = rng.normal(size=(300, 2)) * rng.choice([0.1, 0.5, 2.0, 20.0], size=(300, 1))
    T = camera.T_camera_world
    points = (np.column_stack([x, np.ones(300)]) - T[:3, 3]) @ T[:3, :3]
    projection = camera.project(points)
    seen = projection.visible
    back = camera.undistort(projection.pixels[seen])
    np.testing.assert_allclose(back, x[seen], rtol=1e-7, atol=1e-9)
    lost = projection.reason == am.camera.Reason.LENS
    assert np.isnan(projection.pixels[lost]).all()


@pytest.mark.parametrize("seed", range(5))
def test_matrix_product_of_the_report_with_skew(seed):
    rng = np.random.default_rng(seed)
    f, ku, kv, s, u0, v0 = rng.uniform(
        [0.004, 8e4, 8e4, -900, 300, 200], [0.03, 2e5, 2e5, 900, 900, 800]
    )
    built = am.camera.intrinsics(
        focal_length=f, pixels_per_metre=(ku, kv), skew=s, principal_point=(u0, v0)
    )
    K_report = np.array([[ku, s, u0], [0, kv, v0], [0, 0, 1]])
    np.testing.assert_allclose(built, K_report @ np.diag([f, f, 1]), rtol=1e-15)
    T = random_pose(rng)
    camera = am.Camera(K=built, T_camera_world=T, size_px=SIZE)
    points = rng.normal(size=(500, 3)) * 3
    pixels, scale = matrix_product(built, T, points)
    projection = camera.project(points)
    front = scale > 0
    np.testing.assert_allclose(projection.depth, scale, rtol=1e-12, atol=1e-12)
    # Relative to the size of the terms that are summed: a pixel near zero is a difference.
    size = np.abs(pixels[front]) + np.array([u0, v0])
    assert (np.abs(projection.pixels[front] - pixels[front]) / size).max() < 1e-12
    assert np.isnan(projection.pixels[~front]).all()


@pytest.mark.parametrize("seed", range(8))
def test_brown_conrady_equals_opencv(seed):
    rng = np.random.default_rng(seed)
    lens = am.camera.BrownConrady(
        *rng.uniform([-0.3, -0.1, -0.01, -0.01, -0.02], [0.3, 0.2, 0.01, 0.01, 0.05])
    )
    T = random_pose(rng)
    camera = am.Camera(K=K, T_camera_world=T, size_px=SIZE, lens=lens)
    rays = camera.rays(whole_image()).reshape(-1, 3)
    points = camera.center + rays * rng.uniform(0.5, 20, (len(rays), 1))
    points = points[np.isfinite(points).all(axis=1)]
    k = np.array([lens.k1, lens.k2, lens.p1, lens.p2, lens.k3])
    rotation = cv2.Rodrigues(np.ascontiguousarray(T[:3, :3]))[0]
    theirs = cv2.projectPoints(points, rotation, np.ascontiguousarray(T[:3, 3]), K, k)[0][:, 0]
    np.testing.assert_allclose(camera.project(points).pixels, theirs, rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    "lens", [x for x in LENSES if isinstance(x, am.camera.ReportRadial)], ids=repr
)
def test_report_radial_equals_bisection(lens):
    camera = camera_of(lens)
    x = np.random.default_rng(3).uniform(-1.5, 1.5, (400, 2))
    expected = np.array([report_radial(lens, *p) for p in x])
    pixels = expected @ K[:2, :2].T + K[:2, 2]
    np.testing.assert_allclose(camera.distort(x), pixels, rtol=0, atol=1e-9)


def test_vicon_radial_works_on_pixels_about_the_principal_point():
    lens = am.camera.ViconRadial(k1=3e-8, k2=-1e-14)
    camera = camera_of(lens, K=np.array([[900.0, 0, 630], [0, 850, 500], [0, 0, 1]]))
    measured = np.array([[1200.0, 30.0], [10.0, 900.0]])
    offset = measured - [630, 500]
    q = (offset**2).sum(axis=1, keepdims=True)
    ideal = offset * (1 + 3e-8 * q - 1e-14 * q**2) + [630, 500]
    expected = (ideal - [630, 500]) / [900, 850]
    np.testing.assert_allclose(camera.undistort(measured), expected, rtol=1e-14)


def test_quadratic_correction_of_raw_pixels():
    ex, ey = (0.0036, -0.002, -3.8e-6, -7.9e-7, 2.4e-6), (0.0003, -3e-6, -3.9e-8, 2.4e-6, -2.4e-6)
    camera = camera_of(am.camera.QuadraticCorrection(ex=ex, ey=ey), K_lens=np.eye(3))
    u, v = 1000.0, 200.0
    terms = np.array([u, v, u * u, v * v, u * v])
    ideal = np.array([u + terms @ ex, v + terms @ ey, 1.0])
    expected = np.linalg.solve(K, ideal)[:2]
    np.testing.assert_allclose(camera.undistort([u, v]), expected, rtol=1e-13)


def test_a_lens_in_coordinates_of_its_own():
    K_lens = am.camera.intrinsics(focal_length=800.0, principal_point=(600.0, 520.0))
    lens = am.camera.BrownConrady(k1=-0.2, k2=0.05, p1=0.001)
    camera = camera_of(lens, K_lens=K_lens)
    x = np.array([0.3, -0.2])
    ideal = K @ [*x, 1.0]
    n = np.linalg.solve(K_lens, ideal)
    bent = cv2.projectPoints(
        n[None], np.zeros(3), np.zeros(3), K_lens, np.array([-0.2, 0.05, 0.001, 0])
    )
    np.testing.assert_allclose(camera.distort(x), bent[0][0, 0], rtol=0, atol=1e-9)


@pytest.mark.parametrize("seed", range(20))
def test_the_domain_is_where_the_derivative_stretches(seed):
    rng = np.random.default_rng(seed)
    lens = am.camera.BrownConrady(*rng.normal(size=5) * [0.5, 0.3, 0.1, 0.1, 0.2])
    camera = am.Camera(
        K=np.eye(3) + [[0] * 3] * 3, T_camera_world=np.eye(4), size_px=(9, 9), lens=lens
    )
    angles = np.linspace(0, 2 * np.pi, 721)
    end = min(lens.radius, 30.0)

    def least_eigenvalue(r):
        x = r * np.column_stack([np.cos(angles), np.sin(angles)])
        # The derivative of pixels by a point at depth 1, K = 1: that of the lens.
        J = camera.jacobian(np.column_stack([x, np.ones(len(x))]))[:, :, :2]
        np.testing.assert_allclose(J[:, 0, 1], J[:, 1, 0], atol=1e-9 * np.nanmax(np.abs(J)))
        return np.linalg.eigvalsh((J + np.swapaxes(J, 1, 2)) / 2)[:, 0].min()

    assert least_eigenvalue(0.999 * end) > 1e-2 - 1e-9
    if end < 30:
        x = 1.001 * end * np.column_stack([np.cos(angles), np.sin(angles)])
        assert np.isnan(camera.distort(x)).all()
        # and a little inside, the stretch comes down to its least
        assert least_eigenvalue(end * (1 - 1e-9)) < 1e-2 + 1e-4 * (1 + abs(lens.k1) * 100)


def test_barrel_and_pincushion_have_their_signs():
    corner = np.array([0.5, 0.4])
    straight = camera_of(None).distort(corner)
    centre = K[:2, 2]
    for lens, is_barrel in (
        (am.camera.ReportRadial(a1=0.2), True),
        (am.camera.ReportRadial(a1=-0.2), False),
        (am.camera.BrownConrady(k1=-0.2), True),
        (am.camera.BrownConrady(k1=0.2), False),
        (am.camera.ViconRadial(k1=2e-7), True),
    ):
        bent = camera_of(lens).distort(corner)
        assert (np.linalg.norm(bent - centre) < np.linalg.norm(straight - centre)) == is_barrel


KINDS = [
    am.camera.BrownConrady,
    am.camera.ReportRadial,
    am.camera.ViconRadial,
    am.camera.QuadraticCorrection,
    None,
]


def away(old, new):
    """Where the new camera sees what the old one sees at pixels of a grid of its own."""
    w, h = old.size_px
    pixels = np.stack(np.meshgrid(np.linspace(0, w - 1, 89), np.linspace(0, h - 1, 73)), -1)
    points = old.center + 3 * old.rays(pixels.reshape(-1, 2))
    distance = np.linalg.norm(new.project(points).pixels - pixels.reshape(-1, 2), axis=1)
    distance[np.isnan(distance)] = max(old.size_px)  # not reached by the new lens
    return distance[np.isfinite(points).all(axis=1)]


@pytest.mark.parametrize("lens", LENSES[1:], ids=repr)
@pytest.mark.parametrize("kind", KINDS)
def test_a_changed_lens_reports_its_residual(lens, kind):
    K_lens = np.eye(3) if kind is am.camera.QuadraticCorrection and type(lens) is kind else None
    if K_lens is not None:  # a correction of raw pixels, as the fitted one is
        lens = am.camera.QuadraticCorrection(
            ex=(0.0036, -0.002, -3.8e-6, -7.9e-7, 2.4e-6), ey=(0.0003, -3e-6, 0, 2.4e-6, -2.4e-6)
        )
    camera = camera_of(lens, K_lens=K_lens)
    fit = am.camera.fit_lens(camera, kind)
    met = away(camera, fit.camera)
    assert type(fit.camera.lens) is (kind or type(None))
    assert np.sqrt(np.mean(met**2)) == pytest.approx(fit.rms_px, rel=0.1, abs=1e-6)
    assert met.max() <= 1.25 * fit.max_px + 1e-6
    if kind is not am.camera.QuadraticCorrection:  # no fit is worse than no lens at all
        assert fit.rms_px <= 1.001 * am.camera.fit_lens(camera, None).rms_px
    if type(lens) is kind:
        assert fit.max_px < 1e-6


def test_coefficients_can_be_left_out():
    camera = camera_of(
        am.camera.BrownConrady(k1=-0.2, k2=0.05, k3=0.02, p1=0.002),
        K=K + np.array([[0, 4.0, 0], [0] * 3, [0] * 3]),
    )
    fit = am.camera.fit_lens(
        camera, am.camera.BrownConrady, refit_camera=True, without=("k3", "skew", "p2")
    )
    assert fit.camera.lens.k3 == fit.camera.lens.p2 == fit.camera.K[0, 1] == 0
    assert fit.camera.lens.k1 != 0
    assert away(camera, fit.camera).max() <= 1.1 * fit.max_px


def test_a_mild_lens_is_converted_well_and_a_sign_flip_is_not_enough():
    camera = camera_of(am.camera.ReportRadial(a1=0.1, a2=0.02))
    fit = am.camera.fit_lens(camera, am.camera.BrownConrady)
    assert fit.max_px < 0.05
    flipped = camera.replace(lens=am.camera.BrownConrady(k1=-0.1, k2=-0.02))
    off = np.linalg.norm(flipped.distort(camera.undistort(whole_image())) - whole_image(), axis=-1)
    assert off.max() > 5.0


def test_a_lens_apart_is_taken_into_the_camera():
    K_lens = am.camera.intrinsics(focal_length=880.0, principal_point=(640.0, 510.0))
    camera = camera_of(am.camera.BrownConrady(k1=-0.15, k2=0.03), K_lens=K_lens)
    fixed, free = (
        am.camera.fit_lens(camera, am.camera.BrownConrady),
        am.camera.fit_lens(camera, am.camera.BrownConrady, refit_camera=True),
    )
    assert free.rms_px < 0.9 * fixed.rms_px
    assert free.camera.K_lens is None
    np.testing.assert_allclose(free.camera.center, camera.center, atol=1e-9)
    points = camera.center + 3 * camera.rays(whole_image()).reshape(-1, 3)
    both = [c.project(points).pixels for c in (camera, free.camera)]
    assert np.linalg.norm(both[0] - both[1], axis=1).max() < 1.2 * free.max_px + 1e-6


@pytest.mark.parametrize(
    ("make", "word"),
    [
        (lambda: am.camera.BrownConrady(k1=np.nan), "k1"),
        (lambda: am.camera.ReportRadial(a1="0.1"), "a1"),
        (lambda: am.camera.ViconRadial(k2=np.inf), "k2"),
        (lambda: am.camera.QuadraticCorrection(ex=(0, 0, 0, 0), ey=(0, 0, 0, 0, 0)), "ex"),
        (
            lambda: camera_of(am.camera.QuadraticCorrection(ex=(-2, 0, 0, 0, 0), ey=(0,) * 5)),
            "lens",
        ),
        (lambda: am.camera.fit_lens(camera_of(None), am.camera.Lens), "kind"),
        (
            lambda: am.camera.fit_lens(camera_of(None), am.camera.BrownConrady, without=("k9",)),
            "without",
        ),
        (
            lambda: am.camera.fit_lens(
                camera_of(am.camera.BrownConrady(k1=-1e4)), am.camera.ViconRadial
            ),
            "reaches",
        ),
    ],
)
def test_bad_lenses(make, word):
    with pytest.raises(am.ParameterError, match=word):
        make()


def test_a_fold_is_refused_at_the_centre_of_the_image_and_nowhere_else():
    lens = am.camera.QuadraticCorrection(
        ex=(0, 0, 0, 0, 0), ey=(0, 0, 0, 800 / 900, 0)
    )  # 450 px up
    upright = [[800, 0, 639.5], [0, 800, 511.5], [0, 0, 1]]
    camera = am.Camera(K=upright, T_camera_world=np.eye(4), size_px=(1280, 1024), lens=lens)
    top, middle = camera.rays([[639.5, 0.0], [639.5, 511.5]])
    assert np.isnan(top).all()
    np.testing.assert_allclose(middle, [0, 0, 1], atol=1e-12)
    low = [[800, 0, 639.5], [0, 800, 1100.0], [0, 0, 1]]
    with pytest.raises(am.ParameterError, match="a lens that does not fold the centre"):
        am.Camera(K=low, T_camera_world=np.eye(4), size_px=(1280, 1024), lens=lens)
