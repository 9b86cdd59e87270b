"""Units: a size that contradicts the unit gives a warning, and CSV keeps the unit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from asterism.errors import FormatError
from asterism.io import CAPTURE_FORMATS, read, read_tracks, write
from asterism.model import Tracks
from tests.io.c3d_bytes import make_c3d
from tests.paths import DATA


def body(size=1.0):
    """Points of a body of about a metre and a half, times a size."""
    rng = np.random.default_rng(4)
    places = rng.uniform([-0.5, -0.5, 0.1], [0.5, 0.5, 1.7], (1, 5, 3))
    return size * (places + 0.01 * np.cumsum(rng.normal(size=(20, 1, 3)), axis=0))


def c3d(path, numbers, units):
    path.write_bytes(
        make_c3d(
            np.concatenate([numbers, np.zeros((*numbers.shape[:2], 1))], axis=2),
            labels=list("ABCDE"), units=units,
        )
    )  # fmt: skip
    return path


def text(path, numbers, unit):
    """Write numbers as they stand, as files of a format that call their unit so."""
    name = path.name
    if name.endswith(".c3d"):
        return c3d(path, numbers, unit)
    tracks = Tracks.from_dense(np.arange(len(numbers)) / 100, numbers, list("ABCDE"))
    if name.endswith(".trc"):  # written as metres, then called otherwise
        source = c3d(path.with_suffix(".c3d"), numbers, "m")
        write(read(source).tracks, path)
        path.write_text(path.read_text().replace("\tm\t", f"\t{unit}\t"))
    elif name.endswith(".tsv"):  # always millimetres
        write(replace(tracks, detections=replace(
            tracks.detections, points=tracks.detections.points / 1000)), path)  # fmt: skip
    else:
        write(tracks, path)
    return path


@pytest.mark.parametrize("name", ["a.c3d", "a.trc", "a.tsv"])
def test_metres_called_millimetres_are_told_of(tmp_path, name):
    path = text(tmp_path / name, body(), "mm")
    capture = read(path)
    assert capture.units == "mm"
    assert len(capture.warnings) == 1
    assert "expected coordinates in mm, the unit of the file, found" in capture.warnings[0]
    assert "size of coordinates in m (nine" in capture.warnings[0]
    assert read(text(path, body(1000), "mm")).warnings == ()


@pytest.mark.parametrize("name", ["a.c3d", "a.trc", "a.csv", "a.log"])
def test_millimetres_called_metres_are_told_of(tmp_path, name):
    path = text(tmp_path / name, body(1000), "m")
    capture = read(path)
    assert capture.units == "m"
    assert len(capture.warnings) == 1
    assert "expected coordinates in m, the unit of the file, found" in capture.warnings[0]
    assert "size of coordinates in mm (nine" in capture.warnings[0]
    assert read(text(path, body(), "m")).warnings == ()


@pytest.mark.parametrize("unit", ["mm", "cm", "in", "ft", "m"])
@pytest.mark.parametrize("format", ["csv", "csv-wide"])
def test_a_capture_keeps_its_unit_through_csv(tmp_path, unit, format):
    source = read(c3d(tmp_path / "a.c3d", body(500), unit))
    write(source.tracks, tmp_path / "b.csv", format=format)
    again = read(tmp_path / "b.csv")
    assert again.format == format
    assert again.units == unit
    np.testing.assert_array_equal(again.points, source.points)  # metres, whatever the unit
    assert again.names == source.names
    assert ("source_unit" in (tmp_path / "b.csv").read_text()) == (unit != "m")
    # What is written of it is in that unit, with the numbers that the source had.
    write(again.tracks, tmp_path / "c.c3d")
    assert read(tmp_path / "c.c3d").units == unit
    np.testing.assert_array_equal(read(tmp_path / "c.c3d").points, source.points)


def test_frames_without_points_and_tracks_without_detections_keep_the_columns(tmp_path):
    numbers = body(500)
    numbers[3] = np.nan
    numbers[:, 1] = np.nan
    source = read(c3d(tmp_path / "a.c3d", numbers, "mm"))
    assert source.counts[3] == 0
    write(source.tracks, tmp_path / "b.csv")
    again = read_tracks(tmp_path / "b.csv")
    assert again.detections.units == "mm"
    assert again.names == source.names
    np.testing.assert_array_equal(again.detections.offsets, source.offsets)


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        (
            ",mm\n",
            ",mile\n",
            "line 2, column source_unit: expected one of mm, cm, m, in, ft, found",
        ),
        (",mm\n", ",in\n", "line 3, column source_unit: expected 'in', as above, found 'mm'"),
    ],
)
@pytest.mark.parametrize("format", ["csv", "csv-wide"])
def test_a_unit_that_is_none_or_changes_is_refused(tmp_path, old, new, says, format):
    write(read(c3d(tmp_path / "a.c3d", body(500), "mm")).tracks, tmp_path / "b.csv", format=format)
    text = (tmp_path / "b.csv").read_text()
    (tmp_path / "b.csv").write_text(text.replace(old, new, 1))
    with pytest.raises(FormatError, match=says):
        read(tmp_path / "b.csv")


@pytest.mark.data
def test_no_real_capture_contradicts_its_unit():
    paths = [p for e in (".c3d", ".tsv") for p in DATA.rglob(f"*{e}")]
    paths += [p for p in DATA.rglob("*") if p.name in ("recording_000", "drone2", "marker3")]
    if not paths:
        pytest.skip("the real captures are not beside the project")
    for path in paths:
        capture = read(path)
        assert capture.format in CAPTURE_FORMATS
        assert not any("unit of length" in text for text in capture.warnings), path
