"""States of the tracks in every step: the same contract for every method, and a reference."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

import asterism as am
from asterism.tracking import Rigidity, Stitched
from tests.contracts.methods import METHODS, each_method
from tests.references.track_states import states_by_hand
from tests.scenes import small_model, wanderers

# Their states follow one association, which the labels tell.
SINGLE = {
    name: method
    for name, method in METHODS.items()
    if not isinstance(method, am.JPDA)
    and getattr(method, "rigid", None) is None
    and not getattr(method, "independent", False)
}
STREAMS = METHODS | {
    "stitched": Stitched(),
    "stitched gnn": Stitched(method=am.GNN()),
    "stitched, late": Stitched(confirm=5, lag=0),
}


def corrupted(seed=1, frames=60):
    truth = am.simulate.cube(frames=frames, seed=seed)
    burst = am.simulate.Burst(n=2, shortest=5, longest=12)
    made = am.simulate.corrupt(truth, burst=burst, clutter=0.05, noise=3e-4, seed=seed)
    return made, am.estimate_model(made.detections).model


@pytest.mark.parametrize("method", STREAMS.values(), ids=STREAMS)
def test_the_tracks_of_every_frame_are_those_of_its_labels(method):
    made, model = corrupted()
    d = made.detections
    state = method.init(model, seed=1)
    n_occluded = 0
    for time, points in d:
        state, update = method.step(state, time, points)
        tracks = update.tracks
        assert tracks is update.tracks  # computed once
        K = len(tracks)
        assert tracks.means.shape == (K, 3, 2)
        assert tracks.covariances.shape == (K, 2, 2)
        assert len(tracks.names) == len(set(tracks.ids.tolist())) == K
        seen = set(tracks.ids[tracks.is_seen].tolist())
        assert seen == set(update.labels[update.labels >= 0].tolist())
        known = np.isfinite(tracks.covariances).all(axis=(1, 2))
        assert (np.linalg.eigvalsh(tracks.covariances[known]) > 0).all()
        existence = tracks.existence[np.isfinite(tracks.log_odds)]
        assert ((existence >= 0) & (existence <= 1)).all()
        # A detected marker is where its detection is.
        for k in np.flatnonzero(tracks.is_seen):
            own = points[update.labels == tracks.ids[k]]
            assert np.linalg.norm(own - tracks.positions[k], axis=1).min() < 0.02
        n_occluded += int((~tracks.is_seen).sum())
    assert n_occluded > 20


@pytest.mark.parametrize("method", SINGLE.values(), ids=SINGLE)
def test_states_are_those_of_the_textbook_filter_over_the_labels_so_far(method):
    rng = np.random.default_rng(3)
    truth, model = wanderers(rng, n_frames=24), small_model(max_gap=6)
    d = truth.detections
    state, labels = method.init(model, seed=1), np.full(d.n_points, -1)
    n_checked = n_occluded = 0
    for t, (time, points) in enumerate(d):
        state, update = method.step(state, time, points)
        now = slice(d.offsets[t], d.offsets[t + 1])
        labels[now] = update.labels
        labels[update.revised] = update.revised_labels
        expected = states_by_hand(d.part(0, t + 1), labels[: d.offsets[t + 1]], model)
        tracks = update.tracks
        for k, identity in enumerate(tracks.ids.tolist()):
            mean, covariance, gap, odds = expected[identity]
            np.testing.assert_allclose(tracks.means[k], mean, rtol=1e-6, atol=1e-9)
            np.testing.assert_allclose(tracks.covariances[k], covariance, rtol=1e-6, atol=1e-12)
            assert tracks.gaps[k] == gap
            # The chain of mcmcda terminates tracks more rarely than the model.
            if not isinstance(method, am.MCMCDA):
                assert math.isclose(tracks.log_odds[k], odds, rel_tol=1e-6, abs_tol=1e-6)
            n_checked += 1
            n_occluded += gap > 0
    assert n_checked > 40
    assert n_occluded > 0


def test_smp_without_a_model_of_clutter_does_not_know_whether_a_track_exists():
    made = am.simulate.cube(frames=10, seed=1)
    method = am.SMP(strict=True)
    state = method.init(am.estimate_model(made.detections).model)
    for time, points in made.detections:
        state, update = method.step(state, time, points)
    assert np.isnan(update.tracks.existence).all()


def test_jpda_reports_its_own_estimates_and_the_existence_that_misses_lower():
    made, model = corrupted()
    method = am.JPDA(sure_until_gap=False)
    state = method.init(model)
    for time, points in made.detections.part(0, 30):
        state, update = method.step(state, time, points)
    live, tracks = state.live(), update.tracks
    assert (tracks.means == live["means"]).all()
    before = dict(zip(tracks.ids.tolist(), tracks.existence, strict=True))
    for step in (1, 2):
        time = made.detections.times[29 + step]
        state, update = method.step(state, time, np.empty((0, 3)))
        now = dict(zip(update.tracks.ids.tolist(), update.tracks.existence, strict=True))
        assert all(now[k] < before[k] for k in now)
        before = now


@pytest.mark.parametrize(
    "methods",
    [
        (am.GNN(), am.GNN(rigid=Rigidity())),
        (am.JPDA(), am.JPDA(rigid=Rigidity())),
        (am.TOMHT(), am.TOMHT(rigid=Rigidity())),
        (am.GNN(), Stitched(method=am.GNN())),
    ],
    ids=["gnn", "jpda", "tomht", "stitched"],
)
def test_neighbours_predict_occluded_markers_better_than_their_own_motion(methods):
    truth = am.simulate.cube(frames=160, seed=4)
    hidden, first = 3, 100
    positions = truth.positions()
    positions[first : first + 40, hidden] = np.nan
    noise = np.random.default_rng(1).normal(0, 2e-4, positions.shape)
    made = am.Tracks.from_dense(truth.detections.times, positions + noise)
    model = am.estimate_model(made.detections).model
    model = dataclasses.replace(model, population=dataclasses.replace(model.population, max_gap=60))
    errors = []
    for method in methods:
        state, own = method.init(model), []
        for t, (time, points) in enumerate(made.detections):
            state, update = method.step(state, time, points)
            if t == first - 1:
                at = np.linalg.norm(update.tracks.positions - truth.positions()[t, hidden], axis=1)
                identity = int(update.tracks.ids[at.argmin()])
            if first + 10 <= t < first + 38:
                k = int(np.flatnonzero(update.tracks.ids == identity)[0])
                assert not update.tracks.is_seen[k]
                place = update.tracks.positions[k]
                own.append(np.linalg.norm(place - truth.positions()[t, hidden]))
                sigma = math.sqrt(update.tracks.covariances[k, 0, 0])
                assert own[-1] < 8 * sigma + 1e-3
        errors.append(np.median(own))
    alone, carried = errors
    assert carried < 0.005
    assert carried < 0.5 * alone


def test_named_streams_name_their_tracks_with_a_probability():
    truth = am.simulate.fingers(frames=120, seed=1)
    made = am.learn_marker_set(truth)
    method = am.tracking.Named(marker_sets=made, method=Stitched())
    state = method.init(am.estimate_model(truth.detections).model)
    for time, points in truth.detections:
        state, update = method.step(state, time, points)
    tracks = update.tracks
    assert set(tracks.names) == set(made.names)
    assert (tracks.identity_confidence > 0.9).all()
    by_label = dict(zip(tracks.ids.tolist(), tracks.names, strict=True))
    assert [by_label[k] for k in update.labels.tolist()] == list(update.names)


def test_a_method_without_states_has_none_and_stitching_leaves_them_out():
    class Plain(am.tracking.Method):
        name = "plain"

        def init(self, model, *, n_axes=3, seed=None):
            return am.GNN().init(model, n_axes=n_axes)

        def step(self, state, time, points, *, covariances=None):
            state, update = am.GNN().step(state, time, points)
            return state, dataclasses.replace(update, read_tracks=None)

    made, model = corrupted(frames=10)
    for method in (Plain(), Stitched(method=Plain())):
        state = method.init(model)
        for time, points in made.detections:
            state, update = method.step(state, time, points)
        assert update.tracks is None


@each_method
def test_reading_the_tracks_changes_nothing(method):
    made, model = corrupted(frames=30)
    results = []
    for reads in (False, True):
        state = method.init(model, seed=1)
        labels = []
        for time, points in made.detections:
            state, update = method.step(state, time, points)
            if reads:
                assert len(update.tracks) >= 0
            labels += [update.labels, update.revised, update.revised_labels]
        results.append(np.concatenate(labels))
    assert (results[0] == results[1]).all()
