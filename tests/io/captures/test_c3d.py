"""C3D: every trap that recording systems lay, and files made by another program."""

from __future__ import annotations

import ezc3d
import numpy as np
import pytest

from asterism.io import read, write
from asterism.io.captures.c3d_layout import read_c3d
from asterism.io.captures.marker_names import find_modelled, is_unlabelled
from asterism.model import Detections, Tracks
from asterism.model.side_data import Event
from tests.io.c3d_bytes import DEC, INTEL, SGI, integers, make_c3d, reals, text
from tests.io.captures.c3d_files import grid
from tests.paths import DATA


def test_points_names_and_times(load):
    capture = load(grid(), labels=["LASI", "RASI", "T10"], first=126)
    assert capture.names == ("LASI", "RASI", "T10")
    assert capture.first_frame == 126
    assert capture.units == "mm"
    np.testing.assert_array_equal(capture.times, np.arange(4) / 100)
    np.testing.assert_array_equal(capture.points, grid()[..., :3].reshape(-1, 3) / 1000)
    np.testing.assert_array_equal(capture.labels, [0, 1, 2] * 4)
    np.testing.assert_array_equal(capture.channels, [0, 1, 2] * 4)
    assert capture.warnings == ()


@pytest.mark.parametrize(
    "absent",
    [
        (1.0, 2.0, 3.0, -1.0),
        (np.nan, np.nan, np.nan, 0.0),
        (np.nan, 2.0, 3.0, 0.0),
        (np.inf, 2.0, 3.0, 0.0),
        (0.0, 0.0, 0.0, 0.0),
        (-0.0, 0.0, 0.0, 4.0),
        (0.0, 0.0, 0.0, -1.0),
    ],
)
def test_each_way_to_say_not_seen(load, absent):
    points = grid()
    points[2, 1] = absent
    capture = load(points, labels=["A", "B", "C"])
    np.testing.assert_array_equal(capture.counts, [3, 3, 2, 3])
    assert (2, 1) not in set(zip(capture.frame_of, capture.labels, strict=True))


def test_zeros_with_a_good_residual_are_told_of(load):
    points = grid()
    points[1, 1] = 0
    assert "1 samples at exactly (0, 0, 0)" in load(points, labels=["A", "B", "C"]).warnings[0]


@pytest.mark.parametrize(("units", "size"), [("mm", 1000), ("m", 1), ("cm", 100), ("Meters ", 1)])
def test_units(load, units, size):
    capture = load(grid(), labels=["A", "B", "C"], units=units)
    np.testing.assert_array_equal(capture.points, grid()[..., :3].reshape(-1, 3) / size)


@pytest.mark.parametrize(
    ("units", "unit", "metres"),
    [("in", "in", 0.0254), ("Inches", "in", 0.0254), ("ft", "ft", 0.3048), ("feet", "ft", 0.3048)],
)
def test_inches_and_feet(load, tmp_path, units, unit, metres):
    capture = load(grid(), labels=["A", "B", "C"], units=units)
    np.testing.assert_allclose(capture.points, grid()[..., :3].reshape(-1, 3) * metres, rtol=1e-14)
    assert (capture.units, capture.warnings) == (unit, ())
    # Back in the same unit, with the same numbers, in each format that names one.
    for name in ("b.c3d", "b.trc"):
        write(capture.tracks, tmp_path / name)
        again = read(tmp_path / name)
        assert again.units == unit
        np.testing.assert_array_equal(again.points, capture.points)
    points = ezc3d.c3d(str(tmp_path / "b.c3d"))["data"]["points"]
    np.testing.assert_array_equal(points[:3].transpose(2, 1, 0), grid()[..., :3])
    assert f"\t{unit}\t" in (tmp_path / "b.trc").read_text()


@pytest.mark.parametrize(("factor", "unit"), [(1, "mm"), (0.001, "m")])
@pytest.mark.parametrize("units", [None, "", "furlong"])
def test_unknown_units_are_judged_by_size_and_told_of(load, units, factor, unit):
    points = grid()
    points[..., :3] *= factor
    capture = load(points, labels=["A", "B", "C"], units=units)
    assert capture.units == unit
    assert unit in capture.warnings[0]


def test_rate_from_the_analog_channels_or_none(load):
    more = [("ANALOG", "RATE", 4, (), reals([1000]))]
    analog = np.zeros((4, 10))
    assert load(grid(), rate=0, analog=analog, n_samples=10, more=more).rate == 100
    capture = load(grid(), rate=0)
    assert capture.rate == 0
    np.testing.assert_array_equal(capture.times, [0, 1, 2, 3])
    assert any("no frame rate" in w for w in capture.warnings)


def test_fewer_labels_than_points(load):
    capture = load(grid(), labels=["LASI"])
    assert capture.names == ("LASI", None, None)


def test_more_than_255_points(load):
    labels = [f"M{i}" for i in range(600)]
    capture = load(grid(2, 600), labels=labels)
    assert capture.names == tuple(labels)


@pytest.mark.parametrize(
    "name",
    ["*0", "*183", "", "Unlabeled 7", "Unlabeled_7", "unlabelled12", "U_1034", "0001", "New 0001",
     "uname3", "uname*3", "Ann:Unlabeled 3"],
)  # fmt: skip
def test_names_without_a_marker(name):
    assert is_unlabelled(name)


@pytest.mark.parametrize(
    "name", ["LASI", "T10", "C7", "U_RASI", "Newton", "M001", "Ann:LASI", "12", "RUNA"]
)
def test_names_of_somebody(name):
    assert not is_unlabelled(name)


def test_unlabelled_channels_are_split_at_gaps(load):
    points = grid(6, 2)
    points[2, 0, 3] = points[3, 1, 3] = -1
    capture = load(points, labels=["*0", "LASI"])
    # The recorder may have gone on with another marker in *0, and not in LASI.
    assert capture.names == (None, None, "LASI")
    of = {
        (t, c): k
        for t, c, k in zip(capture.frame_of, capture.channels, capture.labels, strict=True)
    }
    assert [of.get((t, 0)) for t in range(6)] == [0, 0, None, 1, 1, 1]
    assert [of.get((t, 1)) for t in range(6)] == [2, 2, 2, None, 2, 2]


def test_a_named_channel_without_detections_keeps_its_name(load):
    points = grid()
    points[:, 1, 3] = -1
    capture = load(points, labels=["A", "B", "C"])
    assert capture.names == ("A", "B", "C")
    assert set(capture.labels) == {0, 2}


def test_modelled_outputs_are_left_out(load):
    labels = ["LASI", "LHipAngles", "LFEO", "LFEA", "LFEL", "LFEP", "Odd", "*6"]
    more = [("POINT", "SCALARS", *text(["Odd"]))]
    capture = load(grid(4, 8), labels=labels, more=more)
    assert capture.names == ("LASI", None)
    assert capture.modelled == tuple(labels[1:7])
    assert set(capture.channels) == {0, 7}


def test_half_a_segment_is_no_segment():
    assert not any(find_modelled(["LFEO", "LFEA", "LFEL", "LTIB1", "O", "A", "L", "P"], {}))
    assert all(find_modelled(["S:LTIB1", "S:LFOF0"], {}))
    assert all(find_modelled(["S:Weird", "S:LHJC"], {"FORCES": ["Weird"]}))


@pytest.mark.parametrize("processor", [INTEL, DEC, SGI])
@pytest.mark.parametrize("scale", [-0.1, 0.125])
def test_processors_and_integers(load, processor, scale):
    points = grid()
    points[1, 2, 3] = -1
    points[0, 0, :3] = -1234, 5, 7
    capture = load(points, labels=["A", "B", "C"], processor=processor, scale=scale, first=7)
    factor = scale if scale > 0 else 1
    expected = points[points[..., 3] >= 0][:, :3] * factor / 1000
    np.testing.assert_array_equal(capture.points, expected)
    assert (capture.rate, capture.first_frame, capture.units) == (100, 7, "mm")
    assert capture.names == ("A", "B", "C")


@pytest.mark.parametrize("scale", [-1.0, 0.5])
@pytest.mark.parametrize("processor", [INTEL, DEC])  # it does not know SGI
def test_ezc3d_reads_the_same(tmp_path, scale, processor):
    """The maker of test files, the reader and another program agree."""
    path = tmp_path / "trial.c3d"
    path.write_bytes(make_c3d(grid(), labels=["A", "B", "C"], processor=processor, scale=scale))
    theirs = ezc3d.c3d(str(path))["data"]["points"][:3].transpose(2, 1, 0).reshape(-1, 3)
    np.testing.assert_allclose(read(path).points, theirs / 1000, rtol=1e-7)


CORNERS = [0, 0, 0, 600, 0, 0, 600, 400, 0, 0, 400, 0]  # millimetres


def side_data():
    return [
        ("ANALOG", "USED", 2, (), integers([2])),
        ("ANALOG", "LABELS", *text(["Fz1", "EMG"])),
        ("ANALOG", "UNITS", *text(["N", "V"])),
        ("ANALOG", "RATE", 4, (), reals([200])),
        ("ANALOG", "OFFSET", 2, (2,), integers([10, 65_526])),  # -10 as a signed integer
        ("EVENT", "TIMES", 4, (2, 2), reals([0, 1.27, 1, 0.5])),
        ("EVENT", "LABELS", *text(["Foot Off", "Foot Strike"])),
        ("EVENT", "CONTEXTS", *text(["Left", "Right"])),
        ("FORCE_PLATFORM", "USED", 2, (), integers([1])),
        ("FORCE_PLATFORM", "TYPE", 2, (1,), integers([2])),
        ("FORCE_PLATFORM", "CORNERS", 4, (3, 4, 1), reals(CORNERS)),
        ("FORCE_PLATFORM", "ORIGIN", 4, (3, 1), reals([0, 0, -40])),
        ("FORCE_PLATFORM", "CHANNEL", 2, (2, 1), integers([2, 1])),
    ]  # fmt: skip


def test_analog_channels_events_and_force_plates(load):
    stored = np.arange(16).reshape(4, 4)
    capture = load(grid(), analog=stored, n_samples=2, more=side_data(), first=126)
    assert capture.analog.names == ("Fz1", "EMG")
    assert capture.analog.units == ("N", "V")
    np.testing.assert_array_equal(capture.analog.times, np.arange(8) / 200)
    scale = capture.analog.scale
    np.testing.assert_allclose(capture.analog["Fz1"], (stored.ravel()[::2] - 10) * scale[0])
    np.testing.assert_allclose(capture.analog["EMG"], (stored.ravel()[1::2] + 10) * scale[1])
    with pytest.raises(KeyError, match="no analog channel 'Fz2': Fz1, EMG"):
        capture.analog["Fz2"]
    off, strike = capture.events  # 125 frames of 0.01 s before the first
    assert off == Event(time=pytest.approx(0.02), label="Foot Off", context="Left")
    assert strike.time == pytest.approx(59.25)
    (plate,) = capture.plates
    np.testing.assert_allclose(plate.corners[2], [0.6, 0.4, 0])
    np.testing.assert_allclose(plate.origin, [0, 0, -0.04])
    assert plate.channels == ("EMG", "Fz1")
    assert "0.6 × 0.4 m" in repr(plate)
    assert load(grid()).analog is None


@pytest.mark.parametrize("name", ["HC030A22", "JA1Gait35", "Running_0002"])
def test_analog_channels_are_those_of_ezc3d(name):
    for path in DATA.rglob(f"{name}.c3d"):
        mine, theirs = read(path).analog, ezc3d.c3d(str(path))
        assert list(mine.names) == theirs["parameters"]["ANALOG"]["LABELS"]["value"]
        for k, label in enumerate(mine.names):
            wanted = theirs["data"]["analogs"][0][k]
            np.testing.assert_allclose(mine[label], wanted, rtol=1e-6, atol=1e-6)
        return
    pytest.skip(f"no {name}.c3d in {DATA}")


def test_cameras_and_residuals(tmp_path):
    d = Detections(
        times=[0.0, 0.01], offsets=[0, 2, 3], points=[[0, 0, 1], [1, 0, 0], [0, 0, 2]],
        cameras=[0b1011, 0b11, 0b100000010], residuals=[0.00012, 0.0, 0.01],
    )  # fmt: skip
    path = tmp_path / "seen.c3d"
    write(Tracks(detections=d, labels=[0, 1, 0], names=("a", "b")), path)
    # The high byte has the cameras, the low one the residual; 0 would say that it was computed.
    words = read_c3d(path).points[..., 3]
    assert words.tolist() == [[0b1011 * 256 + 12, 0b11 * 256 + 1], [0b10 * 256 + 255, -1]]
    back = read(path)
    assert back.cameras.tolist() == [0b1011, 0b11, 0b10]  # C3D has room for seven
    np.testing.assert_allclose(back.residuals, [0.00012, 0.00001, 0.00255], atol=1e-9)
    theirs = ezc3d.c3d(str(path))["data"]["points"]
    np.testing.assert_allclose(theirs[:3, 0, 0], [0, 0, 1000])
    again = tmp_path / "again.c3d"
    write(back.tracks, again)
    np.testing.assert_array_equal(read_c3d(again).points[..., 3], words)
