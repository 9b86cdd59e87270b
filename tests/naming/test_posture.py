"""The posture of a set as evidence, and the size of a subject."""

from __future__ import annotations

import numpy as np

import asterism as am
from asterism.tracking.naming.posture import posture_log_odds


def test_each_track_is_at_the_place_of_its_own_marker():
    truth = am.simulate.person(frames=60, seed=3)
    made = am.learn_marker_set(truth.part(0, 1))
    frame = truth.positions()[:1]
    turned = frame @ np.array([[0, 1, 0], [-1, 0, 0], [0, 0, 1.0]]) + [3, -2, 0]
    names = np.arange(truth.n_tracks)
    odds = posture_log_odds(made, turned, names, "z", 1.0)
    assert (odds.argmax(axis=1) == names).all()
    assert np.allclose(odds[names, names], np.log(10))
    assert odds.min() >= 0


def test_the_set_of_a_body_does_not_name_a_hand():
    """Its markers fit the hand as those of a body of a fifth of the size."""
    made = am.learn_marker_set(am.simulate.person(frames=200, seed=5))
    assert am.name_tracks(am.simulate.fingers(seed=1), made).n_named == 0
