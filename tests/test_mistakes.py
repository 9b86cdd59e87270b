"""Mistakes that a newcomer makes: each is told in one message that says what to do."""

from __future__ import annotations

import importlib
import logging

import numpy as np
import pytest

import asterism as am

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
        lambda: am.track(D, "gnn"),
        "method: expected a Method, got 'gnn' (try am.GNN(), or am.method_by_name(\"gnn\"))",
    ),
    "a class for a method": (lambda: am.identify(D, am.GNN), "method: .*got the class GNN"),
    "tracks for points": (
        lambda: am.track(TRUTH),
        "detections: expected Detections, got Truth (try its .detections)",
    ),
    "points for tracks": (
        lambda: am.write(D, "x.csv"),
        "tracks: expected Tracks, got Detections (try am.track(detections))",
    ),
    "a stitching for its tracks": (
        lambda: am.evaluate(am.stitch(TRUTH, MODEL), TRUTH),
        "tracks: expected Tracks, got Stitching (try its .tracks)",
    ),
    "an estimate for its model": (
        lambda: am.track(D, am.GNN(), model=am.estimate_model(D)),
        "model: expected a TrackingModel, got ModelEstimate (try its .model)",
    ),
    "arguments the wrong way round": (
        lambda: am.log_posterior(MODEL, TRUTH),
        "tracks: expected Tracks, got TrackingModel (try am.track(detections))",
    ),
    "a file's name for what it holds": (
        lambda: am.evaluate(TRUTH, "truth.c3d"),
        "truth: expected Tracks, got 'truth.c3d' (try am.read_tracks(path))",
    ),
    "no model for a stream": (lambda: am.GNN().init(None), "model: expected a TrackingModel"),
    "no model for a smoother": (lambda: am.smooth(TRUTH, None), "model: expected a TrackingModel"),
    "points to a picture of tracks": (lambda: am.plot_presence(D), "tracks: expected Tracks"),
    "points to a picture in space": (lambda: am.plot_trajectories(D), "tracks: expected Tracks"),
    "points to a picture over time": (lambda: am.plot_axes(D), "tracks: expected Tracks"),
    "points to a picture of errors": (lambda: am.plot_errors(TRUTH, D), "truth: expected Tracks"),
    "a camera for a rig": (lambda: am.plot_rig(RIG[0]), "rig: expected a Rig, got Camera"),
    "a rig for a picture": (lambda: am.plot_image(RIG, 3), "camera: expected a Camera, got Rig"),
    "a number for what a camera sees": (
        lambda: am.plot_image(RIG[0], 3),
        "projection: expected a Projection, got int (try camera.project(points))",
    ),
    "a rig for a lens": (lambda: am.plot_lens(RIG), "camera: expected a Camera, got Rig"),
    "a rig for what it covers": (lambda: am.plot_coverage(RIG), "expected a Coverage, got Rig"),
    "points for groups": (lambda: am.plot_groups(D), "groups: expected GateGroups, got Detec"),
    "a film for what was seen": (
        lambda: am.plot_projections(am.simulate.film(TRUTH, RIG), RIG),
        "observations: expected Observations, got Film (try its .observations)",
    ),
    "a score without a name": (
        lambda: am.plot_compare(am.evaluate(TRUTH, TRUTH)),
        'scores: expected a Mapping, got Evaluation (try {"a name": am.evaluate(tracks, truth)})',
    ),
    "tracks for their score": (
        lambda: am.plot_compare({"gnn": TRUTH}),
        "scores: expected an Evaluation by each name, got Truth of gnn",
    ),
    "confidences for a calibration": (
        lambda: am.plot_reliability({"gnn": TRUTH}), "expected a Calibration, got Truth",
    ),
    "a number for a file": (lambda: am.read(3), "path: expected the name of a file, got int"),
    "points for a file": (lambda: am.read_tracks(D), "path: expected the name of a file, got Dete"),
    "nothing to write to": (lambda: am.write(TRUTH, None), "the name of a file, got NoneType"),
    "a number for a calibration": (lambda: am.read_rig(3), "path: expected the name of a file"),
    "a number for image points": (lambda: am.read_observations(3), "path: expected the name of"),
    "a number for a model": (lambda: am.TrackingModel.from_toml(3), "path: expected the name of"),
    "a number for bonds": (lambda: am.Bonds.from_toml(3), "path: expected the name of a file"),
    "a number for a page": (lambda: am.report(TRUTH, 3), "path: expected the name of a file"),
    "no state to go on from": (
        lambda: am.GNN().step(None, 0.0, D.frame(0)),
        "state: expected an EngineState, got NoneType (try method.init(model))",
    ),
    "no state for mcmcda": (lambda: am.MCMCDA().step(None, 0.0, []), "state: expected an Engine"),
    "a model for a state": (lambda: am.SMP().run(MODEL, D), "state: expected an EngineState"),
    "another method's state": (
        lambda: am.Stitched().step(am.GNN().init(MODEL), 0.0, []),
        "state: expected a StitchedState, got EngineState (try method.init(model))",
    ),
    "no state to stitch from": (lambda: am.Stitched().run(None, D), "state: expected a MethodS"),
    "no model to stitch with": (lambda: am.Stitched().init(None), "model: expected a TrackingM"),
    "points to fill": (lambda: am.fill(D), "expected Tracks, got Detections (try am.track(det"),
    "an estimate to fill with": (
        lambda: am.fill(TRUTH, model=am.estimate_model(D)), "got ModelEstimate (try its .model)",
    ),
    "points to write as a rig": (lambda: am.write_rig(D, "x.toml"), "rig: expected a Rig"),
    "labels of labels": (
        lambda: am.Tracks(detections=TRUTH, labels=TRUTH.labels), "got Truth (try its .detections)",
    ),
    "detections for a capture": (lambda: am.describe(D), "capture: expected a Capture"),
    "tracks to estimate from": (lambda: am.estimate_model(TRUTH), "try its .detections"),
    "a floor of points": (lambda: am.floor(D, 10), "truth: expected Tracks"),
    "points scored as tracks": (lambda: am.point_scores(TRUTH, TRUTH), "points: expected Detec"),
    "a number for a seeing": (
        lambda: am.simulate.film(TRUTH, RIG, seeing=5), "seeing: expected a Seeing, got int",
    ),
    "a class for a name": (lambda: am.method_by_name(am.GNN), "method: expected one of gnn"),
    "a page that is no page": (
        lambda: am.report(TRUTH, "x.pdf"), "path: expected a name ending in .html, got 'x.pdf'",
    ),
    "an option without effect": (
        lambda: am.GNN(max_carried=5),
        "max_carried: expected bodies=True beside it, got 5 alone (it has no effect",
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

    for module in ("automatic", "identify"):
        home = importlib.import_module(f"asterism.label.{module}")
        monkeypatch.setattr(home, "estimate_model", never)
    for run in (am.track, am.identify):
        with pytest.raises(am.ParameterError, match="method"):
            run(D, "gnn")


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
