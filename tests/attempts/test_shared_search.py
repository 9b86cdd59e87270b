"""Searches from tracks whose markers accelerate together."""

from __future__ import annotations

import numpy as np

import asterism as am
from asterism.tracking.attempts.shared_search import searched_with_shared_accelerations


def test_a_search_takes_detections_back_that_tracks_have_lost():
    truth = am.simulate.corrupt(
        am.simulate.person(activity="run", frames=300, seed=1), noise=3e-4, stride=2, seed=1
    )
    d, labels = truth.detections, truth.labels.copy()
    rng = np.random.default_rng(1)
    labels[rng.random(len(labels)) < 0.05] = -1
    model = am.tracking.tracklet_model(am.estimate_model(d).model)
    start = am.Tracks(detections=d, labels=labels)
    found = [
        searched_with_shared_accelerations(start, model, seed=1, threads=threads)
        for threads in (1, 2)
    ]
    np.testing.assert_array_equal(*found)
    is_lost = labels < 0
    is_taken = is_lost & (found[0] >= 0)
    assert is_taken.sum() > 0.4 * is_lost.sum()
    assert (found[0] == truth.labels)[is_taken].all()
    assert (found[0] == truth.labels)[~is_lost].mean() > 0.998
