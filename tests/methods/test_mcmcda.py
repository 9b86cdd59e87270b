"""MCMC data association on streams: the best partition, deadlines, what is settled, options."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
import pytest

import asterism as am
from asterism.tracking import ChainOptions
from tests.methods.crowd import crowd_model
from tests.references.chain_moves import MOVES as MOVE_NAMES
from tests.references.partitions import every_partition, every_track, tiny_model, tiny_problem
from tests.scenes import (
    SANITIZED,
    calibration_in_crowds,
    crowd,
    sized,
    small_model,
    wanderers,
)


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
        best = am.solve.assign_multidimensional(tuples, scores).value
        tracks = am.track(d, am.MCMCDA(window=5, moves=5000, end_odds=1), model=model, seed=seed)
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
        own = am.track(d, am.MCMCDA(moves=1000, end_odds=1), model=model, seed=1).info[
            "log_posterior"
        ]
        more.append(own - max(am.track(d, m, model=model).info["log_posterior"] for m in others))
    assert min(more) > -0.01


@pytest.mark.parametrize("seed", range(3))
def test_the_truth_is_found_where_no_link_is_ambiguous(seed):
    truth = wanderers(np.random.default_rng(seed), n_frames=80)
    tracks = am.track(truth.detections, am.MCMCDA(), model=small_model(), seed=seed)
    assert am.evaluate(tracks, truth).idf1 > 0.98


ASCENT = ChainOptions(acceptance="ascent", ambiguous_share=0)


def test_more_moves_and_the_assignment_come_nearer():
    d = crowd(2, spread=0.1, n_frames=sized(60, 15)).detections
    model = crowd_model()

    def value(moves, **chain):
        method = am.MCMCDA(moves=moves, chain=ChainOptions(**chain))
        values = [
            am.track(d, method, model=model, seed=seed).info["log_posterior"]
            for seed in range(sized(4, 1))
        ]
        return np.mean(values)

    few, many = value(moves=2), value(moves=sized(100, 20))
    if SANITIZED:  # too short to tell them apart
        value(moves=5, assignment=False, proposal="uniform", move_weights="report")
        return
    assert many > few
    assert few > value(moves=2, assignment=False)
    assert value(moves=20) > value(moves=20, proposal="uniform", move_weights="report")


def test_a_longer_window_finds_no_less_with_as_many_moves_a_link():
    less = []
    for seed in range(1, 9):
        scene = am.simulate.attracted(frames=60, seed=seed)
        truth = am.simulate.corrupt(scene, missing=0.1, clutter=0.1, noise=2e-3, seed=seed)
        model = am.estimate_model(truth.detections).model
        short, long = (
            am.track(
                truth.detections,
                am.MCMCDA(window=window, moves=10 * window, confidence=0, end_odds=1),
                model=model,
            ).info["log_posterior"]
            for window in (10, 40)
        )
        less.append(short - long)
    assert np.mean(less) < 1  # 2.4 where the chain samples the posterior of the window to the end


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


def test_a_deadline_stops_the_chain_and_is_kept():
    d, model = crowd(6, spread=0.05, n_frames=20).detections, crowd_model()
    method = am.MCMCDA(moves=None, deadline=0.005)
    state = method.init(model)
    taken, walked = [], []
    for now, points in d:
        start = time.perf_counter()
        state, update = method.step(state, now, points)
        taken.append(time.perf_counter() - start)
        if update.info["ambiguous_groups"] > 0:
            walked.append(update.info["moves"] > 0)
    assert np.mean(walked) > 0.5  # on a busy machine a frame may pass by
    assert np.median(taken) < 0.05
    both = am.track(d, am.MCMCDA(moves=10, deadline=10.0), model=model)
    assert both.info["moves"] == am.track(d, am.MCMCDA(moves=10), model=model).info["moves"]


def test_confidence_is_the_share_of_the_posterior_in_which_a_detection_follows_the_same():
    off, sure = [], []
    for seed in range(40):
        rng = np.random.default_rng(seed)
        d, model = tiny_problem(rng, 5, 3, 2 + seed % 2), tiny_model(rng)
        if not 6 <= d.n_points <= 11:
            continue
        partitions, totals = every_partition(d, model)
        p = np.exp(totals - totals.max())
        p /= p.sum()
        groups = ("whole", "likelihood")[seed // 2 % 2]
        method = am.MCMCDA(
            window=5,
            moves=1000,
            confidence=50_000,
            end_odds=1,
            chain=ChainOptions(groups=groups, ambiguous_within=20),
        )
        tracks = am.track(d, method, model=model, seed=seed)
        before = predecessors(tracks.labels)
        # Links to the last frame were asked for once: that is not yet a mean over frames.
        for i in np.flatnonzero(d.frame_of == d.n_frames - 1):
            if tracks.labels[i] >= 0 and before[i] < 0:
                continue
            exact = sum(
                q for tracks_, q in zip(partitions, p, strict=True)
                if follows(tracks_, i) == before[i]
            )  # fmt: skip
            off.append(tracks.confidence[i] - exact)
            sure.append(exact)
    assert len(off) > 30
    assert np.std(sure) > 0.1  # not a row of ones
    assert np.max(np.abs(off)) < 0.05
    assert np.sqrt(np.mean(np.square(off))) < 0.012


@pytest.mark.parametrize(
    ("until", "off"),
    [(4, 0.02), (4, 0.035), (4, 0.04), (4, 0.045), (4, 0.05), (4, 0.06), (7, 0.04), (7, 0.045)],
)
def test_what_comes_later_speaks_of_what_was_linked(until, off):
    # A marker that moves straight, but for one point or from that on. Whether it is the marker's
    # depends on the points after it: here against all partitions, as frames come.
    x = 0.05 * np.arange(7.0)[:, None, None] * [1, 0, 0]
    x[3:until] += off
    d, model = am.Detections.from_frames(np.arange(7) * 0.1, list(x)), small_model()
    kept = {}  # of each point: the one before it, and how probable that was in each frame since
    for n in range(2, 8):
        partitions, totals = every_partition(d.part(0, n), model)
        p = np.exp(totals - totals.max())
        p /= p.sum()
        best = partitions[int(np.argmax(totals))]
        for i in range(n):
            right = [follows(tracks, i) == follows(best, i) for tracks in partitions]
            if kept.get(i, (None,))[0] != follows(best, i):
                kept[i] = (follows(best, i), [])
            kept[i][1].append(p[right].sum())
    method = am.MCMCDA(moves=100, confidence=20_000, end_odds=1)
    tracks = am.track(d, method, model=model, seed=1)
    assert predecessors(tracks.labels).tolist() == [kept[i][0] for i in range(7)]
    for i in range(7):
        of = i if kept[i][0] != -1 else i + 1  # of the first, that the next follows it
        assert tracks.confidence[i] == pytest.approx(np.mean(kept[of][1]), abs=0.02), i


def predecessors(labels):
    """Of each detection, the one before in its track; -1 for the first, -2 in no track."""
    last, before = {}, np.full(len(labels), -2)
    for i, label in enumerate(labels.tolist()):
        if label >= 0:
            before[i] = last.get(label, -1)
            last[label] = i
    return before


def follows(tracks, i):
    for t in tracks:
        if i in t:
            return t[t.index(i) - 1] if t.index(i) else -1
    return -2


def test_confidence_is_low_for_wrong_links():
    c = calibration_in_crowds(am.MCMCDA())
    assert c.ece < 0.02
    assert c.auc > 0.85


def test_neither_threads_nor_the_way_of_running_change_a_byte():
    d, model = crowd(8, spread=0.1, n_frames=40).detections, crowd_model()
    found = []
    for threads in (1, 2, 3):
        method = am.MCMCDA(moves=5, chains=2, threads=threads)
        tracks = am.track(d, method, model=model, seed=5)
        found.append((tracks.labels.tolist(), tracks.confidence.tolist(), dict(tracks.info)))
    assert found[0] == found[1] == found[2]


def test_chains_disagree_where_they_are_short_and_say_so():
    d, model = crowd(9, spread=0.06, n_frames=40).detections, crowd_model()

    def info(confidence):
        method = am.MCMCDA(chains=4, confidence=confidence)
        return am.track(d, method, model=model, seed=1).info

    short, long = info(30), info(5000)
    assert long["disagreements"] < short["disagreements"] / 2
    assert 1 <= long["rhat"] < short["rhat"]
    assert long["effective_samples"] > short["effective_samples"] >= 1
    assert 0 < long["accepted_extension"] < 1


def test_more_chains_find_no_worse():
    d = crowd(2, spread=0.1, n_frames=sized(60, 15)).detections
    model = crowd_model()

    def value(chains):
        method = am.MCMCDA(moves=3, chains=chains, confidence=0)
        return np.mean(
            [
                am.track(d, method, model=model, seed=s).info["log_posterior"]
                for s in range(sized(6, 1))
            ]
        )

    assert value(8) > value(1) or SANITIZED


def test_groups_that_nothing_joins_are_walked_apart():
    near = crowd(3, spread=0.1, n_frames=40)
    model = crowd_model()
    frames = [np.concatenate([p, p + np.array([5.0, 0, 0])]) for _, p in near.detections]
    d = am.Detections.from_frames(near.detections.times, frames)
    info = {}
    for groups, distance in (
        ("whole", None),
        ("likelihood", None),
        ("clusters", 1.5),
        ("cells", 2.5),
    ):
        method = am.MCMCDA(moves=200, chain=ChainOptions(groups=groups, distance=distance))
        info[groups] = am.track(d, method, model=model, seed=1).info
    best = max(one["log_posterior"] for one in info.values())
    assert all(one["log_posterior"] > best - 12 for one in info.values())
    assert info["whole"]["groups"] == d.n_frames
    assert info["likelihood"]["groups"] > info["clusters"]["groups"] > d.n_frames
    assert info["whole"]["largest_group"] > info["clusters"]["largest_group"]
    # The clusters are further apart than any link; cells cut some in two.
    assert info["likelihood"]["cut_links"] == info["clusters"]["cut_links"] == 0
    cells = am.MCMCDA(chain=ChainOptions(groups="cells", distance=0.2))
    cut = am.track(d, cells, model=model, seed=1).info
    assert cut["cut_links"] > 0


def test_groups_are_divided_by_the_moves_at_their_links():
    # Three motions make many links ambiguous whose tracks have much better ones.
    scene = am.simulate.dense(n_markers=40, frames=sized(60, 20), seed=3)
    truth = am.simulate.corrupt(scene, missing=0.1, clutter=0.1, noise=0.005, seed=4)
    model = am.estimate_model(truth.detections).model
    (own,) = model.motion.modes
    assert isinstance(own, am.DWNA)
    motions = tuple(
        replace(own, acceleration_sigma=k * own.acceleration_sigma) for k in (0.5, 1, 10)
    )
    transitions = np.array([[0.95, 0.045, 0.005], [0.045, 0.95, 0.005], [0.25, 0.25, 0.5]])
    motion = am.InteractingMotions(models=motions, transitions=transitions)
    model = replace(model, motion=motion)
    best = am.track(truth.detections, am.MCMCDA(confidence=0), model=model, seed=1)
    # The whole groups, because a draw may use any move.
    draw = am.track(truth.detections, am.MCMCDA(confidence=0, keep="draw"), model=model, seed=1)
    assert best.info["groups"] > 1.2 * draw.info["groups"]
    assert best.info["moves"] < 0.7 * draw.info["moves"]
    assert best.info["log_posterior"] > draw.info["log_posterior"] - 1e-6
    assert am.evaluate(best, truth).idf1 > 0.99


def test_tracks_that_keep_their_distances_are_sure():
    truth = am.simulate.cube(frames=60, seed=3)
    loose = wanderers(np.random.default_rng(1), n_frames=60, missing=0, clutter=0)
    rigid = am.estimate_model(truth.detections).model
    moves = {}
    for bonds in (0, 2, 3, 4):
        method = am.MCMCDA(chain=ChainOptions(bonds=bonds))
        tracks = am.track(truth.detections, method, model=rigid)
        assert am.evaluate(tracks, truth).idf1 == 1
        moves[bonds] = tracks.info.get("sure_tracks", 0)
    # All eight from the frame on with which the window is full.
    assert moves == {0: 0, 2: 8 * 51, 3: 8 * 51, 4: 8 * 51}
    method = am.MCMCDA(chain=ChainOptions(bonds=3))
    alone = am.track(loose.detections, method, model=small_model())
    assert alone.info["sure_tracks"] == 0


def test_tracks_are_not_broken_where_a_marker_jerks():
    # A marker that jumps by more than the model foresees: a new one would be likelier.
    times = 0.1 * np.arange(60)
    x = np.column_stack([0.5 * times, np.zeros(60), np.zeros(60)])
    x[30:] += [0.0, 0.1, 0.0]
    d = am.Detections.from_frames(times, [row[None] for row in x])
    model = small_model(
        motion=am.DWNA(acceleration_sigma=1.0, velocity_sigma=0.8), birth_density=2.0
    )
    n = {o: am.track(d, am.MCMCDA(end_odds=o), model=model).n_tracks for o in (1, 1000)}
    assert n == {1: 2, 1000: 1}


def test_weights_of_moves_by_name():
    d, model = crowd(7, n_frames=30).detections, crowd_model()
    shares = dict.fromkeys(MOVE_NAMES, 1.0)
    assert (
        am.track(d, am.MCMCDA(chain=ChainOptions(move_weights=shares)), model=model).labels
        == am.track(d, am.MCMCDA(), model=model).labels
    ).all()
    few = {"birth": 1, "death": 1, "extension": 2, "reduction": 2}
    method = am.MCMCDA(chain=ChainOptions(move_weights=few))
    assert am.track(d, method, model=model).n_tracks > 0


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"confidence": -1}, "confidence"), ({"chains": 0}, "chains"), ({"threads": 0}, "threads"),
        ({"end_odds": 0.5}, "end_odds"), ({"end_odds": 1e300}, "end_odds"),
        ({"window": None, "deadline": 1.0}, "deadline"),
        ({"window": 0}, "window"), ({"window": 10**9}, "window"), ({"moves": 1e300}, "moves"),
        ({"moves": -1}, "moves"), ({"moves": None}, "deadline"),
        ({"deadline": 0}, "deadline"), ({"chain": "ascent"}, "chain: expected ChainOptions"),
        ({"chain": ASCENT}, "confidence: expected 0 with the ascent"),
        ({"chain": ASCENT, "confidence": 0, "keep": "draw"}, "keep"),
    ],
)  # fmt: skip
def test_options_are_checked(wrong, message):
    with pytest.raises(am.ParameterError, match=message):
        am.MCMCDA(**wrong)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"groups": "mine"}, "likelihood"), ({"groups": "cells"}, "distance"),
        ({"distance": 1.0}, "distance"), ({"groups": "clusters", "distance": -1}, "distance"),
        ({"ambiguous_within": -1}, "ambiguous_within"),
        ({"bonds": 1}, "bonds"), ({"bonds": True}, "bonds"),
        ({"bonds": 2, "bond_tolerance": 0}, "bond_tolerance"),
        ({"ambiguous_share": 1}, "ambiguous_share"),
        ({"ambiguous_share": 0.5}, "0 with the ascent"),
        ({"proposal": "clever"}, "one of informed, uniform"),
        ({"acceptance": "descent"}, "one of metropolis, ascent"),
        ({"first_rules": 1}, "first_rules"),
        ({"assignment": "yes"}, "assignment"), ({"move_weights": "mine"}, "move_weights"),
        ({"move_weights": {"brith": 1}}, "birth"), ({"move_weights": {"update": 1}}, "births"),
        ({"move_weights": {"birth": 1, "death": 1, "split": 1}}, "split and merge"),
        ({"move_weights": {"birth": 1, "death": -1}}, "death"),
        ({"grops": "whole"}, "Did you mean 'groups'"),
    ],
)  # fmt: skip
def test_options_of_the_chain_are_checked(wrong, message):
    with pytest.raises(am.ParameterError, match=message):
        am.MCMCDA.report_2010(**wrong)


def test_a_seed_is_a_number():
    with pytest.raises(am.ParameterError, match="seed"):
        am.MCMCDA().init(small_model(), seed=-1)
