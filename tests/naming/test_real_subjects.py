"""Real subjects: sets of a static trial and of other subjects name the gait trials.

The benchmark measures all six subjects; here are two, with what must never be missed.
"""

from __future__ import annotations

import sys
from functools import cache

import numpy as np
import pytest

import asterism as am
from tests.paths import DATA, ROOT

sys.path.append(str(ROOT / "benchmarks"))

from naming_takes import SHARED, SUBJECTS, Sets, clean, corrupted, read_trials

FOLDER = SHARED / "markersets" / SUBJECTS

pytestmark = [
    pytest.mark.data,
    pytest.mark.skipif(not FOLDER.is_dir(), reason=f"no marker sets of real subjects at {FOLDER}"),
    pytest.mark.skipif(not DATA.is_dir(), reason=f"no real captures at {DATA}"),
]

NAMED = ("HC002D", "HC031A")


@cache
def sets():
    return Sets(read_trials(SHARED / "markersets", DATA))


def straight(subject):
    return sets().trials[subject, "Straight"].tracks


def scores(take, made):
    """Scores of all detections, and the percent of the markers' with the name of the other side."""
    named = am.name_tracks(take.tracks, made).tracks
    own = take.truth >= 0
    whole, of_markers = (
        am.metrics.name_scores(named.labels[i], take.truth[i], named.names, take.names)
        for i in (slice(None), own)
    )
    return whole.name_f1, of_markers.swapped_sides_percent


@pytest.mark.parametrize("subject", NAMED)
def test_a_static_trial_names_the_gait_trial(subject):
    f1, exchanged = scores(clean(straight(subject)), sets().static(subject))
    assert f1 >= 0.999
    assert exchanged == 0


@pytest.mark.parametrize("subject", NAMED)
def test_a_static_trial_names_pieces_among_ghosts(subject):
    take = corrupted(straight(subject), seed=1)
    assert (take.truth < 0).sum() > take.tracks.detections.n_frames  # ghosts
    assert take.tracks.n_tracks > 4 * len(take.names)
    f1, exchanged = scores(take, sets().static(subject))
    assert f1 >= 0.999
    assert exchanged == 0


@pytest.mark.parametrize("subject", NAMED)
def test_other_subjects_name_the_gait_trial(subject):
    f1, exchanged = scores(clean(straight(subject)), sets().others(subject))
    assert f1 >= 0.999
    assert exchanged == 0


def test_arms_are_on_their_sides_although_the_set_lacks_markers_of_one():
    trial = sets().trials["HC032A", "Turn"]
    made = sets().static("HC032A")
    gone = ("RELB", "RWRA", "LTOE")
    made = made.select([m for m, name in enumerate(made.names) if name not in gone])
    _, exchanged = scores(clean(trial.tracks), made)
    assert exchanged == 0


def test_a_name_goes_to_the_track_that_has_none():
    gone = ("LFHD", "LASI", "RASI")
    made = sets().static("HC030A")
    made = made.select([m for m, name in enumerate(made.names) if name not in gone])
    take = clean(straight("HC030A"))
    found = am.name_tracks(take.tracks, made)
    given = np.array([*found.tracks.names, None], dtype=object)[found.tracks.labels]
    true = np.array(take.names, dtype=object)[take.truth]
    assert (given == true)[~np.isin(true, gone)].all()


@pytest.mark.parametrize("which", ["static", "others"])
def test_an_exchange_inside_the_tracks_of_a_file_is_found(which):
    trial = sets().trials["HC032A", "Turn"]
    take = clean(trial.tracks)
    found = am.name_tracks(take.tracks, getattr(sets(), which)("HC032A"))
    given = np.array([*found.tracks.names, None], dtype=object)[found.tracks.labels]
    right = given == np.array(take.names, dtype=object)[take.truth]
    wrong = trial.is_wrong[take.tracks.detections.frame_of, take.truth]
    assert right[~wrong].all()
    changed = {change.name for change in found.changes}
    assert changed == {"RNAV", "RHLX"}


def test_two_subjects_who_walk_through_each_other_have_their_own_names():
    pair = [straight(subject) for subject in NAMED]
    n_frames = min(t.detections.n_frames for t in pair)
    places = [t.positions()[:n_frames] for t in pair]
    both = np.concatenate([places[0], places[1] + np.array([0, 0.5, 0])], axis=1)
    merged = am.Tracks.from_dense(pair[0].detections.times[:n_frames], both)
    own = [sets().static(subject).of_subject(subject) for subject in NAMED]
    found = am.name_tracks(merged, *own)
    right = [f"{s}:{n}" for s, t in zip(NAMED, pair, strict=True) for n in t.names]
    assert found.markers == tuple(right)


@pytest.mark.parametrize("name", ["JA1Gait35.c3d", "mocap36.c3d", "runway_13.c3d", "walking_1.c3d"])
def test_a_set_of_another_protocol_gives_no_certain_name(name):
    (path,) = DATA.rglob(name)
    take = clean(am.simulate.corrupt(am.read(path).tracks))
    found = am.name_tracks(take.tracks, sets().static(NAMED[0]))
    is_named = np.array([marker is not None for marker in found.markers])
    assert not (is_named & (found.probabilities >= 0.99)).any()
