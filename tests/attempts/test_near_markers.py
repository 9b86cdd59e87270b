"""The density of clutter near markers."""

from __future__ import annotations

import math

import numpy as np
import pytest

import asterism as am
from asterism.tracking.attempts.near_markers import NEAR, with_clutter_near_markers
from tests.scenes import small_model


@pytest.mark.parametrize("n_axes", [2, 3])
def test_it_is_that_of_detections_around_those_of_tracks(n_axes):
    """One detection of two has a neighbour without a track within the distance."""
    one, far = np.zeros(n_axes), np.full(n_axes, 1.0)
    beside, apart = one.copy(), one.copy()
    beside[0], apart[0] = 0.9 * NEAR, 1.1 * NEAR
    points = np.tile([one, far, beside, apart], (20, 1))
    d = am.Detections(times=np.arange(20.0), offsets=4 * np.arange(21), points=points)
    tracks = am.Tracks(detections=d, labels=np.tile([0, 1, -1, -1], 20))
    model = small_model(clutter_density=1e-3)
    found = with_clutter_near_markers(model, tracks).sensor.clutter_density
    ball = {2: math.pi * NEAR**2, 3: 4 / 3 * math.pi * NEAR**3}[n_axes]
    assert found == pytest.approx(0.5 / ball)


def test_it_is_not_below_that_of_the_model():
    truth = am.simulate.cube(frames=20, seed=1)
    model = small_model(clutter_density=0.7)
    assert with_clutter_near_markers(model, truth) == model


def test_no_frames_have_no_ghosts():
    none = am.Tracks(detections=am.Detections.from_frames([], []), labels=[])
    assert with_clutter_near_markers(small_model(), none) == small_model()
