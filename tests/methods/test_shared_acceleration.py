"""Markers that accelerate together: the density, what is learnt, and the chain that samples it."""

from __future__ import annotations

import dataclasses
import itertools

import numpy as np
import pytest

import asterism as am
from asterism.errors import ParameterError
from asterism.model import SharedAcceleration
from asterism.model.shared_acceleration import COMPONENTS, N_OWN, shared_densities
from asterism.tracking.attempts.posterior import within_limits
from asterism.tracking.estimation.evidence import Region
from tests.references import shared_acceleration as reference
from tests.references.chain_moves import as_partition, make_chain
from tests.scenes import interacting, small_model

WEIGHTS = np.array([0.04, 0.01, 0.02, 0.03, 0.15, 0.1, 0.2, 0.1, 0.05, 0.2, 0.1])
BEGIN_WEIGHTS = np.array([0.2, *[0] * 7, 0.8, 0, 0])
VOLUME = 3.0


def segments(rng, sizes, n_frames, *, n_axes=3, jump=0.05, own=0.002, turn=0.1):
    """Positions (T, K, D) of segments that turn and jump, and the shape of each marker."""
    places, shapes = [], []
    for number, size in enumerate(sizes):
        shape = rng.normal(0, 0.1, (size, n_axes))
        at, angle, velocity = rng.normal(0, 0.1, n_axes) + number, 0.0, np.zeros(n_axes)
        track = []
        for _ in range(n_frames):
            velocity = 0.5 * velocity + rng.normal(0, jump, n_axes)
            at, angle = at + velocity, angle + rng.normal(0, turn)
            R = np.eye(n_axes)
            R[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
            track.append(shape @ R.T + at + rng.normal(0, own, (size, n_axes)))
        places.append(np.array(track))
        shapes.append(shape)
    return np.concatenate(places, axis=1), shapes


def made_by_hand(shapes, weights=WEIGHTS, *, unknown=()):
    """A `SharedAcceleration` with a bond of each marker to all before it in its segment."""
    offsets, others, of, own = [0], [], [], []
    first = 0
    for shape in shapes:
        for k in range(len(shape)):
            others += list(range(first, first + k))
            of += [np.full(shape.shape[1], np.nan) if j in unknown else shape[j] for j in range(k)]
            own.append(shape[k])
            offsets.append(len(others))
        first += len(shape)
    own = np.array(own)
    marker = np.repeat(np.arange(len(own)), np.diff(offsets))
    distances = np.linalg.norm(own[marker] - own[others], axis=1)
    return SharedAcceleration(
        offsets=np.array(offsets), others=np.array(others, dtype=np.int32), distances=distances,
        variances=2e-6 + (0.01 * distances) ** 2 * (1 + marker), own_shape=own,
        shape=np.reshape(of, (-1, own.shape[1])), weights=np.tile(weights, (len(own), 1)),
        begin_weights=np.tile(BEGIN_WEIGHTS, (len(own), 1)), volume=VOLUME,
    )  # fmt: skip


def tracks_of(rng, places, *, missing=0.1, extra=None):
    """Tracks of the positions, in which some detections are missing."""
    kept = rng.random(places.shape[:2]) >= missing
    kept[:2] = True
    T = len(places)
    labels = np.concatenate([np.flatnonzero(row) for row in kept])
    points = np.concatenate([each[row] for each, row in zip(places, kept, strict=True)])
    offsets = np.append(0, np.cumsum(kept.sum(axis=1)))
    covariances = None
    if extra is not None:
        covariances = rng.uniform(0, extra, (len(points), 1, 1)) * np.eye(places.shape[2])
    d = am.Detections(
        times=0.1 * np.arange(T), offsets=offsets, points=points, covariances=covariances
    )
    return am.Tracks(detections=d, labels=labels)


MODELS = {"one motion": small_model(), "several": small_model(motion=interacting())}


@pytest.mark.parametrize("n_axes", [2, 3])
@pytest.mark.parametrize("model", list(MODELS.values()), ids=list(MODELS))
@pytest.mark.parametrize("extra", [None, 1e-4], ids=["same noise", "own noise"])
def test_densities_are_those_of_the_reference(n_axes, model, extra):
    rng = np.random.default_rng(n_axes)
    places, shapes = segments(rng, (8, 4, 1), 30, n_axes=n_axes)
    tracks = tracks_of(rng, places, missing=0.25, extra=extra)
    shared = made_by_hand(shapes, unknown=(1,))
    # Track 3 is of no marker, and track 4 of a marker that track 5 is of as well. Tracks 13
    # to 16 continue the last markers of the first segment, and begin where neighbours are missing.
    labels, frame = tracks.labels.copy(), tracks.detections.frame_of
    for k, begin in ((6, 10), (7, 8), (14, 12), (15, 15)):
        labels[(labels == k) & (frame >= begin)] = labels.max() + 1
    tracks = am.Tracks(detections=tracks.detections, labels=labels)
    markers = np.append(np.arange(13), [6, 7, 7, 7])
    markers[3], markers[4] = -1, 5
    found, predicted = shared_densities(tracks, model, shared, markers)
    expected, moments = reference.densities(
        tracks.detections, model, shared, tracks.labels, markers
    )
    assert np.array_equal(np.isnan(found), np.isnan(expected))
    np.testing.assert_allclose(found, expected, rtol=1e-7, atol=1e-7)
    np.testing.assert_allclose(predicted, moments, rtol=1e-7, atol=1e-9)
    assert np.isfinite(found).sum(axis=0).min() >= 8  # every component is there somewhere
    gains = am.model.shared_gains(tracks, model, shared, markers)
    is_counted = np.arange(tracks.n_tracks) % 3 == 1  # the others are still neighbours
    some = am.model.shared_gains(tracks, model, shared, markers, is_counted)
    is_of_them = np.append(is_counted, False)[tracks.labels]
    np.testing.assert_array_equal(some, np.where(is_of_them, gains, 0))
    first = {int(np.flatnonzero(tracks.labels == k)[0]) for k in range(tracks.n_tracks)}
    assert np.isfinite(found[[*first], COMPONENTS.index("shape")]).sum() >= 3
    for i in range(len(gains)):
        has = np.isfinite(expected[i, 0])
        weights = BEGIN_WEIGHTS if i in first else WEIGHTS
        by_hand = reference.gains(expected[i], weights) if has else 0.0
        assert gains[i] == pytest.approx(by_hand, rel=1e-7, abs=1e-7)


def test_the_density_of_a_detection_has_the_integral_1():
    rng = np.random.default_rng(3)
    places, shapes = segments(rng, (5,), 5, n_axes=2, jump=0.02)
    model, shared = small_model(), made_by_hand(shapes)
    grid = places[-1, -1] + np.stack(
        np.meshgrid(*[np.linspace(-0.6, 0.6, 241)] * 2), axis=-1
    ).reshape(-1, 2)
    tracks = tracks_of(rng, places, missing=0)
    total = 0.0
    cell = (1.2 / 240) ** 2
    for y in grid[np.linalg.norm(grid - places[-1, -1], axis=1) < 0.25][::4]:
        points = tracks.detections.points.copy()
        points[-1] = y
        moved = dataclasses.replace(
            tracks, detections=dataclasses.replace(tracks.detections, points=points)
        )
        own = shared_densities(moved, model, shared)[0][-1, 0]
        total += np.exp(own + am.model.shared_gains(moved, model, shared)[-1]) * cell * 4
    assert total == pytest.approx(1, abs=0.03)


def test_the_density_of_a_first_detection_has_the_integral_1():
    """The grid holds all of the density by the shape, and its share of the volume."""
    rng = np.random.default_rng(3)
    places, shapes = segments(rng, (5,), 5, n_axes=2, jump=0.02)
    model, shared = small_model(), made_by_hand(shapes)
    side, n = 0.5, 251
    grid = places[-1, -1] + np.stack(np.meshgrid(*[np.linspace(-side, side, n)] * 2), -1)
    tracks = tracks_of(rng, places, missing=0)
    labels = np.where(tracks.labels == 4, -1, tracks.labels)
    labels[-1] = 4
    total = 0.0
    for y in grid.reshape(-1, 2):
        points = tracks.detections.points.copy()
        points[-1] = y
        d = dataclasses.replace(tracks.detections, points=points)
        gain = am.model.shared_gains(am.Tracks(detections=d, labels=labels), model, shared)[-1]
        total += np.exp(gain) / VOLUME * (2 * side / (n - 1)) ** 2
    by_shape = 1 - BEGIN_WEIGHTS[0]
    assert total == pytest.approx(by_shape + BEGIN_WEIGHTS[0] * (2 * side) ** 2 / VOLUME, abs=0.01)


def test_the_first_detection_of_a_track_says_which_marker_it_is_of():
    rng = np.random.default_rng(6)
    places, _ = segments(rng, (8,), 200, jump=0.03, own=1e-3)
    tracks = tracks_of(rng, places, missing=0.05)
    model = small_model(noise_sigma=1e-3)
    shared = am.tracking.learn_shared_acceleration(tracks, model)
    # Marker 7 is absent for long, and its second track begins in frame 150.
    d = tracks.detections
    is_second = (tracks.labels == 7) & (d.frame_of >= 150)
    is_absent = (tracks.labels == 7) & (d.frame_of >= 100) & (d.frame_of < 150)
    others = (tracks.labels == 6) & (d.frame_of >= 100)
    labels = np.where(is_second, 8, np.where(is_absent | others, -1, tracks.labels))
    apart, first = am.Tracks(detections=d, labels=labels), int(np.flatnonzero(is_second)[0])
    gains = {
        marker: am.model.shared_gains(apart, model, shared, np.append(np.arange(8), marker))[first]
        for marker in (6, 7)
    }
    assert gains[7] > 5
    assert gains[6] < np.log(2 * shared.begin_weights[6, 0])


def test_markers_of_a_segment_are_learnt_to_move_together_and_others_not():
    rng = np.random.default_rng(4)
    places, _ = segments(rng, (8,), 400, jump=0.03, own=1e-3)
    walk = rng.normal(0, 0.03, (400, 4, 3)).cumsum(axis=0) + 2
    tracks = tracks_of(rng, np.concatenate([places, walk], axis=1), missing=0.05)
    model = small_model(noise_sigma=1e-3)
    shared = am.tracking.learn_shared_acceleration(tracks, model)
    assert (np.diff(shared.offsets)[1:8] == np.arange(1, 8)).all()
    assert (np.diff(shared.offsets)[8:] == 0).all()
    assert (shared.weights[4:8, :N_OWN].sum(axis=1) < 0.08).all()
    np.testing.assert_allclose(shared.weights.sum(axis=1), 1)
    gains = am.model.shared_gains(tracks, model, shared)
    assert not gains[tracks.labels >= 8].any()
    of_segment = gains[(tracks.labels >= 3) & (tracks.labels < 8)]
    assert of_segment.mean() > 3


@pytest.mark.parametrize("n_axes", [2, 3])
def test_a_track_begins_in_the_volume_of_the_estimated_model(n_axes):
    rng = np.random.default_rng(1)
    places, _ = segments(rng, (5,), 60, n_axes=n_axes)
    places[..., -1] *= 1e-3  # flat
    tracks = tracks_of(rng, places)
    shared = am.tracking.learn_shared_acceleration(tracks, small_model())
    assert shared.volume == pytest.approx(Region.of(tracks.detections).volume)
    np.testing.assert_allclose(shared.begin_weights.sum(axis=1), 1)
    assert (shared.begin_weights[:, 0] >= 0.03).all()


def test_a_track_without_detections_adds_nothing():
    truth = am.simulate.cube(frames=30, seed=1)
    with_empty = am.Tracks(detections=truth.detections, labels=truth.labels, names=(None,) * 9)
    model = am.estimate_model(truth.detections).model
    shared = am.tracking.learn_shared_acceleration(with_empty, model)
    gains = am.model.shared_gains(with_empty, model, shared)
    assert np.array_equal(gains, am.model.shared_gains(truth, model, shared))


def test_of_clutter_nothing_is_learnt():
    truth = am.simulate.cube(frames=30, seed=1)
    clutter = am.Tracks(detections=truth.detections, labels=np.full(len(truth.labels), -1))
    model = am.estimate_model(truth.detections).model
    shared = am.tracking.learn_shared_acceleration(clutter, model)
    assert shared.weights.shape == (0, len(COMPONENTS))
    assert not am.model.shared_gains(clutter, model, shared).any()


def test_weights_are_those_from_which_detections_were_drawn():
    """Field accelerations with known shares: each is learnt within three standard errors."""
    rng = np.random.default_rng(5)
    densities = rng.normal(0, 3, (20_000, len(COMPONENTS)))
    # Draw the component of each detection, and reject: p(c | densities) ∝ w_c exp(density).
    from asterism.tracking.rigidity.shared import MIN_OWN, fitted_weights

    weights = WEIGHTS / WEIGHTS.sum()
    mixture = np.exp(densities) @ weights / np.exp(densities).mean(axis=1)
    kept = rng.random(len(densities)) < mixture / mixture.max()
    found = fitted_weights(densities[kept], np.zeros(int(kept.sum()), dtype=np.int64), 1)[0]
    found[0] -= MIN_OWN
    found /= 1 - MIN_OWN
    share = np.exp(densities[kept]) * weights
    share /= share.sum(axis=1, keepdims=True)
    information = (share / weights).T @ (share / weights)
    error = np.sqrt(np.diag(np.linalg.inv(information)))
    assert (np.abs(found - weights) < 3 * error + 1e-3).all()


def markers_of(labels, given):
    """The marker of each track, which is the first label given to its detections, -1 for none."""
    own = [given[labels == k] for k in range(labels.max() + 1)]
    return np.array([next(iter(each[each >= 0]), -1) for each in own], dtype=int)


class Enumerated:
    """All partitions of the last frames, given the tracks before, with their posteriors."""

    def __init__(self, tracks, model, shared, n_open) -> None:
        self.tracks, self.model, self.shared = tracks, model, shared
        d = tracks.detections
        self.first = d.n_frames - n_open
        self.settled = np.where(d.frame_of < self.first, tracks.labels, -1)
        self.found: dict[frozenset, float] = {}
        self._extend(self.first, self.settled)
        totals = np.array(list(self.found.values()))
        p = np.exp(totals - totals.max())
        self.p = dict(zip(self.found, p / p.sum(), strict=True))

    def _extend(self, t, labels) -> None:
        d = self.tracks.detections
        if t == d.n_frames:
            return self._score(labels)
        here = np.arange(d.offsets[t], d.offsets[t + 1])
        K = self.tracks.n_tracks
        # Labels from K on are of tracks that begin in the open frames: one for each detection.
        begun = K + np.flatnonzero(d.frame_of[: here[0]] >= self.first)
        choices = [[-1, *range(K), *begun, K + i] for i in here]
        for chosen in itertools.product(*choices):
            used = [c for c in chosen if c >= 0]
            if len(set(used)) == len(used):
                after = labels.copy()
                after[here] = chosen
                self._extend(t + 1, after)
        return None

    def _score(self, labels) -> None:
        kept = np.flatnonzero(labels >= 0)
        values, counts = np.unique(labels[kept], return_counts=True)
        if (counts < 2).any():
            return
        number = {v: k for k, v in enumerate(values.tolist())}
        dense = np.array([number.get(v, -1) for v in labels.tolist()])
        tracks = am.Tracks(detections=self.tracks.detections, labels=dense)
        own = am.log_posterior(tracks, self.model)
        if np.isfinite(own):
            markers = markers_of(dense, self.tracks.labels)
            gain = am.model.shared_gains(tracks, self.model, self.shared, markers).sum()
            self.found[frozenset(as_partition(dense))] = own + gain

    def total_variation(self, n_moves, *, with_shared=True, seed=0):
        d = self.tracks.detections
        chain = make_chain(d, self.model, informed=True, seed=seed)
        chain.assign(self.settled)
        if with_shared:
            chain.give(self.tracks.labels, self.shared.compiled)
        chain.freeze(self.first - 1)
        chain.run(1000)
        labels, counts = chain.visits(n_moves)
        visited = {
            frozenset(as_partition(w)): n / n_moves for w, n in zip(labels, counts, strict=True)
        }
        assert set(visited) <= set(self.p)
        return 0.5 * sum(abs(p - visited.get(w, 0)) for w, p in self.p.items())


def two_segments(seed):
    """Two segments of three markers that meet: three open detections of each, and clutter."""
    rng = np.random.default_rng(seed)
    places, shapes = segments(rng, (3, 3), 5, n_axes=2, jump=0.08, own=0.004, turn=0.3)
    places[:, 3:] += places[-1, :1] - places[-1, 3:4] + 0.08
    return rng, places, shapes


SIZES = {"few neighbours": (5, 3), "more neighbours than are used": (12, 3)}
"""Markers of two segments. A marker is predicted with at most six of those before it."""

FAST = am.DWNA(acceleration_sigma=20.0, velocity_sigma=0.8)


@pytest.mark.parametrize("seed", [1, 4, 6])
def test_the_chain_samples_two_segments_as_enumerated(seed):
    rng, places, shapes = two_segments(seed)
    tracks = tracks_of(rng, places[:, [0, 1, 2, 3, 4]], missing=0)
    shared = made_by_hand([shapes[0], shapes[1][:2]])
    problem = Enumerated(tracks, small_model(motion=FAST, max_speed=8.0), shared, 1)
    assert len(problem.p) > 100
    assert problem.total_variation(1_000_000) < 0.01
    assert problem.total_variation(300_000, with_shared=False) > 0.3


@pytest.mark.parametrize(
    ("seed", "n", "n_open"),
    [(2, 3, 2), (4, 3, 2), (6, 3, 2), (7, 2, 3), (9, 2, 3), (12, 2, 3)],
)
def test_the_chain_samples_several_open_frames_as_enumerated(seed, n, n_open):
    """A change in a frame changes the terms of the next two frames, and tracks may begin."""
    rng, places, shapes = two_segments(seed)
    tracks = tracks_of(rng, places[:, :n], missing=0)
    model = small_model(motion=FAST, max_speed=8.0)
    problem = Enumerated(tracks, model, made_by_hand([shapes[0][:n]]), n_open)
    assert len(problem.p) > 300
    assert problem.total_variation(300_000) < 0.01
    assert problem.total_variation(100_000, with_shared=False) > 0.2


@pytest.mark.parametrize("motion", [FAST, interacting()], ids=["one motion", "several"])
@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("sizes", SIZES.values(), ids=SIZES)
def test_the_gain_of_each_move_is_the_difference_of_the_posteriors(sizes, seed, motion):
    """Over several open frames, with gaps, and tracks of the same marker or of none."""
    rng = np.random.default_rng(seed)
    places, shapes = segments(rng, sizes, 8, n_axes=2 + seed % 2, jump=0.04, own=0.004)
    second = places[:, sizes[0] :]
    second += places[-1, :1] - second[-1, :1] + 0.05
    tracks = tracks_of(rng, places, missing=0.2)
    model, shared = small_model(motion=motion, max_speed=8.0), made_by_hand(shapes)
    d, given = tracks.detections, tracks.labels.copy()
    given[rng.random(len(given)) < 0.1] = -1
    start = np.where(d.frame_of < 3, tracks.labels, -1)
    chain = make_chain(d, model, informed=True, seed=seed)
    chain.assign(start)
    chain.give(given, shared.compiled)
    chain.freeze(1)
    chain.run(500)
    # A track of which a detection is settled keeps the marker that it had then.
    at_start = np.append(markers_of(start, given), -1)
    settled = np.where(d.frame_of <= 1, at_start[start], given)

    def posterior(labels):
        number = {v: k for k, v in enumerate(np.unique(labels[labels >= 0]).tolist())}
        dense = np.array([number.get(v, -1) for v in labels.tolist()])
        found = am.Tracks(detections=d, labels=dense)
        gains = am.model.shared_gains(found, model, shared, markers_of(dense, settled))
        return am.log_posterior(found, model) + gains.sum()

    moves = chain.trace(300)
    assert len(moves) > 100
    for _, _, before, after, _, _, gain, *_ in moves:
        assert gain == pytest.approx(posterior(after) - posterior(before), rel=1e-7, abs=1e-6)


@pytest.mark.parametrize("motion", [FAST, interacting()], ids=["one motion", "several"])
@pytest.mark.parametrize(("n_frames", "within"), [(8, 1e-6), (40, 1e-3)])
@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("sizes", SIZES.values(), ids=SIZES)
def test_the_gain_of_a_move_while_tracks_get_and_lose_their_first_label(
    sizes, seed, n_frames, within, motion
):
    """No frame is settled, and half of the detections have no label.

    Over many frames the filter forgets a move, and later gains are taken to be the same.
    """
    rng = np.random.default_rng(seed)
    places, shapes = segments(rng, sizes, n_frames, n_axes=2 + seed % 2, jump=0.04, own=0.004)
    second = places[:, sizes[0] :]
    second += places[-1, :1] - second[-1, :1] + 0.05
    tracks = tracks_of(rng, places, missing=0.2)
    model, shared = small_model(motion=motion, max_speed=8.0), made_by_hand(shapes)
    d, given = tracks.detections, tracks.labels.copy()
    given[rng.random(len(given)) < 0.5] = -1
    chain = make_chain(d, model, informed=True, seed=seed)
    start = np.where(d.frame_of < n_frames - 5, within_limits(tracks, model).labels, -1)
    start[np.isin(start, np.flatnonzero(np.bincount(start + 1)[1:] == 1))] = -1
    chain.assign(start)
    chain.give(given, shared.compiled)
    chain.run(500)

    def posterior(labels):
        number = {v: k for k, v in enumerate(np.unique(labels[labels >= 0]).tolist())}
        dense = np.array([number.get(v, -1) for v in labels.tolist()])
        found = am.Tracks(detections=d, labels=dense)
        gains = am.model.shared_gains(found, model, shared, markers_of(dense, given))
        return am.log_posterior(found, model) + gains.sum()

    moves = chain.trace(300)
    assert len(moves) > 100
    for _, _, before, after, _, _, gain, *_ in moves:
        change = posterior(after) - posterior(before)
        assert gain == pytest.approx(change, rel=0.1 * within, abs=within)


def test_mcmcda_keeps_fast_segments_apart_by_their_acceleration():
    rng = np.random.default_rng(7)
    places, _ = segments(rng, (7, 7), 150, jump=0.08, own=1e-3, turn=0.2)
    places[:, 7:] += places[:, :1] - places[:, 7:8] + 0.15  # they move through each other
    truth = tracks_of(rng, places, missing=0.05)
    model = small_model(
        noise_sigma=1e-3, motion=am.DWNA(acceleration_sigma=15.0, velocity_sigma=1.0), max_speed=8.0
    )
    shared = am.tracking.learn_shared_acceleration(truth, model)
    method = am.MCMCDA(moves=20, confidence=0)
    scores = []
    for given in (None, shared):
        state = method.init(model, seed=1, start=truth.labels, shared=given)
        _, labels, _ = method.run(state, truth.detections)
        found = am.Tracks(detections=truth.detections, labels=labels)
        scores.append(am.evaluate(found, truth).idf1)
    assert scores[1] > scores[0] + 0.1


@pytest.mark.parametrize(("n_frames", "seed"), [(60, 0), (60, 1), (140, 0), (140, 1)])
def test_a_search_of_a_whole_capture_makes_it_more_probable(n_frames, seed):
    """In one block, and in two: the posterior includes the neighbours before and after a block."""
    rng = np.random.default_rng(seed)
    places, _ = segments(rng, (6, 6), n_frames, jump=0.08, own=1e-3, turn=0.2)
    places[:, 6:] += places[:, :1] - places[:, 6:7] + 0.15
    truth = tracks_of(rng, places, missing=0.05)
    model = small_model(
        noise_sigma=1e-3, motion=am.DWNA(acceleration_sigma=15.0, velocity_sigma=1.0), max_speed=8.0
    )
    shared = am.tracking.learn_shared_acceleration(truth, model)

    def posterior(labels):
        found = am.Tracks(detections=truth.detections, labels=labels)
        gains = am.model.shared_gains(found, model, shared, markers_of(found.labels, truth.labels))
        return am.log_posterior(found, model) + gains.sum()

    found = []
    for moves in (0, 1, 20):
        method = am.MCMCDA(window=None, moves=moves, end_odds=1, confidence=0)
        state = method.init(model, seed=seed, start=truth.labels, shared=shared)
        found.append(posterior(method.run(state, truth.detections)[1]))
    assert found[0] == pytest.approx(posterior(truth.labels))
    assert found[1] > found[0]
    assert found[2] > found[1]


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_search_takes_unlabelled_detections_before_a_track(seed):
    """The track stays of its marker, whose neighbours it follows."""
    rng = np.random.default_rng(seed)
    places, _ = segments(rng, (7, 7), 25, jump=0.005, own=1e-3, turn=0.05)
    truth = tracks_of(rng, places, missing=0.05)
    model = small_model(
        noise_sigma=1e-3, motion=am.DWNA(acceleration_sigma=15.0, velocity_sigma=1.0), max_speed=8.0
    )
    shared = am.tracking.learn_shared_acceleration(truth, model)
    is_lost = (truth.labels == 5) & (truth.detections.frame_of < 6)
    given = np.where(is_lost, -1, truth.labels)
    method = am.MCMCDA(window=None, moves=20, end_odds=1, confidence=0)
    state = method.init(model, seed=seed, start=given, shared=shared)
    labels = method.run(state, truth.detections)[1]
    assert (markers_of(labels, given)[labels[is_lost]] == 5).all()


def test_a_search_takes_lost_detections_in_every_block_and_exchanges_no_markers():
    """Blocks have 100 frames; tracks are lost in the first 40, which are in one block only."""
    taken = []
    for seed in range(6):
        rng = np.random.default_rng(seed)
        places, _ = segments(rng, (6, 6), 190, jump=0.05, own=1e-3, turn=0.2)
        places[:, 6:] += places[:, :1] - places[:, 6:7] + 0.15
        truth = tracks_of(rng, places, missing=0.05)
        motion = am.DWNA(acceleration_sigma=15.0, velocity_sigma=1.0)
        model = small_model(noise_sigma=1e-3, motion=motion, max_speed=8.0)
        shared = am.tracking.learn_shared_acceleration(truth, model)
        is_lost = (rng.random(len(truth.labels)) < 0.1) & (truth.detections.frame_of < 40)
        given = np.where(is_lost, -1, truth.labels)
        method = am.MCMCDA(window=None, moves=20, end_odds=1, confidence=0)
        state = method.init(model, seed=seed, start=given, shared=shared)
        labels = method.run(state, truth.detections)[1]
        markers = np.append(markers_of(labels, given), -1)[labels]
        taken.append((markers == truth.labels)[is_lost])
        is_last = (truth.detections.frame_of == 189) & (given >= 0)
        assert (markers == given)[is_last].all()
    assert np.concatenate(taken).mean() > 0.9
    assert min(each.mean() for each in taken) > 0.75


@pytest.mark.parametrize("window", [10, None])
def test_the_result_is_the_same_for_any_number_of_threads(window):
    rng = np.random.default_rng(8)
    places, _ = segments(rng, (6, 6), 60 if window else 140, jump=0.08, own=1e-3)
    truth = tracks_of(rng, places, missing=0.05)
    model = small_model(
        noise_sigma=1e-3, motion=am.DWNA(acceleration_sigma=15.0, velocity_sigma=1.0), max_speed=8.0
    )
    shared = am.tracking.learn_shared_acceleration(truth, model)
    found = []
    for threads in (1, 2):
        method = am.MCMCDA(window=window, moves=5, confidence=5, threads=threads, chains=2)
        state = method.init(model, seed=1, start=truth.labels, shared=shared)
        found.append(method.run(state, truth.detections)[1:])
    assert np.array_equal(found[0][0], found[1][0])
    assert np.array_equal(found[0][1], found[1][1])


def test_mistakes_are_told():
    truth = am.simulate.person(frames=40, seed=1)
    model = am.estimate_model(truth.detections).model
    shared = am.tracking.learn_shared_acceleration(truth, model)
    with pytest.raises(ParameterError, match="one marker for each label"):
        am.MCMCDA().init(model, start=truth.labels + 1, shared=shared)
    with pytest.raises(ParameterError, match="shared"):
        am.MCMCDA().init(model, start=truth.labels, shared=3)
    with pytest.raises(ParameterError, match="without labels"):
        am.MCMCDA().init(model, shared=shared)
    with pytest.raises(ParameterError, match="markers"):
        am.model.shared_gains(truth, model, shared, np.zeros(3, dtype=int))
    with pytest.raises(ParameterError, match="markers"):
        am.model.shared_gains(truth, model, shared, np.full(truth.n_tracks, 99))
