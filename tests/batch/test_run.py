"""A batch: results, resumption, failures."""

from __future__ import annotations

import csv
import dataclasses
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

import asterism as am
from asterism.batch.storage import deliver
from asterism.cli import main
from asterism.errors import FormatError, ParameterError
from tests.batch.conftest import contents

RESULTS = (
    "first/turn.tracked.csv", "first/turn.tracked.html", "first/walk.tracked.c3d",
    "first/walk.tracked.html", "second/walk.tracked.c3d", "second/walk.tracked.html",
)  # fmt: skip


def test_all_captures_are_tracked_and_the_reason_of_a_failure_is_given(batch):
    assert repr(batch) == "Batch(3 captures tracked, 0 done before, 1 failed)"
    assert "word 9: expected data that begin within" in batch.failed["second/damaged.c3d"]
    out = Path(batch.out)
    assert set(RESULTS) <= set(contents(out))
    assert all(am.io.read_tracks(out / "first/walk.tracked.c3d").names)  # by the set of the folder
    with (out / "summary.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [row["state"] for row in rows] == ["failed", "tracked", "tracked", "tracked"]
    assert rows[0]["capture"] == "second/damaged.c3d"
    named = {row["capture"]: row["n_named"] for row in rows}
    assert (named["first/walk.c3d"], named["second/walk.c3d"]) == ("8", "")
    page = (out / "index.html").read_text(encoding="utf-8")
    assert page.index("damaged.c3d") < page.index('href="first/walk.tracked.html"')


def test_a_result_is_that_of_track(made_captures, batch, tmp_path):
    source, alone = made_captures / "second" / "walk.c3d", tmp_path / "alone.c3d"
    assert main(["track", str(source), "-o", str(alone), "--quiet"]) == 0
    assert alone.read_bytes() == Path(batch.out, "second/walk.tracked.c3d").read_bytes()
    run, again = Path(batch.out, "runs/second/walk.c3d/run.toml"), tmp_path / "again.c3d"
    assert main(["track", "--from", str(run), "-o", str(again), "--quiet"]) == 0
    assert again.read_bytes() == alone.read_bytes()


def test_finished_work_is_known_by_its_content(captures, out):
    before = contents(out)
    again = am.batch.run([captures], out, workers=1)
    assert (again.n_tracked, again.n_done_before) == (0, 3)
    # The same name with another content is other work, and replaces nothing by itself.
    source = captures / "second" / "walk.c3d"
    source.write_bytes((captures / "first" / "walk.c3d").read_bytes())
    again = am.batch.run([captures], out, workers=1)
    assert "found another. Give overwrite" in again.failed["second/walk.c3d"]
    assert contents(out) == before
    again = am.batch.run([captures], out, workers=1, overwrite=True)
    assert (again.n_tracked, again.n_done_before) == (1, 2)
    assert contents(out) != before


@pytest.mark.parametrize("change", ["settings", "marker set", "edits"])
def test_all_that_determines_a_result_is_in_its_key(captures, change):
    settings, source = am.batch.Settings(report=False), captures / "first" / "walk.c3d"
    before = am.batch.plan_batch([str(captures)], "out", settings)
    if change == "settings":
        settings = dataclasses.replace(settings, fill=True)
    elif change == "marker set":
        path = captures / "first" / "markers.toml"
        path.write_text(path.read_text(encoding="utf-8") + "\n# by another\n", encoding="utf-8")
    else:
        edits = [am.model.Edit(kind="clutter", at=((3, 0),))]
        am.io.write_edits(captures / "first" / "walk.edits.toml", edits, am.read(source))
    after = am.batch.plan_batch([str(captures)], "out", settings)
    changed = {a.job.name for a, b in zip(before, after, strict=True) if a.job.key != b.job.key}
    assert (
        changed
        == {
            "settings": {
                "first/walk.c3d",
                "first/turn.csv",
                "second/walk.c3d",
                "second/damaged.c3d",
            },
            "marker set": {"first/walk.c3d", "first/turn.csv"},
            "edits": {"first/walk.c3d"},
        }[change]
    )


def test_edits_beside_a_capture_are_respected(captures, tmp_path):
    source = captures / "second" / "walk.c3d"
    edits = [am.model.Edit(kind="clutter", at=((3, 0),))]
    am.io.write_edits(captures / "second" / "walk.edits.toml", edits, am.read(source))
    am.batch.run([source], tmp_path / "out", workers=1)
    tracks = am.io.read_tracks(tmp_path / "out" / "walk.tracked.c3d")
    d = tracks.detections
    at = d.offsets[3] + [tuple(p) for p in d.frame(3)].index(tuple(am.read(source).frame(3)[0]))
    assert tracks.labels[at] == -1


def test_a_stopped_batch_is_resumed(made_captures, serial, tmp_path):
    """It is killed at several moments, with SIGKILL; the end is as if it had never been."""
    out = tmp_path / "out"
    line = [sys.executable, "-m", "asterism.cli", "batch", str(made_captures), "-o", str(out)]
    stopped = 0
    for seconds in (1.2, 1.8, 2.4):
        process = subprocess.Popen([*line, "--workers", "1", "-q"], stderr=subprocess.DEVNULL)
        time.sleep(seconds)
        process.send_signal(signal.SIGKILL)
        stopped += process.wait() == -signal.SIGKILL
    assert stopped >= 1
    batch = am.batch.run([made_captures], out, workers=1)
    assert set(batch.failed) == {"second/damaged.c3d"}
    assert contents(out) == serial


def test_the_bound_of_the_memory_is_kept(captures, tmp_path):
    batch = am.batch.run([captures / "first"], tmp_path / "out", workers=1, memory=40_000_000)
    assert set(batch.failed) == {"walk.c3d", "turn.csv"}
    for reason in batch.failed.values():
        assert "memory" in reason or "process ended" in reason


def test_a_folder_that_cannot_be_listed_is_reported(captures, monkeypatch):
    closed, listed = captures / "first", os.scandir

    def scandir(path):
        if str(path) == str(closed):
            raise PermissionError(13, "Permission denied", str(path))
        return listed(path)

    monkeypatch.setattr(os, "scandir", scandir)
    planned = am.batch.plan_batch([str(captures)], "out", am.batch.Settings())
    states = {each.job.name: (each.state, each.reason) for each in planned}
    assert states["first"] == ("failed", f"{closed}: Permission denied")
    assert states["second/walk.c3d"][0] == "new"


def test_a_full_disk_is_reported(captures, tmp_path, monkeypatch):
    def full(place, content, *, overwrite):
        del content, overwrite
        raise FormatError(place, "", "", "no space left on device")

    monkeypatch.setattr("asterism.batch.perform.deliver", full)
    batch = am.batch.run([captures / "first"], tmp_path / "out", workers=1)
    assert all("no space left on device" in reason for reason in batch.failed.values())
    monkeypatch.setattr("asterism.batch.perform.deliver", deliver)
    assert am.batch.run([captures / "first"], tmp_path / "out", workers=1).n_tracked == 2


def test_what_another_has_put_there_is_kept(captures, tmp_path):
    out = tmp_path / "out"
    (out / "runs").mkdir(parents=True)
    (out / "walk.tracked.c3d").write_text("precious")
    batch = am.batch.run([captures / "first"], out, workers=1)
    assert "exists" in batch.failed["walk.c3d"] or "another one" in batch.failed["walk.c3d"]
    assert (out / "walk.tracked.c3d").read_text() == "precious"
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "index.html").write_text("precious")
    with pytest.raises(ParameterError, match="which holds files"):
        am.batch.run([captures / "first"], tmp_path / "other", workers=1)


def test_two_captures_with_one_result_are_refused(captures):
    places = [str(captures / "first" / "walk.c3d"), str(captures / "second" / "walk.c3d")]
    with pytest.raises(ParameterError, match="the result of both"):
        am.batch.plan_batch(places, "out", am.batch.Settings())


def test_results_inside_the_folder_are_no_captures(captures):
    out = captures / "first" / "out"
    shutil.copytree(captures / "second", out)
    planned = am.batch.plan_batch([str(captures / "first")], str(out), am.batch.Settings())
    assert [each.job.name for each in planned] == ["turn.csv", "walk.c3d"]


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"method": "gmm"}, "method"),
        ({"options": {"window": 3}}, "options: expected a method that has them"),
        ({"method": "smp", "options": {"windw": 3}}, "windw"),
        ({"stitch": "yes"}, "stitch"),
        ({"seed": -1}, "seed"),
        ({"format": "c4d"}, "format"),
    ],
)
def test_settings_are_checked(given, says):
    with pytest.raises(ParameterError, match=says):
        am.batch.Settings(**given)


def test_the_command_reports_and_fails_with_1(captures, out, capsys):
    new = f"{out}.new"
    assert main(["batch", str(captures), "-o", new, "--dry-run", "--json"]) == 0
    planned = json.loads(capsys.readouterr().out)["captures"]
    assert [each["state"] for each in planned] == ["new"] * 4
    assert not Path(new).exists()
    assert main(["batch", str(captures), "-o", str(out), "--workers", "1", "--json"]) == 1
    found = json.loads(capsys.readouterr().out)
    assert (found["n_done_before"], list(found["failed"])) == (3, ["second/damaged.c3d"])
    (captures / "second" / "damaged.c3d").unlink()
    assert main(["batch", str(captures), "-o", str(out), "--workers", "1"]) == 0
    assert "done before  3" in capsys.readouterr().out
    assert main(["batch", f"{captures}/nothing", "-o", str(out)]) == 2
    assert "expected captures or folders that exist" in capsys.readouterr().err
