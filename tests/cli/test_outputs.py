"""Where commands may write: each output of each command, checked before any work."""

from __future__ import annotations

import importlib
import os
import shutil
from pathlib import Path

import numpy as np
import pytest

import asterism as am
from asterism.cli import main
from asterism.cli.program import command as program

# Each file that a command can write, by a line with the file as OUT; in brackets its ending.
FILES = {
    "track -o": ("track in.csv -o OUT", ".csv"),
    "track --report": ("track in.csv -o new.csv --report OUT", ".html"),
    "track --run -o": ("track in.csv --run new -o OUT", ".csv"),
    "large": ("large plain.csv -o OUT", ".csv"),
    "live --to": ("live in.csv?speed=max --to OUT", ".csv"),
    "live --to a C3D": ("live in.csv?speed=max --to OUT", ".c3d"),
    "edit": ("edit in.csv --script edits.toml -o OUT", ".csv"),
    "stitch": ("stitch truth.csv -o OUT", ".csv"),
    "fill": ("fill truth.csv -o OUT", ".csv"),
    "markerset learn": ("markerset learn truth.csv -o OUT", ".toml"),
    "markerset merge": ("markerset merge set.toml other.toml -o OUT", ".toml"),
    "name": ("name truth.csv --markers set.toml -o OUT", ".csv"),
    "estimate": ("estimate in.csv -o OUT", ".toml"),
    "evaluate": ("evaluate in.csv truth.csv --by-frame OUT", ".csv"),
    "report": ("report truth.csv -o OUT", ".html"),
    "plot": ("plot presence truth.csv -o OUT", ".svg"),
    "view": ("view truth.csv --save OUT", ".rrd"),
    "corrupt --out": ("corrupt truth.csv -o OUT --truth new.csv", ".csv"),
    "corrupt --truth": ("corrupt truth.csv -o new.csv --truth OUT", ".csv"),
    "simulate --out": ("simulate cube -o OUT", ".csv"),
    "simulate --truth": ("simulate cube -o new.csv --truth OUT", ".csv"),
    "serve --truth": ("serve --scene cube --truth OUT", ".csv"),
    "reconstruct -o": ("reconstruct seen.csv --rig rig.toml -o OUT", ".csv"),
    "reconstruct --truth": ("reconstruct seen.csv --rig rig.toml -o new.csv --truth OUT", ".csv"),
    "camera convert": ("camera convert rig.toml OUT", ".toml"),
    "camera map": ("camera map rig.toml -o OUT", ".png"),
}
FOLDERS = {
    "batch": "batch in.csv -o OUT",
    "sweep": "sweep study.toml -o OUT",
    "track": "track in.csv --run OUT",
    "film": "film truth.csv --rig ring4 -o OUT",
    "film a scene": "film cube --rig ring4 -o OUT",
    "chain": "chain cube --rig ring4 -o OUT",
    "demo": "demo -o OUT",
    "reproduce": "reproduce --only marriage -o OUT",
    "camera convert": "camera convert rig.toml OUT --format flydra",
}
# Files that are written where none is named.
DEFAULTS = {
    "track in.csv": "in.tracked.csv",
    "edit in.csv --script edits.toml": "in.corrected.csv",
    "report truth.csv": "truth.html",
    "plot presence truth.csv": "truth.presence.pdf",
}
WORK = {
    "asterism.batch": ("run", "plan_batch"),
    "asterism.sweep": ("run", "read_study"),
    "asterism": ("read", "read_rig", "track", "estimate_model"),
    "asterism.io": ("read_tracks", "read_observations"),
    "asterism.tracking": ("plan_tracking",),
    "asterism.large": ("track",),
    "asterism.live": ("run",),
    "asterism.cli.outputs": ("read_labels", "read_model"),
    "asterism.cli.recording": ("made_scene", "rig_from"),
    "asterism.cli.plot_inputs": ("tracks_of", "summary_of"),
    "asterism.cli.plot_kinds": ("tracks_of", "summary_of"),
    "asterism.cli.commands.camera": ("read_calibration",),
    "asterism.cli.commands.camera_map": ("read_calibration",),
    "asterism.cli.commands.demo": ("_experiment",),
    "asterism.reproduction": ("load",),
    "asterism.io.calibrations.files": ("read_rig",),
    "asterism.model.marker_set_file": ("read_toml",),
}


@pytest.fixture(scope="module")
def inputs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("inputs")
    truth = am.simulate.cube(seed=1, frames=20)
    sensed = am.simulate.corrupt(truth, noise=1e-3, seed=1)
    am.write(sensed, folder / "truth.csv")
    rows = [f"{t},{x},{y},{z}" for t, p in sensed.detections for x, y, z in p.tolist()]
    (folder / "plain.csv").write_text("\n".join(["time,x,y,z", *rows]))
    clutter = [-1] * sensed.detections.n_points
    am.write(am.Tracks(detections=sensed.detections, labels=clutter), folder / "in.csv")
    rig = am.Rig.ring(4, radius=5, height=2)
    am.io.write_rig(rig, folder / "rig.toml")
    am.io.write_observations(am.simulate.film(truth, rig).observations, folder / "seen.csv")
    am.learn_marker_set(truth).to_toml(folder / "set.toml")
    am.learn_marker_set(sensed).to_toml(folder / "other.toml")
    own = np.flatnonzero(sensed.labels == 0)
    at = [
        (int(sensed.detections.frame_of[i]), int(i - sensed.detections.offsets[t]))
        for t, i in zip(sensed.detections.frame_of[own[[0, 9]]], own[[0, 9]], strict=True)
    ]
    edits = [am.model.Edit(kind="same", at=at)]
    (folder / "study.toml").write_text("")
    am.io.write_edits(folder / "edits.toml", edits, am.read(folder / "in.csv"))
    return folder


@pytest.fixture
def here(inputs, tmp_path, monkeypatch):
    shutil.copytree(inputs, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def idle(monkeypatch):
    """Let everything that reads or computes fail the test."""

    def never(*_, **__):
        raise AssertionError("work was done before the outputs were checked")

    for module, names in WORK.items():
        for name in names:
            monkeypatch.setattr(importlib.import_module(module), name, never)


def refused(line, capsys):
    """Run a command that must refuse; give its one line."""
    before = {p: p.read_bytes() if p.is_file() else None for p in Path().rglob("*")}
    assert main(line.split()) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("\n") == 1
    assert {p: p.read_bytes() if p.is_file() else None for p in Path().rglob("*")} == before
    return err


@pytest.mark.parametrize("name", FILES)
def test_a_file_that_exists_needs_overwrite(here, idle, capsys, name):
    line, ending = FILES[name]
    Path(f"old{ending}").write_text("precious")
    err = refused(line.replace("OUT", f"old{ending}"), capsys)
    assert f"old{ending}, which exists. Give --overwrite" in err


@pytest.mark.parametrize("name", FILES)
@pytest.mark.parametrize(
    ("out", "says"),
    [
        ("nowhere/new", "a file in a folder that exists, found nowhere/new"),
        ("folder", "expected a file, found the folder folder"),
    ],
)
def test_a_file_has_its_place(here, idle, capsys, name, out, says):
    line, ending = FILES[name]
    Path(f"folder{ending}").mkdir()
    assert says in refused(line.replace("OUT", out + ending), capsys)


@pytest.mark.parametrize("name", [*FILES, *FOLDERS])
def test_permission_is_looked_at_first(here, idle, capsys, monkeypatch, name):
    line, ending = FILES[name] if name in FILES else (FOLDERS[name], "")
    Path("locked").mkdir()
    allowed = os.access
    monkeypatch.setattr(
        os, "access",
        lambda path, mode: Path(path).name != "locked" and allowed(path, mode),
    )  # fmt: skip
    err = refused(line.replace("OUT", f"locked/new{ending}"), capsys)
    assert "without permission to write in" in err


@pytest.mark.parametrize("name", [n for n in FILES if n not in ("evaluate", "camera convert")])
def test_an_unknown_ending_is_refused_first(here, idle, capsys, name):
    line, _ = FILES[name]
    assert "expected a name ending in" in refused(line.replace("OUT", "new.zip"), capsys)


@pytest.mark.parametrize("name", FOLDERS)
def test_a_folder_with_files_needs_overwrite(here, idle, capsys, name):
    Path("full").mkdir()
    Path("full/notes.txt").write_text("precious")
    err = refused(FOLDERS[name].replace("OUT", "full"), capsys)
    assert "full, which holds files. Give --overwrite" in err
    line = FOLDERS[name].replace("OUT", "set.toml --overwrite")
    assert "expected a folder or a new name, found the file set.toml" in refused(line, capsys)


@pytest.mark.parametrize("line", DEFAULTS)
def test_an_output_that_nobody_named_is_safe_too(here, idle, capsys, line):
    Path(DEFAULTS[line]).write_text("precious")
    assert f"{DEFAULTS[line]}, which exists. Give --overwrite" in refused(line, capsys)


@pytest.mark.parametrize("name", FILES)
def test_overwrite_replaces_the_file(here, capsys, monkeypatch, name):
    if name == "view":
        pytest.importorskip("rerun")
    monkeypatch.setattr(am.live, "serve", lambda *_, **__: 0)  # it would wait for a client
    line, ending = FILES[name]
    Path(f"old{ending}").write_text("precious")
    assert main([*line.replace("OUT", f"old{ending}").split(), "--overwrite", "--quiet"]) == 0
    assert Path(f"old{ending}").read_bytes() != b"precious"


INPUTS = {
    "track in.csv -o in.csv": "in.csv",
    "large plain.csv -o plain.csv": "plain.csv",
    "live in.csv?speed=max --to in.csv": "in.csv",
    "stitch truth.csv -o truth.csv": "truth.csv",
    "fill truth.csv -o truth.csv": "truth.csv",
    "markerset merge set.toml other.toml -o set.toml": "set.toml",
    "name truth.csv --markers set.toml -o truth.csv": "truth.csv",
    "evaluate in.csv truth.csv --by-frame in.csv": "in.csv",
    "corrupt truth.csv -o truth.csv --truth new.csv": "truth.csv",
    "reconstruct seen.csv --rig rig.toml -o seen.csv": "seen.csv",
    "camera convert rig.toml rig.toml": "rig.toml",
}


@pytest.mark.parametrize("line", INPUTS)
def test_what_is_read_is_never_written(here, idle, capsys, line):
    assert f"the input {INPUTS[line]}" in refused(f"{line} --overwrite", capsys)


def test_a_folder_of_cameras_is_read_whole(here, capsys):
    assert main(["camera", "convert", "rig.toml", "cameras", "--format", "flydra", "-q"]) == 0
    inside = next(Path("cameras").iterdir())
    err = refused(f"camera convert cameras {inside} --format rig --overwrite", capsys)
    assert f"the input {inside}" in err


def test_cameras_of_another_rig_are_not_mixed_with_new_ones(here, capsys):
    line = "camera convert rig.toml cameras --format flydra -q"
    assert main(line.split()) == 0
    assert main([*line.split(), "--overwrite"]) == 0  # only files of the same names
    Path("cameras/notes.txt").write_text("precious")
    assert "which holds notes.txt" in refused(f"{line} --overwrite", capsys)


def test_every_command_that_writes_is_in_these_tables():
    tested = {line.split(" -")[0] for line in [*FILES, *FOLDERS]} | {"track", "film"}
    tested = {name.removesuffix(" a scene") for name in tested}
    found = set()
    for name, command in _commands(program):
        names = {p.name for p in command.params}
        writes = names & {"out", "save", "by_frame", "run", "report", "to"}
        assert ("overwrite" in names) == bool(writes), name
        if writes:
            found.add(name)
    assert found == tested


def _commands(group, before=""):
    for name, command in group.commands.items():
        if hasattr(command, "commands"):
            yield from _commands(command, f"{name} ")
        else:
            yield before + name, command
