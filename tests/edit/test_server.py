"""Edits through the server: on disk when they are answered, and seen by every page."""

from __future__ import annotations

import asyncio
import signal

import numpy as np

import asterism as am
from asterism.edit.hub import Hub
from tests.edit.editors import recipe_of
from tests.edit.served import CAPTURE, Served, wait


def same(served, method=None):
    """Return an edit that joins the detections of two tracks of the first frame later on."""
    capture = am.read(served.folder / CAPTURE)
    recipe, path = recipe_of(capture, method), served.folder / "no.toml"
    tracks = am.edit.Session.open(capture, path, recipe).tracks
    own = np.flatnonzero(tracks.labels == 3)
    other = np.flatnonzero(tracks.labels == 4)
    frame = tracks.detections.frame_of
    later = other[frame[other] > frame[own[0]] + 40][0]
    return tracks, {"kind": "same", "detections": [int(own[0]), int(later)], "name": ""}


def test_an_edit_is_on_disk_when_it_is_answered(served):
    capture, path = am.read(served.folder / CAPTURE), served.folder / "trial.edits.toml"
    tracks, message = same(served)
    status, answer = served.post("edit", **message)
    assert status == 200
    edits = am.io.read_edits(path, capture)
    assert [each.kind for each in edits] == ["same"]
    assert answer["version"] == 1
    assert len(answer["edits"]) == 1
    # The answer holds what changed, and nothing else.
    session = am.edit.Session.open(capture, path, recipe_of(capture))
    changed = np.flatnonzero(session.tracks.labels != tracks.labels)
    assert answer["detections"] == changed.tolist()
    assert answer["labels"] == session.tracks.labels[changed].tolist()
    assert 0 < len(changed) < 0.2 * len(tracks.labels)
    assert sum(each["n_detections"] for each in answer["stretches"]) == len(changed)
    status, answer = served.post("undo")
    assert answer["labels"] == tracks.labels[changed].tolist()
    assert am.io.read_edits(path, capture) == ()
    assert answer["n_undone"] == 1
    status, answer = served.post("redo")
    assert (status, answer["n_undone"], len(answer["edits"])) == (200, 0, 1)
    assert served.post("redo")[0] == 409


def test_a_cut_of_a_page_in_part_is_directly_before_the_later_detection(tmp_path, monkeypatch):
    d = am.simulate.cube(frames=60, seed=1).detections
    monkeypatch.setattr("asterism.reporting.page.thinning.MOST_POINTS", d.n_points // 3)
    session = am.edit.Session.open(d, tmp_path / "trial.edits.toml")
    hub = Hub(session, tmp_path / "out.csv")
    shown = [hub.view.detection(i) for i in range(8 * 20)]
    own = [i for i, each in enumerate(shown) if session.tracks.labels[each] == 2]
    message = {"kind": "cut", "detections": own[9:11], "name": ""}
    asyncio.run(hub.act("edit", message))
    ((first, _), (last, _)) = session.edits[0].at
    assert (first, last) == (29, 30)
    assert [int(d.frame_of[shown[i]]) for i in own[9:11]] == [27, 30]


def test_an_assignment_is_on_disk_once_it_is_confirmed_and_not_before(by_method):
    capture, path = am.read(by_method.folder / CAPTURE), by_method.folder / "trial.edits.toml"
    status, preview = by_method.post("preview_reassign", is_even=False)
    assert status == 200
    assert preview["stretches"]
    assert not path.exists()
    version = preview["version"]
    assert by_method.post("reassign", version=version + 1, without=[])[0] == 409
    status, answer = by_method.post("reassign", version=version, without=[])
    assert status == 200
    assert answer["stretches"] == preview["stretches"]
    (edit,) = am.io.read_edits(path, capture)
    assert edit.kind == "reassign"
    _, even = by_method.post("preview_reassign", is_even=True)
    assert by_method.post("reassign", version=even["version"], without=[])[0] == 200
    assert am.io.read_edits(path, capture)[1].kind == "reassign_even"
    by_method.post("undo")
    assert by_method.post("preview_reassign")[0] == 400
    session = am.edit.Session.open(capture, path, recipe_of(capture, am.GNN()))
    assert session.tracks.labels[answer["detections"]].tolist() == answer["labels"]
    assert by_method.post("edit", kind="reassign", detections=[0], name="")[0] != 200


def test_changes_that_are_left_out_stay_out_of_later_assignments(by_method):
    capture, path = am.read(by_method.folder / CAPTURE), by_method.folder / "trial.edits.toml"
    _, preview = by_method.post("preview_reassign", is_even=False)
    stretches = preview["stretches"]
    group = stretches[0]["group"]
    n = sum(each["n_detections"] for each in stretches if each["group"] == group)
    assert n < sum(each["n_detections"] for each in stretches)
    status, answer = by_method.post("reassign", version=preview["version"], without=[group])
    assert status == 200
    (edit,) = am.io.read_edits(path, capture)
    kept = [int(capture.offsets[frame]) + point for frame, point in edit.at]
    assert len(kept) == n
    assert answer["detections"]
    assert not set(kept) & set(answer["detections"])
    _, again = by_method.post("preview_reassign", is_even=False)
    status, answer = by_method.post("reassign", version=again["version"], without=[])
    assert status == 200
    assert not set(kept) & set(answer["detections"])


def test_an_edit_and_an_answer_are_previewed_without_being_made(served):
    capture, path = am.read(served.folder / CAPTURE), served.folder / "trial.edits.toml"
    _, message = same(served)
    choice = {"assessment": 0, "decision": 0, "alternative": 0}
    for action, values in (("edit", message), ("choose", choice)):
        status, preview = served.post(f"preview_{action}", **values)
        assert status == 200
        assert not path.exists() or not am.io.read_edits(path, capture)
        _, answer = served.post(action, **values)
        assert answer["stretches"] == preview["stretches"]
        served.post("undo")
    assert served.post("preview_edit", kind="reassign", detections=[0], name="")[0] != 200


def test_contradictions_are_refused_and_change_nothing(served):
    _, message = same(served)
    assert served.post("edit", **message)[0] == 200
    before = (served.folder / "trial.edits.toml").read_bytes()
    status, text = served.post("edit", **{**message, "kind": "different"})
    assert status == 409
    assert "contradicts" in text
    assert (served.folder / "trial.edits.toml").read_bytes() == before


def test_every_page_receives_every_event(served):
    _, message = same(served)
    one, other = served.listen(), served.listen()
    wait(lambda: len(one) >= 2 and len(other) >= 2)
    served.post("edit", **message)
    for events in (one, other):
        wait(lambda events=events: any(kind == "assessment" and e["assessment"] == 1
                                       for kind, e in events))  # fmt: skip
    served.post("undo")
    for events in (one, other):
        wait(lambda events=events: any(kind == "assessment" and e["assessment"] == 2
                                       for kind, e in events))  # fmt: skip
    for events in (one, other, served.listen()):
        wait(lambda events=events: sum(kind == "change" for kind, _ in events) == 2)
        versions = [event["version"] for kind, event in events if kind == "change"]
        assert versions == [1, 2]
    assert [kind for kind, _ in one] == [kind for kind, _ in other]
    late = served.listen(since=1)
    wait(lambda: any(kind == "change" for kind, _ in late))
    assert [event["version"] for kind, event in late if kind == "change"] == [2]


def test_decisions_are_chosen_and_followed(served):
    events = served.listen()
    wait(lambda: any(kind == "assessment" for kind, _ in events))
    first = next(event for kind, event in events if kind == "assessment")
    assert first["decisions"]
    shares = [each["probability"] for each in first["decisions"]]
    assert max(shares) < 0.8
    status, answer = served.post("choose", assessment=0, decision=0, alternative=None)
    assert status == 200, answer
    wait(lambda: any(kind == "assessment" and e["assessment"] == 1 for kind, e in events))
    then = next(e for kind, e in events if kind == "assessment" and e["assessment"] == 1)
    gone = first["decisions"][0]
    assert all((each["track"], each["at"]) != (gone["track"], gone["at"])
               for each in then["decisions"])  # fmt: skip


def test_saved_files_are_named_and_never_the_input(by_method):
    _, message = same(by_method, am.GNN())
    by_method.post("edit", **message)
    capture, folder = am.read(by_method.folder / CAPTURE), by_method.folder
    input = (folder / CAPTURE).read_bytes()
    for _ in range(2):  # the second time it replaces what it wrote itself
        status, answer = by_method.post("save")
        assert (status, answer["saved"]) == (200, "trial.corrected.c3d")
    assert (folder / CAPTURE).read_bytes() == input
    saved = am.io.read_tracks(folder / "trial.corrected.c3d")
    edits = am.io.read_edits(folder / "trial.edits.toml", capture)
    expected = am.track(capture, am.GNN(), edits=edits)
    assert saved.n_tracks == expected.n_tracks


def test_a_session_is_continued_and_stopped(folder):
    by_method = ("--method", "gnn")
    served = Served(folder, *by_method, is_command=True)
    _, message = same(served, am.GNN())
    assert served.post("edit", **message)[0] == 200
    served.listen()  # an open page does not hold it up
    assert served.stop(signal.SIGTERM)[0] == 0
    served = Served(folder, *by_method, is_command=True)
    events = served.listen()
    wait(lambda: bool(events))
    assert len(events[0][1]["edits"]) == 1
    assert served.post("undo")[0] == 200
    assert served.stop() == (0, "")
