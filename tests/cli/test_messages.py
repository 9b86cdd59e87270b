"""What the commands say about odd input, before they compute anything."""

from __future__ import annotations

import numpy as np
import pytest

import asterism as am
from asterism.cli import main


@pytest.fixture
def walk(tmp_path):
    """A walk whose file states millimetres and has metres."""
    truth = am.simulate.person(frames=60, seed=1)
    d = truth.detections
    small = am.Tracks(
        detections=am.Detections(times=d.times, offsets=d.offsets, points=d.points / 1000),
        labels=truth.labels, names=truth.names,
    )  # fmt: skip
    am.write(small, tmp_path / "metres.c3d")
    am.write(truth, tmp_path / "walk.c3d")
    return tmp_path


@pytest.mark.parametrize(
    "command",
    [
        "markerset learn metres.c3d -o set.toml",
        "markerset check metres.c3d metres.c3d",
        "name walk.c3d --markers metres.c3d -o named.c3d",
        "estimate metres.c3d",
        "report metres.c3d",
        "evaluate metres.c3d metres.c3d",
        "fill metres.c3d -o filled.c3d",
    ],
)
def test_every_command_warns_of_a_unit_that_cannot_be(command, walk, monkeypatch, capsys):
    monkeypatch.chdir(walk)
    assert main([*command.split(), "--quiet"]) == (command.startswith("markerset check"))
    assert "metres.c3d: " in (said := capsys.readouterr().err)
    assert "unit" in said.lower()


def test_two_axes_are_refused_before_the_tracking(tmp_path, capsys, monkeypatch):
    rng = np.random.default_rng(1)
    d = am.Detections(
        times=np.arange(60) / 100, offsets=np.arange(61), points=rng.normal(0, 0.01, (60, 2))
    )
    am.write(d, tmp_path / "flat.csv")
    monkeypatch.setattr(am.tracking, "plan_tracking", lambda *_, **__: pytest.fail("too late"))
    monkeypatch.chdir(tmp_path)
    assert main(["track", "flat.csv", "-o", "flat.c3d"]) == 2
    assert "3-D points, because C3D holds no others" in capsys.readouterr().err


def test_a_report_of_a_missing_file_names_the_file(tmp_path, capsys):
    assert main(["report", str(tmp_path / "nowhere" / "walk.c3d")]) == 2
    assert "walk.c3d: no such file" in capsys.readouterr().err


def test_a_second_session_is_told_how_to_go_on(walk, monkeypatch, capsys):
    pytest.importorskip("starlette")
    monkeypatch.chdir(walk)
    for name in ("walk.edits.toml", "walk.corrected.c3d"):
        (walk / name).write_text("")
    assert main(["edit", "walk.c3d"]) == 2
    said = capsys.readouterr().err
    assert "give --overwrite to go on with the edits in walk.edits.toml" in said.lower()


def test_a_stream_too_short_for_a_model_says_so(walk, monkeypatch, capsys):
    monkeypatch.chdir(walk)
    assert main(["live", "walk.c3d?speed=max"]) == 0
    found = capsys.readouterr().out
    assert "none: estimated from the first 2 s; a shorter stream needs --model" in found


def test_edits_that_were_respected_are_counted(walk, monkeypatch, capsys):
    monkeypatch.chdir(walk)
    capture = am.read("walk.c3d")
    edit = am.model.Edit(kind="clutter", at=((5, 0),))
    am.io.write_edits("walk.edits.toml", [edit], capture)
    assert main(["track", "walk.c3d", "--edits", "walk.edits.toml", "-o", "out.c3d"]) == 0
    assert "edits                1 respected" in capsys.readouterr().out
