"""States of the tracks of whole captures."""

from __future__ import annotations

import numpy as np
import pytest

import asterism as am
from asterism.errors import ParameterError
from tests.references.filters import kalman, rts


def tracked():
    truth = am.simulate.cube(frames=50, seed=2)
    made = am.simulate.corrupt(truth, missing=0.1, noise=3e-4, seed=2)
    model = am.estimate_model(made.detections).model
    return made, model


def test_states_are_those_of_the_textbook_smoother_in_gaps_as_well():
    made, model = tracked()
    if len(model.motion.modes) > 1:
        pytest.fail("the scene needs one motion")
    history = am.tracking.track_states(made, model=model)
    d = made.detections
    n_gaps = 0
    for k in range(made.n_tracks):
        own = made.labels == k
        frames = d.frame_of[own]
        means, covariances, predicted, steps, _ = kalman(model, d.times, frames, d.points[own])
        xs, Ps = rts(means, covariances, predicted, steps)
        for t in range(frames[0], frames[-1] + 1):
            now = history.at(t)
            at = int(np.flatnonzero(now.ids == k)[0])
            x = xs[t - frames[0]].reshape(3, -1)
            np.testing.assert_allclose(now.means[at], x, rtol=1e-6, atol=1e-8)
            np.testing.assert_allclose(
                now.covariances[at],
                Ps[t - frames[0]][: x.shape[1], : x.shape[1]],
                rtol=1e-6,
                atol=1e-15,
            )
            np.testing.assert_allclose(history.positions[t, k], now.positions[at])
            np.testing.assert_allclose(history.velocities[t, k], now.velocities[at])
            assert now.is_seen[at] == (t in frames) == history.is_seen[t, k]
            assert now.gaps[at] == t - frames[frames <= t][-1]
            n_gaps += t not in frames
        assert np.isnan(history.positions[: frames[0], k]).all()
    assert n_gaps > 10


def test_names_and_confidence_come_from_the_tracks_and_the_model_from_the_recipe():
    truth = am.simulate.cube(frames=40, seed=1)
    tracks = am.track(truth.detections, am.GNN())
    now = am.tracking.track_states(tracks).at(-1)
    assert now.names == tracks.names
    assert now.existence is None
    assert (now.identity_confidence is None) == (tracks.identity_confidence is None)
    with pytest.raises(ParameterError, match="no recipe"):
        am.tracking.track_states(truth)
