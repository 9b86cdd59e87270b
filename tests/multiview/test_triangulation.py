"""Places from their images: against SciPy and OpenCV, exact without noise, the bound with it."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.stats import chi2

import asterism as am
from tests.multiview.scenes import LENSES, random_rig


def seen_by(rig, points):
    projection = rig.project(points)
    return np.where(projection.visible[..., None], projection.pixels, np.nan)


@pytest.mark.parametrize("lens", LENSES)
def test_exact_without_noise(lens):
    rng = np.random.default_rng(1)
    for n in (2, 3, 8):
        rig = random_rig(rng, n, LENSES[lens])
        X = rng.uniform(-0.8, 0.8, (200, 3))
        found = am.multiview.triangulate(seen_by(rig, X), rig)
        known = found.n_views >= 2
        assert known.mean() > 0.5
        np.testing.assert_allclose(found.points[known], X[known], rtol=0, atol=1e-9)
        assert np.isnan(found.points[~known]).all()
        assert np.nanmax(np.abs(found.residuals)) < 1e-8


@pytest.mark.parametrize("lens", LENSES)
def test_equals_scipys_least_squares(lens):
    rng = np.random.default_rng(2)
    rig = random_rig(rng, 5, LENSES[lens])
    sigma = np.array([0.2, 0.5, 1.0, 0.3, 2.0])
    X = rng.uniform(-0.5, 0.5, (20, 3))
    z = seen_by(rig, X) + sigma[:, None, None] * rng.standard_normal((5, 20, 2))
    found = am.multiview.triangulate(z, rig, sigma_px=sigma)
    for i in range(len(X)):
        seen = np.isfinite(z[:, i, 0])

        def off(x, i=i, seen=seen):
            return ((z[:, i] - rig.project(x).pixels) / sigma[:, None])[seen].ravel()

        theirs = least_squares(off, X[i], xtol=1e-15, ftol=1e-15, gtol=1e-15)
        np.testing.assert_allclose(found.points[i], theirs.x, rtol=0, atol=1e-8)
        # Their derivative is numerical.
        P = np.linalg.inv(theirs.jac.T @ theirs.jac)
        np.testing.assert_allclose(found.covariances[i], P, rtol=1e-3, atol=1e-3 * np.abs(P).max())


def test_is_near_opencvs_linear_one_for_two_views():
    rng = np.random.default_rng(3)
    rig = random_rig(rng, 2)
    X = rng.uniform(-0.5, 0.5, (50, 3))
    z = rig.project(X).pixels
    P = [c.K @ c.T_camera_world[:3] for c in rig]
    theirs = cv2.triangulatePoints(P[0], P[1], z[0].T, z[1].T)
    np.testing.assert_allclose(
        am.multiview.triangulate(z, rig).points, (theirs[:3] / theirs[3]).T, atol=1e-6
    )


@pytest.mark.parametrize(("n", "lens"), [(2, "none"), (3, "brown"), (8, "none"), (8, "report")])
def test_reaches_the_cramer_rao_bound_with_an_honest_covariance(n, lens):
    rng = np.random.default_rng(4)
    rig = am.Rig.ring(n, radius=4, height=2.5, lens=LENSES[lens])
    X = np.array([0.2, 0.1, 0.8]) + rng.uniform(-0.3, 0.3, (4000, 3))
    z = rig.project(X).pixels + 0.3 * rng.standard_normal((n, len(X), 2))
    found = am.multiview.triangulate(z, rig, sigma_px=0.3)
    off = found.points - X
    bound = np.trace(rig.coverage(X, sigma_px=0.3).covariance, axis1=1, axis2=2)
    assert np.sqrt((off**2).sum(axis=1).mean() / bound.mean()) == pytest.approx(1, abs=0.04)
    nees = np.einsum("ni,nij,nj->n", off, np.linalg.inv(found.covariances), off)
    low, high = chi2.ppf([0.0005, 0.9995], 3 * len(X)) / len(X)
    assert low < nees.mean() < high
    # A covariance that forgets sigma would be eleven times too large.
    twice = am.multiview.triangulate(z, rig, sigma_px=0.6)
    np.testing.assert_allclose(twice.covariances, 4 * found.covariances, rtol=1e-3)


def test_noise_of_each_image_point():
    rng = np.random.default_rng(5)
    rig = random_rig(rng, 4)
    X = rng.uniform(-0.4, 0.4, (30, 3))
    z = rig.project(X).pixels
    z[2] += 5.0
    sigma = np.full((4, 30), 0.1)
    sigma[2] = 1e6
    np.testing.assert_allclose(
        am.multiview.triangulate(z, rig, sigma_px=sigma).points, X, atol=1e-6
    )


def test_what_one_line_leaves_open_has_no_covariance():
    K = am.camera.intrinsics(focal_length=900, principal_point=(640, 512))
    cameras = [
        am.Camera.look_at((x, 0, 0), (9, 0, 0), K=K, size_px=(1280, 1024), name=f"c{x}")
        for x in (0, 1)
    ]
    rig = am.Rig(tuple(cameras))
    found = am.multiview.triangulate(rig.project([[3.0, 0, 0]]).pixels, rig)
    assert np.isnan(found.covariances).all()


def test_bad_input():
    rig = am.Rig.ring(3, radius=4, height=2)
    with pytest.raises(am.ParameterError, match=r"pixels: expected .*\(3, N, 2\)"):
        am.multiview.triangulate(np.zeros((2, 5, 2)), rig)
    with pytest.raises(am.ParameterError, match="infinities"):
        am.multiview.triangulate(np.full((3, 5, 2), np.inf), rig)
    for sigma in (0.0, [0.1, 0.2], np.full((3, 5), -1.0)):
        with pytest.raises(am.ParameterError, match="sigma_px"):
            am.multiview.triangulate(np.zeros((3, 5, 2)), rig, sigma_px=sigma)
    with pytest.raises(am.ParameterError, match="rig"):
        am.multiview.triangulate(np.zeros((3, 5, 2)), [1, 2, 3])
    nothing = am.multiview.triangulate(np.full((3, 4, 2), np.nan), rig)
    assert np.isnan(nothing.points).all()
    assert am.multiview.triangulate(np.empty((3, 0, 2)), rig).points.shape == (0, 3)
