"""Sessions: each edit is on disk, undo and redo, a choice is an edit, and what is saved."""

from __future__ import annotations

import numpy as np
import pytest

import asterism as am
from asterism.edit import Session
from asterism.model import Alternative, Decision, Edit
from asterism.simulate import Burst, Ghosts
from asterism.tracking.attempts.uncorrected import Uncorrected
from asterism.tracking.correction.constraints import detections_of


@pytest.fixture(scope="module")
def capture():
    truth = am.simulate.person(activity="walk", frames=300, seed=3)
    return am.simulate.corrupt(truth, burst=Burst(), ghosts=Ghosts(), noise=3e-4, seed=3).detections


@pytest.fixture
def session(capture, tmp_path):
    return Session.open(capture, tmp_path / "trial.edits.toml", who="Ada")


def two_of(session, track=1):
    own = np.flatnonzero(session.tracks.labels == track)
    return int(own[5]), int(own[-5])


def test_every_edit_is_on_disk_and_taken_up_again(session, capture):
    session.apply(session.edit("same", *two_of(session)))
    session.apply(session.edit("clutter", int(np.flatnonzero(session.tracks.labels == 3)[4])))
    assert am.io.read_edits(session.path, capture) == session.edits
    assert all(each.who == "Ada" and each.when for each in session.edits)
    again = Session.open(capture, session.path)
    assert again.tracks.labels.tobytes() == session.tracks.labels.tobytes()


def test_undo_and_redo_are_on_disk_too(session, capture):
    first = session.tracks.labels.tobytes()
    session.apply(session.edit("clutter", two_of(session)[0]))
    second = session.tracks.labels.tobytes()
    session.undo()
    assert session.tracks.labels.tobytes() == first
    assert am.io.read_edits(session.path, capture) == ()
    session.redo()
    assert session.tracks.labels.tobytes() == second
    assert len(am.io.read_edits(session.path, capture)) == 1
    assert session.redo() is None


def test_a_contradiction_leaves_file_and_tracks_as_they_are(session):
    one, other = two_of(session)
    session.apply(session.edit("same", one, other))
    before = session.path.read_bytes()
    with pytest.raises(am.ParameterError, match="contradicts"):
        session.apply(session.edit("different", one, other))
    assert session.path.read_bytes() == before
    assert len(session.edits) == 1


def test_an_unwritable_file_takes_the_edit_back(capture, tmp_path):
    session = Session.open(capture, tmp_path / "none" / "trial.edits.toml")
    before = session.tracks.labels.tobytes()
    with pytest.raises(am.FormatError):
        session.apply(session.edit("clutter", two_of(session)[0]))
    assert session.tracks.labels.tobytes() == before
    assert session.edits == ()


def test_every_choice_that_is_offered_is_an_edit_that_holds(session):
    for decision in session.decisions()[:8]:
        for choice in (None, *decision.alternatives):
            change = session.apply(session.choose(decision, choice))
            labels = session.tracks.labels[change.detections]
            if choice is not None and choice.track is not None and len(labels):
                assert choice.track in set(labels.tolist())
            session.undo()


def test_a_decided_place_is_offered_no_more(session):
    decision = session.decisions()[0]
    session.apply(session.choose(decision))
    keys = [(each.track, each.first, each.last) for each in session.decisions()]
    assert (decision.track, decision.first, decision.last) not in keys


def test_what_followed_from_an_edit_can_be_refused(capture, tmp_path):
    session = Session.open(capture, tmp_path / "e.toml")
    d = session.tracks.detections
    a, b = 1, 2
    own, other = (np.flatnonzero(session.tracks.labels == k) for k in (a, b))
    change = session.apply(session.edit("same", int(own[5]), int(other[len(other) // 2])))
    follows = [i for i, each in enumerate(change.stretches) if not each.is_asked]
    assert follows
    stretch = change.stretches[follows[0]]
    session.refuse(change, follows[0])
    frames = d.frame_of
    moved = change.detections[(change.before == stretch.source) & (change.after == stretch.target)]
    middle = moved[(frames[moved] >= stretch.first) & (frames[moved] <= stretch.last)]
    assert session.tracks.labels[middle[len(middle) // 2]] != stretch.target
    asked = next(i for i, each in enumerate(change.stretches) if each.is_asked)
    with pytest.raises(am.ParameterError, match="Undo the edit"):
        session.refuse(change, asked)


def test_the_result_is_that_of_track_with_the_same_edits(session, capture):
    session.apply(session.edit("same", *two_of(session)))
    session.apply(session.edit("name", two_of(session, 4)[0], name="KNEE"))
    result = session.result().tracks
    tracks = am.track(capture, edits=session.edits)
    assert result.labels.tobytes() == tracks.labels.tobytes()
    assert result.names == tracks.names
    assert result.recipe == tracks.recipe


def test_a_preview_is_what_a_fill_gives(session):
    gap = next(each for each in session.tracks.gaps() if each.seconds < 0.2)
    positions, sigma = session.fill_preview(session.fill(gap.track, gap.first, gap.last))
    assert positions.shape == (gap.length, 3)
    assert (sigma > 0).all()
    session.apply(session.fill(gap.track, gap.first, gap.last))
    d = session.result().tracks.detections
    assert d.filled is not None
    assert (d.points[d.filled] == positions).all()
    with pytest.raises(am.ParameterError, match="a gap from"):
        session.fill(gap.track, gap.first, gap.last + 1)


def test_a_save_never_replaces_the_input_or_another_file(tmp_path):
    path = tmp_path / "trial.c3d"
    am.write(am.simulate.cube(frames=60, seed=1), path)
    session = Session.open(am.read(path), tmp_path / "trial.edits.toml")
    with pytest.raises(am.FormatError, match="input"):
        session.save(path, overwrite=True)
    session.save(tmp_path / "out.c3d")
    with pytest.raises(am.FormatError, match="overwrite"):
        session.save(tmp_path / "out.c3d")
    session.save(tmp_path / "out.c3d", overwrite=True)
    assert am.read(tmp_path / "out.c3d").n_frames == 60


def test_a_decision_about_other_tracks_is_refused(session):
    made = am.model.Decision(
        kind="identity", track=999, first=0, last=5, n_detections=5, probability=0.5
    )
    with pytest.raises(am.ParameterError, match="about the tracks now"):
        session.choose(made)
    with pytest.raises(am.ParameterError, match="indices below"):
        session.edit("clutter", 10**9)
    assert Edit(kind="clutter", at=((0, 0),)).who == ""


def test_an_answer_about_two_exchanged_tracks_states_what_is_true(tmp_path):
    truth = am.simulate.person(activity="walk", frames=300, seed=3)
    d, frame = truth.detections, truth.detections.frame_of
    a, b = 4, 5
    labels, inside = truth.labels.copy(), (frame >= 100) & (frame < 180)
    labels[inside & (truth.labels == a)], labels[inside & (truth.labels == b)] = b, a
    tracks = am.Tracks(detections=d, labels=labels)
    model = am.estimate_model(d).model
    recipe = am.tracking.plan_tracking(d).recipe
    session = Session(Uncorrected(tracks=tracks, recipe=recipe, model=model), tmp_path / "e.toml")
    decision = Decision(kind="identity", track=a, first=100, last=179, n_detections=80)
    edit = session.choose(decision, Alternative(track=b, probability=0.5))
    # The detection of track b that is nearest in time is of marker a, as both were exchanged.
    own = detections_of(edit, d)
    assert len({int(truth.labels[i]) for i in own}) == 1
    session.apply(edit)
    assert am.evaluate(session.tracks, truth).idf1 == 1
