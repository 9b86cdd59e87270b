"""Pieces of stitching against slow obvious answers, on scenes so small that the answer is clear."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest
from scipy import stats
from scipy.spatial.transform import Rotation

import asterism as am
from asterism import _engine
from asterism.model.compiled import motion_model, steps_of, transition
from asterism.tracking.stitching.passes import Pass, go_through
from asterism.tracking.stitching.whole import stitch_options
from tests.references.rigid_body import BodyByHand

NOISE = 1e-3
MODEL = am.TrackingModel(
    motion=am.DWNA(acceleration_sigma=1, velocity_sigma=1),
    sensor=am.Sensor(noise_sigma=NOISE, p_detection=0.9, clutter_density=0.1),
    population=am.Population(birth_density=0.1, p_disappear=0.001, max_speed=5, max_gap=4),
)
BODY = np.random.default_rng(1).uniform(-0.4, 0.4, (8, 3))
PLACE = np.array([0.05, 0.02, 0.1])  # of the marker that is hidden
WORTH = 0.25
BESIDE = 12 * NOISE**2  # variance that stitching adds to that of carried places


@dataclasses.dataclass
class Found:
    """Of each fragment, in order of its label: the marker, the label before, how probably."""

    fragments: Any
    marker: list[int]
    after: list[int]
    probability: Any
    n_cuts: int

    def logit(self, k):
        return float(np.log(self.probability[k] / (1 - self.probability[k])))


def one_pass(dense, *, advice=(), model=MODEL, confirm=15, max_hidden=None, may_cut=True):
    """Stitch forward once; each column of (frames, labels, 3) is a label, and begins in order."""
    take = am.Tracks.from_dense(np.arange(len(dense)) / 100, dense)
    d = take.detections
    motion = motion_model(model, dense.shape[2])
    options = stitch_options(model, confirm, 0.03, max_hidden, may_cut)
    stitcher = _engine.Stitcher(motion, options)
    if len(advice):
        of, before, weights = zip(*advice, strict=True)
        stitcher.advise(np.array(of), np.array(before), np.array(weights, dtype=float))
    out = stitcher.run(
        motion, d.times, *steps_of(model.motion, d.times), d.offsets, d.points, take.labels
    )
    return Found(out[0], out[1].tolist(), out[2].tolist(), out[3], stitcher.n_cuts)


def scene(*seen, frames=300, body=BODY):
    """A body at rest, and others beside it as (first, last, place), in order of the first."""
    dense = np.full((frames, len(body) + len(seen), 3), np.nan)
    dense[:, : len(body)] = body
    for k, (first, last, place) in enumerate(seen, len(body)):
        dense[first : last + 1, k] = place
    return dense


# What neighbours know of each other


@pytest.mark.parametrize("n_frames", [1, 2, 300, 900])
def test_distances_are_remembered_for_four_hundred_frames(n_frames):
    rng = np.random.default_rng(n_frames)
    far = 0.3 + rng.normal(scale=0.01, size=n_frames)
    neighbours = _engine.Neighbours(3, NOISE**2)
    for x in far:
        neighbours.add(np.array([0, 3], dtype=np.int32), np.array([[0.0, 0, 0], [0, x, 0]]))
    shares = [1 / min(n, 400) for n in range(1, n_frames + 1)]
    weights = np.array([s * np.prod(1 - np.array(shares[n:])) for n, s in enumerate(shares, 1)])
    others, frames, mean, variance, _ = neighbours.of(0)
    assert (others.tolist(), frames.tolist()) == ([3], [n_frames])
    assert mean[0] == pytest.approx(weights @ far)
    assert variance[0] == pytest.approx(weights @ (far - weights @ far) ** 2, abs=1e-15)


def test_what_varies_is_unsteady():
    neighbours = _engine.Neighbours(2, NOISE**2)
    for t in range(200):
        points = [[0.0, 0], [0.2, 0], [-0.2 - 0.01 * (-1) ** t, 0]]
        neighbours.add(np.arange(3, dtype=np.int32), np.array(points))
    others, _, mean, _, predictive = neighbours.of(0)
    assert (others.tolist(), mean) == ([1, 2], pytest.approx([0.2, 0.2]))
    unseen = (0.2 * (0.01 + 1 / 200)) ** 2
    assert predictive == pytest.approx([2 * NOISE**2 + unseen, 0.01**2 + unseen])


def test_a_nearer_neighbour_takes_the_place_of_the_least_steady():
    rng = np.random.default_rng(5)
    middle, around = np.zeros((1, 3)), rng.uniform(0.3, 0.5, (24, 3))
    newcomer = np.full((1, 3), 0.1)
    neighbours = _engine.Neighbours(3, NOISE**2)
    for t in range(200):
        loose = around.copy()
        loose[7] *= 2 + 0.2 * np.sin(0.3 * t)
        points = np.concatenate([middle, loose, newcomer if t >= 60 else newcomer + 9])
        neighbours.add(np.arange(26, dtype=np.int32), points)
    assert sorted(neighbours.of(0)[0]) == sorted({*range(1, 26)} - {8})


# Where neighbours carry a marker, and what else it may be


@pytest.mark.parametrize("D", [2, 3])
def test_carried_is_students_t_about_the_place(D):
    rng = np.random.default_rng(D)
    a = rng.normal(size=(7, D))
    turn = Rotation.from_rotvec([0, 0, 0.7]).as_matrix()[:D, :D]
    b = a @ turn.T + 1 + rng.normal(scale=0.01, size=a.shape)
    then, points = rng.normal(size=(1, D)), rng.normal(size=(20, D))
    v = rng.uniform(0.5, 2, 7) * 1e-5
    place, variance, density = _engine.carried(a, b, 1 / v, then, 1e-6, points)
    at, own = BodyByHand(D, 1e-3).turned(a, b, v, then[0], 1, 1e-6)
    np.testing.assert_allclose(place[:D], at)
    assert variance == pytest.approx(1e-6 + own)
    t = stats.multivariate_t(at, variance * np.eye(D), df=3)
    np.testing.assert_allclose(density, t.logpdf(points))


def test_neighbours_in_one_line_do_not_turn_a_marker_about_it():
    # How far they turned about their line is not known: a marker beside it was carried anywhere.
    rng = np.random.default_rng(4)
    a = np.outer(np.linspace(-0.3, 0.3, 5), [1.0, 0, 0]) + rng.normal(0, 1e-4, (5, 3))
    b = a + np.array([0.02, 0, 0]) + rng.normal(0, 1e-4, (5, 3))
    then = np.array([[0.0, 0.2, 0.0]])
    place, variance, _ = _engine.carried(a, b, np.full(5, 1e8), then, 1e-6, then)
    assert np.linalg.norm(place - [0.02, 0.2, 0]) < 1e-3
    assert variance > 0.05**2  # the marker may be anywhere on a circle about the line
    beside = np.concatenate([a, [[0, 0, 0.1]]])
    turned = np.concatenate([b, [[0.02, 0, 0.1]]])
    place, variance, _ = _engine.carried(beside, turned, np.full(6, 1e8), then, 1e-6, then)
    assert np.linalg.norm(place - [0.02, 0.2, 0]) < 5e-3
    assert variance < 0.01**2


def test_few_neighbours_are_believed_less():
    a, there = np.eye(3)[[0, 1, 2, 2]] * [[1.0], [1], [1], [-1]], np.zeros((1, 3))

    def variance(n, then=there):
        place, variance, _ = _engine.carried(a[:n], a[:n] + 1, np.full(n, 1e4), then, 1e-6, there)
        np.testing.assert_allclose(place, then[0] + 1, atol=1e-12)
        return variance

    assert variance(3) > variance(4) > 1e-6 + 1e-4
    for n in (1, 2):
        assert variance(n, a[:n].mean(axis=0)[None]) == pytest.approx(1e-6)
        beside = a[:n].mean(axis=0)[None] + [0, 0, 0.5]
        assert variance(n, beside) == pytest.approx(1e-6 + 0.15**2)


@pytest.mark.parametrize("D", [2, 3])
def test_elsewhere_is_anywhere_or_beside_another(D):
    rng = np.random.default_rng(D)
    before, points = rng.uniform(-1, 1, (9, D)), rng.uniform(-0.05, 0.05, (5, D))
    volume = np.prod(np.ptp(before, axis=0))
    found = _engine.densities_elsewhere(before, points, noise=NOISE, ghost_radius=0.03)
    for k, y in enumerate(points):
        others = np.delete(points, k, axis=0)
        beside = [stats.multivariate_normal(at, 0.03**2 * np.eye(D)).pdf(y) for at in others]
        assert found[k] == pytest.approx(np.log(1 / volume + sum(beside) / 5))


# Fits that leave the rotation open


@pytest.mark.parametrize("n", [3, 4, 6])
def test_points_in_one_place_are_moved_and_not_turned(n):
    # There the matrix is zero, and so was the vector that was divided by its length.
    R, _, to, rms = _engine.fit_rigid(np.ones((n, 3)), np.full((n, 3), 2.0), np.ones(n))
    np.testing.assert_array_equal(R, np.eye(3))
    np.testing.assert_array_equal(to, [2, 2, 2])
    assert rms == 0


@pytest.mark.parametrize("seed", range(10))
def test_points_on_a_line_go_where_they_are(seed):
    rng = np.random.default_rng(seed)
    a = rng.normal(size=(5, 1)) * rng.normal(size=3) + rng.normal(size=3)
    b = Rotation.random(random_state=seed).apply(a) + 1
    R, from_, to, rms = _engine.fit_rigid(a, b, rng.uniform(0.5, 2, 5))
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-9)
    assert np.linalg.det(R) == pytest.approx(1)
    np.testing.assert_allclose((a - from_) @ R.T + to, b, atol=1e-7)
    assert rms < 1e-7


# What is decided of a fragment


def carried_density(dense, then, now, y):
    """Log density of y where 8 is carried from a frame, hidden since frame 61."""
    by_hand = BodyByHand(3, NOISE, learnt_from=15, bonds_only=False)  # since all are known
    for points in dense[:61]:
        by_hand.see(range(9), points[:9])
    at, variance, _ = by_hand.way(8, 61, then, dict(enumerate(now)), 1, BESIDE)
    return stats.multivariate_t(at, variance * np.eye(3), df=3).logpdf(y)


def test_the_probability_is_that_of_body_and_elsewhere():
    # Hidden too long for its motion to be believed: 8 goes away, 9 comes back.
    dense = scene((0, 60, PLACE), (200, 299, PLACE))
    found = one_pass(dense)
    assert (found.marker[9], found.after[9]) == (8, 8)
    carried = carried_density(dense, 60, BODY, PLACE)
    everything = np.concatenate([BODY, PLACE[None]])
    else_ = _engine.densities_elsewhere(everything, everything, noise=NOISE, ghost_radius=0.03)
    # Log odds of 2 for a marker come back, and 0.5 % for its own motion.
    assert found.logit(9) == pytest.approx(WORTH * (carried - else_[8] + 2 + np.log(0.995)))


@pytest.mark.parametrize("seed", range(4))
def test_the_log_odds_of_a_body_are_those_of_its_steadiest_neighbours(seed):
    rng = np.random.default_rng(seed)
    loose = BODY + rng.normal(size=(300, 8, 3)) * np.linspace(0.0005, 0.004, 8)[:, None]
    dense = scene((0, 60, PLACE), (200, 299, PLACE + 0.003))
    dense[:, :8] = loose
    dense[:, 8:] += rng.normal(scale=0.001, size=(300, 2, 3))
    so_far = dense[:215].reshape(-1, 3)
    so_far = so_far[np.isfinite(so_far[:, 0])]
    means: list[float] = []
    for then in (60, 56, 50):
        looks: list[float] = []
        for t in (200, 205, 210):
            now = dense[t, [*range(8), 9]]
            carried = carried_density(dense, then, now[:8], now[8])
            else_ = _engine.densities_elsewhere(so_far, now, noise=NOISE, ghost_radius=0.03)
            looks.append(carried - else_[8])
        means.append(np.mean(sorted(looks)[1:]))
    gain = np.log(np.mean(np.exp(means))) + 2 + np.log(0.995)
    found = one_pass(dense, may_cut=False)
    assert found.after[9] == 8
    assert found.logit(9) == pytest.approx(WORTH * gain)


@pytest.mark.parametrize("weight", [-2.0, 1.0, 5.0])
def test_advice_is_worth_its_weight_and_half_of_it_against_others(weight):
    dense = scene((0, 60, PLACE), (200, 299, PLACE))
    without = one_pass(dense).logit(9)
    advised = one_pass(dense, advice=[(9, 8, weight)])
    assert advised.logit(9) - without == pytest.approx(WORTH * weight)
    against = one_pass(dense, advice=[(9, 3, weight)])
    assert against.logit(9) - without == pytest.approx(-0.5 * WORTH * weight)


def test_a_short_fragment_is_less_probably_a_marker_come_back():
    long = one_pass(scene((0, 60, PLACE), (200, 299, PLACE)))
    short = one_pass(scene((0, 60, PLACE), (200, 208, PLACE)))
    assert short.after[9] == 8
    assert long.logit(9) - short.logit(9) == pytest.approx(WORTH * 10)


def test_what_was_seen_last_may_have_been_a_ghost():
    dense = scene((0, 60, PLACE), (200, 299, PLACE))
    right, before = one_pass(dense).logit(9), carried_density(dense, 56, BODY, PLACE)
    dense[60, 8] += [0, 0, 0.06]
    # One of the three places that are remembered is wrong, and the bonds are less steady.
    lost = one_pass(dense, may_cut=False).logit(9) - right
    less = carried_density(dense, 56, BODY, PLACE) - before
    assert lost == pytest.approx(WORTH * (np.log(2 / 3) + less), abs=1e-3)


def test_the_worst_of_the_looks_at_a_fragment_does_not_count():
    dense = scene((0, 60, PLACE), (200, 299, PLACE))
    right = one_pass(dense).logit(9)
    dense[200, 9] += [0, 0, 0.05]
    assert one_pass(dense, may_cut=False).logit(9) == pytest.approx(right)
    dense[205, 9] += [0, 0, 0.05]
    assert one_pass(dense, may_cut=False).logit(9) < right - 0.5


def test_fragments_take_what_fits_all_of_them_best():
    # 10 is nearer to 8 than to 9, and 11 can be 8 alone.
    x = np.array([0.02, 0, 0])
    found = one_pass(
        scene(
            (0, 60, PLACE), (0, 60, PLACE + x),
            (200, 299, PLACE + 0.4 * x), (200, 299, PLACE - 0.4 * x),
        )
    )  # fmt: skip
    assert found.after[8:] == [-1, -1, 9, 8]
    alone = one_pass(scene((0, 60, PLACE), (0, 60, PLACE + x), (200, 299, PLACE + 0.4 * x)))
    assert alone.after[8:] == [-1, -1, 8]


def test_rivals_share_the_probability():
    up, right = np.array([0, 0.001, 0]), np.array([0.001, 0, 0])
    hidden = [(0, 60, PLACE + right), (0, 60, PLACE - right)]
    found = one_pass(scene(*hidden, (200, 299, PLACE + up), (200, 299, PLACE - up)))
    assert sorted(found.after[10:]) == [8, 9]
    # This one as that marker, as the other, and the rival as that one are equally probable.
    assert found.probability[10] == pytest.approx(1 / 3, abs=0.01)
    assert found.probability[11] > 0.9  # one is left


def test_a_marker_is_seen_again_before_it_is_hidden_again():
    other = PLACE + np.array([0, 0.3, 0])
    dense = scene(
        (0, 60, PLACE), (100, 130, PLACE), (132, 150, PLACE), (180, 299, PLACE), (240, 299, other)
    )
    found = one_pass(dense)
    assert found.marker[8:] == [8, 8, 8, 8, 9]


def test_a_pause_leaves_no_trace():
    steady = one_pass(scene((0, 60, PLACE), (200, 299, PLACE))).logit(9)
    dense = scene((0, 62, PLACE), (200, 299, PLACE))  # seen in as many frames
    dense[30:32, 8] = np.nan
    assert one_pass(dense).logit(9) == pytest.approx(steady)


def test_what_is_over_in_the_last_frame_may_still_be_gone_on_with():
    found = one_pass(scene((0, 60, PLACE), (285, 294, PLACE), (297, 299, PLACE)))
    assert found.marker[8:] == [8, 8, 8]


def test_who_is_around_a_marker_that_came_back_is_remembered_anew():
    # One half is away when the marker is first hidden, the other half when it comes back again. In
    # between it is seen last in the very frame in which it is known.
    half = [(0, 40, BODY[k]) for k in range(4)]
    back = [(70, 299, BODY[k]) for k in range(4)]
    own = (0, 60, PLACE), (100, 114, PLACE), (250, 299, PLACE)
    others = np.random.default_rng(2).uniform(-0.3, 0.3, (4, 3))
    dense = scene(*half, own[0], *back, *own[1:], body=others)
    dense[126:, :4] = np.nan
    assert one_pass(dense).marker == [0, 1, 2, 3, 4, 5, 6, 7, 8, 4, 5, 6, 7, 8, 8]


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
def test_what_is_there_from_the_start_of_a_short_take_is_no_ghost(frames):
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
    assert set(found.fragments[~late & (labels == 3)]) == {3}
    assert len(set(found.fragments[late & (labels == 3)])) == 1
    marker = np.array(found.marker)[found.fragments]
    np.testing.assert_array_equal(marker[late & (labels == 3)], 8)
    np.testing.assert_array_equal(marker[late & (labels == 8)], 3)


def test_a_link_is_not_cut_where_the_steady_know_it():
    # What is nearest to the marker never held still, and now jumps; its body is farther away.
    t = np.arange(300)
    dense = scene((0, 299, PLACE), body=np.concatenate([BODY, PLACE + 0.1 * BODY]))
    dense[:, 8:16, 0] += (0.05 * np.sin(0.05 * t) + 0.15 * (t >= 200))[:, None]
    assert one_pass(dense).n_cuts == 0


def test_a_marker_hidden_for_longer_than_it_may_be_is_forgotten():
    dense = scene((0, 60, PLACE), (200, 299, PLACE))
    # It must still be known when its fragment is decided upon.
    assert one_pass(dense, max_hidden=153).marker[9] == 8
    assert one_pass(dense, max_hidden=152).marker[9] == 9


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


# Passes


def test_a_backward_pass_is_a_forward_one_through_the_take_reversed():
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
    np.testing.assert_array_equal(back.fragments[::-1], there.fragments)
    np.testing.assert_array_equal(back.markers, there.markers)
    np.testing.assert_array_equal(back.after, there.after)


def test_a_pass_advises_whom_its_joins_come_from():
    told: list[Any] = []

    class Listener:
        def advise(self, labels, before, weights):
            told.extend(zip(labels.tolist(), before.tolist(), weights, strict=True))

    found = Pass(
        fragments=np.zeros(0, np.int32), markers=np.array([0, 1, 0, 0, -2, 1], np.int32),
        after=np.array([-1, -1, 0, 2, -1, 1], np.int32),
        probabilities=np.array([1, 1, 1 / (1 + np.exp(-0.5)), 1, 0.9, 0.1]), n_cuts=0,
    )  # fmt: skip
    found.advise(Listener())  # pyright: ignore[reportArgumentType]
    # 2 went on with 0: in the other direction 0 goes on with 2.
    assert [(label, before) for label, before, _ in told] == [(0, 2), (2, 3), (1, 5)]
    assert [weight for *_, weight in told] == pytest.approx([0.5 / WORTH, 5, 1])


# Streams


def stream(dense, *, lag=2, confirm=15, revise=None, labels=None):
    """Labels in the end, and what was told in each frame as (detection, marker)."""
    options = stitch_options(MODEL, confirm, 0.03, None)
    live = _engine.LiveStitcher(motion_model(MODEL, 3), options, lag=lag)
    F, Q = transition(MODEL.motion, 0.01)
    final: list[int] = []
    told: list[list[tuple[int, int]]] = []
    for t, points in enumerate(dense):
        seen = np.isfinite(points[:, 0])
        own = np.flatnonzero(seen) if labels is None else labels[t][seen]
        which, new = np.array((revise or {}).get(t, []), dtype=np.int64).reshape(-1, 2).T
        live, markers, changed, now = live.step(
            F, Q, points[seen], own, np.ascontiguousarray(which), np.ascontiguousarray(new)
        )
        first = len(final)
        final.extend(markers)
        for detection, marker in zip(changed, now, strict=True):
            assert detection < first
            assert final[detection] != marker  # only what changes is told
            final[detection] = marker
        told.append(list(zip(changed.tolist(), now.tolist(), strict=True)))
    return np.array(final), told


def test_what_was_not_known_is_told_when_it_is():
    dense = np.zeros((40, 1, 3))
    final, told = stream(dense)
    assert (final[:38] == 0).all()
    # Frame 14 makes the fragment a marker, and is taken two frames later.
    assert told[:16] == [[]] * 16
    assert told[16] == [(k, 0) for k in range(16)]


def test_what_is_decided_late_is_told_from_its_first_frame():
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
