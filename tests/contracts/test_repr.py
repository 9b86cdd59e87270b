"""The ``repr`` of every public object: one short line that says what it is."""

from __future__ import annotations

import dataclasses
import importlib
import inspect
from pathlib import Path

import numpy as np
import pytest

import asterism as am
from asterism.errors import SinkError, SourceError, SourceLost
from asterism.records import MAX_REPR, record
from asterism.tracking.pipeline import without_edits

NAMESPACES = (
    "asterism", "asterism.simulate", "asterism.camera", "asterism.model", "asterism.filter",
    "asterism.tracking.methods", "asterism.tracking", "asterism.multiview", "asterism.solve",
    "asterism.metrics", "asterism.io", "asterism.io.calibrations", "asterism.plot",
    "asterism.reporting", "asterism.batch", "asterism.sweep", "asterism.large", "asterism.live",
    "asterism.errors",
)  # fmt: skip


def public():
    """Every public class, by its name."""
    found = {}
    for name in NAMESPACES:
        module = importlib.import_module(name)
        found |= {
            n: getattr(module, n) for n in module.__all__ if inspect.isclass(getattr(module, n))
        }
    return found


PUBLIC = public()
# Contracts that other classes fill, and the base of the lists of what can be chosen.
ABSTRACT = {name for name, kind in PUBLIC.items() if inspect.isabstract(kind)} | {
    "Motion", "Sink", "Source",
}  # fmt: skip
LONG = "a name that is much longer than any that people would give a camera or a marker " * 5


def instances():
    """Objects of all public classes: large ones, and options that all differ from the defaults."""
    rng = np.random.default_rng(1)
    truth = am.simulate.person(frames=30, seed=1)
    d = truth.detections
    capture = am.Capture.from_frames(d.times, [d.frame(t) for t in range(d.n_frames)])
    capture = dataclasses.replace(capture, path=Path(f"{LONG}.c3d"))
    plain = am.TrackingModel(
        motion=am.DWNA(acceleration_sigma=20 / 3, velocity_sigma=1 / 3),
        sensor=am.Sensor(
            noise_sigma=1 / 3000,
            p_detection=0.9 + 1 / 37,
            clutter_density=1 / 7,
            p_redetection=1 / 3,
        ),
        population=am.Population(
            birth_density=1 / 7, p_disappear=1 / 300, max_speed=16 / 3, max_gap=50
        ),
    )
    motions = tuple(am.DWNA(acceleration_sigma=a, velocity_sigma=1 / 3) for a in (1 / 7, 3.1, 30.7))
    several = am.InteractingMotions(models=motions, transitions=np.full((3, 3), 1 / 3))
    model = dataclasses.replace(plain, motion=several)
    rig = am.Rig.ring(30, radius=4, height=2)
    film = am.simulate.film(truth, rig)
    marker_set = am.learn_marker_set(truth)
    tracks = am.track(d, am.JPDA(), model=plain)
    aligned = am.metrics.align(tracks, truth)
    labels = aligned.labels, aligned.truth_labels
    by_frame = (*labels, aligned.frame_of)
    state, update = am.GNN().step(am.GNN().init(plain), 0.0, d.frame(0))
    space = am.multiview.triangulation_map(rig, (-1, -1, 0), (1, 1, 1))
    made = am.reconstruct(film.observations, rig)
    polygon = am.camera.Polygon(corners=[[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], name=LONG)
    gap = am.tracking.FilledGap(
        track=3, first=10, last=20, seconds=1 / 3, weights={"smoother": 1 / 3, "body": 2 / 3},
        rms={"smoother": 1 / 300, "body": 1 / 300}, n_windows=7, std=1 / 300, n_neighbours=5,
        reason="",
    )  # fmt: skip
    changed = {
        "gate": am.tracking.Gate(probability=1.23456789e-7),
        "lifecycle": am.tracking.Lifecycle(confirm_probability=0.987654, delete_odds=1e5 / 3),
        "rigid": am.tracking.Rigidity(max_gap=12345),
        "window": 5, "max_states": 777,
        "prune_odds": 1e5 / 3, "new_track_odds": 1e5 / 3, "max_hypotheses": 77,
        "merged_within": 1 / 30, "guard": False,
    }  # fmt: skip
    methods = []
    for kind in am.tracking.METHODS.values():
        known = {f.name for f in dataclasses.fields(kind)}
        methods += [kind(), kind(**{k: v for k, v in changed.items() if k in known - {"capacity"}})]
    return [
        *methods, changed["gate"], changed["lifecycle"], changed["rigid"],
        am.tracking.ChainOptions(groups="cells", distance=1 / 3),
        am.tracking.Stitched(), am.tracking.Stitched().init(plain), state, update,
        update.tracks, am.tracking.track_states(truth, model=plain),
        am.tracking.Named(marker_sets=marker_set, method=am.GNN()),
        am.tracking.Named(marker_sets=marker_set, method=am.GNN()).init(plain),
        am.MCMCDA(window=50, moves=12.345, deadline=1 / 3, confidence=12.345, end_odds=123.4,
                  chains=4, threads=2, chain=am.tracking.ChainOptions(
                      ambiguous_within=3.21, bonds=3, ambiguous_share=0.25,
                      proposal="uniform", move_weights="report")),
        plain.motion, several, am.RandomWalk(walk_sigma=1 / 3),
        am.DWPA(increment_sigma=1 / 3, acceleration_prior_sigma=20 / 3),
        am.model.LinearMotion(F=np.eye(3), Q=np.eye(3), H=np.eye(3)[0], step=0.01,
                        prior_covariance=np.eye(3)),
        plain, model, plain.sensor, plain.population, am.estimate_model(d),
        truth, d, capture, tracks, am.io.describe(capture),
        rig, rig[0], dataclasses.replace(rig[0], name=LONG), film, film.projection,
        film.observations, polygon, am.camera.Mesh(vertices=np.eye(3), faces=[[0, 1, 2]]),
        am.camera.Capsule(ends=[[0, 0, 0], [0, 0, 1]], radius=0.1), am.camera.Reason.VISIBLE,
        rig[0].depth_image([polygon]), rig[0].paint([polygon]), am.camera.Face(0, 0),
        am.camera.fit_lens(rig[0], am.camera.BrownConrady), space,
        space.suggestions[0], space.coverage,
        am.multiview.triangulate(np.zeros((30, 4, 2)), rig), made, made.views, made.model,
        am.camera.BrownConrady(k1=1 / 3, k2=1 / 3, p1=1 / 3, p2=1 / 3, k3=1 / 3),
        am.camera.ReportRadial(1 / 3, 1 / 3), am.camera.ViconRadial(1 / 3, 1 / 3, 1 / 3),
        am.camera.QuadraticCorrection(ex=(1 / 3,) * 5, ey=(1 / 3,) * 5),
        am.tracking.choose_method(d, plain), am.stitch(tracks, plain), am.fill_gaps(tracks), gap,
        tracks.recipe, am.tracking.plan_tracking(d, model=plain),
        am.model.Analog(
            names=(LONG, "b"), units=("V", ""), rate=1 / 3, stored=np.zeros((900, 2), np.float32),
            offset=np.zeros(2), scale=np.ones(2),
        ),
        am.model.Event(time=1 / 3, label=LONG, context=LONG),
        am.model.ForcePlate(
            kind=2, corners=rng.normal(size=(4, 3)), origin=rng.normal(size=3), channels=(LONG,) * 6
        ),
        am.model.Gap(track=3, first=10, last=20, seconds=1 / 3),
        am.tracking.learn_bonds(truth), marker_set,
        am.tracking.learn_shared_acceleration(truth, plain),
        am.name_tracks(tracks, marker_set),
        am.tracking.Tracked(tracks=tracks, recipe=tracks.recipe),
        settings := am.batch.Settings(method="smp", options={"window": 3}, model=plain, seed=7),
        job := am.batch.Job(
            source=LONG, name=LONG, output=LONG, format="c3d", settings=settings, markers=(LONG,)
        ),
        am.batch.Planned(job=job, state="failed", reason=LONG),
        outcome := am.batch.Outcome(error=LONG, warnings=(LONG,) * 30),
        study := am.sweep.Study(
            scenes={LONG: {"scene": "cube"}}, methods={LONG: {}}, seeds=tuple(range(50))
        ),
        study.cases()[0],
        am.sweep.Sweep(rows=[{}] * 30, summary=[], scores=(LONG,), n_done_before=0, failed={}),
        am.batch.Batch(out=LONG, planned=(), outcomes={LONG: outcome}),
        am.model.Alternative(track=3, probability=1 / 3, name=LONG),
        am.model.Decision(
            kind="identity", track=3, first=5, last=17, n_detections=9, probability=1 / 3
        ),
        am.model.Edit(kind="name", at=((3, 5),), name=LONG, who=LONG),
        am.tracking.Stretch(
            first=5, last=17, source=3, target=-1, n_detections=9, is_asked=True, group=0
        ),
        am.tracking.Change(
            edit=am.model.Edit(kind="name", at=((3, 5),), name=LONG), detections=np.arange(9),
            before=np.zeros(9), after=np.ones(9), stretch_of=np.zeros(9, dtype=int), stretches=(),
            names={},
        ),
        am.tracking.Correction(truth, plain),
        am.edit.Session(without_edits(tracks.recipe, d), Path(LONG)),
        am.large.LargeTracker(model=plain, tile=1 / 3), am.large.LargeTracker(model=plain).init(),
        am.large.Columns(axes=(LONG, LONG), label=LONG[:70]),
        am.large.DecidedFrame(number=3, labels=np.zeros(9, dtype=int)),
        am.large.LargeRun(
            output=Path(LONG), n_frames=10**6, n_points=10**12, n_tracks=10**9, n_labelled=10**12,
            n_tiles=99, largest_group=99, n_joined=10**9, seconds=1 / 3, frame_seconds=1 / 3,
            model=plain,
        ),
        am.tracking.KeptNames(kept=(LONG,) * 9, moved=(), left_out=(LONG,), conflicts=()),
        am.tracking.NameChange(track=3, first=5, last=17, usual=LONG, name=None),
        am.tracking.NameConflict(name=LONG, first=5, last=17, found=LONG, probability=1 / 3),
        am.tracking.Join(marker=3, last=5, first=17, probability=1 / 3),
        am.tracking.HypothesisCluster(
            targets=np.arange(9), detections=np.arange(90), origins=np.zeros((50, 9), dtype=int),
            probabilities=np.full(50, 1 / 50),
        ),
        am.filter.filter_states(tracks, plain), am.filter.gate_groups(tracks, plain), aligned,
        am.evaluate(tracks, truth), am.metrics.point_scores(made.detections, truth),
        am.metrics.hota_scores(*labels), am.metrics.identity_scores(*labels),
        am.metrics.clear_scores(*by_frame),
        am.metrics.gospa_scores(*by_frame), am.metrics.association_scores(*by_frame),
        am.metrics.calibration_curve(rng.random(50), rng.random(50) < 0.5),
        am.solve.k_best_assignments(rng.random((20, 20)), k=9),
        am.solve.joint_marginals(np.zeros((9, 9)), np.zeros(9)),
        am.solve.assign_multidimensional([[0, 1], [1, 0]], [1 / 3, 2 / 3]),
        am.simulate.Burst(n=3), am.simulate.Ghosts(n=3), am.simulate.Visits(),
        am.simulate.Seeing(noise_px=1 / 3), *am.simulate.SCENES.values(), am.simulate.SCENES,
        *am.io.CAPTURE_FORMATS.values(), am.io.CAPTURE_FORMATS,
        *am.io.CALIBRATION_FORMATS.values(), am.io.CALIBRATION_FORMATS, am.tracking.METHODS,
        am.ParameterError(LONG, LONG, LONG, LONG), am.FormatError(LONG, LONG, LONG, LONG),
        am.SolverLimit(LONG, 3, 2, LONG), am.AsterismError(LONG),
        SourceError(LONG), SourceLost(LONG), SinkError(LONG), am.live.EndOfSource("qtm"),
        update.tracks, am.tracking.track_states(tracks, model=plain),
        am.live.LatencyHistogram(), am.live.LiveRun(source=LONG),
        am.live.SourceFrame(number=1, time=1 / 3, points=d.frame(0), received=1 / 3),
        am.live.StreamHeader(source=LONG, rate=1 / 3, names=(LONG,) * 60),
        am.live.LiveFrame(
            number=1, time=1 / 3, points=d.frame(0), labels=np.zeros(60), names=(LONG,) * 60
        ),
        am.live.ServedFrame(
            number=1, time=1 / 3, markers=d.frame(0), points=d.frame(0), ids=np.arange(60)
        ),
        am.live.QtmServer(names=(LONG,) * 60), am.live.NatNetServer(names=(LONG,) * 60),
    ]  # fmt: skip


@pytest.fixture(scope="module")
def objects():
    return instances()


def test_each_public_class_has_an_instance_here(objects):
    there = {kind.__name__ for value in objects for kind in type(value).__mro__}
    assert set(PUBLIC) - ABSTRACT - there == set()


def test_each_fits_in_a_line(objects):
    for value in objects:
        text = repr(value)
        assert len(text) <= MAX_REPR, text
        assert text.isprintable(), text
        assert " at 0x" not in text, text
        is_short = isinstance(value, am.simulate.Visits) or not dataclasses.is_dataclass(value)
        assert is_short or text.startswith(f"{type(value).__name__}("), text


def test_public_dataclasses_name_a_misspelt_argument():
    for name, kind in PUBLIC.items():
        if dataclasses.is_dataclass(kind) and name not in ABSTRACT:
            with pytest.raises(am.ParameterError, match="xyzzy"):
                kind(xyzzy=1)


def test_the_key_numbers_are_in_it():
    truth = am.simulate.cube(seed=1, frames=20)
    d = truth.detections
    model = am.TrackingModel(
        motion=am.DWNA(acceleration_sigma=20),
        sensor=am.Sensor(noise_sigma=0.0003, p_detection=0.95, clutter_density=0.1),
        population=am.Population(birth_density=0.1, p_disappear=0.01, max_speed=8, max_gap=10),
    )
    state, update = am.GNN().step(am.GNN().init(model), 0.0, d.frame(0))
    film = am.simulate.film(truth, am.Rig.ring(4, radius=4, height=1))
    n = film.observations.n_points
    said = {
        "GNN(lifecycle=Lifecycle(delete_odds=50))": am.GNN(
            lifecycle=am.tracking.Lifecycle(delete_odds=50)
        ),
        "GNN()": am.GNN(),
        "TrackingModel(noise 0.3 mm, P_d 0.95, clutter 0.1/m^D, gaps ≤ 10 frames, "
        "speeds ≤ 8 m/s, DWNA(acceleration_sigma=20))": model,
        "EngineState(3-D, 1 frames and 8 detections taken, 0 tracks so far)": state,
        "Update(8 detections, 0 in tracks, 0 earlier labels revised)": update,
        f"Film(4 cameras, 20 frames, 8 markers, {n} image points)": film,
        "Truth(8 tracks, 160 detections in them, 0 clutter, 20 frames)": truth,
        "8 by name: gnn, smp, jpda, splitting, tomht, mda, mht, mcmcda": am.tracking.METHODS,
    }
    assert list(said) == [repr(value) for value in said.values()]


@record
class Record:
    """Three fields, two of them optional."""

    first: int
    second_length: float = 2.0
    third: tuple[int, ...] = ()


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: Record(firstt=1), "Record: expected one of first, second_length, third, found "
         "'firstt'. Did you mean 'first'?"),
        (lambda: Record(first=1, lngth=1), "Did you mean 'second_length'?"),
        (lambda: Record(), "Record.first: expected a value, found nothing"),
        (lambda: Record(1), "expected options by name, found 1 without one. Write Record(first=…)"),
        (lambda: am.GNN(gatee=3), "Did you mean 'gate'?"),
        (
            lambda: am.camera.BrownConrady(1, 2, 3, 4, 5, 6),
            "expected 5 values without a name, found 6",
        ),
        (lambda: am.camera.BrownConrady(1, k1=2), "BrownConrady.k1: expected one value, found two"),
        (lambda: dataclasses.replace(am.tracking.Lifecycle(), delete_ods=5),
         "Did you mean 'delete_odds'?"),
    ],
)  # fmt: skip
def test_a_misspelt_argument_is_named(make, says):
    with pytest.raises(am.ParameterError) as caught:
        make()
    assert says in str(caught.value)


def test_errors_within_a_constructor_stay_as_they_are():
    @record
    class Broken:
        value: int

        def __post_init__(self):
            raise TypeError("of its own")

    with pytest.raises(TypeError, match="of its own"):
        Broken(value=1)
