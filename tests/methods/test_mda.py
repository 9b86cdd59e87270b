"""Multidimensional assignment over a window: the best partition of all, and its relaxation."""

from __future__ import annotations

import dataclasses
import functools

import numpy as np
import pytest

import asterism as am
from asterism.tracking import Gate, Lifecycle
from tests.references.partitions import every_partition, tiny_model, tiny_problem
from tests.scenes import crowd, small_model, wanderers

WHOLE = am.MDA(
    window=16, max_branches=10**6, prune_odds=1e30, new_track_odds=1e300,
    gate=Gate(probability=1e-300),
    lifecycle=Lifecycle(confirm_probability=0.5 + 1e-12, delete_odds=1e300),
)  # fmt: skip


@pytest.mark.parametrize("seed", range(6))
def test_the_whole_window_finds_the_best_of_all_partitions(seed):
    rng = np.random.default_rng(seed)
    n_tracks = 0
    for _ in range(40):
        n_frames, most = ((5, 2), (4, 3), (3, 4))[rng.integers(3)]
        d, model = tiny_problem(rng, n_frames, most, int(rng.integers(2, 4))), tiny_model(rng)
        best = every_partition(d, model)[1].max()
        exact = am.track(d, WHOLE, model=model)
        assert am.log_posterior(exact, model) == pytest.approx(best, abs=1e-5)
        assert exact.info["gap"] == 0
        relaxed = am.track(d, dataclasses.replace(WHOLE, solver="relaxed"), model=model)
        below = best - am.log_posterior(relaxed, model)
        assert below > -1e-9
        if relaxed.info["gap"] == 0:  # every window closed
            assert below < 1e-4
        n_tracks += exact.n_tracks
    assert n_tracks > 15


@pytest.mark.parametrize("solver", ["exact", "relaxed"])
def test_the_same_as_multiple_hypotheses_where_both_are_exact(solver):
    truth = wanderers(np.random.default_rng(2), n_frames=50, clutter=2.0)
    model = small_model()
    tomht = am.track(truth.detections, am.TOMHT(), model=model)
    mda = am.track(truth.detections, am.MDA(solver=solver), model=model)
    assert (mda.labels == tomht.labels).all()
    assert mda.info["gap"] == tomht.info["gap"] == 0


def test_a_gap_of_the_relaxation_is_reported(monkeypatch):
    # One round of prices closes no gap where markers walk over each other.
    short = functools.partial(am.solve.assign_multidimensional, max_rounds=1)
    monkeypatch.setattr("asterism.tracking.methods.mda.assign_multidimensional", short)
    truth = crowd(3, spread=0.08)
    model = small_model(
        motion=am.DWNA(acceleration_sigma=1.2, velocity_sigma=0.3), noise_sigma=0.01,
        max_speed=1.5, clutter_density=1.0, birth_density=1.0,
    )  # fmt: skip
    relaxed = am.track(truth.detections, am.MDA(window=4, solver="relaxed"), model=model)
    exact = am.track(truth.detections, am.MDA(window=4), model=model)
    assert relaxed.info["gap"] > 0
    assert relaxed.info["windows_with_a_gap"] > 0
    assert (exact.info["gap"], exact.info["windows_with_a_gap"]) == (0, 0)


def test_a_state_may_be_forked_and_dropped_in_any_order():
    # The chooser is a Python function that all copies of a tracker share.
    truth = wanderers(np.random.default_rng(3), n_frames=20)
    method, model = am.MDA(), small_model()
    state = method.init(model)
    kept = []
    for time, points in truth.detections:
        state, _ = method.step(state, time, points)
        kept.append(state)
    del state
    last = kept[10]
    kept.clear()
    _, update = method.step(last, float(truth.detections.times[11]), truth.detections.frame(11))
    assert len(update.labels) == truth.detections.counts[11]


def test_options_are_checked():
    for wrong in (
        {"window": 1}, {"window": 17}, {"solver": "greedy"}, {"max_branches": 0},
        {"prune_odds": 1}, {"new_track_odds": 0},
    ):  # fmt: skip
        with pytest.raises(am.ParameterError, match=next(iter(wrong))):
            am.MDA(**wrong)
