"""Commands that take several captures."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

from asterism.cli import main
from tests.cli.runs import refused, run


def test_info_of_several_captures_is_a_table(scene, capsys):
    lines = run("info in.csv truth.csv", capsys).splitlines()
    assert [line.split()[0] for line in lines] == ["file", "in.csv", "truth.csv"]
    Path("none.c3d").write_bytes(b"no capture")
    assert main(["info", "in.csv", "none.c3d", "--json"]) == 1
    found = json.loads(capsys.readouterr().out)["captures"]
    assert found[0]["n_frames"] > 0
    assert "none.c3d" in found[1]["error"]


def test_report_of_several_captures_is_a_page_each(scene, capsys):
    found = json.loads(run("report in.csv truth.csv --json", capsys))["reports"]
    assert [each["output"] for each in found] == ["in.html", "truth.html"]
    assert all(Path(each["output"]).stat().st_size == each["bytes"] for each in found)
    assert "--title: expected one capture, found 2" in refused(
        "report in.csv truth.csv --title A --overwrite", capsys
    )


def test_evaluate_compares_two_folders(scene, capsys):
    for folder in ("tracked/a", "tracked/runs", "truths/a"):
        Path(folder).mkdir(parents=True)
    shutil.copy("truth.csv", "tracked/a/walk.tracked.csv")
    shutil.copy("truth.csv", "tracked/runs/other.csv")
    shutil.copy("in.csv", "tracked/summary.csv")
    shutil.copy("truth.csv", "truths/a/walk.csv")
    found = json.loads(run("evaluate tracked truths --json", capsys))["captures"]
    assert list(found) == ["a/walk"]
    assert found["a/walk"]["idf1"] == 1
    lines = run("evaluate tracked truths", capsys).splitlines()
    assert lines[1].split() == ["a/walk", "1.0000", "1.0000", "1.0000", "0"]
    assert lines[2].split() == ["mean", "1.0000", "1.0000", "1.0000", "0"]
    assert "as the other is one" in refused("evaluate tracked truth.csv", capsys)
    assert "expected captures with the names" in refused("evaluate truths tracked/runs", capsys)
