"""Tracks that are changed by the distances which they keep to each other."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest

import asterism as am
from asterism.tracking.attempts import own_distances
from asterism.tracking.attempts.uncorrected import Uncorrected
from asterism.tracking.methods import TOMHT, Rigidity, options_of
from asterism.tracking.plan import plan_tracking
from asterism.tracking.stitching.exchanged import with_markers
from tests.scenes import exchanged, two_that_circle

HIDDEN, FIRST, LAST = (3, 4), 60, 100


def followed_through_a_gap():
    """A person, two of whose markers are hidden for 40 frames and exchanged afterwards."""
    person = am.simulate.person(frames=160, seed=2)
    d, labels = person.detections, person.labels.copy()
    hidden = np.isin(labels, HIDDEN) & (d.frame_of >= FIRST) & (d.frame_of < LAST)
    labels[hidden] = -1
    after = d.frame_of >= LAST
    one, other = (after & (labels == k) for k in HIDDEN)
    labels[one], labels[other] = HIDDEN[::-1]
    model = am.tracking.tracklet_model(am.estimate_model(d).model)
    recipe = dataclasses.replace(
        plan_tracking(d).recipe, method="tomht", options=options_of(TOMHT(rigid=Rigidity()))
    )
    tracks = am.Tracks(detections=d, labels=labels)
    # As a method with bonds leaves it: one tracklet on both sides of the gap.
    stitching = am.tracking.Stitching(
        tracks=tracks, tracklets=labels.astype(np.int32),
        markers=np.arange(tracks.n_tracks, dtype=np.int32),
        after=np.full(tracks.n_tracks, -1, dtype=np.int32),
        probabilities=np.ones(tracks.n_tracks), cuts=np.empty((0, 2), dtype=np.int64),
    )  # fmt: skip
    return person, Uncorrected(tracks=tracks, recipe=recipe, model=model, stitching=stitching)


@pytest.mark.parametrize(("is_doubtful", "lead"), [(True, 30), (True, 1e6), (False, 30)])
def test_tracks_in_doubt_are_exchanged_back_where_that_is_more_probable(
    is_doubtful, lead, monkeypatch
):
    monkeypatch.setattr(
        "asterism.tracking.attempts.uncorrected.DOUBTFUL", -1.0 if is_doubtful else 1.0
    )
    monkeypatch.setattr(own_distances, "EXCHANGE", lead)
    truth = two_that_circle(seed=1)
    recipe = plan_tracking(truth.detections).recipe
    right = am.stitch(truth, am.tracking.tracklet_model(recipe.model))
    pair = [int(right.tracks.labels[truth.labels == k][0]) for k in (5, 6)]
    wrong = exchanged(right.tracks, pair, range(FIRST, LAST))
    stitching = with_markers(right, wrong.labels, np.full(len(wrong.labels), 0.95))
    model = am.tracking.tracklet_model(recipe.model)
    before = Uncorrected(tracks=wrong, recipe=recipe, model=model, stitching=stitching)
    assert own_distances.exchanged_by_spreads(before) is before
    after = own_distances.changed_if_more_probable(before)
    if not is_doubtful or lead > 30:
        assert after is before
    else:
        np.testing.assert_array_equal(after.tracks.labels, right.tracks.labels)


def test_tracklets_in_doubt_move_to_the_absent_marker(monkeypatch):
    monkeypatch.setattr("asterism.tracking.attempts.uncorrected.DOUBTFUL", -1.0)
    person = am.simulate.corrupt(
        am.simulate.person(activity="run", frames=300, seed=2), noise=3e-4, stride=2, seed=2
    )
    recipe = plan_tracking(person.detections).recipe
    model = am.tracking.tracklet_model(recipe.model)
    right, frame = person.labels.copy(), person.detections.frame_of
    gap = model.population.max_gap + 2
    near = (frame >= 60 - gap) & (frame < 80 + gap)
    right[((right == 36) & near & ((frame < 60) | (frame >= 80))) | ((right == 37) & near)] = -1
    inside = (right == 36) & near
    found = am.stitch(am.Tracks(detections=person.detections, labels=right), model)
    labels = found.tracks.labels
    one, other = (int(labels[right == k][0]) for k in (36, 37))
    assert (labels[right == 36] == one).all()
    wrong = np.where(inside, other, labels)
    stitching = with_markers(found, wrong, np.full(len(wrong), 0.95))
    tracks = dataclasses.replace(found.tracks, labels=wrong)
    for each in (stitching, None):
        before = Uncorrected(tracks=tracks, recipe=recipe, model=model, stitching=each)
        done: list[int] = []
        after = own_distances.changed_if_more_probable(before, done.append)
        np.testing.assert_array_equal(after.tracks.labels, labels)
        assert done == sorted(done)
        assert done[-1] == person.detections.n_frames
        if each is not None:
            assert after.stitching.tracks is after.tracks
            assert after.tracks.info["joins"] == len(after.stitching.joins)


def test_tracks_are_cut_at_gaps_that_the_model_excludes_and_keep_their_labels():
    person, found = followed_through_a_gap()
    again = own_distances._stitched_again(found)
    assert len(found.stitching.joins) == 0
    assert len(again.stitching.joins) == len(HIDDEN)
    np.testing.assert_array_equal(again.tracks.labels, found.tracks.labels)
    in_tracks = again.tracks.labels >= 0
    frame_of = person.detections.frame_of
    for k in range(int(again.stitching.tracklets.max()) + 1):
        own = frame_of[in_tracks & (again.stitching.tracklets == k)]
        assert np.diff(own).max(initial=0) <= found.model.population.max_gap
    no_stitching = dataclasses.replace(found, stitching=None)
    assert own_distances._stitched_again(no_stitching) is no_stitching


def test_rounds_after_the_first_begin_with_tracks_that_were_stitched_again(monkeypatch):
    begun = []

    def stitched_again(found):
        begun.append(found.expected_right)
        return SimpleNamespace(**vars(found) | {"expected_right": min(found.expected_right + 1, 2)})

    for step in ("_reassigned", "_with_detections_in_gaps", "_with_lost_markers"):
        monkeypatch.setattr(own_distances, step, lambda found: found)
    monkeypatch.setattr(own_distances, "exchanged_by_spreads", lambda found: found)
    monkeypatch.setattr(own_distances, "_stitched_again", stitched_again)
    first = SimpleNamespace(expected_right=0, is_doubtful=True, has_bonds=True, stitching=None)
    assert own_distances.assigned_again(first).expected_right == 2
    assert begun == [0, 1, 2]  # the last round made no more identities certain
    first.has_bonds = False
    assert own_distances.assigned_again(first) is first


def test_tracks_that_lose_all_names_are_not_named_again(monkeypatch):
    tracks = followed_through_a_gap()[1].tracks
    unnamed = dataclasses.replace(tracks, names=(None,) * tracks.n_tracks)
    monkeypatch.setattr(own_distances, "name_tracks", lambda *_: SimpleNamespace(tracks=unnamed))
    monkeypatch.setattr(
        own_distances,
        "_with_labels",
        lambda *_: SimpleNamespace(tracks=unnamed, expected_right=1, is_doubtful=True),
    )
    first = SimpleNamespace(tracks=tracks, expected_right=0, is_doubtful=True)
    assert own_distances.refined_by_own_distances(first).expected_right == 1
