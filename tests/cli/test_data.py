"""Real captures: corrupted, tracked and scored from the command line."""

from __future__ import annotations

import json

import pytest

from asterism.cli import main
from tests.paths import DATA

pytestmark = [
    pytest.mark.data,
    pytest.mark.skipif(not DATA.is_dir(), reason=f"no real captures at {DATA}"),
]

# Least IDF1 and the format in between: what is missed by far is a fault, not a weakness.
CASES = [
    ("testdata.c3d", "c3d", 0.9),
    ("Running_0002.c3d", "tsv", 0.8),
    ("mocap36.c3d", "trc", 0.4),
]


@pytest.mark.parametrize(("name", "ending", "least"), CASES)
def test_corrupt_track_and_score(tmp_path, monkeypatch, capsys, name, ending, least):
    monkeypatch.chdir(tmp_path)
    (source,) = DATA.rglob(name)
    options = "--missing 0.1 --clutter 0.1 --noise 0.0003 --burst 5:5-60 --seed 1 -q"
    made = ["-o", f"a.{ending}", "--truth", f"t.{ending}", *options.split()]
    assert main(["corrupt", str(source), *made]) == 0, capsys.readouterr().err
    assert main(["track", f"a.{ending}", "-o", f"b.{ending}", "-q"]) == 0
    capsys.readouterr()
    assert main(["evaluate", f"b.{ending}", f"t.{ending}", "--json"]) == 0
    scores = json.loads(capsys.readouterr().out)
    assert scores["idf1"] > least
    assert scores["mota"] > 0.9
    assert scores["clutter_labelled_percent"] < 10
