"""The scene for Rerun holds the tracks, and no statistics are sent."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import numpy as np
import pytest

import asterism as am
from asterism.cli import main
from asterism.plot import rerun_scene, viewer
from asterism.plot.style import CYCLE


def tracks_of(table, sure=None, names=(), n_axes=3):
    """Tracks from rows of frames: a digit is a track seen, a dot is nothing, a star is clutter."""
    labels, frames, rng = [], [], np.random.default_rng(1)
    for row in table:
        seen = [-1 if c == "*" else int(c) for c in row if c != "."]
        labels += seen
        frames.append(rng.normal(size=(len(seen), n_axes)))
    detections = am.Detections.from_frames(np.arange(len(table)) / 10, frames)
    return am.Tracks(detections=detections, labels=labels, names=names, confidence=sure)


class Recorder:
    """Takes what would be logged: by entity, `{column: rows}`, and what holds for all times."""

    def __init__(self):
        self.columns, self.times, self.static = {}, {}, {}

    def log(self, path, *archetypes, static):
        assert static
        self.static[path.removeprefix("/")] = {
            batch.component_descriptor().component: batch.as_arrow_array().to_pylist()
            for archetype in archetypes
            for batch in archetype.as_component_batches()
        }

    def send_columns(self, path, indexes, columns):
        path = path.removeprefix("/")
        times = {t.timeline_name(): t.as_arrow_array() for t in indexes}
        self.times[path] = {
            "time": times["time"].cast("int64").to_numpy() / 1e9,
            "frame": times["frame"].to_pylist(),
        }
        self.columns[path] = {
            c.component_descriptor().component.split(":")[-1]: c.as_arrow_array().to_pylist()
            for c in columns
        }
        for rows in self.columns[path].values():
            assert len(rows) == len(self.times[path]["frame"])


@pytest.fixture
def rr():
    return pytest.importorskip("rerun", reason="the extra [view] is not installed")


def path_of(rr, parts):
    return rr.new_entity_path(parts).removeprefix("/")


def logged(rr, tracks, rig=None):
    recorder = Recorder()
    rerun_scene._log(rr, recorder, tracks, rig)
    return recorder


def test_a_marker_is_there_when_it_was_seen_and_gone_when_not(rr):
    tracks = tracks_of(["0*", "0", "", "01", "1"], names=("LASI", None))
    found = logged(rr, tracks)
    d = tracks.detections
    place = "world/markers/LASI"
    assert found.times[place]["frame"] == [0, 1, 2, 3, 4]
    np.testing.assert_allclose(found.times[place]["time"], [0, 0.1, 0.2, 0.3, 0.4])
    rows = found.columns[place]["positions"]
    assert [len(row) for row in rows] == [1, 1, 0, 1, 0]
    np.testing.assert_allclose(
        [row[0] for row in rows if row], d.points[tracks.labels == 0], rtol=1e-6
    )
    # Seen until the end: nothing takes it away.
    other = path_of(rr, ["world", "markers", "track 1"])
    assert found.times[other]["frame"] == [3, 4]
    look = {key.split(":")[-1]: value for key, value in found.static[place].items()}
    assert look["labels"] == ["LASI"]
    red, green, blue = bytes.fromhex(CYCLE[0][1:])
    assert look["colors"] == [red << 24 | green << 16 | blue << 8 | 255]


def test_gaps_have_lines_while_they_last(rr):
    tracks = tracks_of(["0", "0", "", "", "0", "", "0"])
    found = logged(rr, tracks)
    place = path_of(rr, ["world", "gaps", "track 0"])
    assert found.times[place]["frame"] == [2, 4, 5, 6]
    strips = found.columns[place]["strips"]
    assert [len(row) for row in strips] == [1, 0, 1, 0]
    points = tracks.detections.points
    np.testing.assert_allclose(strips[0][0], points[[1, 2]], rtol=1e-6)
    np.testing.assert_allclose(strips[2][0], points[[2, 3]], rtol=1e-6)


def test_trails_run_from_frame_to_frame_and_not_over_gaps(rr):
    tracks = tracks_of(["01", "10", "", "0", "0"])
    found = logged(rr, tracks)
    rows = found.columns["world/trails"]["strips"]
    assert [len(row) for row in rows] == [0, 2, 0, 0, 1]
    points = tracks.detections.points
    np.testing.assert_allclose(rows[1], [points[[0, 3]], points[[1, 2]]], rtol=1e-6)
    assert len({*found.columns["world/trails"]["colors"][1]}) == 2


def test_clutter_and_confidence(rr):
    sure = [0.5, 0.25, 1.0, 0.75]
    tracks = tracks_of(["0*", "*", "0"], sure=sure)
    found = logged(rr, tracks)
    assert [len(row) for row in found.columns["world/clutter"]["positions"]] == [1, 1, 0]
    place = path_of(rr, ["confidence", "track 0"])
    assert found.times[place]["frame"] == [0, 2]
    assert found.columns[place]["scalars"] == [[0.5], [0.75]]
    without = logged(rr, tracks_of(["0*", "0"]))
    assert not [path for path in without.columns if path.startswith("confidence")]


def test_cameras_stand_where_they_stand_and_look_where_they_look(rr):
    rig = am.Rig.ring(3, radius=4, height=2)
    found = logged(rr, tracks_of(["0", "0"]), rig)
    assert sum(path.startswith("world/cameras/") for path in found.static) == 3
    camera = {k.split(":")[-1]: v for k, v in found.static["world/cameras/cam2"].items()}
    np.testing.assert_allclose(camera["translation"][0], rig[1].center, rtol=1e-6)
    # Column by column: a point of the camera to the world.
    turned = np.reshape(camera["mat3x3"][0], (3, 3)).T
    np.testing.assert_allclose(turned[:, 2], rig[1].axis, atol=1e-6)
    K = np.reshape(camera["image_from_camera"][0], (3, 3)).T
    np.testing.assert_allclose(K, rig[1].K, rtol=1e-6)
    np.testing.assert_allclose(camera["resolution"][0], rig[1].size_px)


def test_two_dimensions_lie_in_a_plane(rr):
    rows = logged(rr, tracks_of(["0", "0"], n_axes=2)).columns
    (place,) = (path for path in rows if path.startswith("world/markers"))
    assert [row[0][2] for row in rows[place]["positions"]] == [0, 0]


def test_names_of_any_kind_stay_apart(rr):
    d = am.simulate.cube(seed=1).detections
    names = ("a/b", "a", "a", "", None, "ü ö", "$x", "track 4")
    tracks = am.Tracks(detections=d, labels=np.tile(np.arange(8), d.n_frames), names=names)
    found = logged(rr, tracks)
    assert sum(path.startswith("world/markers/") for path in found.columns) == 8


def test_a_saved_scene_can_be_read_and_leaves_no_scraps(rr, tmp_path):
    tracks = tracks_of(["0*", "0", "", "01"], sure=np.ones(5))
    am.plot.view(tracks, rig=am.Rig.ring(2, radius=4, height=2), path=tmp_path / "scene.rrd")
    assert [p.name for p in tmp_path.iterdir()] == ["scene.rrd"]
    command = [sys.executable, "-m", "rerun", "rrd", "verify", str(tmp_path / "scene.rrd")]
    # With separate settings, so that a test changes no user's.
    env = os.environ | {
        "HOME": str(tmp_path),
        "XDG_CONFIG_HOME": str(tmp_path),
        "APPDATA": str(tmp_path),
    }
    subprocess.run(command, check=True, timeout=120, capture_output=True, env=env)


def test_saving_needs_neither_viewer_nor_settings(rr, tmp_path, monkeypatch):
    def refused(*_args, **_kwargs):
        raise AssertionError("no program is started")

    monkeypatch.setattr(subprocess, "run", refused)
    monkeypatch.setattr(subprocess, "Popen", refused)
    am.plot.view(tracks_of(["0", "0"]), path=tmp_path / "scene.rrd")


def test_a_folder_that_is_not_there(rr, tmp_path):
    with pytest.raises(am.FormatError, match="a file that can be written"):
        am.plot.view(tracks_of(["0"]), path=tmp_path / "nowhere" / "scene.rrd")


def test_nothing_is_nothing_to_look_at(rr, tmp_path):
    with pytest.raises(am.ParameterError, match="at least one detection"):
        am.plot.view(tracks_of(["", ""]), path=tmp_path / "scene.rrd")
    am.plot.view(tracks_of(["*", "*"]), path=tmp_path / "scene.rrd")
    am.plot.view(tracks_of(["0"]), path=tmp_path / "one.rrd")


def test_without_rerun_one_line_says_what_to_install(tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "rerun", None)
    tracks = am.simulate.cube(seed=1)
    with pytest.raises(am.ParameterError, match=r"pip install 'asterism\[view\]'"):
        am.plot.view(tracks, path=tmp_path / "scene.rrd")
    am.write(tracks, tmp_path / "in.csv")
    assert main(["view", str(tmp_path / "in.csv"), "--save", str(tmp_path / "s.rrd")]) == 2
    err = capsys.readouterr().err
    assert err.count("\n") == 1
    assert "pip install 'asterism[view]'" in err


def test_the_viewer_is_for_this_machine_and_silent(tmp_path, monkeypatch):
    ran = []

    def run(command, **_):
        ran.append(command[1:])
        return subprocess.CompletedProcess(command, 0, "", "")

    settings = tmp_path / "analytics.json"
    monkeypatch.setattr(subprocess, "run", run)
    monkeypatch.setattr(viewer, "_settings_file", lambda: settings)
    viewer.open_viewer(tmp_path / "scene.rrd")
    show = ["-m", "rerun", str(tmp_path / "scene.rrd"), "--bind", "127.0.0.1", "--port", "auto"]
    assert ran == [["-m", "rerun", "analytics", "disable"], show]
    # Settings that are there are changed in their one entry, and no command counts itself.
    ran.clear()
    kept = {"analytics_id": "abc", "metadata": {"a": [1]}, "data_dir_path": "x"}
    settings.write_text(json.dumps({"analytics_enabled": True} | kept))
    viewer.open_viewer(tmp_path / "scene.rrd")
    assert ran == [show]
    assert json.loads(settings.read_text()) == {"analytics_enabled": False} | kept
    before = settings.stat().st_mtime_ns
    viewer.open_viewer(tmp_path / "scene.rrd")
    assert settings.stat().st_mtime_ns == before
    settings.write_text("{broken")
    ran.clear()
    viewer.open_viewer(tmp_path / "scene.rrd")
    assert ran[0] == ["-m", "rerun", "analytics", "disable"]


def test_a_viewer_that_does_not_open_says_so(tmp_path, monkeypatch):
    def run(command, **_):
        return subprocess.CompletedProcess(command, 1, "", "log\nError: no DISPLAY\n")

    monkeypatch.setattr(subprocess, "run", run)
    settings = tmp_path / "analytics.json"
    settings.write_text('{"analytics_enabled": false}')
    monkeypatch.setattr(viewer, "_settings_file", lambda: settings)
    with pytest.raises(am.FormatError, match=r"Error: no DISPLAY. Without a screen, save"):
        viewer.open_viewer(tmp_path / "scene.rrd")


def test_the_viewer_gets_the_scene(rr, monkeypatch):
    sizes = []
    monkeypatch.setattr(viewer, "open_viewer", lambda path: sizes.append(path.stat().st_size))
    am.plot.view(tracks_of(["0", "0"]))
    assert sizes
    assert sizes[0] > 1000


def test_the_command_saves_with_a_rig(rr, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    am.write(am.simulate.cube(seed=1), "in.csv")
    assert main(["view", "in.csv", "--rig", "ring4", "--save", "scene.rrd"]) == 0
    assert "written  scene.rrd" in capsys.readouterr().out
    assert (tmp_path / "scene.rrd").stat().st_size > 1000


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ("--save scene.txt", "a name ending in .rrd"),
        ("--rig no.xcp --save s.rrd", "ring8"),
    ],
)
def test_what_view_refuses(tmp_path, monkeypatch, capsys, options, message):
    monkeypatch.chdir(tmp_path)
    am.write(am.simulate.cube(seed=1), "in.csv")
    assert main(f"view in.csv {options}".split()) == 2
    err = capsys.readouterr().err
    assert message in err
    assert "Traceback" not in err
