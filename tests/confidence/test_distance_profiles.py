"""The comparison of parts of tracks with distance profiles against a plain one."""

from __future__ import annotations

import numpy as np
import pytest

import asterism as am
from asterism import _engine
from asterism.tracking.rigidity.profiles import candidate_margins, learn_profiles
from tests.references.distance_profiles import PART_FRAMES, SAMPLES, compare_part
from tests.scenes import moving, sized

TOLERANCE = 1e-9


def captured(rng, *, n_axes=3, n_markers=8, n_frames=300, missing=0.1, shared=0.5):
    """Two bodies and a wanderer; tracks that start and end, exchange markers, and change them."""
    _, positions = moving(rng.uniform(-0.4, 0.4, (n_markers, 3)), n_frames, int(rng.integers(99)))
    loose = rng.normal(0, 0.2, (1, n_markers, 3)) * rng.random(n_markers)[:, None]
    positions = positions + loose * np.sin(np.arange(n_frames) / 20)[:, None, None]
    positions += rng.normal(0, 0.002, positions.shape)
    positions[rng.random(positions.shape[:2]) < missing] = np.nan
    tracks = [positions]
    for k in range(n_markers):
        if rng.random() > shared:
            continue
        begin, end = np.sort(rng.integers(n_frames + 1, size=2))
        other = np.full((n_frames, 1, 3), np.nan)
        if rng.random() < 0.5:  # a part is a track of its own
            other[begin:end, 0] = positions[begin:end, k]
            positions[begin:end, k] = np.nan
        else:  # two tracks are exchanged for a while
            j = int(rng.integers(n_markers))
            positions[begin:end, [j, k]] = positions[begin:end, [k, j]]
        tracks.append(other)
    return np.concatenate(tracks, axis=1)[:, :, :n_axes]


def parts_in(rng, positions, n):
    """Return parts (track, frames, partners) of all lengths."""
    found = []
    n_tracks = positions.shape[1]
    for _ in range(n):
        k = int(rng.integers(n_tracks))
        frames = np.flatnonzero(np.isfinite(positions[:, k, 0]))
        if len(frames):
            begin = int(rng.integers(len(frames)))
            end = begin + 1 + int(rng.integers(min(len(frames) - begin, rng.choice([1, 5, 500]))))
            found.append((k, frames[begin:end], rng.integers(-1, n_tracks, 2)))
    return found


def profiles_of(positions, noise):
    tracks = am.Tracks.from_dense(np.arange(len(positions)) / 100, positions)
    d = tracks.detections
    n = min(SAMPLES, d.n_frames)
    samples = np.arange(n) * d.n_frames // max(n, 1)
    return _engine.DistanceProfiles(
        np.ascontiguousarray(d.points), tracks.labels, d.offsets, samples,
        n_tracks=tracks.n_tracks, noise=noise,
    )  # fmt: skip


def compared(positions, noise, parts, threads=1):
    some = [
        frames[np.arange(n) * (len(frames) - 1) // max(n - 1, 1)]
        for _, frames, _ in parts
        for n in [min(len(frames), PART_FRAMES)]
    ]
    return profiles_of(positions, noise).compare(
        np.array([k for k, _, _ in parts], dtype=np.int64),
        np.concatenate([np.empty(0, np.int64), *some]),
        np.cumsum([0, *map(len, some)]).astype(np.int64),
        np.array([partners for *_, partners in parts], dtype=np.int64).reshape(-1, 2),
        n_threads=threads,
    )


def held_to_reference(positions, parts, noise=0.002):
    """Return the number of known parts and of alternatives, as of the reference implementation."""
    is_known, unknown, in_range, others, densities = compared(positions, noise, parts)
    for p, (track, frames, partners) in enumerate(parts):
        known, log_unknown, log_in_range, best = compare_part(
            positions, noise, track, frames, set(partners)
        )
        assert is_known[p] == known
        assert unknown[p] == pytest.approx(log_unknown, abs=TOLERANCE, rel=TOLERANCE)
        assert in_range[p] == pytest.approx(log_in_range, abs=TOLERANCE, rel=TOLERANCE)
        assert others[p].tolist() == [k for _, k in best] + [-1] * (3 - len(best))
        wanted = [density for density, _ in best] + [-np.inf] * (3 - len(best))
        assert densities[p].tolist() == pytest.approx(wanted, abs=TOLERANCE, rel=TOLERANCE)
    return int(is_known.sum()), int((others >= 0).sum())


@pytest.mark.parametrize("n_axes", [2, 3])
@pytest.mark.parametrize("missing", [0.0, 0.1, 0.6])
@pytest.mark.parametrize("seed", range(sized(3, 1)))
def test_comparisons_are_those_of_the_reference(n_axes, missing, seed):
    rng = np.random.default_rng([seed, n_axes])
    positions = captured(rng, n_axes=n_axes, missing=missing)
    n_known, n_others = held_to_reference(positions, parts_in(rng, positions, 40))
    assert n_known > 10
    assert n_others > 10


def test_any_number_of_threads_gives_the_same_evidence():
    rng = np.random.default_rng(3)
    positions = captured(rng, n_axes=3, missing=0.3)
    parts = parts_in(rng, positions, 300)
    alone = [each.tobytes() for each in compared(positions, 0.002, parts)]
    for threads in (2, 3, 50):
        found = compared(positions, 0.002, parts, threads)
        assert [each.tobytes() for each in found] == alone


def test_few_frames_and_few_tracks_are_compared_alike():
    rng = np.random.default_rng(1)
    for n_frames, n_markers in ((1, 1), (1, 5), (5, 4), (7, 4), (40, 1), (40, 3), (161, 3)):
        positions = captured(rng, n_frames=n_frames, n_markers=n_markers)
        held_to_reference(positions, parts_in(rng, positions, 12))


def test_only_the_longest_tracks_are_references():
    rng = np.random.default_rng(2)
    positions = rng.uniform(-1, 1, (1, 140, 3)) + rng.normal(0, 0.002, (30, 140, 3))
    positions[rng.random((30, 140)) < rng.uniform(0, 0.8, 140)] = np.nan
    n_known, n_others = held_to_reference(positions, parts_in(rng, positions, 15))
    assert n_known > 5
    assert n_others > 5


def test_no_part_is_compared_with_nothing():
    assert [len(each) for each in compared(np.empty((0, 0, 3)), 0.001, [])] == [0, 0, 0, 0, 0]
    assert [len(each) for each in compared(np.zeros((3, 1, 3)), 0.001, [])] == [0, 0, 0, 0, 0]


MADE = {
    "points": np.arange(12.0).reshape(4, 3), "labels": np.array([0, 1, 0, 1]),
    "offsets": np.array([0, 2, 4]), "samples": np.array([0, 1]), "n_tracks": 2, "noise": 0.001,
}  # fmt: skip
PART = {
    "tracks": np.array([0]), "frames": np.array([0, 1]), "offsets": np.array([0, 2]),
    "partners": np.array([[1, -1]]), "n_threads": 1,
}  # fmt: skip


@pytest.mark.parametrize(
    "changes",
    [
        {"points": np.zeros((4, 0))},
        {"points": np.zeros((4, 4))},
        {"points": np.zeros(4)},
        {"points": np.full((4, 3), np.nan)},
        {"labels": np.array([0, 1, 0])},
        {"labels": np.array([0, 2, 0, 1])},
        {"labels": np.array([0, -2, 0, 1])},
        {"labels": np.array([0, 0, 0, 1])},  # two detections of a track in a frame
        {"offsets": np.array([0, 3, 2])},
        {"offsets": np.array([0, 2, 5])},
        {"samples": np.array([2])},
        {"samples": np.array([-1])},
        {"n_tracks": 1},
        {"n_tracks": -1, "labels": np.full(4, -1)},
        {"noise": np.nan},
    ],
)
def test_damaged_profiles_are_refused(changes):
    _engine.DistanceProfiles(**MADE)
    with pytest.raises(ValueError, match=":"):
        _engine.DistanceProfiles(**MADE | changes)


@pytest.mark.parametrize(
    "changes",
    [
        {"tracks": np.array([2])},
        {"tracks": np.array([-1])},
        {"tracks": np.array([0, 1])},
        {"frames": np.array([0, 2])},
        {"frames": np.array([-1, 0])},
        {"offsets": np.array([0, 3])},
        {"offsets": np.array([2, 0])},
        {"partners": np.array([[1]])},
    ],
)
def test_damaged_parts_are_refused(changes):
    profiles = _engine.DistanceProfiles(**MADE)
    profiles.compare(**PART)
    with pytest.raises(ValueError, match=":"):
        profiles.compare(**PART | changes)


def test_a_part_without_a_detection_of_its_track_is_refused():
    profiles = _engine.DistanceProfiles(**MADE | {"labels": np.array([0, 1, -1, 1])})
    with pytest.raises(ValueError, match="frames"):
        profiles.compare(**PART)


@pytest.mark.parametrize("pairs", [[[0, 2]], [[-1, 0]], [0, 1]])
def test_damaged_pairs_are_refused(pairs):
    profiles = _engine.DistanceProfiles(**MADE)
    profiles.agreements(np.array([[0, 1]]))
    with pytest.raises(ValueError, match=r"pairs|tracks"):
        profiles.agreements(np.array(pairs))


@pytest.mark.parametrize("frames", [100, 300])
def test_candidates_fit_a_track_as_each_would_alone(frames):
    made = am.simulate.person(activity="walk", frames=frames, n_markers=40, seed=3)
    truth = am.simulate.corrupt(made, missing=0.05, clutter=0.1, noise=3e-4, seed=3)
    d, labels, track = truth.detections, truth.labels.copy(), 4
    is_lost = np.isin(d.frame_of, np.arange(40, 60))
    labels[is_lost & (labels == track)] = -1
    candidates = np.flatnonzero(is_lost & (labels < 0))
    found = candidate_margins(d, labels, 3e-4, candidates, track)
    for i, margins in zip(candidates, found, strict=True):
        alone, frame = labels.copy(), d.frame_of[[i]].astype(np.int64)
        alone[i] = track
        profiles = learn_profiles(d, alone, 3e-4, frame)
        # The profile of the track is learnt without the candidate.
        sampled = np.isin(frame, np.arange(160) * frames // 160)
        at = np.searchsorted(profiles.frames, frame)
        there = alone[d.offsets[frame[0]] : d.offsets[frame[0] + 1]]
        absent = np.setdiff1d(np.arange(truth.n_tracks), there)
        *others, unknown = profiles.engine.densities(np.array([track]), at, np.arange(2), absent)[0]
        best = max((one for one in others if one != 0), default=-np.inf)
        wanted = [-unknown, -best if unknown < 2 else -np.inf]
        assert margins == pytest.approx(wanted, abs=0.1 if sampled else 1e-9)
    is_right = truth.labels[candidates] == track
    assert found[is_right, 0].min() > 0 > found[~is_right, 0].max()
    assert np.isfinite(found[:, 1]).any()
    assert len(candidate_margins(d, labels, 3e-4, candidates[:0], track)) == 0
    assert not candidate_margins(d, labels, 3e-4, candidates, truth.n_tracks).any()
