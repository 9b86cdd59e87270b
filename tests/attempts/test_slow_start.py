"""Tracks in slow motion before their capture."""

from __future__ import annotations

import dataclasses

import numpy as np

import asterism as am
from asterism.tracking.attempts.most_certain import attempt, next_pass
from asterism.tracking.attempts.own_distances import refined_by_own_distances
from asterism.tracking.attempts.slow_start import (
    MAX_FRAMES,
    SLOWER,
    after_slow_start,
    with_slow_start,
)
from asterism.tracking.estimation import fit_body_motion
from asterism.tracking.methods import options_of
from asterism.tracking.plan import plan_tracking


def two_markers(**fields):
    """Three frames of two markers and a detection of neither; the second misses the last one."""
    return am.Tracks(
        detections=am.Detections(
            times=[0.5, 0.6, 0.7],
            offsets=[0, 3, 5, 6],
            points=[[0, 0, 0], [9, 9, 9], [1, 0, 0], [0, 4, 0], [1, 4, 0], [0, 8, 8]],
            **fields,
        ),
        labels=[0, -1, 1, 0, 1, 0],
    )


def test_tracks_are_shown_backwards_between_their_frames():
    tracks = two_markers()
    slow = with_slow_start(tracks)
    assert slow.counts.tolist() == [1] * SLOWER + [2] * SLOWER + [3, 2, 1]
    np.testing.assert_allclose(slow.times, 0.7 - 0.1 * np.arange(2 * SLOWER + 3)[::-1], atol=1e-12)
    np.testing.assert_allclose(slow.points[:SLOWER, 1], 8 - np.arange(4))
    np.testing.assert_allclose(slow.points[:SLOWER, 2], 8 - 2 * np.arange(4))
    both = slow.points[SLOWER : 3 * SLOWER].reshape(SLOWER, 2, 3)
    np.testing.assert_allclose(both[:, :, 1], np.repeat(4 - np.arange(4)[:, None], 2, axis=1))
    np.testing.assert_allclose(both[:, :, 0], [[0, 1]] * SLOWER)
    np.testing.assert_array_equal(slow.points[3 * SLOWER :], tracks.detections.points)


def test_covariances_are_shown_too():
    covariances = np.eye(3) * np.arange(1, 7)[:, None, None]
    slow = with_slow_start(two_markers(covariances=covariances))
    assert slow.covariances[:SLOWER, 0, 0].tolist() == [6, 5.5, 5, 4.5]
    np.testing.assert_array_equal(slow.covariances[-6:], covariances)


def test_only_the_first_frames_are_shown():
    n = MAX_FRAMES + 20
    tracks = am.Tracks.from_dense(np.arange(n) / 100, np.zeros((n, 1, 3)))
    assert with_slow_start(tracks).n_frames == n + SLOWER * (MAX_FRAMES - 1)
    alone = am.Tracks.from_dense([0.0], np.zeros((1, 1, 3)))
    assert with_slow_start(alone).n_frames == 1


def test_tracks_of_the_slow_start_alone_are_left_out():
    tracks = two_markers()
    slow = with_slow_start(tracks)
    labels = np.full(slow.n_points, -1)
    labels[0] = 1  # a track of the slow start alone
    labels[-6:] = [2, -1, 0, 2, 0, 3]
    found = am.Tracks(detections=slow, labels=labels, confidence=np.linspace(0, 1, len(labels)))
    after = after_slow_start(found, tracks.detections)
    assert after.detections is tracks.detections
    assert after.labels.tolist() == [1, -1, 0, 1, 0, 2]
    np.testing.assert_array_equal(after.confidence, found.confidence[-6:])


def test_a_further_pass_is_repeated_by_its_recipe():
    walk = am.simulate.person(activity="walk", frames=300, seed=21)
    truth = am.simulate.corrupt(walk, missing=0.1, clutter=0.1, noise=3e-4, stride=6, seed=21)
    d = truth.detections
    recipe = plan_tracking(d, stitch=True).recipe
    method = am.TOMHT(rigid=am.tracking.Rigidity())
    recipe = dataclasses.replace(
        recipe,
        model=fit_body_motion(d, recipe.model)[0],
        method=method.name,
        options=options_of(method),
    )
    once = refined_by_own_distances(attempt(recipe, d))
    twice = next_pass(once)
    assert (twice.recipe.passes, twice.recipe.label) == (2, "tomht, 2 passes")
    assert twice.tracks.recipe == twice.recipe
    assert not np.array_equal(twice.tracks.labels, once.tracks.labels)
    again = attempt(twice.recipe, d)
    np.testing.assert_array_equal(again.tracks.labels, twice.tracks.labels)
    assert again.recipe == twice.recipe
    assert am.model.Recipe.from_dict(twice.recipe.to_dict()) == twice.recipe
