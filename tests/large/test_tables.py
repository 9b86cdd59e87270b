"""Plain tables: CSV and Parquet in, the same rows with labels out."""

from __future__ import annotations

import sys
from itertools import pairwise

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

import asterism as am
from asterism.large import csv_table, parquet_table
from asterism.large.rows import frames_of
from asterism.large.track import open_table
from tests.large.scenes import MODEL, dense, labels_of, rows_of, write_csv


@pytest.fixture(scope="module")
def scene():
    return dense(n=60, frames=14)


def write_parquet(path, columns, **options):
    pq.write_table(pa.table(columns), path, **options)
    return path


def labels_in(path):
    if path.suffix == ".parquet":
        return pq.read_table(path)["track"].to_numpy()
    return np.array([int(line.rpartition(",")[2]) for line in path.read_text().splitlines()[1:]])


@pytest.mark.parametrize("write", [write_csv, write_parquet])
def test_a_table_gets_the_labels_of_the_tracker(tmp_path, scene, write):
    d = scene.detections
    ending = ".csv" if write is write_csv else ".parquet"
    source = write(tmp_path / f"in{ending}", rows_of(d, scene.labels))
    seen = []
    run = am.large.track(source, tmp_path / f"out{ending}", model=MODEL, progress=seen.append)
    wanted = np.concatenate(labels_of(d))
    assert labels_in(tmp_path / f"out{ending}").tolist() == wanted.tolist()
    assert (run.n_frames, run.n_points) == (14, d.n_points)
    assert run.n_labelled == (wanted >= 0).sum()
    assert run.n_tracks == wanted.max() + 1
    assert seen == list(range(1, 15))
    assert sorted(p.name for p in tmp_path.iterdir()) == [f"in{ending}", f"out{ending}"]


def test_bytes_are_the_same_for_any_size_of_chunks_tiles_and_threads(tmp_path, scene, monkeypatch):
    source = write_csv(tmp_path / "in.csv", rows_of(scene.detections))
    parquet = write_parquet(tmp_path / "in.parquet", rows_of(scene.detections), row_group_size=7)
    am.large.track(source, tmp_path / "one.csv", model=MODEL)
    am.large.track(parquet, tmp_path / "one.parquet", model=MODEL)
    monkeypatch.setattr(csv_table, "_BYTES", 100)
    am.large.track(source, tmp_path / "two.csv", model=MODEL, tile=0.3, threads=2)
    am.large.track(parquet, tmp_path / "two.parquet", model=MODEL, tile=0.3, threads=2)
    for ending in (".csv", ".parquet"):
        one, two = (tmp_path / f"{name}{ending}" for name in ("one", "two"))
        assert one.read_bytes() == two.read_bytes()


def test_row_groups_are_whole_frames(tmp_path, scene, monkeypatch):
    monkeypatch.setattr(parquet_table, "_ROWS", 100)
    source = write_parquet(tmp_path / "in.parquet", rows_of(scene.detections), row_group_size=33)
    am.large.track(source, tmp_path / "out.parquet", model=MODEL)
    file = pq.ParquetFile(tmp_path / "out.parquet")
    groups = [file.read_row_group(i)["frame"].to_pylist() for i in range(file.num_row_groups)]
    assert len(groups) > 3
    assert all(set(a).isdisjoint(b) for a, b in pairwise(groups))


def test_the_text_of_a_row_stays_as_it_is(tmp_path):
    text = 'note;T;u;v\n+;0.00;1.50;2\n"a; b";0.00;3e0;4.000\n\n"";2;1.5;2\n'
    source = tmp_path / "in.csv"
    source.write_text(text, encoding="utf-8-sig")
    columns = am.large.Columns(time="T", axes=("u", "v"), unit="cm", label="id")
    am.large.track(source, tmp_path / "out.csv", model=MODEL, columns=columns)
    assert (tmp_path / "out.csv").read_text() == (
        'note;T;u;v;id\n+;0.00;1.50;2;-1\n"a; b";0.00;3e0;4.000;-1\n"";2;1.5;2;-1\n'
    )
    frames = list(frames_of(source, open_table(source, columns).chunks()))
    assert [frame.time for frame in frames] == [0.0, 2.0]
    np.testing.assert_array_equal(frames[0].points, [[0.015, 0.02], [0.03, 0.04]])


def test_parquet_keeps_the_other_columns_and_reads_every_number(tmp_path):
    columns = {
        "name": ["a", None, "c"],
        "frame": pa.array([3, 3, 5], pa.int32()),
        "x_mm": pa.array([1, 2, 3], pa.int64()),
        "y_mm": pa.array([1.5, 2.5, 3.5], pa.float32()),
    }
    source = write_parquet(tmp_path / "in.parquet", columns)
    am.large.track(source, tmp_path / "out.parquet", model=MODEL)
    table = pq.read_table(tmp_path / "out.parquet")
    assert table.drop_columns(["track"]).equals(pq.read_table(source))
    assert table["track"].to_pylist() == [-1, -1, -1]
    points = next(open_table(source).chunks()).points
    np.testing.assert_array_equal(points, [[0.001, 0.0015], [0.002, 0.0025], [0.003, 0.0035]])


def test_absent_frame_numbers_are_frames_without_detections(tmp_path, scene):
    d = scene.detections
    frames = [d.frame(t) if t != 8 else np.zeros((0, 3)) for t in range(14)]
    with_gap = am.Detections.from_frames(d.times, frames)
    source = write_csv(tmp_path / "in.csv", rows_of(with_gap))
    run = am.large.track(source, tmp_path / "out.csv", model=MODEL)
    assert run.n_frames == 13
    assert labels_in(tmp_path / "out.csv").tolist() == np.concatenate(labels_of(with_gap)).tolist()


def test_a_very_long_pause_takes_no_time(tmp_path, scene):
    columns = rows_of(scene.detections)
    columns["frame"] = columns["frame"] + 10**12 * (columns["frame"] >= 7)
    source = write_csv(tmp_path / "in.csv", columns)
    assert am.large.track(source, tmp_path / "out.csv", model=MODEL).n_frames == 14


HEAD = "frame,x,y,z\n"
BAD = {
    "": "line 1: expected a header",
    "a,b\n1,2\n": "columns: expected one of frame, frame_index, time, time_s, t, found a, b",
    "frame,a\n1,2\n": "columns: expected coordinates x, y and perhaps z, found frame, a",
    "frame,x,y,x\n1,2,3,4\n": "columns: expected one named x, found two",
    "frame,x,y,track\n1,2,3,4\n": "expected no column track yet, found frame, x, y, track. Give",
    HEAD: "expected rows of detections, found none",
    HEAD + "1,1,1,1\n1,1,,1\n": "line 3, column y: expected a number, found ''",
    HEAD + "1,1,1,1\n1,1,nan,1\n": "line 3, column y: expected a finite number, found nan",
    HEAD + "1,1,1,1\n\n1,1,inf,1\n": "line 4, column y: expected a finite number, found inf",
    HEAD + "1,1,1,1\n1,1,1\n": "line 3: expected 4 columns, found 3",
    HEAD + "1,1,1,1\n1,1,1,1,1\n": "line 3: expected 4 columns, found 5",
    HEAD + '1,1,1,1\n1,1,1,"1\n': "line 3: expected closed quotation marks",
    HEAD + "1,1,1,1\n1,q,1,1\n": "line 3, column x: expected a number, found 'q'. Leave out rows",
    HEAD + "2,1,1,1\n1,1,1,1\n": "line 3: expected a frame or time ≥ 2, found 1. Sort the table",
    HEAD + "1.5,1,1,1\n": "line 2, column frame: expected a whole number, found 1.5",
    "frame,time,x,y\n1,0,1,1\n1,1,1,1\n": "frame 1: expected the time 0 in every row, found 1",
    "frame,time,x,y\n1,0,1,1\n2,0,1,1\n": "frame 2: expected a time after 0 s, found 0 s",
}


@pytest.mark.parametrize("text", BAD)
def test_a_malformed_table_is_one_error_with_its_place(tmp_path, text):
    source = tmp_path / "in.csv"
    source.write_text(text)
    with pytest.raises(am.FormatError) as caught:
        am.large.track(source, tmp_path / "out.csv", model=MODEL)
    assert str(caught.value).startswith(f"{source}: ")
    assert BAD[text] in str(caught.value)
    assert [p.name for p in tmp_path.iterdir()] == ["in.csv"]


def test_unordered_frames_in_another_chunk_are_found(tmp_path, monkeypatch):
    monkeypatch.setattr(csv_table, "_BYTES", 1)
    source = tmp_path / "in.csv"
    source.write_text(HEAD + "1,1,1,1\n5,1,1,1\n3,1,1,1\n")
    with pytest.raises(am.FormatError, match="expected a frame or time ≥ 5, found 3"):
        am.large.track(source, tmp_path / "out.csv", model=MODEL)


def test_text_that_is_not_utf_8_and_files_that_are_not_there(tmp_path):
    source = tmp_path / "in.csv"
    source.write_bytes(HEAD.encode() + b"1,1,1,1\n1,\xff,1,1\n")
    with pytest.raises(am.FormatError, match="expected text in UTF-8"):
        am.large.track(source, tmp_path / "out.csv", model=MODEL)
    for name in ("none.csv", "none.parquet"):
        with pytest.raises(am.FormatError, match="no such file"):
            am.large.track(tmp_path / name, tmp_path / f"out{name[4:]}", model=MODEL)


def test_damaged_parquet(tmp_path, scene):
    whole = write_parquet(tmp_path / "in.parquet", rows_of(scene.detections), row_group_size=200)
    content = bytearray(whole.read_bytes())
    rng = np.random.default_rng(1)
    n_refused, messages = 0, []
    for k in range(60):
        bad = content[: rng.integers(0, len(content))] if k % 2 else bytearray(content)
        if k % 2 == 0:
            for at in rng.integers(0, len(content), 20):
                bad[at] = rng.integers(0, 256)
        whole.write_bytes(bad)
        try:
            am.large.track(whole, tmp_path / "out.parquet", model=MODEL)
            (tmp_path / "out.parquet").unlink()
        except (am.FormatError, am.SolverLimit) as error:
            n_refused += 1
            messages.append(str(error))
        assert [p.name for p in tmp_path.iterdir()] == ["in.parquet"]
    assert n_refused > 30
    assert all(str(whole) in text or "gates" in text for text in messages)


def test_nulls_and_text_in_parquet(tmp_path):
    columns = {"frame": [0, 0], "x": [1.0, None], "y": [1.0, 2.0]}
    source = write_parquet(tmp_path / "in.parquet", columns)
    with pytest.raises(am.FormatError, match="row 2, column x: expected a finite number"):
        am.large.track(source, tmp_path / "out.parquet", model=MODEL)
    source = write_parquet(tmp_path / "in.parquet", columns | {"y": ["a", "b"]})
    with pytest.raises(am.FormatError, match="column y: expected numbers, found string"):
        am.large.track(source, tmp_path / "out.parquet", model=MODEL)


def test_without_pyarrow_the_error_says_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(am.ParameterError, match=r"pip install 'asterism\[parquet\]'"):
        am.large.track(tmp_path / "a.parquet", tmp_path / "b.parquet")


def test_an_interrupt_leaves_nothing(tmp_path, scene):
    source = write_csv(tmp_path / "in.csv", rows_of(scene.detections))

    def stop(n):
        if n == 12:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        am.large.track(source, tmp_path / "out.csv", model=MODEL, progress=stop)
    assert [p.name for p in tmp_path.iterdir()] == ["in.csv"]


def test_a_full_disk_and_a_table_of_another_form(tmp_path, scene):
    source = write_csv(tmp_path / "in.csv", rows_of(scene.detections))
    with pytest.raises(am.FormatError, match="cannot be written"):
        am.large.track(source, tmp_path / "nowhere" / "out.csv", model=MODEL)
    with pytest.raises(am.ParameterError, match=r"expected a name ending in \.csv"):
        am.large.track(source, tmp_path / "out.parquet", model=MODEL)
    with pytest.raises(am.ParameterError, match="a path of its own"):
        am.large.track(source, source, model=MODEL)
    with pytest.raises(am.ParameterError, match="unit"):
        am.large.Columns(unit="furlong")
    with pytest.raises(am.FormatError, match="expected one named when"):
        am.large.track(
            source, tmp_path / "out.csv", model=MODEL, columns=am.large.Columns(time="when")
        )


def test_reading_parquet_does_not_keep_what_was_read(tmp_path):
    rng = np.random.default_rng(0)
    schema = pa.schema([("frame", pa.int64()), ("x", pa.float64()), ("y", pa.float64())])
    with pq.ParquetWriter(tmp_path / "long.parquet", schema) as writer:
        for t in range(40):
            columns = [np.full(20_000, t), rng.random(20_000), rng.random(20_000)]
            writer.write_table(pa.table(columns, schema=schema))
    before = pa.total_allocated_bytes()
    table = open_table(tmp_path / "long.parquet")
    held = [pa.total_allocated_bytes() - before for _ in table.chunks()]
    assert len(held) > 3
    assert max(held) < 0.5 * (tmp_path / "long.parquet").stat().st_size
