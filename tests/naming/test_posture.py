"""The posture of a set as evidence, and the size of a subject."""

from __future__ import annotations

import numpy as np
import pytest

import asterism as am
from asterism.tracking.naming.posture import posture_log_odds
from asterism.tracking.naming.search import search


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


@pytest.mark.parametrize("seed", range(4))
def test_the_posture_is_laid_over_names_that_are_found_without_it(seed):
    """Laid over the names of a start it would keep them: here a body turned by half a turn.

    The body is nearly the same after half a turn, so that distances decide by a little.
    """
    rng = np.random.default_rng(seed)
    left = rng.uniform([0.1, -0.3, 0], [0.3, 0.3, 0.6], (5, 3))
    right = left * [-1, -1, 1] + rng.normal(scale=0.004, size=(5, 3))
    places = np.concatenate([left, right])
    names = [f"{side}{n}" for side in "LR" for n in "ABCDE"]
    made = am.MarkerSet(names=names, places=places)
    start = np.array(made.partners)
    found = search(made, np.repeat(places[None], 40, axis=0), "z", start=start)
    assert (found.names == np.arange(10)).all()
