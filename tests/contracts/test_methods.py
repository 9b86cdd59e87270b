"""The contract of every method, one table of cases; a new method is one entry in METHODS."""

from __future__ import annotations

import dataclasses
import itertools

import numpy as np
import pytest

import asterism as am
from asterism.tracking import Gate, Lifecycle
from tests.contracts.methods import METHODS, each_method
from tests.references.frame_by_frame import track_by_hand
from tests.references.hypothesis_trees import trees_by_hand
from tests.references.jpda import jpda_by_hand
from tests.scenes import interacting, sized, small_model, wanderers

# The others are held to every partition of small problems instead.
WITH_REFERENCE = {
    name: m
    for name, m in METHODS.items()
    if not isinstance(m, am.TOMHT | am.MDA | am.MHT | am.MCMCDA)
}
each_with_reference = pytest.mark.parametrize("method", WITH_REFERENCE.values(), ids=WITH_REFERENCE)


def stream(method, model, detections, **options):
    state = method.init(model, n_axes=detections.n_axes, **options)
    labels = np.full(detections.n_points, -1)
    confidence = np.full(detections.n_points, np.nan)
    for t, (time, points) in enumerate(detections):
        state, update = method.step(state, time, points)
        frame = slice(detections.offsets[t], detections.offsets[t + 1])
        labels[frame] = update.labels
        labels[update.revised] = update.revised_labels
        if update.confidence is not None:
            confidence[frame] = update.confidence
            confidence[update.revised] = update.revised_confidence
    return state, labels, confidence


def by_hand(method, detections, model) -> np.ndarray:
    if isinstance(method, am.JPDA):
        return jpda_by_hand(detections, method, model)[0]
    if getattr(method, "window", 1) > 1:
        return trees_by_hand(detections, method, model)[0]
    return track_by_hand(detections, method, model)


def same_partition(a: np.ndarray, b: np.ndarray) -> bool:
    """Whether two labellings group alike, whatever the numbers."""
    pairs = np.unique(np.stack([a, b]), axis=1)
    return (
        all(len(np.unique(side)) == pairs.shape[1] for side in pairs) and ((a < 0) == (b < 0)).all()
    )


def test_every_registered_method_is_in_the_table():
    assert {m.name for m in METHODS.values()} == set(am.tracking.METHODS)


@each_method
@pytest.mark.parametrize("n_axes", [2, 3])
@pytest.mark.parametrize("irregular", [False, True])
def test_stream_and_batch_give_identical_labels(method, n_axes, irregular):
    rng = np.random.default_rng(1)
    n_frames = sized(80, 30)
    truth = wanderers(rng, n_axes=n_axes, n_frames=n_frames, clutter=1.5, irregular=irregular)
    model = small_model()
    tracks = am.track(truth.detections, method, model=model)
    state, labels, confidence = stream(method, model, truth.detections)
    assert (tracks.labels == labels).all()
    if isinstance(method, am.GNN | am.SMP | am.MDA):  # the motion model gives theirs at the end
        assert np.isnan(confidence).all()
    else:
        assert (tracks.confidence == confidence).all()
    assert tracks.info == state.info | {"log_posterior": am.log_posterior(tracks, model)}
    assert tracks.n_tracks >= 6


@each_method
def test_a_run_may_be_cut_anywhere(method):
    d = wanderers(np.random.default_rng(2), n_frames=60).detections
    model = small_model()
    whole = am.track(d, method, model=model).labels
    cut = d.offsets[25]
    first = am.Detections(times=d.times[:25], offsets=d.offsets[:26], points=d.points[:cut])
    second = am.Detections(times=d.times[25:], offsets=d.offsets[25:] - cut, points=d.points[cut:])
    state, a, _ = method.run(method.init(model), first)
    state, b, _ = method.run(state, second)
    sure = a >= 0  # a tentative track's first detections may be labelled only after the cut
    assert (whole[:cut][sure] == a[sure]).all()
    assert (whole[cut:] == b).all()
    assert state.n_ids == whole.max() + 1


@each_method
def test_a_step_leaves_the_old_state_as_it_was(method):
    d = wanderers(np.random.default_rng(3), n_frames=30).detections
    state = method.init(small_model())
    for time, points in itertools.islice(d, 20):
        state, _ = method.step(state, time, points)
    forks = [method.step(state, float(d.times[20]), d.frame(20))[1].labels for _ in range(2)]
    other = method.step(state, float(d.times[20]), d.frame(20) + 5.0)[1].labels
    again = method.step(state, float(d.times[20]), d.frame(20))[1].labels
    assert (forks[0] == forks[1]).all()
    assert (again == forks[0]).all()
    assert (other == -1).all()


@each_with_reference
@pytest.mark.parametrize("motion", ["dwna", "interacting"])
@pytest.mark.parametrize("seed", range(2))
def test_the_engine_tracks_as_the_reference_implementation_does(method, motion, seed):
    rng = np.random.default_rng(seed)
    truth = wanderers(rng, n_markers=5, n_frames=30, n_axes=2 + seed % 2, clutter=1.5)
    model = small_model()
    if motion == "interacting":
        model = dataclasses.replace(model, motion=interacting())
    labels = am.track(truth.detections, method, model=model).labels
    assert (labels == by_hand(method, truth.detections, model)).all()
    assert labels.max() >= 3


@each_with_reference
@pytest.mark.parametrize("bound", ["gate", "speed", "odds"])
@pytest.mark.parametrize("seed", range(3))
def test_tight_bounds_are_those_of_the_reference_implementation(method, bound, seed):
    # With bounds so tight that true links are lost, each of them decides.
    rng = np.random.default_rng(100 + seed)
    truth = wanderers(rng, n_markers=5, n_frames=20, clutter=1.5)
    model = small_model(motion=interacting())
    free = am.track(truth.detections, method, model=model).labels
    if bound == "gate":
        method = dataclasses.replace(method, gate=Gate(probability=0.97))
    elif bound == "odds":  # late confirmation, early deletion: the best score of a track decides
        method = dataclasses.replace(
            method, lifecycle=Lifecycle(confirm_probability=1 - 1e-12, delete_odds=1.5)
        )
    else:
        model = small_model(motion=interacting(), max_speed=0.6)
    labels = am.track(truth.detections, method, model=model).labels
    assert (labels == by_hand(method, truth.detections, model)).all()
    assert (labels != free).any()


@each_with_reference
def test_many_points_are_tracked_as_few_are(method):
    # From 64 points on a frame takes the grid; the reference implementation has none.
    rng = np.random.default_rng(4)
    truth = wanderers(rng, n_markers=80, n_frames=6, clutter=20)
    assert np.diff(truth.detections.offsets).min() > 64
    model = small_model(clutter_density=2.0, max_speed=0.5)  # faster, and all would hang together
    labels = am.track(truth.detections, method, model=model).labels
    assert (labels == by_hand(method, truth.detections, model)).all()


@each_method
def test_what_does_not_matter_changes_nothing(method):
    rng = np.random.default_rng(5)
    truth = wanderers(rng, n_frames=50)
    d, model = truth.detections, small_model()
    labels = am.track(d, method, model=model).labels
    rotation, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    moved = am.Detections(
        times=d.times + 12.5, offsets=d.offsets, points=d.points @ rotation.T + [3, -2, 1]
    )
    assert same_partition(am.track(moved, method, model=model).labels, labels)
    order = np.concatenate(
        [rng.permutation(np.arange(a, b)) for a, b in itertools.pairwise(d.offsets)]
    )
    shuffled = am.Detections(times=d.times, offsets=d.offsets, points=d.points[order])
    assert same_partition(am.track(shuffled, method, model=model).labels, labels[order])


@each_method
def test_same_input_same_labels_whatever_the_seed(method):
    d = wanderers(np.random.default_rng(6)).detections
    model = small_model()
    runs = [am.track(d, method, model=model, seed=seed).labels for seed in (1, 1, 2)]
    assert (runs[0] == runs[1]).all()
    assert (runs[0] == runs[2]).all()


@each_method
def test_well_separated_markers_are_never_confused(method):
    truth = wanderers(np.random.default_rng(7), n_markers=4, n_frames=60, missing=0.05, clutter=0.3)
    result = am.evaluate(am.track(truth.detections, method, model=small_model()), truth)
    assert result.idf1 > 0.97
    assert result.switches == 0


@each_method
def test_empty_frames_and_endings(method):
    # A marker is seen for six frames, occluded for as long as the model bridges, then for longer.
    model = small_model(max_gap=4)
    seen = [*range(6), *range(9, 15), *range(19, 25)]
    frames = [[[0.01 * t, 0, 0]] if t in seen else [] for t in range(25)]
    labels = am.track(
        am.Detections.from_frames(np.arange(25) * 0.1, frames), method, model=model
    ).labels
    assert labels.tolist() == [0] * 12 + [1] * 6


@each_with_reference  # multiple hypotheses weigh a long absence against a new marker
def test_a_confirmed_track_may_be_missed_for_max_gap_frames(method):
    # Confirmed soon, then occluded for longer than its own detections could make up for.
    model = small_model(
        motion=am.RandomWalk(walk_sigma=0.02), noise_sigma=3e-4, p_detection=0.999,
        clutter_density=0.05, birth_density=1e-3, max_gap=30,
    )  # fmt: skip
    seen = [0, 1, 2, *range(28, 33)]
    frames = [[[1e-3 * t, 0, 0]] if t in seen else [] for t in range(33)]
    tracks = am.track(am.Detections.from_frames(np.arange(33) * 0.01, frames), method, model=model)
    assert tracks.labels.tolist() == [0] * 8


@each_method
def test_clutter_alone_gives_no_track(method):
    rng = np.random.default_rng(8)
    frames = [rng.uniform(-2, 2, (3, 3)) for _ in range(200)]
    model = small_model(clutter_density=3 / 64, birth_density=1e-4)
    tracks = am.track(am.Detections.from_frames(np.arange(200) * 0.1, frames), method, model=model)
    assert tracks.n_tracks == 0
    assert (tracks.labels == -1).all()


@pytest.mark.parametrize("method", [am.TOMHT, am.MHT, am.MDA], ids=["tomht", "mht", "mda"])
def test_a_detection_that_a_track_expects_begins_no_other(method):
    # A second marker comes up within the gate of the first, and stays there.
    frames = [[[0.1 * t, 0, 0], [0.1 * t, 0.03, 0]][: 1 + (t >= 6)] for t in range(20)]
    d = am.Detections.from_frames(0.1 * np.arange(20), frames)
    model = small_model(noise_sigma=0.01, clutter_density=0.1, birth_density=0.1)
    assert am.track(d, method(), model=model).n_tracks == 2
    assert am.track(d, method(new_track_odds=1e-6), model=model).n_tracks == 1


@each_method
def test_memory_of_an_endless_stream_is_bounded(method):
    rng = np.random.default_rng(9)
    model = small_model(clutter_density=1.0)
    state = method.init(model)
    most = held = 0
    for t in range(sized(1500, 200)):
        points = np.vstack([[[0.0, 0, 0], [1, 0, 0]], rng.uniform(-2, 2, (4, 3))])
        state, update = method.step(state, t * 0.1, points)
        info = update.info
        most = max(most, info["tentative"] if "tentative" in info else info["tracks"])
        held = max(held, info["pending"] if "pending" in info else info["detections"])
    assert 2 <= most < 60
    assert 2 < held < 120
    assert update.info["tracks"] >= 2


@each_method
@pytest.mark.parametrize(
    ("time", "points", "message"),
    [
        (1.0, [[0.0, 0, 0]], "time: expected later than the frame before"),
        (0.5, [[0.0, 0, 0]], "time: expected later than the frame before"),
        (float("nan"), [[0.0, 0, 0]], "time: expected a finite number"),
        (2.0, [[0.0, np.nan, 0]], "points: expected finite numbers, found nan"),
        (2.0, [[0.0, 0]], r"points: expected an array of shape \(n, 3\)"),
        (2.0, [["a", "b", "c"]], "points: .* of numbers"),
    ],
)
def test_a_bad_frame_is_refused_and_the_state_lives_on(method, time, points, message):
    state, _ = method.step(method.init(small_model()), 1.0, [[0.0, 0, 0]])
    with pytest.raises(am.ParameterError, match=message):
        method.step(state, time, points)
    assert method.step(state, 1.1, [[0.0, 0, 0]])[1].labels.shape == (1,)


def test_options_are_checked():
    for wrong in (
        {"gate": {"probability": 0}},
        {"lifecycle": {"confirm_probability": 1.0}},
        {"lifecycle": {"delete_odds": 0.5}},
    ):
        ((table, options),) = wrong.items()
        with pytest.raises(am.ParameterError, match=f"{table}.{next(iter(options))}"):
            am.tracking.method_by_name("gnn", **wrong)
    with pytest.raises(am.ParameterError, match="gate: expected a Gate"):
        am.GNN(gate=3)
    with pytest.raises(am.ParameterError, match="proposers"):
        am.SMP(proposers="markers")
    with pytest.raises(am.ParameterError, match="Did you mean 'probability'"):
        am.tracking.method_by_name("gnn", gate={"probabil": 0.1})
    with pytest.raises(am.ParameterError, match="Did you mean 'gnn'"):
        am.tracking.method_by_name("gn")
    assert am.tracking.method_by_name("smp", proposers="detections") == am.SMP(
        proposers="detections"
    )


def test_what_is_no_capture_is_refused():
    truth = wanderers(np.random.default_rng(1))
    with pytest.raises(am.ParameterError, match="detections"):
        am.track(truth, am.GNN(), model=small_model())
    with pytest.raises(am.ParameterError, match="method"):
        am.track(truth.detections, "gn", model=small_model())


def test_points_too_dense_for_the_model_are_a_clear_limit(monkeypatch):
    monkeypatch.setattr("asterism.tracking.methods.options.MAX_CANDIDATES", 1000)
    rng = np.random.default_rng(1)
    d = am.Detections.from_frames([0.0, 0.1], [rng.normal(0, 0.01, (200, 3)) for _ in range(2)])
    with pytest.raises(am.SolverLimit, match="at most 1000"):
        am.track(d, am.GNN(), model=small_model())


@each_method
@pytest.mark.parametrize("motion", ["dwna", "interacting"])
@pytest.mark.parametrize(
    ("scale", "step", "changes"),
    [
        (1e9, 0.1, {}),
        (1e-310, 0.1, {"noise_sigma": 1e-12}),
        (1.0, 1e60, {}),
        (1.0, 1e-9, {"max_speed": 1e11}),
        (1.0, 0.1, {"noise_sigma": 1e-12, "clutter_density": 1e-300}),
        (1.0, 0.1, {"p_detection": 1 - 1e-16, "p_disappear": 1e-300}),
        (1.0, 0.1, {"clutter_density": 1e300, "birth_density": 1e-300}),
    ],
)
def test_absurd_numbers_do_no_harm(method, motion, scale, step, changes):
    # No label is promised, but neither a crash nor an index that was made of NaN.
    rng = np.random.default_rng(1)
    model = small_model(**changes)
    if motion == "interacting":
        model = dataclasses.replace(model, motion=interacting())
    # 64 take the grid; a second crowd on top of the first would have 65² branches and add seconds.
    frames = [rng.uniform(-1, 1, (n, 3)) * scale for n in (66, 3, 0, 4, 64)]
    d = am.Detections.from_frames(np.arange(5) * step, frames)
    tracks = am.track(d, method, model=model)
    assert (tracks.labels >= -1).all()
    assert len(am.filter.filter_states(tracks, model).log_densities) == d.n_points


def test_a_hundred_thousand_points_in_a_frame():
    rng = np.random.default_rng(1)
    points = rng.uniform(-50, 50, (100_000, 3))
    d = am.Detections.from_frames(np.arange(3) * 0.01, [points, points + 0.001, points + 0.002])
    model = small_model(clutter_density=1e-3, birth_density=1e-3, max_speed=1.0)
    tracks = am.track(d, am.GNN(), model=model)
    assert tracks.n_tracks > 99_000


def test_marriage_and_assignment_differ_where_they_should():
    # Two tracks, two points in a row: the middle point is nearest to both. Assignment shifts both;
    # marriage gives the nearest pair to each other first.
    model = small_model(
        motion=am.RandomWalk(walk_sigma=0.2), p_detection=0.999, clutter_density=1e-3,
        birth_density=1e-6,
    )  # fmt: skip
    still = [[[0.0, 0, 0], [0.1, 0, 0]]] * 6
    moved = [[[0.09, 0, 0], [0.21, 0, 0]]]
    d = am.Detections.from_frames(np.arange(7) * 0.1, still + moved)
    gnn, smp = (am.track(d, m, model=model).labels[-2:] for m in (am.GNN(), am.SMP()))
    assert gnn.tolist() == [0, 1]
    assert smp.tolist() == [1, 0]
