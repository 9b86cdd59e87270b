"""Monte Carlo studies: cases, resumption, tables."""

from __future__ import annotations

import csv
import dataclasses
import json
import math

import numpy as np
import pytest

import asterism as am
from asterism.cli import main
from asterism.errors import FormatError, ParameterError
from asterism.sweep.score import score_case
from asterism.sweep.table import summarize

STUDY = am.sweep.Study(
    scenes={"cube": {"scene": "cube", "frames": 20}},
    corruptions={"missing": {"missing": [0.0, 0.3], "noise": 0.001}},
    methods={"gnn": {"method": "gnn"}, "smp": {"method": "smp", "window": 3}},
    seeds=(1, 2, 3),
    scores=("idf1", "switches", "n_true"),
)


def files(folder):
    return {p.name: p.read_bytes() for p in folder.iterdir() if p.name != "cases.jsonl"}


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    out = tmp_path_factory.mktemp("sweep") / "out"
    return out, am.sweep.run(STUDY, out, workers=1)


def test_each_case_is_one_row_with_the_scores_of_its_settings(whole):
    _, sweep = whole
    assert len(sweep.rows) == 2 * 2 * 3
    row = next(r for r in sweep.rows if (r["method"], r["corruption.missing"], r["seed"])
               == ("smp", 0.3, 2))  # fmt: skip
    truth = am.simulate.corrupt(
        am.simulate.cube(frames=20, seed=2), missing=0.3, noise=0.001, seed=2
    )
    tracks = am.track(truth.detections, am.SMP(window=3), seed=2)
    found = am.evaluate(tracks, truth)
    assert {name: row[name] for name in STUDY.scores} == {
        name: getattr(found, name) for name in STUDY.scores
    }
    # The other seeds give other figures, so that a wrong seed would be noticed.
    same = [r for r in sweep.rows if r["method"] == "smp" and r["corruption.missing"] == 0.3]
    assert len({r["n_true"] for r in same}) > 1
    assert {r["idf1"] for r in sweep.rows if r["corruption.missing"] == 0} == {1.0}


def test_a_stopped_sweep_is_resumed_with_the_same_bytes(whole, tmp_path, monkeypatch):
    out, _ = whole
    asked = []

    def counted(case, scores, *, progress=None):
        asked.append(case.key)
        if len(asked) == 5:
            raise KeyboardInterrupt
        return score_case(case, scores, progress=progress)

    monkeypatch.setattr("asterism.sweep.run_sweep.score_case", counted)
    with pytest.raises(KeyboardInterrupt):
        am.sweep.run(STUDY, tmp_path, workers=1)
    with (tmp_path / "cases.jsonl").open("a", encoding="utf-8") as file:
        file.write('{"key": "torn')  # as a process that is killed leaves it
    sweep = am.sweep.run(STUDY, tmp_path, workers=1)
    assert sweep.n_done_before == 4
    assert len(asked) == 5 + 8
    assert files(tmp_path) == files(out)
    more = dataclasses.replace(STUDY, seeds=(1, 2, 3, 4))
    assert am.sweep.run(more, tmp_path, workers=1).n_done_before == 12


@pytest.mark.filterwarnings("ignore")
def test_workers_give_the_same_bytes(whole, tmp_path):
    pytest.importorskip("distributed", reason="needs the extra cluster")
    am.sweep.run(STUDY, tmp_path, workers=2)
    assert files(tmp_path) == files(whole[0])


def test_a_case_that_fails_stops_no_other(tmp_path):
    study = dataclasses.replace(
        STUDY, corruptions={"good": {}, "bad": {"missing": 2.0}}, seeds=(1,)
    )
    sweep = am.sweep.run(study, tmp_path, workers=1)
    assert {row["corruption"] for row in sweep.rows} == {"good"}
    assert len(sweep.failed) == 2
    assert all("missing" in reason for reason in sweep.failed.values())


def test_the_interval_covers_the_mean_as_often_as_it_states():
    rng = np.random.default_rng(1)
    rows = [
        {"method": f"{k}", "seed": s, "x": x}
        for k in range(2000)
        for s, x in enumerate(rng.normal(0.3, 2.0, 5))
    ]
    found = summarize(rows, ["x"])
    covered = np.mean([row["x_low"] <= 0.3 <= row["x_high"] for row in found])
    assert abs(covered - 0.95) < 4 * math.sqrt(0.95 * 0.05 / 2000)
    assert math.isnan(summarize(rows[:1], ["x"])[0]["x_low"])


def test_a_capture_is_known_by_its_content(tmp_path):
    am.write(am.simulate.cube(frames=20, seed=1), tmp_path / "cube.c3d")
    (tmp_path / "study.toml").write_text(
        'seeds = 2\n[scenes.a]\ncapture = "cube.c3d"\n[corruptions.b]\nmissing = 0.1\n'
        'burst = { n = 1, shortest = 2, longest = 4 }\n[methods.gnn]\nmethod = "gnn"\n'
    )
    study = am.sweep.read_study(tmp_path / "study.toml")
    before = [case.key for case in study.cases()]
    assert am.sweep.run(study, tmp_path / "out", workers=1).rows[0]["idf1"] > 0.5
    am.write(am.simulate.cube(frames=20, seed=2), tmp_path / "cube.c3d")
    assert not set(before) & {case.key for case in study.cases()}
    (tmp_path / "cube.c3d").unlink()
    with pytest.raises(FormatError, match="no such file"):
        study.cases()


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("[scenes.a]\nscene = 'cube'\n", "methods: expected one table at least"),
        ("[scenes.a]\nscene = 'cub'\n[methods.b]\n", "scenes.a.scene"),
        ("[scenes.a]\n[methods.b]\n", "either scene or capture"),
        ("[scenes.a]\nscene = 'cube'\n[methods.b]\nmethod = 'gmm'\n", "methods.b.method"),
        ("scores = ['idf2']\n[scenes.a]\nscene = 'cube'\n[methods.b]\n", "idf2"),
        ("seeds = [1, 1]\n[scenes.a]\nscene = 'cube'\n[methods.b]\n", "different numbers"),
        ("[scenes.a]\nscene = 'cube'\nframe = 3\n[methods.b]\n", "Did you mean 'frames'"),
        ("[scenes.a]\nscene = 'cube'\n[methods.b]\nwindow = 3\n", "methods.b"),
        (
            "[scenes.a]\nscene = 'cube'\n[methods.b]\nmethod = 'smp'\nwindo = 3\n",
            "Did you mean 'window'",
        ),
        (
            "[scenes.a]\nscene = 'cube'\n[corruptions.c]\nmising = 0.1\n[methods.b]\n",
            "Did you mean 'missing'",
        ),
        ("seed = 3\n[scenes.a]\nscene = 'cube'\n[methods.b]\n", "seed"),
    ],
)
def test_a_wrong_study_is_refused(tmp_path, text, says):
    (tmp_path / "study.toml").write_text(text)
    with pytest.raises(FormatError, match=says):
        am.sweep.read_study(tmp_path / "study.toml")


def test_the_command(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "study.toml").write_text(
        "seeds = 2\n[scenes.cube]\nscene = 'cube'\nframes = 20\n[methods.gnn]\nmethod = 'gnn'\n"
    )
    line = ["sweep", "study.toml", "-o", "out", "--workers", "1"]
    assert main([*line, "--dry-run", "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == {"n_cases": 2}
    assert main(line) == 0
    assert "1 ± 0" in capsys.readouterr().out
    with (tmp_path / "out" / "table.csv").open() as file:
        assert [row["idf1"] for row in csv.DictReader(file)] == ["1.0", "1.0"]


def test_a_folder_with_other_files_needs_overwrite(tmp_path):
    (tmp_path / "notes.txt").write_text("precious")
    with pytest.raises(ParameterError, match="which holds files"):
        am.sweep.run(STUDY, tmp_path, workers=1)
