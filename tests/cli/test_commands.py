"""The command line from the inside: what it writes, prints and refuses."""

from __future__ import annotations

import csv
import dataclasses
import json
import re
import tomllib
from pathlib import Path

import numpy as np
import pytest

import asterism as am
from asterism.cli import main
from tests.cli.runs import printed, refused, run


def test_bursts_of_missed_detections_are_made_and_estimated(scene, capsys):
    run("simulate person -o p.csv --frames 160 --seed 1", capsys)
    line = "corrupt p.csv -o a.csv --truth t.csv --missing 0.15 --corrupt missing_run=4"
    made = json.loads(run(f"{line} --noise 0.0003 --json", capsys))
    assert made["corruption"]["missing_run"] == 4.0
    found = json.loads(run("estimate a.csv --bursts --json", capsys))
    assert found["model"]["sensor"]["p_redetection"] == pytest.approx(0.25, abs=0.05)
    run("estimate a.csv --bursts -o runs.toml", capsys)
    run("track a.csv --method gnn --model runs.toml -o b.csv", capsys)
    assert "missing in (0, 1)" in refused(f"{line} --overwrite".replace("0.15", "0"), capsys)


def test_corrupt_forgets_every_name_and_keeps_every_point(scene):
    unnamed, truth = am.read("in.csv"), am.io.read_tracks("truth.csv")
    assert (unnamed.labels == -1).all()
    assert set(truth.names) == {f"M{i:02d}" for i in range(16)}
    np.testing.assert_array_equal(unnamed.points, truth.detections.points)
    assert 0 < (truth.labels == -1).sum() < truth.detections.n_points
    # The order of the points must not tell the markers: in the file of truth they would be sorted.
    first = truth.labels[: truth.detections.offsets[1]]
    assert (np.diff(first) < 0).any()


@pytest.mark.parametrize("ending", ["c3d", "trc", "csv", "tsv"])
def test_corrupt_track_evaluate_in_every_format(scene, capsys, ending):
    options = "--missing 0.1 --clutter 0.1 --noise 0.0003 --seed 1 -q"
    run(f"corrupt scene.csv -o a.{ending} --truth t.{ending} {options}", capsys)
    run(f"track a.{ending}", capsys)
    scores = json.loads(run(f"evaluate a.tracked.{ending} t.{ending} --json", capsys))
    assert scores["idf1"] > 0.99
    assert scores["n_markers"] == 16
    # Formats that cannot mark clutter must not turn every point of it into a track.
    assert scores["n_tracks"] <= 18
    assert scores["clutter_labelled_percent"] < 5


def test_track_says_what_it_did(scene, capsys):
    text = run("track in.csv -o out.csv", capsys)
    for word in ("noise σ", "likelihood", "detections labelled", "longest gaps", "frames/s"):
        assert word in text
    tracks = am.io.read_tracks("out.csv")
    assert f"tracks               {tracks.n_tracks}" in text
    assert run("track in.csv -o out.csv --overwrite --quiet", capsys) == ""


def test_track_gives_the_same_as_the_library(scene, capsys):
    run("track in.csv -o out.csv --method smp --option proposers=detections", capsys)
    capture = am.read("in.csv")
    expected = am.track(capture, am.SMP(proposers="detections"))
    np.testing.assert_array_equal(am.io.read_tracks("out.csv").labels, expected.labels)


def test_summary_as_json(scene, capsys):
    summary = json.loads(
        run("track in.csv --method gnn --model model.toml -o out.csv --json", capsys)
    )
    tracks = am.io.read_tracks("out.csv")
    assert summary["n_tracks"] == tracks.n_tracks
    assert summary["n_clutter"] == (tracks.labels == -1).sum()
    assert summary["n_labelled"] + summary["n_clutter"] == summary["n_detections"]
    model = am.TrackingModel.from_dict(summary["model"])
    assert model.population.max_gap > 0
    assert summary["log_posterior"] == pytest.approx(am.log_posterior(tracks, model), rel=1e-12)
    gap = summary["longest_gaps"][0]
    frames = tracks.detections.frame_of[tracks.labels == gap["track"]] + 1
    assert not np.isin(np.arange(gap["first"], gap["last"] + 1), frames).any()
    assert np.isin([gap["first"] - 1, gap["last"] + 1], frames).all()


def test_a_run_is_repeated_bit_for_bit(scene, capsys):
    run("track in.csv --run first --method smp --option lifecycle.delete_odds=100 --seed 5", capsys)
    names = sorted(path.name for path in (scene / "first").iterdir())
    decisions = ["decisions.csv", "decisions.json"]
    assert names == [*decisions, "in.tracked.csv", "log.txt", "run.toml", "summary.json"]
    run("track --from first/run.toml -o again.csv", capsys)
    result = (scene / "first/in.tracked.csv").read_bytes()
    assert (scene / "again.csv").read_bytes() == result
    run("track --from first/run.toml --run second", capsys)
    assert (scene / "second/in.tracked.csv").read_bytes() == result
    for name in decisions:
        assert (scene / "second" / name).read_bytes() == (scene / "first" / name).read_bytes()
    first, second = (
        tomllib.loads((scene / name / "run.toml").read_text()) for name in ("first", "second")
    )
    assert first == second
    assert first["method"]["options"]["lifecycle"]["delete_odds"] == 100
    assert first["method"]["seed"] == 5
    assert {"asterism", "python", "numpy", "scipy", "platform"} <= set(first["versions"])
    assert "tracking in.csv" in (scene / "first/log.txt").read_text()


def test_the_model_file_gives_what_the_estimate_gave(scene, capsys):
    run("track in.csv -o a.csv", capsys)
    run("track in.csv -o b.csv --model model.toml", capsys)
    assert (scene / "a.csv").read_bytes() == (scene / "b.csv").read_bytes()


def test_a_run_is_only_repeated_with_its_input(scene, capsys):
    run("track in.csv --model model.toml --run first", capsys)
    (scene / "in.csv").rename("moved.csv")
    assert "Give its new path" in refused("track --from first/run.toml", capsys)
    run("track moved.csv --from first/run.toml -o again.csv", capsys)
    assert (scene / "again.csv").read_bytes() == (scene / "first/in.tracked.csv").read_bytes()
    text = (scene / "moved.csv").read_text()
    (scene / "moved.csv").write_text(text[: text.rstrip().rindex("\n") + 1])  # a point less
    assert "SHA-256" in refused("track moved.csv --from first/run.toml", capsys)
    assert "--method" in refused("track moved.csv --from first/run.toml --method gnn", capsys)
    assert "--seed" in refused("track moved.csv --from first/run.toml --seed 0", capsys)


def test_other_versions_are_told(scene, capsys):
    run("track in.csv --model model.toml --run first", capsys)
    path = scene / "first/run.toml"
    path.write_text(path.read_text().replace(f'asterism = "{am.__version__}"', 'asterism = "0"'))
    assert main(["track", "--from", "first/run.toml", "-o", "again.csv", "-q"]) == 0
    assert "made with asterism 0" in capsys.readouterr().err


def test_a_full_folder_is_left_alone(scene, capsys):
    run("track in.csv --model model.toml --run first", capsys)
    before = (scene / "first/run.toml").stat().st_mtime_ns
    assert "--overwrite" in refused("track in.csv --run first", capsys)
    assert (scene / "first/run.toml").stat().st_mtime_ns == before
    run("track in.csv --model model.toml --run first --overwrite", capsys)
    assert (scene / "first/run.toml").stat().st_mtime_ns > before
    assert "a folder" in refused("track in.csv --run truth.csv", capsys)


def test_formats_of_the_result(scene, capsys):
    truth = am.io.read_tracks("truth.csv")
    am.write(truth, "a.bin")
    run("track a.bin --model model.toml", capsys)  # a log holds no tracks: CSV does
    am.write(truth, "wide.csv", format="csv-wide")
    run("track wide.csv --model model.toml", capsys)
    assert am.read("wide.tracked.csv").format == "csv-wide"
    run("track in.csv --model model.toml -o b.csv --format csv-wide", capsys)
    assert am.read("b.csv").format == "csv-wide"
    assert am.io.read_tracks("a.tracked.csv").n_tracks >= 16
    run("track in.csv --model model.toml -o b.c3d", capsys)
    assert am.read("b.c3d").n_points == truth.detections.n_points


def test_evaluate_prints_what_the_library_says(scene, capsys):
    run("track in.csv --model model.toml -o out.csv", capsys)
    scores = am.evaluate(am.io.read_tracks("out.csv"), am.io.read_tracks("truth.csv"))
    assert run("evaluate out.csv truth.csv --by-frame frames.csv", capsys) == f"{scores}\n"
    as_json = json.loads(run("evaluate out.csv truth.csv --json", capsys))
    assert as_json["idf1"] == scores.idf1
    with (scene / "frames.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [int(row["wrong"]) for row in rows] == scores.by_frame()["wrong"].tolist()
    assert [float(row["times"]) for row in rows] == scores.times.tolist()


def test_info(scene, capsys):
    text = run("info truth.csv", capsys)
    assert "16" in text
    found = json.loads(run("info in.csv --json", capsys))
    assert found["n_frames"] == 60
    assert found["step_median"] is None  # JSON has no NaN
    am.write(am.io.read_tracks("truth.csv"), "t.c3d")
    raw = bytearray((scene / "t.c3d").read_bytes())
    raw[raw.find(b"POINT") + 0 : raw.find(b"POINT") + 5] = b"PAINT"
    (scene / "odd.c3d").write_bytes(raw)
    (warning,) = json.loads(run("info odd.c3d --json", capsys))["warnings"]
    shown = {
        line: "".join(printed(line, capsys))
        for line in (
            "info odd.c3d",
            "info odd.c3d --json",
            "info odd.c3d --quiet",
            "info odd.c3d truth.csv",
        )
    }
    for line, text in shown.items():
        assert "".join(text.split()).count("".join(warning.split())) == 1, line


def test_methods_and_scenes_are_those_of_the_library(capsys):
    listed = json.loads(run("methods --json", capsys))
    assert list(listed) == ["auto", *am.tracking.METHODS]
    options = listed["smp"]["options"]
    made = am.SMP()
    for name, option in options.items():
        table, _, key = name.partition(".")
        value = getattr(made, table)
        if table == "rigid":
            value = getattr(am.tracking.Rigidity(), key) if key else False
        elif key:
            value = getattr(value, key)
        assert option["default"] == value
    assert {"gate.probability", "proposers", "strict", "capacity", "rigid"} < options.keys()
    assert all(option["about"] for option in options.values())
    text = run("methods", capsys)
    assert "tracks|detections" in text
    assert "A tentative track is deleted when its odds" in text
    assert list(json.loads(run("scenes --json", capsys))) == list(am.simulate.SCENES)


def test_simulate_takes_the_options_of_the_scene(scene, capsys):
    run("simulate smooth -o s.csv --frames 20 --seed 4 --option n_markers=7", capsys)
    expected = am.simulate.smooth(n_markers=7, frames=20, seed=4)
    np.testing.assert_array_equal(am.read("s.csv").points, expected.detections.points)


def test_a_recording_of_a_scene_with_its_truth(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    given = (
        "--corrupt missing=0.2 --corrupt clutter=0.3 --corrupt burst=2:3-6 --corrupt visits=10-20"
    )
    run(
        f"simulate crossing -o in.csv --truth t.csv --frames 40 --rate 100 --seed 3 {given}", capsys
    )
    sensing = {"missing": 0.2, "clutter": 0.3}
    scene = am.simulate.crossing(frames=40, rate=100, seed=3)
    expected = am.simulate.corrupt(
        scene, **sensing, burst=am.simulate.Burst(n=2, shortest=3, longest=6),
        visits=am.simulate.Visits(shortest=10, longest=20), seed=3,
    )  # fmt: skip
    points, truth = am.read("in.csv"), am.io.read_tracks("t.csv")
    np.testing.assert_array_equal(points.points, expected.detections.points)
    np.testing.assert_array_equal(truth.labels, expected.labels)
    assert not any(points.names)
    run("simulate cube -o a.csv --truth b.csv --rig ring4 --json", capsys)
    assert am.read("a.csv").n_points == 800
    for wrong in (
        "simulate cube -o c.csv --corrupt missing=0.1",
        "simulate cube -o c.csv --truth d.csv --corrupt mising=0.1",
        "simulate cube -o c.csv --truth d.csv --corrupt missing=2",
        "simulate cube -o c.csv --truth d.csv --corrupt visits=5",
        "simulate cube -o c.csv --truth d.csv --rig nothing.xcp",
        "simulate cube -o c.csv --markers 9",
        "simulate cube -o c.csv --seed 1 --option seed=4",
        "simulate smooth -o c.csv --markers 9 --option n_markers=8",
        "simulate cube -o c.csv --truth c.csv",
    ):
        assert main(wrong.split()) == 2
        assert not Path("c.csv").exists()


def test_scenes_are_listed_a_line_each(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    lines = run("scenes", capsys).strip().splitlines()
    assert [line.split()[0] for line in lines] == list(am.simulate.SCENES)
    assert "activity" in run("scenes person", capsys)
    assert main(["scenes", "persn"]) == 2
    run("simulate swarm -o s.csv --frames 5 --markers 7", capsys)
    assert am.io.read_tracks("s.csv").n_tracks == 7


def test_help_and_version(capsys):
    assert run("--version", capsys) == f"asterism {am.__version__}\n"
    commands = "track corrupt evaluate info methods estimate simulate film camera scenes demo"
    for command in commands.split():
        assert f"asterism {command}" in run(f"{command} --help", capsys)
    # What stands in brackets is no markup of the help's.
    assert "pip install 'asterism[view]'" in run("view --help", capsys)
    assert "[[" not in run("scenes --help", capsys)


def test_examples_in_the_help_are_indented(capsys):
    # The help's margin is that of its second paragraph on: with nothing but examples there, theirs.

    from asterism.cli.program import command as program

    for command in program.commands:
        lines = run(f"{command} --help", capsys).splitlines()
        examples = [line for line in lines if line.strip().startswith(f"asterism {command} ")]
        indented = [line for line in examples if line.startswith("     asterism")]
        assert indented == examples, command
        assert examples or command in ("methods", "scenes", "camera", "markerset"), command


WRITES = {"-o", "--by-frame"}


@pytest.mark.parametrize("line", [
    "info in.csv",
    "evaluate truth.csv truth.csv",
    "evaluate truth.csv truth.csv --by-frame frames.csv",
    "camera info rig.toml",
    "camera check rig.toml",
    "camera map rig.toml --spacing 1",
])  # fmt: skip
def test_quiet_prints_nothing_and_json_an_object(scene, capsys, line):
    am.io.write_rig(am.Rig.ring(4, radius=4, height=2.5), "rig.toml")
    assert run(line, capsys)
    again = f"{line} --overwrite" if WRITES.intersection(line.split()) else line
    assert run(f"{again} --quiet", capsys) == ""
    assert isinstance(json.loads(run(f"{again} --json", capsys)), dict)


@pytest.mark.parametrize("line", ["methods", "scenes", "info scene.csv", "track in.csv -o a.csv"])
def test_no_line_ends_in_blanks(scene, capsys, line):
    lines = run(line, capsys).splitlines()
    assert len(lines) > 5
    assert not [text for text in lines if text != text.rstrip()]


def test_demo(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    # Shorter than what people see, and drawn for one method: what is written is the same.
    from asterism.cli.commands import demo

    draw = demo._draw
    monkeypatch.setattr(demo, "_N_FRAMES", 60)
    monkeypatch.setattr(demo, "_draw", lambda *a: a[2].name == "gnn" and draw(*a))
    text = run("demo -o one", capsys)
    first = text[text.index("Scores") :].splitlines()[2]
    assert first.split()[0] == "auto"
    assert "one/summary.md" in text
    run("demo -o two -q", capsys)
    names = sorted(str(p.relative_to(tmp_path / "one")) for p in (tmp_path / "one").rglob("*.*"))
    assert "gnn/errors.png" in names
    for name in names:
        if name.endswith((".md", ".csv", ".c3d", "model.toml")):
            one, two = ((tmp_path / folder / name).read_bytes() for folder in ("one", "two"))
            assert one == two, name
    run("track --from one/smp/run.toml -o again.c3d", capsys)
    again = (tmp_path / "again.c3d").read_bytes()
    assert again == (tmp_path / "one/smp/tracked.c3d").read_bytes()
    assert "--overwrite" in refused("demo -o one", capsys)


def test_a_model_that_fits_nothing_is_told_of(scene, capsys):
    model = am.TrackingModel.from_toml("model.toml")
    slow = dataclasses.replace(model.population, max_speed=1e-6)
    sharp = dataclasses.replace(model.sensor, noise_sigma=1e-9)
    dataclasses.replace(model, population=slow, sensor=sharp).to_toml("other.toml")
    assert main(["track", "in.csv", "-o", "out.csv", "--model", "other.toml"]) == 0
    assert "no track was confirmed" in capsys.readouterr().err
    assert main(["track", "in.csv", "-o", "better.csv", "--model", "model.toml"]) == 0
    assert "no track was confirmed" not in capsys.readouterr().err


def test_corrupt_reports_markers_apart_from_unnamed_points(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    truth = am.simulate.cube(seed=1, frames=50)
    labels = truth.labels.copy()
    labels[labels == 7] = -1  # 50 points of clutter
    names = ("A", "B", "C", "D", "E", "F", None, None)  # and 50 of a track without a name
    am.write(am.Tracks(detections=truth.detections, labels=labels, names=names), "in.csv")
    line = "corrupt in.csv -o a.csv --truth t.csv --seed 1"
    figures = json.loads(run(f"{line} --json", capsys))
    assert (figures["n_dropped"], figures["n_unnamed"]) == (0, 100)
    text = run(f"{line} --missing 0.5 --overwrite", capsys)
    n_dropped = 6 * 50 - am.io.read_tracks("t.csv").detections.n_points
    assert 100 < n_dropped < 200
    assert re.search(rf"missed detections +{n_dropped} *\n", text)
    assert re.search(r"unnamed points left out +100 *\n", text)
