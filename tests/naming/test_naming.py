"""Tracks named by marker sets."""

from __future__ import annotations

import functools

import numpy as np
import pytest

import asterism as am
from tests.scenes import moving


@functools.cache
def person(seed):
    """A person, and its marker set."""
    truth = am.simulate.person(seed=seed)
    return truth, am.learn_marker_set(truth)


def shuffled(tracks, seed):
    """The same tracks without names in another order; and which each was before."""
    was = np.random.default_rng(seed).permutation(tracks.n_tracks)
    labels = np.where(tracks.labels >= 0, np.argsort(was)[tracks.labels], -1)
    return am.Tracks(detections=tracks.detections, labels=labels), was


def is_right(naming, names, was):
    return np.array([own == names[k] for own, k in zip(naming.markers, was, strict=True)])


@pytest.mark.parametrize("seed", range(4))
def test_a_person_is_named_in_the_next_capture(seed):
    truth = am.simulate.person(seed=seed)
    half = truth.detections.n_frames // 2
    made = am.learn_marker_set(truth.part(0, half))
    take, was = shuffled(truth.part(half, 2 * half), seed)
    found = am.name_tracks(take, made)
    assert is_right(found, truth.names, was).all()
    assert (found.probabilities > 0.9).mean() > 0.9
    assert found.tracks.names == made.names  # in the order of the set
    assert found.missing == ()
    assert found.changes == ()


@pytest.mark.parametrize("seed", range(3))
def test_a_single_frame_is_enough(seed):
    truth = am.simulate.person(seed=seed)
    take, was = shuffled(truth, seed)
    found = am.name_tracks(take, am.learn_marker_set(truth.part(3, 4)))
    assert is_right(found, truth.names, was).mean() > 0.95


@pytest.mark.parametrize("seed", range(3))
def test_markers_may_be_attached_again(seed):
    truth = am.simulate.person(seed=seed)
    rng = np.random.default_rng(seed)
    places = truth.positions() + rng.normal(scale=0.003, size=(1, truth.n_tracks, 3))
    take, was = shuffled(am.Tracks.from_dense(truth.detections.times, places), seed)
    found = am.name_tracks(take, am.learn_marker_set(truth))
    assert is_right(found, truth.names, was).mean() > 0.95


@pytest.mark.parametrize("size", [0.85, 1.15])
def test_a_subject_may_be_larger_or_smaller(size):
    truth = am.simulate.person(seed=3)
    places = size * truth.positions()
    take, was = shuffled(am.Tracks.from_dense(truth.detections.times, places), 1)
    found = am.name_tracks(take, am.learn_marker_set(truth))
    assert is_right(found, truth.names, was).all()


def test_a_body_and_its_mirror_image_are_distinguished():
    rng = np.random.default_rng(4)
    for seed in range(5):
        shape = rng.uniform(-0.3, 0.3, (7, 3))
        t, own = moving(shape, seed=seed, noise=1e-3)
        _, other = moving(shape * [1, 1, -1], seed=seed + 50, noise=1e-3)
        sets = []
        for subject, positions in (("own", own), ("other", other)):
            names = [f"{subject}:{n}" for n in range(7)]
            sets.append(am.learn_marker_set(am.Tracks.from_dense(t[:60], positions[:60], names)))
        both = np.concatenate([own, other + np.array([2, 0, 0])], axis=1)
        take, was = shuffled(am.Tracks.from_dense(t[60:], both[60:]), seed)
        names = [name for made in sets for name in made.full_names]
        assert is_right(am.name_tracks(take, *sets), names, was).all()


def test_pieces_of_a_marker_become_one_track():
    truth = am.simulate.person(seed=5)
    d = truth.detections
    labels = truth.labels.copy()
    labels[(labels == 7) & (d.frame_of >= 150) & (d.frame_of < 180)] = -1
    labels[(labels == 7) & (d.frame_of >= 180)] = truth.n_tracks
    found = am.name_tracks(am.Tracks(detections=d, labels=labels), am.learn_marker_set(truth))
    assert found.markers[7] == found.markers[truth.n_tracks] == truth.names[7]
    assert found.tracks.n_tracks == truth.n_tracks
    assert am.evaluate(found.tracks, truth).switches == 0


def test_two_tracks_that_exchanged_their_markers_are_cut():
    truth = am.simulate.person(seed=6)
    d = truth.detections
    names = list(truth.names)
    a, b = names.index("LTOE"), names.index("LMT5") if "LMT5" in names else names.index("LHEE")
    labels = truth.labels.copy()
    late = d.frame_of >= 160
    labels[late & (truth.labels == a)], labels[late & (truth.labels == b)] = b, a
    found = am.name_tracks(am.Tracks(detections=d, labels=labels), am.learn_marker_set(truth))
    given = np.array([*found.tracks.names, None], dtype=object)[found.tracks.labels]
    true = np.array(truth.names, dtype=object)[truth.labels]
    assert (given == true).mean() > 0.999
    assert {change.track for change in found.changes} == {a, b}
    assert all(abs(change.first - 160) <= 15 or change.first == 0 for change in found.changes)


def test_markers_outside_the_set_have_no_name():
    rng = np.random.default_rng(6)
    t, places = moving(rng.uniform(-0.3, 0.3, (9, 3)))
    made = am.learn_marker_set(am.Tracks.from_dense(t, places[:, :6], "ABCDEF"))
    # Six markers of the set, and three of no set.
    places[:, 6:] = 3 + np.cumsum(rng.normal(scale=0.02, size=(len(t), 3, 3)), axis=0)
    found = am.name_tracks(am.Tracks.from_dense(t, places), made)
    assert found.markers == (*"ABCDEF", None, None, None)


def test_a_set_of_another_body_gives_no_name():
    rng = np.random.default_rng(8)
    _, made = person(1)
    t, places = moving(rng.uniform(-0.8, 0.8, (30, 3)), seed=2)
    found = am.name_tracks(am.Tracks.from_dense(t, places), made)
    assert found.n_named == 0
    assert found.missing == made.names


def test_missing_markers_leave_their_names_unused():
    truth = am.simulate.person(seed=2)
    gone = (3, 11, 20, 40)
    kept = [k for k in range(truth.n_tracks) if k not in gone]
    take, was = shuffled(truth.select(kept), 2)
    found = am.name_tracks(take, am.learn_marker_set(truth))
    names = [truth.names[k] for k in kept]
    assert is_right(found, names, was).all()
    assert set(found.missing) == {truth.names[k] for k in gone}


def test_captures_without_anything_to_name():
    _, made = person(1)
    empty = am.Tracks.from_dense(np.arange(5) / 100, np.full((5, 2, 3), np.nan))
    assert am.name_tracks(empty, made).n_named == 0
    with pytest.raises(am.ParameterError, match="tracks with names"):
        am.learn_marker_set(empty)


def test_two_axes_will_do():
    rng = np.random.default_rng(7)
    t = np.arange(120) / 100
    angle = np.cumsum(rng.normal(scale=0.05, size=120))
    shape = rng.uniform(-0.3, 0.3, (8, 2))
    turn = np.stack([np.cos(angle), -np.sin(angle), np.sin(angle), np.cos(angle)], axis=1)
    flat = np.einsum("tij,kj->tki", turn.reshape(-1, 2, 2), shape)
    flat += rng.normal(scale=1e-4, size=flat.shape)
    made = am.learn_marker_set(am.Tracks.from_dense(t, flat, "ABCDEFGH"))
    take, was = shuffled(am.Tracks.from_dense(t, flat), 1)
    assert is_right(am.name_tracks(take, made), "ABCDEFGH", was).all()


def test_of_two_at_once_only_one_is_the_marker():
    shape = np.random.default_rng(9).uniform(-0.3, 0.3, (8, 3))
    t, places = moving(np.vstack([shape, shape[2] + 0.004]), noise=1e-4)
    made = am.learn_marker_set(am.Tracks.from_dense(t, places[:, :8], "ABCDEFGH"))
    found = am.name_tracks(am.Tracks.from_dense(t, places), made)
    assert sorted(filter(None, found.markers)) == list("ABCDEFGH")
    assert found.markers[2] == "C" or found.markers[8] == "C"
    assert found.tracks.n_tracks == 9


def test_a_track_after_a_marker_has_gone_is_not_yet_that_marker():
    rng = np.random.default_rng(6)
    t, places = moving(rng.uniform(-0.3, 0.3, (7, 3)))
    made = am.learn_marker_set(am.Tracks.from_dense(t, places[:, :6], "ABCDEF"))
    places[:, 6] = 1 + np.cumsum(rng.normal(scale=0.02, size=(len(t), 3)), axis=0)
    places[60:, 5] = places[:60, 6] = np.nan
    found = am.name_tracks(am.Tracks.from_dense(t, places), made)
    assert found.markers == (*"ABCDEF", None)


def test_a_set_whose_subject_is_absent_names_nothing():
    (one, set_of_one), (_, set_of_other) = person(1), person(2)
    sets = [set_of_one.of_subject("A"), set_of_other.of_subject("B")]
    found = am.name_tracks(am.Tracks(detections=one.detections, labels=one.labels), *sets)
    assert set(found.markers) == {f"A:{name}" for name in one.names}


@pytest.mark.parametrize("apart", [0.4, 1.5])
def test_two_bodies_that_move_in_step_have_their_own_names(apart):
    (one, set_of_one), (other, set_of_other) = person(1), person(2)
    sets = [set_of_one.of_subject("A"), set_of_other.of_subject("B")]
    places = np.concatenate([one.positions(), other.positions() + np.array([0, apart, 0])], axis=1)
    found = am.name_tracks(am.Tracks.from_dense(one.detections.times, places), *sets)
    right = [f"A:{name}" for name in one.names] + [f"B:{name}" for name in other.names]
    given = [(a, b) for a, b in zip(found.markers, right, strict=True) if a is not None]
    assert all(a == b for a, b in given)
    assert len(given) > 0.9 * len(right)


def test_subjects_that_cannot_be_told_apart_are_refused():
    truth = am.simulate.person(frames=80, seed=4)
    made = am.learn_marker_set(truth)
    both = np.concatenate([truth.positions(), truth.positions() + np.array([3, 0, 0])], axis=1)
    both[:, truth.n_tracks :, 0] += np.linspace(0, 1, 80)[:, None]  # walks on its own
    found = am.name_tracks(
        am.Tracks.from_dense(truth.detections.times, both),
        made.of_subject("A"),
        made.of_subject("B"),
    )
    assert found.n_named == 0
    with pytest.raises(am.ParameterError, match="names that differ"):
        am.name_tracks(truth, made, made)


def test_names_of_a_labelled_capture_are_checked():
    truth = am.simulate.person(seed=7)
    made = am.learn_marker_set(truth)
    assert am.tracking.check_names(truth, made) == ()
    names = list(truth.names)
    a, b = names.index("LTOE"), names.index("RTOE")
    names[a], names[b] = names[b], names[a]
    wrong = am.Tracks(detections=truth.detections, labels=truth.labels, names=tuple(names))
    conflicts = am.tracking.check_names(wrong, made)
    assert {(conflict.name, conflict.found) for conflict in conflicts} == {
        ("RTOE", "LTOE"),
        ("LTOE", "RTOE"),
    }
    assert all(conflict.first == 0 for conflict in conflicts)
