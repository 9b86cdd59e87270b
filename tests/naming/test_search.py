"""The search for names against its reference implementation."""

from __future__ import annotations

import numpy as np
import pytest

import asterism as am
from asterism import _engine
from asterism.tracking.naming.evidence import TrackStats
from asterism.tracking.naming.search import search
from tests.references import naming
from tests.scenes import moving

WEIGHTS = (0.3, 0.4, 0.15, 0.15)


def made_up(seed, n_tracks=7, n_markers=8):
    """Arguments of the engine's evidence: random tracks, and markers partly at their distances."""
    rng = np.random.default_rng(seed)
    _, places = moving(rng.uniform(-0.3, 0.3, (n_tracks, 3)), n_frames=30, seed=seed, noise=2e-3)
    places[:, 0] += rng.normal(scale=0.02, size=(30, 3))
    places[5:20, 1] = np.nan
    stats = TrackStats.of(places)
    distances = rng.uniform(0.05, 0.6, (n_markers, n_markers))
    n = min(n_tracks, n_markers)
    distances[:n, :n] = stats.distances.middle[:n, :n] * rng.uniform(0.97, 1.03, (n, n))
    distances = np.triu(distances, 1)
    distances = distances + distances.T
    movements = np.where(rng.uniform(size=distances.shape) < 0.5, np.nan, 0.01)
    movements = np.triu(movements, 1) + np.triu(movements, 1).T
    distances[0, 1] = distances[1, 0] = np.nan
    quads = np.array([rng.permutation(n_markers)[:4] for _ in range(12)])
    heights = np.stack(
        [rng.normal(scale=0.1, size=12), rng.uniform(1e-4, 1e-3, 12), rng.uniform(0.2, 1, 12)], 1
    )
    i, j = stats.pairs.T
    return {
        "distances": distances,
        "movements": movements,
        "variations": np.full(distances.shape, 0.006),
        "prior": rng.uniform(-3.0, 0.0, (n_tracks, n_markers)),
        "quads": quads,
        "heights": heights,
        "pairs": stats.pairs,
        "pair_distances": stats.distances.middle[i, j],
        "pair_spreads": stats.distances.spread[i, j],
        "positions": np.ascontiguousarray(stats.positions),
        "spreads": np.where(stats.distances.n_frames > 0, stats.distances.spread, np.nan),
        "size": 1.03,
        "weights": np.array(WEIGHTS),
        "none": -8.0,
    }


def random_names(rng, n_tracks, n_markers):
    names = rng.permutation(np.append(np.arange(n_markers), np.full(n_tracks, -1)))[:n_tracks]
    return names.astype(np.int64)


@pytest.mark.parametrize("seed", range(6))
def test_scores_are_those_of_plain_loops(seed):
    given = made_up(seed)
    evidence = _engine.NameEvidence(**given)
    rng = np.random.default_rng(seed)
    for _ in range(30):
        names = random_names(rng, 7, 8)
        assert evidence.total(names) == pytest.approx(naming.total(given, names), abs=2e-4)


@pytest.mark.parametrize("seed", range(6))
def test_the_score_of_a_marker_is_what_naming_a_track_adds(seed):
    given = made_up(seed)
    given["quads"], given["heights"] = given["quads"][:0], given["heights"][:0]
    evidence = _engine.NameEvidence(**given)
    rng = np.random.default_rng(seed)
    names = random_names(rng, 7, 8)
    scores = evidence.scores(names)
    free = set(range(8)) - set(names.tolist())
    for k in range(7):
        without = names.copy()
        without[k] = -1
        for m in free | {int(names[k])} - {-1}:
            named = without.copy()
            named[k] = m
            gain = evidence.total(named) - evidence.total(without)
            assert scores[k, m] + 8.0 == pytest.approx(gain, abs=1e-4)


@pytest.mark.parametrize("seed", range(8))
def test_the_search_finds_the_best_of_all_assignments(seed):
    given = made_up(seed, n_tracks=5, n_markers=5)
    best, way = naming.best_names(given, 5, 5)[0]
    evidence = _engine.NameEvidence(**given)
    search = _engine.NameSearch(
        evidence, groups=[[0, 1, 2, 3, 4], [0, 1, 2]], partner=np.array([1, 0, -1, 4, 3]),
        near=[[j for j in range(5) if j != k] for k in range(5)],
    )  # fmt: skip
    rng = np.random.default_rng(seed)
    found = [search.improved(random_names(rng, 5, 5)) for _ in range(12)]
    names, score = max(found, key=lambda item: item[1])
    assert score == pytest.approx(evidence.total(names))
    assert score == pytest.approx(best, abs=1e-3), (names, way)


def test_every_move_keeps_each_name_once():
    truth = am.simulate.person(frames=60, seed=1)
    made = am.learn_marker_set(truth)
    found = am.name_tracks(truth, made)
    given = [name for name in found.tracks.names if name]
    assert len(given) == len(set(given)) == 53


def test_a_point_beside_a_marker_that_is_not_worn_is_not_that_marker():
    truth = am.simulate.person(frames=120, seed=2)
    made = am.learn_marker_set(truth.part(0, 1))
    places = truth.positions()
    k = truth.names.index("RTHI")
    places[:, k] += 0.2 * (places[:, truth.names.index("RKNE")] - places[:, k])  # 4 cm
    found = am.name_tracks(am.Tracks.from_dense(truth.detections.times, places), made)
    assert found.markers[k] is None
    assert found.missing == ("RTHI",)
    assert found.n_named == truth.n_tracks - 1


def test_a_name_goes_to_a_track_without_one():
    """No start gives it, and the track that has it fits nearly as well."""
    truth = am.simulate.person(frames=60, seed=2)
    made = am.learn_marker_set(truth.part(0, 1))
    names = np.arange(truth.n_tracks)
    a, b = made.names.index("LWRA"), made.names.index("LWRB")
    made = made.select([m for m in names if m != b])
    number = {name: m for m, name in enumerate(made.names)}
    right = np.array([number.get(name, -1) for name in truth.names])
    start = right.copy()
    start[b], start[a] = right[a], -1
    found = search(made, truth.positions(), "z", start=start)
    assert (found.names == right).all()
