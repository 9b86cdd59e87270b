"""Mistakes of a new user: each raises one message that says what to do."""

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
    "a number for a marker set": (
        lambda: am.MarkerSet.from_toml(3), "path: expected the name of a file",
    ),
    "no marker set": (
        lambda: am.name_tracks(am.Tracks(detections=D, labels=TRUTH.labels)),
        "marker_sets: expected a marker set, or a capture with names",
    ),
    "tracks for a marker set": (
        lambda: am.name_tracks(TRUTH, TRUTH), "marker_sets: expected a MarkerSet",
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
    too_large = am.Detections(times=D.times, offsets=D.offsets, points=D.points * 1000)
    with caplog.at_level(logging.WARNING, "asterism"):
        am.estimate_model(D)
        assert not caplog.records
        am.estimate_model(too_large)
    (warning,) = caplog.records
    assert "expected metres; divide millimetres by 1000" in warning.getMessage()


def test_a_few_points_far_away_are_not_doubted(caplog):
    # A reflection at infinity is clutter, and no reason to doubt the unit of all others.
    far = np.full((D.n_frames, 1, 3), 1e4)
    frames = [np.concatenate([D.frame(t), far[t]]) if t % 9 == 0 else D.frame(t)
              for t in range(D.n_frames)]  # fmt: skip
    with caplog.at_level(logging.WARNING, "asterism"):
        am.estimate_model(am.Detections.from_frames(D.times, frames))
    assert not caplog.records
