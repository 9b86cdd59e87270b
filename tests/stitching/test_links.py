"""Links of the stitcher: remembered distances, densities of carried markers, ghosts, streams."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

import asterism as am
from asterism import _engine
from asterism.model.compiled import motion_model, transition
from asterism.tracking.stitching.passes import Pass, go_through
from asterism.tracking.stitching.whole import stitch_options
from tests.stitching.one_pass import BODY, MODEL, PLACE, WEIGHT, one_pass, scene


@pytest.mark.parametrize("place", [PLACE, BODY[0] + [0, 0.04, 0]])
def test_what_is_short_among_bodies_is_a_ghost(place):
    found = one_pass(scene((100, 105, place)))
    assert found.marker[8] == -2
    found = one_pass(scene((100, 130, place)))
    assert found.marker[8] == 8


@pytest.mark.parametrize(("first", "marker"), [(285, 8), (286, -2), (299, -2)])
def test_what_comes_up_too_late_to_be_decided_upon_is_a_ghost(first, marker):
    assert one_pass(scene((first, 299, PLACE))).marker[8] == marker


@pytest.mark.parametrize("frames", [1, 14, 15])
def test_what_is_there_from_the_start_of_a_short_capture_is_no_ghost(frames):
    assert one_pass(scene(frames=frames)).marker == list(range(8))


@pytest.mark.parametrize(("off", "is_ghost"), [(0.05, True), (0.5, False)])
def test_where_there_are_no_bodies_ghosts_are_short_and_beside_a_marker(off, is_ghost):
    dense = scene((100, 105, np.zeros(3)), body=BODY[:4])
    walks = np.random.default_rng(2).normal(scale=0.02, size=(300, 4, 3))
    dense[:, :4] += np.cumsum(walks, axis=0)
    dense[100:106, 4] = dense[100:106, 0] + [0, 0, off]
    found = one_pass(dense, may_cut=False)
    assert found.marker[4] == (-2 if is_ghost else 4)


@pytest.mark.parametrize(("gap", "goes_on"), [(3, True), (4, False)])
def test_a_label_goes_on_through_the_longest_gap(gap, goes_on):
    dense = scene((0, 99, PLACE))
    dense[40 : 40 + gap, 8] = np.nan
    found = one_pass(dense)
    assert len(found.marker) == 10 - goes_on
    assert set(found.after[9:]) <= {8}  # a new fragment, and the same marker


def test_a_label_whose_marker_was_found_elsewhere_begins_anew():
    # 8 pauses, 9 takes its place and is known after 5 frames; then the label comes back far away.
    model = dataclasses.replace(MODEL, population=dataclasses.replace(MODEL.population, max_gap=12))
    dense = scene((0, 60, PLACE), (61, 299, PLACE))
    dense[68:, 8] = PLACE + np.array([0, 0, 0.3])
    found = one_pass(dense, model=model, confirm=5, may_cut=False)
    assert found.marker[8:] == [8, 8, 9]
    assert found.after[8:] == [-1, 8, -1]


def test_cut_fragments_are_those_of_the_points():
    # Label 3 jumps to 8's place and 8 to 3's: both are cut, and each goes on with the other.
    dense = scene((0, 299, PLACE))
    dense[150:, [3, 8]] = dense[150:, [8, 3]]
    found = one_pass(dense)
    assert found.n_cuts >= 2
    frames, labels = np.divmod(np.arange(300 * 9), 9)
    late = frames >= 150
    assert set(found.tracklets[~late & (labels == 3)]) == {3}
    assert len(set(found.tracklets[late & (labels == 3)])) == 1
    marker = np.array(found.marker)[found.tracklets]
    np.testing.assert_array_equal(marker[late & (labels == 3)], 8)
    np.testing.assert_array_equal(marker[late & (labels == 8)], 3)


def test_a_link_is_not_cut_where_the_steady_know_it():
    # What is nearest to the marker never held still, and now jumps; its body is farther away.
    t = np.arange(300)
    dense = scene((0, 299, PLACE), body=np.concatenate([BODY, PLACE + 0.1 * BODY]))
    dense[:, 8:16, 0] += (0.05 * np.sin(0.05 * t) + 0.15 * (t >= 200))[:, None]
    assert one_pass(dense).n_cuts == 0


def test_a_marker_occluded_for_too_long_is_forgotten():
    dense = scene((0, 60, PLACE), (200, 299, PLACE))
    # It must still be known when its fragment is decided upon.
    assert one_pass(dense, max_occlusion=153).marker[9] == 8
    assert one_pass(dense, max_occlusion=152).marker[9] == 9


def test_where_there_is_no_body_a_marker_goes_on_as_it_moved():
    t = np.arange(120)[:, None] / 100
    way = [1, 2, 0] * t
    dense = np.stack([way, way], axis=1)
    dense[60:, 0] = dense[:75, 1] = np.nan
    found = one_pass(dense)
    assert found.marker == [0, 0]
    assert 0.7 < found.probability[1] < 0.999
    dense[75:, 1] += [0, 0.4, 0]
    assert one_pass(dense).marker == [0, 1]


def test_a_backward_pass_is_a_forward_one_through_the_capture_reversed():
    truth = am.simulate.corrupt(am.simulate.person(seed=1), burst=am.simulate.Burst(), seed=1)
    d = truth.detections
    inside = d.frame_of < 120
    d = am.Detections(times=d.times[:120], offsets=d.offsets[:121], points=d.points[inside])
    model = am.tracking.tracklet_model(MODEL)
    labels = am.track(d, am.GNN(), model=model).labels
    turned = am.Detections(
        times=-d.times[::-1], offsets=d.n_points - d.offsets[::-1], points=d.points[::-1]
    )
    options = stitch_options(model, 15, 0.03, None)
    back = go_through(d, labels, model, options, backward=True)
    there = go_through(turned, labels[::-1], model, options)
    np.testing.assert_array_equal(back.tracklets[::-1], there.tracklets)
    np.testing.assert_array_equal(back.markers, there.markers)
    np.testing.assert_array_equal(back.after, there.after)


def test_a_pass_advises_whom_its_joins_come_from():
    advice: list[Any] = []

    class Listener:
        def advise(self, labels, before, weights):
            advice.extend(zip(labels.tolist(), before.tolist(), weights, strict=True))

    found = Pass(
        tracklets=np.zeros(0, np.int32), markers=np.array([0, 1, 0, 0, -2, 1], np.int32),
        after=np.array([-1, -1, 0, 2, -1, 1], np.int32),
        probabilities=np.array([1, 1, 1 / (1 + np.exp(-0.5)), 1, 0.9, 0.1]),
    )  # fmt: skip
    found.advise(Listener())  # pyright: ignore[reportArgumentType]
    # 2 went on with 0: in the other direction 0 goes on with 2.
    assert [(label, before) for label, before, _ in advice] == [(0, 2), (2, 3), (1, 5)]
    assert [weight for *_, weight in advice] == pytest.approx([0.5 / WEIGHT, 5, 1])


def stream(dense, *, lag=2, confirm=15, revise=None, labels=None):
    """Labels in the end, and the revisions of each frame as (detection, marker)."""
    options = stitch_options(MODEL, confirm, 0.03, None)
    live = _engine.LiveStitcher(motion_model(MODEL, 3), options, lag=lag)
    F, Q = transition(MODEL.motion, 0.01)
    final: list[int] = []
    revised: list[list[tuple[int, int]]] = []
    for t, points in enumerate(dense):
        seen = np.isfinite(points[:, 0])
        own = np.flatnonzero(seen) if labels is None else labels[t][seen]
        which, new = np.array((revise or {}).get(t, []), dtype=np.int64).reshape(-1, 2).T
        markers, changed, now = live.step(
            F, Q, points[seen], own, np.ascontiguousarray(which), np.ascontiguousarray(new)
        )
        first = len(final)
        final.extend(markers)
        for detection, marker in zip(changed, now, strict=True):
            assert detection < first
            assert final[detection] != marker  # a revision reports changed labels only
            final[detection] = marker
        revised.append(list(zip(changed.tolist(), now.tolist(), strict=True)))
    return np.array(final), revised


def test_a_label_is_revised_once_it_is_known():
    dense = np.zeros((40, 1, 3))
    final, revised = stream(dense)
    assert (final[:38] == 0).all()
    # Frame 14 makes the fragment a marker, and is taken two frames later.
    assert revised[:16] == [[]] * 16
    assert revised[16] == [(k, 0) for k in range(16)]


def test_a_late_decision_is_revised_from_its_first_frame():
    dense = np.zeros((60, 1, 3))
    dense[14:17] = np.nan  # seen again in the last frame in which it may be, and then decided
    final, _ = stream(dense[:20])
    assert (final == 0).all()


def test_a_frame_that_waits_may_be_revised_and_one_that_is_taken_may_not():
    dense = np.tile(BODY, (60, 1, 1))
    right, _ = stream(dense)
    n = len(BODY)
    labels = np.tile(np.arange(n), (60, 1))
    labels[30, [2, 5]] = 5, 2
    swapped = [(30 * n + 2, 2), (30 * n + 5, 5)]
    final, _ = stream(dense, labels=labels, revise={32: swapped})
    np.testing.assert_array_equal(final, right)
    late, _ = stream(dense, revise={33: [(30 * n + 2, 5), (30 * n + 5, 2)]})
    np.testing.assert_array_equal(late, right)


def test_a_stream_is_revised_where_it_has_been():
    live = _engine.LiveStitcher(
        motion_model(MODEL, 3), stitch_options(MODEL, 15, 0.03, None), lag=2
    )
    F, Q = transition(MODEL.motion, 0.01)
    for wrong in (-1, 0, 5):
        with pytest.raises(ValueError, match="revised"):
            live.step(F, Q, np.zeros((1, 3)), np.zeros(1, int), np.array([wrong]), np.array([0]))
