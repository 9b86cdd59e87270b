"""Mistakes that a newcomer makes: each is told in one message that says what to do."""

from __future__ import annotations

import importlib
import logging
import shutil

import numpy as np
import pytest

import asterism as am
from asterism.cli import main

TRUTH = am.simulate.cube(seed=1)
D = TRUTH.detections
MODEL = am.TrackingModel(
    motion=am.DWNA(acceleration_sigma=1.0, velocity_sigma=1.0),
    sensor=am.Sensor(noise_sigma=0.001, p_detection=0.9, clutter_density=0.1),
    population=am.Population(birth_density=0.1, p_disappear=0.01, max_speed=5, max_gap=5),
)
RIG = am.Rig.ring(2, radius=3, height=2)

MISTAKES = {
    "a name for a method": (
        lambda: am.track(D, "gn"),
        "Did you mean 'gnn'?",
    ),
    "a class for a method": (
        lambda: am.track(D, am.GNN, stitch=True), "method: .*found the class GNN",
    ),
    "tracks for points": (
        lambda: am.track(TRUTH),
        "detections: expected Detections, found Truth. Try its .detections.",
    ),
    "points for tracks": (
        lambda: am.evaluate(D, TRUTH),
        "tracks: expected Tracks, found Detections. Try am.track(detections).",
    ),
    "a stitching for its tracks": (
        lambda: am.evaluate(am.stitch(TRUTH, MODEL), TRUTH),
        "tracks: expected Tracks, found Stitching. Try its .tracks.",
    ),
    "an estimate for its model": (
        lambda: am.track(D, am.GNN(), model=am.estimate_model(D)),
        "model: expected a TrackingModel, found ModelEstimate. Try its .model.",
    ),
    "arguments the wrong way round": (
        lambda: am.log_posterior(MODEL, TRUTH),
        "tracks: expected Tracks, found TrackingModel. Try am.track(detections).",
    ),
    "a file's name for what it holds": (
        lambda: am.evaluate(TRUTH, "truth.c3d"),
        "truth: expected Tracks, found 'truth.c3d'. Try am.io.read_tracks(path).",
    ),
    "no model for a stream": (lambda: am.GNN().init(None), "model: expected a TrackingModel"),
    "no model for a smoother": (
        lambda: am.filter.smooth_states(TRUTH, None), "model: expected a TrackingModel",
    ),
    "points to a picture of tracks": (lambda: am.plot.plot_presence(D), "tracks: expected Tracks"),
    "points to a picture in space": (
        lambda: am.plot.plot_trajectories(D), "tracks: expected Tracks",
    ),
    "points to a picture over time": (lambda: am.plot.plot_axes(D), "tracks: expected Tracks"),
    "points to a picture of errors": (
        lambda: am.plot.plot_errors(TRUTH, D), "truth: expected Tracks",
    ),
    "a camera for a rig": (lambda: am.plot.plot_rig(RIG[0]), "rig: expected a Rig, found Camera"),
    "a rig for a picture": (
        lambda: am.plot.plot_image(RIG, 3), "camera: expected a Camera, found Rig",
    ),
    "a number for what a camera sees": (
        lambda: am.plot.plot_image(RIG[0], 3),
        "projection: expected a Projection, found int. Try camera.project(points).",
    ),
    "a rig for a lens": (lambda: am.plot.plot_lens(RIG), "camera: expected a Camera, found Rig"),
    "a rig for what it covers": (
        lambda: am.plot.plot_coverage(RIG), "expected a Coverage, found Rig",
    ),
    "points for groups": (
        lambda: am.plot.plot_groups(D), "groups: expected GateGroups, found Detec",
    ),
    "a film for what was seen": (
        lambda: am.plot.plot_projections(am.simulate.film(TRUTH, RIG), RIG),
        "observations: expected Observations, found Film. Try its .observations.",
    ),
    "a score without a name": (
        lambda: am.plot.plot_compare(am.evaluate(TRUTH, TRUTH)),
        'scores: expected a Mapping, found Evaluation. Try {"a name": am.evaluate(tracks, truth)}.',
    ),
    "tracks for their score": (
        lambda: am.plot.plot_compare({"gnn": TRUTH}),
        "scores: expected an Evaluation by each name, found Truth of gnn",
    ),
    "confidences for a calibration": (
        lambda: am.plot.plot_reliability({"gnn": TRUTH}),
        "expected a CalibrationCurve, found Truth",
    ),
    "a number for a file": (lambda: am.read(3), "path: expected the name of a file, found int"),
    "points for a file": (lambda: am.io.read_tracks(D), "the name of a file, found Detections"),
    "nothing to write to": (lambda: am.write(TRUTH, None), "the name of a file, found NoneType"),
    "a number for a calibration": (lambda: am.read_rig(3), "path: expected the name of a file"),
    "a number for image points": (lambda: am.io.read_observations(3), "path: expected the name of"),
    "a number for a model": (lambda: am.TrackingModel.from_toml(3), "path: expected the name of"),
    "a number for bonds": (
        lambda: am.tracking.Bonds.from_toml(3), "path: expected the name of a file",
    ),
    "a number for a page": (lambda: am.report(TRUTH, 3), "path: expected the name of a file"),
    "no state to go on from": (
        lambda: am.GNN().step(None, 0.0, D.frame(0)),
        "state: expected an EngineState, found NoneType. Try method.init(model).",
    ),
    "no state for mcmcda": (lambda: am.MCMCDA().step(None, 0.0, []), "state: expected an Engine"),
    "a model for a state": (lambda: am.SMP().run(MODEL, D), "state: expected an EngineState"),
    "another method's state": (
        lambda: am.tracking.Stitched().step(am.GNN().init(MODEL), 0.0, []),
        "state: expected a StitchedState, found EngineState. Try method.init(model).",
    ),
    "no state to stitch from": (
        lambda: am.tracking.Stitched().run(None, D), "state: expected a MethodS",
    ),
    "no model to stitch with": (
        lambda: am.tracking.Stitched().init(None), "model: expected a TrackingM",
    ),
    "points to fill": (
        lambda: am.fill_gaps(D), "expected Tracks, found Detections. Try am.track(det",
    ),
    "an estimate to fill with": (
        lambda: am.fill_gaps(TRUTH, model=am.estimate_model(D)),
        "found ModelEstimate. Try its .model.",
    ),
    "points to write as a rig": (lambda: am.io.write_rig(D, "x.toml"), "rig: expected a Rig"),
    "labels of labels": (
        lambda: am.Tracks(detections=TRUTH, labels=TRUTH.labels), "found Truth. Try its .detec",
    ),
    "detections for a capture": (lambda: am.io.describe(D), "capture: expected a Capture"),
    "tracks to estimate from": (lambda: am.estimate_model(TRUTH), "Try its .detections"),
    "a floor of points": (lambda: am.metrics.oracle_tracks(D, 10), "truth: expected Tracks"),
    "points scored as tracks": (
        lambda: am.metrics.point_scores(TRUTH, TRUTH), "points: expected Detec",
    ),
    "a number for a seeing": (
        lambda: am.simulate.film(TRUTH, RIG, seeing=5), "seeing: expected a Seeing, found int",
    ),
    "a class for a name": (
        lambda: am.tracking.method_by_name(am.GNN), "method: expected one of gnn",
    ),
    "a page that is no page": (
        lambda: am.report(TRUTH, "x.pdf"), "path: expected a name ending in .html, found 'x.pdf'",
    ),
    "a switch for options": (
        lambda: am.GNN(rigid=True),
        "rigid: expected a Rigidity, found bool. Try am.tracking.Rigidity(), or None",
    ),
}  # fmt: skip


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_is_told(mistake):
    make, says = MISTAKES[mistake]
    with pytest.raises(am.ParameterError) as caught:
        make()
    plain = says.replace(".*", "\0")
    for part in plain.split("\0"):
        assert part in str(caught.value)


def test_a_wrong_method_is_told_before_the_model_is_estimated(monkeypatch):
    def never(*_, **__):
        raise AssertionError

    monkeypatch.setattr(importlib.import_module("asterism.tracking.plan"), "estimate_model", never)
    for wrong in ("gn", am.GNN, 3):
        with pytest.raises(am.ParameterError, match="method"):
            am.track(D, wrong)


def test_millimetres_for_metres_are_doubted(caplog):
    spoilt = am.Detections(times=D.times, offsets=D.offsets, points=D.points * 1000)
    with caplog.at_level(logging.WARNING, "asterism"):
        am.estimate_model(D)
        assert not caplog.records
        am.estimate_model(spoilt)
    (told,) = caplog.records
    assert "if these are millimetres, divide them by 1000" in told.getMessage()


def test_a_few_points_far_away_are_not_doubted(caplog):
    # A reflection at infinity is clutter, and no reason to doubt the unit of all others.
    far = np.full((D.n_frames, 1, 3), 1e4)
    frames = [np.concatenate([D.frame(t), far[t]]) if t % 9 == 0 else D.frame(t)
              for t in range(D.n_frames)]  # fmt: skip
    with caplog.at_level(logging.WARNING, "asterism"):
        am.estimate_model(am.Detections.from_frames(D.times, frames))
    assert not caplog.records


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """Files that are right, and some that are not, for wrong commands."""
    folder = tmp_path_factory.mktemp("files")
    truth = am.simulate.cube(seed=1, frames=20)
    sensed = am.simulate.corrupt(truth, noise=1e-3, seed=1)
    unnamed = am.Tracks(detections=sensed.detections, labels=[-1] * sensed.detections.n_points)
    am.write(sensed, folder / "truth.csv")
    am.write(unnamed, folder / "in.csv")
    rig = am.Rig.ring(4, radius=5, height=2)
    am.io.write_rig(rig, folder / "rig.toml")
    am.io.write_observations(am.simulate.film(truth, rig).observations, folder / "seen.csv")
    am.learn_bonds(truth).to_toml(folder / "bonds.toml")
    model = MODEL.to_toml(folder / "model.toml")
    (folder / "misspelt.toml").write_text(model.replace("noise_sigma", "noise_sgima"))
    (folder / "bad.toml").write_text("a = [\n")
    (folder / "bad.csv").write_text("frame,x\n1,q,3\n")
    (folder / "folder").mkdir()
    return folder


# A wrong command, how its one line begins, and what it says at last.
WRONG = (
    ("track nowhere.csv", "nowhere.csv: no such file", ""),
    ("track folder", "folder: expected a file", "found a folder"),
    ("track in.csv --method gnnn", "--method: expected", "Did you mean 'gnn'?"),
    (
        "track in.csv --method gnn --option gat=3",
        "--option (method gnn): expected",
        "Did you mean 'gate.probability'?",
    ),
    (
        "track in.csv --method smp --option proposers=trakcs",
        "--option proposers: expected",
        "Did you mean 'tracks'?",
    ),
    (
        "track in.csv --method gnn --option lifecycle.delete_odds=0",
        "--option lifecycle.delete_odds: expected a number > 1",
        "found 0",
    ),
    (
        "track in.csv --method gnn --option lifecycle.delete_odds",
        "--option: expected NAME=VALUE for method gnn",
        "found 'lifecycle.delete_odds'",
    ),
    ("track in.csv --format c33", "--format: expected", "Did you mean 'c3d'?"),
    (
        "track in.csv -o x.zip",
        "--out: expected a name ending in .c3d, .trc, .csv, .tsv",
        "found x.zip. Or give --format.",
    ),
    (
        "track in.csv --model bad.toml",
        "bad.toml: the file: expected TOML",
        "found Invalid value (at end of document)",
    ),
    (
        "track in.csv --model misspelt.toml",
        "misspelt.toml: model.sensor: expected",
        "Did you mean 'noise_sigma'?",
    ),
    ("track in.csv --model folder", "folder: expected a model file", "found a folder"),
    ("track --from folder", "folder: expected a run.toml", "found a folder"),
    (
        "track --from bad.toml",
        "bad.toml: the file: expected TOML",
        "found Invalid value (at end of document)",
    ),
    ("track in.csv --seed q", "--seed: expected a whole number", "found 'q'"),
    ("track in.csv --seed -1", "--seed: expected a whole number ≥ 0", "found -1"),
    ("track in.csv --start", "--start: expected a capture with tracks", "found none in in.csv"),
    (
        "track in.csv --run in.csv",
        "--run: expected a place of its own",
        "found in.csv, the input in.csv",
    ),
    ("track in.csv --report x.pdf", "--report: expected a name ending in .html", "found x.pdf"),
    ("track", "IN: expected a capture to track", "found nothing. See asterism track --help."),
    (
        "stitch in.csv -o x.csv",
        "IN: expected a capture with tracks",
        "found none in in.csv. Run asterism track --stitch first.",
    ),
    ("stitch nowhere.csv -o x.csv", "nowhere.csv: no such file", ""),
    (
        "stitch truth.csv -o x.csv --confirm -1",
        "--confirm: expected a whole number in [2, 100000]",
        "found -1",
    ),
    (
        "stitch truth.csv -o x.csv --ghost-radius -1",
        "--ghost-radius: expected a number in (0, 1e+06)",
        "found -1",
    ),
    (
        "stitch truth.csv -o x.csv --max-hidden 0",
        "--max-hidden: expected a whole number in [1, 1e+09]",
        "found 0",
    ),
    (
        "fill in.csv -o x.csv",
        "IN: expected a capture with tracks",
        "found none in in.csv. Run asterism track first.",
    ),
    (
        "fill truth.csv -o x.trc",
        "--out: expected a format that tells filled points from measu",
        "found x.trc. Or give --unflagged.",
    ),
    (
        "fill truth.csv -o x.csv --longest 0",
        "--longest: expected a number in (0, 1e+09)",
        "found 0",
    ),
    ("fill nowhere.c3d -o x.csv", "nowhere.c3d: no such file", ""),
    (
        "bonds in.csv",
        "IN: expected a capture with tracks",
        "found none in in.csv. Run asterism track first.",
    ),
    ("bonds truth.csv -o x.json", "--out: expected a name ending in .toml", "found x.json"),
    (
        "bonds truth.csv --neighbours 0",
        "--neighbours: expected a whole number in [1, 1000]",
        "found 0",
    ),
    ("bonds folder", "folder: expected a file", "found a folder"),
    (
        "name truth.csv --bonds bad.toml -o x.csv",
        "bad.toml: the file: expected TOML",
        "found Invalid value (at end of document)",
    ),
    (
        "name truth.csv --bonds model.toml -o x.csv",
        'model.toml: format: expected "asterism bonds"',
        "found none. Write one by asterism bonds.",
    ),
    ("name truth.csv --bonds nowhere.toml -o x.csv", "nowhere.toml: no such file", ""),
    (
        "name in.csv --bonds bonds.toml -o x.csv",
        "IN: expected a capture with tracks",
        "found none in in.csv. Run asterism track --stitch first.",
    ),
    ("estimate nowhere.csv", "nowhere.csv: no such file", ""),
    ("estimate in.csv -o x.json", "--out: expected a name ending in .toml", "found x.json"),
    ("methods x", "methods: expected no more arguments", "found 'x'"),
    ("scenes cubee", "SCENE: expected", "Did you mean 'cube'?"),
    ("scenes cube --x", "scenes: expected one of --json, --help", "found '--x'"),
    (
        "evaluate truth.csv in.csv",
        "TRUTH: expected a capture whose markers are labelled",
        "found in.csv, which has no labels. The truth is the seco",
    ),
    ("evaluate truth.csv nowhere.csv", "nowhere.csv: no such file", ""),
    (
        "evaluate truth.csv",
        "TRUTH: expected a value",
        "found nothing. See asterism evaluate --help.",
    ),
    ("report nowhere.csv", "nowhere.csv: no such file", ""),
    ("report truth.csv --up q", "--up: expected one of x, y, z", "found 'q'"),
    ("report truth.csv --rig nowhere.toml", "nowhere.toml: no such file", ""),
    ("report truth.csv -o x.pdf", "--out: expected a name ending in .html", "found x.pdf"),
    ("plot presnce truth.csv", "KIND: expected", "Did you mean 'presence'?"),
    ("plot presence nowhere.csv", "nowhere.csv: no such file", ""),
    (
        "plot presence folder",
        "folder: summary.json: expected a finished run",
        "found no such file. Make one by asterism track --run.",
    ),
    (
        "plot presence truth.csv -o x.gif",
        "--out: expected a name ending in .pdf, .svg or .png",
        "found x.gif",
    ),
    ("plot errors truth.csv", "--truth: expected a file, which errors needs", "found nothing"),
    (
        "plot confidence truth.csv",
        "FILES: expected tracks with a confidence",
        "found truth.csv, which has none. Write one by asterism t",
    ),
    (
        "plot presence truth.csv --rig ring3",
        "--rig: expected nothing for presence",
        "found one. It is for projections, image.",
    ),
    (
        "plot image truth.csv --rig ringg",
        "--rig: expected a calibration, or ring or wall and a number ",
        "found 'ringg', which is neither",
    ),
    (
        "plot image truth.csv --rig ring0",
        "--rig (cameras): expected a whole number in [1, 1000]",
        "found 0",
    ),
    ("plot image truth.csv --rig ring3 --frame 999", "--frame: expected 1 to 20", "found 999"),
    ("plot lens rig.toml --camera camm1", "--camera: expected", "Did you mean 'cam1'?"),
    ("plot lens rig.toml --camera cam9", "--camera: expected", "Did you mean 'cam4'?"),
    ("plot posterior truth.csv --moves -1", "--moves: expected a number in [0, 1e+06]", "found -1"),
    (
        "plot posterior truth.csv --seeds 0",
        "--seeds: expected a whole number in [1, 1000]",
        "found 0",
    ),
    ("plot presence truth.csv in.csv", "FILES: expected one file for presence", "found 2"),
    ("view nowhere.csv", "nowhere.csv: no such file", ""),
    ("view truth.csv --save x.txt", "--save: expected a name ending in .rrd", "found x.txt"),
    (
        "view truth.csv --rig rig9",
        "--rig: expected a calibration, or ring or wall and a number ",
        "found 'rig9', which is neither",
    ),
    (
        "corrupt in.csv -o x.csv --truth y.csv",
        "IN: expected a capture whose markers are labelled",
        "found in.csv, which has no labels",
    ),
    (
        "corrupt truth.csv -o x.csv",
        "--truth: expected a value",
        "found nothing. See asterism corrupt --help.",
    ),
    (
        "corrupt truth.csv -o x.csv --truth y.csv --missing 2",
        "--missing: expected a number in [0, 1]",
        "found 2",
    ),
    (
        "corrupt truth.csv -o x.csv --truth y.csv --burst 5-6",
        "--burst: expected N or N:MIN-MAX, 5:5-60 say",
        "found '5-6'",
    ),
    (
        "corrupt truth.csv -o x.csv --truth y.csv --burst 5:9-3",
        "--burst (longest): expected a whole number ≥ 9",
        "found 3",
    ),
    (
        "corrupt truth.csv -o x.csv --truth y.csv --corrupt mising=1",
        "--corrupt (what goes wrong): expected",
        "Did you mean 'missing'?",
    ),
    (
        "corrupt truth.csv -o x.csv --truth y.csv --corrupt jitter=5",
        "--corrupt jitter: expected a number in [0, 1)",
        "found 5.0",
    ),
    (
        "corrupt truth.csv -o x.csv --truth y.csv --stride 0",
        "--stride: expected a whole number ≥ 1",
        "found 0",
    ),
    (
        "corrupt truth.csv -o x.csv --truth y.csv --corrupt visits=5",
        "--corrupt visits: expected MIN-MAX, 50-200 say",
        "found '5'",
    ),
    ("simulate cubee -o x.csv", "SCENE: expected", "Did you mean 'cube'?"),
    (
        "simulate cube -o x.csv --option sped=3",
        "--option (scene cube): expected",
        "Did you mean 'speed'?",
    ),
    ("simulate cube -o x.csv --option speed=q", "--option speed: expected a number", "found 'q'"),
    ("simulate cube -o x.csv --frames 0", "--frames: expected a whole number ≥ 1", "found 0"),
    (
        "simulate cube -o x.csv --markers 3",
        "--markers: expected nothing: cube has its own number",
        "found 3",
    ),
    (
        "simulate person -o x.csv --option activity=walkk",
        "--option activity: expected",
        "Did you mean 'walk'?",
    ),
    (
        "simulate cube -o x.csv --corrupt noise=1",
        "--truth: expected a file for the truth, as --corrupt or --rig ",
        "found none. Without it no file would hold the true label",
    ),
    (
        "simulate cube -o x.zip",
        "--out: expected a name ending in .c3d, .trc, .csv, .tsv, .lo",
        "found 'x.zip'. Or name the format.",
    ),
    ("simulate cube", "--out: expected a value", "found nothing. See asterism simulate --help."),
    ("demo -o in.csv", "--out: expected a folder or a new name", "found the file in.csv"),
    ("demo --seed -1", "--seed: expected a whole number ≥ 0", "found -1"),
    ("reproduce --only marrige", "--only: expected", "Did you mean 'marriage'?"),
    ("reproduce --seeds 1", "--seeds: expected a whole number in [2, 1000]", "found 1"),
    ("film cubee --rig ring4 -o d", "CAPTURE: expected", "Did you mean 'cube'?"),
    (
        "film cube --rig rig9 -o d",
        "--rig: expected a calibration, or ring or wall and a number ",
        "found 'rig9', which is neither",
    ),
    (
        "film cube --rig ring4 -o d --seeing noise=3",
        "--seeing (what cameras see): expected",
        "Did you mean 'noise_px'?",
    ),
    (
        "film cube --rig ring4 -o d --seeing noise_px=-1",
        "--seeing noise_px: expected a number ≥ 0",
        "found -1",
    ),
    (
        "film in.csv --rig ring4 -o d",
        "CAPTURE: expected points in tracks",
        "found in.csv, which has none. Run asterism track first: ",
    ),
    (
        "film truth.csv --rig ring4 -o d --frames 3",
        "CAPTURE: expected a scene, as --frames is given",
        "found the file truth.csv",
    ),
    (
        "film cube --rig ring4 -o d --pictures -1",
        "--pictures: expected a whole number in [0, 10000]",
        "found -1",
    ),
    (
        "reconstruct truth.csv --rig rig.toml -o x.csv",
        "truth.csv: line 1: expected the columns frame, time, camera,",
        "found 'frame, time_s, x_m, y_m, z_m, track, name'",
    ),
    ("reconstruct seen.csv --rig nowhere.toml -o x.csv", "nowhere.toml: no such file", ""),
    (
        "reconstruct seen.csv --rig rig.toml -o x.csv --min-views 1",
        "--min-views: expected a whole number in [2, 4]",
        "found 1",
    ),
    (
        "reconstruct seen.csv --rig rig.toml -o x.csv --gate 0",
        "--gate: expected a number > 0",
        "found 0",
    ),
    (
        "reconstruct seen.csv --rig rig.toml -o x.csv --threads 0",
        "--threads: expected a whole number in [1, 1024]",
        "found 0",
    ),
    ("reconstruct nowhere.csv --rig rig.toml -o x.csv", "nowhere.csv: no such file", ""),
    ("chain cubee", "SCENE: expected", "Did you mean 'cube'?"),
    ("chain cube --method gnnn", "--method: expected", "Did you mean 'gnn'?"),
    (
        "chain cube --rig rig9",
        "--rig: expected a calibration, or ring or wall and a number ",
        "found 'rig9', which is neither",
    ),
    (
        "chain cube --seeing nois=3",
        "--seeing (what cameras see): expected",
        "Did you mean 'noise_px'?",
    ),
    ("camera info nowhere.toml", "nowhere.toml: no such file", ""),
    (
        "camera info bad.toml",
        "bad.toml: its text: expected TOML",
        "found Invalid value (at end of document)",
    ),
    ("camera info rig.toml --from xcpp", "--from: expected", "Did you mean 'xcp'?"),
    ("camera info rig.toml --units inchs", "--units: expected one of mm, cm, m", "found 'inchs'"),
    (
        "camera convert rig.toml x.zip",
        "OUT: expected a name ending in .toml, .yml, .yaml, .qca.txt,",
        "found 'x.zip'. Or name the format: flydra and myptv are ",
    ),
    ("camera convert rig.toml x.toml --format rigg", "--format: expected", "Did you mean 'rig'?"),
    ("camera convert rig.toml x.toml --lens bown", "--lens: expected", "Did you mean 'brown'?"),
    ("camera check rig.toml --points nowhere.csv", "nowhere.csv: no such file", ""),
    ("camera check rig.toml --max-px 0", "--max-px: expected a number > 0", "found 0"),
    (
        "camera map rig.toml --low 1,2,3",
        "--low: expected both --low and --high, or neither",
        "found one of them",
    ),
    (
        "camera map rig.toml --low 1,2 --high 1,2,3",
        "--low: expected X,Y,Z in metres",
        "found '1,2'",
    ),
    ("camera map rig.toml --spacing -1", "--spacing: expected a number > 0", "found -1"),
    ("camera infoo x", "camera: expected", "Did you mean 'info'?"),
    ("trak x", "COMMAND: expected", "Did you mean 'track'?"),
    ("--versio", "COMMAND: expected", "Did you mean '--version'?"),
)


@pytest.mark.parametrize(("line", "begins", "ends"), WRONG, ids=[line for line, *_ in WRONG])
def test_a_wrong_command_is_told_in_one_line(
    files, tmp_path, monkeypatch, capsys, line, begins, ends
):
    shutil.copytree(files, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    before = sorted(tmp_path.rglob("*"))
    assert main(line.split()) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith(f"asterism: {begins}")
    assert ends in err
    assert err.count("\n") == 1
    assert ".part" not in err
    assert sorted(tmp_path.rglob("*")) == before
