"""Bonds between markers, and tracks named by them."""

from __future__ import annotations

import dataclasses
import itertools

import numpy as np
import pytest
from scipy import stats
from scipy.spatial.transform import Rotation

import asterism as am


def moving(shape, n_frames=120, seed=0, noise=0.0):
    """A rigid body that turns and wanders."""
    rng = np.random.default_rng(seed)
    t = np.arange(n_frames) / 100
    turns = Rotation.from_rotvec(np.cumsum(rng.normal(scale=0.03, size=(n_frames, 3)), axis=0))
    places = np.stack([turns.apply(x) for x in shape], axis=1)
    places += np.cumsum(rng.normal(scale=0.005, size=(n_frames, 1, 3)), axis=0)
    return t, places + rng.normal(scale=noise, size=places.shape)


def part(tracks, first, last):
    """The frames from first to last - 1."""
    d = tracks.detections
    inside = (d.frame_of >= first) & (d.frame_of < last)
    cut = am.Detections(
        times=d.times[first:last],
        offsets=d.offsets[first : last + 1] - d.offsets[first],
        points=d.points[inside],
    )
    return am.Tracks(detections=cut, labels=tracks.labels[inside], names=tracks.names)


def shuffled(tracks, seed):
    """The same without names in another order; and of each track now which it was."""
    was = np.random.default_rng(seed).permutation(tracks.n_tracks)
    labels = np.where(tracks.labels >= 0, np.argsort(was)[tracks.labels], -1)
    return am.Tracks(detections=tracks.detections, labels=labels), was


def test_distances_and_spreads_are_those_of_the_capture():
    rng = np.random.default_rng(1)
    t, places = moving(rng.uniform(-0.2, 0.2, (5, 3)))
    places[:, 4] += 0.03 * np.sin(9 * t)[:, None]  # hangs loosely
    places[30:60, 2] = np.nan
    bonds = am.learn_bonds(am.Tracks.from_dense(t, places, "ABCDE"))
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
    bonds = am.learn_bonds(am.Tracks.from_dense(t, take))
    whose = np.repeat([0, 1, 2, 3], [*sizes, 1])[order]
    expected = {tuple(np.flatnonzero(whose == n).tolist()) for n in range(3)}
    assert set(bonds.clusters) == expected
    for cluster in bonds.clusters:  # all pairs rigid
        rigid = {tuple(pair) for pair in bonds.pairs[bonds.rigid].tolist()}
        assert set(itertools.combinations(cluster, 2)) <= rigid


def test_only_the_steadiest_are_kept():
    truth = am.simulate.person(seed=2)
    few, many = am.learn_bonds(truth, neighbours=4), am.learn_bonds(truth, neighbours=16)
    assert len(few.pairs) < len(many.pairs)
    n_bonds = np.bincount(few.pairs.ravel(), minlength=truth.n_tracks)
    assert n_bonds.min() >= 4
    assert {tuple(p) for p in few.pairs.tolist()} <= {tuple(p) for p in many.pairs.tolist()}


def test_bonds_come_back_from_their_file(tmp_path):
    truth = am.simulate.person(seed=3)
    bonds = am.learn_bonds(truth)
    text = bonds.to_toml(tmp_path / "bonds.toml")
    again = am.tracking.Bonds.from_toml(tmp_path / "bonds.toml")
    assert again.to_toml() == text
    assert again.names == bonds.names
    np.testing.assert_array_equal(again.pairs, bonds.pairs)
    np.testing.assert_allclose(again.distances, bonds.distances, atol=1e-6)
    np.testing.assert_allclose(again.places, bonds.places, atol=1e-6)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('format = "asterism bonds"', 'format = "model"', "format"),
        ("axes = 3", "axes = 4", "axes"),
        ("axes = 3", "axes = 3.0", "axes: expected 2 or 3, found 3.0"),
        ('name = "B"', 'name = "A"', "names"),
        ('name = "B"', 'title = "B"', "marker 2"),
        ('    "B",', '    "X",', "X"),
        ("distance = ", "distanec = ", "distance"),
        ("distance = ", 'distance = "far" #', "distance"),
        ("spread = ", "spread = -", "spread"),
        ("frames = ", f"frames = 1{'0' * 400} #", "frames of bond 1"),
        ("frames = ", "frames = 1.5 #", "frames of bond 1"),
        ('    "C",', '    "B",', r"pairs: .* found \(0, 1\)"),
        ("[[bond]]", "[[bond", "TOML"),
    ],
)
def test_files_that_are_wrong_are_refused(tmp_path, old, new, message):
    t, places = moving(np.random.default_rng(0).uniform(size=(3, 3)), noise=1e-3)
    path = tmp_path / "bonds.toml"
    text = am.learn_bonds(am.Tracks.from_dense(t, places, "ABC")).to_toml()
    assert old in text
    path.write_text(text.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(am.FormatError, match=message):
        am.tracking.Bonds.from_toml(path)


@pytest.mark.parametrize("seed", range(4))
def test_a_person_is_named_in_the_next_capture(seed):
    truth = am.simulate.person(seed=seed)
    half = truth.detections.n_frames // 2
    bonds = am.learn_bonds(part(truth, 0, half))
    take, was = shuffled(part(truth, half, 2 * half), seed)
    found = am.name_tracks(take, bonds)
    np.testing.assert_array_equal(found.markers, was)
    assert (found.probabilities > 0.9).mean() > 0.9
    assert found.tracks.names == tuple(bonds.names[k] for k in was)
    np.testing.assert_array_equal(found.tracks.labels, take.labels)


@pytest.mark.parametrize("seed", range(3))
def test_markers_may_be_stuck_on_anew(seed):
    truth = am.simulate.person(seed=seed)
    rng = np.random.default_rng(seed)
    bonds = am.learn_bonds(truth)
    places = truth.positions() + rng.normal(scale=0.003, size=(1, truth.n_tracks, 3))
    take, was = shuffled(am.Tracks.from_dense(truth.detections.times, places), seed)
    found = am.name_tracks(take, bonds)
    assert np.mean(found.markers == was) > 0.95


def test_a_body_and_its_mirror_image_are_distinguished():
    rng = np.random.default_rng(4)
    for seed in range(5):
        shape = rng.uniform(-0.3, 0.3, (7, 3))
        t, own = moving(shape, seed=seed, noise=1e-3)
        _, other = moving(shape * [1, 1, -1], seed=seed + 50, noise=1e-3)
        both = np.concatenate([own, other + np.array([2, 0, 0])], axis=1)
        bonds = am.learn_bonds(am.Tracks.from_dense(t[:60], both[:60]))
        take, was = shuffled(am.Tracks.from_dense(t[60:], both[60:]), seed)
        np.testing.assert_array_equal(am.name_tracks(take, bonds).markers, was)


def test_pieces_of_a_marker_become_one_track():
    truth = am.simulate.person(seed=5)
    d = truth.detections
    labels = truth.labels.copy()
    labels[(labels == 7) & (d.frame_of >= 150) & (d.frame_of < 180)] = -1
    labels[(labels == 7) & (d.frame_of >= 180)] = truth.n_tracks
    found = am.name_tracks(am.Tracks(detections=d, labels=labels), am.learn_bonds(truth))
    assert found.markers[7] == found.markers[truth.n_tracks] == 7
    assert found.tracks.n_tracks == truth.n_tracks
    assert am.evaluate(found.tracks, truth).switches == 0


def test_markers_outside_the_set_have_no_name():
    rng = np.random.default_rng(6)
    t, places = moving(rng.uniform(-0.3, 0.3, (9, 3)))
    bonds = am.learn_bonds(am.Tracks.from_dense(t, places[:, :6]))
    # Six markers of the set, and three of no set.
    places[:, 6:] = 3 + np.cumsum(rng.normal(scale=0.02, size=(len(t), 3, 3)), axis=0)
    found = am.name_tracks(am.Tracks.from_dense(t, places), bonds)
    np.testing.assert_array_equal(found.markers, [0, 1, 2, 3, 4, 5, -1, -1, -1])
    assert (found.probabilities[6:] == 0).all()


def test_tracks_without_a_name_enter_no_marker_set():
    # A recorder's own channels are no markers: learnt, they would name real markers T003 or *12.
    places = np.tile(np.random.default_rng(8).uniform(size=(6, 3)), (30, 1, 1))
    names = [None, "T000", "T004", "*12", "Unlabeled 7", "LASI"]
    bonds = am.learn_bonds(am.Tracks.from_dense(np.arange(30) / 100, places, names))
    assert bonds.names == ("T000", "T004", "LASI")
    assert [tuple(pair) for pair in bonds.pairs] == [(0, 1), (0, 2), (1, 2)]
    np.testing.assert_allclose(bonds.distances[1], np.linalg.norm(places[0, 1] - places[0, 5]))


def test_markers_without_any_name_are_numbered():
    places = np.tile(np.random.default_rng(8).uniform(size=(3, 3)), (30, 1, 1))
    take = am.Tracks.from_dense(np.arange(30) / 100, places)
    assert am.learn_bonds(take).names == ("T000", "T001", "T002")


def test_takes_without_anything_to_tell():
    bonds = am.learn_bonds(am.simulate.person(seed=1))
    empty = am.Tracks.from_dense(np.arange(5) / 100, np.full((5, 2, 3), np.nan))
    found = am.name_tracks(empty, bonds)
    assert found.n_named == 0
    assert len(am.learn_bonds(empty).pairs) == 0
    with pytest.raises(am.ParameterError, match="axes"):
        am.name_tracks(am.Tracks.from_dense([0, 1], np.zeros((2, 1, 2))), bonds)


def test_two_axes_will_do():
    rng = np.random.default_rng(7)
    t, places = moving(np.c_[rng.uniform(-0.3, 0.3, (8, 2)), np.zeros(8)], noise=1e-4)
    turn = np.cumsum(rng.normal(scale=0.05, size=len(t)))
    flat = places[0, :, :2] @ Rotation.from_rotvec([[0, 0, a] for a in turn]).as_matrix()[:, :2, :2]
    bonds = am.learn_bonds(am.Tracks.from_dense(t, flat))
    take, was = shuffled(am.Tracks.from_dense(t, flat), 1)
    np.testing.assert_array_equal(am.name_tracks(take, bonds).markers, was)


@pytest.mark.parametrize("wrong", [{"neighbours": 0}, {"min_frames": 1}, {"neighbours": 2.5}])
def test_options_out_of_range_are_refused(wrong):
    with pytest.raises(am.ParameterError, match=next(iter(wrong))):
        am.learn_bonds(am.simulate.cube(seed=1), **wrong)


def test_of_two_at_once_only_one_is_the_marker():
    shape = np.random.default_rng(9).uniform(-0.3, 0.3, (8, 3))
    t, places = moving(np.vstack([shape, shape[2] + 0.004]), noise=1e-4)
    bonds = am.learn_bonds(am.Tracks.from_dense(t, places[:, :8]))
    found = am.name_tracks(am.Tracks.from_dense(t, places), bonds)
    assert sorted(found.markers) == [-1, *range(8)]
    assert found.markers[2] == 2 or found.markers[8] == 2
    assert found.tracks.n_tracks == 9


@pytest.mark.parametrize("seed", range(4))
def test_names_are_as_probable_as_among_all_ways_of_naming(seed):
    rng = np.random.default_rng(seed)
    shape, t = rng.uniform(0, 0.06, (4, 2)), np.arange(60) / 100
    before, take = (
        am.Tracks.from_dense(t, shape + rng.normal(scale=noise, size=(60, 4, 2)))
        for noise in (0.001, 0.002)
    )
    bonds, own = am.learn_bonds(before), am.learn_bonds(take)
    said = np.zeros((4, 4, 4, 4))
    for (i, j), (a, b) in itertools.product(enumerate(own.pairs), enumerate(bonds.pairs)):
        off = own.distances[i] - bonds.distances[a]
        varied = own.spreads[i] ** 2 + bonds.spreads[a] ** 2
        s = np.sqrt([varied + 0.0005**2, varied + (0.004 + 0.015 * bonds.distances[a]) ** 2])
        best = np.clip((stats.t(3).logpdf(off / s) - np.log(s) + np.log(2)).max(), -3, 7)
        for k, m in (j, j[::-1]):
            said[k, m, *b] = said[k, m, *b[::-1]] = best
    ways = [
        way
        for way in itertools.product(range(-1, 4), repeat=4)
        if len(named := [m for m in way if m >= 0]) == len(set(named))
    ]
    score = np.array(
        [
            sum(
                said[k, m, way[k], way[m]]
                for k, m in itertools.combinations(range(4), 2)
                if min(way[k], way[m]) >= 0
            )
            for way in ways
        ]
    )
    weights = np.exp(0.25 * (score - score.max()))
    best = np.array(ways[int(np.argmax(score))])
    probable = (np.array(ways) == best).T @ weights / weights.sum()
    found = am.name_tracks(take, bonds)
    np.testing.assert_array_equal(found.markers, best)
    np.testing.assert_allclose(found.probabilities, probable, atol=2e-3)


def test_a_body_may_be_elsewhere_in_the_next_capture():
    rng = np.random.default_rng(3)
    t, body = moving(rng.uniform(-0.3, 0.3, (8, 3)), noise=1e-4)
    _, stick = moving(np.array([[0, 0, 0], [0.2, 0, 0], [0, 0.3, 0]]), seed=1, noise=1e-4)
    learnt = am.learn_bonds(am.Tracks.from_dense(t, np.concatenate([body, stick], axis=1)))
    inside = (learnt.pairs[:, 0] < 8) == (learnt.pairs[:, 1] < 8)
    kept = {n: getattr(learnt, n)[inside] for n in ("pairs", "distances", "spreads", "frames")}
    bonds = dataclasses.replace(learnt, **kept)
    take = am.Tracks.from_dense(t, np.concatenate([body, stick + np.array([3, 0, 0])], axis=1))
    np.testing.assert_array_equal(am.name_tracks(take, bonds).markers, np.arange(11))


def test_who_comes_when_a_marker_has_gone_is_not_yet_that_marker():
    rng = np.random.default_rng(6)
    t, places = moving(rng.uniform(-0.3, 0.3, (7, 3)))
    bonds = am.learn_bonds(am.Tracks.from_dense(t, places[:, :6]))
    places[:, 6] = 1 + np.cumsum(rng.normal(scale=0.02, size=(len(t), 3)), axis=0)
    places[60:, 5] = places[:60, 6] = np.nan
    found = am.name_tracks(am.Tracks.from_dense(t, places), bonds)
    np.testing.assert_array_equal(found.markers, [0, 1, 2, 3, 4, 5, -1])


def test_frames_of_long_captures_are_counted_though_not_all_are_looked_at():
    places = np.tile([[0.0, 0, 0], [1, 0, 0], [0, 2, 0]], (2400, 1, 1))
    places[30:, 2] = np.nan
    bonds = am.learn_bonds(am.Tracks.from_dense(np.arange(2400) / 100, places))
    np.testing.assert_array_equal(bonds.pairs, [[0, 1], [0, 2], [1, 2]])
    np.testing.assert_array_equal(bonds.frames, [2400, 30, 30])
