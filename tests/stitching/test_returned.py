"""Bodies that left the view, whose markers are joined when they come back."""

from __future__ import annotations

import importlib
from itertools import chain, combinations, permutations

import numpy as np
import pytest

import asterism as am
from asterism.tracking.stitching.joined import joined_by_distances
from asterism.tracking.stitching.passes import Pass
from asterism.tracking.stitching.returned import ALIKE, STEADY, UNKNOWN, _clear, returned

NOISE = 2e-4
SQUARE = [[0, 0, 0], [0.2, 0, 0], [0.2, 0.2, 0], [0, 0.2, 0]]
UNEVEN = [[0, 0, 0], [0.21, 0, 0], [0.33, 0.4, 0], [0.1, 0.62, 0.2], [0.5, 0.11, 0.05]]


def seen_in_turn(*bodies, frames=40, away=100, noise=1e-4):
    """Show bodies one after the other, each turned and moved, with new tracks for each."""
    rng = np.random.default_rng(5)
    n_frames, n = len(bodies) * (frames + away), sum(map(len, bodies))
    positions, first = np.full((n_frames, n, 3), np.nan), 0
    for k, body in enumerate(bodies):
        q, _ = np.linalg.qr(rng.standard_normal((3, 3)))
        shown = np.asarray(body, float) @ (q * np.sign(np.linalg.det(q))) + rng.normal(size=3)
        begin = k * (frames + away)
        at = positions[begin : begin + frames, first : first + len(body)]
        at[...] = shown + rng.normal(scale=noise, size=at.shape)
        first += len(body)
    return am.Tracks.from_dense(np.arange(n_frames) / 100, positions)


def test_a_body_that_comes_back_keeps_its_tracks():
    assert returned(seen_in_turn(UNEVEN, UNEVEN), NOISE) == [(k, k + 5) for k in range(5)]


def test_it_may_come_back_often_and_with_fewer_markers():
    order = [3, 0, 4, 1]
    tracks = seen_in_turn(UNEVEN, [UNEVEN[k] for k in order], UNEVEN)
    expected = [(k, 5 + order.index(k)) if k in order else (k, k + 9) for k in range(5)]
    expected += [(k, 9 + k) for k in order]
    assert returned(tracks, NOISE) == sorted(expected)


@pytest.mark.parametrize("body", [SQUARE, SQUARE[:3], UNEVEN[:2]])
def test_a_body_that_looks_the_same_when_turned_is_not_joined(body):
    assert returned(seen_in_turn(body, body), NOISE) == []


def test_another_body_is_not_joined():
    other = np.random.default_rng(1).uniform(0, 0.6, (5, 3))
    assert returned(seen_in_turn(UNEVEN, other), NOISE) == []


def test_two_equal_bodies_that_leave_together_are_not_joined():
    """Nothing tells which of both comes back."""
    both = [[x + 2, y, z] for x, y, z in UNEVEN] + UNEVEN
    assert returned(seen_in_turn(both, UNEVEN), NOISE) == []


def test_three_loose_markers_are_too_little_evidence():
    three = [[0, 0, 0], [0.3, 0, 0], [0.3, 0.5, 0]]
    assert len(returned(seen_in_turn(three, three, noise=5e-3), NOISE)) == 3
    assert returned(seen_in_turn(three, three, noise=6e-3), NOISE) == []


def test_longer_occlusions_than_asked_are_not_joined():
    tracks = seen_in_turn(UNEVEN, UNEVEN, away=100)
    assert returned(tracks, NOISE, max_occlusion=99) == []
    assert len(returned(tracks, NOISE, max_occlusion=100)) == 5


def test_independent_markers_are_never_joined():
    swarm = am.simulate.smooth(n_markers=20, frames=200, seed=2)
    labels = swarm.labels + 20 * (swarm.detections.frame_of >= 120)
    labels[(swarm.detections.frame_of >= 80) & (swarm.detections.frame_of < 120)] = -1
    tracks = am.Tracks(detections=swarm.detections, labels=labels)
    assert all(returned(tracks, NOISE, steady=each) == [] for each in STEADY)


@pytest.mark.parametrize("seed", [3, 4])
def test_segments_of_a_person_come_back(seed):
    walk = am.simulate.person(frames=400, seed=seed)
    d, frame = walk.detections, walk.detections.frame_of
    labels = np.where(frame < 150, walk.labels, np.where(frame < 260, -1, walk.labels + 53))
    found = returned(am.Tracks(detections=d, labels=labels), NOISE)
    assert {later - earlier for earlier, later in found} == {53}
    assert len(found) >= 20


def test_where_many_pairs_agree_few_are_kept(monkeypatch):
    walk = am.simulate.person(frames=400, seed=3)
    frame = walk.detections.frame_of
    labels = np.where(frame < 150, walk.labels, np.where(frame < 260, -1, walk.labels + 53))
    tracks = am.Tracks(detections=walk.detections, labels=labels)
    name, sizes = "asterism.tracking.stitching.returned", []
    bodies = importlib.import_module(name)._bodies
    monkeypatch.setattr(f"{name}._bodies", lambda alike: sizes.append(len(alike)) or bodies(alike))
    all_pairs = returned(tracks, NOISE)
    monkeypatch.setattr(f"{name}.MANY", 0)
    few = returned(tracks, NOISE)
    assert sizes[1] < sizes[0] / 2
    assert {later - earlier for earlier, later in few} == {53}
    assert len(few) > len(all_pairs) - 10


@pytest.mark.parametrize("order", [[0, 1, 2], [2, 1, 0], [1, 2, 0]])
def test_all_visits_are_joined_to_one_marker(order):
    """Whatever the order in which the visits are numbered."""
    tracks = seen_in_turn(UNEVEN, UNEVEN, UNEVEN)
    labels = (np.array(order)[tracks.labels // 5] * 5 + tracks.labels % 5).astype(np.int32)
    found = Pass(
        tracklets=labels, markers=np.arange(15, dtype=np.int32),
        after=np.full(15, -1, dtype=np.int32), probabilities=np.ones(15),
    )  # fmt: skip
    joined = joined_by_distances(tracks.detections, found, NOISE, None)
    assert len(np.unique(joined.markers)) == 5
    np.testing.assert_array_equal(joined.markers[:5], joined.markers[5:10])
    np.testing.assert_array_equal(joined.markers[:5], joined.markers[10:])


def test_a_marker_has_no_two_tracks_of_one_time():
    """The third body would give the markers of the first tracks two tracks each."""
    follows = np.ones((12, 12), dtype=bool)
    follows[6:9, 9:] = follows[9:, 6:9] = False
    bodies = {
        ((0, 3), (1, 4), (2, 5)): 9.0,
        ((3, 6), (4, 7), (5, 8)): 8.0,
        ((0, 9), (1, 10), (2, 11)): 7.0,
    }
    found = _clear(bodies, follows)
    assert sorted(map(sorted, found)) == [[0, 3, 6], [1, 4, 7], [2, 5, 8]]


def test_all_of_a_person_is_stitched():
    walk = am.simulate.person(frames=900, seed=5)
    positions = walk.positions()
    positions[300:500] = np.nan
    away = am.Tracks.from_dense(walk.detections.times, positions)
    truth = am.simulate.corrupt(away, burst=am.simulate.Burst(), noise=3e-4, seed=5)
    assert am.evaluate(am.track(truth.detections), truth).idf1 > 0.9


def test_joins_are_those_of_the_best_assignment():
    """Against all assignments of all subsets, by the log odds that `returned` states."""
    rng, n_found = np.random.default_rng(8), 0
    for _ in range(20):
        body, other = rng.uniform(0, 0.5, (2, 4, 3))
        later = np.concatenate([body[[2, 0, 3]] + rng.normal(scale=1e-3, size=3), other[:1]])
        tracks = seen_in_turn(body, later)
        pairs = best_assignment(tracks.positions())
        found = returned(tracks, NOISE)
        assert [pair for pair in found if pair not in pairs] == []
        n_found += found == sorted(pairs)
    assert n_found >= 15


def best_assignment(positions):
    """Return the pairs with the largest log odds, by looking at all."""
    first = [int(np.flatnonzero(np.isfinite(p[:, 0]))[0]) for p in positions.swapaxes(0, 1)]
    n = sum(each == 0 for each in first)
    at = {k: positions[first[k] : first[k] + 40, k] for k in range(len(first))}
    kept = {
        (a, b): np.median(np.linalg.norm(at[a] - at[b], axis=1))
        for group in (range(n), range(n, len(first)))
        for a, b in permutations(group, 2)
    }

    def ratio(one, other):
        mean = kept[one[0], other[0]]
        spread = np.hypot(*(np.hypot(np.sqrt(2) * 1e-3, 0.01 * x) for x in (mean, mean)))
        off = mean - kept[one[1], other[1]]
        log_t = [
            -2 * np.log1p(off**2 / (3 * s**2)) - np.log(s)
            for s in (spread, np.hypot(spread, UNKNOWN))
        ]
        return log_t[0] - log_t[1]

    best, odds = set(), 0.0
    sizes = range(3, n + 1)
    for earlier in chain.from_iterable(combinations(range(n), size) for size in sizes):
        for later in permutations(range(n, len(first)), len(earlier)):
            body = list(zip(earlier, later, strict=True))
            ratios = [ratio(one, other) for one, other in combinations(body, 2)]
            m = len(body)
            total = (3 * m - 6) * np.mean(ratios)
            if min(ratios) > ALIKE and total > odds:
                best, odds = set(body), total
    return best
