"""Names that a capture has itself, without a marker set."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import asterism as am
from asterism.tracking.naming.conflicts import kept_names

DROPPED = slice(0, 16)
"""Markers whose name the file does not have, in any frame."""
STRETCH = 60, 110
EXCHANGED = "LTOE", "LHEE"


@pytest.fixture(scope="module")
def truth():
    return am.simulate.person(frames=240, seed=3)


@pytest.fixture(scope="module")
def file(truth):
    """A capture in which names are missing, and two are exchanged for a stretch of frames."""
    d = truth.detections
    names = [None, *truth.names]
    for k in range(*DROPPED.indices(len(truth.names))):
        names[1 + k] = None
    labels = truth.labels + 1
    a, b = (names.index(name) for name in EXCHANGED)
    inside = (d.frame_of >= STRETCH[0]) & (d.frame_of < STRETCH[1])
    is_one, is_other = inside & (labels == a), inside & (labels == b)
    labels[is_one], labels[is_other] = b, a
    return am.Capture(
        path=Path("walk.c3d"), format="c3d", times=d.times, offsets=d.offsets, points=d.points,
        labels=labels, names=tuple(names),
    )  # fmt: skip


def names_of(tracks):
    return np.array([*tracks.names, None], dtype=object)[tracks.labels]


def expected_of(truth):
    names = list(truth.names)
    names[DROPPED] = [None] * len(names[DROPPED])
    return np.array(names, dtype=object)[truth.labels]


@pytest.mark.parametrize("make", [am.track, lambda capture: am.name_tracks(capture.tracks).tracks])
def test_names_are_kept_and_an_exchange_is_undone(truth, file, make):
    expected = expected_of(truth)
    assert (names_of(file.tracks) == expected).mean() < 0.995
    assert (names_of(make(file)) == expected).mean() > 0.9995


def test_the_result_for_each_name_is_reported(truth, file):
    own = am.name_tracks(am.track(file, marker_set=())).own
    assert set(own.kept) == set(truth.names[DROPPED.stop :])
    assert (own.moved, own.left_out) == ((), ())
    listed = {(c.name, c.found): (c.first, c.last) for c in own.conflicts}
    assert set(listed) == {EXCHANGED, EXCHANGED[::-1]}
    for first, last in listed.values():
        assert abs(first - STRETCH[0]) <= 2
        assert abs(last + 1 - STRETCH[1]) <= 2


def test_names_are_kept_moved_or_left_out(truth):
    tracks = truth.select(["C7", "CLAV", "LTOE"])
    given = tracks.labels
    late = tracks.detections.frame_of >= 100
    found = np.select([given == 2, late & (given == 0), late & (given == 1)], [-1, 1, 0], given)
    own = kept_names(tracks, given, found, np.full(len(given), 0.9), tracks.names)
    assert (own.kept, own.moved, own.left_out) == ((), ("C7", "CLAV"), ("LTOE",))
    assert [(c.name, c.found, c.first, c.last, c.probability) for c in own.conflicts] == [
        ("C7", "CLAV", 100, 239, 0.9),
        ("CLAV", "C7", 100, 239, 0.9),
        ("LTOE", None, 0, 239, 0.9),
    ]


def test_no_names_remain_no_names(truth, file):
    bare = replace(file, labels=np.full(file.n_points, -1), names=())
    tracks = am.track(bare)
    assert not any(tracks.names)
    assert tracks.recipe.markers == ""
    with pytest.raises(am.ParameterError, match="capture with names"):
        am.name_tracks(tracks)
    ignored = am.track(file, marker_set=())
    assert np.array_equal(ignored.labels, tracks.labels)
    assert not any(ignored.names)


def test_a_recipe_with_own_names_is_repeated(file):
    tracks = am.track(file, "gnn")
    again = am.track(file, recipe=tracks.recipe)
    assert np.array_equal(again.labels, tracks.labels)
    assert again.names == tracks.names
    others = replace(file, names=tuple(n and f"{n}2" for n in file.names))
    with pytest.raises(am.ParameterError, match="marker_set"):
        am.track(others, recipe=tracks.recipe)


def test_placeholders_and_names_that_occur_twice_are_no_names(truth):
    names = ("*1", truth.names[2], *truth.names[2:])
    own = am.name_tracks(replace(truth, names=names)).own
    assert set(own.kept) == set(truth.names[3:])


def test_a_single_named_marker_keeps_its_name(truth):
    names = tuple(name if name == "C7" else None for name in truth.names)
    found = am.name_tracks(replace(truth, names=names))
    assert found.own.kept == ("C7",)
    assert found.markers == names
