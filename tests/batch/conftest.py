"""Captures for the tests of batches."""

from __future__ import annotations

import shutil
import tempfile
from pathlib import Path

import numpy as np
import pytest

import asterism as am


@pytest.fixture(autouse=True)
def temporary_folder(tmp_path_factory, monkeypatch):
    """Workers that are killed leave their temporary folder in that of the tests."""
    monkeypatch.setenv("TMPDIR", str(tmp_path_factory.mktemp("workers")))
    monkeypatch.setattr(tempfile, "tempdir", None)


@pytest.fixture(scope="session")
def made_captures(tmp_path_factory):
    """A folder with two subjects, three captures, a marker set, and a damaged file."""
    folder = tmp_path_factory.mktemp("captures")
    for name in ("first", "second"):
        (folder / name).mkdir()
    for place, seed in (("first/walk.c3d", 1), ("first/turn.csv", 2), ("second/walk.c3d", 3)):
        truth = am.simulate.corrupt(
            am.simulate.cube(frames=30, seed=seed), missing=0.05, noise=3e-4, seed=seed
        )
        clutter = np.full(truth.detections.n_points, -1)
        am.write(am.Tracks(detections=truth.detections, labels=clutter), folder / place)
    am.learn_marker_set(am.simulate.cube(frames=30, seed=1)).to_toml(
        folder / "first" / "markers.toml"
    )
    (folder / "second" / "damaged.c3d").write_bytes(b"\x02\x50" + b"junk" * 200)
    (folder / "second" / "notes.csv").write_text("date,weather\nMonday,rain\n")
    return folder


@pytest.fixture
def captures(made_captures, tmp_path):
    """A copy of that folder, to change."""
    return shutil.copytree(made_captures, tmp_path / "captures")


@pytest.fixture
def truncated(captures):
    """A capture of that folder, of which the last frames are missing."""
    path = captures / "second" / "walk.c3d"
    content = path.read_bytes()
    begin = 512 * (int.from_bytes(content[16:18], "little") - 1)  # word 9: block of the data
    path.write_bytes(content[: begin + (len(content) - begin) // 2])
    return path


@pytest.fixture
def whole(captures):
    """That copy without the damaged file and the notes, so that every capture has a result."""
    for name in ("damaged.c3d", "notes.csv"):
        (captures / "second" / name).unlink()
    return captures


@pytest.fixture(scope="session")
def batch(made_captures, tmp_path_factory):
    """A batch that was never stopped."""
    return am.batch.run([made_captures], tmp_path_factory.mktemp("batch") / "out", workers=1)


@pytest.fixture(scope="session")
def serial(batch):
    """The files of that batch by name."""
    return contents(Path(batch.out))


@pytest.fixture
def out(batch, tmp_path):
    """A copy of its output folder."""
    return shutil.copytree(batch.out, tmp_path / "out")


def contents(folder):
    """Bytes of all files by name, without the temporary ones that a process was killed over.

    The index and the table differ by the paths of the captures.
    """
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
        and path.suffix != ".part"
        and path.name not in ("index.html", "summary.csv")
    }
