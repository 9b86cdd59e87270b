"""People: bodies that hold together, markers on their skin, feet that stand, flights that fall."""

from __future__ import annotations

import numpy as np
import pytest

from asterism.errors import ParameterError
from asterism.simulate.people import fingers, juggler, person, two_people
from asterism.simulate.people.marker_set import MarkerSet
from asterism.simulate.people.skeleton import Body
from tests.simulate.bodies import ACTIVITIES, ACTIVITY, fastest, gaps

SCENES = {
    **{a: lambda a=a, **options: person(activity=a, **options) for a in ACTIVITIES},
    "cross": two_people,
    "hug": lambda **options: two_people(activity="hug", **options),
    "fingers": fingers,
    "juggler": juggler,
}
EVERY = pytest.mark.parametrize("name", SCENES)
SEGMENT = dict(
    zip(
        MarkerSet(body=Body(height=1.75), n_markers=90).names,
        MarkerSet(body=Body(height=1.75), n_markers=90).segments,
        strict=True,
    )
)


def _segment(name, is_hand=False):
    """Name of the capsules that a marker of any scene sits on; none for a ball."""
    if name.startswith("BALL"):
        return None
    if name[1] == ":":
        return name[:2] + SEGMENT[name[2:]]
    if name in SEGMENT and not is_hand:
        return SEGMENT[name]
    if name in ("WRT", "WRL", "BACK") or (name[1] == "1" and name != "T1"):
        return "palm"
    return name if name == "T1" else name[0] + str(int(name[1]) - 1)


def _check_skin(truth, least=0.0):
    """Each marker a few mm above its own segment, outside every other one."""
    positions = truth.positions()
    own = [_segment(name, truth.n_tracks == 23) for name in truth.names]
    on_own = np.full(positions.shape[:2], np.inf)
    for capsule in truth.surfaces:
        gap = gaps(positions, capsule)
        is_own = np.array([segment == capsule.name for segment in own])
        on_own[:, is_own] = np.minimum(on_own[:, is_own], gap[:, is_own])
        k = int(gap[:, ~is_own].min(axis=0).argmin())
        name = np.array(truth.names)[~is_own][k]
        assert gap[:, ~is_own].min() > least, f"{name} in {capsule.name}"
    has_own = np.array([segment is not None for segment in own])
    assert on_own[:, has_own].min() > 0.0005
    assert on_own[:, has_own].max() < 0.005


@EVERY
def test_every_marker_is_there_in_every_frame_at_real_times(name):
    truth = SCENES[name](frames=7, rate=50.0, seed=2)
    assert np.isfinite(truth.positions()).all()
    assert np.allclose(truth.detections.times, np.arange(7) / 50)
    assert len(set(truth.names)) == truth.n_tracks
    assert all(surface.n_moments == 7 for surface in truth.surfaces)
    assert (truth.connections > 0).any(axis=1).mean() > 0.8


@EVERY
def test_same_seed_same_bytes_and_another_seed_another_scene(name):
    first, again, other = (SCENES[name](frames=20, seed=seed) for seed in (3, 3, 5))
    assert first.detections.points.tobytes() == again.detections.points.tobytes()
    assert all(
        (a.ends == b.ends).all() for a, b in zip(first.surfaces, again.surfaces, strict=True)
    )
    assert not np.allclose(first.detections.points, other.detections.points, atol=0.01)


@EVERY
@pytest.mark.parametrize("wrong", [{"frames": 0}, {"frames": 2.5}, {"rate": 0}, {"seed": -1}])
def test_what_makes_no_capture_is_refused(name, wrong):
    with pytest.raises(ParameterError, match=next(iter(wrong))):
        SCENES[name](**wrong)


@EVERY
def test_one_frame_is_a_scene(name):
    assert SCENES[name](frames=1).detections.n_frames == 1


@EVERY
@pytest.mark.parametrize("seed", range(3))
def test_segments_are_rigid(name, seed):
    truth = SCENES[name](frames=60, rate=25.0, seed=seed)
    positions = truth.positions()
    own = [_segment(n, name == "fingers") for n in truth.names]
    n_pairs = 0
    for segment in dict.fromkeys(s for s in own if s):
        members = positions[:, [s == segment for s in own]]
        distances = np.linalg.norm(members[:, :, None] - members[:, None], axis=-1)
        assert np.ptp(distances, axis=0).max() < 1e-9
        n_pairs += members.shape[1] - 1
    assert n_pairs > 6
    for capsule in truth.surfaces:
        assert np.ptp(np.linalg.norm(np.diff(capsule.ends, axis=1), axis=-1)) < 1e-9


@EVERY
def test_nothing_jumps(name):
    # A jump of the velocity would make the acceleration grow as the rate, four times.
    slow, fast = (
        fastest(SCENES[name](frames=int(2 * rate), rate=rate, seed=1), rate, 2)
        for rate in (200.0, 800.0)
    )
    assert fast < 1.35 * slow
    assert fast < 320


@ACTIVITY
@pytest.mark.parametrize(("seed", "height"), [(0, 1.75), (1, 1.75), (2, 1.2), (3, 2.2), (4, 1.6)])
def test_markers_are_on_the_skin_and_in_no_other_part(activity, seed, height):
    truth = person(activity=activity, frames=104, rate=20, seed=seed, n_markers=90, height=height)
    _check_skin(truth)


@pytest.mark.parametrize("activity", ["cross", "hug"])
@pytest.mark.parametrize(("seed", "heights"), [(0, (1.66, 1.82)), (1, (1.9, 1.6)), (2, (1.7, 1.7))])
def test_markers_are_in_neither_of_two_bodies(activity, seed, heights):
    _check_skin(
        two_people(activity=activity, frames=150, rate=25, seed=seed, heights=heights, n_markers=90)
    )


@pytest.mark.parametrize("seed", range(6))
def test_markers_are_on_the_fingers_and_in_none(seed):
    _check_skin(fingers(frames=250, rate=25, seed=seed))


@pytest.mark.parametrize(
    ("n_balls", "height"), [(3, 1.75), (5, 1.3), (5, 1.75), (7, 2.1), (7, 1.3)]
)
def test_jugglers_and_balls_do_not_go_through_each_other(n_balls, height):
    truth = juggler(n_balls=n_balls, frames=300, rate=200, seed=3, n_markers=90, height=height)
    _check_skin(truth)
    balls = truth.positions()[:, -n_balls:]
    for capsule in truth.surfaces:
        assert gaps(balls, capsule).min() > 0.033
    between = np.linalg.norm(balls[:, :, None] - balls[:, None], axis=-1)
    assert between[between > 0].min() > 0.07


def test_a_marker_inside_would_be_found():
    truth = person(frames=5, n_markers=40)
    names = list(truth.names)
    i, j = names.index("LKNE"), names.index("LTIB")
    names[i], names[j] = names[j], names[i]  # as if they were fixed to each other's segment
    bad = type(truth).of(truth.detections.times, truth.positions(), names, surfaces=truth.surfaces)
    with pytest.raises(AssertionError):
        _check_skin(bad)


@pytest.mark.parametrize("n_markers", [40, 41, 53, 60, 90])
def test_sets_of_markers_are_nested(n_markers):
    small, large = (person(frames=4, n_markers=n) for n in (n_markers, 90))
    assert small.n_tracks == n_markers
    assert small.names == large.names[:n_markers]
    assert np.array_equal(small.positions(), large.positions()[:, :n_markers])
    assert {"LASI", "RPSI", "C7", "T10", "CLAV", "STRN", "LTOE", "RHEE"} < set(small.names)


def test_colours_and_lines_tell_the_sides():
    truth = person(frames=1, n_markers=90)
    colour = dict(zip(truth.names, truth.colours.tolist(), strict=True))
    assert colour["LASI"] == 1
    assert colour["RTOE"] == 2
    assert {colour[n] for n in ("C7", "T10", "CLAV", "RBAK", "LBAK", "L3", "SACR")} == {3}
    for i, j in np.argwhere(np.triu(truth.connections)):
        pair = {colour[truth.names[i]], colour[truth.names[j]]} - {3}
        assert pair <= {truth.connections[i, j]} or truth.connections[i, j] == 3
    assert (truth.connections > 0).any(axis=1)[:40].all()
