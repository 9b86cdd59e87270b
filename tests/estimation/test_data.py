"""The model from a real capture: what no simulated body shows."""

from __future__ import annotations

import pytest

import asterism as am
from asterism.simulate import Burst, Ghosts
from tests.paths import DATA
from tests.scenes import stitched


@pytest.mark.skipif(not DATA.is_dir(), reason=f"no real captures at {DATA}")
def test_of_the_fits_the_one_that_loses_least_is_taken():
    # The last fit sees a sample of the tracks without those that jolt, and loses them: 0.950.
    (source,) = DATA.rglob("mocap36.c3d")
    truth = am.simulate.corrupt(
        am.read(source).tracks, burst=Burst(), ghosts=Ghosts(), noise=3e-4, seed=1
    )
    found = stitched(truth.detections)
    assert am.evaluate(found.tracks, truth).idf1 > 0.97
