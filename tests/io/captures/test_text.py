"""TRC, TSV, the CSVs and the log: what real exporters write, and what broken files say."""

from __future__ import annotations

import struct

import numpy as np
import pytest

from asterism.errors import FormatError, ParameterError
from asterism.io import read, read_tracks, write
from asterism.model import Detections, Tracks

TRC = (
    "PathFileType\t4\t(X/Y/Z)\ttrial.trc\n"
    "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\t"
    "OrigNumFrames\n"
    "100.00\t100.00\t3\t2\tmm\t100.00\t1\t3\n"
    "Frame#\tTime\tLASI\t\t\tRASI\t\t\n"
    "\t\tX1\tY1\tZ1\tX2\tY2\tZ2\n"
    "\n"
    "5\t0.500\t1\t2\t3\t4\t5\t6\n"
    "6\t0.510\t1.5\t2\t3\t\t\t\n"
    "7\t0.520\t1\t2\t3\t4\t5\t6\n"
)


@pytest.fixture
def load(tmp_path):
    def _load(content, name="trial.trc", how=read):
        path = tmp_path / name
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return how(path)

    return _load


def check_trc(capture):
    np.testing.assert_array_equal(capture.times, [0.5, 0.51, 0.52])
    np.testing.assert_array_equal(capture.counts, [2, 1, 2])
    np.testing.assert_array_equal(capture.points[2], np.array([1.5, 2, 3]) / 1000)
    assert (capture.rate, capture.first_frame, capture.units) == (100, 5, "mm")


def test_trc(load):
    capture = load(TRC)
    check_trc(capture)
    assert capture.names == ("LASI", "RASI")
    # These few millimetres are the size of metres, and nothing else is odd.
    assert [text.partition(":")[0] for text in capture.warnings] == ["unit of length"]


@pytest.mark.parametrize(
    "change",
    [
        lambda t: t.replace("\n", "\r\n"),
        lambda t: t.replace("\n\n", "\n"),  # no empty line
        lambda t: t.replace("6\n", "6\t\n").replace("RASI\t\t", "RASI\t\t\t"),  # trailing tabs
        lambda t: "\ufeff" + t,
        lambda t: t + "\n\n",
        lambda t: t.replace("\t\t\t\n7", "\tNaN\tNaN\tNaN\n7").replace("3\tNaN", "3\tNaN", 1),
        lambda t: t.replace("3\t\t\t\n", "3\t0.0\t0\t0\n"),
    ],
)
def test_trc_as_others_write_it(load, change):
    capture = load(change(TRC))
    check_trc(capture)
    assert capture.names == ("LASI", "RASI")


def test_trc_units_and_names(load):
    capture = load(TRC.replace("\tmm\t", "\tm\t"))
    np.testing.assert_array_equal(capture.points[2], [1.5, 2, 3])
    assert load(TRC.replace("RASI", "LASI")).names == ("LASI", "LASI")
    assert "by their size" in load(TRC.replace("\tmm\t", "\tell\t")).warnings[0]
    assert load(TRC.replace("RASI", "*1")).names == ("LASI", None, None)


def test_trc_gaps_are_blank(tmp_path):
    dense = np.array([[[1, 2, 3], [4, 5, 6]], [[1, 2, 3], [np.nan] * 3]]) / 1000
    write(Tracks.from_dense([0, 0.01], dense, ["LASI", "RASI"]), tmp_path / "a.trc")
    lines = (tmp_path / "a.trc").read_text().split("\n")
    assert lines[3] == "Frame#\tTime\tLASI\t\t\tRASI\t\t"
    assert lines[6] == "1\t0.0\t1.0\t2.0\t3.0\t4.0\t5.0\t6.0"
    assert lines[7] == "2\t0.01\t1.0\t2.0\t3.0\t\t\t\t"  # OpenSim drops one blank field at the end


@pytest.mark.parametrize(
    ("change", "place"),
    [
        (lambda t: t.replace("6\t0.510\t1.5\t2", "6\t0.510"), "line 8: expected 8 columns"),
        (lambda t: t.replace("6\n", "6\t7\n", 1), "line 7: expected 8 columns"),
        (lambda t: t.replace("1.5", "1,5"), "line 8, column 3: expected a number"),
        (lambda t: t.replace("1.5", "inf"), "line 8, column 3: expected a finite"),
        (lambda t: t.replace("0.510", "0.500"), "line 8: expected a time after 0.5 s"),
        (lambda t: t.replace("0.520", "-0.52"), "line 9: expected a time after 0.51 s"),
        (lambda t: t.replace("0.510", ""), "line 8: expected a time"),
        (lambda t: t.replace("LASI\t\t\t", "LASI\t"), "line 4: expected three tabs"),
        (lambda t: t.replace("Frame#", "Item"), "line 4"),
        (lambda t: t.replace("PathFileType", "Path"), "line 1"),
        (lambda t: t[:60], "line 1"),
        (lambda t: "", "line 1"),
    ],
)
def test_bad_trc(load, change, place):
    with pytest.raises(FormatError, match=place):
        load(change(TRC))


@pytest.mark.parametrize("n_kept", [6, 5])
def test_trc_without_frames(load, n_kept):
    capture = load("\n".join(TRC.split("\n")[:n_kept]))
    assert (capture.n_frames, capture.names) == (0, ("LASI", "RASI"))
    assert "the file has 0 frames" in capture.warnings[0]


TSV = (
    "NO_OF_FRAMES\t3\nNO_OF_CAMERAS\t7\nNO_OF_MARKERS\t2\nFREQUENCY\t100\nDESCRIPTION\t--\n"
    "TIME_STAMP\t2021-08-26, 15:19:24.317\t1.5\nDATA_INCLUDED\t3D\n"
    "MARKER_NAMES\thand\tthumb\nTRAJECTORY_TYPES\tMeasured\tMixed\n"
    "Frame\tTime\thand X\thand Y\thand Z\tthumb X\tthumb Y\tthumb Z\n"
    "1\t0.00000\t1\t2\t3\t4\t5\t6\n2\t0.01000\t1\t2\t3\t%s\n3\t0.02000\t1\t2\t3\t4\t5\t6\n"
)


@pytest.mark.parametrize("gap", ["\t\t", "NULL\tNULL\tNULL", "0.000\t0.000\t0.000", "null\tnan\t"])
def test_tsv(load, gap):
    capture = load(TSV % gap, "a.tsv")
    assert capture.names == ("hand", "thumb")
    np.testing.assert_array_equal(capture.counts, [2, 1, 2])
    np.testing.assert_array_equal(capture.points[1], np.array([4, 5, 6]) / 1000)
    assert (capture.rate, capture.first_frame, capture.units) == (100, 1, "mm")
    assert "thumb (Mixed)" in capture.warnings[0]


def test_tsv_without_titles(load):
    text = TSV % "\t\t"
    head, _, rows = text.partition("Frame\t")
    rows = "\n".join("\t".join(r.split("\t")[2:]) for r in rows.split("\n")[1:])
    capture = load(head + rows, "a.tsv")
    np.testing.assert_array_equal(capture.times, [0, 0.01, 0.02])
    np.testing.assert_array_equal(capture.counts, [2, 1, 2])


@pytest.mark.parametrize(
    ("old", "new", "place"),
    [
        ("3\t0.02000\t1\t2", "3\t0.02000\t1", "line 13: expected 8 columns"),
        ("0.02000", "0.01", "line 13: expected a time after 0.01 s"),
        ("FREQUENCY\t100", "FREQUENCY\tfast", "FREQUENCY"),
        ("DATA_INCLUDED\t3D", "DATA_INCLUDED\t6D", "DATA_INCLUDED"),
        ("MARKER_NAMES", "MARKER_WORDS", "MARKER_NAMES"),
        ("NO_OF_FRAMES", "NUMBER", "line 1"),
    ],
)
def test_bad_tsv(load, old, new, place):
    with pytest.raises(FormatError, match=place):
        load((TSV % "\t\t").replace(old, new), "a.tsv")


MOTIVE = """Format Version,1.23,Take Name,a,Capture Frame Rate,240.0,Export Frame Rate,120.0,\
Length Units,%s

,Type,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body Marker,Rigid Body Marker,\
Rigid Body Marker,Marker,Marker,Marker,Marker,Marker,Marker
,Name,RB,RB,RB,RB,RB:1,RB:1,RB:1,RB:1,RB:1,RB:1,Unlabeled 7,Unlabeled 7,Unlabeled 7
,ID,"1","1","1","1","2","2","2","3","3","3","4","4","4"
,,Rotation,Position,Position,Position,Position,Position,Position,Position,Position,Position,\
Position,Position,Position
Frame,Time (Seconds),X,X,Y,Z,X,Y,Z,X,Y,Z,X,Y,Z
0,0.00,9,1,2,3,7,7,7,0.1,0.2,0.3,,,
1,0.01,9,1,2,3,7,7,7,0.1,0.2,0.3,0.5,0.6,0.7
2,0.02,9,1,2,3,7,7,7,,,,0.5,0.6,0.7
3,0.03,9,1,2,3,7,7,7,,,,,,
4,0.04,9,1,2,3,7,7,7,,,,0.5,0.6,0.7
"""


def test_motive(load):
    capture = load(MOTIVE % "Meters", "take.csv")
    assert capture.format == "motive"
    assert capture.names == ("RB:1", None, None)
    assert capture.modelled == ("RB", "RB:1")
    assert (capture.rate, capture.units, capture.first_frame) == (120, "m", 0)
    np.testing.assert_array_equal(capture.labels, [0, 0, 1, 1, 2])
    np.testing.assert_array_equal(capture.points[2], [0.5, 0.6, 0.7])
    millimetres = load(MOTIVE % "Millimeters", "take.csv")
    np.testing.assert_array_equal(millimetres.points[2], np.array([0.5, 0.6, 0.7]) / 1000)


def test_bad_motive(load):
    with pytest.raises(FormatError, match="type Marker"):
        load((MOTIVE % "Meters").replace(",Marker", ",Bone"), "take.csv")
    with pytest.raises(FormatError, match="line 9: expected a time after"):
        load((MOTIVE % "Meters").replace("1,0.01", "1,0.00"), "take.csv")
    with pytest.raises(FormatError, match="Length Units"):
        load(MOTIVE % "Cubits", "take.csv")
    with pytest.raises(FormatError, match="the header"):
        load((MOTIVE % "Meters")[:200], "take.csv")


CSV = (
    "frame,time_s,x_m,y_m,z_m,track,name,confidence\n"
    "1,0.0,1.0,2.0,3.0,0,LASI,0.5\n"
    "1,0.0,4.0,5.0,6.0,-1,,1.0\n"
    "2,0.01,,,,,,\n"
    "3,0.05,1.0,2.0,3.0,1,,0.25\n"
    ",,,,,2,RASI,\n"
)


def test_csv(load):
    tracks = load(CSV, "a.csv", read_tracks)
    assert tracks.names == ("LASI", None, "RASI")
    np.testing.assert_array_equal(tracks.labels, [0, -1, 1])
    np.testing.assert_array_equal(tracks.confidence, [0.5, 1, 0.25])
    np.testing.assert_array_equal(tracks.detections.times, [0, 0.01, 0.05])
    np.testing.assert_array_equal(tracks.detections.counts, [2, 0, 1])


def test_csv_is_written_as_documented(load, tmp_path):
    write(load(CSV, "a.csv", read_tracks), tmp_path / "b.csv")
    assert (tmp_path / "b.csv").read_text() == CSV


def test_csv_by_others(load):
    """Columns in another order, rows by track, no tracks at all."""
    tracks = load(
        'name,y_m,x_m,time_s,frame,track\n"L, x",2,1,0.0,1,0\n"L, x",2,1,0.1,2,0\n,8,9,0.0,1,1\n',
        "a.csv", read_tracks,
    )  # fmt: skip
    assert tracks.names == ("L, x", None)
    np.testing.assert_array_equal(tracks.labels, [0, 1, 0])
    np.testing.assert_array_equal(tracks.detections.points, [[1, 2], [9, 8], [1, 2]])
    bare = load("frame,time_s,x_m,y_m\n1,0,1,2\n", "a.csv")
    np.testing.assert_array_equal(bare.labels, [-1])
    assert load("frame,time_s,x_m,y_m,z_m\n", "a.csv").n_frames == 0


@pytest.mark.parametrize(
    ("old", "new", "place"),
    [
        ("1,0.0,4.0", "1,0.0", "line 3: expected 8 columns"),
        ("4.0,5.0", "4.0,five", "line 3, column y_m: expected a finite number"),
        ("4.0,5.0", "4.0,", "line 3: expected a frame, a time and all coordinates"),
        ("4.0,5.0", "4.0,inf", "line 3, column y_m: expected a finite number"),
        ("4.0,5.0,6.0", "inf,inf,inf", "line 3, column x_m: expected a finite number"),
        ("1,0.0,4.0", "1,0.1,4.0", "line 3: expected the time of the other rows of frame 1"),
        ("3,0.05", "3,0.005", "line 5: expected a time after 0.01 s"),
        ("3,0.05", "3,-0.05", "line 5: expected a time after 0.01 s"),
        (",-1,", ",-2,", "column track"),
        (",-1,", ",0.5,", "column track"),
        (",-1,", ",0,", "labels: expected at most one detection of a track in a frame"),
        (",-1,", ",99999999999,", "column track"),
        (",2,RASI", ",0,RASI", "line 6: expected one name for track 0"),
        ("0.25", "1.25", "confidence"),
        ("confidence", "trust", "line 1: expected the columns"),
    ],
)
def test_bad_csv(load, old, new, place):
    with pytest.raises(FormatError, match=place):
        load(CSV.replace(old, new), "a.csv", read_tracks)


WIDE = "time_s,LASI_x,LASI_y,LASI_z,R_x_x,R_x_y,R_x_z\n0.0,1,2,3,4,5,6\n0.3,1,2,3,,,\n"


def test_wide_csv(load, tmp_path):
    capture = load(WIDE, "a.csv")
    assert capture.names == ("LASI", "R_x")
    np.testing.assert_array_equal(capture.counts, [2, 1])
    flat = load("time_s,A_x,A_y\n0,1,2\n", "a.csv")
    assert flat.n_axes == 2
    write(capture.tracks, tmp_path / "b.csv", format="csv-wide")
    np.testing.assert_array_equal(read(tmp_path / "b.csv").points, capture.points)


@pytest.mark.parametrize(
    ("old", "new", "place"),
    [
        ("LASI_y", "LASI_w", "line 1: .* 'LASI_w' instead"),
        ("0.3,1,2", "0.3,1", "line 3: expected 7 columns"),
        ("0.3", "0.0", "line 3: expected a time after"),
    ],
)
def test_bad_wide_csv(load, old, new, place):
    with pytest.raises(FormatError, match=place):
        load(WIDE.replace(old, new), "a.csv")


def log(*records):
    return b"".join(
        struct.pack("<II", t, len(p)) + np.array(p, "<f4").tobytes() for t, p in records
    )


def test_point_cloud(load, tmp_path):
    raw = log((5, []), (14, [[1, 2, 3]]), (25, [[1, 2, 3], [4, 5, 6]]))
    for name in ("a.log", "a.bin", "recording_000"):
        capture = load(raw, name)
        np.testing.assert_array_equal(capture.times, [0.005, 0.014, 0.025])
        np.testing.assert_array_equal(capture.counts, [0, 1, 2])
        np.testing.assert_array_equal(capture.labels, -1)
    write(capture.tracks, tmp_path / "b.log")
    assert (tmp_path / "b.log").read_bytes() == raw


@pytest.mark.parametrize(
    ("raw", "place"),
    [
        (log((5, []), (5, [])), "record 1, byte 8: expected a time after 5 ms"),
        (log((5, [[1, 2, 3]]), (4, [])), "record 1, byte 20: expected a time after 5 ms"),
        (log((5, [[1, 2, 3]]))[:-1], "record 0, byte 0: expected 1 points"),
        (log((5, [])) + b"\1", "record 1, byte 8: expected 8 bytes"),
        (struct.pack("<II", 5, 2**32 - 1), "record 0"),
        (log((5, [[1, np.nan, 3]])), "record 0, point 0: expected finite"),
        (b"", "record 0"),
    ],
)
def test_bad_point_cloud(load, raw, place):
    with pytest.raises(FormatError, match=place):
        load(raw, "a.log", lambda path: read(path, format="pointcloud"))


def test_point_cloud_holds_whole_milliseconds(tmp_path):
    d = Detections.from_frames([0, 0.0001], [[[1, 2, 3]], []])
    with pytest.raises(ParameterError, match="millisecond"):
        write(Tracks(detections=d, labels=[0]), tmp_path / "a.log")


@pytest.mark.parametrize("name", ["a.txt", "noending", "a.csv"])
def test_unknown_content(load, name):
    with pytest.raises(FormatError, match="expected one of: "):
        load("Dear reader,\nthis is a letter.\n", name)


def test_files_that_are_none(tmp_path):
    with pytest.raises(FormatError, match="no such file"):
        read(tmp_path / "no.c3d")
    with pytest.raises(FormatError, match="found a folder"):
        read(tmp_path)
    with pytest.raises(FormatError, match="device or pipe"):
        read("/dev/zero", format="c3d")
    (tmp_path / "a.c3d").write_bytes(b"")
    with pytest.raises(ParameterError, match="format: expected one of c3d, trc"):
        read(tmp_path / "a.c3d", format="mp3")


def test_content_tells_where_the_ending_does_not(load):
    assert load(TRC, "export.txt").format == "trc"
    assert load(CSV, "export").format == "csv"
    assert load(TSV % "\t\t", "export.txt").format == "qtm"


@pytest.mark.parametrize("encoding", ["latin-1", "utf-8", "utf-16"])
def test_encodings(load, encoding):
    assert load(TRC.replace("LASI", "Hüfte").encode(encoding)).names[0] == "Hüfte"


def test_a_trc_header_names_its_own_file(tmp_path):
    tracks = Tracks.from_dense([0, 0.01], np.ones((2, 1, 3)), ["LASI"])
    write(tracks, tmp_path / "walk 1.trc")
    first = (tmp_path / "walk 1.trc").read_text().splitlines()[0]
    assert first == "PathFileType\t4\t(X/Y/Z)\twalk 1.trc"
    (tmp_path / "link.trc").symlink_to(tmp_path / "walk 1.trc")
    write(tracks, tmp_path / "link.trc")  # a link stays one, and its target is the file
    assert (tmp_path / "walk 1.trc").read_text().splitlines()[0] == first
