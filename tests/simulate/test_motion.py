"""People in motion: feet, speeds, joints, flight, and scenes of two, a hand and a juggler."""

from __future__ import annotations

import time

import numpy as np
import pytest

from asterism.camera import Rig
from asterism.errors import ParameterError
from asterism.simulate.people import fingers, juggler, person, two_people
from asterism.simulate.people.curves import about_x, about_z, blend, through
from asterism.simulate.people.skeleton import LENGTHS, SIDES, two_bones
from tests.simulate.bodies import ACTIVITY, fastest, gaps


def _of(truth, name, prefix=""):
    return truth.positions()[:, truth.names.index(prefix + name)]


def _capsules(truth, name):
    return [s for s in truth.surfaces if s.name == name]


def _hip(truth, side):
    """A hip joint, from the axis of the thigh."""
    start, end = np.moveaxis(_capsules(truth, side + "thigh")[0].ends, 1, 0)
    return start + (start - end) * 0.010 / 0.130


def _root(truth):
    return (_hip(truth, "L") + _hip(truth, "R")) / 2


def _angle(a, b):
    cos = (a * b).sum(-1) / np.linalg.norm(a, axis=-1) / np.linalg.norm(b, axis=-1)
    return np.degrees(np.arccos(np.clip(cos, -1, 1)))


def _bone(truth, name):
    start, end = np.moveaxis(_capsules(truth, name)[-1].ends, 1, 0)
    return end - start


def _contacts(truth, height):
    """Heel and ball of both feet: positions (T, 4, 3) and whether they touch the ground."""
    ends = np.concatenate([_capsules(truth, s + "foot")[0].ends for s in SIDES], axis=1)
    lowest = ends[..., 2] - 0.020 * height
    return ends, lowest


@pytest.mark.parametrize("seed", range(4))
@ACTIVITY
def test_feet_neither_slide_nor_sink(activity, seed):
    truth = person(activity=activity, frames=400, seed=seed)
    ends, lowest = _contacts(truth, 1.75)
    assert lowest.min() > -0.004
    is_down = lowest < 0.0005
    for k in range(4):
        edges = np.flatnonzero(np.diff(np.r_[0, is_down[:, k], 0]))
        for start, stop in edges.reshape(-1, 2):
            assert np.ptp(ends[start:stop, k, :2], axis=0).max() < 0.02  # as it comes and goes
            if stop - start > 6:
                assert np.ptp(ends[start + 3 : stop - 3, k, :2], axis=0).max() < 0.002
    stands = is_down.any(axis=1)
    if activity in ("walk", "turn"):
        assert stands.all()
    else:
        assert 0.1 < (~stands).mean() < 0.6


@pytest.mark.parametrize("seed", range(4))
def test_people_walk_and_run_as_fast_as_people_do(seed):
    for activity, speeds, steps, strides in (
        ("walk", (1.1, 1.6), (100, 130), (1.2, 1.7)),
        ("run", (2.5, 4.0), (150, 185), (1.8, 2.8)),
    ):
        truth = person(activity=activity, frames=1000, seed=seed)
        root = _root(truth)
        speed = np.linalg.norm(root[-1] - root[0]) / 9.99
        _, lowest = _contacts(truth, 1.75)
        is_down = (lowest[:, :2] < 0.0005).any(axis=1)  # the left foot
        landings = np.flatnonzero(np.diff(is_down.astype(int)) == 1)
        stride = (landings[-1] - landings[0]) / (len(landings) - 1) / 100
        assert speeds[0] < speed < speeds[1]
        assert steps[0] < 120 / stride < steps[1]
        assert strides[0] < speed * stride < strides[1]
        share = is_down[landings[0] + 1 : landings[-1] + 1].mean()
        assert (0.57 < share < 0.65) if activity == "walk" else (0.28 < share < 0.42)


@pytest.mark.parametrize("seed", range(4))
def test_joints_bend_as_the_normative_curves_say(seed):
    for activity, knee_peak, hip_range, elbow in (
        ("walk", (55, 72), (38, 68), (5, 50)),
        ("run", (90, 130), (48, 85), (60, 120)),
    ):
        truth = person(activity=activity, frames=400, seed=seed)
        for side in SIDES:
            thigh = _bone(truth, side + "thigh")
            knee = _angle(thigh, _bone(truth, side + "shank"))
            assert knee_peak[0] < knee.max() < knee_peak[1]
            assert knee.min() > 4  # never locked
            ahead = _root(truth)[-1] - _root(truth)[0]
            hip = np.degrees(np.arctan2(thigh @ ahead / np.linalg.norm(ahead), -thigh[:, 2]))
            assert hip_range[0] < np.ptp(hip) < hip_range[1]
            bend = _angle(_bone(truth, side + "arm"), _bone(truth, side + "forearm"))
            assert elbow[0] < bend.min() < bend.max() < elbow[1]


@pytest.mark.parametrize("activity", ["run", "jump"])
@pytest.mark.parametrize("seed", range(3))
def test_who_flies_falls_freely(activity, seed):
    rate = 200.0
    truth = person(activity=activity, frames=600, rate=rate, seed=seed)
    _, lowest = _contacts(truth, 1.75)
    flies = (lowest > 0.002).all(axis=1)
    inside = np.flatnonzero(flies[:-2] & flies[1:-1] & flies[2:])
    assert len(inside) > 30
    pull = np.diff(_root(truth)[:, 2], n=2)[inside] * rate**2
    assert np.allclose(pull, -9.81, atol=1e-3)


@pytest.mark.parametrize("seed", range(6))
def test_people_jump_as_high_as_people_do(seed):
    truth = person(activity="jump", frames=300, seed=seed)
    root = _root(truth)[:, 2]
    flies = (_contacts(truth, 1.75)[1] > 1e-6).all(axis=1)
    assert 0.2 < root.max() - root[np.flatnonzero(flies)[0]] < 0.5
    assert root.min() < root[0] - 0.2  # the crouch
    assert abs(root[0] - root[-1]) < 0.01
    long = person(activity="jump", frames=905, seed=seed)
    top = _root(long)[:, 2]
    assert (np.diff((top > root[0] + 0.15).astype(int)) == 1).sum() == 3


@pytest.mark.parametrize(("activity", "limit"), [("walk", 6.5), ("run", 9), ("jump", 11)])
@pytest.mark.parametrize("seed", range(4))
def test_no_marker_is_faster_than_people_are(activity, limit, seed):
    assert fastest(person(activity=activity, frames=400, seed=seed), 100.0, 1) < limit


@pytest.mark.parametrize("seed", range(2))
def test_left_and_right_are_alike_in_the_mean(seed):
    truth = person(frames=3000, seed=seed)
    root = _root(truth)
    forward = root[-1] - root[0]
    turn = about_z(-np.degrees(np.arctan2(forward[1], forward[0])))
    mean = ((truth.positions() - root[:, None]) @ turn.T).mean(axis=0)
    of = dict(zip(truth.names, mean, strict=True))
    pairs = [name for name in of if name[0] == "L" and "R" + name[1:] in of]
    assert len(pairs) == 23
    for name in pairs:
        assert np.abs(of[name] * [1, -1, 1] - of["R" + name[1:]]).max() < 0.02


@pytest.mark.parametrize("seed", range(3))
def test_who_turns_looks_back(seed):
    truth = person(activity="turn", frames=500, seed=seed)
    ahead = (_of(truth, "LASI") + _of(truth, "RASI")) / 2 - _of(truth, "SACR")
    heading = np.unwrap(np.arctan2(ahead[:, 1], ahead[:, 0]))
    assert abs(heading[420] - heading[80]) > 0.9 * np.pi
    assert np.linalg.norm(_root(truth)[:, :2], axis=1).max() < 4


@pytest.mark.parametrize("height", [1.3, 1.75, 2.1])
def test_a_person_is_as_tall_as_asked(height):
    truth = juggler(frames=1, height=height, n_markers=90)
    top = max((s.ends[..., 2] + s.radius).max() for s in truth.surfaces)
    assert abs(top - height) < 0.03 * height
    thigh = np.linalg.norm(_bone(truth, "Lthigh")[0]) / height
    assert np.isclose(thigh, 0.135)  # the lower of its two capsules
    assert np.isclose(sum(LENGTHS[k] for k in ("ankle", "shank", "thigh")), 0.530)


def test_two_who_cross_pass_closely_and_part():
    truth = two_people(frames=600, seed=4)
    a, b = (_of(truth, "STRN", prefix) for prefix in ("A:", "B:"))
    apart = np.linalg.norm(a - b, axis=1)
    assert 0.5 < apart.min() < 1.0
    assert abs(int(apart.argmin()) - 300) < 30
    assert min(apart[0], apart[-1]) > 5


@pytest.mark.parametrize("seed", range(3))
def test_two_who_hug_come_close_hide_markers_and_part(seed):
    truth = two_people(activity="hug", frames=600, seed=seed)
    apart = np.linalg.norm(_of(truth, "STRN", "A:") - _of(truth, "STRN", "B:"), axis=1)
    assert apart[300] < 0.30
    assert min(apart[0], apart[-1]) > 1.0
    for one, other in ("AB", "BA"):  # the arms reach round the other's back
        back, chest = _of(truth, "T10", other + ":")[300], _of(truth, "STRN", other + ":")[300]
        for side in SIDES:
            hand = _of(truth, f"{side}FIN", one + ":")[300]
            assert (hand - back) @ (back - chest) > -0.005
            assert np.linalg.norm(hand - back) < 0.5
    rig = Rig.ring(8, radius=3.5, height=2.3)
    chests = [truth.names.index(prefix + "STRN") for prefix in ("A:", "B:")]
    seen = [
        rig.project(
            truth.positions()[frame],
            surfaces=[type(s)(ends=s.ends[frame], radius=s.radius) for s in truth.surfaces],
        ).visible.sum(axis=0)
        for frame in (150, 300)
    ]
    assert (seen[1][chests] <= 2).all()
    assert seen[1].sum() < 0.95 * seen[0].sum()


@pytest.mark.parametrize("seed", range(4))
def test_a_hand_is_a_hand(seed):
    truth = fingers(frames=600, seed=seed)
    assert truth.n_tracks == 23
    assert sorted(set(truth.colours.tolist())) == [1, 2, 3, 4, 5, 6]
    positions = truth.positions()
    size = np.linalg.norm(positions - positions.mean(axis=1, keepdims=True), axis=-1)
    assert 0.08 < size.max() < 0.16
    for finger in "IMRL":  # closed and open, each in its own time
        stretch = np.linalg.norm(_of(truth, finger + "4") - _of(truth, finger + "1"), axis=1)
        assert stretch.min() < 0.9 * stretch.max()  # along the back, which grows longer as it bends
    stretches = [np.linalg.norm(_of(truth, f + "4") - _of(truth, f + "1"), axis=1) for f in "IMRL"]
    alike = np.corrcoef(stretches)[np.triu_indices(4, 1)]
    assert alike.max() < 0.97
    assert fastest(truth, 100.0, 1) < 2


@pytest.mark.parametrize("n_balls", [3, 5, 7])
def test_balls_fly_on_parabolas_and_lie_in_hands(n_balls):
    rate = 500.0
    truth = juggler(n_balls=n_balls, frames=1500, rate=rate, seed=n_balls)
    balls = truth.positions()[:, -n_balls:]
    hands = [_capsules(truth, side + "hand")[0] for side in SIDES]
    gap = np.min([gaps(balls, hand) for hand in hands], axis=0)
    is_held = np.abs(gap - 0.035) < 1e-6
    flies = ~is_held & (gap > 0.036)
    assert 0.1 < is_held.mean() < 0.6
    fall = np.diff(balls, n=2, axis=0) * rate**2
    inside = flies[:-2] & flies[1:-1] & flies[2:]
    assert np.allclose(fall[inside], [0, 0, -9.81], atol=1e-5)
    for k in range(n_balls):  # from hand to hand, and each hand holds one ball at a time
        which = [np.abs(gaps(balls[:, [k]], hand)[:, 0] - 0.035) < 1e-6 for hand in hands]
        assert which[0].any()
        assert which[1].any()
    for hand in hands:
        assert (np.abs(gaps(balls, hand) - 0.035) < 1e-6).sum(axis=1).max() == 1


@pytest.mark.parametrize(
    ("make", "wrong"),
    [
        (person, {"activity": "fly"}),
        (person, {"n_markers": 39}),
        (person, {"n_markers": 91}),
        (person, {"n_markers": 50.5}),
        (person, {"height": 1.1}),
        (person, {"height": float("nan")}),
        (two_people, {"activity": "walk"}),
        (two_people, {"heights": (1.7,)}),
        (two_people, {"heights": (1.3, 2.0)}),
        (two_people, {"heights": (1.7, 2.3)}),
        (two_people, {"n_markers": 30}),
        (juggler, {"n_balls": 4}),
        (juggler, {"n_balls": 3.5}),
        (juggler, {"height": 3}),
    ],
)
def test_what_makes_no_person_is_refused(make, wrong):
    with pytest.raises(ParameterError, match=next(iter(wrong))):
        make(**wrong, frames=3)


def test_a_thousand_frames_are_made_at_once():
    start = time.process_time()
    person(frames=1000, n_markers=60)
    assert time.process_time() - start < 1.0


def test_two_bones_reach_and_bend_the_right_way():
    rng = np.random.default_rng(0)
    start = rng.normal(size=(50, 3))
    end = start + rng.normal(size=(50, 3)) * 0.2
    front = rng.normal(size=(50, 3))
    reach = np.linalg.norm(end - start, axis=1)
    near = (reach > 0.06) & (reach < 0.84)
    for bend in (1.0, -1.0):
        upper, lower = two_bones(start, end, 0.45, 0.40, front, bend)
        for turn in (upper, lower):
            assert np.allclose(turn @ np.swapaxes(turn, 1, 2), np.eye(3), atol=1e-9)
            assert np.allclose(np.linalg.det(turn), 1)
        knee = start - 0.45 * upper[:, :, 2]
        assert np.allclose((knee - 0.40 * lower[:, :, 2])[near], end[near], atol=1e-9)
        middle = (
            start + (end - start) * (((knee - start) * (end - start)).sum(1) / reach**2)[:, None]
        )
        assert (bend * ((knee - middle) * front).sum(axis=1)[near] > 0).all()


def test_curves_keep_to_their_knots():
    t = np.linspace(-1, 4, 501)
    value = through(t, [(0, 1.0, 0, 0), (1, 2.0, 3.0, -4.0), (3, 0.0, 0, 0)], derivatives=2)
    assert np.allclose(value[t <= 0], [1, 0, 0])
    assert np.allclose(value[np.isclose(t, 1)], [2, 3, -4])
    assert np.abs(np.diff(value[:, 0]) * 100 - value[1:, 1]).max() < 0.3
    up = blend(t, 0, 1, 2, 3)
    assert up.min() == 0
    assert np.isclose(up[np.isclose(t, 1.5)], 1)
    assert np.allclose(up[t >= 3], 0)
    assert np.allclose(about_x(90.0) @ [0, 1, 0], [0, 0, 1])
