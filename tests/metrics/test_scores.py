"""Scores from label arrays: hand-made cases, slow obvious oracles, and what must not matter."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from asterism.errors import ParameterError
from asterism.metrics import (
    association_scores,
    clear_scores,
    gospa_scores,
    hota_scores,
    identity_scores,
    right_links,
)
from asterism.metrics.counts import successions


def _all_scores(labels, truth, frames):
    found = {}
    for part in (
        clear_scores(labels, truth, frames),
        identity_scores(labels, truth),
        hota_scores(labels, truth),
        gospa_scores(labels, truth, frames),
        association_scores(labels, truth, frames),
    ):
        found |= vars(part)
    return found


def _arrays(case):
    """Read "0:0 1:1 | 0:0 1:-" as frames of track:marker, "-" for none."""
    labels, truth, frames = [], [], []
    for t, frame in enumerate(case.split("|")):
        for word in frame.split():
            a, b = (-1 if x == "-" else int(x) for x in word.split(":"))
            labels.append(a)
            truth.append(b)
            frames.append(t)
    return np.array(labels, dtype=int), np.array(truth, dtype=int), np.array(frames, dtype=int)


CASES = {
    "everything right": (
        "0:0 1:1 | 0:0 1:1 | 0:0 1:1",
        {"mota": 1, "idf1": 1, "hota": 1, "gospa": 0, "switches": 0, "wrong_percent": 0,
         "missing_percent": 0, "n_tracks": 2, "broken_links": 0, "frames_by_wrong": (3,),
         "mostly_tracked": 2, "mostly_lost": 0},
    ),
    "tracks under other numbers are as right": (
        "7:0 3:1 | 7:0 3:1",
        {"mota": 1, "idf1": 1, "hota": 1, "n_tracks": 2, "tracks_per_marker": 1},
    ),
    "two markers swap for good: one switch each, one frame's worth of wrong links": (
        "0:0 1:1 | 0:0 1:1 | 0:0 1:1 | 1:0 0:1",
        {"switches": 2, "mota": 1 - 2 / 8, "idf1": 6 / 8, "wrong_percent": 25,
         "wrong_first_percent": 25, "wrong_links": 2, "broken_links": 2,
         "frames_by_wrong": (3, 0, 1)},
    ),
    "a swap after the first frame is 3/4 wrong by the first marker, 1/4 by the commonest": (
        "0:0 1:1 | 1:0 0:1 | 1:0 0:1 | 1:0 0:1",
        {"wrong_percent": 25, "wrong_first_percent": 75, "idf1": 6 / 8, "switches": 2},
    ),
    "a track that breaks is pure, but only one of its pieces can be the marker": (
        "0:0 | 0:0 | 0:0 | 1:0",
        {"wrong_percent": 0, "wrong_first_percent": 0, "idp": 3 / 4, "idf1": 3 / 4,
         "switches": 1, "fragments": 0, "wrong_links": 0, "broken_links": 1, "n_tracks": 2,
         "tracks_per_marker": 2},
    ),
    "labels that pause are a fragment, not a switch": (
        "0:0 | -:0 | 0:0 | -:0",
        {"fragments": 1, "switches": 0, "missed": 2, "mota": 0.5, "missing_percent": 50,
         "broken_links": 3, "wrong_links": 0, "idr": 0.5, "idp": 1},
    ),
    "a marker that is away and comes back to its track is no fragment": (
        "0:0 1:1 | 0:0 | 0:0 1:1",
        {"fragments": 0, "switches": 0, "mota": 1, "broken_links": 0},
    ),
    "a track that ends unlabelled has no fragment": (
        "0:0 | 0:0 | -:0 | -:0",
        {"fragments": 0, "missed": 2, "broken_links": 2},
    ),
    "a labelled ghost: false, wrong, and one of two clutter points": (
        "0:0 1:- | 0:0 -:-",
        {"false_labels": 1, "mota": 0.5, "wrong_percent": 100 / 3, "idp": 2 / 3, "idr": 1,
         "clutter_labelled_percent": 50, "n_tracks": 2, "deta": 2 / 3, "gospa": 0.1 / 8**0.5},
    ),
    "a track that starts on a ghost is wrong throughout by its first marker": (
        "0:- | 0:0 | 0:0",
        {"wrong_percent": 100 / 3, "wrong_first_percent": 100, "wrong_links": 1, "broken_links": 0},
    ),
    "of equally common markers the lowest is the track's": (
        "0:1 | 0:0",
        {"wrong_percent": 50, "frame_wrong": [1, 0], "frame_wrong_first": [0, 1]},
    ),
    "nothing labelled": (
        "-:0 -:1 | -:0",
        {"mota": 0, "idr": 0, "idf1": 0, "hota": 0, "assa": 0, "idp": np.nan, "n_tracks": 0,
         "wrong_percent": np.nan, "missing_percent": 100, "mostly_lost": 2, "switches": 0,
         "frames_by_wrong": (2,), "gospa": (0.1 + 0.1 / 2**0.5) / 2},
    ),
    "clutter alone, labelled": (
        "0:- | 0:-",
        {"mota": np.nan, "idp": 0, "idr": np.nan, "hota": 0, "wrong_percent": 100,
         "missing_percent": np.nan, "wrong_links": 1, "tracks_per_marker": np.nan},
    ),
    "nothing at all": (
        "",
        {"mota": np.nan, "idf1": np.nan, "hota": np.nan, "gospa": np.nan, "switches": 0,
         "n_markers": 0},
    ),
    "one track taken by both markers in turn leaves one of them": (
        "0:0 | 0:1 | 0:1",
        {"idf1": 4 / 6, "switches": 0, "wrong_links": 1, "mostly_tracked": 2,
         "assa": (1 * 1 / 3 + 2 * 2 / 3) / 3},
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", CASES)
def test_hand_made(name):
    case, expected = CASES[name]
    found = _all_scores(*_arrays(case if case else "|"[:0]))
    for field, value in expected.items():
        if isinstance(value, list):
            assert found[field].tolist() == value, field
        else:
            assert found[field] == pytest.approx(value, abs=1e-12, nan_ok=True), field


@st.composite
def _cases(draw):
    """Draw labels and truth of a few frames, both one-to-one within a frame."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    labels, truth, frames = [], [], []
    for t in range(draw(st.integers(0, 8))):
        n = int(rng.integers(0, 6))
        for array in (labels, truth):
            own = rng.permutation(8)[:n] if rng.random() < 0.5 else np.arange(n)
            array.append(np.where(rng.random(n) < 0.25, -1, own))
        frames.append(np.full(n, t))
    none = [np.empty(0, dtype=int)]
    return tuple(np.concatenate(none + x) for x in (labels, truth, frames))


def _oracle(labels, truth, frames):
    """Count everything point by point, frame by frame."""
    n_frames = int(frames[-1]) + 1 if len(frames) else 0
    found = dict.fromkeys(("missed", "false_labels", "switches", "fragments"), 0)
    last_track, is_on, was_on = {}, {}, {}
    frame_switches = [0] * n_frames
    per_frame_cost = [0.0] * n_frames
    for label, marker, t in zip(labels.tolist(), truth.tolist(), frames.tolist(), strict=True):
        found["missed"] += marker >= 0 > label
        found["false_labels"] += label >= 0 > marker
        per_frame_cost[t] += 0.005 * ((label >= 0) != (marker >= 0))
        if marker < 0:
            continue
        if label >= 0:
            if last_track.get(marker, label) != label:
                found["switches"] += 1
                frame_switches[t] += 1
            last_track[marker] = label
            found["fragments"] += was_on.get(marker, False) and not is_on[marker]
            was_on[marker] = True
        is_on[marker] = label >= 0
    found["frame_switches"] = frame_switches
    found["frame_gospa"] = [c**0.5 for c in per_frame_cost]

    members = {
        k: [m for lab, m in zip(labels.tolist(), truth.tolist(), strict=True) if lab == k]
        for k in sorted(set(labels.tolist()) - {-1})
    }
    wrong = wrong_first = wrong_links = 0
    for markers in members.values():
        real = [m for m in markers if m >= 0]
        common = max(sorted(set(real)), key=real.count) if real else None
        wrong += sum(m != common for m in markers)
        wrong_first += sum(m != markers[0] or m < 0 for m in markers)
        wrong_links += sum(a != b or a < 0 for a, b in itertools.pairwise(markers))
    found |= {"wrong": wrong, "wrong_first": wrong_first, "wrong_links": wrong_links}

    def links(values):
        return {
            pair
            for k in set(values.tolist()) - {-1}
            for pair in itertools.pairwise(np.flatnonzero(values == k).tolist())
        }

    found["broken_links"] = len(links(truth) - links(labels))

    # The best one-to-one matching by trying all of them.
    tracks, markers = sorted(members), sorted(set(truth.tolist()) - {-1})
    shared = np.array([[members[k].count(m) for k in tracks] for m in markers], dtype=int).reshape(
        len(markers), len(tracks)
    )
    if shared.shape[0] > shared.shape[1]:
        shared = shared.T
    found["n_identified"] = max(
        sum(shared[i, j] for i, j in enumerate(columns))
        for columns in itertools.permutations(range(shared.shape[1]), shared.shape[0])
    )
    matches = [
        (k, m) for k, m in zip(labels.tolist(), truth.tolist(), strict=True) if min(k, m) >= 0
    ]
    jaccard = [
        ((labels == k) & (truth == m)).sum() / ((labels == k) | (truth == m)).sum()
        for k, m in matches
    ]
    found["assa"] = float(np.mean(jaccard)) if matches else None
    return found


@settings(max_examples=200, deadline=None)
@given(_cases())
def test_equal_to_counting_point_by_point(case):
    _, truth, _ = case
    found, expected = _all_scores(*case), _oracle(*case)
    for name in (
        "missed", "false_labels", "switches", "fragments", "wrong_links", "broken_links",
        "n_identified",
    ):  # fmt: skip
        assert found[name] == expected[name], name
    assert found["frame_wrong"].sum() == expected["wrong"]
    assert found["frame_wrong_first"].sum() == expected["wrong_first"]
    assert found["frame_switches"].tolist() == expected["frame_switches"]
    assert np.allclose(found["frame_gospa"], expected["frame_gospa"])
    if expected["assa"] is not None:
        assert found["assa"] == pytest.approx(expected["assa"])
    n_frames = len(found["frame_true"])
    assert found["frame_missed"].sum() == found["missed"]
    assert found["frame_false"].sum() == found["false_labels"]
    assert found["frame_true"].sum() == found["n_true"] == (truth >= 0).sum()
    assert sum(found["frames_by_wrong"]) == n_frames
    assert sum(k * n for k, n in enumerate(found["frames_by_wrong"])) == expected["wrong"]


def _equal(a, b):
    for name, value in a.items():
        np.testing.assert_allclose(value, b[name], rtol=1e-12, atol=1e-12, err_msg=name)


@settings(max_examples=80, deadline=None)
@given(_cases(), st.integers(0, 2**32))
def test_order_within_a_frame_and_names_do_not_matter(case, seed):
    labels, truth, frames = case
    rng = np.random.default_rng(seed)
    before = _all_scores(*case)
    order = np.lexsort((rng.random(len(frames)), frames))
    _equal(before, _all_scores(labels[order], truth[order], frames))
    # Track numbers are names only. (Marker numbers break ties of the commonest one.)
    renamed = np.append(rng.permutation(30)[:9], -1)[labels]
    _equal(before, _all_scores(renamed, truth, frames))


@settings(max_examples=80, deadline=None)
@given(_cases())
def test_perfect_labels_are_perfect(case):
    _, truth, frames = case
    found = _all_scores(truth, truth, frames)
    if (truth >= 0).any():
        for name in ("mota", "idf1", "idp", "idr", "hota", "deta", "assa", "tracks_per_marker"):
            assert found[name] == 1, name
    for name in ("switches", "fragments", "wrong_links", "broken_links", "missed", "false_labels"):
        assert found[name] == 0, name
    assert not found["frame_gospa"].any()


def test_errors_of_place_enter_motp_and_gospa():
    labels, truth, frames = _arrays("0:0 1:1 -:2 | 0:0 1:1 -:-")
    error = np.array([0.003, 0.004, np.nan, 0.5, 0.0, np.nan])
    assert clear_scores(labels, truth, frames, error=error).motp_mm == pytest.approx(507 / 4)
    found = gospa_scores(labels, truth, frames, c=0.1, error=error).frame_gospa
    assert np.allclose(found, [np.sqrt(0.003**2 + 0.004**2 + 0.1**2 / 2), 0.1])


def test_a_small_cut_off_makes_misses_cheap():
    labels, truth, frames = _arrays("-:0 | 0:0")
    assert gospa_scores(labels, truth, frames, c=0.02).gospa == pytest.approx(0.02 / 8**0.5)


def test_frames_without_detections_count():
    arrays = _arrays("0:0 | | 0:0")
    assert association_scores(*arrays, n_frames=5).frames_by_wrong == (5,)
    assert len(clear_scores(*arrays, n_frames=5).frame_true) == 5
    assert len(gospa_scores(*arrays, n_frames=5).frame_gospa) == 5


def test_right_links_tell_which_continuations_hold():
    labels, truth, _ = _arrays("0:0 1:1 2:- | 0:0 1:2 2:- | 0:0 1:2 2:0")
    successors, is_right = right_links(labels, truth)
    assert dict(zip(successors.tolist(), is_right.tolist(), strict=True)) == {
        3: True, 4: False, 5: False, 6: True, 7: True, 8: False,
    }  # fmt: skip


def test_many_tracks_sort_as_few():
    # Above 65535 tracks another way of sorting takes over.
    rng = np.random.default_rng(0)
    few = rng.integers(-1, 50, 3000)
    many = np.where(few >= 0, few % 25 + 2**16 * (few // 25), -1)
    for a, b in zip(successions(few), successions(many), strict=True):
        assert np.array_equal(a, b)


@pytest.mark.parametrize(
    ("labels", "truth", "frames", "what"),
    [
        ([0, 1], [0], [0, 0], "truth_labels"),
        ([0, -2], [0, 1], [0, 0], "labels"),
        ([0, 1], [0, -3], [0, 0], "truth_labels"),
        ([0, 1], [0, 1], [1, 0], "frame_of"),
        ([0, 1], [0, 1], [-1, 0], "frame_of"),
        ([0.5, 1], [0, 1], [0, 0], "labels"),
        ([0, 1], [0, 1], [0], "frame_of"),
    ],
)
def test_arrays_that_do_not_fit_are_refused(labels, truth, frames, what):
    for score in (clear_scores, gospa_scores, association_scores):
        with pytest.raises(ParameterError, match=what):
            score(labels, truth, frames)


def test_too_few_frames_are_refused():
    with pytest.raises(ParameterError, match="n_frames"):
        clear_scores([0], [0], [3], n_frames=3)
    with pytest.raises(ParameterError, match="c: expected"):
        gospa_scores([0], [0], [0], c=0)
