"""What goes through a large capture in parts finds the same as in one."""

from __future__ import annotations

import numpy as np
import pytest

import asterism as am
from asterism.model.one_a_frame import first_twice
from tests.scenes import small_model, stitched, wanderers


@pytest.mark.parametrize("size", [1, 7, 30])
def test_tracks_are_checked_in_parts(monkeypatch, size):
    truth = wanderers(np.random.default_rng(3), missing=0.3, clutter=1)
    offsets, labels = truth.detections.offsets, truth.labels
    frame = truth.detections.frame_of
    assert first_twice(offsets, labels, truth.n_tracks) is None
    monkeypatch.setattr("asterism.model.one_a_frame.CHECKED_POINTS", size)
    assert first_twice(offsets, labels, truth.n_tracks) is None
    for i in range(len(labels)):
        for j in np.flatnonzero((frame == frame[i]) & (labels >= 0) & (labels != labels[i])):
            wrong = labels.copy()
            wrong[i] = labels[j]
            assert first_twice(offsets, wrong, truth.n_tracks) == (frame[i], labels[j])


@pytest.mark.parametrize("size", [1, 20, 200])
def test_tracks_are_scored_in_parts(monkeypatch, size):
    truth = wanderers(np.random.default_rng(3), missing=0.3, clutter=1)
    whole = am.model.track_scores(truth, small_model())
    monkeypatch.setattr("asterism.model.posterior.SCORED_POINTS", size)
    assert am.model.track_scores(truth, small_model()).tobytes() == whole.tobytes()


@pytest.mark.parametrize("frames", [1, 13, 10**6])
def test_captures_are_stitched_in_parts(monkeypatch, frames):
    person = am.simulate.person(seed=1, frames=150)
    burst = am.simulate.Burst(n=5, shortest=10, longest=40)
    capture = am.simulate.corrupt(person, burst=burst, noise=3e-4, seed=1).detections
    whole = stitched(capture, am.GNN())
    assert whole.joins
    monkeypatch.setattr("asterism.tracking.stitching.passes.FRAMES_A_CALL", frames)
    parts = stitched(capture, am.GNN())
    assert parts.tracks.labels.tobytes() == whole.tracks.labels.tobytes()
    assert parts.probabilities.tobytes() == whole.probabilities.tobytes()
