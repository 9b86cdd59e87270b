"""Detections without a track in the gaps of tracks."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import asterism as am
from asterism.filter import smooth_states
from asterism.tracking.attempts import in_gaps
from asterism.tracking.attempts.in_gaps import _log_odds_of_detection, with_detections_in_gaps

CUBE = am.simulate.corrupt(am.simulate.cube(frames=60, seed=1), noise=3e-4, seed=1)
TRUTH = am.Tracks.from_dense(CUBE.detections.times, CUBE.positions())
"""The detections of a frame are in the order of the 8 markers."""
MODEL = am.estimate_model(TRUTH.detections).model
AT, N = 30, 8
FIRST = AT * N
"""Detection of the first marker in frame `AT`."""


def stitched(labels, points=TRUTH.detections.points):
    changed = dataclasses.replace(TRUTH.detections, points=points)
    return am.stitch(am.Tracks(detections=changed, labels=labels), MODEL)


def missed(*offsets):
    """Tracks in which the first marker misses a frame, with detections at offsets from it."""
    d, more = TRUTH.detections, len(offsets) - 1
    at = np.repeat(d.points[FIRST][None], len(offsets), axis=0) + offsets
    points = np.concatenate([d.points[:FIRST], at, d.points[FIRST + 1 :]])
    labels = np.concatenate([TRUTH.labels[:FIRST], [-1] * (more + 1), TRUTH.labels[FIRST + 1 :]])
    ends = d.offsets + more * (np.arange(len(d.offsets)) > AT)
    changed = am.Detections(times=d.times, offsets=ends, points=points)
    return am.stitch(am.Tracks(detections=changed, labels=labels), MODEL)


@pytest.mark.parametrize(
    ("offsets", "taken"),
    [
        ([[0, 0, 0]], [0]),
        ([[0, 0.05, 0]], [0]),  # a jolt
        ([[0, 0.1, 0]], []),  # far
        ([[0, 0.01, 0], [0, 0, 0.002]], [1]),  # the nearer of two
        ([[0, 0.002, 0], [0, 0.002, 0]], []),  # neither of two at the same place
    ],
)
def test_the_nearest_detection_in_a_gap_of_one_frame_is_taken(offsets, taken):
    before = missed(*offsets)
    found = with_detections_in_gaps(before, MODEL)
    expected = before.tracks.labels.copy()
    expected[FIRST + np.array(taken, dtype=int)] = expected[0]
    np.testing.assert_array_equal(found.tracks.labels, expected)
    np.testing.assert_array_equal(found.tracklets >= 0, expected >= 0)
    assert found.tracks.info["in_gaps"] == len(taken)
    assert found.joins == before.joins == ()
    again = with_detections_in_gaps(found, MODEL)
    np.testing.assert_array_equal(again.tracks.labels, expected)
    assert again.tracks.info["in_gaps"] == len(taken)


def test_a_detection_between_two_gaps_is_taken_by_the_nearer_track():
    labels, points = TRUTH.labels.copy(), TRUTH.detections.points.copy()
    labels[FIRST : FIRST + 2] = -1
    points[FIRST] += 0.05 * (points[FIRST + 1] - points[FIRST])
    points[FIRST + 1] += 1
    found = with_detections_in_gaps(stitched(labels, points), MODEL).tracks
    assert found.labels[FIRST : FIRST + 2].tolist() == [found.labels[0], -1]


@pytest.mark.parametrize("length", [30, 31, 32])
def test_blocks_of_a_capture_take_what_the_whole_takes(monkeypatch, length):
    before = missed([0, 0.01, 0])
    monkeypatch.setattr(in_gaps, "BLOCK", length * N)
    monkeypatch.setattr(in_gaps, "MARGIN", 20)
    found = with_detections_in_gaps(before, MODEL).tracks
    assert found.labels[FIRST] == found.labels[0]
    assert found.info["in_gaps"] == 1


@pytest.mark.parametrize("n", [1, 2, 7])
def test_pairs_are_compared_in_any_number_at_a_time(monkeypatch, n):
    is_missed = np.random.default_rng(n).random(len(TRUTH.labels)) < 0.1
    is_missed[TRUTH.detections.frame_of % 59 == 0] = False
    before = stitched(np.where(is_missed, -1, TRUTH.labels))
    monkeypatch.setattr(in_gaps, "PAIRS", n)
    found = with_detections_in_gaps(before, MODEL).tracks.labels
    np.testing.assert_array_equal(found, before.tracks.labels[:N][TRUTH.labels])


def test_a_detection_is_in_the_tracklet_before_the_gap():
    before = missed([0, 0, 0])
    tracklets, own = before.tracklets.copy(), before.tracks.labels == before.tracks.labels[0]
    tracklets[own & (TRUTH.detections.frame_of > AT)] = tracklets.max() + 1
    two = dataclasses.replace(before, tracklets=tracklets)
    assert with_detections_in_gaps(two, MODEL).tracklets[FIRST] == tracklets[0]


def test_the_usual_error_is_that_against_the_position_smoothed_from_all_other_detections():
    motion = am.DWNA(acceleration_sigma=0.004)
    model = dataclasses.replace(MODEL, motion=motion)
    d, r = TRUTH.detections, model.sensor.noise_sigma**2
    states, H = smooth_states(TRUTH, model), motion.modes[0].observation
    places, variances = states.means @ H, states.covariances @ H @ H
    own, inside = states.offsets[0], range(10, 50)
    error = np.array([d.points[t * N] - places[own + t] for t in inside])
    variance = np.array([variances[own + t] for t in inside])
    expected = 0.0
    for t in inside:
        labels = TRUTH.labels.copy()
        labels[t * N] = -1
        others = smooth_states(dataclasses.replace(TRUTH, labels=labels), model)
        off, P = d.points[t * N] - others.means[own + t] @ H, others.covariances[own + t] @ H @ H
        expected += (off**2).mean() / (P + r)
    found = in_gaps._usual_variance(np.zeros(40, dtype=int), error, variance, r, 2)
    assert found == pytest.approx([(expected + 20) / 60, 1])
    # Of a position that is smoothed almost from this detection alone, the error is not known.
    hardly = in_gaps._usual_variance(np.zeros(40, dtype=int), error, np.full(40, 0.95 * r), r, 2)
    assert hardly.tolist() == [1, 1]


@pytest.mark.parametrize("length", [1, 3])
def test_log_odds_contain_those_of_a_detection_in_its_frame_of_the_gap(length):
    sensor = dataclasses.replace(MODEL.sensor, p_detection=0.9, p_redetection=0.3)
    changed = dataclasses.replace(MODEL, sensor=sensor)
    gone = FIRST + N * np.arange(length)
    for n in range(length):
        labels, points = TRUTH.labels.copy(), TRUTH.detections.points.copy()
        labels[gone] = -1
        points[np.delete(gone, n)] += 5
        before = stitched(labels, points)
        at = np.array([n == 0]), np.array([n == length - 1])
        odds = [in_gaps._clear(before, model) for model in (MODEL, changed)]
        assert [each[0].tolist() for each in odds] == [[gone[n]]] * 2
        prior = [_log_odds_of_detection(*at, model) for model in (MODEL, changed)]
        assert odds[1][2] - odds[0][2] == pytest.approx(prior[1] - prior[0])


def test_a_detection_needs_a_lead_over_one_that_is_not_probable_enough_itself():
    some = np.linspace(0.05, 0.1, 101)
    most = max(x for x in some if len(in_gaps._clear(missed([0, x, 0]), MODEL)[0]))
    near, far = [0, 0.99 * most, 0], [0, -1.02 * most, 0]
    taken = [len(in_gaps._clear(missed(*each), MODEL)[0]) for each in ([near], [far], [near, far])]
    assert taken == [1, 0, 0]


def test_detections_of_ghosts_are_not_taken():
    before = missed([0, 0, 0])
    tracklets = before.tracklets.copy()
    tracklets[FIRST] = tracklets.max() + 1
    ghost = dataclasses.replace(before, tracklets=tracklets)
    assert with_detections_in_gaps(ghost, MODEL).tracks.info["in_gaps"] == 0


def test_a_detection_in_the_middle_of_a_gap_is_taken():
    d, labels = TRUTH.detections, TRUTH.labels.copy()
    gone = [(AT + n) * N for n in range(5)]  # the third is detected, and far from a straight line
    points = d.points.copy()
    points[[each for n, each in enumerate(gone) if n != 2]] += 5
    labels[gone] = -1
    changed = am.Tracks(detections=dataclasses.replace(d, points=points), labels=labels)
    found = with_detections_in_gaps(am.stitch(changed, MODEL), MODEL).tracks
    expected = labels.copy()
    expected[gone[2]] = 0
    assert found.labels[FIRST - N] == 0
    np.testing.assert_array_equal(found.labels, expected)


def test_a_ghost_is_not_taken_where_there_are_many():
    """Where each marker has ghosts, a detection at the same distance is as likely one of them."""
    d, taken = TRUTH.detections, []
    for n_ghosts in (0, 3):
        rng = np.random.default_rng(1)
        at, labels = [], []
        for t in range(d.n_frames):
            own = d.points[t * N : (t + 1) * N].copy()
            mine = np.arange(N)
            if t == AT:
                own[0] += [0, 0.01, 0]
                mine[0] = -1
            ghosts = rng.normal(0, 0.02, (n_ghosts, N, 3)) + own
            at += [own, *ghosts]
            labels += [mine, np.full(n_ghosts * N, -1)]
        counts = np.full(d.n_frames, N * (1 + n_ghosts))
        many = am.Detections(
            times=d.times, offsets=np.append(0, np.cumsum(counts)), points=np.concatenate(at)
        )
        tracks = am.Tracks(detections=many, labels=np.concatenate(labels))
        found = with_detections_in_gaps(am.stitch(tracks, MODEL), MODEL).tracks
        taken.append(int(found.labels[AT * N * (1 + n_ghosts)]))
    assert taken == [0, -1]


def test_the_probability_is_the_confidence_of_the_detection():
    before = missed([0, 0.01, 0])
    confidence = np.where(before.tracks.labels >= 0, 1.0, 0.0)
    tracks = dataclasses.replace(before.tracks, confidence=confidence)
    found = with_detections_in_gaps(dataclasses.replace(before, tracks=tracks), MODEL)
    assert 0.997 < found.tracks.confidence[FIRST] < 1


def test_only_certain_detections_are_taken():
    """Where misses are frequent a detection near the fill may well be clutter."""
    sensor = dataclasses.replace(MODEL.sensor, p_detection=0.6, p_redetection=0.5)
    model, taken = dataclasses.replace(MODEL, sensor=sensor), []
    for off in np.linspace(0, 0.06, 61):
        before = missed([0, off, 0])
        tracks = dataclasses.replace(before.tracks, confidence=np.ones(len(TRUTH.labels)))
        found = with_detections_in_gaps(dataclasses.replace(before, tracks=tracks), model).tracks
        taken.append(found.labels[FIRST] >= 0)
        assert not taken[-1] or found.confidence[FIRST] > 0.997
    assert any(taken)
    assert not all(taken)


def test_the_default_takes_a_jolt_as_its_recipe_does():
    points = TRUTH.detections.points.copy()
    points[FIRST] += [0, 0.02, 0]
    jolt = dataclasses.replace(TRUTH.detections, points=points)
    alone = am.track(jolt, am.SMP(window=3), stitch=True)
    found = am.track(jolt)
    assert int((alone.labels < 0).sum()) == 1
    assert found.labels[FIRST] == found.labels[0] >= 0
    assert all(each.probability >= 0.95 for each in found.decisions)
    again = am.track(jolt, recipe=found.recipe)
    np.testing.assert_array_equal(again.labels, found.labels)


@pytest.mark.parametrize("length", [1, 2, 4])
def test_prior_odds_are_those_of_detections_after_detections_and_after_misses(length):
    sensor = dataclasses.replace(MODEL.sensor, p_detection=0.9, p_redetection=0.3)
    model = dataclasses.replace(MODEL, sensor=sensor)

    def log_probability(seen):
        p = [0.9 if before else 0.3 for before in seen[:-1]]
        return sum(np.log(q if now else 1 - q) for q, now in zip(p, seen[1:], strict=True))

    missed = [True] + [False] * length + [True]
    for n in range(length):
        seen = [is_seen or at == n + 1 for at, is_seen in enumerate(missed)]
        odds = _log_odds_of_detection(np.array([n == 0]), np.array([n == length - 1]), model)
        assert odds == pytest.approx([log_probability(seen) - log_probability(missed)])
