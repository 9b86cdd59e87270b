"""The figures of a capture, by hand and against those measured when the data were collected."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from asterism.io import describe, read, write
from asterism.model import Tracks
from tests.paths import DATA

MANIFEST = DATA / "manifest.json"


def _entries():
    if not MANIFEST.is_file():
        return [None]
    rows = [f for e in json.loads(MANIFEST.read_text()) for f in e.get("figures", [])]
    return [f for f in rows if f["file"].endswith(("c3d", "tsv")) and (DATA / f["file"]).is_file()]


def test_by_hand(tmp_path):
    nan = [np.nan] * 3
    dense = np.array(
        [
            [[0, 0, 1], [0.030, 0, 1], nan],
            [[0.010, 0, 1], nan, nan],
            [[0.020, 0, 1], [0.050, 0, 1], nan],
            # A has moved 30 mm, nearly to where B was: B is nearer to A's old place than A is.
            [[0.050, 0, 1], [0.030, 0, 1], nan],
        ]
    )
    tracks = Tracks.from_dense(np.arange(4) / 50, dense, ["A", "B", "C"])
    write(tracks, tmp_path / "a.csv")
    info = describe(read(tmp_path / "a.csv"))
    assert (info.n_frames, info.n_named, info.n_unlabelled, info.n_modelled) == (4, 3, 0, 0)
    assert (info.rate, info.duration) == pytest.approx((50, 0.08))
    assert (info.points_min, info.points_mean, info.points_max) == (1, 7 / 4, 2)
    assert info.absent_percent == pytest.approx(100 / 8)  # C is not there at all: not absent
    assert (info.n_gaps, info.gap_median, info.gap_longest) == (1, 1, 1)
    assert info.step_median == pytest.approx(np.median([10, 10, 30, 20]))
    assert info.spacing_50 == pytest.approx(np.median([30, 30, 30, 30, 20, 20]))
    assert info.confusion_percent == pytest.approx(50)
    assert info.difficulty == "hard"
    assert "50 %" in info.reason


def test_nothing_to_measure(tmp_path):
    write(Tracks.from_dense([0, 1], np.full((2, 1, 3), np.nan), ["A"]), tmp_path / "a.csv")
    info = describe(read(tmp_path / "a.csv"))
    assert info.difficulty == "unknown"
    assert np.isnan(info.confusion_percent)
    assert (info.points_max, info.n_named) == (0, 1)
    empty = Tracks.from_dense(np.empty(0), np.empty((0, 1, 3)))
    write(empty, tmp_path / "b.csv")
    assert describe(read(tmp_path / "b.csv")).n_frames == 0


def test_points_without_identities(tmp_path):
    # Two points 100 mm apart that both move by 10 mm, and a frame with the first alone.
    dense = np.zeros((5, 2, 3))
    dense[:, 1, 1] = 0.1
    dense[..., 0] = 0.01 * np.arange(5)[:, None]
    dense[4, 1] = np.nan
    tracks = Tracks.from_dense(np.arange(5) / 50, dense)
    write(tracks, tmp_path / "a.log")
    info = describe(read(tmp_path / "a.log"))
    assert (info.n_points, info.n_unidentified, info.n_named, info.n_pieces) == (9, 9, 0, 0)
    # Rounded to 32 bits; the last step of the second goes to the first, as it alone is there.
    np.testing.assert_allclose(info.nearest_step_median, 10, rtol=1e-5)
    expected = np.percentile([*[10] * 7, np.hypot(10, 100)], 99)
    np.testing.assert_allclose(info.nearest_step_99, expected, rtol=1e-5)
    assert np.isnan(info.step_median)
    np.testing.assert_allclose(info.spacing_50, 100, rtol=1e-5)
    assert info.difficulty == "unknown"
    assert "no identities" in info.reason
    assert "times the distance of close ones" in info.reason


def test_points_that_coincide_are_no_infinity(tmp_path):
    for names in (["A", "B"], None):
        dense = np.zeros((4, 2, 3))
        dense[..., 0] = 0.01 * np.arange(4)[:, None]
        write(Tracks.from_dense(np.arange(4) / 50, dense, names), tmp_path / "a.csv")
        info = describe(read(tmp_path / "a.csv"))
        assert "inf" not in info.reason
        assert "10 mm, and 5 % of the points or more lie exactly on another" in info.reason


@pytest.mark.data
@pytest.mark.parametrize(
    ("name", "n_points", "steps", "spacing"),
    [  # measured when the data were collected
        ("recording_000", 890, (0.01, 0.03), None),
        ("drone2", 4632, (2.1, 11.1), (162, 293, 476)),
        ("marker3", 4138, (0.03, 10.7), (403, 459, 681)),
    ],
)
def test_real_logs(name, n_points, steps, spacing):
    found = sorted(DATA.rglob(name))
    if not found:
        pytest.skip("the real logs are not beside the project")
    info = describe(read(found[0]))
    assert info.n_points == info.n_unidentified == n_points
    got = info.nearest_step_median, info.nearest_step_99
    np.testing.assert_allclose(got, steps, rtol=0.02, atol=0.005)
    if spacing is None:
        assert np.isnan(info.spacing_50)
    else:
        got = info.spacing_1, info.spacing_5, info.spacing_50
        np.testing.assert_allclose(got, spacing, atol=0.5)


@pytest.mark.data
@pytest.mark.parametrize("known", _entries(), ids=lambda f: Path(f["file"]).name if f else "none")
def test_real_captures(known):
    if known is None:
        pytest.skip("the real captures are not beside the project")
    info = describe(read(DATA / known["file"]))
    assert info.n_frames == known["frames"]
    assert info.rate == pytest.approx(known["rate"], rel=1e-4)
    assert info.n_modelled == known["model"]
    assert info.points_mean == pytest.approx(known["vis_mean"])
    assert (info.points_min, info.points_max) == (known["vis_min"], known["vis_max"])
    assert info.step_median == pytest.approx(known["d50"], rel=0.01)
    assert info.step_99 == pytest.approx(known["d99"], rel=0.01)
    assert info.spacing_5 == pytest.approx(known["nn5"], rel=0.01)
    assert info.spacing_50 == pytest.approx(known["nn50"], rel=0.01)
    assert info.confusion_percent == pytest.approx(100 * known["conf1"], abs=0.05)
    if not known["unl"]:  # the table counts unlabelled channels too, which have no gaps here
        assert info.absent_percent == pytest.approx(100 * known["absent"], abs=0.01)
        assert info.n_gaps == known["ngaps"]
        assert info.gap_longest == known["gap_max"]
