"""The acceleration that bonded markers have in common: of a known size, within its error."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

import asterism as am
from asterism.errors import ParameterError
from tests.paths import DATA

WALKING = DATA / "RealTimeBiomechanics__rtosim/data/ViconNexus/walking_1.c3d"

SIZES = (5, 4, 3)
PAIRS = np.array([
    (first + i, first + j)
    for first, size in zip((0, 5, 9), SIZES, strict=True)
    for i, j in itertools.combinations(range(size), 2)
])  # fmt: skip


def segments(seed, *, sigma=5.0, own=3e-4, n_frames=300, missing=0.1, n_axes=3, uneven=0.0):
    """Segments that accelerate at random, each marker with noise of its own."""
    rng = np.random.default_rng(seed)
    dt = (0.01 + uneven * (-1.0) ** np.arange(n_frames))[:, None]
    places = []
    for number, size in enumerate(SIZES):
        a = rng.normal(0, sigma, (n_frames, n_axes))
        v = np.concatenate([np.zeros((1, n_axes)), (a * dt).cumsum(axis=0)[:-1]])
        x = np.concatenate([np.zeros((1, n_axes)), (v * dt + a * dt**2 / 2).cumsum(axis=0)[:-1]])
        shape = rng.normal(number, 0.1, (size, n_axes))
        places.append(x[:, None] + shape + rng.normal(0, own, (n_frames, size, n_axes)))
    kept = rng.random((n_frames, sum(SIZES))) >= missing
    d = am.Detections(
        times=np.append(0, dt[:-1].cumsum()), offsets=np.append(0, np.cumsum(kept.sum(axis=1))),
        points=np.concatenate(places, axis=1)[kept],
    )  # fmt: skip
    return am.Tracks(detections=d, labels=np.nonzero(kept)[1])


@pytest.mark.parametrize("n_axes", [2, 3])
def test_a_known_size_is_measured_within_its_standard_error(n_axes):
    found = np.array([
        am.tracking.shared_size(segments(seed, n_axes=n_axes), *PAIRS.T) for seed in range(60)
    ])  # fmt: skip
    off = (found[:, 0] - 5.0) / found[:, 1]
    assert abs(off.mean()) < 0.5
    assert 0.6 < (off**2).mean() < 1.6
    assert found[:, 1].mean() < 0.5


def test_frames_may_be_spaced_unevenly():
    found = np.array([
        am.tracking.shared_size(segments(seed, uneven=0.002), *PAIRS.T) for seed in range(60)
    ])  # fmt: skip
    assert abs(((found[:, 0] - 5.0) / found[:, 1]).mean()) < 0.9


def test_noise_of_its_own_is_not_in_common():
    off = []
    for seed in range(40):
        tracks = segments(seed, sigma=0.0, own=1e-3)
        size, std = am.tracking.shared_size(tracks, *PAIRS.T)
        off.append(size**2 / (2 * size * std) if size else 0.0)
    assert np.mean(np.array(off) > 2) < 0.1  # one-sided: about 2 % by chance


def test_segments_that_share_no_bond_do_not_count():
    tracks = segments(1)
    across = np.array([(0, 5), (1, 6), (2, 9), (5, 10)])
    size, _ = am.tracking.shared_size(tracks, *across.T)
    assert size < 1.5
    assert am.tracking.shared_size(tracks, [], []) == (0.0, pytest.approx(np.nan, nan_ok=True))


def test_a_track_that_there_is_not_is_named():
    with pytest.raises(ParameterError, match=r"first, second.*12 tracks.*0 to 12"):
        am.tracking.shared_size(segments(1), [0, 3], [1, 12])


def test_what_is_learnt_is_within_its_error_and_independent_markers_have_none():
    off = []
    for seed in range(20):
        tracks = segments(seed, own=1e-4)
        model = am.estimate_model(tracks.detections).model
        shared = am.tracking.learn_shared_acceleration(tracks, model)
        off.append((shared.size - 5.0) / shared.size_std)
    assert abs(np.mean(off)) < 0.7
    assert np.square(off).mean() < 2
    swarm = am.simulate.swarm(frames=200, seed=2)
    alone = am.tracking.learn_shared_acceleration(swarm, am.estimate_model(swarm.detections).model)
    assert alone.size == 0


@pytest.mark.skipif(not WALKING.is_file(), reason="the capture is not there")
def test_noise_and_half_of_the_frames_change_little_on_a_capture():
    truth = am.read(WALKING).tracks
    bonds = am.tracking.learn_bonds(truth)
    kept = am.simulate.corrupt(truth, missing=0.1, noise=3e-4, stride=2, seed=1)
    sizes = []
    for each in (truth, kept):
        index = [each.names.index(name) for name in bonds.names]
        pairs = np.array(index)[bonds.pairs[bonds.rigid]]
        sizes.append(am.tracking.shared_size(each, *pairs.T)[0])
    assert sizes[1] == pytest.approx(sizes[0], rel=0.25)
