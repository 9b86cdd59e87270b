"""Fragments made into markers: rigid fits, what neighbours carry, joins, cuts and ghosts."""

from __future__ import annotations

import dataclasses
import functools

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import asterism as am
from asterism import _engine
from asterism.simulate import Burst, Ghosts
from tests.scenes import stitched

PERSON = am.simulate.person


def disturbed(seed, *, scene=PERSON, **more):
    truth = scene(seed=seed)
    return am.simulate.corrupt(truth, burst=Burst(), ghosts=Ghosts(), noise=3e-4, seed=seed, **more)


@functools.cache
def person(seed):
    """A disturbed person, its model, and its markers as `stitch` finds them."""
    truth = disturbed(seed)
    model = am.estimate_model(truth.detections).model
    return truth, model, stitched(truth.detections, model=model)


def kabsch(a, b, w):
    """Fit by singular values, as textbooks have it."""
    w = w / w.sum()
    from_, to = w @ a, w @ b
    U, _, Vt = np.linalg.svd((a - from_).T @ ((b - to) * w[:, None]))
    signs = np.ones(a.shape[1])
    signs[-1] = np.sign(np.linalg.det(Vt.T @ U.T))
    R = Vt.T @ np.diag(signs) @ U.T
    return R, from_, to


@pytest.mark.parametrize("seed", range(30))
@pytest.mark.parametrize("D", [2, 3])
def test_rigid_fits_are_those_by_singular_values(seed, D):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(D + 1, 9))
    a, w = rng.normal(size=(n, D)), rng.uniform(0.1, 2, n)
    turn = Rotation.random(random_state=seed).as_matrix()
    if D == 2:
        angle = rng.uniform(-np.pi, np.pi)
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    b = a @ turn.T + rng.normal(size=D) + rng.normal(scale=0.1, size=(n, D))
    R, from_, to, rms = _engine.fit_rigid(a, b, w)
    expected, x, y = kabsch(a, b, w)
    np.testing.assert_allclose(R[:D, :D], expected, atol=1e-9)
    np.testing.assert_allclose(from_[:D], x, atol=1e-12)
    np.testing.assert_allclose(to[:D], y, atol=1e-12)
    left = (w @ ((a - x) @ expected.T + y - b) ** 2 / w.sum()).sum()
    free = n * D - D * (D + 1) / 2
    assert rms == pytest.approx(np.sqrt(left / D * n * D / free), rel=1e-9)


def test_a_rigid_fit_never_mirrors():
    a = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    R, *_, rms = _engine.fit_rigid(a, a * [1, 1, -1], np.ones(4))
    assert np.linalg.det(R) == pytest.approx(1)
    assert rms > 0.1


@pytest.mark.parametrize("n", [1, 2])
def test_too_few_pairs_are_moved_and_not_turned(n):
    a = np.eye(3)[:n]
    R, *_, rms = _engine.fit_rigid(a, a + np.array([1.0, 2, 3]), np.ones(n))
    np.testing.assert_array_equal(R, np.eye(3))
    assert rms == pytest.approx(0, abs=1e-12)


@pytest.mark.parametrize(
    ("method", "seed"),
    [
        *((am.SMP(window=3), seed) for seed in range(4)),
        *((am.GNN(), seed) for seed in range(2)),
        *((am.MCMCDA(confidence=0), seed) for seed in range(2)),
    ],
)
def test_occluded_markers_of_a_person_are_found_again(method, seed):
    truth, model, found = person(seed)
    lost = am.evaluate(am.track(truth.detections, method, model=model, seed=1), truth)
    if method != am.SMP(window=3):
        found = stitched(truth.detections, method, model=model, seed=1)
    e = am.evaluate(found.tracks, truth)
    assert e.idf1 > 0.985
    assert 1 - lost.idf1 > 5 * (1 - e.idf1)
    assert e.switches_per_1000 < 0.5
    assert e.clutter_labelled_percent < 12 < 80 < lost.clutter_labelled_percent


def test_joins_are_right_as_often_as_they_say():
    right: list[bool] = []
    sure: list[float] = []
    for seed in range(6):
        truth, _, found = person(seed)
        frame = truth.detections.frame_of
        for join in found.joins:
            own = found.tracks.labels == join.marker
            before = truth.labels[own & (frame <= join.last)]
            now = truth.labels[own & (frame == join.first)]
            # Right if it is what the marker was so far, for the most part.
            right.append(bool(now[0] >= 0 and now[0] == np.bincount(before + 1).argmax() - 1))
            sure.append(join.probability)
    is_right, p = np.array(right), np.array(sure)
    assert len(p) > 100
    assert is_right[p > 0.99].mean() > 0.97
    assert is_right[p < 0.9].mean() < is_right[p > 0.99].mean()
    assert is_right.mean() == pytest.approx(p.mean(), abs=0.05)


@pytest.mark.parametrize(
    ("scene", "noise"),
    [
        ("cube", 0.005),
        ("wander", 0.005),
        ("swarm", 3e-4),
        ("fingers", 3e-4),
        ("juggler", 3e-4),
        ("smooth", 0.005),
    ],
)
def test_it_does_no_harm(scene, noise):
    plain: list[float] = []
    joined: list[float] = []
    for seed in range(2):
        truth = am.simulate.corrupt(
            am.simulate.SCENES[scene].make(seed=seed),
            missing=0.1,
            clutter=0.1,
            noise=noise,
            seed=seed,
        )
        model = am.estimate_model(truth.detections).model
        tracks = am.track(truth.detections, am.SMP(window=3), model=model)
        plain.append(am.evaluate(tracks, truth).idf1)
        found = stitched(truth.detections, model=model)
        joined.append(am.evaluate(found.tracks, truth).idf1)
    assert np.mean(joined) > np.mean(plain) - 0.001


def test_where_neighbours_predict_no_marker_motion_decides():
    found: list[float] = []
    for seed in range(4):
        made = am.simulate.smooth(seed=seed)
        occluded = Burst(n=4, shortest=5, longest=12)
        truth = am.simulate.corrupt(made, burst=occluded, noise=0.005, seed=seed)
        found.append(am.evaluate(stitched(truth.detections).tracks, truth).idf1)
    assert np.mean(found) > 0.99  # 0.987 where the bodies always decide


def test_a_link_that_the_neighbours_contradict_is_cut():
    truth = am.simulate.corrupt(PERSON(seed=2), noise=3e-4, seed=2)
    d = truth.detections
    labels = truth.labels.copy()
    late = d.frame_of >= d.n_frames // 2
    a, b = 5, 30  # from here on they have each other's label
    labels[late & (truth.labels == a)], labels[late & (truth.labels == b)] = b, a
    model = am.estimate_model(d).model
    found = am.stitch(am.Tracks(detections=d, labels=labels), model)
    assert 2 <= len(found.cuts) <= 6
    e = am.evaluate(found.tracks, truth)
    assert e.switches == 0
    assert e.n_tracks == truth.n_tracks


def test_a_true_partition_without_gaps_is_hardly_changed():
    truth = am.simulate.corrupt(PERSON(seed=3), noise=3e-4, seed=3)
    model = am.estimate_model(truth.detections).model
    found = am.stitch(truth, model)
    assert len(found.cuts) <= 4  # in two passes over 15 847 links
    assert am.evaluate(found.tracks, truth).idf1 > 0.9999
    assert set(found.tracks.names) == set(truth.names)


def test_names_and_confidence_stay():
    truth, model, _ = person(1)
    model = am.tracking.tracklet_model(model)
    fragments = am.track(truth.detections, am.MCMCDA(), model=model, seed=1)
    named = dataclasses.replace(fragments, names=tuple(f"t{k}" for k in range(fragments.n_tracks)))
    found = am.stitch(named, model)
    assert found.tracks.confidence is not None
    assert named.confidence is not None
    assert (found.tracks.confidence <= named.confidence).all()
    assert any(join.probability < 0.999 for join in found.joins)
    # A marker is called what its first fragment is called.
    for marker in range(found.tracks.n_tracks):
        first = np.flatnonzero(found.tracks.labels == marker)[0]
        assert found.tracks.names[marker] == f"t{fragments.labels[first]}"


def test_no_two_markers_have_one_name():
    # The label goes on 0.3 m beside, with what is no longer the marker.
    places = np.tile(np.random.default_rng(1).uniform(-0.4, 0.4, (8, 3)), (200, 1, 1))
    places[100:, 3] += [0.3, 0, 0]
    take = am.Tracks.from_dense(np.arange(200) / 100, places, "ABCDEFGH")
    found = am.stitch(take, person(1)[1])
    assert found.tracks.names == (*"ABCDEFGH", None)
    assert found.bonds.names == tuple("ABCDEFGH")  # a track without a name is not learnt


def test_labels_come_from_fragments_and_joins_from_both():
    _, _, found = person(4)
    fragment, labels = found.tracklets, found.tracks.labels
    assert ((labels >= 0) <= (fragment >= 0)).all()
    assert (labels[fragment >= 0] == np.maximum(found.markers[fragment[fragment >= 0]], -1)).all()
    for join in found.joins:
        assert join.first > join.last
        assert 0 <= join.probability <= 1
    # Every fragment of a marker but the first goes on with another of it.
    for marker in range(found.tracks.n_tracks):
        own = np.flatnonzero(found.markers == marker)
        assert (found.after[own] < 0).sum() == 1
        assert set(found.after[own]) <= {-1, *own}


def test_the_same_input_gives_the_same():
    truth, model, one = person(5)
    two = stitched(truth.detections, model=model)
    np.testing.assert_array_equal(one.tracks.labels, two.tracks.labels)
    np.testing.assert_array_equal(one.probabilities, two.probabilities)


def test_in_the_plane():
    rng = np.random.default_rng(1)
    body = rng.uniform(-0.5, 0.5, (8, 2))
    frames = 300
    t = np.arange(frames)
    angle, middle = 0.02 * t, np.stack([0.01 * t, 0.3 * np.sin(0.05 * t)], axis=1)
    turn = np.stack([np.cos(angle), -np.sin(angle), np.sin(angle), np.cos(angle)], -1)
    at = np.einsum("tij,kj->tki", turn.reshape(-1, 2, 2), body) + middle[:, None]
    at += rng.normal(scale=5e-4, size=at.shape)
    at[100:140, 3] = np.nan
    at[120:150, 5] = np.nan
    truth = am.Tracks.from_dense(t / 100, at)
    found = stitched(truth.detections)
    assert am.evaluate(found.tracks, truth).idf1 == 1
    assert {(join.last, join.first) for join in found.joins} >= {(99, 140), (119, 150)}


@pytest.mark.parametrize("n_frames", [0, 1, 3])
def test_little_or_nothing(n_frames):
    d = am.Detections.from_frames(np.arange(n_frames) / 100, [[[0.0, 0, 0]]] * n_frames)
    model = am.TrackingModel(
        motion=am.DWNA(acceleration_sigma=1, velocity_sigma=1),
        sensor=am.Sensor(noise_sigma=1e-3, p_detection=0.9, clutter_density=0.1),
        population=am.Population(birth_density=0.1, p_disappear=0.001, max_speed=5, max_gap=4),
    )
    for labels in (np.zeros(n_frames, dtype=np.int64), np.full(n_frames, -1)):
        found = am.stitch(am.Tracks(detections=d, labels=labels), model)
        assert found.joins == ()
        assert len(found.cuts) == 0
        assert (found.tracks.labels == labels).all()


def test_a_marker_that_is_forgotten_is_new():
    truth, model, remembered = person(6)
    forgotten = stitched(truth.detections, model=model, max_occlusion=30)
    longest = max(join.first - join.last for join in forgotten.joins)
    assert longest <= 30 + 15
    assert forgotten.tracks.n_tracks > remembered.tracks.n_tracks


@pytest.mark.parametrize(
    ("wrong", "text"),
    [
        ({"confirm": 1}, "confirm"),
        ({"confirm": 2.5}, "confirm"),
        ({"ghost_radius": 0}, "ghost_radius"),
        ({"max_occlusion": 0}, "max_occlusion"),
    ],
)
def test_options_are_checked(wrong, text):
    truth = am.simulate.cube(seed=1)
    model = am.estimate_model(truth.detections).model
    with pytest.raises(am.ParameterError, match=text):
        am.stitch(truth, model, **wrong)


def test_what_is_no_tracks_is_refused():
    truth = am.simulate.cube(seed=1)
    model = am.estimate_model(truth.detections).model
    with pytest.raises(am.ParameterError, match=r"am\.track"):
        am.stitch(truth.detections, model)
    with pytest.raises(am.ParameterError, match="estimate_model"):
        am.stitch(truth, 3)


def sliding(seen, slides=True):
    """Seven markers of a body, and one on skin that slides back and forth, each in some frames."""
    body, times = np.random.default_rng(1).uniform(-0.15, 0.15, (8, 3)), np.arange(200) / 25
    turn = Rotation.from_euler("z", 0.5 * np.sin(2 * times)[:, None])
    dense = np.stack([turn.apply(p) for p in body], axis=1)
    dense[:, 0, 2] += 0.03 * (np.arange(200) // 9 % 2) * slides
    dense[~seen, 0] = np.nan
    dense += np.random.default_rng(2).normal(scale=3e-4, size=dense.shape)
    tracks = am.Tracks.from_dense(times, dense)
    return tracks, am.estimate_model(tracks.detections).model


@pytest.mark.parametrize(("n_seen", "n_tracks"), [(50, 7), (70, 8), (110, 8)])
def test_a_marker_that_its_neighbours_contradict_again_and_again_is_no_ghost(n_seen, n_tracks):
    tracks, model = sliding(np.arange(200) < n_seen)
    found = am.stitch(tracks, model)
    assert len(found.cuts) > 3
    assert found.tracks.n_tracks == n_tracks
    if n_tracks == 7:
        assert not found.joins
        return
    assert len(found.joins) == len(found.cuts)
    assert {join.probability for join in found.joins} == {0.95}
    assert (am.evaluate(found.tracks, tracks).idf1, len(found.ghosts)) == (1, 0)


def test_ghosts_of_a_track_with_many_other_detections_are_no_marker():
    tracks, model = sliding(np.ones(200, dtype=bool), slides=np.arange(200) < 100)
    found = am.stitch(tracks, model)
    _, _, n = found.extents
    assert n[found.ghosts].sum() > 60
    assert found.tracks.n_tracks == 8
