"""C3D: every trap that recording systems lay, and files made by another program."""

from __future__ import annotations

import tracemalloc

import ezc3d
import numpy as np
import pytest

from asterism.errors import FormatError, ParameterError
from asterism.io import read, write
from asterism.io.captures.c3d_layout import read_c3d
from asterism.io.captures.marker_names import find_modelled, is_unlabelled
from asterism.model import Capture, Detections, Tracks
from asterism.model.side_data import Event
from tests.io.c3d_bytes import DEC, INTEL, SGI, integers, make_c3d, reals, text
from tests.paths import DATA


def grid(n_frames=4, n_points=3):
    """Points in millimetres that all differ, with a fourth word of 0."""
    values = np.arange(n_frames * n_points * 3, dtype=float).reshape(n_frames, n_points, 3) + 100
    return np.concatenate([values, np.zeros((n_frames, n_points, 1))], axis=2)


@pytest.fixture
def load(tmp_path):
    def _load(*args, **options):
        path = tmp_path / "trial.c3d"
        path.write_bytes(make_c3d(*args, **options))
        return read(path)

    return _load


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
def test_names_of_nobody(name):
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
    assert "5 frames are taken; the header says 3" in capture.warnings


def test_no_frames_no_points_no_detections(load):
    assert load(np.empty((0, 3, 4)), labels=["A", "B", "C"]).n_frames == 0
    nobody = load(np.empty((6, 0, 4)), analog=np.ones((6, 2)), n_samples=2)
    assert (nobody.n_frames, nobody.n_points) == (6, 0)
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


def test_a_first_frame_that_no_c3d_can_count(tmp_path):
    (tmp_path / "a.csv").write_text("frame,time_s,x_m,y_m,z_m\n-7,0,1,2,3\n-6,0.8,1,2,3\n")
    write(read(tmp_path / "a.csv").tracks, tmp_path / "a.c3d")
    capture = read(tmp_path / "a.c3d")
    assert (capture.first_frame, capture.rate) == (1, 1.25)


def with_everything():
    points = grid(4, 4)
    points[..., 3] = 513  # cameras 2, residual 1
    points[2, 0, 3] = -1
    return make_c3d(
        points,
        labels=["LASI", "LHipAngles", "*2", "RASI"],
        scale=-0.1,
        first=126,
        analog=np.arange(4 * 6).reshape(4, 6),
        n_samples=3,
        more=[
            ("POINT", "DESCRIPTIONS", *text(["left", "angle", "", "right"])),
            ("POINT", "ANGLES", *text(["LHipAngles"])),
            ("ANALOG", "USED", 2, (), integers([2])),
            ("ANALOG", "LABELS", *text(["Fx", "Fy"])),
            ("ANALOG", "SCALE", 4, (2,), reals([1, 2])),
            ("ANALOG", "GEN_SCALE", 4, (), reals([1])),
            ("ANALOG", "OFFSET", 2, (2,), integers([0, 0])),
            ("ANALOG", "RATE", 4, (), reals([300])),
            ("EVENT", "USED", 2, (), integers([1])),
            ("EVENT", "LABELS", *text(["Foot Strike"])),
            ("EVENT", "TIMES", 4, (2, 1), reals([0, 1.5])),
            ("MANUFACTURER", "COMPANY", *text(["Somebody"])),
            ("Own", "LeftLeg", 4, (), reals([0.9])),
        ],
    )


def test_what_is_not_a_point_survives(tmp_path):
    source, result = tmp_path / "source.c3d", tmp_path / "result.c3d"
    source.write_bytes(with_everything())
    capture = read(source)
    # Another labelling: one track over two channels, one without a name, the rest clutter.
    labels = np.where(capture.channels == 0, 1, np.where(capture.channels == 3, 0, -1))
    labels[(capture.channels == 2) & (capture.frame_of == 2)] = 1
    tracks = Tracks(detections=capture, labels=labels, names=("NEW", None))
    write(tracks, result)
    old, new = (ezc3d.c3d(str(path)) for path in (source, result))
    assert new["parameters"]["POINT"]["LABELS"]["value"] == ["NEW", "T001", "*0", "LHipAngles"]
    np.testing.assert_array_equal(new["data"]["analogs"], old["data"]["analogs"])
    np.testing.assert_array_equal(new["data"]["points"][:3, 3], old["data"]["points"][:3, 1])
    for group in ("ANALOG", "EVENT", "MANUFACTURER"):
        for name, value in old["parameters"][group].items():
            if name != "__METADATA__":
                np.testing.assert_array_equal(
                    new["parameters"][group][name]["value"], value["value"]
                )
    assert new["parameters"]["POINT"]["ANGLES"]["value"] == ["LHipAngles"]
    assert b"LeftLeg" in result.read_bytes()
    assert new["header"]["points"]["first_frame"] == 125
    # Residuals and cameras go with the points; what is not there has residual -1.
    residuals = new["data"]["meta_points"]["residuals"][0]
    before = old["data"]["meta_points"]["residuals"][0]
    np.testing.assert_allclose(before[3], 0.2, rtol=1e-6)
    np.testing.assert_array_equal(residuals[0], before[3])
    np.testing.assert_array_equal(residuals[1], [*before[0, :2], before[2, 2], before[0, 3]])
    np.testing.assert_array_equal(residuals[2], [*before[2, :2], -1, before[2, 3]])
    again = read(result)
    np.testing.assert_array_equal(again.tracks.positions(), tracks.positions())
    assert again.names == tracks.names
    assert again.n_points == capture.n_points


@pytest.mark.parametrize("processor", [INTEL, DEC, SGI])
@pytest.mark.parametrize("kind", ["SIGNED", "UNSIGNED"])
def test_integers_of_any_processor_become_reals_of_intel(tmp_path, processor, kind):
    source, result = tmp_path / "source.c3d", tmp_path / "result.c3d"
    analog = np.array([[1, 40_000], [-2, 3], [4, 5], [6, 65_535]])
    more = [
        ("ANALOG", "USED", 2, (), integers([1], processor)),
        ("ANALOG", "FORMAT", -1, (len(kind),), kind.encode()),
        ("ANALOG", "RATE", 4, (), reals([200], processor)),
        ("ANALOG", "SCALE", 4, (1,), reals([1], processor)),
        ("ANALOG", "GEN_SCALE", 4, (), reals([1], processor)),
        ("ANALOG", "OFFSET", 2, (1,), integers([0], processor)),
        ("EVENT", "TIMES", 4, (2, 1), reals([0, 1.5], processor)),
    ]
    source.write_bytes(
        make_c3d(grid(), labels=["A", "B", "C"], scale=0.5, processor=processor, analog=analog,
                 n_samples=2, more=more)
    )  # fmt: skip
    capture = read(source)
    write(capture.tracks, result)
    bits = 0 if kind == "SIGNED" else 65_536
    expected = np.where(analog < 0, analog + bits, analog)
    expected = np.where((expected > 32_767) & (bits == 0), expected - 65_536, expected)
    np.testing.assert_array_equal(read_c3d(result).analog, expected)
    theirs = ezc3d.c3d(str(result))
    np.testing.assert_array_equal(theirs["data"]["points"][:3].T, grid()[..., :3] * 0.5)
    np.testing.assert_array_equal(theirs["parameters"]["EVENT"]["TIMES"]["value"][1], [1.5])
    np.testing.assert_array_equal(read(result).points, capture.points)


def test_memory_stays_near_the_size_of_the_file(tmp_path):
    path = tmp_path / "long.c3d"
    rng = np.random.default_rng(4)
    dense = rng.normal(size=(5000, 100, 3))
    dense[rng.random((5000, 100)) < 0.05] = np.nan
    write(Tracks.from_dense(np.arange(5000) / 120, dense, [f"M{i}" for i in range(100)]), path)
    tracemalloc.start()
    read(path)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 6 * path.stat().st_size


def test_every_detection_is_in_the_file(tmp_path):
    rng = np.random.default_rng(1)
    frames = [rng.normal(size=(n, 3)) for n in (3, 0, 5, 1)]
    d = Detections.from_frames([0, 0.01, 0.02, 0.03], frames)
    write(Tracks(detections=d, labels=np.full(9, -1)), tmp_path / "a.c3d")
    capture = read(tmp_path / "a.c3d")
    np.testing.assert_array_equal(capture.labels, -1)
    np.testing.assert_allclose(capture.points, d.points, rtol=1e-6)
    np.testing.assert_array_equal(capture.offsets, d.offsets)


def test_a_point_at_the_origin_is_not_lost(tmp_path):
    tracks = Tracks.from_dense([0, 0.1], np.zeros((2, 1, 3)), ["A"])
    write(tracks, tmp_path / "a.c3d")
    capture = read(tmp_path / "a.c3d")
    assert capture.n_points == 2
    np.testing.assert_allclose(capture.points, 0, atol=1e-30)


def test_names_do_not_collide(tmp_path):
    dense = np.random.default_rng(2).normal(size=(3, 4, 3))
    write(Tracks.from_dense([0, 1, 2], dense, ["T001", None, None, "T003"]), tmp_path / "a.c3d")
    labels = ezc3d.c3d(str(tmp_path / "a.c3d"))["parameters"]["POINT"]["LABELS"]["value"]
    assert labels == ["T001", "T001_", "T002", "T003"]
    capture = read(tmp_path / "a.c3d")
    assert capture.names == ("T001", None, None, "T003")
    # A name that is given later is a name, also where it is the one that was made up.
    named = Tracks(detections=capture, labels=capture.labels, names=("A", "B", "T002", None))
    write(named, tmp_path / "b.c3d")
    assert read(tmp_path / "b.c3d").names == ("A", "B", "T002", None)


def test_times_must_be_regular_and_points_3d(tmp_path):
    dense = np.ones((3, 1, 3))
    write(Tracks.from_dense([0, 0.01, 0.02005], dense), tmp_path / "a.c3d")
    with pytest.raises(ParameterError, match="Write CSV"):
        write(Tracks.from_dense([0, 0.01, 0.03], dense), tmp_path / "b.c3d")
    with pytest.raises(ParameterError, match="3-D points"):
        write(Tracks.from_dense([0, 0.01, 0.02], dense[..., :2]), tmp_path / "b.c3d")
    assert not (tmp_path / "b.c3d").exists()


def test_too_much_for_the_parameter_section(tmp_path):
    dense = np.ones((1, 3000, 3))
    names = [f"a marker with a rather long name, number {i:09d}" for i in range(3000)]
    with pytest.raises(ParameterError, match="130 kB"):
        write(Tracks.from_dense([0], dense, names), tmp_path / "a.c3d")
    with pytest.raises(ParameterError, match="255 bytes"):
        write(Tracks.from_dense([0], dense[:, :1], ["n" * 256]), tmp_path / "a.c3d")


def test_the_source_is_gone_or_changed(tmp_path):
    source = tmp_path / "source.c3d"
    source.write_bytes(make_c3d(grid(), labels=["A", "B", "C"]))
    capture = read(source)
    source.write_bytes(make_c3d(grid(3), labels=["A", "B", "C"]))
    with pytest.raises(FormatError, match="another number of frames"):
        write(capture.tracks, tmp_path / "out.c3d")
    source.unlink()
    with pytest.raises(FormatError, match="no such file"):
        write(capture.tracks, tmp_path / "out.c3d")
    write(capture.tracks, tmp_path / "out.csv")  # which needs no source


def test_a_clip_of_a_capture_takes_its_part_of_the_source(tmp_path):
    source, result = tmp_path / "source.c3d", tmp_path / "clip.c3d"
    source.write_bytes(with_everything())
    whole = read(source)
    begin, end = int(whole.offsets[1]), int(whole.offsets[3])
    clip = Capture(
        times=whole.times[1:3],
        offsets=whole.offsets[1:4] - begin,
        points=whole.points[begin:end],
        path=whole.path,
        format="c3d",
        rate=whole.rate,
        first_frame=whole.first_frame + 1,
        units=whole.units,
        channels=whole.channels[begin:end],
        labels=whole.labels[begin:end],
        names=whole.names,
    )
    write(clip.tracks, result)
    old, new = (ezc3d.c3d(str(path)) for path in (source, result))
    analog = old["data"]["analogs"][:, :, 3:9]
    np.testing.assert_array_equal(new["data"]["analogs"], analog)
    np.testing.assert_array_equal(read(result).points, clip.points)


def test_a_described_data_start_keeps_the_data_where_the_header_says(tmp_path):
    # A description that was dropped after the blocks were counted moved the data by one block.
    raw = make_c3d(np.ones((3, 1, 4)), labels=["A"])
    at = raw.index(b"DATA_START") + len(b"DATA_START")
    text = b"where the points begin, counted in blocks of 512"
    offset = int.from_bytes(raw[at : at + 2], "little") + len(text)
    start = 512 * (int.from_bytes(raw[16:18], "little") - 1)
    record = raw[at + 2 : at + 6] + bytes([len(text)]) + text  # type, no dimensions, value, text
    parameters = raw[:at] + offset.to_bytes(2, "little") + record + raw[at + 7 : start - len(text)]
    assert not raw[start - len(text) : start].strip(b"\0")
    path = tmp_path / "described.c3d"
    path.write_bytes(parameters + raw[start:])
    d = read(path)
    assert d.n_frames == 3
    for n in range(1, 120):
        tracks = Tracks(detections=d, labels=[0, 0, 0], names=tuple(f"N{i}" for i in range(n)))
        out = tmp_path / "out.c3d"
        write(tracks, out)
        assert read(out).n_frames == 3, n


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
