"""Cameras fitted to what a format can hold: what is told is what is met."""

from __future__ import annotations

import numpy as np
import pytest

from asterism.camera import BrownConrady, QuadraticCorrection, ReportRadial, ViconRadial
from asterism.errors import ParameterError
from asterism.io.calibration import CALIBRATIONS
from asterism.io.calibration.fitting import fit_kind, fit_to_format
from calibration_rigs import LENSES, rig_for

KINDS = {"brown": BrownConrady, "vicon": ViconRadial, "report": ReportRadial,
         "quadratic": QuadraticCorrection, "none": None}  # fmt: skip


def away(old, new):
    """Where the new camera sees what the old one sees at pixels of a grid of its own."""
    w, h = old.size_px
    pixels = np.stack(np.meshgrid(np.linspace(0, w - 1, 43), np.linspace(0, h - 1, 37)), -1)
    points = old.center + 3 * old.rays(pixels.reshape(-1, 2))
    return np.linalg.norm(new.project(points).pixels - pixels.reshape(-1, 2), axis=1)


@pytest.mark.parametrize("lens", LENSES)
@pytest.mark.parametrize("kind", KINDS)
def test_the_residual_is_true(lens, kind):
    camera = rig_for("qca", bent=False)[0].replace(lens=LENSES[lens])
    if lens == "QuadraticCorrection":
        camera = camera.replace(K_lens=np.eye(3))
    fit = fit_kind(camera, KINDS[kind])
    met = away(camera, fit.camera)
    assert np.sqrt(np.mean(met**2)) == pytest.approx(fit.rms_px, rel=0.1, abs=1e-7)
    assert met.max() == pytest.approx(fit.max_px, rel=0.1, abs=1e-6)
    np.testing.assert_allclose(fit.camera.center, camera.center, atol=1e-12)
    if KINDS[kind] is type(camera.lens):
        assert fit.max_px < 1e-6
    # No fit is worse than no lens at all; some are fitted in ideal pixels and told in bent ones.
    assert fit.rms_px <= 1.001 * fit_kind(camera, None).rms_px


@pytest.mark.parametrize("kind", ["brown", "vicon", "report"])
def test_as_good_as_the_fit_of_the_camera_itself(kind):
    """Two programs, one that follows the lens to the end of its domain and one of formulas."""
    for lens in ("ReportRadial", "ViconRadial"):
        camera = rig_for("myptv", bent=False)[0].replace(lens=LENSES[lens])
        other = camera.with_lens(KINDS[kind])
        assert fit_kind(camera, KINDS[kind]).rms_px <= 1.15 * other.rms_px + 1e-7


def test_a_lens_that_would_fold_is_not_taken():
    # Pincushion so strong that a polynomial the other way turns round within the image.
    camera = rig_for("myptv", bent=False)[0].replace(lens=ReportRadial(-0.35, 0.0))
    for kind in (BrownConrady, ViconRadial, None):
        fit = fit_kind(camera, kind)
        assert fit.rms_px < 100
        assert np.isfinite(fit.max_px)


def test_a_lens_that_reaches_next_to_nothing_is_not_fitted():
    camera = rig_for("myptv", bent=False)[0].replace(lens=BrownConrady(k1=-1e4))
    with pytest.raises(ParameterError, match="reaches"):
        fit_kind(camera, ViconRadial)


def test_what_fits_is_left_as_it_is():
    for name, form in CALIBRATIONS.items():
        assert fit_to_format(rig_for(name)[0], form) is None


def test_limits_of_a_format_are_kept():
    camera = rig_for("flydra", bent=False)[0].replace(lens=LENSES["BrownConrady"])
    fit = fit_to_format(camera, CALIBRATIONS["flydra"])
    assert fit is not None
    assert fit.camera.K[0, 1] == fit.camera.lens.k3 == 0
    assert 0 < fit.max_px < 2
    assert away(camera, fit.camera).max() == pytest.approx(fit.max_px, rel=0.2)
