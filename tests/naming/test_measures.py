"""What the engine measures of tracks for naming, against reference implementations."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import asterism as am
from asterism import _engine
from asterism.tracking.naming.subject import Subject
from asterism.tracking.rigidity.distances import distances_between, distances_from
from tests.references import naming_measures as reference


def person(seed, n_frames=60):
    """Positions (F, 53, 3) with a third of one track and single detections missing."""
    rng = np.random.default_rng(seed)
    positions = am.simulate.person(frames=n_frames, seed=seed).positions()
    positions[n_frames // 3 : 2 * n_frames // 3, rng.integers(53)] = np.nan
    positions[rng.uniform(size=positions.shape[:2]) < 0.05] = np.nan
    return positions


@pytest.mark.parametrize("n_axes", [2, 3])
def test_distances_of_all_tracks_are_those_of_each(n_axes):
    positions = person(1)[..., :n_axes].copy()
    positions[:, 7] = np.nan
    found = distances_between(positions)
    for k in range(53):
        own = distances_from(positions[:, k], positions)
        np.testing.assert_array_equal(found.middle[k], own.middle)
        np.testing.assert_array_equal(found.spread[k], own.spread)
        np.testing.assert_array_equal(found.n_frames[k], own.n_frames)


def test_no_tracks_and_no_frames_have_no_distances():
    assert distances_between(np.empty((9, 0, 3))).middle.shape == (0, 0)
    found = distances_between(np.empty((0, 2, 3)))
    assert np.isnan(found.middle).all()
    assert (found.n_frames == 0).all()


@pytest.mark.parametrize("seed", range(6))
def test_exchanges_are_those_of_the_reference(seed):
    positions = person(seed)
    rng = np.random.default_rng(seed)
    for _ in range(4):  # exchange a marker with one of its nearest
        a = int(rng.integers(53))
        b = int(np.argsort(distances_between(positions).middle[a])[rng.integers(1, 4)])
        stretch = slice(*np.sort(rng.integers(0, 60, 2)))
        positions[stretch, [a, b]] = positions[stretch, [b, a]]
    found = _engine.exchanges_by_distances(positions, min_frames=reference.MIN_FRAMES)
    assert found
    assert found == reference.exchanged_stretches(positions)


@pytest.mark.parametrize("is_kept", [False, True])
def test_neighbours_are_those_of_the_reference(is_kept):
    truth = am.simulate.person(frames=60, seed=2)
    made = am.learn_marker_set(truth)
    movements = made.movements.copy()
    movements[5], movements[:, 5] = np.nan, np.nan
    made = replace(made, movements=movements)
    positions = person(3)
    positions[:-4, 9] = np.nan  # too few frames
    found = distances_between(positions)
    own = Subject.of(made, 1.02, found, is_kept=is_kept)
    right = reference.measured_neighbours(made, 1.02, found, is_kept and made.knows_movement)
    np.testing.assert_array_equal(own.neighbours, right[0])
    for table, values in zip((own.distances, own.variances, own.weights), right[1:], strict=True):
        np.testing.assert_allclose(table, values, rtol=1e-12)
    row = Subject.of(
        made, 1.02, replace(found, **{name: getattr(found, name)[[4]] for name in
                                      ("middle", "spread", "n_frames")}),
        is_kept=is_kept, markers=np.array([4]),
    )  # fmt: skip
    np.testing.assert_array_equal(row.distances[0], own.distances[4])


@pytest.mark.parametrize("seed", range(3))
def test_scores_of_a_window_are_those_of_plain_loops(seed):
    rng = np.random.default_rng(seed)
    made = am.learn_marker_set(am.simulate.person(frames=60, seed=seed))
    positions = person(seed)
    subject = Subject.of(made, 1.0, distances_between(positions), is_kept=True)
    tables = (subject.neighbours, subject.distances, subject.variances, subject.weights)
    holder = rng.permutation(53)
    holder[rng.uniform(size=53) < 0.8] = -1
    right = rng.uniform(size=53) < 0.7
    holder[right] = np.arange(53)[right]
    points = np.ascontiguousarray(positions[18:23])
    for rows in (np.arange(53), np.array([11])):
        scores = _engine.window_scores(
            points, rows=rows, holder=holder, neighbours=tables[0], distances=tables[1],
            variances=tables[2], weights=tables[3],
        )  # fmt: skip
        expected = reference.window_scores(points, rows, holder, tables)
        np.testing.assert_allclose(scores, expected, atol=1e-11)
        assert (expected == -50).any()
        assert (expected > 10).any()
