"""A file is there as a whole or untouched, and no input is overwritten by accident."""

from __future__ import annotations

import os
import signal
import stat
import subprocess
import sys
import textwrap
import time
from pathlib import Path

import numpy as np
import pytest

from asterism.errors import FormatError, ParameterError
from asterism.io import read, write
from asterism.model import Tracks

SUFFIXES = ("c3d", "trc", "csv", "tsv", "log")


@pytest.fixture
def tracks():
    rng = np.random.default_rng(3)
    return Tracks.from_dense(
        np.arange(50) / 100, rng.normal(size=(50, 4, 3)), ["A", "B", None, "D"]
    )


def names_in(folder):
    return sorted(path.name for path in Path(folder).iterdir())


@pytest.mark.parametrize("ending", SUFFIXES)
def test_the_input_is_not_overwritten_unless_asked(tracks, tmp_path, ending):
    path = tmp_path / f"a.{ending}"
    write(tracks, path)
    raw = path.read_bytes()
    capture = read(path)
    (tmp_path / "link").symlink_to(path)
    (tmp_path / "hard").hardlink_to(path)
    os.chdir(tmp_path)
    for other in (path, tmp_path / "link", tmp_path / "hard", Path(path.name), str(path)):
        with pytest.raises(ParameterError, match="overwrite_input=True"):
            write(capture.tracks, other, format=capture.format)
    assert path.read_bytes() == raw
    write(capture.tracks, path, overwrite_input=True)
    np.testing.assert_array_equal(read(path).points, capture.points)
    write(capture.tracks, tmp_path / f"b.{ending}")
    write(capture.tracks, tmp_path / f"b.{ending}")  # another file is replaced


@pytest.mark.parametrize("ending", SUFFIXES)
def test_a_full_disk(tracks, tmp_path, monkeypatch, ending):
    path = tmp_path / f"a.{ending}"
    path.write_text("the old content")

    def full(handle):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(FormatError, match="no space left on device"):
        write(tracks, path)
    assert path.read_text() == "the old content"
    assert names_in(tmp_path) == [path.name]


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
def test_a_full_device(tracks):
    with pytest.raises(FormatError, match="no space left on device"):
        write(tracks, "/dev/full", format="csv")


def test_a_folder_that_is_not_there_or_not_writable(tracks, tmp_path, monkeypatch):
    with pytest.raises(FormatError, match="no such folder"):
        write(tracks, tmp_path / "no" / "a.csv")
    (tmp_path / "a.csv").mkdir()
    with pytest.raises(FormatError, match="folder"):
        write(tracks, tmp_path / "a.csv")

    def refuse(path, *_):  # the rights themselves do not stop root
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(os, "open", refuse)
    with pytest.raises(FormatError, match="cannot be written: permission denied"):
        write(tracks, tmp_path / "b.csv")


def test_an_error_on_the_way_leaves_nothing(tmp_path):
    irregular = Tracks.from_dense([0, 1, 5], np.ones((3, 1, 3)))
    path = tmp_path / "a.trc"
    path.write_text("the old content")
    with pytest.raises(ParameterError):
        write(irregular, path)
    assert path.read_text() == "the old content"
    assert names_in(tmp_path) == ["a.trc"]


def test_the_old_file_is_replaced_and_not_written_over(tracks, tmp_path):
    """Who has the old file open, or holds it by another link, keeps it as it was."""
    path, held, link = (tmp_path / name for name in ("a.csv", "held", "link.csv"))
    path.write_text("the old content")
    held.hardlink_to(path)
    link.symlink_to(path)
    write(tracks, link)
    assert held.read_text() == "the old content"
    assert link.is_symlink()
    assert read(path).n_points == 200


def test_rights_are_those_of_any_new_file(tracks, tmp_path):
    write(tracks, tmp_path / "a.csv")
    (tmp_path / "plain").touch()
    rights = stat.S_IMODE((tmp_path / "a.csv").stat().st_mode)
    assert rights == stat.S_IMODE((tmp_path / "plain").stat().st_mode)
    (tmp_path / "a.csv").chmod(0o640)
    write(tracks, tmp_path / "a.csv")
    assert stat.S_IMODE((tmp_path / "a.csv").stat().st_mode) == 0o640


def test_unknown_ending_and_format(tracks, tmp_path):
    with pytest.raises(ParameterError, match=r"a name ending in \.c3d, \.trc, \.csv"):
        write(tracks, tmp_path / "a.xyz")
    with pytest.raises(ParameterError, match="a name ending in"):
        write(tracks, tmp_path / "a")
    with pytest.raises(ParameterError, match="one that can be written"):
        write(tracks, tmp_path / "a.csv", format="motive")
    with pytest.raises(ParameterError, match="expected one of c3d"):
        write(tracks, tmp_path / "a.csv", format="C3D")
    assert names_in(tmp_path) == []


@pytest.mark.skipif(os.name != "posix", reason="needs SIGKILL")
@pytest.mark.parametrize("ending", ["c3d", "csv"])
def test_killed_while_writing(tracks, tmp_path, ending):
    """Without the temporary name the old file would be cut off here."""
    path = tmp_path / f"a.{ending}"
    write(tracks, path)
    old = path.read_bytes()
    script = textwrap.dedent(
        f"""
        import numpy as np
        from asterism.io import write
        from asterism.model import Tracks
        big = Tracks.from_dense(np.arange(40000) / 100, np.ones((40000, 20, 3)))
        while True:
            write(big, {str(path)!r} + ".big", format={ending!r})
            write(big, {str(path)!r}, format={ending!r})
        """
    )
    child = subprocess.Popen([sys.executable, "-c", script])
    try:
        # In the middle of the first file, which has grown but is not at its name yet.
        deadline = time.monotonic() + 30
        while not any(p.stat().st_size > 0 for p in tmp_path.glob(".*.part")):
            assert time.monotonic() < deadline
            time.sleep(0.001)
    finally:
        child.send_signal(signal.SIGKILL)
        child.wait()
    assert path.read_bytes() == old
    assert not (tmp_path / f"{path.name}.big").exists()
