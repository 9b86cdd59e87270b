"""Bonds: pairs of markers at a stable distance, and rigid clusters."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

import asterism as am
from asterism.tracking import learn_bonds
from tests.scenes import moving


def test_distances_and_spreads_are_those_of_the_capture():
    rng = np.random.default_rng(1)
    t, places = moving(rng.uniform(-0.2, 0.2, (5, 3)))
    places[:, 4] += 0.03 * np.sin(9 * t)[:, None]  # hangs loosely
    places[30:60, 2] = np.nan
    bonds = learn_bonds(am.Tracks.from_dense(t, places, "ABCDE"))
    assert [tuple(pair) for pair in bonds.pairs] == list(itertools.combinations(range(5), 2))
    for (i, j), distance, spread, n in zip(
        bonds.pairs, bonds.distances, bonds.spreads, bonds.frames, strict=True
    ):
        d = np.linalg.norm(places[:, i] - places[:, j], axis=1)
        d = np.sort(d[np.isfinite(d)])
        assert n == len(d)
        assert distance == pytest.approx(np.median(d), abs=1e-3)
        assert (spread < 1e-12) == (4 not in (i, j))
        assert spread == pytest.approx((np.quantile(d, 0.84) - np.quantile(d, 0.16)) / 2, abs=2e-3)
    assert bonds.clusters == ((0, 1, 2, 3),)


@pytest.mark.parametrize("seed", range(5))
def test_clusters_are_the_rigid_bodies(seed):
    rng = np.random.default_rng(seed)
    sizes = (5, 4, 3)
    parts = [
        moving(rng.uniform(-0.2, 0.2, (n, 3)), seed=10 * seed + n, noise=1e-4)[1] for n in sizes
    ]
    loose = moving(rng.uniform(-1, 1, (1, 3)), seed=99)[1]
    t = np.arange(120) / 100
    order = rng.permutation(sum(sizes) + 1)
    take = np.concatenate([*parts, loose], axis=1)[:, order]
    bonds = learn_bonds(am.Tracks.from_dense(t, take))
    whose = np.repeat([0, 1, 2, 3], [*sizes, 1])[order]
    expected = {tuple(np.flatnonzero(whose == n).tolist()) for n in range(3)}
    assert set(bonds.clusters) == expected
    for cluster in bonds.clusters:  # all pairs rigid
        rigid = {tuple(pair) for pair in bonds.pairs[bonds.rigid].tolist()}
        assert set(itertools.combinations(cluster, 2)) <= rigid


def test_only_the_steadiest_are_kept():
    truth = am.simulate.person(seed=2)
    few, many = learn_bonds(truth, neighbours=4), learn_bonds(truth, neighbours=16)
    assert len(few.pairs) < len(many.pairs)
    n_bonds = np.bincount(few.pairs.ravel(), minlength=truth.n_tracks)
    assert n_bonds.min() >= 4
    assert {tuple(p) for p in few.pairs.tolist()} <= {tuple(p) for p in many.pairs.tolist()}


def test_tracks_without_a_name_enter_no_marker_set():
    # A recorder's own channels are no markers: learnt, they would name real markers T003 or *12.
    places = np.tile(np.random.default_rng(8).uniform(size=(6, 3)), (30, 1, 1))
    names = [None, "T000", "T004", "*12", "Unlabeled 7", "LASI"]
    bonds = learn_bonds(am.Tracks.from_dense(np.arange(30) / 100, places, names))
    assert bonds.names == ("T000", "T004", "LASI")
    assert [tuple(pair) for pair in bonds.pairs] == [(0, 1), (0, 2), (1, 2)]
    np.testing.assert_allclose(bonds.distances[1], np.linalg.norm(places[0, 1] - places[0, 5]))


def test_markers_without_any_name_are_numbered():
    places = np.tile(np.random.default_rng(8).uniform(size=(3, 3)), (30, 1, 1))
    take = am.Tracks.from_dense(np.arange(30) / 100, places)
    assert learn_bonds(take).names == ("T000", "T001", "T002")


@pytest.mark.parametrize("wrong", [{"neighbours": 0}, {"min_frames": 1}, {"neighbours": 2.5}])
def test_options_out_of_range_are_refused(wrong):
    with pytest.raises(am.ParameterError, match=next(iter(wrong))):
        learn_bonds(am.simulate.cube(seed=1), **wrong)


def test_frames_of_long_captures_are_counted_though_not_all_are_looked_at():
    places = np.tile([[0.0, 0, 0], [1, 0, 0], [0, 2, 0]], (2400, 1, 1))
    places[30:, 2] = np.nan
    bonds = learn_bonds(am.Tracks.from_dense(np.arange(2400) / 100, places))
    np.testing.assert_array_equal(bonds.pairs, [[0, 1], [0, 2], [1, 2]])
    np.testing.assert_array_equal(bonds.frames, [2400, 30, 30])
