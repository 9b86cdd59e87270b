"""What is written is read again, to the last bit: as a property, and on real captures."""

from __future__ import annotations

import ezc3d
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from asterism.io import CAPTURE_FORMATS, read, read_tracks, write
from asterism.io.units import PER_METRE, from_metres
from asterism.model import Detections, Tracks
from tests.io.c3d_bytes import make_c3d
from tests.paths import DATA

LOGS = ("recording_000", "drone2", "marker3")
CAPTURES = sorted(
    path
    for path in DATA.rglob("*")
    if path.suffix in (".c3d", ".tsv") or (path.name in LOGS and path.is_file())
) or [None]
quick = settings(
    max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


def same(a, b):
    """Whether two tracks are the same in all but their file."""
    x, y = a.detections, b.detections
    np.testing.assert_array_equal(x.times, y.times)
    np.testing.assert_array_equal(x.offsets, y.offsets)
    np.testing.assert_array_equal(x.points, y.points)
    np.testing.assert_array_equal(a.labels, b.labels)
    assert a.names == b.names


# What a marker may be called; longer names and other letters have tests of their own.
names = st.text("ABCxyz:_12 é,\"'", min_size=1, max_size=8).map(
    lambda name: "L" + name.strip() + "k"
)


@st.composite
def any_tracks(draw, n_axes=3, float32=False, regular=True):
    n_frames = draw(st.integers(1, 5))
    counts = draw(st.lists(st.integers(0, 4), min_size=n_frames, max_size=n_frames))
    width = 32 if float32 else 64
    # Away from zero, which is how several formats say "not seen".
    number = st.floats(0.0625, 2048, width=width) | st.floats(-2048, -0.0625, width=width)
    points = draw(hnp.arrays(np.float64, (sum(counts), n_axes), elements=number))
    if regular:
        times = np.arange(n_frames) / draw(st.sampled_from([50, 100, 120, 128, 240]))
    else:
        steps = draw(hnp.arrays(np.float64, n_frames, elements=st.floats(1e-6, 1e3)))
        times = np.cumsum(steps)
    labels = np.concatenate(
        [draw(st.permutations([0, 1, 2, -1, -1]))[:n] for n in counts] + [np.empty(0, int)]
    ).astype(np.int64)
    d = Detections(times=times, offsets=np.concatenate([[0], np.cumsum(counts)]), points=points)
    called = draw(st.lists(st.none() | names, min_size=3, max_size=4))
    return Tracks(detections=d, labels=labels, names=called)


@quick
@given(tracks=any_tracks(n_axes=2, regular=False) | any_tracks(regular=False), data=st.data())
def test_csv_loses_nothing(tracks, data, tmp_path):
    n = len(tracks.labels)
    chance = data.draw(st.none() | hnp.arrays(np.float64, n, elements=st.floats(0, 1)))
    tracks = Tracks(
        detections=tracks.detections, labels=tracks.labels, names=tracks.names, confidence=chance
    )
    write(tracks, tmp_path / "a.csv")
    again = read_tracks(tmp_path / "a.csv")
    same(again, tracks)
    if chance is None:
        assert again.confidence is None
    else:
        np.testing.assert_array_equal(again.confidence, chance)
    capture = read(tmp_path / "a.csv")
    np.testing.assert_array_equal(capture.labels, tracks.labels)


@quick
@given(tracks=any_tracks(float32=True))
def test_c3d_keeps_labels_names_and_32_bits(tracks, tmp_path):
    write(tracks, tmp_path / "a.c3d")
    once = read_tracks(tmp_path / "a.c3d")
    np.testing.assert_allclose(once.positions(), tracks.positions(), rtol=1e-7)
    assert once.names == tracks.names
    assert (once.labels < 0).sum() == (tracks.labels < 0).sum()
    # From then on nothing changes any more: neither the numbers nor the file.
    write(once, tmp_path / "b.c3d")
    same(read_tracks(tmp_path / "b.c3d"), once)
    assert (tmp_path / "a.c3d").read_bytes() == (tmp_path / "b.c3d").read_bytes()


@quick
@given(
    values=hnp.arrays(
        np.float32, (3, 2, 3), elements=st.floats(-1e6, 1e6, width=32, allow_subnormal=False)
    ),
    units=st.sampled_from(["mm", "m", "cm"]),
)
def test_c3d_in_any_unit_keeps_its_own_numbers(values, units, tmp_path):
    words = np.concatenate([values.astype(np.float64), np.zeros((3, 2, 1))], axis=2)
    (tmp_path / "a.c3d").write_bytes(make_c3d(words, labels=["A", "B"], units=units))
    capture = read(tmp_path / "a.c3d")
    write(capture.tracks, tmp_path / "b.c3d")
    again = read(tmp_path / "b.c3d")
    same(again.tracks, capture.tracks)
    theirs = ezc3d.c3d(str(tmp_path / "b.c3d"))["data"]["points"][:3].transpose(2, 1, 0)
    is_seen = (values != 0).any(axis=2)
    np.testing.assert_array_equal(theirs[is_seen], values[is_seen])


@quick
@given(tracks=any_tracks(), form=st.sampled_from(["trc", "qtm", "csv-wide"]))
def test_tables_keep_positions(tracks, form, tmp_path):
    path = tmp_path / "a.txt"
    write(tracks, path, format=form)
    once = read_tracks(path, format=form)
    width = once.detections.n_points
    assert width == tracks.detections.n_points
    np.testing.assert_allclose(
        once.positions()[:, : tracks.n_tracks], tracks.positions(), rtol=3e-16, atol=0
    )
    np.testing.assert_array_equal(once.detections.times, tracks.detections.times)
    write(once, tmp_path / "b.txt", format=form)
    np.testing.assert_array_equal(
        read_tracks(tmp_path / "b.txt", format=form).detections.points, once.detections.points
    )


@quick
@given(
    values=hnp.arrays(np.float64, 20, elements=st.floats(-1e9, 1e9)),
    unit=st.sampled_from(["mm", "cm", "m"]),
)
def test_metres_go_back_to_the_number_in_the_file(values, unit):
    metres = values / PER_METRE[unit]
    np.testing.assert_array_equal(from_metres(metres, unit) / PER_METRE[unit], metres)
    decimals = np.round(values, 3)
    np.testing.assert_array_equal(from_metres(decimals / PER_METRE[unit], unit), decimals)


@pytest.mark.data
@pytest.mark.parametrize("path", CAPTURES, ids=lambda path: path.name if path else "none")
def test_real_captures(path, tmp_path):
    if path is None:
        pytest.skip("the real captures are not beside the project")
    capture = read(path)
    out = tmp_path / f"out{path.suffix or '.log'}"
    write(capture.tracks, out)
    again = read(out)
    same(again.tracks, capture.tracks)
    assert (again.rate, again.first_frame, again.units) == (
        capture.rate, capture.first_frame, capture.units,
    )  # fmt: skip
    write(capture.tracks, tmp_path / "out.csv")
    same(read_tracks(tmp_path / "out.csv"), capture.tracks)
    if path.suffix == ".c3d" and path.name != "mocap36.c3d":  # which ezc3d refuses
        check_with_ezc3d(path, out, capture)


def check_with_ezc3d(path, out, capture):
    old, new = ezc3d.c3d(str(path)), ezc3d.c3d(str(out))
    d = capture
    theirs = old["data"]["points"][:3, d.channels, d.frame_of].T / PER_METRE[d.units]
    np.testing.assert_array_equal(d.points, theirs)
    np.testing.assert_array_equal(new["data"]["analogs"], old["data"]["analogs"])
    assert old["header"]["events"] == new["header"]["events"]
    for group, parameters in old["parameters"].items():
        if group not in ("POINT", "EZC3D"):
            for name, parameter in parameters.items():
                if name != "__METADATA__":
                    value = new["parameters"][group][name]["value"]
                    np.testing.assert_array_equal(value, parameter["value"])
    labels = new["parameters"]["POINT"]["LABELS"]["value"]
    labels = labels + new["parameters"]["POINT"].get("LABELS2", {"value": []})["value"]
    for name in capture.modelled:
        i = _labels(old).index(name)
        np.testing.assert_array_equal(
            new["data"]["points"][:, labels.index(name)], old["data"]["points"][:, i]
        )
    # Residuals and cameras went with their points.
    i = capture.labels
    for key in ("residuals", "camera_masks"):
        before = old["data"]["meta_points"][key][:, d.channels, d.frame_of]
        np.testing.assert_array_equal(new["data"]["meta_points"][key][:, i, d.frame_of], before)


def _labels(c3d):
    point = c3d["parameters"]["POINT"]
    return point["LABELS"]["value"] + point.get("LABELS2", {"value": []})["value"]


@pytest.mark.parametrize("form", ["c3d", "trc", "csv", "csv-wide", "qtm", "pointcloud"])
@pytest.mark.parametrize("n_frames", [0, 1, 3])
@pytest.mark.parametrize("n_markers", [0, 1, 2])
@pytest.mark.parametrize("seen", [True, False])
def test_next_to_nothing(form, n_frames, n_markers, seen, tmp_path):
    """No frames, no markers, nothing seen, or one of each."""
    if form == "pointcloud" and n_frames == 0:
        pytest.skip("a log without a record is an empty file, which is refused")
    dense = np.full((n_frames, n_markers, 3), 1.5 if seen else np.nan)
    tracks = Tracks.from_dense(np.arange(n_frames) / 100, dense, ["A", "B"][:n_markers])
    write(tracks, tmp_path / "a", format=form)
    again = read_tracks(tmp_path / "a", format=form)
    np.testing.assert_array_equal(again.detections.points, tracks.detections.points)
    np.testing.assert_array_equal(again.detections.times, tracks.detections.times)
    if form != "pointcloud":
        assert again.names == tracks.names
    (tmp_path / "b").mkdir()  # the name stays the same, as TRC holds it
    write(again, tmp_path / "b" / "a", format=form)
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b" / "a").read_bytes()


def test_every_written_format_has_its_round_trip():
    """A new format must find its way into the tests above."""
    assert [name for name, f in CAPTURE_FORMATS.items() if f.write] == [
        "c3d", "trc", "csv", "csv-wide", "qtm", "pointcloud",
    ]  # fmt: skip
