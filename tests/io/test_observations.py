"""Image points are read as written, to the last bit; an error names the damaged line."""

from __future__ import annotations

import csv
import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import asterism as am
from asterism.io.observations import read_observations, write_observations

HEADER = "frame,time,camera,u,v,marker\n"


def assert_same(a, b):
    np.testing.assert_array_equal(a.times.view(np.uint64), b.times.view(np.uint64))
    assert a.cameras == b.cameras
    np.testing.assert_array_equal(a.offsets, b.offsets)
    np.testing.assert_array_equal(a.pixels.view(np.uint64), b.pixels.view(np.uint64))
    assert (a.markers is None) == (b.markers is None)
    if a.markers is not None:
        np.testing.assert_array_equal(a.markers, b.markers)
        assert a.marker_names == b.marker_names


NAMES = st.text(
    st.characters(exclude_characters="\r\n", exclude_categories=("Cs",)), min_size=1, max_size=5
)
FLOATS = st.floats(-1e300, 1e300)


@st.composite
def observations(draw):
    cameras = draw(st.lists(NAMES, min_size=1, max_size=4, unique=True))
    times = sorted(draw(st.lists(FLOATS, max_size=6, unique_by=lambda t: t + 0.0)))
    counts = [draw(st.integers(0, 3)) for _ in range(len(times) * len(cameras))]
    n = sum(counts)
    pixels = draw(st.lists(st.tuples(FLOATS, FLOATS), min_size=n, max_size=n))
    names = draw(st.lists(NAMES, max_size=4, unique=True))
    most = len(names) - 1 if names else 10**6
    markers = draw(st.none() | st.lists(st.integers(-1, most), min_size=n, max_size=n))
    return am.Observations(
        times=times,
        cameras=cameras,
        offsets=np.concatenate([[0], np.cumsum(counts)]).astype(int),
        pixels=np.array(pixels, dtype=float).reshape(n, 2),
        markers=markers,
        marker_names=names,
    )


@settings(deadline=None)
@given(made=observations(), first=st.integers(-5, 10**6))
def test_all_comes_back_bit_for_bit(tmp_path_factory, made, first):
    path = tmp_path_factory.mktemp("round") / "o.csv"
    write_observations(made, path, first_frame=first)
    assert_same(read_observations(path), made)


def test_empty_frames_blind_cameras_and_unseen_markers_survive(tmp_path):
    made = am.Observations(
        times=[0.0, 0.1, 0.3, 0.5],
        cameras=("right", "blind", "left"),
        offsets=[0, 0, 0, 0, 2, 2, 3, 3, 3, 3, 3, 3, 3],
        pixels=[[1, 2], [3, 4], [5, 6]],
        markers=[2, -1, 2],
        marker_names=("never", "nor, this", "seen"),
    )
    write_observations(made, tmp_path / "o.csv", first_frame=7)
    assert_same(read_observations(tmp_path / "o.csv"), made)
    assert (tmp_path / "o.csv").read_text().splitlines() == [
        "frame,time,camera,u,v,marker",
        ",,right,,,",
        ",,blind,,,",
        ",,left,,,",
        ",,,,,never",
        ',,,,,"nor, this"',
        ",,,,,seen",
        "7,0.0,,,,",
        "8,0.1,right,1.0,2.0,seen",
        "8,0.1,right,3.0,4.0,",
        "8,0.1,left,5.0,6.0,seen",
        "9,0.3,,,,",
        "10,0.5,,,,",
    ]


def test_a_film_comes_back(tmp_path):
    scene = am.simulate.crossing(seed=1, rate=100)
    rig = am.Rig.ring(4, radius=3, height=1, target=(0, 0, 0), focal_px=3000)
    seen = am.simulate.film(scene, rig).observations
    assert 0 < seen.n_points < 4 * scene.detections.n_points
    write_observations(seen, tmp_path / "o.csv")
    assert_same(read_observations(tmp_path / "o.csv"), seen)


def test_any_reader_of_csv_can_read_it(tmp_path):
    made = am.Observations(
        times=[0.5], cameras=('a "b", c',), offsets=[0, 1], pixels=[[1.25, 2]], markers=[0],
        marker_names=("M,1",),
    )  # fmt: skip
    write_observations(made, tmp_path / "o.csv")
    with (tmp_path / "o.csv").open(newline="") as file:
        *_, row = csv.DictReader(file)
    assert row == {
        "frame": "1", "time": "0.5", "camera": 'a "b", c', "u": "1.25", "v": "2.0", "marker": "M,1"
    }  # fmt: skip


def read_text(tmp_path, text):
    (tmp_path / "o.csv").write_text(text)
    return read_observations(tmp_path / "o.csv")


def test_what_others_write_is_read_too(tmp_path):
    """Columns in another order, nothing declared, rows not sorted, blanks at the end."""
    text = "v,u,camera,time,frame\n4,3,b,0.1,11\n2,1,a,0.0,10\n6,5,b,0.1,11\n\n\n"
    made = read_text(tmp_path, text)
    assert made.cameras == ("b", "a")
    assert made.times.tolist() == [0.0, 0.1]
    assert made.points(1, 0).tolist() == [[3, 4], [5, 6]]
    assert made.points(0, 1).tolist() == [[1, 2]]
    assert made.markers is None


@pytest.mark.parametrize(
    ("texts", "markers", "names"),
    [
        (("7", "", "0"), [7, -1, 0], ()),
        (("B", "", "A"), [0, -1, 1], ("B", "A")),
        (("7", "", "A"), [0, -1, 1], ("7", "A")),
        (("07", "", "1"), [0, -1, 1], ("07", "1")),
        (("", "", ""), [-1, -1, -1], ()),
    ],
)
def test_markers_without_declaration(tmp_path, texts, markers, names):
    made = read_text(tmp_path, HEADER + "".join(f"1,0,a,1,2,{text}\n" for text in texts))
    assert made.markers.tolist() == markers
    assert made.marker_names == names


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "line 1: expected the columns frame, time, camera, u, v, marker"),
        ("frame,time,camera,u\n", "line 1: expected the columns"),
        ("frame,time,camera,u,v,v\n", "line 1: expected the columns"),
        ("frame,time,camera,u,v,w\n", "line 1: expected the columns"),
        (HEADER, "cameras: expected different names, at least one"),
        (HEADER + "1,0,a,1,2,\n1,0,a,1\n", "line 3: expected 6 columns, found 4"),
        (HEADER + "1,0,a,1,2,\n1,0,a,1,x,\n", "line 3, column v: expected a finite number"),
        (HEADER + "1,0,a,1,inf,\n", "line 2, column v: expected a finite number"),
        (HEADER + "1,0,a,1,,\n", "line 2: expected frame, time, camera, u and v"),
        (HEADER + "1,0,,1,2,\n", "line 2: expected frame, time, camera, u and v"),
        (HEADER + "1,,a,1,2,\n", "line 2: expected frame, time, camera, u and v"),
        (HEADER + ",,a,1,2,\n", "line 2: expected frame, time, camera, u and v"),
        (HEADER + ",,a,,,M\n", "line 2: expected frame, time, camera, u and v"),
        (HEADER + "1,0,a,,,M\n", "line 2: expected frame, time, camera, u and v"),
        (HEADER + "1.5,0,a,1,2,\n", "line 2, column frame: expected a whole number, found 1.5"),
        (HEADER + "1,0,a,1,2,\n1,1,a,1,2,\n", "line 3: expected the time of the other rows"),
        (HEADER + "2,0,a,1,2,\n1,1,a,1,2,\n", "line 2: expected a time after 1 s, found 0 s"),
        (HEADER + ",,a,,,\n1,0,b,1,2,\n", "line 3: expected a declared camera, found 'b'"),
        (HEADER + ",,,,,A\n1,0,b,1,2,B\n", "line 3: expected a declared marker, found 'B'"),
        (HEADER + ",,a,,,\n,,b,,,\n,,b,,,\n", "line 4: expected each camera declared once"),
        (HEADER + ',,"a,,,\n', "line 2: expected CSV"),
    ],
)
def test_damage_is_told_by_its_line(tmp_path, text, message):
    with pytest.raises(am.FormatError) as error:
        read_text(tmp_path, text)
    assert message in str(error.value)
    assert "o.csv" in str(error.value)


@pytest.mark.parametrize("where", ["none.csv", "."])
def test_a_file_that_cannot_be_read(tmp_path, where):
    with pytest.raises(am.FormatError, match=r"no such file|found a folder"):
        read_observations(tmp_path / where)


@pytest.mark.parametrize("name", ["", "a\nb", "a\rb", "\ud800"])
def test_names_that_a_file_cannot_hold_are_refused(tmp_path, name):
    made = {"times": [0.0], "offsets": [0, 1], "pixels": [[1, 2]], "markers": [0]}
    for names in (
        {"cameras": (name,), "marker_names": ("M",)},
        {"cameras": ("a",), "marker_names": (name,)},
        {"cameras": ("a",), "marker_names": ("M", "M")},
    ):
        with pytest.raises(am.ParameterError, match="names"):
            write_observations(am.Observations(**made, **names), tmp_path / "o.csv")
    assert not list(tmp_path.iterdir())


def test_a_file_that_is_there_is_replaced_as_a_whole_or_not_at_all(tmp_path, monkeypatch):
    path = tmp_path / "o.csv"
    path.write_text("before")
    made = am.Observations(times=[0.0], cameras=("a",), offsets=[0, 1], pixels=[[1, 2]])
    with monkeypatch.context() as broken:
        broken.setattr("asterism.io.observations.quoted", lambda _: 1 / 0)
        with pytest.raises(ZeroDivisionError):
            write_observations(made, path)
    assert path.read_text() == "before"
    write_observations(made, path)
    assert_same(read_observations(path), made)
    assert [p.name for p in tmp_path.iterdir()] == ["o.csv"]


def test_a_hundred_thousand_points_take_less_than_a_moment(tmp_path):
    n_frames, n_cameras, n = 200, 10, 50
    made = am.Observations(
        times=np.arange(n_frames) / 300,
        cameras=[f"cam{i}" for i in range(n_cameras)],
        offsets=np.arange(n_frames * n_cameras + 1) * n,
        pixels=np.random.default_rng(1).uniform(0, 1000, (n_frames * n_cameras * n, 2)),
        markers=np.tile(np.arange(n), n_frames * n_cameras),
    )
    start = time.process_time()
    write_observations(made, tmp_path / "o.csv")
    assert_same(read_observations(tmp_path / "o.csv"), made)
    assert time.process_time() - start < 3  # a tenth of it on a quiet machine
