"""Cameras fitted to what a format can hold."""

from __future__ import annotations

import functools

import numpy as np
import pytest

from asterism.io.calibrations import CALIBRATION_FORMATS
from asterism.io.calibrations.fitting import fit_to_format
from tests.io.calibrations.rigs import LENSES, rig_for


def test_what_fits_is_left_as_it_is():
    for name, form in CALIBRATION_FORMATS.items():
        assert fit_to_format(rig_for(name)[0], form) is None


def test_limits_of_a_format_are_kept():
    camera = rig_for("flydra", bent=False)[0].replace(lens=LENSES["BrownConrady"])
    fit = fit_to_format(camera, CALIBRATION_FORMATS["flydra"])
    assert fit is not None
    assert fit.camera.K[0, 1] == fit.camera.lens.k3 == 0
    assert 0 < fit.max_px < 2
    points = camera.center + 3 * camera.rays([[0.0, 0.0], camera.size_px, [300.0, 200.0]])
    apart = fit.camera.project(points).pixels - camera.project(points).pixels
    assert np.linalg.norm(apart, axis=1).max() <= 1.05 * fit.max_px


@functools.cache
def camera_with(lens):
    return rig_for("rig", bent=False)[0].replace(lens=LENSES[lens])


@pytest.mark.usefixtures("each_fit_once")
@pytest.mark.parametrize("name", CALIBRATION_FORMATS)
@pytest.mark.parametrize("lens", LENSES)
def test_what_was_fitted_is_held(name, lens):
    fit = fit_to_format(camera_with(lens), CALIBRATION_FORMATS[name])
    if fit is not None:
        assert fit_to_format(fit.camera, CALIBRATION_FORMATS[name]) is None
