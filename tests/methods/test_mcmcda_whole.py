"""MCMCDA over whole captures: blocks, starts from labels, repairs, hard captures."""

from __future__ import annotations

import dataclasses
import signal
import time

import numpy as np
import pytest

import asterism as am
from asterism.tracking import ChainOptions
from tests.methods.crowd import crowd_model
from tests.paths import REPRO
from tests.scenes import (
    SANITIZED,
    crowd,
    interacting,
    sized,
    small_model,
    wanderers,
)


def test_a_single_scan_at_a_time():
    truth = wanderers(np.random.default_rng(4), n_frames=60)
    method = am.MCMCDA(window=1, moves=100)
    tracks = am.track(truth.detections, method, model=small_model(), seed=1)
    assert am.evaluate(tracks, truth).idf1 > 0.95


def broken(truth, rng, n_cuts=12, n_swaps=4):
    """The truth cut into fragments, some of whose ends are another's."""
    labels, frame = truth.labels.copy(), truth.detections.frame_of
    for _ in range(n_swaps):
        a, b = rng.choice(np.unique(truth.labels[truth.labels >= 0]), 2, replace=False)
        late = frame >= rng.integers(10, frame[-1] - 10)
        is_a, is_b = (labels == a) & late, (labels == b) & late
        labels[is_a], labels[is_b] = b, a
    for _ in range(n_cuts):
        one = rng.choice(np.unique(labels[labels >= 0]))
        late = frame >= rng.integers(5, frame[-1] - 5)
        labels[(labels == one) & late] = labels.max() + 1
    return am.Tracks(detections=truth.detections, labels=labels)


@pytest.mark.parametrize("window", [10, None])
def test_fragments_are_repaired(window):
    truth = wanderers(np.random.default_rng(6), n_frames=80)
    model = small_model()
    start = broken(truth, np.random.default_rng(1))
    assert am.evaluate(start, truth).idf1 < 0.8
    method = am.MCMCDA(window=window, moves=100)
    tracks = am.track(truth.detections, method, model=model, start=start, seed=1)
    assert am.evaluate(tracks, truth).idf1 > 0.98
    assert tracks.info["given_links"] > 300
    assert tracks.info["refused_links"] < 30
    # What it is given it does not throw away: with no move to spare it is what comes out.
    few = am.MCMCDA(window=window, moves=0, confidence=0)
    kept = am.track(truth.detections, few, model=model, start=truth)
    assert am.evaluate(kept, am.metrics.oracle_tracks(truth, model.population.max_gap)).idf1 > 0.99


def test_initial_tracks_with_long_gaps_go_on_as_other_tracks():
    """The engine reuses the numbers of detections that have left its window."""
    rng = np.random.default_rng(4)
    at = rng.uniform(0, 0.3, (12, 3)) + rng.normal(0, 3e-4, (300, 12, 3))
    is_seen = np.ones((300, 12), dtype=bool)
    for start, n, k in zip(
        rng.integers(10, 260, 60), rng.integers(5, 40, 60), np.arange(60) % 12, strict=True
    ):
        is_seen[start : start + n, k] = False
    at[~is_seen] = np.nan
    truth = am.Tracks.from_dense(np.arange(300) / 100, at)
    model = am.estimate_model(truth.detections).model
    model = dataclasses.replace(
        model, population=dataclasses.replace(model.population, max_speed=60.0, max_gap=4)
    )
    few = am.MCMCDA(moves=0, confidence=0)
    tracks = am.track(truth.detections, few, model=model, start=truth, stitch=False)
    parts = am.metrics.oracle_tracks(truth, 4)
    assert tracks.n_tracks == parts.n_tracks > 40
    assert am.evaluate(tracks, parts).idf1 == 1


@pytest.mark.parametrize("seed", [2, 3, 7])
@pytest.mark.parametrize(("activity", "missing"), [("walk", 0.1), ("run", 0.2)])
def test_initial_tracks_keep_what_is_improbable_until_more_detections_follow(
    activity, missing, seed
):
    """Of a running person many tracks begin with a gap; of a walking one some jolt."""
    truth = am.simulate.person(activity=activity, frames=80, seed=seed)
    truth = am.simulate.corrupt(truth, missing=missing, clutter=0.1, noise=3e-4, seed=seed)
    model = am.tracking.tracklet_model(am.estimate_model(truth.detections).model)
    start = am.metrics.oracle_tracks(truth, model.population.max_gap)
    tracks = am.track(truth.detections, am.MCMCDA(), model=model, start=start, stitch=False)
    if not tracks.info["refused_links"]:
        before = am.log_posterior(start, model)
        assert tracks.info["log_posterior"] >= before - 1e-6
    first = np.unique(start.labels, return_index=True)[1][1:]  # without clutter
    assert (tracks.labels[first] >= 0).all()


@pytest.mark.parametrize("window", [10, None])
@pytest.mark.parametrize("seed", [2, 3])
def test_initial_tracks_are_the_start_although_others_are_nearer(seed, window):
    """A track with a gap must not begin with clutter or with another track's first detection."""
    truth = am.simulate.person(activity="run", frames=80, seed=seed)
    truth = am.simulate.corrupt(truth, missing=0.3, clutter=0.3, noise=3e-4, stride=2, seed=seed)
    model = am.tracking.tracklet_model(am.estimate_model(truth.detections).model)
    start = am.metrics.oracle_tracks(truth, model.population.max_gap)
    few = am.MCMCDA(window=window, moves=0, confidence=0)
    kept = am.track(truth.detections, few, model=model, start=start, stitch=False)
    assert not kept.info["refused_links"]
    long = np.append(start.lengths > 1, False)[start.labels]
    assert np.array_equal(kept.labels >= 0, long)
    pairs = set(zip(kept.labels[long], start.labels[long], strict=True))
    assert len(pairs) == kept.n_tracks == (start.lengths > 1).sum()


@pytest.mark.parametrize("window", [10, None])
def test_without_a_move_and_a_start_nothing_could_begin(window):
    # Every detection would be clutter, without a message.
    truth = wanderers(np.random.default_rng(6), n_frames=10)
    method = am.MCMCDA(window=window, moves=0)
    with pytest.raises(am.ParameterError, match=r"moves: expected a number > 0, or labels"):
        am.track(truth.detections, method, model=small_model())


def test_a_stream_without_a_move_is_refused():
    with pytest.raises(am.ParameterError, match="moves"):
        am.MCMCDA(moves=0).init(small_model())


def test_a_stream_may_start_from_labels():
    truth = wanderers(np.random.default_rng(6), n_frames=20, missing=0, clutter=0)
    method = am.MCMCDA(moves=0, confidence=0)
    state = method.init(small_model(), start=truth.labels)
    labels = np.full(truth.detections.n_points, -1)
    for t, (at, points) in enumerate(truth.detections):
        state, update = method.step(state, at, points)
        labels[truth.detections.offsets[t] : truth.detections.offsets[t + 1]] = update.labels
        labels[update.revised] = update.revised_labels
    whole = am.track(truth.detections, method, model=small_model(), start=truth)
    assert (labels == whole.labels).all()
    assert state.info["given_links"] > 50
    with pytest.raises(am.ParameterError, match="start"):
        method.init(small_model(), start=["a"])


def test_a_start_is_for_those_who_can():
    truth = wanderers(np.random.default_rng(6), n_frames=10)
    with pytest.raises(am.ParameterError, match="mcmcda"):
        am.track(truth.detections, am.GNN(), model=small_model(), start=truth)
    other = wanderers(np.random.default_rng(7), n_frames=10)
    with pytest.raises(am.ParameterError, match="same"):
        am.track(truth.detections, am.MCMCDA(), model=small_model(), start=other)


def test_a_chain_over_a_whole_capture_runs_to_the_last_frame():
    truth = crowd(4, spread=0.1, n_frames=sized(60, 20))
    d, model = truth.detections, crowd_model()
    moves = sized(200, 20)
    method = am.MCMCDA(window=None, moves=moves)
    done = []
    whole = am.track(d, method, model=model, seed=1, progress=done.append)
    assert done == sorted(done)
    assert done[-1] == d.n_frames
    narrow = am.track(d, am.MCMCDA(window=1, moves=moves), model=model, seed=1)
    assert whole.info["log_posterior"] > narrow.info["log_posterior"]
    assert whole.info["moves"] > moves / 2 * d.n_points
    assert ((whole.confidence > 0) & (whole.confidence <= 1)).all()
    with pytest.raises(am.ParameterError, match="window"):
        method.step(method.init(model), 0.0, d.points[:2])


@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="no interval timers here")
def test_a_signal_ends_a_run_between_two_frames():
    d, model = crowd(4, spread=0.1, n_frames=60).detections, crowd_model()

    def stop(*_):
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGALRM, stop)
    start = time.process_time()  # others may have the core meanwhile
    try:
        signal.setitimer(signal.ITIMER_REAL, 0.2)
        with pytest.raises(KeyboardInterrupt):
            am.track(d, am.MCMCDA(moves=100_000), model=model)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
    assert time.process_time() - start < 5  # to the end it would be a minute


def test_a_chain_over_a_whole_capture_can_be_interrupted():
    d, model = crowd(4, spread=0.1, n_frames=60).detections, crowd_model()

    seen = []

    def stop(t):
        seen.append(t)
        if t > d.n_frames // 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        am.track(d, am.MCMCDA(window=None, moves=500), model=model, progress=stop)
    assert max(seen[:-1]) <= d.n_frames // 2 < seen[-1] < d.n_frames  # and nothing after it


def test_the_report_s_own_makes_no_moves_but_its_own():
    # Births and deaths alone can never undo half a track; moves at ambiguous links would.
    d, model = crowd(7, n_frames=30).detections, crowd_model()
    few = {"birth": 1, "death": 1}
    chain = ChainOptions(move_weights=few, ambiguous_share=0, assignment=False, groups="whole")
    own = am.MCMCDA(chain=chain)
    info = am.track(d, own, model=model, seed=1).info
    taken = [name for name, share in info.items() if name.startswith("accepted_") and share > 0]
    assert set(taken) <= {"accepted_birth", "accepted_death"}
    ambiguous = dataclasses.replace(chain, ambiguous_share=0.5)
    more = am.track(d, am.MCMCDA(chain=ambiguous), model=model, seed=1)
    assert more.info["log_posterior"] > info["log_posterior"]


def test_a_capture_in_blocks_is_explained_as_well_as_in_one(monkeypatch):
    truth = crowd(4, spread=0.1, n_frames=60)
    d, model = truth.detections, crowd_model()
    n = sized(400, 20)
    method = am.MCMCDA(window=None, moves=n, confidence=n, end_odds=1)
    whole = am.track(d, method, model=model, seed=1)  # 60 frames fit into one block
    monkeypatch.setattr("asterism.tracking.methods.mcmcda.BLOCK", 24)
    blocks = am.track(d, method, model=model, seed=1)
    # What is before and after a block counts: each alone would lose the tracks at every border.
    assert blocks.info["log_posterior"] > whole.info["log_posterior"] - sized(3, 20)
    if SANITIZED:
        return
    same = (blocks.labels >= 0) == (whole.labels >= 0)
    assert same.mean() > 0.97
    assert abs(blocks.confidence - whole.confidence)[same].mean() < 0.05


@pytest.mark.parametrize("several", [False, True])
def test_a_long_capture_is_one_sequence_of_tracks_over_all_blocks(monkeypatch, several):
    monkeypatch.setattr("asterism.tracking.methods.mcmcda.BLOCK", 20)
    truth = wanderers(np.random.default_rng(11), n_markers=4, n_frames=sized(150, 60), clutter=0.3)
    model = small_model(**({"motion": interacting()} if several else {}))
    method = am.MCMCDA(window=None, moves=30)
    tracks = am.track(truth.detections, method, model=model, seed=3)
    assert tracks.info["log_posterior"] > am.log_posterior(truth, model) - 1
    assert (tracks.n_tracks, am.evaluate(tracks, truth).switches) == (4, 0)
    again = am.track(
        truth.detections, am.MCMCDA(window=None, moves=30, threads=2), model=model, seed=3
    )
    assert again.labels.tobytes() == tracks.labels.tobytes()
    assert again.confidence.tobytes() == tracks.confidence.tobytes()


def test_fast_markers_in_a_whole_capture_end_no_process():
    # A move that exchanged a settled detection corrupted the partition: some frames later an index
    # lay outside an array.
    for seed in range(sized(4, 1)):
        truth = crowd(20 + seed, spread=0.05, n_frames=80)
        model = crowd_model()
        tracks = am.track(truth.detections, am.MCMCDA(window=None), model=model, seed=seed)
        order, _ = tracks.by_track
        frames = truth.detections.frame_of[order]
        inside = np.diff(tracks.labels[order]) == 0
        assert (np.diff(frames)[inside] >= 1).all()


@pytest.mark.skipif(SANITIZED, reason="a piece of it is in the sweep of methods")
@pytest.mark.skipif(not REPRO.is_dir(), reason=f"no inputs of known defects in {REPRO}")
def test_a_racing_wheelchair_at_half_rate_ends_no_process():
    z = np.load(REPRO / "whole_capture_crash.npz")
    d = am.Detections(times=z["times"], points=z["points"], offsets=z["offsets"])
    model = am.estimate_model(d).model
    tracks = am.track(d, am.MCMCDA(window=None, moves=5), model=model)
    assert tracks.info["log_posterior"] > 10_000
