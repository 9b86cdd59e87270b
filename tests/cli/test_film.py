"""``asterism film``: what goes into the folder is what the cameras see."""

from __future__ import annotations

import json
import shlex
from pathlib import Path

import numpy as np
import pytest
from matplotlib.collections import PathCollection
from matplotlib.figure import Figure

import asterism as am
from asterism.cli import main
from asterism.cli.film_pictures import contact_sheet, coverage_picture, rig_picture
from asterism.cli.filming import film_all, frames_between, names_apart
from asterism.io.calibrations import read_rig, write_rig
from asterism.io.observations import read_observations
from asterism.simulate.rig_presets import is_preset, place_preset
from tests.cli.runs import refused, run
from tests.paths import DATA


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def plain_pictures(monkeypatch):
    """Empty figures, for tests of what else is in the folder."""
    for name in ("contact_sheet", "rig_picture", "coverage_picture"):
        monkeypatch.setattr(f"asterism.cli.film_pictures.{name}", lambda *_: Figure())


@pytest.fixture(scope="module")
def gappy():
    """A scene with gaps, clutter, an empty frame, a nameless track, and some that come late."""
    scene = am.simulate.crossing(seed=3, rate=100)
    corrupted = am.simulate.corrupt(scene, missing=0.2, clutter=0.2, seed=4)
    d = corrupted.detections
    is_late = (corrupted.labels % 2 == 0) & (corrupted.labels >= 0)
    is_kept = (d.frame_of != 30) & ~(is_late & (d.frame_of < 10))
    counts = np.bincount(d.frame_of[is_kept], minlength=d.n_frames)
    return am.Tracks(
        detections=am.Detections(
            times=d.times, offsets=np.append(0, np.cumsum(counts)), points=d.points[is_kept]
        ),
        labels=corrupted.labels[is_kept],
        names=(None, *corrupted.names[1:]),
    )


NARROW = am.Rig.ring(4, radius=2, height=1, target=(0.3, 0, 0), focal_px=4000)


def test_piece_by_piece_is_the_same_as_at_once(gappy, monkeypatch):
    monkeypatch.setattr("asterism.cli.filming._MAX_FRAMES", 7)
    done = []
    footage = film_all(gappy, NARROW, done.append)
    whole = am.simulate.film(gappy, NARROW)
    seen, expected = footage.observations, whole.observations
    assert seen.times.tolist() == expected.times.tolist()
    assert seen.cameras == expected.cameras
    for name in ("offsets", "pixels", "markers"):
        np.testing.assert_array_equal(getattr(seen, name), getattr(expected, name))
    assert seen.marker_names == ("T000", *gappy.names[1:])
    assert done == [7, 14, 21, 28, 35, 42, 49, 56, 60]


def test_the_counts_are_those_of_the_samples(gappy):
    footage = film_all(gappy, NARROW, lambda _: None)
    projection = am.simulate.film(gappy, NARROW).projection
    is_there = projection.reason[0] != am.camera.Reason.ABSENT
    assert footage.n_samples == is_there.sum() == (gappy.labels >= 0).sum()
    for c in range(4):
        counts = np.bincount(projection.reason[c][is_there], minlength=8)
        np.testing.assert_array_equal(footage.counts[c], counts)
    assert footage.counts[:, am.camera.Reason.OUTSIDE].all()
    assert (footage.counts.sum(axis=1) == footage.n_samples).all()
    by_two = (projection.visible.sum(axis=0)[is_there] >= 2).mean()
    assert 0 < by_two < 1
    assert footage.share_seen_by(2) == pytest.approx(by_two)
    assert footage.share_seen_by(0) == 1


def test_every_track_has_a_name_of_its_own():
    names = ("A", None, "A", "", "T001", "A (2)", "B\tC", None)
    apart = names_apart(names)
    assert len(set(apart)) == len(names)
    assert apart[0] == "A"
    assert apart[4] == "T001"
    assert apart[5] == "A (2)"
    assert apart[6] == "B C"
    assert apart[7] == "T007"
    assert names_apart(()) == ()


@pytest.mark.parametrize(
    ("n_frames", "n", "expected"),
    [(100, 4, [0, 33, 66, 99]), (3, 10, [0, 1, 2]), (9, 1, [4]), (5, 0, []), (0, 4, [])],
)
def test_frames_are_spread_evenly(n_frames, n, expected):
    assert frames_between(n_frames, n) == expected


@pytest.mark.parametrize("text", ["ring1", "ring8", "wall1", "wall4", "wall9"])
@pytest.mark.parametrize("scale", [1e-3, 1.0, 50.0])
def test_a_preset_sees_every_corner_of_the_box(text, scale):
    low, high = scale * np.array([[-1.0, 2.0, 0.1], [3.0, 2.5, 1.9]])
    rig, about = place_preset(text, low, high)
    corners = np.stack(np.meshgrid(*zip(low, high, strict=True)), axis=-1).reshape(-1, 3)
    assert rig.project(corners).visible.all()
    assert len(rig) == int(text[4:])
    assert about.startswith(f"{len(rig)} cameras ")


def test_a_preset_is_what_is_said_of_it():
    rig, about = place_preset("ring6", np.array([0.0, 0, 0]), np.array([2.0, 1, 2]))
    words = about.split()
    radius, height = (float(words[words.index(w) + 1]) for w in ("radius", "="))
    centers = np.stack([camera.center for camera in rig])
    np.testing.assert_allclose(np.linalg.norm(centers[:, :2] - [1, 0.5], axis=1), radius)
    np.testing.assert_allclose(centers[:, 2], height)
    assert "looking at (1.00, 0.50, 1.00)" in about
    assert [is_preset(t) for t in ("ring8", "wall12", "ring", "ring8.toml", "Ring8")] == [
        True, True, False, False, False,
    ]  # fmt: skip


def test_the_folder_holds_the_film(here, capsys):
    out = run("film crossing --rig ring4 -o out --rate 100 --seed 3 --pictures 2", capsys)
    files = sorted(str(p.relative_to("out")) for p in Path("out").rglob("*") if p.is_file())
    assert files == [
        "coverage.png", "film.json", "observations.csv",
        "pictures/frame_000001.png", "pictures/frame_000060.png", "rig.png", "rig.toml",
    ]  # fmt: skip
    assert all(Path("out", f).read_bytes()[:4] == b"\x89PNG" for f in files if f.endswith("png"))
    scene = am.simulate.crossing(seed=3, rate=100)
    rig = read_rig("out/rig.toml")
    again = am.simulate.film(scene, rig).observations
    seen = read_observations("out/observations.csv")
    for name in ("times", "offsets", "pixels", "markers"):
        np.testing.assert_array_equal(getattr(seen, name), getattr(again, name))
    assert (seen.cameras, seen.marker_names) == (rig.names, scene.names)
    assert "100.0 %" in out
    assert "cam3" in out
    assert "ring of radius" in out


@pytest.mark.usefixtures("plain_pictures")
def test_the_summary_says_what_was_seen(here, capsys):
    write_rig(NARROW, "narrow.toml")
    printed = json.loads(run("film crossing --rig narrow.toml -o out --pictures 0 --json", capsys))
    summary = json.loads(Path("out/film.json").read_text())
    assert printed == {"folder": "out", **summary}
    projection = am.simulate.film(am.simulate.crossing(), NARROW).projection
    for c, name in enumerate(NARROW.names):
        counts = projection[c].counts()
        del counts[am.camera.Reason.ABSENT]
        assert summary["cameras"][name] == {r.name.lower(): n for r, n in counts.items()}
    by_two = 100 * (projection.visible.sum(axis=0) >= 2).mean()
    assert summary["seen_by_two_percent"] == pytest.approx(by_two)
    assert 5 < by_two < 95
    assert summary["n_image_points"] == projection.visible.sum()
    assert summary["versions"]["asterism"] == am.__version__
    assert summary["pictures"] == []
    assert not Path("out/pictures").exists()
    # The command makes the same file again.
    before = Path("out/observations.csv").read_bytes()
    command = shlex.split(summary["command"])
    assert command[0] == "asterism"
    assert main([*command[1:], "--overwrite", "-q"]) == 0
    assert Path("out/observations.csv").read_bytes() == before


@pytest.mark.usefixtures("plain_pictures")
def test_a_capture_is_filmed_with_its_own_frame_numbers_and_names(here, gappy, capsys):
    am.write(gappy, "in.csv")
    text = Path("in.csv").read_text().splitlines()
    moved = [text[0]]
    for line in text[1:]:
        frame, _, rest = line.partition(",")
        moved.append(f"{int(frame) + 99},{rest}" if frame else line)
    Path("in.csv").write_text("\n".join(moved))
    assert main(shlex.split("film in.csv --rig ring3 -o out --pictures 1")) == 0
    out, err = capsys.readouterr()
    assert "16 tracks, 15 of them named, 60 frames" in out
    n_clutter = (gappy.labels < 0).sum()
    assert f"{n_clutter} points without a track are not filmed" in err
    assert [p.name for p in Path("out/pictures").iterdir()] == ["frame_000130.png"]
    seen = read_observations("out/observations.csv")
    assert seen.n_frames == 60
    assert seen.counts[30].sum() == 0
    assert "\n130,0.3,,,,\n" in Path("out/observations.csv").read_text()
    assert seen.marker_names == ("T000", *gappy.names[1:])
    assert seen.n_points == 3 * (gappy.labels >= 0).sum()


@pytest.mark.usefixtures("plain_pictures")
def test_cameras_of_another_world_are_told_of(here, capsys):
    am.write(am.simulate.cube(frames=5), "in.csv")
    write_rig(am.Rig.ring(3, radius=2, height=1, target=(900.0, 0, 0), far=50.0), "far.toml")
    assert main(shlex.split("film in.csv --rig far.toml -o out --pictures 0 -q")) == 0
    out, err = capsys.readouterr()
    assert out == ""
    assert "only 0 % of the points are seen by a camera" in err
    assert "units and axes" in err


def test_nothing_is_said_when_all_is_well(here, capsys):
    assert main(shlex.split("film cube --rig ring3 -o out --frames 5 --pictures 1 -q")) == 0
    assert capsys.readouterr() == ("", "")


def test_what_cannot_be_filmed_is_refused(here, capsys):
    scene = am.simulate.cube(frames=5)
    clutter = am.Tracks(detections=scene.detections, labels=np.full(40, -1))
    flat = am.Tracks.from_dense(scene.detections.times, scene.positions()[:, :, :2])
    for name, tracks in (("in", scene), ("clutter", clutter), ("flat", flat)):
        am.write(tracks, f"{name}.csv")
    assert "points in tracks" in refused("film clutter.csv --rig ring3 -o out", capsys)
    assert "points in 3-D" in refused("film flat.csv --rig ring3 -o out", capsys)
    err = refused("film none.c3d --rig ring3 -o out", capsys)
    assert "none.c3d" in err
    assert "crossing" in err
    assert "'ring'" in refused("film in.csv --rig ring -o out", capsys)
    assert "cameras" in refused("film in.csv --rig ring0 -o out", capsys)
    assert "1000" in refused("film in.csv --rig ring99999 -o out", capsys)
    assert "a calibration" in refused("film in.csv --rig none.xcp -o out", capsys)
    assert "--seed" in refused("film in.csv --rig ring3 -o out --seed 1", capsys)
    assert "--pictures" in refused("film in.csv --rig ring3 -o out --pictures -1", capsys)
    Path("bad.toml").write_text("nonsense")
    assert "bad.toml" in refused("film in.csv --rig bad.toml -o out", capsys)
    assert not Path("out").exists()


def test_a_folder_with_files_and_the_input_are_safe(here, capsys):
    am.write(am.simulate.cube(frames=5), "in.csv")
    run("film in.csv --rig ring3 -o out --pictures 0 -q", capsys)
    before = {p: p.read_bytes() for p in Path("out").iterdir()}
    assert "--overwrite" in refused("film in.csv --rig ring3 -o out", capsys)
    for line in (
        "film in.csv --rig out/rig.toml -o out --overwrite",
        "film out/observations.csv --rig ring3 -o out --overwrite",
    ):
        refused(line, capsys)
    assert before == {p: p.read_bytes() for p in Path("out").iterdir()}
    run("film in.csv --rig ring3 -o out --pictures 0 -q --overwrite", capsys)
    assert before == {p: p.read_bytes() for p in Path("out").iterdir()}  # same input, same bytes
    Path("film.txt").write_text("a file")
    assert "a folder" in refused("film in.csv --rig ring3 -o film.txt", capsys)


def test_every_camera_has_its_tile_and_every_marker_its_colour(gappy):
    figure = contact_sheet(gappy, NARROW, 12, "twelve")
    axes = figure.axes
    assert [a.get_title(loc="left").split(":")[0] for a in axes] == list(NARROW.names)
    expected = NARROW.project(gappy.positions()[12])
    colours = {}
    for c, tile in enumerate(axes):
        seen = next(k for k in tile.collections if isinstance(k, PathCollection))
        is_seen = expected.visible[c]
        np.testing.assert_array_equal(seen.get_offsets(), expected.pixels[c][is_seen])
        drawn = dict(zip(np.flatnonzero(is_seen), map(tuple, seen.get_facecolors()), strict=True))
        assert all(colours.setdefault(k, colour) == colour for k, colour in drawn.items())
    assert len(colours) > 5


def test_the_rig_is_drawn_with_the_paths_of_a_long_capture():
    scene = am.simulate.cube(frames=1000).select(range(7))  # more would be coloured by time
    axes = rig_picture(scene, NARROW).axes[0]
    assert axes.get_title(loc="left") == "4 cameras, 7 tracks"
    path = next(line for line in axes.lines if len(line.get_data_3d()[0]) > 50)
    drawn = np.stack(path.get_data_3d(), axis=1)
    np.testing.assert_array_equal(drawn, scene.positions()[::3, 0])


@pytest.mark.parametrize("scale", [0.0, 1.0])
def test_the_coverage_is_that_of_the_level_of_the_markers(scale):
    points = scale * np.random.default_rng(1).normal(size=(3, 5, 3)) + [0, 0, 0.4]
    truth = am.Tracks.from_dense(np.arange(3), points)
    rig = am.Rig.ring(5, radius=2, height=1, target=(0, 0, 0.4))
    count, error, *_ = coverage_picture(truth, rig).axes
    height = (points[..., 2].min() + points[..., 2].max()) / 2
    assert count.get_title(loc="left").startswith(f"z = {height:.3g} m")
    assert "median error" in error.get_title(loc="left")
    assert {t.get_text() for t in count.texts} == set(rig.names)
    (box,) = (p for p in count.patches if p.get_label() == "markers")
    np.testing.assert_allclose(box.get_xy(), points.min(axis=(0, 1))[:2])


@pytest.mark.data
@pytest.mark.skipif(not DATA.is_dir(), reason=f"no real captures at {DATA}")
@pytest.mark.usefixtures("plain_pictures")
def test_a_real_walk_through_its_own_cameras(here, capsys):
    (source,) = DATA.rglob("walking_1.c3d")
    rig = source.with_suffix(".xcp")
    line = shlex.join(["film", str(source), "--rig", str(rig)])
    summary = json.loads(run(f"{line} -o out --pictures 1 --json", capsys))
    assert len(summary["cameras"]) == 12
    assert summary["n_tracks"] == summary["n_named"] == 34
    assert summary["seen_by_two_percent"] == 100
    assert 0.9 < summary["n_image_points"] / (12 * summary["n_samples"]) < 1
    assert read_observations("out/observations.csv").n_points == summary["n_image_points"]
