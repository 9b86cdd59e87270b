"""Marker sets: what is learnt, merged, written and refused."""

from __future__ import annotations

import numpy as np
import pytest

import asterism as am
from asterism.model.marker_geometry import heights
from asterism.model.marker_set import other_side, side_of
from tests.scenes import moving


def person(seed=1, frames=120):
    return am.simulate.person(frames=frames, seed=seed)


def test_distances_and_movements_are_those_of_the_capture():
    rng = np.random.default_rng(1)
    t, places = moving(rng.uniform(-0.2, 0.2, (5, 3)))
    places[:, 4] += 0.2 * np.sin(9 * t)[:, None]  # hangs loosely
    places[30:60, 2] = np.nan
    made = am.learn_marker_set(am.Tracks.from_dense(t, places, "ABCDE"))
    for i in range(5):
        for j in range(i):
            d = np.linalg.norm(places[:, i] - places[:, j], axis=1)
            d = d[np.isfinite(d)]
            off = 5e-3 if 4 in (i, j) else 1e-9  # the engine sorts, without interpolation
            assert made.distances[i, j] == pytest.approx(np.median(d), abs=off)
            assert (made.movements[i, j] > 0.01) == (4 in (i, j))
    assert made.segments == ("segment 1",) * 4 + (None,)
    assert made.knows_movement


def test_a_static_trial_does_not_know_movement():
    truth = person()
    still = np.repeat(truth.positions()[:1], 30, axis=0)
    made = am.learn_marker_set(am.Tracks.from_dense(np.arange(30) / 100, still, truth.names))
    assert not made.knows_movement
    assert np.isnan(made.height_spreads).all()
    both = am.learn_marker_set(am.Tracks.from_dense(np.arange(30) / 100, still, truth.names), truth)
    assert both.knows_movement


def test_markers_of_the_static_trial_alone_are_rare():
    truth = person()
    still = np.repeat(truth.positions()[:1], 30, axis=0)
    static = am.Tracks.from_dense(np.arange(30) / 100, still, truth.names)
    walk = truth.select([k for k in range(truth.n_tracks) if truth.names[k] != "LHEE"])
    made = am.learn_marker_set(static, walk)
    at = made.names.index("LHEE")
    assert made.presences[at] == 0
    assert (np.delete(made.presences, at) == 1).all()
    found = am.name_tracks(walk, made)
    assert found.missing == ("LHEE",)


def test_heights_tell_left_from_right():
    made = am.learn_marker_set(person())
    mirrored = made.places * [1, -1, 1]
    known = np.isfinite(made.heights)
    np.testing.assert_allclose(
        np.sign(heights(mirrored, made.quads))[known], -np.sign(made.heights)[known]
    )


def test_sides_and_partners_follow_from_names():
    assert [side_of(n) for n in ("LKNE", "RightKnee", "knee_l", "C7", "L", "T10")] == [
        "left", "right", "left", None, None, None,
    ]  # fmt: skip
    assert other_side("LeftKnee") == "RightKnee"
    made = am.learn_marker_set(person())
    for m, p in enumerate(made.partners):
        assert p == -1 or made.partners[p] == m
    assert made.names[made.partners[made.names.index("LKNE")]] == "RKNE"


@pytest.mark.parametrize("seed", range(3))
def test_sets_come_back_from_their_file(tmp_path, seed):
    made = am.learn_marker_set(person(seed)).of_subject("Ann B")
    text = made.to_toml(tmp_path / "set.toml")
    again = am.MarkerSet.from_toml(tmp_path / "set.toml")
    assert again.to_toml() == text
    assert again.full_names == made.full_names
    assert (again.segments, again.n_subjects, again.up) == (made.segments, 1, "z")
    for name in ("places", "distances", "movements", "variations", "heights", "height_spreads"):
        np.testing.assert_allclose(getattr(again, name), getattr(made, name), atol=1.1e-5)
    np.testing.assert_array_equal(again.quads, made.quads)


def test_a_set_by_hand_needs_names_and_places(tmp_path):
    truth = person()
    made = am.learn_marker_set(truth)
    rows = [
        f'"{name}" = {{place = [{", ".join(f"{x:.4f}" for x in place)}]}}'
        for name, place in zip(made.names, made.places, strict=True)
    ]
    path = tmp_path / "hand.toml"
    path.write_text('format = "asterism marker set 1"\n[markers]\n' + "\n".join(rows))
    hand = am.MarkerSet.from_toml(path)
    np.testing.assert_allclose(hand.distances, made_distances(made.places), atol=2e-4)
    found = am.name_tracks(truth, hand)
    assert np.mean([a == b for a, b in zip(found.markers, truth.names, strict=True)]) > 0.9


def made_distances(places):
    return np.linalg.norm(places[:, None] - places[None], axis=2)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('format = "asterism marker set 1"', 'format = "model"', "format"),
        ('up = "z"', 'up = "w"', "up"),
        ("subjects = 1", "subjects = 0", "n_subjects"),
        ("subjects = 1", "subject = 3", "subject"),
        ("place = [", "place = [1, ", "place of A"),
        ("place = [", 'place = ["x", ', "place of A"),
        ("place = [", "places = [", "place"),
        ("[distances.A]", "[distances.X]", "no X"),
        ("B = [", "B = [inf, ", "distances.A.B"),
        ('["A", ', '["X", ', "no X"),
        ('["A", ', "[3, ", "no 3"),
        ('["A", ', '["A", "A", ', "row 1"),
        ("[markers]", "[markers", "TOML"),
    ],
)
def test_files_that_are_wrong_are_refused(tmp_path, old, new, message):
    t, places = moving(np.random.default_rng(0).uniform(size=(5, 3)), noise=1e-3)
    path = tmp_path / "set.toml"
    text = am.learn_marker_set(am.Tracks.from_dense(t, places, "ABCDE")).to_toml()
    assert old in text
    path.write_text(text.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(am.FormatError, match=message):
        am.MarkerSet.from_toml(path)


def test_placeholders_of_a_recorder_are_no_markers():
    places = np.tile(np.random.default_rng(8).uniform(size=(6, 3)), (30, 1, 1))
    names = [None, "T000", "Ann:T004", "*12", "Unlabeled 7", "Ann:LASI"]
    made = am.learn_marker_set(am.Tracks.from_dense(np.arange(30) / 100, places, names))
    assert made.names == ("T000", "T004", "LASI")
    assert made.full_names == ("Ann:T000", "Ann:T004", "Ann:LASI")


def test_merged_sets_know_the_variation_between_subjects():
    shape = np.random.default_rng(2).uniform(-0.3, 0.3, (6, 3))
    sets = []
    for n, size in enumerate((0.9, 1.0, 1.1, 1.0)):
        own = size * shape
        own[0] += [0.02 * (n - 1.5), 0, 0]  # attached elsewhere on each subject
        t, places = moving(own, seed=n, noise=1e-4)
        sets.append(am.learn_marker_set(am.Tracks.from_dense(t, places, "ABCDEF")))
    made = am.merge_marker_sets(*sets)
    assert made.n_subjects == 4
    others = np.ix_(range(1, 6), range(1, 6))
    np.testing.assert_allclose(made.distances[others], made_distances(shape)[others], rtol=0.02)
    assert made.variations[others].max() < 0.004 < made.variations[0].max()
    assert am.merge_marker_sets(sets[0]) is sets[0]


def test_one_subject_with_exchanged_names_does_not_spoil_the_median():
    shape = np.random.default_rng(2).uniform(-0.3, 0.3, (6, 3))
    sets = []
    for n in range(5):
        t, places = moving(shape, seed=n, noise=1e-4)
        names = "BACDEF" if n == 2 else "ABCDEF"
        sets.append(am.learn_marker_set(am.Tracks.from_dense(t, places, names)))
    made = am.merge_marker_sets(*sets)
    order = [made.names.index(name) for name in "ABCDEF"]
    np.testing.assert_allclose(
        made.distances[np.ix_(order, order)], made_distances(shape), atol=2e-3
    )


@pytest.mark.parametrize(
    "wrong",
    [
        {"names": ("A", "A")},
        {"places": np.zeros((2, 2))},
        {"distances": np.zeros((3, 3))},
        {"quads": [[0, 1, 2, 3]]},
        {"segments": ("x",)},
        {"presences": [0.5, 2.0]},
        {"up": "up"},
        {"n_subjects": 0},
        {"subject": 3},
    ],
)
def test_fields_that_do_not_fit_are_refused(wrong):
    fields = {"names": ("A", "B"), "places": np.zeros((2, 3))}
    with pytest.raises(am.ParameterError, match=next(iter(wrong))):
        am.MarkerSet(**{**fields, **wrong})
