"""The best exchange of two tracks in time against one that tries every pair of cuts."""

from __future__ import annotations

import numpy as np
import pytest

import asterism as am
from asterism.tracking.correction.exchange import Lane, Motion, best_exchange
from tests.references.exchange_in_time import best_interval, gain_of
from tests.references.exchanges import exchange_ratio
from tests.scenes import sized


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
        starts = rng.random(len(own)) < 0.2
        starts[:1] = True
        lanes.append(
            Lane(
                detections=own, frames=d.frame_of[own], gains=rng.normal(0, 1, len(own)),
                starts=starts, before=rng.uniform(0.1, 1, len(own)),
                pinned=rng.random(len(own)) < 0.05,
            )
        )  # fmt: skip
    return d, model, tuple(lanes), rng


@pytest.mark.parametrize("seed", range(sized(40, 10)))
def test_the_exchange_is_the_best_of_all(seed):
    d, model, lanes, rng = problem(seed)
    motion = Motion(d, model)
    frame = int(rng.choice(lanes[0].frames))

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
                lane.starts.tolist(), lane.before.tolist(), lane.pinned.tolist(), strict=True,
            )
        )
        for lane in lanes
    ]  # fmt: skip
    wanted = best_interval(plain, frame, is_short, log_likelihood, ratio_of)
    found = best_exchange(lanes, frame, motion)
    if wanted is None:
        # Without a cut between parts, those inside parts are tried; pins may still be in the way.
        pins = np.concatenate([lane.frames[lane.pinned] for lane in lanes])
        if found is None:
            assert frame in pins
        else:
            assert not ((pins >= found.first) & (pins < found.end)).any()
        return
    assert found.gain == pytest.approx(wanted[2], abs=1e-9)
    own = gain_of(plain, found.first, found.end, is_short, log_likelihood, ratio_of)
    assert own == pytest.approx(wanted[2], abs=1e-9)  # the same interval, or an equal one


def test_a_straight_continuation_fits_better_than_a_bent_one():
    d = am.Detections.from_frames(
        np.arange(3) / 100, [[[0, 0, 0]], [[0.01, 0, 0]], [[0.02, 0, 0], [0.01, 0.01, 0]]]
    )
    model = am.estimate_model(am.simulate.cube(seed=1).detections).model
    straight, bent = Motion(d, model).continuation(0, 1, np.array([2, 3]))
    assert straight == 0
    assert bent < straight
