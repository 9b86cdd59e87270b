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

import numpy as np
import pytest

import asterism as am
from asterism.batch import find, storage
from asterism.batch.perform import perform
from asterism.batch.storage import deliver
from asterism.cli import main
from asterism.errors import FormatError, ParameterError
from asterism.tracking.methods import options_of
from tests.batch.conftest import contents

QUICK = am.batch.Settings(method="gnn")
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
    assert "found another. Give overwrite" in again.changed["second/walk.c3d"]
    assert set(again.failed) == {"second/damaged.c3d"}
    assert contents(out) == before
    (captures / "second" / "damaged.c3d").unlink()
    again = am.batch.run([captures], out, workers=1, overwrite=True)
    assert (again.n_tracked, again.n_done_before) == (1, 2)
    assert contents(out) != before


def test_results_of_other_settings_keep_their_figures(captures, out, capsys):
    def rows():
        with (out / "summary.csv").open(encoding="utf-8", newline="") as file:
            return {row["capture"]: row for row in csv.DictReader(file)}

    am.batch.run([captures], out, workers=1)
    before, files = rows(), contents(out)
    line = ["batch", str(captures), "-o", str(out), "--workers", "1", "--format", "csv"]
    # Without a page, and in another format: the index has the links of the results that are there.
    line += ["--fill", "--no-report"]
    assert main(line) == 1
    printed = " ".join(capsys.readouterr().out.split())
    assert "changed 3, of another input, settings or versions: kept first/turn.csv" in printed
    assert "Give --overwrite" in printed
    assert "failed 1" in printed
    assert contents(out) == files
    after = rows()
    for name, row in after.items():
        if name == "second/damaged.c3d":
            assert row["state"] == "failed"
            continue
        assert row["state"] == "changed"
        stem = name.rpartition(".")[0]
        result = out / f"{stem}.tracked{Path(name).suffix}"
        assert row["reason"].startswith(f"{result}: expected a result of the same input, settings")
        assert row | {"state": "tracked", "reason": ""} == before[name]
    page = (out / "index.html").read_text(encoding="utf-8")
    assert "Without a result: 1. With a result of another input or settings: 3." in page
    assert 'href="first/walk.tracked.html"' in page
    assert main([*line, "--json"]) == 1
    found = json.loads(capsys.readouterr().out)
    assert (len(found["changed"]), list(found["failed"])) == (3, ["second/damaged.c3d"])
    assert main([*line, "--dry-run"]) == 0
    assert capsys.readouterr().out.count(" changed ") == 3
    # The settings of before find their results again.
    assert repr(am.batch.run([captures], out, workers=1)) == (
        "Batch(0 captures tracked, 3 done before, 1 failed)"
    )
    assert rows() == before


@pytest.mark.parametrize("change", ["settings", "marker set", "edits"])
def test_all_that_determines_a_result_is_in_its_key(captures, change):
    settings, source = am.batch.Settings(report=False), captures / "first" / "walk.c3d"
    before, _ = am.batch.plan_batch([str(captures)], "out", settings)
    if change == "settings":
        settings = dataclasses.replace(settings, fill=True)
    elif change == "marker set":
        path = captures / "first" / "markers.toml"
        path.write_text(path.read_text(encoding="utf-8") + "\n# by another\n", encoding="utf-8")
    else:
        edits = [am.model.Edit(kind="clutter", at=((3, 0),))]
        am.io.write_edits(captures / "first" / "walk.edits.toml", edits, am.read(source))
    after, _ = am.batch.plan_batch([str(captures)], "out", settings)
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
    am.batch.run([source], tmp_path / "out", QUICK, workers=1)
    tracks = am.io.read_tracks(tmp_path / "out" / "walk.tracked.c3d")
    d = tracks.detections
    at = d.offsets[3] + [tuple(p) for p in d.frame(3)].index(tuple(am.read(source).frame(3)[0]))
    assert tracks.labels[at] == -1
    assert "1 respected" in (tmp_path / "out" / "walk.tracked.html").read_text(encoding="utf-8")
    of_run = tmp_path / "out" / "runs" / "walk.c3d" / "summary.json"
    assert json.loads(of_run.read_text(encoding="utf-8"))["n_edits"] == 1


def test_a_stopped_batch_is_resumed(made_captures, serial, tmp_path):
    """It is killed with SIGKILL when some files are there; the end is as if it had never been."""
    out = tmp_path / "out"
    line = [sys.executable, "-m", "asterism.cli", "batch", str(made_captures), "-o", str(out)]
    for n in (1, 5):  # files of results, which are six for each capture
        process = subprocess.Popen([*line, "--workers", "1", "-q"], stderr=subprocess.DEVNULL)
        while process.poll() is None and (not out.is_dir() or len(contents(out)) < n):
            time.sleep(0.002)
        process.send_signal(signal.SIGKILL)
        assert process.wait() == -signal.SIGKILL
        assert n <= len(contents(out)) < len(serial)
    unfinished = out / "second" / f".{16 * 'a'}.part"
    unfinished.parent.mkdir(exist_ok=True)
    unfinished.write_bytes(b"C3")
    os.utime(unfinished, (0, 0))
    batch = am.batch.run([made_captures], out, workers=1)
    assert set(batch.failed) == {"second/damaged.c3d"}
    assert contents(out) == serial
    assert not unfinished.exists()


def test_the_bound_of_the_memory_is_kept(captures, tmp_path):
    batch = am.batch.run([captures / "first"], tmp_path / "out", workers=1, memory=60_000_000)
    assert set(batch.failed) == {"walk.c3d", "turn.csv"}
    for reason in batch.failed.values():
        # The engine ends the process where a thread has no memory.
        assert "needs more memory than the bound of 0.06 GB" in reason or "SIGABRT" in reason


def test_a_failed_capture_is_named_once(tmp_path, capsys):
    captures = tmp_path / "captures"
    captures.mkdir()
    am.write(am.simulate.cube(frames=1, seed=1), captures / "static.c3d")
    (captures / "damaged.c3d").write_bytes((captures / "static.c3d").read_bytes()[:600])
    assert main(["batch", str(captures), "-o", str(tmp_path / "out"), "--workers", "1"]) == 1
    printed = " ".join(capsys.readouterr().out.split())
    assert "static.c3d: detections: expected at least 3 points in at least 3 frames" in printed
    assert "found 8 points in 1 frame" in printed
    assert (printed.count("static.c3d"), printed.count("damaged.c3d")) == (1, 1)


def test_the_memory_of_a_capture_is_its_own(captures, tmp_path):
    held = np.ones(60_000_000)  # of this process, which is not counted
    source = captures / "first" / "walk.c3d"
    batch = am.batch.run([source], tmp_path / "out", QUICK, workers=1)
    (peak,) = (each.peak_bytes for each in batch.outcomes.values())
    if sys.platform == "linux":
        assert 30e6 < peak < held.nbytes


def test_an_input_that_changes_in_between_is_refused(captures, tmp_path):
    plan, _ = am.batch.plan_batch([str(captures / "first")], "out", am.batch.Settings())
    job = next(each.job for each in plan if each.job.name == "walk.c3d")
    (captures / "first" / "walk.c3d").write_bytes((captures / "second" / "walk.c3d").read_bytes())
    outcome = perform(job, str(tmp_path / "out"))
    assert "expected the input and the versions with which the batch began" in outcome.error
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("method", am.tracking.METHODS)
def test_each_method_has_a_key(captures, method):
    made = am.tracking.method_by_name(method)
    settings = am.batch.Settings(method=method, options=options_of(made))
    default = am.batch.Settings(method=method)
    for given in (settings, default):
        plan, _ = am.batch.plan_batch([str(captures / "first" / "walk.c3d")], "out", given)
        assert len(plan[0].job.key) == 64


def test_what_cannot_be_read_is_reported(captures, tmp_path):
    for name in ("gone.csv", "lost.c3d"):
        (captures / "first" / name).symlink_to(captures / "nowhere")
    planned, _ = am.batch.plan_batch([str(captures)], "out", am.batch.Settings())
    states = {each.job.name: (each.state, each.reason) for each in planned}
    for name in ("first/gone.csv", "first/lost.c3d"):
        assert states[name][0] == "failed"
        assert "no such file" in states[name][1]
    assert states["first/walk.c3d"][0] == "new"


def test_a_folder_that_cannot_be_listed_is_reported(captures, monkeypatch):
    closed, listed = captures / "first", os.scandir

    def scandir(path):
        if str(path) == str(closed):
            raise PermissionError(13, "Permission denied", str(path))
        return listed(path)

    monkeypatch.setattr(os, "scandir", scandir)
    planned, _ = am.batch.plan_batch([str(captures)], "out", am.batch.Settings())
    states = {each.job.name: (each.state, each.reason) for each in planned}
    assert states["first"] == ("failed", f"{closed}: Permission denied")
    assert states["second/walk.c3d"][0] == "new"


def test_a_full_disk_is_reported(captures, tmp_path, monkeypatch):
    def full(place, content, *, overwrite):
        del content, overwrite
        raise FormatError(place, "", "", "no space left on device")

    monkeypatch.setattr("asterism.batch.perform.deliver", full)
    source, out = captures / "first" / "walk.c3d", tmp_path / "out"
    batch = am.batch.run([source], out, QUICK, workers=1)
    (reason,) = batch.failed.values()
    assert "no space left on device" in reason
    monkeypatch.setattr("asterism.batch.perform.deliver", deliver)
    assert am.batch.run([source], out, QUICK, workers=1).n_tracked == 1


def test_a_truncated_capture_needs_a_look(captures, truncated, tmp_path, caplog):
    out, cut = tmp_path / "out", "cut off in frame "
    batch = am.batch.run([captures], out, QUICK, workers=1)
    # Places to check are not what puts it before the others.
    for path in out.rglob("summary.json"):
        values = json.loads(path.read_text(encoding="utf-8"))
        if values["input"] != str(truncated):
            path.write_text(json.dumps(values | {"places": 9, "expected_wrong": 9.0}))
    assert am.batch.run([captures], out, QUICK, workers=1).n_done_before == 3
    with (out / "summary.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert rows[1]["capture"] == "second/walk.c3d"
    assert (rows[1]["state"], rows[1]["reason"]) == ("tracked", "")
    assert cut in rows[1]["truncated"]
    assert [row["truncated"] for row in rows if row is not rows[1]] == [""] * 3
    page = (out / "index.html").read_text(encoding="utf-8")
    assert "Cut off: 1." in page
    assert page.index(cut) < page.index('href="first/walk.tracked.html"')
    warnings = batch.outcomes["second/walk.c3d"].warnings
    assert warnings[0].startswith(f"{truncated}: ")
    assert cut in warnings[0]
    result = out / "second" / "walk.tracked.c3d"
    complete = f"{result}: holds the complete frames of a truncated capture, {truncated}"
    assert warnings[1] == complete
    assert complete in caplog.messages


def test_what_another_has_put_there_is_kept(captures, tmp_path):
    for name in ("index.html", "summary.csv", "runs", "walk.tracked.c3d"):
        other = tmp_path / name.replace(".", "-")
        other.mkdir()
        path = other / name
        path.mkdir() if name == "runs" else path.write_text("precious")
        with pytest.raises(ParameterError, match="which holds files"):
            am.batch.run([captures / "first"], other, workers=1)
        assert list(other.iterdir()) == [path]


def test_a_result_that_another_has_changed_is_kept(whole, out):
    path = out / "second" / "walk.tracked.c3d"
    path.write_text("precious")
    (out / "runs/second/walk.c3d/summary.json").unlink()
    batch = am.batch.run([whole], out, workers=1)
    assert "expected none, or one with the same bytes" in batch.failed["second/walk.c3d"]
    assert path.read_text() == "precious"
    assert am.batch.run([whole], out, workers=1, overwrite=True).n_tracked == 1
    assert path.read_bytes()[:2] == b"\x02\x50"


@pytest.fixture
def others(captures, out):
    """Files of that folder that are not recognised as captures, in the order of their listing."""
    first, second = captures / "first", captures / "second"
    walk = (first / "walk.c3d").read_bytes()
    (first / "damaged.csv").write_bytes(bytes(range(256)))
    for name in ("named.csv", "plain", "text.txt", ".hidden.csv"):
        (first / name).write_bytes(walk)
    (first / "unused.edits.toml").write_text("")
    # What the batch uses, and what this program has written, is not listed.
    edits = [am.model.Edit(kind="clutter", at=((3, 0),))]
    am.io.write_edits(first / "walk.edits.toml", edits, am.read(first / "walk.c3d"))
    shutil.copy(first / "markers.toml", second / "other.toml")
    shutil.copytree(out, captures / "earlier")
    shutil.copytree(out / "runs" / "first" / "walk.c3d", first / "run")
    return [
        str(captures / name)
        for name in (
            "first/damaged.csv", "first/named.csv", "second/notes.csv",
            "first/plain", "first/text.txt", "first/unused.edits.toml",
        )
    ]  # fmt: skip


@pytest.mark.parametrize("protocol", ["", "file://"])
def test_files_that_are_no_captures_are_listed(captures, others, protocol, monkeypatch):
    if protocol:
        pytest.importorskip("fsspec", reason="needs the extra cluster")
    read = []

    def read_bytes(place, n=None):
        read.append(Path(place).name)
        return storage.read_bytes(place, n)

    monkeypatch.setattr(find, "read_bytes", read_bytes)
    sources, sets = [f"{protocol}{captures}"], [f"{protocol}{captures}/second/other.toml"]
    planned, left_out = am.batch.plan_batch(sources, "out", am.batch.Settings(), markers=sets)
    assert len(planned) == 4
    unused = [f"{captures}/first/markers.toml"]  # the given set is used in its place
    assert sorted(left_out) == sorted(f"{protocol}{each}" for each in others + unused)
    assert left_out[:3] == [f"{protocol}{each}" for each in others[:3]]
    # The first bytes are read only of files with the ending of a capture, once each.
    assert set(read) == {"damaged.csv", "named.csv", "notes.csv", "turn.csv", "summary.json"}
    assert read.count("damaged.csv") == 1


def test_the_command_states_the_files_that_are_no_captures(captures, others, tmp_path, capsys):
    for name in ("other.toml", "damaged.c3d"):
        (captures / "second" / name).unlink()
    line = ["batch", str(captures), "-o", str(tmp_path / "new"), "--workers", "1"]
    line += ["--method", "gnn"]
    for options in (["--dry-run"], []):
        main([*line, *options, "--json"])
        assert json.loads(capsys.readouterr().out)["left_out"] == others
        main([*line, *options])
        printed = "".join(capsys.readouterr().out.split())  # long paths are folded
        assert "leftout6,notrecognisedascaptures" in printed
        assert "first/damaged.csv" in printed
        assert "and1more" in printed
        assert "unused.edits.toml" not in printed
    folder = captures / "nothing"
    folder.mkdir()
    (folder / "walk.txt").write_text("walk")
    assert main(["batch", str(folder), "-o", str(tmp_path / "out")]) == 2
    assert "no file is recognised as a capture" in capsys.readouterr().err


def test_the_output_is_another_folder_than_the_input(captures, capsys):
    before = contents(captures)
    for source, out in ((captures, captures), (captures / "first", captures)):
        for options in ([], ["--dry-run"], ["--overwrite"]):
            assert main(["batch", str(source), "-o", str(out), *options]) == 2
            said = "".join(capsys.readouterr().err.split())
            assert "out:expectedanotherfolderthantheinput" in said
    assert contents(captures) == before
    # A pattern such as captures/* matches an output folder in it too.
    places = [str(captures / "first"), str(captures / "out")]
    (captures / "out").mkdir()
    assert len(am.batch.plan_batch(places, places[1], am.batch.Settings())[0]) == 2
    pytest.importorskip("fsspec", reason="needs the extra cluster")
    with pytest.raises(ParameterError, match="another folder than the input"):
        am.batch.run([f"file://{captures}/"], f"file://{captures}")


def test_two_captures_with_one_result_are_refused(captures):
    places = [str(captures / "first" / "walk.c3d"), str(captures / "second" / "walk.c3d")]
    with pytest.raises(ParameterError, match="the result of both"):
        am.batch.plan_batch(places, "out", am.batch.Settings())


def test_results_inside_the_folder_are_no_captures(captures):
    out = captures / "first" / "out"
    shutil.copytree(captures / "second", out)
    shutil.copy(captures / "first" / "walk.c3d", captures / "first" / "walk.tracked.c3d")
    planned, _ = am.batch.plan_batch([str(captures / "first")], str(out), am.batch.Settings())
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


def test_the_summary_is_written_as_parquet_too(captures, tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet", reason="needs the extra parquet")
    am.batch.run([captures], tmp_path / "out", QUICK, workers=1, parquet=True)
    rows = parquet.read_table(tmp_path / "out" / "summary.parquet").to_pylist()
    with (tmp_path / "out" / "summary.csv").open(newline="") as file:
        expected = list(csv.DictReader(file))
    assert [row["capture"] for row in rows] == [row["capture"] for row in expected]
    for row, text in zip(rows, expected, strict=True):
        for name, value in row.items():
            assert text[name] == ("" if value is None else f"{value:.6g}" if
                                  isinstance(value, float) else str(value))  # fmt: skip
    assert rows[0]["state"] == "failed"
    assert rows[0]["n_frames"] is None
    assert {row["n_frames"] for row in rows[1:]} == {30}
