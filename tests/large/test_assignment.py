"""The assignment in tiles: that of the dense reference, for every tiling."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

import asterism as am
from asterism import _engine
from asterism.large import assignment, tiles
from asterism.large.assignment import Frames, TileAnswer, assign, solve
from asterism.large.tracks import LiveTracks
from asterism.model.compiled import motion_model, transition
from tests.large.scenes import MODEL
from tests.references.large import Filter, assigned, chi2, gains

GATE = chi2(3, 1e-9)
SIDES = (np.inf, 0.5, 0.21, 0.04)


def scene(seed, n=12, n_frames=2, extent=0.35, n_axes=3):
    """Tracks with two to four detections behind them, and the next frames."""
    rng = np.random.default_rng(seed)
    here = rng.uniform(0, extent, (n, n_axes))
    velocity = rng.normal(0, 0.05, (n, n_axes))
    tracks = []
    for i in range(n):
        track = Filter.begin(MODEL, here[i] + rng.normal(0, 0.005, n_axes), 0.0)
        for t in range(1, 4):
            track = track.predicted(1.0)
            is_seen = t < 2 or rng.random() < 0.7
            y = here[i] + t * velocity[i] + rng.normal(0, 0.01, n_axes)
            track = track.updated(y, float(t)) if is_seen else track.missed()
        tracks.append(track._with(is_confirmed=bool(rng.random() < 0.7)))
    frames = []
    for t in range(4, 4 + n_frames):
        seen = (here + t * velocity + rng.normal(0, 0.01, here.shape))[rng.random(n) < 0.9]
        false = rng.uniform(-0.2, extent + 0.2, (rng.poisson(0.1 * n), n_axes))
        frames.append((float(t), rng.permutation(np.concatenate([seen, false]))))
    return tracks, frames


def solved(tracks, frames, side, mapper=map):
    """The assignment of the library."""
    n_axes = frames[0][1].shape[1]
    F, Q = transition(MODEL.motion, 1.0)
    W = len(frames)
    Fs, Qs = np.stack([F] * W), np.stack([Q] * W)
    states = np.array([np.concatenate([t.x.ravel(), t.P.ravel()]) for t in tracks])
    motion = motion_model(MODEL, n_axes)
    states, regions = _engine.predict_tracks(
        motion, gate=chi2(n_axes, 1e-9), F=Fs, Q=Qs, states=states, n_threads=1
    )
    K = len(tracks)
    live = LiveTracks(
        keys=np.arange(K), ids=np.array([0 if t.is_confirmed else -1 for t in tracks]),
        firsts=np.zeros(K, np.int64), states=states, last=np.array([t.last for t in tracks]),
        last_times=np.array([t.last_time for t in tracks]),
        scores=np.array([t.score for t in tracks]),
        best_scores=np.array([t.score for t in tracks]),
        gaps=np.array([t.gap for t in tracks], np.int32),
    )  # fmt: skip
    ahead = Frames(
        times=np.array([f[0] for f in frames]), F=Fs, Q=Qs, points=tuple(f[1] for f in frames)
    )
    return assign(
        live, states, regions, ahead, model=MODEL, gate=chi2(n_axes, 1e-9), side=side, mapper=mapper
    )


@pytest.mark.parametrize("n_frames", [1, 2, 3])
@pytest.mark.parametrize("seed", range(6))
def test_it_is_that_of_the_dense_reference(seed, n_frames):
    tracks, frames = scene(seed, n_frames=n_frames)
    wanted = assigned(gains([t.predicted(1.0) for t in tracks], frames, GATE))
    for side in SIDES:
        found = solved(tracks, frames, side)
        assert found.match.tolist() == wanted.tolist()


@pytest.mark.parametrize("n_axes", [2, 3])
@pytest.mark.parametrize("extent", [0.15, 3.0])
def test_in_two_axes_in_crowds_and_in_sparse_scenes(n_axes, extent):
    tracks, frames = scene(11, n=10, extent=extent, n_axes=n_axes)
    model_gate = chi2(n_axes, 1e-9)
    wanted = assigned(gains([t.predicted(1.0) for t in tracks], frames, model_gate))
    for side in SIDES:
        assert solved(tracks, frames, side).match.tolist() == wanted.tolist()


def test_groups_that_cross_a_seam_are_joined():
    tracks, frames = scene(2, n=40, extent=0.5)
    whole = solved(tracks, frames, np.inf)
    cut = solved(tracks, frames, 0.1)
    assert whole.n_tiles == 1
    assert whole.n_joined == 0
    assert cut.n_tiles > 10
    assert cut.n_joined > 10
    assert cut.match.tolist() == whole.match.tolist()


def test_without_the_joining_the_result_would_be_wrong(monkeypatch):
    """A planted mistake: each tile solves its own groups, seams or not."""
    made = assignment.TileTask

    def blind(**fields):
        return made(**fields | {"is_shared": np.zeros_like(fields["is_shared"])})

    monkeypatch.setattr(assignment, "TileTask", blind)
    wrong = 0
    for seed in range(8):
        tracks, frames = scene(seed, n=40, extent=0.45)
        cut = solved(tracks, frames, 0.08).match
        taken = cut[cut >= 0]
        wrong += len(set(taken.tolist())) < len(taken) or (
            cut.tolist() != solved(tracks, frames, np.inf).match.tolist()
        )
    assert wrong > 0


def test_an_overlap_that_is_too_narrow_would_be_wrong(monkeypatch):
    """A planted mistake: a tile has no detections beyond the predictions of its tracks."""
    real = tiles.cut

    def narrow(regions, frames, side):
        return real(regions * np.array([1, 1, 1, 0.0]), frames, side)

    tracks, frames = scene(3, n=40, extent=0.45)
    whole = solved(tracks, frames, np.inf).match
    monkeypatch.setattr(assignment, "cut", narrow)
    assert solved(tracks, frames, 0.1).match.tolist() != whole.tolist()


def test_a_task_can_be_sent_to_another_process():
    tracks, frames = scene(4, n=30)

    def far(function, tasks):
        sent = [pickle.loads(pickle.dumps((function, task))) for task in tasks]
        return [pickle.loads(pickle.dumps(run(task))) for run, task in sent]

    near = solved(tracks, frames, 0.2)
    assert solved(tracks, frames, 0.2, far).match.tolist() == near.match.tolist()


def test_a_mapper_that_loses_a_tile_is_an_error():
    tracks, frames = scene(4, n=30)
    with pytest.raises(ValueError, match="zip"):
        solved(tracks, frames, 0.2, lambda function, tasks: list(map(function, tasks))[:-1])


def test_a_tile_without_detections_has_an_answer():
    tracks, frames = scene(1, n=3)
    nothing = [(time, np.zeros((0, 3))) for time, _ in frames]
    assert solved(tracks, nothing, 0.2).match.tolist() == [-1, -1, -1]


def test_gates_with_too_many_detections_are_refused(monkeypatch):
    monkeypatch.setattr(assignment, "MAX_CANDIDATES", 3)
    tracks, frames = scene(1, n=30)
    with pytest.raises(am.SolverLimit, match="within the gates of one tile"):
        solved(tracks, frames, np.inf)


def test_solve_is_pure():
    tracks, frames = scene(5, n=20)
    kept = []

    def keep(function, tasks):
        kept.extend(tasks)
        return map(function, kept)

    solved(tracks, frames, 0.3, keep)
    for task in kept:
        before = pickle.dumps(task)
        one, two = solve(task), solve(task)
        assert isinstance(one, TileAnswer)
        assert pickle.dumps(task) == before
        assert one.match.tolist() == two.match.tolist()
