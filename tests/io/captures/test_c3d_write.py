"""C3D files that are written: what survives, and what does not fit."""

from __future__ import annotations

import tracemalloc

import ezc3d
import numpy as np
import pytest

from asterism.errors import FormatError, ParameterError
from asterism.io import read, write
from asterism.io.captures.c3d_layout import read_c3d
from asterism.model import Capture, Detections, Tracks
from tests.io.c3d_bytes import DEC, INTEL, SGI, integers, make_c3d, reals, text
from tests.io.captures.c3d_files import grid


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
