"""Tracks split into branches: the χ² test, the window, labels for the time being, shared points."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy.stats import chi2

import asterism as am
from asterism.tracking import Gate, Lifecycle
from asterism.tracking.methods.track_splitting import chi2_limits
from tests.references.hypothesis_trees import trees_by_hand
from tests.scenes import calibration_in_crowds, crowd, interacting, small_model, wanderers

NO_TEST = 1e-300


def crowd_model(motion: am.model.Motion | None = None) -> am.TrackingModel:
    return small_model(
        motion=motion or am.DWNA(acceleration_sigma=1.2, velocity_sigma=0.3), noise_sigma=0.01,
        max_speed=1.5, clutter_density=3.0, birth_density=1.0,
    )  # fmt: skip


@pytest.mark.parametrize(
    "method",
    [
        am.TrackSplitting(window=1),
        am.TrackSplitting(),
        am.TrackSplitting(window=5, alpha=0.05, fading=1.0, max_branches=6, merge_last=2),
        am.TrackSplitting(window=4, independent=True),
        am.TrackSplitting(window=6, prune_odds=20, merge_last=1),
        am.SMP(window=2),
        am.SMP(window=4, proposers="detections"),
    ],
    ids=["one frame", "default", "report's test", "independent", "pruned", "smp", "smp by points"],
)
@pytest.mark.parametrize("motion", ["dwna", "interacting"])
@pytest.mark.parametrize("seed", range(2))
def test_labels_and_confidence_are_those_of_the_reference_implementation(method, motion, seed):
    truth = crowd(seed, n_axes=2 + seed % 2, spread=0.12, n_frames=16)
    model = crowd_model(interacting() if motion == "interacting" else None)
    labels, confidence = trees_by_hand(truth.detections, method, model)
    tracks = am.track(truth.detections, method, model=model)
    assert (tracks.labels == labels).all()
    if isinstance(method, am.TrackSplitting):  # others have that of the motion model
        assert abs(tracks.confidence - confidence).max() < 1e-9
    assert labels.max() >= 3


@pytest.mark.parametrize("seed", range(4))
def test_a_window_of_one_frame_is_the_method_without_trees(seed):
    truth = wanderers(np.random.default_rng(seed), n_axes=2 + seed % 2, clutter=2.0)
    model = small_model(motion=interacting() if seed % 2 else small_model().motion)
    wide = am.TrackSplitting(window=1, alpha=NO_TEST, max_branches=1000, prune_odds=1e30)
    a, b = (am.track(truth.detections, m, model=model).labels for m in (wide, am.GNN()))
    assert (a == b).all()


@pytest.mark.parametrize("method", [am.TrackSplitting(), am.SMP(window=4)], ids=["trees", "smp"])
def test_labels_for_the_time_being_are_those_of_the_frames_so_far(method):
    # After every frame, what a stream has said is what a batch of the frames so far gives.
    d, model = crowd(1, spread=0.12).detections, crowd_model()
    state = method.init(model)
    said, sure = np.full(d.n_points, -1), np.zeros(d.n_points)
    n_revised = 0
    for t, (time, points) in enumerate(d):
        state, update = method.step(state, time, points)
        a, b = d.offsets[t], d.offsets[t + 1]
        said[a:b], said[update.revised] = update.labels, update.revised_labels
        n_revised += len(update.revised)
        first = am.Detections(
            times=d.times[: t + 1], offsets=d.offsets[: t + 2], points=d.points[:b]
        )
        batch = am.track(first, method, model=model)
        assert (said[:b] == batch.labels).all()
        if update.confidence is not None:
            sure[a:b], sure[update.revised] = update.confidence, update.revised_confidence
            assert (sure[:b] == batch.confidence).all()
        assert (update.revised < a).all()
    assert n_revised > 0


def one_marker(
    rng: np.random.Generator, n_frames: int, n_axes: int, model: am.TrackingModel
) -> am.Detections:
    """A marker that moves as the model says and is always seen; nothing else."""
    noise, a = model.sensor.noise_sigma, model.motion.acceleration_sigma
    x, v = np.zeros(n_axes), rng.normal(0, model.motion.velocity_sigma, n_axes)
    points = [x]
    for _ in range(n_frames - 1):
        kick = rng.normal(0, a, n_axes)
        x, v = x + 0.1 * v + 0.005 * kick, v + 0.1 * kick
        points.append(x)
    seen = np.array(points) + rng.normal(0, noise, (n_frames, n_axes))
    return am.Detections.from_frames(0.1 * np.arange(n_frames), list(seen[:, None]))


def true_model(**changes) -> am.TrackingModel:
    return small_model(
        motion=am.DWNA(acceleration_sigma=0.5, velocity_sigma=0.4), noise_sigma=0.01,
        clutter_density=1e-3, birth_density=1e-3, max_speed=100.0, **changes,
    )  # fmt: skip


def innovations(d: am.Detections, model: am.TrackingModel) -> np.ndarray:
    """νᵀ S⁻¹ ν of every detection of the only marker after the first: a filter written out."""
    motion, r = model.motion, model.sensor.noise_sigma**2
    F, Q = motion.transition(0.1)[0], motion.process_noise(0.1)[0]
    x = np.stack([d.points[0], np.zeros(d.n_axes)])
    P = model.initial_covariance(d.n_axes)
    squares = []
    for y in d.points[1:]:
        x, P = F @ x, F @ P @ F.T + Q
        S = P[0, 0] + r
        squares.append(((y - x[0]) ** 2).sum() / S)
        K = P[:, 0] / S
        x, P = x + np.outer(K, y - x[0]), P - np.outer(K, K) * S
    return np.array(squares)


@pytest.mark.parametrize("fading", [1.0, 0.8])
@pytest.mark.parametrize("n_axes", [2, 3])
def test_the_recursion_of_lambda_is_the_batch_sum(fading, n_axes):
    model = true_model()
    method = am.TrackSplitting(alpha=NO_TEST, fading=fading)
    d = one_marker(np.random.default_rng(n_axes), 300, n_axes, model)
    squares = innovations(d, model)
    state = method.init(model, n_axes=n_axes)
    for t, (time, points) in enumerate(d):
        state, _ = method.step(state, time, points)
        live = state.live()
        if len(live["ids"]):
            batch = (fading ** np.arange(t)[::-1] * squares[:t]).sum()
            assert live["chi2"][0] == pytest.approx(batch, rel=1e-9)
            assert live["updates"][0] == t
    assert t == 299


def share_above(fading: float, alpha: float, n_axes: int, at: list[int], n_runs: int) -> np.ndarray:
    """In how many runs λ(k) of the right branch exceeds δ(k), by the engine's own λ."""
    model = true_model()
    limits = chi2_limits(alpha, n_axes, fading)
    method = am.TrackSplitting(
        alpha=NO_TEST,
        fading=fading,
        window=1,
        lifecycle=Lifecycle(confirm_probability=0.6),
    )
    rng = np.random.default_rng(int(1000 * fading) + n_axes)
    above = np.zeros(len(at))
    for _ in range(n_runs):
        d = one_marker(rng, max(at) + 1, n_axes, model)
        state = method.init(model, n_axes=n_axes)
        for k, (time, points) in enumerate(d):
            state, _ = method.step(state, time, points)
            if k in at:
                live = state.live()
                assert live["updates"].tolist() == [k]
                above[at.index(k)] += live["chi2"][0] > limits[min(k, len(limits)) - 1]
    return above / n_runs


@pytest.mark.parametrize("n_axes", [2, 3])
def test_alpha_is_the_rate_at_which_right_branches_are_lost(n_axes):
    alpha, n_runs = 0.05, 1200
    shares = share_above(1.0, alpha, n_axes, [2, 5, 12], n_runs)
    error = np.sqrt(alpha * (1 - alpha) / n_runs)
    assert abs(shares - alpha).max() < 3.5 * error


def test_with_fading_alpha_is_kept():
    shares = share_above(0.5, 0.05, 3, [2, 5, 12], 1200)
    assert abs(shares - 0.05).max() < 3.5 * np.sqrt(0.05 * 0.95 / 1200)


@pytest.mark.parametrize("alpha", [0.2, 0.05])
def test_a_branch_beyond_the_limit_is_cut(alpha):
    # The first link of a track is the first test: as many first links are lost as alpha says.
    model, n_runs = true_model(), 1200
    method = am.TrackSplitting(
        alpha=alpha, fading=1.0, window=1, lifecycle=Lifecycle(confirm_probability=0.6)
    )
    rng = np.random.default_rng(5)
    lost = 0
    for _ in range(n_runs):
        state = method.init(model)
        for time, points in one_marker(rng, 2, 3, model):
            state, update = method.step(state, time, points)
        lost += update.info["cut_branches"]
    error = np.sqrt(alpha * (1 - alpha) / n_runs)
    assert abs(lost / n_runs - alpha) < 3.5 * error


@pytest.mark.parametrize("n_axes", [2, 3])
def test_limits_are_quantiles_of_the_sum(n_axes):
    limits = chi2_limits(0.01, n_axes, 1.0)
    k = np.array([1, 7, 400])
    assert limits[k - 1] == pytest.approx(chi2.isf(0.01, n_axes * k), rel=1e-12)
    rng = np.random.default_rng(3)
    for fading in (0.3, 0.5, 0.9):
        limits = chi2_limits(0.01, n_axes, fading)
        total = np.zeros(200_000)
        for k in range(1, len(limits) + 1):
            total = fading * total + rng.chisquare(n_axes, total.size)
            if k in (1, 3, len(limits)):
                assert (total > limits[k - 1]).mean() == pytest.approx(0.01, rel=0.1)
            if k > 60:
                break


def test_a_long_life_passes_from_the_table_to_the_closed_form_without_a_step():
    # The report's test (no fading) over more detections than there are exact limits.
    model = small_model(
        motion=am.RandomWalk(walk_sigma=0.05), noise_sigma=0.01, clutter_density=1e-3,
        birth_density=1e-3, max_speed=100.0,
    )  # fmt: skip
    n = 6000
    n_cut = {1e-6: 0, 0.999: 0}
    for seed in range(5):
        rng = np.random.default_rng(seed)
        walk = np.cumsum(rng.normal(0, 0.05 * np.sqrt(0.1), (n, 3)), axis=0)
        d = am.Detections.from_frames(
            0.1 * np.arange(n), list((walk + rng.normal(0, 0.01, (n, 3)))[:, None])
        )
        for alpha in n_cut:
            method = am.TrackSplitting(alpha=alpha, fading=1.0)
            n_cut[alpha] += am.track(d, method, model=model).info["cut_branches"]
    assert n_cut[1e-6] == 0
    assert n_cut[0.999] > 0
    # A noise greater by a tenth is nothing at once, and everything in the long run.
    wrong = dataclasses.replace(
        model,
        motion=am.RandomWalk(walk_sigma=0.045),
        sensor=dataclasses.replace(model.sensor, noise_sigma=0.009),
    )
    assert am.track(d, am.TrackSplitting(fading=1.0), model=wrong).n_tracks > 5
    assert am.track(d, am.TrackSplitting(), model=wrong).n_tracks == 1


@pytest.mark.parametrize("n_axes", [2, 3])
def test_the_nis_of_a_mixture_is_chi2(n_axes):
    # Right after birth the three motions expect the same place, each with its own spread: the sum
    # over the modes is then exactly the tail of the mixture, and λ(1) is χ² with D degrees.
    model = small_model(
        motion=interacting(), noise_sigma=0.01, clutter_density=1e-6, birth_density=1e-6,
        max_speed=1e3,
    )  # fmt: skip
    method = am.TrackSplitting(
        alpha=NO_TEST,
        window=1,
        lifecycle=Lifecycle(confirm_probability=0.51),
        gate=Gate(probability=1e-15),
    )
    rng = np.random.default_rng(7)
    modes, r = model.motion.modes, model.sensor.noise_sigma**2
    P0 = model.initial_covariance(n_axes)
    F = modes[0].transition(0.1)[0]
    S = [(F @ P0 @ F.T + mode.process_noise(0.1)[0])[0, 0] + r for mode in modes]
    T = np.asarray(model.motion.mode_transitions)
    weights = np.linalg.matrix_power(T, 200)[0] @ T
    squares = []
    for _ in range(3000):
        spread = np.sqrt(S[rng.choice(3, p=weights / weights.sum())])
        state = method.init(model, n_axes=n_axes)
        state, _ = method.step(state, 0.0, np.zeros((1, n_axes)))
        state, _ = method.step(state, 0.1, rng.normal(0, spread, (1, n_axes)))
        squares += state.live()["chi2"].tolist()
    assert len(squares) > 2900
    from scipy.stats import kstest

    assert kstest(squares, chi2(n_axes).cdf).pvalue > 1e-3


def test_trees_that_want_one_detection_are_counted_and_resolved():
    # A second marker vanishes beside the first: for some frames both trees like one detection best.
    n = 40
    path = np.stack([0.01 * np.arange(n), np.zeros(n), np.zeros(n)], axis=1)
    frames = [
        [path[t], path[t] + [0, 0.03, 0]] if t < 20 else [path[t] + [0, 0.004, 0]] for t in range(n)
    ]
    model = small_model(
        motion=am.DWNA(acceleration_sigma=0.6, velocity_sigma=0.2), noise_sigma=0.005,
        clutter_density=1e-2, birth_density=1e-3, max_gap=8,
    )  # fmt: skip
    d = am.Detections.from_frames(0.1 * np.arange(n), frames)
    free = am.track(d, am.TrackSplitting(independent=True), model=model)
    bound = am.track(d, am.TrackSplitting(), model=model)
    assert free.info["shared_detections"] > 3
    assert bound.info["shared_detections"] < free.info["shared_detections"]
    for tracks in (free, bound):
        after = tracks.labels[d.offsets[20] :]
        assert (after >= 0).all()
        assert tracks.n_tracks == 2


def test_what_comes_later_decides_between_two_ways():
    # Two points near the expected place, the truth a little farther than the false one; the frames
    # that follow tell which it was. A single frame cannot know.
    model = small_model(
        motion=am.DWNA(acceleration_sigma=1.0, velocity_sigma=0.5), noise_sigma=0.005,
        clutter_density=0.5, birth_density=0.01,
    )  # fmt: skip
    wins = {"gnn": 0, "splitting": 0, "smp": 0, "smp of the past": 0}
    methods = {
        "gnn": am.GNN(), "splitting": am.TrackSplitting(),
        "smp": am.SMP(), "smp of the past": am.SMP(window=3),
    }  # fmt: skip
    n_runs = 60
    for seed in range(n_runs):
        rng = np.random.default_rng(seed)
        truth = one_marker(rng, 30, 3, true_model())
        frames = [truth.frame(t) for t in range(30)]
        for t in range(12, 28, 4):
            decoy = frames[t][0] + rng.normal(0, 0.012, 3)
            frames[t] = np.array([decoy, frames[t][0]])
        d = am.Detections.from_frames(truth.times, frames)
        real = np.concatenate([[1] if len(f) == 1 else [0, 1] for f in frames]).astype(bool)
        for name, method in methods.items():
            labels = am.track(d, method, model=model).labels
            wins[name] += (labels[~real] < 0).sum()
    n = 4 * n_runs
    assert wins["splitting"] > wins["gnn"] + 0.05 * n
    assert wins["smp of the past"] > wins["smp"] + 0.05 * n
    assert wins["splitting"] > 0.75 * n


def test_confidence_is_calibrated_where_the_model_is_right():
    found = calibration_in_crowds(am.TrackSplitting())
    assert found.auc > 0.85
    assert found.ece < 0.015


def test_limits_on_branches_are_kept_and_reported():
    d, model = crowd(3, spread=0.05).detections, crowd_model()
    few = am.track(d, am.TrackSplitting(max_branches=2, window=6), model=model)
    assert few.info["peak_branches"] == 2
    assert few.info["dropped_branches"] > 0
    many = am.track(d, am.TrackSplitting(max_branches=200, window=6), model=model)
    assert many.info["dropped_branches"] == 0
    merged = am.track(d, am.TrackSplitting(max_branches=200, window=6, merge_last=1), model=model)
    assert merged.info["peak_branches"] < many.info["peak_branches"]


def test_options_are_checked():
    for wrong in (
        {"alpha": 0}, {"alpha": 1}, {"fading": 0}, {"fading": 1.1}, {"fading": 0.995},
        {"window": 0}, {"window": 17},
        {"window": 2.5}, {"max_branches": 0}, {"merge_last": 0}, {"prune_odds": 1},
        {"independent": 1},
    ):  # fmt: skip
        with pytest.raises(am.ParameterError, match=next(iter(wrong))):
            am.TrackSplitting(**wrong)
    for wrong in ({"window": 0}, {"window": 3, "strict": True}, {"window": 3, "capacity": 2}):
        with pytest.raises(am.ParameterError, match="window"):
            am.SMP(**wrong)
