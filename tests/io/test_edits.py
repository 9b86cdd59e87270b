"""Files of edits: round trips, changed input, and every kind of damage with its place."""

from __future__ import annotations

import pytest

import asterism as am
from asterism.io import read_edits, write_edits
from asterism.model import Edit

D = am.simulate.cube(frames=20, seed=1).detections
EDITS = (
    Edit(kind="same", at=((3, 0), (9, 2)), who="Ada", when="2026-11-25T09:00:00+00:00"),
    Edit(kind="name", at=((4, 1),), name='a "name" \\ with\nall'),
    Edit(kind="only", at=((3, 0), (9, 2), (12, 2))),
    Edit(kind="no_fill", at=((4, 1), (7, 1))),
    Edit(kind="reassign", at=(), who="Ada"),
    Edit(kind="reassign_even", at=((4, 1),)),
)


def test_edits_are_read_as_they_were_written(tmp_path):
    path = tmp_path / "trial.edits.toml"
    write_edits(path, EDITS, D)
    assert read_edits(path, D) == EDITS


def test_frames_are_those_of_the_capture(tmp_path):
    path = tmp_path / "trial.edits.toml"
    write_edits(path, EDITS, D)
    assert "at = [[4, 0], [10, 2]]" in path.read_text()  # frames of a file count from 1


def test_another_capture_is_told_and_the_file_stays(tmp_path):
    path = tmp_path / "trial.edits.toml"
    write_edits(path, EDITS, D)
    before = path.read_bytes()
    with pytest.raises(am.FormatError, match=r"sha256: expected .* of the capture"):
        read_edits(path, am.simulate.cube(frames=20, seed=2).detections)
    assert path.read_bytes() == before


@pytest.mark.parametrize(
    ("text", "place"),
    [
        ("[[edit]\n", "TOML"),
        ("other = 3\n", "other"),
        ("edit = 3\n", "edit"),
        ('[[edit]]\nkind = "none"\nat = [[1, 0]]\n', r"edit 1: .*kind"),
        ('[[edit]]\nkind = "same"\nat = [[1, 0]]\n', r"edit 1: .*2 detections"),
        ('[[edit]]\nkind = "clutter"\nat = [[0, 0]]\n', "a frame from 1 to 20"),
        ('[[edit]]\nkind = "clutter"\nat = [[21, 0]]\n', "a frame from 1 to 20"),
        ('[[edit]]\nkind = "clutter"\nat = [[1, 8]]\n', "a point below 8"),
        ('[[edit]]\nkind = "clutter"\nat = [[1, true]]\n', "pairs"),
        ('[[edit]]\nkind = "clutter"\nat = [1, 0]\n', "pairs"),
        ('[[edit]]\nkind = "name"\nat = [[1, 0]]\n', "the name of a marker"),
        ('[[edit]]\nkind = "clutter"\nat = [[1, 0]]\nwho = 3\n', "who"),
        ('[[edit]]\nkind = "clutter"\nat = [[1, 0]]\nwhy = "x"\n', "why"),
    ],
)
def test_damage_is_named_with_its_place(text, place, tmp_path):
    path = tmp_path / "trial.edits.toml"
    write_edits(path, (), D)
    head = path.read_text() if text.startswith("[[edit]]") else ""
    path.write_text(head + text)
    with pytest.raises(am.FormatError, match=place):
        read_edits(path, D)


def test_a_missing_file_is_told(tmp_path):
    with pytest.raises(am.FormatError, match="no such file"):
        read_edits(tmp_path / "none.toml", D)
