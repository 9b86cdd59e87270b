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


WORK = {
    "asterism": ("name_tracks", "stitch", "estimate_model", "fill_gaps"),
    "asterism.tracking": ("plan_tracking",),
    "asterism.multiview": ("estimate_images",),
    "asterism.simulate": ("corrupt",),
    "asterism.cli.filming": ("film_all",),
}


@pytest.fixture
def flat(tmp_path, monkeypatch):
    """A folder with tracks of 2-D points and image points at uneven times, where no work begins."""
    rng = np.random.default_rng(1)
    times, labels = np.arange(60) / 100, np.zeros(60, dtype=int)
    for name, axes, at in (("flat", 2, times), ("uneven", 3, times**2)):
        d = am.Detections(
            times=at, offsets=np.arange(61), points=rng.normal(0, 0.01, (60, axes))
        )  # fmt: skip
        am.write(am.Tracks(detections=d, labels=labels, names=("one",)), tmp_path / f"{name}.csv")
    rig = am.Rig.ring(2, radius=5, height=2)
    am.io.write_rig(rig, tmp_path / "rig.toml")
    filmed = am.simulate.film(am.io.read_tracks(tmp_path / "uneven.csv"), rig)
    am.io.write_observations(filmed.observations, tmp_path / "seen.csv")
    for module, names in WORK.items():
        for name in names:
            monkeypatch.setattr(f"{module}.{name}", lambda *_, **__: pytest.fail("too late"))
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize(
    "command",
    [
        "track flat.csv -o out.c3d",
        "name flat.csv -o out.c3d",
        "stitch flat.csv -o out.c3d",
        "fill flat.csv -o out.c3d",
        "edit flat.csv --script flat.edits.toml -o out.c3d",
        "corrupt flat.csv -o out.c3d --truth truth.csv",
        "corrupt flat.csv -o out.csv --truth truth.c3d",
        "serve uneven.csv --labelled --rig ring4 --truth truth.c3d",
        "reconstruct seen.csv --rig rig.toml -o out.c3d",
    ],
)
def test_what_a_format_cannot_hold_is_refused_before_the_work(command, flat, capsys):
    (flat / "flat.edits.toml").touch()
    assert main(command.split()) == 2
    found = capsys.readouterr().err
    assert "because C3D h" in found
    assert {path.name for path in flat.glob("*.c3d")} | {*flat.glob("truth.*")} == set()


def test_a_batch_refuses_what_a_format_cannot_hold_before_the_work(flat):
    stages = []
    batch = am.batch.run(
        ["flat.csv"], "out", am.batch.Settings(format="c3d"), workers=1,
        progress=lambda name, stage, done, of: stages.append(stage),
    )  # fmt: skip
    assert "3-D points, because C3D holds no others" in batch.failed["flat.csv"]
    assert "estimating the model" not in stages


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


def test_without_edits_none_are_counted(walk, monkeypatch, capsys):
    monkeypatch.chdir(walk)
    assert main(["track", "walk.c3d", "-o", "out.c3d"]) == 0
    assert "respected" not in capsys.readouterr().out
