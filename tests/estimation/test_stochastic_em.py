"""Stochastic EM: draws from the posterior, counts from draws, and what they come to."""

from __future__ import annotations

import math
from collections import Counter

import numpy as np
import pytest

import asterism as am
from asterism.tracking import ChainOptions
from asterism.tracking.estimation.rates import Counts, Rates, count
from tests.references.chain_moves import as_partition
from tests.references.partitions import every_partition, problem_of_size
from tests.scenes import wanderers


def test_a_kept_draw_is_of_the_posterior():
    # Against all partitions: were the best kept, the distance would be near 1.
    d, model = problem_of_size(500, 5000, 3, 2)
    partitions, totals = every_partition(d, model)
    p = np.exp(totals - totals.max())
    p /= p.sum()
    # Assignment, groups and ambiguous links left out: the whole walk in one piece.
    draw = am.MCMCDA(
        window=d.n_frames, moves=300.0, confidence=0.0, end_odds=1.0, keep="draw",
        chain=ChainOptions(ambiguous_share=0, groups="whole"),
    )  # fmt: skip
    n = 2000
    seen = Counter(
        as_partition(am.track(d, draw, model=model, seed=seed).labels) for seed in range(n)
    )
    share = np.array([seen[frozenset(tracks)] / n for tracks in partitions])
    expected = 0.5 * np.sqrt(2 * p * (1 - p) / (math.pi * n)).sum()
    assert 0.5 * np.abs(share - p).sum() < 1.3 * expected + 0.01
    assert 0.5 * np.abs(np.eye(len(p))[p.argmax()] - p).sum() > 0.5


def by_hand(labels, n_frames, p, q, z, births):
    """The same expectations, from every way in which a track may have ended."""
    deaths = misses = steps = born = hits = rehits = remisses = 0.0
    frames = [np.flatnonzero(row) for row in labels]
    seen = q / (1 - p + q)  # in the long run
    n_start = sum(f[0] == 0 for f in frames) / seen
    for f in frames:
        for gap in np.diff(f):
            hits += gap == 1
            misses += gap > 1
            rehits += gap > 1
            remisses += max(gap - 2, 0)
        steps += f[-1] - f[0]
        left = n_frames - 1 - f[-1]
        unseen = [1.0, *((1 - z) ** k * (1 - p) * (1 - q) ** (k - 1) for k in range(1, left + 1))]
        # Probability, whether dead, frames alive and unseen.
        ways = [*((unseen[k] * z, 1, k) for k in range(left)), (unseen[left], 0, left)]
        total = sum(w for w, _, _ in ways)
        deaths += sum(w * dead for w, dead, _ in ways) / total
        misses += sum(w * (alive > 0) for w, _, alive in ways) / total
        remisses += sum(w * max(alive - 1, 0) for w, _, alive in ways) / total
        steps += sum(w * (alive + dead) for w, dead, alive in ways) / total
        if f[0] > 0:
            born += births / (births + n_start * (1 - seen) * (1 - q) ** (f[0] - 1) * q)
    return hits, misses, rehits, remisses, deaths, steps, born


def test_what_a_partition_leaves_open_is_averaged_over():
    rng = np.random.default_rng(0)
    T, K = 12, 6
    is_there = rng.random((K, T)) < 0.6
    for k in range(K):
        is_there[k, rng.choice(T, 4, replace=False)] = True  # long enough to count
    positions = np.where(is_there.T[:, :, None], rng.normal(size=(T, K, 3)), np.nan)
    tracks = am.Tracks.from_dense(np.arange(T) * 0.1, positions)
    found = count(
        tracks, Rates(p_detection=0.7, p_redetection=0.4, p_disappear=0.05, births=0.3, clutter=1.0)
    )
    hits, misses, rehits, remisses, deaths, steps, born = by_hand(is_there, T, 0.7, 0.4, 0.05, 0.3)
    assert found == Counts(
        hits=pytest.approx(hits), misses=pytest.approx(misses),
        rehits=pytest.approx(rehits), remisses=pytest.approx(remisses),
        deaths=pytest.approx(deaths), steps=pytest.approx(steps),
        births=pytest.approx(born), clutter=0.0, frames=T,
    )  # fmt: skip


def test_pairs_of_false_points_are_no_markers():
    d = am.Detections.from_frames(np.arange(5) * 0.1, [np.zeros((1, 3))] * 5)
    rates = Rates(p_detection=0.9, p_redetection=0.9, p_disappear=0.01, births=0.1, clutter=1.0)
    pair = count(am.Tracks(detections=d, labels=np.array([0, 0, -1, -1, -1])), rates)
    assert (pair.clutter, pair.hits, pair.births) == (5.0, 0.0, 0.0)
    four = count(am.Tracks(detections=d, labels=np.array([0, 0, 0, 0, -1])), rates)
    assert (four.clutter, four.hits) == (1.0, 3.0)


def arena(seed: int, *, births: float = 0.2, p_disappear: float = 0.01) -> am.Detections:
    """Markers that come and go, in a box of 2 m; DWNA of 1 m/s², 1 mm noise, P_d 0.9."""
    rng = np.random.default_rng(seed)
    T, dt = 150, 0.01
    frames: list[list] = [[] for _ in range(T)]
    starts = [0] * 20 + [t for t in range(1, T) for _ in range(rng.poisson(births))]
    for first in starts:
        x, v = rng.uniform(0, 2, 3), rng.normal(0, 0.3, 3)
        for t in range(first, T):
            if t > first:
                if rng.random() < p_disappear:
                    break
                a = rng.normal(0, 1.0, 3)
                x, v = x + v * dt + a * dt**2 / 2, v + a * dt
            if rng.random() < 0.9 or t == first > 0:
                frames[t].append(x + rng.normal(0, 1e-3, 3))
    for t in range(T):
        frames[t] += list(rng.uniform(0, 2, (rng.poisson(2.0), 3)))
    return am.Detections.from_frames(np.arange(T) * dt, [np.reshape(f, (-1, 3)) for f in frames])


@pytest.mark.parametrize("seed", [1, 2])
def test_births_and_deaths_are_found_where_they_are(seed):
    d = arena(seed)
    found = am.estimate_model(d, population="open")
    volume = np.prod(np.ptp(d.points, axis=0))
    model, stds = found.model, found.stds
    true = {
        "noise_sigma": (model.sensor.noise_sigma, 1e-3),
        "motion": (model.motion.acceleration_sigma, 1.0),
        "p_detection": (model.sensor.p_detection, 0.9),
        "clutter_density": (model.sensor.clutter_density, 2.0 / volume),
        "birth_density": (model.population.birth_density, 0.2 / volume),
        "p_disappear": (model.population.p_disappear, 0.01),
    }
    assert stds.keys() == true.keys()
    for name, (got, right) in true.items():
        assert abs(got - right) < 4 * stds[name], name
        assert stds[name] < 0.3 * right, name  # and says something
    assert "births" in str(found)


def test_a_closed_population_has_one_birth_and_one_death():
    d = arena(3, births=0.0, p_disappear=0.0)
    closed, open_ = am.estimate_model(d), am.estimate_model(d, population="open")
    volume = np.prod(np.ptp(d.points, axis=0))
    assert closed.model.population.birth_density * volume * d.n_frames == pytest.approx(1)
    assert not {"birth_density", "p_disappear"} & closed.stds.keys()
    # Where nothing comes or goes, the open estimate sees that.
    assert open_.model.population.birth_density * volume * d.n_frames < 3
    assert open_.model.population.p_disappear < 1e-3


def test_who_walks_has_no_velocity():
    rng = np.random.default_rng(4)
    paths = np.cumsum(rng.normal(0, 0.004, (200, 12, 3)), axis=0) + rng.uniform(-1, 1, (12, 3))
    paths += rng.normal(0, 1e-3, paths.shape)
    d = am.Tracks.from_dense(np.arange(200) * 0.01, paths).detections
    found = am.estimate_model(d)
    assert isinstance(found.model.motion, am.RandomWalk)
    sigma = found.model.motion.walk_sigma
    assert abs(sigma - 0.04) < 4 * found.stds["motion"]
    assert any("σ_w" in name for name, _, _ in found.reasons)


def test_draws_need_the_chain_that_samples():
    ascent = ChainOptions(acceptance="ascent", ambiguous_share=0)
    with pytest.raises(am.ParameterError, match="keep"):
        am.MCMCDA(keep="draw", chain=ascent, confidence=0.0)
    with pytest.raises(am.ParameterError, match="one of best, draw"):
        am.MCMCDA(keep="last")


def test_the_population_is_closed_or_open():
    with pytest.raises(am.ParameterError, match="one of closed, open"):
        am.estimate_model(wanderers(np.random.default_rng(0)).detections, population="half")
