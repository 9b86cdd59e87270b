"""MCMC data association on streams: the best partition, deadlines, what is settled, options."""

from __future__ import annotations

import time

import numpy as np
import pytest

import asterism as am
from chain_oracle import MOVES as MOVE_NAMES
from partition_oracle import every_track, tiny_model, tiny_problem
from scenes import crowd, small_model, wanderers


def crowd_model():
    return small_model(
        motion=am.DWNA(acceleration_sigma=1.2, velocity_sigma=0.3), noise_sigma=0.01,
        max_speed=1.5, clutter_density=5.0, birth_density=0.5, p_disappear=1e-3, max_gap=6,
    )  # fmt: skip


def test_the_window_s_best_partition_is_found():
    n = n_best = 0
    for seed in range(60):
        rng = np.random.default_rng(seed)
        d, model = tiny_problem(rng, 5, 4), tiny_model(rng)
        paths, scores = every_track(d, model)
        if not paths:
            continue
        tuples = np.full((len(paths), d.n_frames), -1)
        for k, path in enumerate(paths):
            tuples[k, d.frame_of[list(path)]] = path
        best = am.assign_multidimensional(tuples, scores).value
        tracks = am.track(d, am.MCMCDA(window=5, moves=5000), model=model, seed=seed)
        assert tracks.info["log_posterior"] <= best + 1e-5
        n += 1
        n_best += tracks.info["log_posterior"] > best - 0.01
    assert n > 40
    assert n_best >= 0.99 * n


def test_a_crowd_is_explained_no_worse_than_by_any_other_method():
    others = (am.GNN(), am.JPDA(), am.TrackSplitting(), am.TOMHT(window=4), am.MHT(window=4))
    more = []
    for seed in range(6):
        d, model = crowd(seed, spread=0.08).detections, crowd_model()
        own = am.track(d, am.MCMCDA(moves=10_000), model=model, seed=1).info["log_posterior"]
        more.append(own - max(am.track(d, m, model=model).info["log_posterior"] for m in others))
    assert min(more) > -0.01


@pytest.mark.parametrize("seed", range(3))
def test_where_nothing_is_in_doubt_the_truth_is_found(seed):
    truth = wanderers(np.random.default_rng(seed), n_frames=80)
    tracks = am.track(truth.detections, am.MCMCDA(), model=small_model(), seed=seed)
    assert am.evaluate(tracks, truth).idf1 > 0.98


def test_more_moves_and_the_assignment_come_nearer():
    d, model = crowd(2, spread=0.1, n_frames=60).detections, crowd_model()

    def value(**options):
        values = [
            am.track(d, am.MCMCDA(**options), model=model, seed=seed).info["log_posterior"]
            for seed in range(4)
        ]
        return np.mean(values)

    few, many = value(moves=2), value(moves=100)
    assert many > few
    assert few > value(moves=2, assignment=False)
    assert value(moves=20) > value(moves=20, proposal="uniform", move_weights="report")


def test_what_is_settled_stays_and_what_is_open_may_change():
    truth = crowd(4, spread=0.1, n_frames=60)
    d, model, window = truth.detections, crowd_model(), 4
    method = am.MCMCDA(window=window, moves=5)
    state = method.init(model, seed=3)
    n_revised = 0
    for t, (now, points) in enumerate(d):
        state, update = method.step(state, now, points)
        assert (d.frame_of[update.revised] > t - window - 1).all()
        n_revised += len(update.revised)
    assert n_revised > 0


def test_the_seed_decides_and_nothing_else():
    d, model = crowd(5, spread=0.05, n_frames=40).detections, crowd_model()
    labels = [
        am.track(d, am.MCMCDA(moves=3), model=model, seed=seed).labels.tolist()
        for seed in (1, 1, 2, 3, 4)
    ]
    assert labels[0] == labels[1]
    assert len({str(one) for one in labels}) > 1


def test_a_deadline_stops_the_walk_and_is_told():
    d, model = crowd(6, spread=0.05, n_frames=20).detections, crowd_model()
    method = am.MCMCDA(moves=None, deadline=0.005)
    state = method.init(model)
    taken = []
    for now, points in d:
        start = time.perf_counter()
        state, update = method.step(state, now, points)
        taken.append(time.perf_counter() - start)
        assert update.info["moves"] > 0
    assert np.median(taken) < 0.05
    both = am.track(d, am.MCMCDA(moves=10, deadline=10.0), model=model)
    assert both.info["moves"] == am.track(d, am.MCMCDA(moves=10), model=model).info["moves"]


def test_weights_of_moves_by_name():
    d, model = crowd(7, n_frames=30).detections, crowd_model()
    shares = dict.fromkeys(MOVE_NAMES, 1.0)
    assert (
        am.track(d, am.MCMCDA(move_weights=shares), model=model).labels
        == am.track(d, am.MCMCDA(), model=model).labels
    ).all()
    few = am.MCMCDA(move_weights={"birth": 1, "death": 1, "extension": 2, "reduction": 2})
    assert am.track(d, few, model=model).n_tracks > 0


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"window": 0}, "window"), ({"moves": -1}, "moves"), ({"moves": None}, "deadline"),
        ({"deadline": 0}, "deadline"), ({"proposal": "clever"}, "'informed' or 'uniform'"),
        ({"chain": "descent"}, "'metropolis' or 'ascent'"), ({"first_rules": 1}, "first_rules"),
        ({"assignment": "yes"}, "assignment"), ({"move_weights": "mine"}, "move_weights"),
        ({"move_weights": {"brith": 1}}, "birth"), ({"move_weights": {"update": 1}}, "births"),
        ({"move_weights": {"birth": 1, "death": 1, "split": 1}}, "split and merge"),
        ({"move_weights": {"birth": 1, "death": -1}}, "death"),
    ],
)  # fmt: skip
def test_options_are_checked(wrong, message):
    with pytest.raises(am.ParameterError, match=message):
        am.MCMCDA(**wrong)


def test_a_seed_is_a_number():
    with pytest.raises(am.ParameterError, match="seed"):
        am.MCMCDA().init(small_model(), seed=-1)
