"""Stitching, marker sets and names on the command line."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

import asterism as am
from asterism.cli import main
from tests.cli.runs import refused, run


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """A person of whom markers are occluded for a while, beside ghosts; tracks of gnn; its set."""
    folder = tmp_path_factory.mktemp("recorded")
    person, p, truth, alone = (
        str(folder / name) for name in ("person.csv", "p.c3d", "pt.c3d", "alone.c3d")
    )
    options = "--burst 5:5-60 --ghosts 3:1-10 --noise 0.0003 --seed 1 -q"
    assert main(["simulate", "person", "-o", person, "--frames=200", "--seed=1", "-q"]) == 0
    assert main(["corrupt", person, "-o", p, "--truth", truth, *options.split()]) == 0
    assert main(["track", p, "--method", "gnn", "-o", alone, "-q"]) == 0
    assert main(["markerset", "learn", person, "-o", str(folder / "set.toml"), "-q"]) == 0
    return folder


@pytest.fixture
def person(recorded, tmp_path, monkeypatch):
    """A copy of that folder, to work in."""
    shutil.copytree(recorded, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_track_finds_occluded_markers_again(person, capsys):
    out = run("track p.c3d --method gnn -o found.c3d --stitch --run r", capsys)
    assert "joins" in out
    truth = am.io.read_tracks("pt.c3d")
    alone, found = (am.evaluate(am.io.read_tracks(f), truth) for f in ("alone.c3d", "found.c3d"))
    assert found.idf1 > 0.985 > alone.idf1
    # The run repeats it, and says what the library says.
    run("track --from r/run.toml -o again.c3d", capsys)
    assert Path("again.c3d").read_bytes() == Path("found.c3d").read_bytes()
    model = am.tracking.tracklet_model(am.estimate_model(am.read("p.c3d")).model)
    expected = am.track(am.read("p.c3d"), am.GNN(), model=model, stitch=True)
    assert am.evaluate(am.io.read_tracks("found.c3d"), expected).idf1 == 1


def test_stitch_says_what_it_joined(scene, person, capsys):
    out = run("stitch alone.c3d -o markers.c3d", capsys)
    assert "least certain" in out
    report = json.loads(run("stitch alone.c3d -o markers.csv --json", capsys))
    assert report["n_joins"] == len(report["joins"]) > 10
    assert report["n_tracks"] < report["n_tracks_before"]
    truth = am.io.read_tracks("pt.c3d")
    before, after = (
        am.evaluate(am.io.read_tracks(f), truth).idf1 for f in ("alone.c3d", "markers.c3d")
    )
    assert after > 0.98 > before
    assert run("stitch truth.csv -o quiet.csv -q", capsys) == ""


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("stitch in.csv -o out.csv", "asterism track --stitch"),
        ("stitch truth.csv -o truth.csv", "a path of its own"),
        ("stitch truth.csv -o out.csv --confirm 1", "confirm"),
        ("stitch truth.csv -o out.csv --ghost-radius 0", "--ghost-radius"),
        ("stitch truth.csv -o out.csv --model none.toml", "none.toml"),
        ("stitch nothing.csv -o out.csv", "nothing.csv"),
    ],
)
def test_what_stitch_refuses(scene, capsys, line, says):
    assert says in refused(line, capsys)
    assert not Path("out.csv").exists()


def test_the_marker_set_of_one_capture_names_the_next(person, capsys):
    out = run("markerset learn person.csv -o subject.toml", capsys)
    assert "moving subjects" in out
    report = json.loads(run("markerset show subject.toml --json", capsys))
    assert len(report["markers"]) == 53
    assert {one["name"]: one["partner"] for one in report["markers"]}["LKNE"] == "RKNE"
    run("track p.c3d --stitch -o tracked.c3d", capsys)
    out = run("name tracked.c3d --markers subject.toml -o named.c3d", capsys)
    assert "names not found" in out
    truth, named = am.io.read_tracks("person.csv"), am.read("named.c3d")
    names = [name for name in named.names if name]
    assert set(names) <= set(truth.names)
    assert len(names) > 0.95 * truth.n_tracks
    assert names == [name for name in truth.names if name in names]  # in the order of the set
    report = json.loads(run("name tracked.c3d --markers subject.toml -o n.csv --json", capsys))
    assert report["n_named"] == len(report["names"]) >= len(names)
    assert {one["name"] for one in report["names"]} == set(names)
    # The names are right: each point that has one lies where that marker was.
    places = truth.positions()
    number = {name: k for k, name in enumerate(truth.names)}
    off = [
        np.linalg.norm(point - places[frame, number[named.names[label]]])
        for point, frame, label in zip(named.points, named.frame_of, named.labels, strict=True)
        if label >= 0 and named.names[label]
    ]
    assert np.quantile(off, 0.99) < 0.002


def test_one_command_tracks_names_and_fills(person, capsys):
    line = "track p.c3d --markers set.toml --fill -o named.c3d --report page.html --run runs/a"
    out = run(line, capsys)
    for row in ("names given", "names not found", "gaps filled", "page.html"):
        assert row in out
    truth, named = am.io.read_tracks("person.csv"), am.read("named.c3d")
    assert set(filter(None, named.names)) <= set(truth.names)
    assert len([name for name in named.names if name]) > 0.95 * truth.n_tracks
    assert named.filled.any()
    summary = json.loads(Path("runs/a/summary.json").read_text())
    assert summary["naming"]["n_named"] >= 50
    assert summary["filled"]["n_filled"] > 0
    run("track --from runs/a/run.toml -o again.c3d", capsys)
    assert Path("again.c3d").read_bytes() == Path("named.c3d").read_bytes()
    am.MarkerSet.from_toml("set.toml").of_subject("Ann").to_toml("other.toml")
    err = refused("track --from runs/a/run.toml --markers other.toml -o b.c3d", capsys)
    assert "--markers: expected those of" in err


def test_a_labelled_capture_serves_as_marker_set(person, capsys):
    run("name pt.c3d --markers pt.c3d -o own.c3d", capsys)
    truth, named = (am.io.read_tracks(f) for f in ("pt.c3d", "own.c3d"))
    assert set(filter(None, named.names)) == set(truth.names)
    run("track p.c3d --markers pt.c3d --run kept", capsys)
    run("track --from kept/run.toml -o again.c3d", capsys)
    assert Path("again.c3d").read_bytes() == Path("kept/p.tracked.c3d").read_bytes()


def test_a_capture_keeps_its_own_names(person, capsys):
    out = run("track pt.c3d -o kept.c3d --run kept", capsys)
    assert "53 kept, 0 moved, 0 left out" in out
    run("track --from kept/run.toml -o again.c3d", capsys)
    assert Path("again.c3d").read_bytes() == Path("kept.c3d").read_bytes()
    truth = am.io.read_tracks("person.csv")
    names = list(truth.names)
    a, b = names.index("LTOE"), names.index("LHEE")
    late = truth.detections.frame_of >= truth.detections.n_frames - 60
    labels = truth.labels.copy()
    labels[late & (truth.labels == a)], labels[late & (truth.labels == b)] = b, a
    am.write(am.Tracks(detections=truth.detections, labels=labels, names=truth.names), "w.csv")
    own = json.loads(run("name w.csv -o n.csv --json", capsys))["own"]
    assert len(own["kept"]) == 53
    assert {(c["name"], c["found"]) for c in own["conflicts"]} == {
        ("LTOE", "LHEE"),
        ("LHEE", "LTOE"),
    }
    assert "contradicted" in run("name w.csv -o m.csv", capsys)
    assert main(["markerset", "check", "person.csv", "w.csv", "--json"]) == 1
    checked = json.loads(capsys.readouterr().out)["conflicts"]
    assert [c | {"probability": 1} for c in checked] == [
        {"capture": "w.csv"} | c | {"probability": 1} for c in own["conflicts"]
    ]


def test_sets_are_merged_and_names_checked(person, capsys):
    shutil.copy("set.toml", "again.toml")
    out = run("markerset merge set.toml again.toml -o both.toml", capsys)
    assert "subjects" in out
    assert am.MarkerSet.from_toml("both.toml").n_subjects == 2
    assert "none" in run("markerset check both.toml person.csv", capsys)
    truth = am.io.read_tracks("person.csv")
    names = list(truth.names)
    a, b = names.index("LTOE"), names.index("RTOE")
    names[a], names[b] = names[b], names[a]
    wrong = am.Tracks(detections=truth.detections, labels=truth.labels, names=tuple(names))
    am.write(wrong, "wrong.csv")
    assert main(["markerset", "check", "both.toml", "wrong.csv", "--json"]) == 1
    conflicts = json.loads(capsys.readouterr().out)["conflicts"]
    assert {(one["name"], one["found"]) for one in conflicts} == {
        ("LTOE", "RTOE"),
        ("RTOE", "LTOE"),
    }


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("markerset learn in.csv -o x.toml", "a capture with named markers"),
        ("markerset learn truth.csv -o truth.csv", "a name ending in .toml"),
        ("markerset show none.toml", "none.toml"),
        ("markerset merge set.toml none.toml -o x.toml", "none.toml"),
        ("name in.csv --markers set.toml -o out.csv", "asterism track"),
        ("name truth.csv --markers none.toml -o out.csv", "none.toml"),
        ("name truth.csv --markers in.csv -o out.csv", "--markers: expected a capture with named"),
        ("name truth.csv --markers set.toml -o set.toml", "a name ending in .c3d"),
        ("name bare.csv -o out.csv", "--markers: expected a marker set"),
    ],
)
def test_what_marker_sets_and_naming_refuse(scene, capsys, line, says):
    truth = am.io.read_tracks("truth.csv")
    am.learn_marker_set(truth).to_toml("set.toml")
    am.write(am.Tracks(detections=truth.detections, labels=truth.labels), "bare.csv")
    assert says in refused(line, capsys)
