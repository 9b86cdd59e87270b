"""``asterism edit`` without its page: scripts of edits, and what is refused."""

from __future__ import annotations

import sys

import pytest

import asterism as am
from tests.cli.runs import refused, run


@pytest.fixture
def capture(tmp_path, monkeypatch):
    """A capture in the current folder, with a file of one edit."""
    monkeypatch.chdir(tmp_path)
    truth = am.simulate.corrupt(am.simulate.cube(frames=60, seed=1), clutter=0.05, seed=1)
    am.write(truth.detections, "trial.c3d")
    edit = am.model.Edit(kind="clutter", at=((0, 0),))
    am.io.write_edits("trial.edits.toml", (edit,), am.read("trial.c3d"))
    return am.read("trial.c3d")


def test_a_script_of_edits_gives_what_track_gives(capture, capsys):
    assert "1, trial.edits.toml" in run(
        "edit trial.c3d --script trial.edits.toml -o corrected.c3d", capsys
    )
    run("track trial.c3d --edits trial.edits.toml -o tracked.c3d", capsys)
    one, other = (am.io.read_tracks(name) for name in ("corrected.c3d", "tracked.c3d"))
    assert one.n_tracks == other.n_tracks == 7
    assert (one.labels == other.labels).all()
    printed = run("edit trial.c3d --script trial.edits.toml --json", capsys)
    assert '"output": "trial.corrected.c3d"' in printed
    assert am.read("trial.c3d").n_points == capture.n_points


def test_a_run_is_continued(capture, capsys):
    run("track trial.c3d --method gnn --run first", capsys)
    run("edit first --script trial.edits.toml -o gnn.c3d", capsys)
    assert am.io.read_tracks("gnn.c3d").n_tracks > 0
    assert "beside those of the run, found --method" in refused(
        "edit first --method smp --script trial.edits.toml", capsys
    )


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("edit nowhere.c3d", "nowhere.c3d: no such file"),
        ("edit trial.c3d --script none.toml", "--script: expected a file of edits"),
        ("edit trial.c3d --script trial.edits.toml -o trial.c3d", "--out: expected a path of its"),
        ("edit trial.c3d --script trial.edits.toml -o trial.edits.toml", "--out: expected a name"),
        ("edit trial.c3d --script trial.edits.toml -o x.zip", "--out: expected a name ending in"),
        ("edit trial.c3d --script trial.edits.toml --port 99", "--script: expected no option of"),
        ("edit trial.c3d --script trial.edits.toml --no-browser", "--script: expected no option"),
        ("edit trial.c3d --edits trial.c3d", "--edits: expected a path of its own"),
        ("edit trial.c3d --method gnnn", "--method: expected"),
        ("edit trial.c3d --seed -1", "--seed: expected a whole number"),
        ("edit trial.c3d --port 0", "--port"),
        ("edit trial.c3d --edits broken.toml --no-browser", "broken.toml: the file: expected TOML"),
        ("edit . --no-browser", "run.toml: no such file"),
    ],
)
def test_mistakes_are_refused_in_one_line(capture, capsys, tmp_path, line, message):
    (tmp_path / "broken.toml").write_text("[")
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    error = refused(line, capsys)
    assert message in error
    assert error.count("\n") == 1
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_results_are_not_overwritten(capture, capsys):
    line = "edit trial.c3d --script trial.edits.toml"
    run(line, capsys)
    assert "Give --overwrite" in refused(line, capsys)
    run(f"{line} --overwrite", capsys)


def test_a_taken_port_is_reported(capture, capsys):
    import socket

    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        message = refused(f"edit trial.c3d --no-browser --port {port}", capsys)
    assert f"--port: expected a free port, found {port}" in message


def test_a_missing_extra_is_named(capture, capsys, monkeypatch):
    for name in ("starlette", "uvicorn"):
        monkeypatch.setitem(sys.modules, name, None)
    assert "run pip install 'asterism[edit]'" in refused("edit trial.c3d", capsys).lower()
    run("edit trial.c3d --script trial.edits.toml", capsys)  # needs no server
