"""The content of a file decides its format, whatever its suffix."""

from __future__ import annotations

import shutil
import struct

import numpy as np
import pytest

from asterism.io import CAPTURE_FORMATS, read, write
from asterism.io.calibrations import CALIBRATION_FORMATS, read_rig, write_rig
from asterism.model import Tracks
from tests.io.c3d_bytes import DEC, SGI, make_c3d
from tests.io.calibrations.rigs import NAMES, rig_for, same_pixels
from tests.paths import DATA
from tests.tools.fuzz_readers import MOTIVE

SUFFIXES = ("", ".c3d", ".trc", ".csv", ".tsv", ".log", ".bin", ".txt", ".dat")


def tracks():
    dense = np.random.default_rng(3).uniform(-2, 2, (30, 4, 3))
    return Tracks.from_dense(np.arange(30) / 100, dense, ["A", "B", "C", "D"])


@pytest.mark.parametrize("format", CAPTURE_FORMATS)
@pytest.mark.parametrize("ending", SUFFIXES)
def test_captures_by_content(tmp_path, format, ending):
    path = tmp_path / f"file{ending}"
    if CAPTURE_FORMATS[format].write is None:
        path.write_text(MOTIVE)
    else:
        write(tracks(), tmp_path / "made", format=format)
        shutil.move(tmp_path / "made", path)
    assert read(path).format == format


@pytest.mark.parametrize("ending", SUFFIXES)
@pytest.mark.parametrize(
    "options", [{"processor": SGI}, {"processor": DEC}, {"scale": 0.1}], ids=["sgi", "dec", "int"]
)
@pytest.mark.parametrize("is_damaged", [False, True], ids=["whole", "damaged"])
def test_c3d_of_any_processor_by_content(tmp_path, ending, options, is_damaged):
    points = np.random.default_rng(1).uniform(100, 900, (40, 3, 4))
    points[..., 3] = 0
    raw = bytearray(make_c3d(points, labels=["A", "B", "C"], **options))
    if is_damaged and "processor" not in options:
        raw[515] = 0  # no parameter section can be read
    (tmp_path / f"file{ending}").write_bytes(raw)
    assert read(tmp_path / f"file{ending}").format == "c3d"


@pytest.mark.parametrize("ending", SUFFIXES)
def test_a_log_whose_clock_looks_like_a_c3d(tmp_path, ending):
    # The second byte of the first time is that of a C3D, 0x50.
    records = [(0x5002 + 10 * t, np.full((2, 3), t / 7, "<f4")) for t in range(40)]
    raw = b"".join(struct.pack("<II", t, len(p)) + p.tobytes() for t, p in records)
    (tmp_path / f"file{ending}").write_bytes(raw)
    assert read(tmp_path / f"file{ending}").format == "pointcloud"


def test_text_in_utf16_without_an_ending(tmp_path):
    write(tracks(), tmp_path / "a.trc")
    text = (tmp_path / "a.trc").read_text()
    (tmp_path / "bare").write_bytes(text.encode("utf-16"))
    assert read(tmp_path / "bare").format == "trc"


@pytest.mark.parametrize(
    "format", [f for f, c in CALIBRATION_FORMATS.items() if c.sniff is not None]
)
@pytest.mark.parametrize("ending", ["", ".toml", ".yml", ".qca.txt", ".xcp", ".txt"])
def test_calibrations_by_content(tmp_path, format, ending):
    rig = rig_for(format)
    write_rig(rig, tmp_path / NAMES[format], format=format)
    made = tmp_path / NAMES[format]
    if made.is_dir():
        made = sorted(made.iterdir())[0]
        rig = type(rig)(rig.cameras[:1])
    path = tmp_path / f"file{ending}"
    shutil.move(made, path)
    same_pixels(rig, read_rig(path))


@pytest.mark.data
@pytest.mark.parametrize(
    "path",
    sorted(p for e in ("c3d", "tsv") for p in DATA.rglob(f"*.{e}")) or [None],
    ids=lambda p: p.name if p else "none",
)
def test_real_captures_without_their_endings(tmp_path, path):
    if path is None:
        pytest.skip("the real captures are not beside the project")
    for ending in ("", ".log", ".csv"):
        bare = tmp_path / f"file{ending}"
        bare.symlink_to(path)
        assert read(bare).format == read(path).format
