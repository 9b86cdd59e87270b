"""The runs of frames from which a model is estimated."""

from __future__ import annotations

import numpy as np
import pytest

import asterism as am
from asterism.tracking.estimation.sampling import sample_runs
from asterism.tracking.estimation.scales import first_scales
from tests.scenes import wanderers


def mostly_slow(centre=1400):
    """Twenty markers that move slowly but for one short stretch of a long capture."""
    speed = 0.0005 + 0.03 * np.exp(-(((np.arange(3000) - centre) / 8) ** 2))
    rng = np.random.default_rng(0)
    positions = rng.uniform(0, 3, (20, 3)) + np.cumsum(speed)[:, None, None] * [1.0, 0, 0]
    positions += rng.normal(0, 2e-4, positions.shape)
    return am.Tracks.from_dense(np.arange(3000) / 100, positions).detections


def test_a_short_capture_is_taken_whole():
    d = wanderers(np.random.default_rng(1)).detections
    assert sample_runs(d, np.zeros(d.n_frames), d.n_points) == [d]


@pytest.mark.parametrize("n_points", [500, 4000, 20_000])
def test_runs_are_apart_and_have_the_points_asked_for(n_points):
    d = mostly_slow()
    runs = sample_runs(d, first_scales(d)[1], n_points)
    assert 0.7 * n_points < sum(run.n_points for run in runs) <= n_points
    ends = [run.times[-1] for run in runs]
    assert all(run.times[0] > end for run, end in zip(runs[1:], ends, strict=False))


@pytest.mark.parametrize("centre", [15, 700, 1400, 2970])
def test_a_short_fast_motion_is_in_the_sample(centre):
    d = mostly_slow(centre)
    runs = sample_runs(d, first_scales(d)[1], 3000)
    assert any(run.times[0] <= d.times[centre] <= run.times[-1] for run in runs)
    assert am.estimate_model(d).model.population.max_speed > 3


def test_frames_without_points_are_no_run():
    d = mostly_slow()
    keep = (d.frame_of < 300) | (d.frame_of > 2500)
    some = am.Detections(
        times=d.times,
        offsets=np.concatenate([[0], np.cumsum(np.bincount(d.frame_of[keep], minlength=3000))]),
        points=d.points[keep],
    )
    runs = sample_runs(some, first_scales(some)[1], 4000)
    assert all(run.n_points for run in runs)
