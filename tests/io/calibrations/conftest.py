"""What several tests of calibrations share."""

from __future__ import annotations

import pytest

from asterism.camera import fit_lens
from asterism.io.calibrations import fitting


@pytest.fixture(scope="module")
def each_fit_once():
    """Compute a fit once for all formats that have room for the same lens."""
    found = {}

    def fit_once(camera, kind, *, refit_camera, without):
        key = id(camera), kind, refit_camera, tuple(without)
        if key not in found:
            fit = fit_lens(camera, kind, refit_camera=refit_camera, without=without)
            found[key] = camera, fit  # the camera is kept, so that no other has its id
        return found[key][1]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(fitting, "fit_lens", fit_once)
        yield
