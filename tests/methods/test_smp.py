"""The stable marriage as the 2010 report has it, and what lifts its restrictions."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import asterism as am
from tests.references.frame_by_frame import OneTrack, propose, track_by_hand
from tests.scenes import small_model
from tests.solve.markets import marry, random_market


def strict_by_hand(detections: am.Detections, model: am.TrackingModel, proposers: str):
    """§5.5 line by line: complete lists, targets by density, measurements by distance."""
    n = int(detections.counts[0])
    tracks = [OneTrack(model, 0.0, y, 0) for y in detections.frame(0)]
    labels = list(range(n))
    for t in range(1, detections.n_frames):
        points = detections.frame(t)
        for track in tracks:
            track.predict(detections.times[t] - detections.times[t - 1])
        density = np.log([[track.densities(y).sum() for y in points] for track in tracks])
        distance = np.array([[track.distance(y) for y in points] for track in tracks])
        by_tracks = [list(np.argsort(-row, kind="stable")) for row in density]
        by_points = [list(np.argsort(column, kind="stable")) for column in distance.T]
        if proposers == "tracks":
            costs = {(i, j): distance[i, j] for i in range(n) for j in range(n)}
            partners = propose(by_tracks, costs)
        else:
            costs = {(j, i): -density[i, j] for i in range(n) for j in range(n)}
            of_point = propose(by_points, costs)
            partners = [of_point.index(i) for i in range(n)]
        frame = np.empty(n, dtype=int)
        for i, j in enumerate(partners):
            tracks[i].update(points[j])
            frame[j] = i
        labels += frame.tolist()
    return np.array(labels)


@pytest.mark.parametrize("proposers", ["tracks", "detections"])
@pytest.mark.parametrize("seed", range(4))
def test_strict_is_the_reports_method(proposers, seed):
    scene = am.simulate.walk(n_markers=6, frames=25, rate=10, stride=0.03, seed=seed)
    detections = am.simulate.corrupt(scene, noise=0.004, seed=seed).detections
    model = small_model(motion=am.DWNA(acceleration_sigma=5.0, velocity_sigma=0.8))
    method = am.SMP(strict=True, proposers=proposers)
    by_hand = strict_by_hand(detections, model, proposers)
    np.testing.assert_array_equal(am.track(detections, method, model=model).labels, by_hand)
    state = method.init(model)
    streamed = []
    for time, points in detections:
        state, update = method.step(state, time, points)
        streamed += update.labels.tolist()
    assert streamed == by_hand.tolist()


@pytest.mark.parametrize("seed", range(6))
def test_the_reports_first_three_tests_are_all_correct(seed):
    # §5.6: eight points of variable speed and direction, two cubes, a random walk with its model.
    quiet = {"noise_sigma": 0.0005, "p_detection": 0.999, "max_speed": 1e3}
    cases = [
        (
            am.simulate.wander(frames=100, seed=seed),
            am.DWNA(acceleration_sigma=0.01, velocity_sigma=0.03),
        ),
        (am.simulate.crossing(seed=seed), am.DWNA(acceleration_sigma=0.002, velocity_sigma=0.03)),
        (am.simulate.walk(seed=seed, stride=0.005), am.RandomWalk(walk_sigma=0.005)),
    ]
    for scene, motion in cases:
        detections = am.simulate.corrupt(scene, noise=0.0005, seed=seed)
        model = small_model(motion=motion, **quiet)
        tracks = am.track(detections.detections, am.SMP(strict=True), model=model)
        assert am.evaluate(tracks, detections).wrong_links == 0


def test_strict_refuses_what_it_cannot_handle():
    scene = am.simulate.cube(frames=6, rate=10)
    d = am.simulate.corrupt(scene, missing=0.2, seed=3).detections
    uneven = int(np.flatnonzero(d.counts != d.counts[0])[0])
    method, model = am.SMP(strict=True), small_model()
    with pytest.raises(am.ParameterError, match=rf"frame {uneven}.*strict"):
        am.track(d, method, model=model)
    state, _ = method.step(method.init(model), 0.0, np.zeros((2, 3)))
    for n in (0, 1, 3):
        with pytest.raises(am.ParameterError, match=r"2 in the frame at 0\.1 s"):
            method.step(state, 0.1, np.zeros((n, 3)))
    with pytest.raises(am.ParameterError, match="strict"):
        am.SMP(strict=1)
    assert am.track(d, am.SMP(), model=model).n_tracks >= 1  # which lifts both restrictions


@settings(max_examples=80, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 9), st.integers(0, 9))
def test_fictitious_women_are_truncated_lists(seed, n_men, n_women):
    # §5.6: fictitious women at the end of every man's list, ranking men in any order. The men who
    # end with them are those who stay alone when lists end where partners become unacceptable.
    rng = np.random.default_rng(seed)
    lists, costs = random_market(rng, n_men, n_women, rng.uniform(0.2, 1.0))
    alone, _ = marry(lists, costs, n_women)
    with_fictitious = [[*wishes, *range(n_women, n_women + n_men)] for wishes in lists]
    costs |= {(p, n_women + k): float(rng.random()) for p in range(n_men) for k in range(n_men)}
    full, _ = marry(with_fictitious, costs, n_women + n_men)
    np.testing.assert_array_equal(np.where(full < n_women, full, -1), alone)
    assert (full >= 0).all()


def test_proposals_grow_like_n_log_n():
    # For random lists the mean number of proposals is n H_n (Wilson 1972), far below n².
    rng = np.random.default_rng(0)
    for n in (16, 64, 256):
        counts = []
        for _ in range(30):
            first = np.arange(n + 1, dtype=np.int64) * n
            receivers = np.concatenate([rng.permutation(n) for _ in range(n)]).astype(np.int32)
            _, proposals = am._engine.marry(first, receivers, rng.random(n * n), n)
            counts.append(proposals)
        expected = n * (np.log(n) + 0.5772 + 1 / (2 * n))
        spread = np.std(counts) / np.sqrt(len(counts))
        assert abs(np.mean(counts) - expected) < 4 * spread + 0.06 * expected
        assert max(counts) <= n * n


@pytest.mark.parametrize("proposers", ["tracks", "detections"])
@pytest.mark.parametrize("capacity", [2, 3])
@pytest.mark.parametrize("seed", range(5))
def test_hospitals_and_residents_equal_the_reference_implementation(proposers, capacity, seed):
    scene = am.simulate.walk(n_markers=5, frames=25, rate=10, stride=0.03, seed=seed)
    d = am.simulate.corrupt(
        scene, noise=0.004, missing=0.1, clutter=0.2, doubled=0.4, doubled_apart=0.012, seed=seed
    ).detections
    model = small_model(motion=am.DWNA(acceleration_sigma=5.0, velocity_sigma=0.8))
    method = am.SMP(capacity=capacity, proposers=proposers, merged_within=0.02)
    labels = am.track(d, method, model=model).labels
    by_hand = track_by_hand(d, method, model)
    np.testing.assert_array_equal(labels, by_hand)


def test_a_marker_seen_as_two_blobs_is_one_track():
    scene = am.simulate.smooth(n_markers=10, frames=150, seed=1)
    sensed = am.simulate.corrupt(scene, noise=0.003, doubled=0.7, doubled_apart=0.01, seed=2)
    model = small_model(
        motion=am.DWNA(acceleration_sigma=0.006, velocity_sigma=0.03), max_speed=0.2
    )
    alone, merged = (
        am.evaluate(am.track(sensed.detections, am.SMP(capacity=q), model=model), sensed)
        for q in (1, 2)
    )
    assert merged.n_tracks == 10
    assert alone.n_tracks > 13  # the second blobs become tracks of their own
    assert merged.clutter_labelled_percent < alone.clutter_labelled_percent


def test_merged_blobs_are_measured_between_them():
    # Two blobs as likely as each other: the track goes on between them.
    frames = [[[0.0, 0, 0]], [[0.0, 0, 0]], [[0.0, 0, 0]], [[0.004, 0, 0], [-0.004, 0, 0]]]
    d = am.Detections.from_frames([0.0, 0.1, 0.2, 0.3], frames)
    model = small_model(motion=am.DWNA(acceleration_sigma=0.1, velocity_sigma=0.1))
    for capacity in (1, 2):
        method = am.SMP(capacity=capacity)
        state = method.init(model)
        for time, points in d:
            state, update = method.step(state, time, points)
        assert sorted(update.labels.tolist()) == [-1, 0]
        x = state.live()["means"][0, 0, 0]
        assert (abs(x) < 1e-12) == (capacity == 2)


@pytest.mark.parametrize(
    "wrong",
    [{"capacity": 0}, {"capacity": 1.5}, {"merged_within": 0}, {"capacity": 2, "strict": True}],
)
def test_capacities_that_make_no_sense(wrong):
    with pytest.raises(am.ParameterError, match=next(iter(wrong))):
        am.SMP(**wrong)
