"""Groups of detections, and statements that contradict each other."""

from __future__ import annotations

from dataclasses import replace

import pytest

import asterism as am
from asterism.model import Edit
from asterism.tracking.correction.constraints import Constraints


@pytest.fixture(scope="module")
def d():
    return am.simulate.cube(frames=20, seed=1).detections


def same(a, b):
    return Edit(kind="same", at=(a, b))


def different(a, b):
    return Edit(kind="different", at=(a, b))


def name(a, text):
    return Edit(kind="name", at=(a,), name=text)


def clutter(a):
    return Edit(kind="clutter", at=(a,))


A, B, C, E = (0, 0), (5, 1), (9, 2), (12, 3)


def test_groups_follow_from_chains_of_statements(d):
    found = Constraints.of([same(A, B), same(C, E), same(B, C)], d)
    assert found.group(0) == {int(d.offsets[t]) + i for t, i in (A, B, C, E)}


def test_two_detections_of_a_name_are_one_marker(d):
    found = Constraints.of([name(A, "LASI"), name(B, "LASI")], d)
    assert found.name(int(d.offsets[5]) + 1) == "LASI"
    assert found.group(0) == {0, int(d.offsets[5]) + 1}


def test_two_names_are_two_markers(d):
    found = Constraints.of([name(A, "LASI"), name(B, "RASI")], d)
    assert found.are_different(0, int(d.offsets[5]) + 1)


@pytest.mark.parametrize(
    "edits",
    [
        [same(A, B), different(A, B)],
        [different(A, B), same(A, B)],
        [same(A, B), same(B, C), different(A, C)],
        [different(A, C), same(A, B), same(B, C)],
        [name(A, "LASI"), name(A, "RASI")],
        [name(A, "LASI"), name(B, "RASI"), same(A, B)],
        [name(A, "LASI"), different(A, B), name(B, "LASI")],
        [clutter(A), same(A, B)],
        [same(A, B), clutter(B)],
        [clutter(A), name(A, "LASI")],
        [same(A, (5, 1)), same(A, (5, 2))],
    ],
)
def test_contradictions_name_both_statements(edits, d):
    with pytest.raises(am.ParameterError, match="which contradicts"):
        Constraints.of(edits, d)


def test_frames_of_a_capture_are_those_of_its_file(d, tmp_path):
    am.write(d, tmp_path / "walk.csv")
    read = am.read(tmp_path / "walk.csv")
    capture = replace(read, first_frame=107)
    with pytest.raises(am.ParameterError) as error:
        Constraints.of([name((2, 1), "LASI"), name((2, 1), "RASI")], capture)
    text = str(error.value)
    assert "name RASI: frame 2 point 1 (frame 109 of the file), which contradicts name LASI" in text
    with pytest.raises(am.ParameterError, match=r"frame 2 point 99 \(frame 109 of the file\)"):
        Constraints.of([name((2, 99), "LASI")], capture)


def test_a_contradiction_changes_nothing(d):
    found = Constraints.of([same(A, B)], d)
    with pytest.raises(am.ParameterError):
        found.add(different(A, B))
    assert found.edits == (same(A, B),)
    assert not found.are_different(0, int(d.offsets[5]) + 1)


@pytest.mark.parametrize("at", [(20, 0), (0, 8)])
def test_a_missing_detection_is_refused(at, d):
    with pytest.raises(am.ParameterError, match="a detection of 20 frames"):
        Constraints.of([clutter(at)], d)
