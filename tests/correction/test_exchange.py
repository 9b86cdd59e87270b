"""The best exchange of two tracks in time against one that tries every choice of intervals."""

from __future__ import annotations

import numpy as np
import pytest

import asterism as am
from asterism.tracking.correction.exchange import Lane, Motion, best_exchange
from tests.references.exchange_in_time import best_intervals, cost, gain_of, respects
from tests.references.exchanges import exchange_ratio
from tests.scenes import sized

STATED = (0.03, 0.96, 0.01)
"""Shares of detections that must stay, that are free, and that must go."""


def problem(seed):
    """Two tracks near each other with gaps, exchanges, random evidence and some pins."""
    rng = np.random.default_rng(seed)
    t = np.arange(60)[:, None, None] / 60
    shift = rng.normal(0, 0.02, (3, 1, 2, 3))
    at = shift[0] + shift[1] * np.sin(6 * t) + shift[2] * np.cos(9 * t)
    at += rng.normal(0, 3e-4, at.shape)
    truth = am.Tracks.from_dense(np.arange(60) / 100, at)
    corrupted = am.simulate.corrupt(truth, missing=float(rng.choice([0, 0.1, 0.5])), seed=seed)
    d, labels = corrupted.detections, corrupted.labels.copy()
    for cut in rng.integers(d.n_frames, size=2):
        labels[d.frame_of >= cut] = 1 - labels[d.frame_of >= cut]
    model = am.estimate_model(truth.detections).model
    lanes = []
    for k in (0, 1):
        own = np.flatnonzero(labels == k)
        starts = np.zeros(len(own), dtype=bool)
        starts[rng.integers(len(own), size=2)] = True
        starts[:1] = True
        lanes.append(
            Lane(
                detections=own, frames=d.frame_of[own], gains=rng.normal(0, 1, len(own)),
                starts=starts, before=rng.uniform(0.1, 1, len(own)),
                stated=rng.choice(np.array([-1, 0, 1], dtype=np.int8), len(own), p=STATED),
            )
        )  # fmt: skip
    return d, model, tuple(lanes), rng


@pytest.mark.parametrize("seed", range(sized(40, 10)))
def test_the_exchange_is_the_best_of_all(seed):
    d, model, lanes, rng = problem(seed)
    motion = Motion(d, model)
    lanes[0].stated[rng.integers(len(lanes[0].stated))] = 1

    def is_short(head, tail):
        return bool(motion.is_short(np.array([head]), np.array([tail]))[0])

    def log_likelihood(before, head, tail):
        return float(motion.log_likelihood(*(np.array([i]) for i in (before, head, tail)))[0])

    tracks = [(lane.frames, d.points[lane.detections]) for lane in lanes]

    def ratio_of(cut):
        log_miss = np.log1p(-min(model.sensor.p_detection, 0.999))
        return exchange_ratio(model, d.times, cut, *tracks, log_miss)

    plain = [
        list(
            zip(
                lane.detections.tolist(), lane.frames.tolist(), lane.gains.tolist(),
                lane.starts.tolist(), lane.before.tolist(), lane.stated.tolist(), strict=True,
            )
        )
        for lane in lanes
    ]  # fmt: skip
    wanted = best_intervals(plain, is_short, log_likelihood, ratio_of)
    found = best_exchange(lanes, motion)
    if found is None:
        stated = [{t: one[5] for one in lane if one[5] for t in [one[1]]} for lane in plain]
        assert any(stated[1].get(t, way) != way for t, way in stated[0].items())
        return
    intervals = list(zip(found.firsts.tolist(), found.ends.tolist(), strict=True))
    assert respects(plain, intervals)
    own = gain_of(plain, intervals, lambda t: cost(plain, t, is_short, log_likelihood, ratio_of))
    assert own == pytest.approx(found.gain, abs=1e-9)
    if wanted is not None:  # without a cut between parts, those inside parts are tried
        assert found.gain >= wanted - 1e-9
    if wanted is not None and set(np.ravel(intervals)) <= cuts_of(plain):
        assert found.gain == pytest.approx(wanted, abs=1e-9)


def cuts_of(plain):
    """Return the frames in which parts begin or have ended."""
    begins = {t for lane in plain for (_, t, _, is_start, _, _) in lane if is_start}
    ends = {
        lane[i][1] + 1 for lane in plain for i in range(len(lane))
        if i + 1 == len(lane) or lane[i + 1][3]
    }  # fmt: skip
    return begins | ends


def test_a_straight_continuation_fits_better_than_a_bent_one():
    d = am.Detections.from_frames(
        np.arange(3) / 100, [[[0, 0, 0]], [[0.01, 0, 0]], [[0.02, 0, 0], [0.01, 0.01, 0]]]
    )
    model = am.estimate_model(am.simulate.cube(seed=1).detections).model
    straight, bent = Motion(d, model).continuation(0, 1, np.array([2, 3]))
    assert straight == 0
    assert bent < straight


@pytest.mark.parametrize("seed", range(3))
def test_log_odds_by_motion_are_those_of_the_likelier_link(seed):
    truth = am.simulate.corrupt(
        am.simulate.cube(frames=120, seed=seed), missing=0.3, clutter=0.3, seed=seed
    )
    d, model = truth.detections, am.estimate_model(truth.detections).model
    motion, y, frame = Motion(d, model), d.points, d.frame_of
    own = np.flatnonzero(truth.labels == 0)
    own = own[(frame[own] < 8) | (frame[own] > 112)]
    others = np.flatnonzero(~np.isin(frame, frame[own]))
    volume = np.prod(np.maximum(y.max(axis=0) - y.min(axis=0), 0.01))

    def link(near, i):
        """Return the log odds of the link to the first of these detections, None if it is long."""
        if not len(near) or abs(frame[i] - frame[near[0]]) > motion.max_gap:
            return None
        n, velocity, factor = frame[i] - frame[near[0]], 0, 9
        if len(near) > 1 and abs(frame[near[0]] - frame[near[1]]) <= motion.max_gap:
            velocity = (y[near[0]] - y[near[1]]) / (frame[near[0]] - frame[near[1]])
            factor = 1
        variance = factor * (motion._r + motion._q * abs(n) ** 3)
        off2 = ((y[i] - y[near[0]] - n * velocity) ** 2).sum()
        density = -2 * np.log1p(off2 / (3 * variance)) - 1.5 * np.log(2 * np.pi * variance)
        return density - np.log(2.5 / volume)

    found = motion.log_odds(own, others, 2.5)
    for i, odds in zip(others, found, strict=True):
        sides = own[frame[own] < frame[i]][::-1][:2], own[frame[own] > frame[i]][:2]
        links = [each for each in (link(side, i) for side in sides) if each is not None]
        assert odds == pytest.approx(np.clip(max(links), -2, 2) if links else 0)
    assert found.min() < 0 < found.max()
    assert (found == 0).any()
