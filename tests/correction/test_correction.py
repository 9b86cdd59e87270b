"""Corrections: edits hold, what does not depend on them keeps its bytes, and undo restores all."""

from __future__ import annotations

import dataclasses
import itertools

import numpy as np
import pytest

import asterism as am
from asterism.edit import Session
from asterism.model import Edit
from asterism.simulate import Burst, Ghosts
from asterism.tracking.attempts.uncorrected import Uncorrected
from asterism.tracking.correction.change import change_of, without_improbable
from asterism.tracking.correction.constraints import Constraints, detections_of
from asterism.tracking.correction.solver import Solver
from tests.scenes import sized


@pytest.fixture(scope="module")
def walk():
    truth = am.simulate.person(activity="walk", frames=300, seed=3)
    corrupted = am.simulate.corrupt(truth, burst=Burst(), ghosts=Ghosts(), noise=3e-4, seed=3)
    plan = am.tracking.plan_tracking(corrupted.detections)
    model = am.tracking.tracklet_model(plan.recipe.model)
    tracklets = am.track(corrupted.detections, plan.method, model=model, stitch=False)
    return corrupted, am.stitch(tracklets, model), model


def swapped(truth, a, b, first, end):
    """Return tracks in which two markers are exchanged for a while."""
    labels, frame = truth.labels.copy(), truth.detections.frame_of
    inside = (frame >= first) & (frame < end)
    labels[inside & (truth.labels == a)], labels[inside & (truth.labels == b)] = b, a
    return am.Tracks(detections=truth.detections, labels=labels, names=truth.names)


def at(d, *detections):
    frames = [int(d.frame_of[i]) for i in detections]
    return tuple((t, int(i - d.offsets[t])) for i, t in zip(detections, frames, strict=True))


def nearest_pair(truth, frame):
    positions = truth.positions()[frame]
    off = np.linalg.norm(positions[:, None] - positions[None], axis=-1)
    off[~np.isfinite(off) | (off == 0)] = np.inf
    return tuple(map(int, np.unravel_index(off.argmin(), off.shape)))


@pytest.mark.parametrize("end", [180, 300])
def test_one_statement_mends_an_exchange_on_both_tracks(end):
    truth = am.simulate.person(activity="walk", frames=300, seed=3)
    a, b = nearest_pair(truth, 100)
    tracks = swapped(truth, a, b, 100, end)
    model = am.estimate_model(truth.detections).model
    own = np.flatnonzero(truth.labels == a)
    edit = Edit(kind="same", at=at(truth.detections, own[20], own[140]))
    found = am.tracking.correct(tracks, [edit], model)
    assert am.evaluate(tracks, truth).idf1 < 1
    assert am.evaluate(found, truth).idf1 == 1


@pytest.mark.parametrize("last", [120, 150])
def test_one_detection_or_those_up_to_another_are_exchanged_alone(last):
    truth = am.simulate.person(activity="walk", frames=300, seed=3)
    a, b = nearest_pair(truth, 100)
    tracks = swapped(truth, a, b, 120, last + 1)
    correction = am.tracking.Correction(tracks, am.estimate_model(truth.detections).model)
    own = np.flatnonzero(truth.labels == a)
    stated = own[[20, *sorted({120, last})]]
    change = correction.apply(Edit(kind="only", at=at(truth.detections, *stated)))
    np.testing.assert_array_equal(correction.tracks.labels, truth.labels)
    assert len(change.detections) == 2 * (last - 119)
    same = correction.constraints.group(int(stated[0]))
    assert same == set(stated[:2].tolist())
    correction.undo()
    np.testing.assert_array_equal(correction.tracks.labels, tracks.labels)


def test_a_stated_detection_is_not_exchanged_for_another():
    truth = am.simulate.person(activity="walk", frames=300, seed=3)
    d, (a, b) = truth.detections, nearest_pair(truth, 100)
    correction = am.tracking.Correction(truth, am.estimate_model(d).model)
    one, other = (np.flatnonzero(truth.labels == k) for k in (a, b))
    correction.apply(Edit(kind="same", at=at(d, one[20], one[120])))
    with pytest.raises(am.errors.ParameterError, match="respects the earlier edits"):
        correction.apply(Edit(kind="only", at=at(d, one[60], other[120])))
    np.testing.assert_array_equal(correction.tracks.labels, truth.labels)


def test_what_was_stated_stays_on_its_track():
    truth = am.simulate.person(activity="walk", frames=300, seed=3)
    d, (a, b) = truth.detections, nearest_pair(truth, 100)
    # By the evidence, the first 260 frames are exchanged, and not the last 40.
    correction = am.tracking.Correction(swapped(truth, a, b, 0, 260), am.estimate_model(d).model)
    own = np.flatnonzero(truth.labels == a)
    correction.apply(Edit(kind="same", at=at(d, own[280], own[290])))
    correction.apply(Edit(kind="same", at=at(d, own[280], own[100])))
    assert correction.tracks.labels[own[280]] == a
    np.testing.assert_array_equal(correction.tracks.labels, truth.labels)


def test_changes_that_lose_are_left_out_with_all_that_depends_on_them():
    before = np.array([0, 1, 0, 1, -1, -1])
    after = np.array([1, 0, 0, 1, 0, 1])
    frame = np.array([0, 0, 1, 1, 2, 2])
    log_odds = np.array([3.0, -4.0, 0.0, 0.0, 1.0, -1.0])
    found = without_improbable(before, after, log_odds, frame)
    np.testing.assert_array_equal(found, [0, 1, 0, 1, 0, -1])


def test_a_cut_parts_a_track_exactly_there():
    truth = am.simulate.cube(frames=100, seed=2)
    model = am.estimate_model(truth.detections).model
    own = np.flatnonzero(truth.labels == 3)
    edit = Edit(kind="cut", at=at(truth.detections, own[40], own[41]))
    found = am.tracking.correct(truth, [edit], model)
    sides = found.labels[own]
    assert len(set(sides[:41])) == len(set(sides[41:])) == 1
    assert sides[40] != sides[41]
    others = truth.labels != 3
    assert (found.labels[others] == truth.labels[others]).all()


@pytest.mark.parametrize("order", [1, -1])
def test_a_cut_between_detections_with_others_between_is_refused(order):
    truth = am.simulate.cube(frames=100, seed=2)
    capture = am.Capture(
        **{f.name: getattr(truth.detections, f.name) for f in dataclasses.fields(am.Detections)},
        first_frame=1,
    )
    own = np.flatnonzero(truth.labels == 3)
    tracks = dataclasses.replace(truth, detections=capture)
    correction = am.tracking.Correction(tracks, am.estimate_model(capture).model)
    with pytest.raises(am.ParameterError) as refused:
        correction.apply(Edit(kind="cut", at=at(capture, *own[[40, 60]][::order])))
    places = ["frame 40 point 3", "frame 60 point 3"][::order]
    shown = [41, 61][::order]
    assert str(refused.value) == (
        "edits: expected a cut between detections that follow each other in their track, "
        f"found cut: {', '.join(places)} (frame {shown[0]}, {shown[1]} of the file), "
        "with 19 of M03 between them. State cut: frame 59 point 3, frame 60 point 3 "
        "(frame 60, 61 of the file), or different instead of cut."
    )
    assert (correction.tracks.labels == truth.labels).all()
    assert correction.edits == ()
    # The message states one that is possible, and one that holds already is no error.
    correction.apply(Edit(kind="cut", at=at(capture, own[59], own[60])))
    assert correction.apply(Edit(kind="cut", at=at(capture, own[40], own[60]))).stretches == ()


def test_a_group_on_both_sides_of_another_statement_follows_a_cut():
    truth = am.simulate.cube(frames=100, seed=2)
    d, model = truth.detections, am.estimate_model(truth.detections).model
    own = np.flatnonzero(truth.labels == 3)
    edits = [
        Edit(kind="same", at=at(d, own[41], own[70])),
        Edit(kind="same", at=at(d, own[40], own[55])),
        Edit(kind="cut", at=at(d, own[40], own[41])),
    ]
    found = am.tracking.correct(truth, edits, model)
    assert all(holds(edit, found) for edit in edits)
    assert found.labels[own[41]] != found.labels[own[55]]


def test_a_name_goes_to_the_track_and_follows_the_marker():
    truth = am.simulate.person(activity="walk", frames=200, seed=3)
    named = am.Tracks(
        detections=truth.detections, labels=truth.labels, names=(None,) * truth.n_tracks
    )
    model = am.estimate_model(truth.detections).model
    one = int(np.flatnonzero(truth.labels == 4)[50])
    edit = Edit(kind="name", at=at(truth.detections, one), name="ANKLE")
    found = am.tracking.correct(named, [edit], model)
    assert found.names.index("ANKLE") == 4
    assert (found.labels == truth.labels).all()


def test_clutter_deletes_a_part_and_same_brings_it_back(walk):
    _, stitching, model = walk
    tracks = stitching.tracks
    correction = am.tracking.Correction(tracks, model, stitching)
    own = np.flatnonzero(tracks.labels == 2)
    change = correction.apply(Edit(kind="clutter", at=at(tracks.detections, own[10])))
    assert own[10] in change.detections
    assert set(change.after.tolist()) == {-1}
    assert set(change.before.tolist()) == {2}


def random_edit(rng, tracks):
    d, labels = tracks.detections, tracks.labels
    kind = str(rng.choice(["same", "same", "same", "only", "different", "cut", "clutter", "name"]))
    i, j = rng.choice(len(labels), 2, replace=False)
    if kind == "cut":
        own = np.flatnonzero(labels == labels[i])
        if labels[i] < 0 or len(own) < 2:
            return None
        n = int(rng.integers(1, len(own)))
        i, j = own[n - 1], own[n]
    if kind in ("clutter", "name"):
        name = str(rng.choice(["A", "B", "C"])) if kind == "name" else ""
        return Edit(kind=kind, at=at(d, i), name=name)
    return None if d.frame_of[i] == d.frame_of[j] else Edit(kind=kind, at=at(d, i, j))


def holds(edit, tracks):
    own = detections_of(edit, tracks.detections)
    labels = tracks.labels[list(own)]
    if edit.kind in ("same", "only"):
        return labels[0] == labels[1] >= 0
    if edit.kind in ("different", "cut"):
        return labels[0] != labels[1] or labels[0] < 0
    if edit.kind == "name":
        return tracks.names[labels[0]] == edit.name
    return labels[0] < 0


@pytest.mark.parametrize("seed", range(sized(12, 4)))
def test_random_edits_hold_and_undo_restores_every_byte(seed, walk):
    _, stitching, model = walk
    rng = np.random.default_rng(seed)
    correction = am.tracking.Correction(stitching.tracks, model, stitching)
    states = [(correction.tracks.labels.tobytes(), correction.tracks.names)]
    applied = []
    for _ in range(40):
        edit = random_edit(rng, correction.tracks)
        if edit is None:
            continue
        before = correction.tracks.labels.copy()
        try:
            change = correction.apply(edit)
        except am.ParameterError:
            assert (correction.tracks.labels == before).all()
            continue
        applied.append(edit)
        now = correction.tracks
        assert all(holds(each, now) for each in applied), edit
        changed = np.flatnonzero(now.labels != before)
        assert changed.tolist() == change.detections.tolist()
        assert (before[changed] == change.before).all()
        touched = set(change.before.tolist()) | set(change.after.tolist())
        assert len(touched - {-1}) <= 2 or edit.kind == "same"
        assert sum(each.n_detections for each in change.stretches) == len(changed)
        states.append((now.labels.tobytes(), now.names))
    assert len(applied) > 10
    replayed = am.tracking.Correction(stitching.tracks, model, stitching)
    for edit in applied:
        replayed.apply(edit)
    assert replayed.tracks.labels.tobytes() == states[-1][0]
    for labels, names in reversed(states):
        assert correction.tracks.labels.tobytes() == labels
        assert correction.tracks.names == names
        correction.undo()
    assert correction.undo() is None


@pytest.mark.parametrize(
    ("method", "stitch"), list(itertools.product(["gnn", "jpda", "mcmcda"], [False, True]))
)
def test_every_method_respects_edits_and_repeats_them(method, stitch):
    truth = am.simulate.corrupt(
        am.simulate.cube(frames=80, seed=4), missing=0.05, clutter=0.1, seed=4
    )
    d = truth.detections
    own = np.flatnonzero(truth.labels == 1)
    other = np.flatnonzero(truth.labels == 2)
    edits = [
        Edit(kind="same", at=at(d, own[5], own[-5])),
        Edit(kind="different", at=at(d, own[5], other[20])),
        Edit(kind="name", at=at(d, own[5]), name="CORNER"),
    ]
    tracks = am.track(d, method, stitch=stitch, edits=edits)
    assert all(holds(edit, tracks) for edit in edits)
    again = am.track(d, recipe=tracks.recipe, edits=edits)
    assert (again.labels == tracks.labels).all()
    assert again.names == tracks.names
    with pytest.raises(am.ParameterError, match="edits"):
        am.track(d, recipe=tracks.recipe)


def test_a_gap_is_filled_or_left_open_as_stated():
    truth = am.simulate.corrupt(
        am.simulate.cube(frames=100, rate=100, seed=1), missing=0.05, seed=1
    )
    d = truth.detections
    gap, other = truth.gaps()[:2]
    own = np.flatnonzero(truth.labels == gap.track)
    ends = [own[d.frame_of[own] < gap.first][-1], own[d.frame_of[own] > gap.last][0]]
    fill, leave = (Edit(kind=kind, at=at(d, *ends)) for kind in ("fill", "no_fill"))
    alone = am.fill_gaps(truth, longest=0.0, edits=[fill])
    assert [(g.track, g.first) for g in alone.gaps if g.is_filled] == [(gap.track, gap.first)]
    left = am.fill_gaps(truth, edits=[leave])
    reasons = {(g.track, g.first): g.reason for g in left.gaps}
    assert reasons[gap.track, gap.first] == "left open by an edit"
    assert reasons[other.track, other.first] == ""


def test_one_statement_mends_every_exchange_of_the_same_two_tracks():
    truth = am.simulate.person(activity="walk", frames=300, seed=3)
    a, b = nearest_pair(truth, 100)
    tracks = swapped(swapped(truth, a, b, 40, 90), a, b, 180, 260)
    model = am.estimate_model(truth.detections).model
    own = np.flatnonzero(truth.labels == a)
    edit = Edit(kind="same", at=at(truth.detections, own[140], own[220]))
    assert am.evaluate(tracks, truth).idf1 < 1
    assert am.evaluate(am.tracking.correct(tracks, [edit], model), truth).idf1 == 1


def in_turns(truth, k, frames):
    """Return tracks in which a marker is on another track in every second stretch of frames."""
    labels, frame = truth.labels.copy(), truth.detections.frame_of
    labels[(labels == k) & (frame // frames % 2 == 1)] = truth.n_tracks
    return am.Tracks(detections=truth.detections, labels=labels)


def test_two_tracks_of_one_marker_are_joined_as_a_whole():
    truth = am.simulate.person(activity="walk", frames=300, seed=3)
    tracks, model = in_turns(truth, 4, 30), am.estimate_model(truth.detections).model
    own = np.flatnonzero(truth.labels == 4)
    edit = Edit(kind="same", at=at(truth.detections, own[15], own[45]))
    assert (am.tracking.correct(tracks, [edit], model).labels == truth.labels).all()


def test_tracks_that_an_edit_keeps_apart_are_not_joined_as_a_whole():
    truth = am.simulate.person(activity="walk", frames=300, seed=3)
    tracks, model = in_turns(truth, 4, 30), am.estimate_model(truth.detections).model
    own, d = np.flatnonzero(truth.labels == 4), truth.detections
    edits = [
        Edit(kind="different", at=at(d, own[15], own[105])),
        Edit(kind="same", at=at(d, own[15], own[45])),
    ]
    found = am.tracking.correct(tracks, edits, model)
    assert all(holds(edit, found) for edit in edits)


def test_one_statement_takes_all_detections_that_keep_the_distances_of_the_track():
    # The body leaps in each of these frames, so that motion does not tell what comes next.
    made = am.simulate.person(activity="walk", frames=300, n_markers=40, seed=3)
    positions, rng = made.positions(), np.random.default_rng(1)
    positions[140:152] += rng.normal(0, 0.3, (12, 1, 3))
    truth = am.simulate.corrupt(
        am.Tracks.from_dense(made.detections.times, positions), clutter=0.2, noise=3e-4, seed=3
    )
    d, labels = truth.detections, truth.labels.copy()
    marker = nearest_pair(truth, 100)[0]
    own = np.flatnonzero(labels == marker)
    lost = own[(d.frame_of[own] >= 140) & (d.frame_of[own] < 152)]
    labels[lost] = -1
    model = am.estimate_model(made.detections).model
    edit = Edit(kind="same", at=at(d, own[20], lost[6]))
    found = am.tracking.correct(am.Tracks(detections=d, labels=labels), [edit], model)
    assert (found.labels == truth.labels).all()


def test_one_statement_takes_the_probable_detections_of_its_marker_in_the_whole_capture():
    made = am.simulate.person(activity="walk", frames=300, n_markers=40, seed=3)
    truth = am.simulate.corrupt(made, clutter=0.2, noise=3e-4, seed=3)
    d, labels, rng = truth.detections, truth.labels.copy(), np.random.default_rng(2)
    marker, other = nearest_pair(truth, 100)
    own, of_other = (np.flatnonzero(labels == k) for k in (marker, other))
    lost = rng.choice(own[30:-30], 40, replace=False)
    left = rng.choice(of_other[30:-30], 5, replace=False)
    labels[lost] = labels[left] = -1
    tracks = am.Tracks(detections=d, labels=labels)
    model = am.estimate_model(made.detections).model
    apart = Edit(kind="different", at=at(d, own[0], lost[1]))
    edit = Edit(kind="same", at=at(d, own[0], lost[0]))
    found = am.tracking.correct(tracks, [apart, edit], model)
    changed = np.flatnonzero(found.labels != labels)
    assert set(found.labels[changed]) == {marker}
    assert (truth.labels[changed] == marker).all()
    assert len(changed) > 0.9 * len(lost)
    assert found.labels[lost[1]] == -1  # it is stated to be of another marker


def test_probable_ghosts_are_not_taken_along():
    truth = am.simulate.person(activity="walk", frames=300, n_markers=40, seed=3)
    d, labels = truth.detections, truth.labels.copy()
    own = np.flatnonzero(labels == 4)
    # All but the stated one are beyond those that continue it without a gap.
    lost, ghosts = own[[40, 140, 160, 180, 200]], own[150:210:20]
    labels[lost] = labels[ghosts] = -1
    solver = Solver(am.Tracks(detections=d, labels=labels), am.estimate_model(d).model)
    solver.evidence.ghost[ghosts] = 20.0
    solver.solve(Edit(kind="same", at=at(d, own[0], lost[0])), Constraints(d))
    assert (solver.labels[lost] == 4).all()
    assert (solver.labels[ghosts] == -1).all()


def test_a_part_on_two_markers_is_not_exchanged_as_a_whole():
    truth = am.simulate.person(activity="walk", frames=300, n_markers=40, seed=3)
    d, labels, frame = truth.detections, truth.labels.copy(), truth.detections.frame_of
    a, b = 4, 20
    inside = (frame >= 100) & (frame < 112)
    labels[inside & (labels == b)] = -1
    labels[inside & (labels == a)] = b
    solver = Solver(am.Tracks(detections=d, labels=labels), am.estimate_model(d).model)
    # No link is uncertain: all detections of a track are one part.
    solver.evidence.part_of[:] = labels
    solver.evidence.before = np.ones(truth.n_tracks)
    own = np.flatnonzero(truth.labels == a)
    solver.solve(Edit(kind="same", at=at(d, own[20], own[106])), Constraints(d))
    assert (solver.labels[own] == a).mean() > 0.98
    others = truth.labels != a
    assert (solver.labels[others] == labels[others]).all()


def test_what_was_taken_along_from_clutter_can_be_refused(tmp_path):
    made = am.simulate.person(activity="walk", frames=300, n_markers=40, seed=3)
    truth = am.simulate.corrupt(made, clutter=0.2, noise=3e-4, seed=3)
    d, labels = truth.detections, truth.labels.copy()
    own = np.flatnonzero(labels == nearest_pair(truth, 100)[0])
    labels[own[[50, 80, 120, 121, 122, 200]]] = -1
    begun = Uncorrected(
        tracks=am.Tracks(detections=d, labels=labels),
        recipe=am.tracking.plan_tracking(d).recipe,
        model=am.estimate_model(made.detections).model,
    )
    session = Session(begun, tmp_path / "e.toml")
    change = session.apply(session.edit("same", int(own[0]), int(own[50])))
    assert change.stretches[0].is_asked
    assert change.stretches[0].n_detections == 1
    firsts = [each.first for each in change.stretches]
    i = firsts.index(d.frame_of[own[120]])
    assert change.stretches[i].n_detections == 3
    assert not change.stretches[i].is_asked
    session.refuse(change, i)
    assert (session.tracks.labels[own[120:123]] == -1).all()
    assert (session.tracks.labels[own[[50, 80, 200]]] >= 0).all()


def holes(truth, share, seed):
    """Return tracks of which a share of the detections is clutter, and these detections."""
    own = np.random.default_rng(seed).random(len(truth.labels)) < share
    labels = np.where(own, -1, truth.labels)
    return am.Tracks(detections=truth.detections, labels=labels, names=truth.names), own


REASSIGN = Edit(kind="reassign", at=())


def test_detections_without_a_track_are_assigned_again_all_at_once():
    truth = am.simulate.person(activity="walk", frames=200, seed=3)
    tracks, lost = holes(truth, 0.05, 3)
    model = am.estimate_model(truth.detections).model
    found = am.tracking.correct(tracks, [REASSIGN], model)
    assert (found.labels[~lost] == truth.labels[~lost]).all()
    is_right = found.labels[lost] == truth.labels[lost]
    assert is_right.mean() > 0.97
    assert set(found.labels[lost][~is_right].tolist()) <= {-1}


def test_stated_clutter_and_stated_markers_stay_when_all_is_assigned_again():
    truth = am.simulate.person(activity="walk", frames=200, seed=3)
    tracks, lost = holes(truth, 0.05, 3)
    d, model = truth.detections, am.estimate_model(truth.detections).model
    ghost, wrong = (int(i) for i in np.flatnonzero(lost)[[20, 60]])
    other = int(np.flatnonzero(tracks.labels == truth.labels[ghost])[0])
    edits = [
        Edit(kind="clutter", at=at(d, ghost)),
        Edit(kind="same", at=at(d, other, wrong)),
        REASSIGN,
    ]
    assert truth.labels[wrong] != truth.labels[other]
    correction = am.tracking.Correction(tracks, model)
    for edit in edits[:2]:
        correction.apply(edit)
    before = correction.tracks.labels.copy()
    change = correction.apply(REASSIGN)
    now = correction.tracks.labels
    assert now[ghost] == -1
    assert now[wrong] == now[other] == truth.labels[other]
    assert len(change.detections) > 100
    assert not any(each.is_asked for each in change.stretches)
    assert correction.undo() is change
    assert (correction.tracks.labels == before).all()


def test_emptied_tracks_do_not_hinder_an_assignment_of_all():
    truth = am.simulate.person(activity="walk", frames=100, seed=3)
    last = truth.n_tracks - 1
    tracks, lost = holes(truth, 0.05, 3)
    labels = np.where(truth.labels == last, -1, tracks.labels)
    tracks = am.Tracks(detections=truth.detections, labels=labels, names=truth.names)
    model = am.estimate_model(truth.detections).model
    found = am.tracking.correct(tracks, [REASSIGN], model)
    again = lost & (truth.labels != last)
    assert (found.labels[again] == truth.labels[again]).mean() > 0.9
    assert (found.labels[truth.labels == last] == -1).all()


def test_detections_of_an_assignment_stay_now_and_later():
    truth = am.simulate.person(activity="walk", frames=200, seed=3)
    tracks, _ = holes(truth, 0.05, 3)
    d, model = truth.detections, am.estimate_model(truth.detections).model
    correction = am.tracking.Correction(tracks, model)
    change = correction.apply(REASSIGN)
    correction.undo()
    kept = change.of_groups([change.stretches[0].group])
    assert 0 < len(kept) < len(change.detections)
    some = correction.apply(Edit(kind="reassign", at=at(d, *kept)))
    assert set(kept.tolist()) | set(some.detections.tolist()) == set(change.detections.tolist())
    assert not set(kept.tolist()) & set(some.detections.tolist())
    assert not set(kept.tolist()) & set(correction.apply(REASSIGN).detections.tolist())


def test_stretches_that_take_the_place_of_each_other_are_one_group():
    frame = np.repeat(np.arange(4), 3)
    before = np.tile([0, 1, -1], 4)
    after = before.copy()
    after[3:6] = [1, 0, -1]  # both exchanged in frame 1
    after[11] = 2  # a detection without a track in frame 3
    edit = Edit(kind="reassign", at=())
    change = change_of(edit, (), frame, (before, after), ([None] * 3, [None] * 3))
    assert [(each.source, each.target, each.group) for each in change.stretches] == [
        (0, 1, 0), (1, 0, 0), (-1, 2, 2),
    ]  # fmt: skip
    assert change.of_groups([0]).tolist() == [3, 4]
    assert change.of_groups([2]).tolist() == [11]


def test_two_tracks_of_a_marker_that_alternate_become_one():
    truth = am.simulate.person(activity="walk", frames=400, seed=3)
    d, model = truth.detections, am.estimate_model(truth.detections).model
    other = truth.n_tracks
    own = np.flatnonzero(truth.labels == 0)
    second = own[(d.frame_of[own] // 20) % 2 == 1]
    labels = truth.labels.copy()
    labels[second] = other
    wrong = np.flatnonzero(truth.labels == 1)
    wrong = wrong[np.isin(d.frame_of[wrong], [5, 45, 85, 125, 165, 205, 245, 285])]
    labels[wrong] = other  # 4 % of the frames of the second track are those of the first
    tracks = am.Tracks(detections=d, labels=labels, names=(None,) * (other + 1))
    found = am.tracking.correct(
        tracks, [Edit(kind="same", at=at(d, int(own[0]), int(second[50])))], model
    )
    assert (found.labels[own] == found.labels[own[0]]).all()


def test_a_detection_that_does_not_fit_its_part_is_dropped_alone():
    truth = am.simulate.person(activity="walk", frames=200, seed=3)
    d = truth.detections
    own = np.flatnonzero(truth.labels == 4)
    points = d.points.copy()
    points[own[100]] += [0.03, 0.03, 0.03]
    moved = dataclasses.replace(d, points=points)
    tracks = am.Tracks(detections=moved, labels=truth.labels, names=truth.names)
    model = am.estimate_model(d).model
    correction = am.tracking.Correction(tracks, model)
    correction.apply(Edit(kind="clutter", at=at(moved, int(own[100]))))
    assert (correction.tracks.labels[own] < 0).nonzero()[0].tolist() == [100]
