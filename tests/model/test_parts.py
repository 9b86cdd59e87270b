"""What goes through a large capture in parts finds the same as in one."""

from __future__ import annotations

import numpy as np
import pytest

import asterism as am
from asterism.model.labels import check_labels
from tests.scenes import small_model, stitched, wanderers


@pytest.mark.parametrize("size", [1, 7, 30])
def test_tracks_are_checked_in_parts(monkeypatch, size):
    truth = wanderers(np.random.default_rng(3), missing=0.3, clutter=1)
    offsets, labels = truth.detections.offsets, truth.labels
    frame = truth.detections.frame_of
    assert check_labels(labels, offsets) == truth.n_tracks
    monkeypatch.setattr("asterism.model.labels.CHECKED_POINTS", size)
    assert check_labels(labels, offsets) == truth.n_tracks
    for i in range(len(labels)):
        for j in np.flatnonzero((frame == frame[i]) & (labels >= 0) & (labels != labels[i])):
            wrong = labels.copy()
            wrong[i] = labels[j]
            message = f"two of track {labels[j]} in frame {frame[i]}"
            with pytest.raises(am.ParameterError, match=message):
                check_labels(wrong, offsets)


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
