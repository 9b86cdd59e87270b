"""Damaged and truncated C3D files: what is read, what is refused."""

from __future__ import annotations

import ezc3d
import numpy as np
import pytest

from asterism.errors import FormatError
from asterism.io import read, write
from asterism.io.captures.c3d_layout import read_c3d
from asterism.model import Tracks
from tests.io.c3d_bytes import integers, make_c3d, reals
from tests.io.captures.c3d_files import grid


def test_more_than_65535_frames(tmp_path):
    n = 70_000
    positions = np.linspace(0, 1, n * 3).reshape(n, 1, 3) + 1
    path = tmp_path / "long.c3d"
    write(Tracks.from_dense(np.arange(n) / 100, positions, ["A"]), path)
    capture = read(path)
    assert capture.n_frames == n
    assert capture.warnings == ()
    theirs = ezc3d.c3d(str(path))["data"]["points"]
    assert theirs.shape[2] == n
    np.testing.assert_array_equal(capture.points[-1], theirs[:3, 0, -1] / 1000)


@pytest.mark.parametrize(
    "more",
    [
        [("POINT", "LONG_FRAMES", 4, (), reals([70_000]))],
        [
            ("TRIAL", "ACTUAL_START_FIELD", 2, (2,), integers([5, 1])),
            ("TRIAL", "ACTUAL_END_FIELD", 2, (2,), integers([70_004 - 65_536, 2])),
        ],
    ],
)
def test_long_files_of_other_makers(load, more):
    points = np.ones((70_000, 1, 4))
    capture = load(points, labels=["A"], frames=0xFFFF, header_last=0xFFFF, more=more)
    assert capture.n_frames == 70_000
    assert capture.first_frame == (65_541 if more[0][0] == "TRIAL" else 1)


def test_a_truncated_file_of_more_than_65535_frames(tmp_path):
    more = [("POINT", "LONG_FRAMES", 4, (), reals([70_000]))]
    raw = make_c3d(
        np.ones((70_000, 1, 4)), labels=["A"], frames=0xFFFF, header_last=0xFFFF, more=more
    )
    begin = 512 * (raw[16] - 1)
    (tmp_path / "a.c3d").write_bytes(raw[: begin + 66_000 * 16])
    capture = read(tmp_path / "a.c3d")
    assert capture.n_frames == 66_000
    assert "expected 70000 frames, found 66000 complete, 64000 bytes" in capture.truncated


def test_header_and_parameters_disagree(load):
    capture = load(grid(5), labels=["A", "B", "C"], frames=5, header_last=3)
    assert capture.n_frames == 5
    assert "5 frames are read; the header states 3" in capture.warnings


def test_no_frames_no_points_no_detections(load):
    assert load(np.empty((0, 3, 4)), labels=["A", "B", "C"]).n_frames == 0
    empty = load(np.empty((6, 0, 4)), analog=np.ones((6, 2)), n_samples=2)
    assert (empty.n_frames, empty.n_points) == (6, 0)
    gone = np.full((6, 2, 4), np.nan)
    assert load(gone, labels=["A", "*1"]).names == ("A",)


def test_a_damaged_parameter_section_is_read_as_far_as_it_goes(tmp_path):
    raw = bytearray(make_c3d(grid(), labels=["A", "B", "C"]))
    at = raw.index(b"LABELS") + len("LABELS")
    raw[at : at + 2] = b"\xff\x7f"  # the record claims to reach beyond the section
    path = tmp_path / "broken.c3d"
    path.write_bytes(raw)
    capture = read(path)
    assert capture.n_points == 12
    assert any("damaged parameter section" in w for w in capture.warnings)
    raw[515] = 0  # not a processor: there are no parameters at all
    path.write_bytes(raw)
    capture = read(path)
    assert capture.n_points == 12
    assert capture.names == (None, None, None)
    assert any("neither names nor a unit" in w for w in capture.warnings)


def test_bad_files(tmp_path):
    path = tmp_path / "bad.c3d"
    good = make_c3d(grid(200), labels=["A", "B", "C"])
    cases = {
        b"": "header",
        b"PK\3\4" * 400: "header",
        b"time,x,y\n1,2,3\n": "header",
        good[:400]: "header",
        good[: 512 * (good[16] - 1) + 47]: "cut off",
    }
    for raw, what in cases.items():
        path.write_bytes(raw)
        with pytest.raises(FormatError, match=what):
            read(path)


def test_what_is_complete_of_a_truncated_file_is_read(tmp_path, caplog):
    path = tmp_path / "cut.c3d"
    analog = np.arange(200 * 6).reshape(200, 6)
    more = [("ANALOG", "USED", 2, (), integers([3])), ("ANALOG", "RATE", 4, (), reals([200]))]
    raw = make_c3d(grid(200), labels=["A", "B", "C"], analog=analog, n_samples=2, more=more)
    frame = (4 * 3 + 6) * 4
    begin = 512 * (int.from_bytes(raw[16:18], "little") - 1)
    whole = raw[: begin + 200 * frame]
    for n_bytes in (1, frame - 1, frame, 60 * frame + 11, 199 * frame):
        path.write_bytes(whole[:-n_bytes])
        n_complete = 200 - -(-n_bytes // frame)
        caplog.clear()
        capture = read(path)
        assert capture.n_frames == n_complete
        assert capture.names == ("A", "B", "C")
        np.testing.assert_allclose(capture.points[-1] * 1000, grid(200)[n_complete - 1, 2, :3])
        said = (
            f"cut off in frame {n_complete + 1}: expected 200 frames, found {n_complete} "
            f"complete, {n_bytes} bytes are missing. Copy the file again."
        )
        assert capture.truncated == said
        assert caplog.messages == [f"{path}: {said}"]
        assert read_c3d(path).analog.shape == (n_complete, 6)
    # The writer says so too, and what is read of its file.
    caplog.clear()
    write(read(path).tracks, tmp_path / "b.c3d")
    write(read(path).tracks, tmp_path / "b.csv")
    assert sum("b.c3d: holds the complete frames of a trunc" in m for m in caplog.messages) == 1
    assert sum("b.csv: holds the complete frames of a trunc" in m for m in caplog.messages) == 1
    again = read(tmp_path / "b.c3d")
    assert again.truncated == f"made from a capture that is {said}"
    write(again.tracks, tmp_path / "c.c3d")
    assert read(tmp_path / "c.c3d").truncated == again.truncated
    # A file that is whole says nothing.
    path.write_bytes(whole)
    assert read(path).truncated == ""
    write(read(path).tracks, tmp_path / "b.c3d")
    assert b"TRUNCATED" not in (tmp_path / "b.c3d").read_bytes()


def test_hostile_parameters(load):
    """Found by thinking, not by the fuzzer: each would take all memory or end in a traceback."""
    many = ("POINT", "LABELS", -1, (0, 255, 255, 255, 255), b"")
    assert load(grid(), more=[many]).n_points == 12
    for value in (np.nan, np.inf, -5, 3e9, 70_000):
        more = [("POINT", "USED", 4, (), reals([value]))]
        assert load(grid(), drop=["USED"], more=more).n_points == 12
        words = ("TRIAL", "ACTUAL_START_FIELD", 4, (2,), reals([value, value]))
        end = ("TRIAL", "ACTUAL_END_FIELD", 4, (2,), reals([value, value]))
        frames = ("POINT", "FRAMES", 4, (), reals([value]))
        long = ("POINT", "LONG_FRAMES", 4, (), reals([value]))
        assert load(grid(), drop=["FRAMES"], more=[words, end, frames, long]).n_frames == 4
    with pytest.raises(FormatError, match="SCALE"):
        load(grid(), drop=["SCALE"], more=[("POINT", "SCALE", 4, (), reals([np.nan]))])
    signalling = b"\x01\x00\xa0\x7f"  # a NaN of which NumPy warns when it is converted
    with pytest.raises(FormatError, match="SCALE"):
        load(grid(), drop=["SCALE"], more=[("POINT", "SCALE", 4, (), signalling)])
