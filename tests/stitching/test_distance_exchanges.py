"""Stretches in which two tracks have each other's marker are found and exchanged back."""

from __future__ import annotations

import numpy as np
import pytest

import asterism as am
from asterism import _engine
from asterism._engine import ExchangeEvidence as By
from asterism.model.compiled import motion_model, steps_of
from asterism.tracking.stitching import exchanged as module
from asterism.tracking.stitching.exchanged import (
    exchanged_back,
    exchanged_by_distances,
    with_markers,
)
from asterism.tracking.stitching.passes import Pass
from tests.references.distance_exchanges import stretches
from tests.scenes import exchanged, sized, steady_and_loose, two_that_circle

NOISE = 1e-3


def positions_of(tracks):
    d = tracks.detections
    positions = np.full((d.n_frames, tracks.n_tracks, d.n_axes), np.nan)
    inside = tracks.labels >= 0
    positions[d.frame_of[inside], tracks.labels[inside]] = d.points[inside]
    return positions


def model_of(d):
    return am.tracking.tracklet_model(am.estimate_model(d).model)


def near_pairs(tracks):
    """Pairs of markers less than 20 cm apart in the median."""
    positions = positions_of(tracks)
    distance = np.linalg.norm(positions[:, :, None] - positions[:, None], axis=3)
    return np.argwhere(np.triu(np.nanmedian(distance, axis=0) < 0.2, 1))


def of_engine(tracks, model, noise=NOISE, evidence=By.medians):
    d, (kind, F, Q) = tracks.detections, steps_of(model.motion, tracks.detections.times)
    order, offsets = tracks.by_track
    found = _engine.exchanged_stretches(
        motion_model(model, d.n_axes), d.times, kind, F, Q, np.ascontiguousarray(d.points[order]),
        d.frame_of[order].astype(np.int64), offsets.astype(np.int64),
        np.ones(tracks.n_tracks, dtype=bool), p_detection=0.9, noise=noise,
        evidence=evidence,
    )  # fmt: skip
    return [
        (*pair.tolist(), *stretch.tolist(), gain)
        for pair, stretch, gain in zip(*found, strict=True)
    ]


def motion_of(tracks, model):
    """Motion at an edge, as the engine's exchanges rate it."""
    d, (kind, F, Q) = tracks.detections, steps_of(model.motion, tracks.detections.times)
    order, offsets = tracks.by_track
    frame = d.frame_of.astype(np.int64)

    def ratio(a, b, t):
        rows = [order[offsets[k] : offsets[k + 1]] for k in (a, b)]
        links = [np.searchsorted(frame[own], t) for own in rows]
        linked = [0 < i < len(own) for i, own in zip(links, rows, strict=True)]
        if not any(linked):
            return 0.0
        if not all(linked):
            side = linked.index(True)
            own, i = frame[rows[side]], links[side]
            return -1.0 if own[i] - own[i - 1] > 4 else -np.inf
        own = np.concatenate(rows)
        return _engine.exchange_ratios(
            motion_model(model, d.n_axes), d.times, kind, F, Q, np.ascontiguousarray(d.points[own]),
            frame[own], np.array([0, len(rows[0]), len(own)]), np.array([t]), p_detection=0.9,
        )[0]  # fmt: skip

    return ratio


def exchanges_of(tracks, model):
    """Ratios of the exchanges of tracks that both go on, by pair and frame."""
    d, (kind, F, Q) = tracks.detections, steps_of(model.motion, tracks.detections.times)
    order, offsets = tracks.by_track
    before, after, ratios, frames = _engine.exchanges(
        motion_model(model, d.n_axes), d.times, kind, F, Q, np.ascontiguousarray(d.points[order]),
        d.frame_of[order].astype(np.int64), offsets.astype(np.int64), p_detection=0.9, n_threads=1,
    )  # fmt: skip
    found = {}
    for i in np.flatnonzero((before >= 0).all(axis=1) & (after >= 0).all(axis=1)):
        pair = tuple(tracks.labels[order[before[i]]].tolist())
        found.setdefault(pair, {})[int(frames[i])] = ratios[i]
    return found


@pytest.mark.parametrize("evidence", By)
@pytest.mark.parametrize("seed", range(sized(4, 1)))
def test_stretches_are_those_of_the_reference(seed, evidence):
    rng = np.random.default_rng(seed)
    person = am.simulate.person(frames=160, seed=seed)
    truth = am.simulate.corrupt(person, missing=0.15, noise=NOISE, seed=seed)
    tracks = am.Tracks(detections=truth.detections, labels=truth.labels)
    pairs = near_pairs(tracks)
    for pair in pairs[rng.choice(len(pairs), 6, replace=False)]:
        first, n = rng.integers(0, 140), rng.integers(5, 60)
        tracks = exchanged(tracks, pair, range(first, first + n))
    model = model_of(tracks.detections)
    found = of_engine(tracks, model, evidence=evidence)
    exchanges = exchanges_of(tracks, model) if evidence is By.motion else None
    motion = motion_of(tracks, model)
    wanted = stretches(positions_of(tracks), NOISE, motion, evidence is not By.medians, exchanges)
    assert [f[:4] for f in found] == [w[:4] for w in wanted]
    assert [f[4] for f in found] == pytest.approx([w[4] for w in wanted], abs=1e-6)
    assert len(found) >= 2


@pytest.mark.parametrize("edges", [(100, 160), (120,)])
def test_an_exchange_is_undone(edges):
    """Two markers of a segment are occluded together, and each comes back as the other."""
    person = am.simulate.person(frames=300, seed=2)
    pairs = near_pairs(person)[::9]
    n_undone = 0
    for pair in pairs:
        frame = person.detections.frame_of
        is_occluded = np.isin(frame, [t for edge in edges for t in range(edge - 25, edge)])
        kept = ~(is_occluded & np.isin(person.labels, pair))
        d = person.detections.keep(kept)
        truth = am.Tracks(detections=d, labels=person.labels[kept])
        wrong = exchanged(truth, pair, range(edges[0], edges[1] if len(edges) > 1 else 300))
        labels, log_odds = exchanged_back(d, wrong.labels.astype(np.int64), model_of(d))
        is_back = am.evaluate(am.Tracks(detections=d, labels=labels), truth).idf1 == 1
        assert is_back or np.array_equal(labels, wrong.labels)
        assert np.isfinite(log_odds).any() == is_back
        n_undone += is_back
    assert n_undone >= 0.8 * len(pairs)


@pytest.mark.parametrize("seed", range(sized(4, 1)))
def test_an_exchange_is_undone_by_the_spreads_of_distances(seed):
    truth = steady_and_loose(seed)
    d, model = truth.detections, model_of(truth.detections)
    wrong = exchanged(truth, (5, 6), range(105, 305)).labels.astype(np.int64)
    labels, _ = exchanged_back(d, wrong, model)
    assert np.array_equal(labels, wrong)
    labels, log_odds = exchanged_back(d, wrong, model, By.spreads)
    assert np.array_equal(labels, truth.labels)
    assert (log_odds[wrong != truth.labels] > 6).all()


@pytest.mark.parametrize("seed", range(sized(4, 1)))
def test_an_exchange_of_tracks_with_the_same_distances_is_undone_by_the_motion(seed):
    truth = two_that_circle(seed)
    d, model = truth.detections, model_of(truth.detections)
    wrong = exchanged(truth, (5, 6), range(150, 260)).labels.astype(np.int64)
    labels, _ = exchanged_back(d, wrong, model, By.spreads)
    assert np.array_equal(labels, wrong)  # not by the distances
    labels, log_odds = exchanged_back(d, wrong, model, By.motion)
    assert np.array_equal(labels, truth.labels)
    assert (log_odds[wrong != truth.labels] > 6).all()


def test_exchanges_that_fit_the_motion_in_several_frames_are_undone():
    """Close together, where detections are missing, as much as the edges of a stretch."""
    n_undone = 0
    for seed in range(12):
        truth = am.simulate.corrupt(two_that_circle(seed, radius=0.01), missing=0.1, seed=seed)
        d, model = truth.detections, model_of(truth.detections)
        first, n = np.random.default_rng(seed).integers((60, 20), (200, 150))
        wrong = exchanged(truth, (5, 6), range(first, first + n)).labels.astype(np.int64)
        labels, _ = exchanged_back(d, wrong, model, By.motion)
        n_undone += am.evaluate(am.Tracks(detections=d, labels=labels), truth).idf1 == 1
    assert n_undone == 12


@pytest.mark.parametrize("stretch", [range(150), range(250, 400)])
def test_tracks_with_the_same_distances_are_joined_by_the_motion_at_one_edge(stretch):
    truth = two_that_circle(1)
    d, model = truth.detections, model_of(truth.detections)
    wrong = exchanged(truth, (5, 6), stretch).labels.astype(np.int64)
    labels, _ = exchanged_back(d, wrong, model, By.motion)
    assert am.evaluate(am.Tracks(detections=d, labels=labels), truth).idf1 == 1


def test_an_exchange_is_made_if_it_is_accepted():
    truth = two_that_circle(1)
    wrong = exchanged(truth, (5, 6), range(150, 260)).labels.astype(np.int64)
    asked = []

    def accepts(before, after, changed):
        asked.append((before, after, changed))
        return False

    labels, log_odds = exchanged_back(
        truth.detections, wrong, model_of(truth.detections), By.motion, accepts
    )
    assert np.array_equal(labels, wrong)
    assert np.isinf(log_odds).all()
    ((before, after, changed),) = asked
    assert np.array_equal(before, wrong)
    assert np.array_equal(after, truth.labels)
    assert np.array_equal(changed, np.flatnonzero(wrong != truth.labels))


@pytest.mark.parametrize("evidence", [By.spreads, By.motion])
@pytest.mark.parametrize("seed", range(sized(4, 1)))
@pytest.mark.parametrize("n_alone", [0, 150, 270])
def test_stretches_by_spreads_are_those_of_the_reference(n_alone, seed, evidence):
    """The swinging marker is exchanged, and absent for a part of that stretch."""
    truth = steady_and_loose(seed, until=450)
    d, frame = truth.detections, truth.detections.frame_of
    is_absent = (truth.labels == 6) & (frame >= 118) & (frame < 118 + n_alone)
    is_missed = np.random.default_rng(seed).uniform(size=len(frame)) < 0.05
    kept = ~is_absent & ~is_missed
    tracks = am.Tracks(detections=d.keep(kept), labels=truth.labels[kept])
    tracks = exchanged(tracks, (5, 6), range(105, 455))
    model = model_of(tracks.detections)
    found = of_engine(tracks, model, evidence=evidence)
    exchanges = exchanges_of(tracks, model) if evidence is By.motion else None
    motion = motion_of(tracks, model)
    wanted = stretches(positions_of(tracks), NOISE, motion, True, exchanges)
    assert [f[:4] for f in found] == [w[:4] for w in wanted]
    assert [f[4] for f in found] == pytest.approx([w[4] for w in wanted], abs=1e-6)
    assert (len(found) > 0) == (n_alone < 270)  # three quarters alone are too many


@pytest.mark.parametrize("evidence", By)
@pytest.mark.parametrize("seed", range(sized(4, 1)))
@pytest.mark.parametrize("scene", ["person", "smooth", "fingers", "cube"])
def test_right_tracks_are_left_alone(scene, seed, evidence):
    size = {"n_markers": 20} if scene == "smooth" else {}
    made = getattr(am.simulate, scene)(frames=200, seed=seed, **size)
    truth = am.simulate.corrupt(made, missing=0.1, noise=NOISE, seed=seed)
    labels = truth.labels.astype(np.int64)
    model = model_of(truth.detections)
    again, log_odds = exchanged_back(truth.detections, labels, model, evidence)
    assert np.array_equal(again, labels)
    assert np.isinf(log_odds).all()


def test_two_axes():
    person = am.simulate.person(frames=200, seed=3)
    d = person.detections
    flat = am.Detections.from_frames(d.times, [d.frame(t)[:, [0, 2]] for t in range(d.n_frames)])
    tracks = am.Tracks(detections=flat, labels=person.labels)
    labels, _ = exchanged_back(flat, tracks.labels.astype(np.int64), model_of(flat))
    assert np.array_equal(labels, tracks.labels)


def test_a_stitching_with_exchanges_is_whole():
    """Each part of a tracklet is a tracklet; each marker has one chain of them."""
    person = am.simulate.person(frames=300, seed=2)
    truth = am.simulate.corrupt(person, missing=0.05, noise=NOISE, seed=2)
    tracks = am.Tracks(detections=truth.detections, labels=truth.labels)
    positions = positions_of(tracks)
    apart = [
        (np.nanmin(np.linalg.norm(positions[:, a] - positions[:, b], axis=1)), a, b)
        for a, b in near_pairs(tracks)
    ]
    model, found = model_of(truth.detections), None
    for _, a, b in sorted(apart)[:12]:
        wrong = exchanged(tracks, (a, b), range(150, 300))
        stitching = am.stitch(wrong, model)
        found = stitching if len(stitching.cuts) else found
        for k in range(stitching.tracks.n_tracks):
            own = np.flatnonzero(stitching.markers == k)
            assert stitching.after[own].tolist() == [-1, *own[:-1]]
        labels = np.append(np.maximum(stitching.markers, -1), -1)[stitching.tracklets]
        assert np.array_equal(labels, stitching.tracks.labels)
        first, _, n = stitching.extents
        assert (np.diff(stitching.tracks.detections.frame_of[first]) >= 0).all()
        assert (n > 0).all()
        assert ((stitching.probabilities > 0) & (stitching.probabilities <= 1)).all()
    assert found is not None


def test_a_join_over_a_part_that_left_is_as_probable_as_the_exchange(monkeypatch):
    """The middle one of three tracklets of a marker moves to another marker."""
    points = [np.zeros((n, 3)) + np.arange(n)[:, None] for n in (2, 1, 2)]
    d = am.Detections.from_frames(np.arange(3) * 0.01, points)
    found = Pass(
        tracklets=np.array([0, 1, 2, 3, 4], dtype=np.int32),
        markers=np.array([0, 1, 0, 0, 1], dtype=np.int32),
        after=np.array([-1, -1, 0, 2, 1], dtype=np.int32),
        probabilities=np.full(5, 0.9),
    )
    log_odds = np.array([np.inf, np.inf, 8.0, np.inf, np.inf])
    monkeypatch.setattr(module, "exchanged_back", lambda *_: (np.array([0, 1, 1, 0, 1]), log_odds))
    after = exchanged_by_distances(d, found, model_of(am.simulate.cube(frames=20).detections))
    assert after.markers.tolist() == [0, 1, 1, 0, 1]
    assert after.after.tolist() == [-1, -1, 1, 0, 2]
    p = 1 / (1 + np.exp(-_engine.Stitcher.ODDS_FACTOR * 8))
    assert after.probabilities.tolist() == pytest.approx([0.9, 0.9, p, p, p])


def test_a_tracklet_ends_where_a_part_of_another_fills_its_gap():
    """Two tracklets in frames 0, 0, 1, 1, 2, 3, 3; the detection of frame 2 moves."""
    found = Pass(
        tracklets=np.array([0, 1, 0, 1, 0, 0, 1, -1, 2], dtype=np.int32),
        markers=np.array([0, 1, -2], dtype=np.int32),
        after=np.full(3, -1, dtype=np.int32),
        probabilities=np.array([1.0, 1.0, 0.6]),
    )
    labels = np.array([0, 1, 0, 1, 1, 0, 1, -1, -1])
    after = with_markers(found, labels, np.where(np.arange(9) == 4, 0.8, np.nan))
    assert after.tracklets.tolist() == [0, 1, 0, 1, 2, 3, 4, -1, 5]
    assert after.markers.tolist() == [0, 1, 1, 0, 1, -2]
    assert after.after.tolist() == [-1, -1, 1, 0, 2, -1]
    assert after.probabilities.tolist() == [1.0, 1.0, 0.8, 0.8, 0.8, 0.6]


def test_detections_take_and_lose_a_marker_of_their_own():
    """Clutter and a ghost are taken by a track, and a detection of another leaves it."""
    found = Pass(
        tracklets=np.array([0, 1, -1, 1, 0, 1, 2, 0], dtype=np.int32),
        markers=np.array([0, 1, -2], dtype=np.int32),
        after=np.full(3, -1, dtype=np.int32),
        probabilities=np.array([1.0, 1.0, 0.6]),
    )
    labels = np.array([0, 1, 0, -1, 0, 1, 1, 0])
    after = with_markers(found, labels, np.full(8, 0.95))
    assert after.tracklets.tolist() == [0, 1, 2, -1, 3, 1, 4, 3]
    assert after.markers.tolist() == [0, 1, 0, 0, 1]
    assert after.after.tolist() == [-1, -1, 0, 2, 1]
    assert after.probabilities[2:].tolist() == [0.95, 0.95, 0.95]


@pytest.mark.parametrize(
    "changes",
    [
        {"noise": -1.0},
        {"p_detection": 1.0},
        {"is_examined": np.ones(3, dtype=bool)},
        {"points": np.full((4, 3), np.nan)},
    ],
)
def test_the_engine_refuses_what_does_not_fit(changes):
    d = am.simulate.cube(frames=20, seed=1).detections
    model = model_of(d)
    kind, F, Q = steps_of(model.motion, d.times)
    given = {
        "motion": motion_model(model, 3), "times": d.times, "kind": kind, "F": F, "Q": Q,
        "points": np.zeros((4, 3)), "frames": np.array([0, 1, 0, 1]),
        "offsets": np.array([0, 2, 4]), "is_examined": np.ones(2, dtype=bool),
        "p_detection": 0.9, "noise": 0.001, "evidence": By.medians,
    }  # fmt: skip
    _engine.exchanged_stretches(**given)
    with pytest.raises(ValueError, match=next(iter(changes))):
        _engine.exchanged_stretches(**given | changes)
