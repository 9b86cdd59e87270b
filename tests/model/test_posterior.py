from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

import asterism as am
from tests.references.filters import imm_log_densities, kalman
from tests.references.posterior import track_score
from tests.scenes import interacting, small_model, wanderers


@pytest.mark.parametrize("termination", ["marginal", "last"])
@pytest.mark.parametrize("motion", ["dwna", "interacting"])
def test_scores_are_the_formula_term_by_term(termination, motion):
    truth = wanderers(np.random.default_rng(1), missing=0.25, irregular=True, n_markers=12)
    model = small_model(termination=termination, max_gap=6)
    if motion == "interacting":
        model = dataclasses.replace(model, motion=interacting())
    d = truth.detections
    # Tracks that end with so many frames left.
    is_left = d.frame_of >= d.n_frames - truth.labels % 7
    truth = dataclasses.replace(truth, labels=np.where(is_left, -1, truth.labels))
    order, offsets = truth.by_track
    expected = []
    for k in range(truth.n_tracks):
        members = order[offsets[k] : offsets[k + 1]]
        frames, points = d.frame_of[members], d.points[members]
        densities = (
            imm_log_densities(model, d.times, frames, points)
            if motion == "interacting"
            else kalman(model, d.times, frames, points)[-1]
        )
        expected.append(track_score(model, d.times, frames, points, densities))
    scores = am.model.track_scores(truth, model)
    assert np.isfinite(scores).sum() >= 8
    assert np.allclose(scores, expected, rtol=1e-9)
    assert am.log_posterior(truth, model) == pytest.approx(sum(expected), rel=1e-9)


@pytest.mark.parametrize(
    ("frames", "x", "why"),
    [
        ([0], [0.0], "one detection is no track"),
        ([0, 5], [0.0, 0.1], "a gap over the maximal one"),
        ([0, 1], [0.0, 0.5], "a link faster than the maximal speed"),
    ],
)
def test_what_the_model_forbids_scores_minus_infinity(frames, x, why):
    points = [[[x[frames.index(t)], 0, 0]] if t in frames else [] for t in range(6)]
    detections = am.Detections.from_frames(np.arange(6) * 0.1, points)
    tracks = am.Tracks(detections=detections, labels=np.zeros(len(frames), dtype=int))
    assert am.model.track_scores(tracks, small_model())[0] == -math.inf, why


def test_all_clutter_is_the_zero_of_the_scale():
    detections = wanderers(np.random.default_rng(2)).detections
    nothing = am.Tracks(detections=detections, labels=np.full(detections.n_points, -1))
    assert am.log_posterior(nothing, small_model()) == 0.0


def test_truth_beats_what_was_done_to_it():
    truth = wanderers(np.random.default_rng(3), n_markers=5, missing=0.05)
    model = small_model(max_gap=8)
    best = am.log_posterior(truth, model)
    labels = truth.labels.copy()
    swapped = labels.copy()
    late = truth.detections.frame_of >= 20
    swapped[late & (labels == 0)], swapped[late & (labels == 1)] = 1, 0
    dropped = np.where(labels == 2, -1, labels)
    for worse in (swapped, dropped):
        tracks = am.Tracks(detections=truth.detections, labels=worse)
        assert am.log_posterior(tracks, model) < best
