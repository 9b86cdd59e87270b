"""Pieces of stitching against slow obvious answers, on scenes so small that the answer is clear."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats
from scipy.spatial.transform import Rotation

from asterism import _engine
from tests.references.rigid_body import BodyByHand
from tests.stitching.one_pass import BODY, NOISE, PLACE, WEIGHT, one_pass, scene

BESIDE = 12 * NOISE**2  # variance that stitching adds to that of carried places


@pytest.mark.parametrize("n_frames", [1, 2, 300, 900])
def test_distances_are_remembered_for_four_hundred_frames(n_frames):
    rng = np.random.default_rng(n_frames)
    far = 0.3 + rng.normal(scale=0.01, size=n_frames)
    neighbours = _engine.Neighbours(3, NOISE**2)
    for x in far:
        neighbours.add(np.array([0, 3]), np.array([[0.0, 0, 0], [0, x, 0]]))
    shares = [1 / min(n, 400) for n in range(1, n_frames + 1)]
    weights = np.array([s * np.prod(1 - np.array(shares[n:])) for n, s in enumerate(shares, 1)])
    others, frames, mean, variance, _ = neighbours.of(0)
    assert (others.tolist(), frames.tolist()) == ([3], [n_frames])
    assert mean[0] == pytest.approx(weights @ far)
    assert variance[0] == pytest.approx(weights @ (far - weights @ far) ** 2, abs=1e-15)


@pytest.mark.parametrize("n_markers", [2, 6, 11])
def test_a_distance_is_that_of_the_frames_with_both_markers(n_markers):
    rng = np.random.default_rng(n_markers)
    neighbours = _engine.Neighbours(3, NOISE**2)
    places, kept = rng.normal(0, 0.3, (n_markers, 3)), {}
    for t in range(90):
        points = places + rng.normal(0, 0.01, places.shape)
        seen = np.flatnonzero((rng.uniform(size=n_markers) < 0.6) | (t == 0))
        neighbours.add(seen, points[seen])
        for i in seen:
            for j in set(seen) - {i}:
                kept.setdefault((i, j), []).append(np.linalg.norm(points[i] - points[j]))
    for i in range(n_markers):
        others, frames, mean, variance, predictive = neighbours.of(i)
        assert sorted(others) == sorted({*range(n_markers)} - {i})
        for j, n, m, v in zip(others, frames, mean, variance, strict=True):
            far = np.array(kept[i, j])
            assert (n, m, v) == (len(far), pytest.approx(far.mean()), pytest.approx(far.var()))
        assert (np.diff(predictive) >= 0).all()


def test_what_varies_is_unsteady():
    neighbours = _engine.Neighbours(2, NOISE**2)
    for t in range(200):
        points = [[0.0, 0], [0.2, 0], [-0.2 - 0.01 * (-1) ** t, 0]]
        neighbours.add(np.arange(3), np.array(points))
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
        neighbours.add(np.arange(26), points)
    assert sorted(neighbours.of(0)[0]) == sorted({*range(1, 26)} - {8})


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


def test_few_neighbours_have_less_weight():
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
    found = _engine.background_densities(before, points, noise=NOISE, ghost_radius=0.03)
    for k, y in enumerate(points):
        others = np.delete(points, k, axis=0)
        beside = [stats.multivariate_normal(at, 0.03**2 * np.eye(D)).pdf(y) for at in others]
        assert found[k] == pytest.approx(np.log(1 / volume + sum(beside) / 5))


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


def carried_density(dense, then, now, y):
    """Log density of y where 8 is carried from a frame, occluded since frame 61."""
    by_hand = BodyByHand(3, NOISE, learnt_from=15, bonds_only=False)  # since all are known
    for points in dense[:61]:
        by_hand.see(range(9), points[:9])
    at, variance, _ = by_hand.way(8, 61, then, dict(enumerate(now)), 1, BESIDE, by_hand.trust(8))
    return stats.multivariate_t(at, variance * np.eye(3), df=3).logpdf(y)


def test_the_probability_is_that_of_body_and_elsewhere():
    # Occluded for too long to be predicted by its motion: 8 goes away, 9 comes back.
    dense = scene((0, 60, PLACE), (200, 299, PLACE))
    found = one_pass(dense)
    assert (found.marker[9], found.after[9]) == (8, 8)
    carried = carried_density(dense, 60, BODY, PLACE)
    everything = np.concatenate([BODY, PLACE[None]])
    else_ = _engine.background_densities(everything, everything, noise=NOISE, ghost_radius=0.03)
    # Log odds of 2 for a marker come back, and 0.5 % for its own motion.
    assert found.logit(9) == pytest.approx(WEIGHT * (carried - else_[8] + 2 + np.log(0.995)))


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
            else_ = _engine.background_densities(so_far, now, noise=NOISE, ghost_radius=0.03)
            looks.append(carried - else_[8])
        means.append(np.mean(sorted(looks)[1:]))
    gain = np.log(np.mean(np.exp(means))) + 2 + np.log(0.995)
    found = one_pass(dense, may_cut=False)
    assert found.after[9] == 8
    assert found.logit(9) == pytest.approx(WEIGHT * gain)


@pytest.mark.parametrize("weight", [-2.0, 1.0, 5.0])
def test_advice_has_its_weight_and_half_of_it_against_others(weight):
    dense = scene((0, 60, PLACE), (200, 299, PLACE))
    without = one_pass(dense).logit(9)
    advised = one_pass(dense, advice=[(9, 8, weight)])
    assert advised.logit(9) - without == pytest.approx(WEIGHT * weight)
    against = one_pass(dense, advice=[(9, 3, weight)])
    assert against.logit(9) - without == pytest.approx(-0.5 * WEIGHT * weight)


def test_a_short_fragment_is_less_probably_a_marker_come_back():
    long = one_pass(scene((0, 60, PLACE), (200, 299, PLACE)))
    short = one_pass(scene((0, 60, PLACE), (200, 208, PLACE)))
    assert short.after[9] == 8
    assert long.logit(9) - short.logit(9) == pytest.approx(WEIGHT * 10)


def test_what_was_seen_last_may_have_been_a_ghost():
    dense = scene((0, 60, PLACE), (200, 299, PLACE))
    right, before = one_pass(dense).logit(9), carried_density(dense, 56, BODY, PLACE)
    dense[60, 8] += [0, 0, 0.06]
    # One of the three places that are remembered is wrong, and the bonds are less steady.
    lost = one_pass(dense, may_cut=False).logit(9) - right
    less = carried_density(dense, 56, BODY, PLACE) - before
    assert lost == pytest.approx(WEIGHT * (np.log(2 / 3) + less), abs=1e-3)


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
    occluded = [(0, 60, PLACE + right), (0, 60, PLACE - right)]
    found = one_pass(scene(*occluded, (200, 299, PLACE + up), (200, 299, PLACE - up)))
    assert sorted(found.after[10:]) == [8, 9]
    # This one as that marker, as the other, and the rival as that one are equally probable.
    assert found.probability[10] == pytest.approx(1 / 3, abs=0.01)
    assert found.probability[11] > 0.9  # one is left


def test_a_marker_is_seen_again_before_its_next_occlusion():
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
    # One half is away when the marker is first occluded, the other half when it comes back again.
    # In between it is seen last in the very frame in which it is known.
    half = [(0, 40, BODY[k]) for k in range(4)]
    back = [(70, 299, BODY[k]) for k in range(4)]
    own = (0, 60, PLACE), (100, 114, PLACE), (250, 299, PLACE)
    others = np.random.default_rng(2).uniform(-0.3, 0.3, (4, 3))
    dense = scene(*half, own[0], *back, *own[1:], body=others)
    dense[126:, :4] = np.nan
    assert one_pass(dense).marker == [0, 1, 2, 3, 4, 5, 6, 7, 8, 4, 5, 6, 7, 8, 8]
