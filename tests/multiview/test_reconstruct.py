"""From many views to points: against all sets of image points, exact without noise, hard cases."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.stats import chi2

import asterism as am
from asterism import _engine
from tests.multiview.scenes import LENSES, filmed, observations, random_rig
from tests.references.reconstruction import every_set, score

MODEL = am.multiview.ImageModel(
    sigma_px=0.3, p_detection=0.9, clutter=0.5, density=5.0, volume=((-2, -2, -2), (2, 2, 2))
)


def matched(made, shot, X):
    """Distance of each point from the marker of most of its image points; NaN for none of them."""
    d, who = made.detections, made.markers(shot.observations)
    off = np.linalg.norm(d.points - X[d.frame_of, who], axis=1)
    return np.where(who >= 0, off, np.nan)


def sets_of(made, o):
    """Give the image points of each point of a single frame as indices in each camera."""
    sets = np.full((made.detections.n_points, o.n_cameras), -1)
    sets[made.views.point_of, made.views.cameras] = made.views.blobs - o.offsets[made.views.cameras]
    return sets


@pytest.mark.parametrize("block", range(6))
def test_every_marker_of_two_views_and_no_ghost_without_noise(block):
    rng = np.random.default_rng([1, block])
    model = dataclasses.replace(MODEL, sigma_px=1e-3, p_detection=0.5)
    for _ in range(50):
        rig = random_rig(rng, int(rng.integers(2, 9)), list(LENSES.values())[rng.integers(4)])
        X = rng.uniform(-1, 1, (1, int(rng.integers(1, 40)), 3))
        shot = filmed(rig, X)
        n_seen = (shot.blob_of[:, 0] >= 0).sum(axis=0)
        made = am.reconstruct(shot.observations, rig, model)
        off = matched(made, shot, X)
        assert sorted(made.markers(shot.observations)) == np.flatnonzero(n_seen >= 2).tolist()
        assert off.max(initial=0) < 1e-9
        assert made.info["gap"] == 0


def test_without_noise_nothing_has_to_be_known():
    rng = np.random.default_rng(2)
    for n in (3, 5, 8):
        rig = am.Rig.ring(n, radius=4, height=2)
        X = rng.uniform((-0.8, -0.8, 0.2), (0.8, 0.8, 1.8), (10, 30, 3))
        shot = filmed(rig, X)
        made = am.reconstruct(shot.observations, rig)
        assert matched(made, shot, X).max() < 1e-9
        n_seen = (shot.blob_of >= 0).sum(axis=0)
        assert made.detections.n_points == (n_seen >= 2).sum()


@pytest.mark.parametrize("n", [3, 8])
def test_with_noise_as_exact_as_can_be_and_honest(n):
    rng = np.random.default_rng(3)
    rig = am.Rig.ring(n, radius=4, height=2.5)
    X = rng.uniform((-0.7, -0.7, 0.3), (0.7, 0.7, 1.7), (60, 20, 3))
    shot = filmed(rig, X, noise=0.3, seed=3)
    made = am.reconstruct(shot.observations, rig, dataclasses.replace(MODEL, p_detection=0.97))
    d, who = made.detections, made.markers(shot.observations)
    assert matched(made, shot, X).max() < 0.02
    assert d.n_points == ((shot.blob_of >= 0).sum(axis=0) >= 2).sum()
    off = d.points - X[d.frame_of, who]
    bound = np.trace(d.covariances, axis1=1, axis2=2)
    assert np.sqrt((off**2).sum(axis=1).mean() / bound.mean()) == pytest.approx(1, abs=0.1)
    nees = np.einsum("ni,nij,nj->n", off, np.linalg.inv(d.covariances), off)
    low, high = chi2.ppf([0.0005, 0.9995], 3 * len(off)) / len(off)
    assert low < nees.mean() < high
    np.testing.assert_allclose(d.stds, np.sqrt(bound / 3))
    estimated = am.multiview.estimate_images(shot.observations, rig)
    np.testing.assert_allclose(estimated.sigma_px, 0.3, rtol=0.15)


def test_scores_are_those_of_the_definition():
    rng = np.random.default_rng(4)
    for _ in range(20):
        rig = random_rig(rng, 4, list(LENSES.values())[rng.integers(4)])
        X = rng.uniform(-0.7, 0.7, (1, 3, 3))
        o = filmed(rig, X, noise=0.3, missing=0.2, seed=int(rng.integers(1000))).observations
        model = dataclasses.replace(
            MODEL, sigma_px=(0.3, 0.5, 0.2, 0.4), p_detection=(0.9, 0.6, 0.99, 0.7)
        )
        made = am.reconstruct(o, rig, model, merge_px=0)
        for row, value in zip(sets_of(made, o), made.scores, strict=True):
            chosen = [o.points(0, c)[i] if i >= 0 else None for c, i in enumerate(row)]
            assert value == pytest.approx(score(rig, model, chosen), abs=0.02)


def test_finds_the_best_of_all_choices():
    rng = np.random.default_rng(5)
    n_contested = 0
    for _ in range(12):
        rig = random_rig(rng, 3)
        # Close together, so that rays of different markers meet.
        X = rng.uniform(-0.03, 0.03, (1, 4, 3))
        o = filmed(
            rig, X, noise=0.5, missing=0.1, false=0.3, seed=int(rng.integers(1000))
        ).observations
        model = dataclasses.replace(MODEL, sigma_px=0.5, density=1e3)
        tuples, scores = every_set(rig, model, [o.points(0, c) for c in range(3)])
        best = am.solve.assign_multidimensional(tuples, scores)
        made = am.reconstruct(o, rig, model, merge_px=0)
        n_contested += len(tuples) > len(best.chosen)
        assert made.scores.sum() == pytest.approx(best.value, abs=0.05 * max(len(tuples), 1) ** 0.5)
        assert made.info["n_cut"] == 0
    assert n_contested > 7


def test_the_choice_is_that_of_the_exact_solver():
    rng = np.random.default_rng(6)
    n_hard = 0
    for _ in range(200):
        n, m = int(rng.integers(1, 40)), int(rng.integers(4, 30))
        uses = [rng.choice(m, rng.integers(1, 4), replace=False) for _ in range(n)]
        scores = rng.exponential(5, n)
        tuples = np.full((n, m), -1)
        for i, use in enumerate(uses):
            tuples[i, use] = 0
        best = am.solve.assign_multidimensional(tuples, scores)
        chosen, is_exact, gap = _engine.choose_candidates(
            scores, np.cumsum([0] + [len(u) for u in uses]), np.concatenate(uses), 10**6
        )
        assert is_exact
        assert gap == 0
        taken = np.concatenate([uses[i] for i in chosen])
        assert len(set(taken)) == len(taken)
        assert scores[chosen].sum() == pytest.approx(best.value, abs=1e-6)
        order = np.argsort(-scores)
        greedy, used = 0.0, set()
        for i in order:
            if not used & set(uses[i]):
                greedy += scores[i]
                used |= set(uses[i])
        n_hard += greedy < best.value - 1e-6
    assert n_hard > 20


def test_a_search_that_is_cut_says_by_how_much():
    rng = np.random.default_rng(7)
    n, m = 120, 40
    uses = [np.sort(rng.choice(m, 3, replace=False)) for _ in range(n)]
    scores = rng.uniform(5, 6, n)
    first = np.cumsum([0] + [3] * n)
    chosen, is_exact, gap = _engine.choose_candidates(scores, first, np.concatenate(uses), 1)
    tuples = np.full((n, m), -1)
    for i, use in enumerate(uses):
        tuples[i, use] = 0
    best = am.solve.assign_multidimensional(tuples, scores).value
    assert not is_exact
    assert scores[chosen].sum() <= best + 1e-6 <= scores[chosen].sum() + gap + 2e-6


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10**6))
@example(seed=42451)  # a ghost just within the volume
def test_the_order_of_image_points_and_the_world_do_not_matter(seed):
    rng = np.random.default_rng(seed)
    rig = random_rig(rng, 5)
    shot = filmed(
        rig, rng.uniform(-0.6, 0.6, (2, 12, 3)), noise=0.3, missing=0.1, false=1.0, seed=seed
    )
    o = shot.observations
    made = am.reconstruct(o, rig, MODEL)
    # Within each camera and frame in another order.
    order = np.lexsort((rng.random(o.n_points), o.frame_of * o.n_cameras + o.camera_of))
    mixed = dataclasses.replace(o, pixels=o.pixels[order], markers=o.markers[order])
    again = am.reconstruct(mixed, rig, MODEL)
    np.testing.assert_array_equal(again.detections.offsets, made.detections.offsets)
    np.testing.assert_allclose(again.detections.points, made.detections.points, atol=1e-9)
    # Another world: a turn of 90 degrees about z and a shift.
    T = np.eye(4)
    T[:2, :2] = [[0, -1], [1, 0]]
    T[:3, 3] = (0.1, -0.05, 0.02)
    turned = am.Rig(
        tuple(c.replace(T_camera_world=c.T_camera_world @ np.linalg.inv(T)) for c in rig)
    )
    low, high = np.array(MODEL.volume) + T[:3, 3]  # which a turn of 90 degrees leaves as it is
    moved = dataclasses.replace(MODEL, volume=(tuple(low), tuple(high)))
    there = am.reconstruct(o, turned, moved).detections
    assert there.n_points == made.detections.n_points
    expected = made.detections.points @ T[:3, :3].T + T[:3, 3]
    for t in range(2):
        a, b = there.frame(t), expected[made.detections.frame_of == t]
        nearest = np.linalg.norm(a[:, None] - b, axis=-1).min(axis=1)
        assert nearest.max(initial=0) < 1e-7


def test_threads_change_nothing():
    rng = np.random.default_rng(8)
    rig = random_rig(rng, 5)
    o = filmed(rig, rng.uniform(-0.6, 0.6, (30, 20, 3)), noise=0.3, false=2.0).observations
    one, four = (am.reconstruct(o, rig, MODEL, n_threads=n) for n in (1, 4))
    np.testing.assert_array_equal(one.detections.points, four.detections.points)
    np.testing.assert_array_equal(one.views.blobs, four.views.blobs)


def test_a_miss_counts_only_where_the_camera_could_see():
    rig = am.Rig.ring(3, radius=4, height=2)
    K = am.camera.intrinsics(focal_length=900, principal_point=(640, 512))
    away = am.Camera.look_at((4, 4, 2), (9, 9, 2), K=K, size_px=(1280, 1024), name="away")
    towards = am.Camera.look_at((4, 4, 2), (0, 0, 1), K=K, size_px=(1280, 1024), name="towards")
    near = towards.replace(near=20.0, name="near")
    place = rig.project([[0.1, 0.2, 1.0]]).pixels
    scores = []
    for more in ((), (away,), (near,), (towards,)):
        cameras = am.Rig((*rig.cameras, *more))
        o = observations(cameras, [*place, *([np.empty((0, 2))] * len(more))])
        scores.append(am.reconstruct(o, cameras, MODEL).scores[0])
    assert scores[0] == scores[1] == scores[2]
    assert scores[3] == pytest.approx(scores[0] + np.log(0.1))


def test_one_wrong_view_is_left_out():
    rng = np.random.default_rng(9)
    rig = am.Rig.ring(6, radius=4, height=2)
    X = rng.uniform((-0.5, -0.5, 0.5), (0.5, 0.5, 1.5), (1, 8, 3))
    z = rig.project(X[0]).pixels
    z[2] += rng.choice([-1, 1], (8, 2)) * rng.uniform(5, 20, (8, 2))
    made = am.reconstruct(observations(rig, z), rig, MODEL)
    d = made.detections
    assert d.n_points == 8
    assert np.linalg.norm(d.points[:, None] - X, axis=-1).min(axis=1).max() < 1e-9
    assert (made.views.counts == 5).all()
    assert 2 not in made.views.cameras
    assert set(d.cameras) == {0b111011}


def test_no_image_point_is_used_twice_unless_images_have_merged():
    rng = np.random.default_rng(10)
    rig = random_rig(rng, 4)
    o = filmed(rig, rng.uniform(-0.1, 0.1, (20, 20, 3)), noise=1.0, false=3.0).observations
    model = dataclasses.replace(MODEL, sigma_px=1.0, density=500)
    made = am.reconstruct(o, rig, model, merge_px=0)
    assert len(np.unique(made.views.blobs)) == len(made.views.blobs)
    assert not made.views.is_shared.any()
    assert made.detections.n_points > 300


def test_merged_images_are_shared():
    # The first of two cameras has both markers on one ray but for a pixel, the second does not.
    rig = am.Rig.ring(4, radius=4, height=1)[:2]
    camera = rig[0]
    pair = np.array([[0.3, 0.0, 1.0], [-0.3, 0.0, 1.0]])
    first = camera.project(pair).pixels
    merged = first.mean(axis=0)
    assert np.linalg.norm(first[0] - first[1]) < 2
    z = [[merged], rig[1].project(pair).pixels]
    model = dataclasses.replace(MODEL, clutter=0.05)
    alone = am.reconstruct(observations(rig, z), rig, model, merge_px=0)
    made = am.reconstruct(observations(rig, z), rig, model)
    assert alone.detections.n_points == 1
    assert made.detections.n_points == 2
    assert made.views.is_shared.sum() == 2
    off = np.linalg.norm(made.detections.points[:, None] - pair, axis=-1).min(axis=1)
    assert off.max() < 0.02
    # Both know that they are less sure.
    assert made.detections.stds.min() > alone.detections.stds.max()


def test_min_views_and_volume():
    rng = np.random.default_rng(11)
    rig = am.Rig.ring(4, radius=4, height=2)
    X = rng.uniform((-0.5, -0.5, 0.5), (0.5, 0.5, 1.5), (1, 10, 3))
    z = [list(p) for p in rig.project(X[0]).pixels]
    del z[0][0], z[1][0]
    o = observations(rig, z)
    assert am.reconstruct(o, rig, MODEL).detections.n_points == 10
    assert am.reconstruct(o, rig, MODEL, min_views=3).detections.n_points == 9
    small = dataclasses.replace(MODEL, volume=((-2, -2, -2), (0, 2, 2)))
    assert am.reconstruct(o, rig, small).detections.n_points == (X[0, :, 0] < 0).sum()


def expected_at(times, X, sigma=0.005):
    """Places where points are expected, of all frames alike."""
    d = am.Detections.from_frames(times, list(X))
    noise = np.broadcast_to(sigma**2 * np.eye(3), (d.n_points, 3, 3))
    return dataclasses.replace(d, covariances=noise)


def test_expected_places_help_and_invent_nothing():
    # Four cameras of which two see each marker, and much clutter: ghosts are as likely as markers.
    rng = np.random.default_rng(12)
    rig = am.Rig.ring(4, radius=4, height=2)
    X = rng.uniform((-0.5, -0.5, 0.5), (0.5, 0.5, 1.5), (15, 50, 3))
    shot = filmed(rig, X, noise=0.3)
    pixels, offsets = [], [0]
    for cell in range(len(shot.observations.offsets) - 1):
        a, b = shot.observations.offsets[cell : cell + 2]
        seen = shot.observations.pixels[a:b][rng.random(b - a) < 0.6]
        false = rng.uniform((300, 200), (1600, 900), (6, 2))
        pixels.append(np.concatenate([seen, false]))
        offsets.append(offsets[-1] + len(pixels[-1]))
    o = dataclasses.replace(
        shot.observations, pixels=np.concatenate(pixels), offsets=np.array(offsets), markers=None
    )
    truth = am.Tracks.from_dense(o.times, X)

    def scores(prior=None):
        return am.metrics.point_scores(am.reconstruct(o, rig, MODEL, prior=prior).detections, truth)

    plain = scores()
    helped = scores(expected_at(o.times, X + rng.normal(0, 0.005, X.shape)))
    assert helped.recall > plain.recall + 0.02
    assert helped.ghosts < 0.7 * plain.ghosts
    # Expected where nothing is: next to nothing changes.
    misled = scores(expected_at(o.times, X + 0.4))
    assert misled.recall == pytest.approx(plain.recall, abs=0.01)
    assert misled.ghosts < plain.ghosts + 0.02


def test_the_score_of_a_point_is_that_of_its_density():
    # One point, seen well: what the prior adds is the log of the density there over the usual one.
    rig = am.Rig.ring(4, radius=4, height=2)
    X = np.array([[[0.1, 0.2, 1.0]]])
    o = filmed(rig, X, noise=0.0).observations
    plain = am.reconstruct(o, rig, MODEL)
    off, sigma = np.array([0.004, -0.003, 0.002]), 0.005
    helped = am.reconstruct(o, rig, MODEL, prior=expected_at(o.times, X + off, sigma))
    S = sigma**2 * np.eye(3) + plain.detections.covariances[0]
    density = np.exp(-0.5 * off @ np.linalg.solve(S, off)) / np.sqrt(np.linalg.det(2 * np.pi * S))
    gained = np.log1p(0.9 * density / MODEL.density)
    assert helped.scores[0] - plain.scores[0] == pytest.approx(gained, rel=0.02)
    assert gained > 5


def test_what_is_expected_must_be_of_these_frames():
    rng = np.random.default_rng(12)
    rig = am.Rig.ring(4, radius=4, height=2)
    X = rng.uniform((-0.5, -0.5, 0.5), (0.5, 0.5, 1.5), (5, 10, 3))
    o = filmed(rig, X, noise=0.3).observations
    with pytest.raises(am.ParameterError, match="covariances"):
        am.reconstruct(o, rig, prior=am.Detections.from_frames(o.times, list(X)))
    with pytest.raises(am.ParameterError, match="prior: expected the times"):
        am.reconstruct(o, rig, prior=am.Detections.from_frames([0.0], [X[0]]))
    with pytest.raises(am.ParameterError, match="prior: expected places in 3-D"):
        am.reconstruct(o, rig, prior=am.Detections.from_frames(o.times, list(X[..., :2])))


def test_cameras_go_by_name():
    rng = np.random.default_rng(13)
    rig = am.Rig.ring(5, radius=4, height=2)
    X = rng.uniform((-0.5, -0.5, 0.5), (0.5, 0.5, 1.5), (3, 10, 3))
    o = filmed(am.Rig((rig[3], rig[0], rig[4])), X).observations
    made = am.reconstruct(o, rig, MODEL)
    assert made.detections.n_points == 30
    assert set(made.detections.cameras) == {0b11001}
    assert [camera for camera, _ in made.views.of(0)] == [0, 1, 2]


def test_frames_without_anything():
    rig = am.Rig.ring(3, radius=4, height=2)
    nothing = np.empty((0, 2))
    o = observations(rig, [[nothing] * 3, [nothing] * 3], times=(0.0, 1.0))
    made = am.reconstruct(o, rig)
    assert made.detections.n_frames == 2
    assert made.detections.n_points == 0
    assert made.markers(dataclasses.replace(o, markers=np.empty(0, int))).shape == (0,)
    none = am.Observations(times=[], cameras=rig.names, offsets=[0], pixels=nothing)
    assert am.reconstruct(none, rig).detections.n_frames == 0
    one = observations(rig, [[[640.0, 500.0]], nothing, nothing])
    assert am.reconstruct(one, rig).detections.n_points == 0


def test_bad_input():
    rig = am.Rig.ring(3, radius=4, height=2)
    o = observations(rig, rig.project([[0.0, 0.0, 1.0]]).pixels)
    with pytest.raises(am.ParameterError, match=r"rig: expected the cameras .*: no cam3"):
        am.reconstruct(o, rig[:2])
    with pytest.raises(am.ParameterError, match="two cameras or more"):
        am.reconstruct(observations(rig[:1], [[[1.0, 2.0]]]), rig)
    with pytest.raises(am.ParameterError, match="pixels: expected finite numbers"):
        observations(rig, [[[np.nan, 1.0]], [], []])
    for wrong in (
        {"min_views": 1}, {"min_views": 4}, {"gate": 0}, {"max_nodes": 0}, {"n_threads": 0},
        {"merge_px": -1},
    ):  # fmt: skip
        with pytest.raises(am.ParameterError, match=next(iter(wrong))):
            am.reconstruct(o, rig, **wrong)
    for wrong in (
        {"sigma_px": 0}, {"p_detection": 1}, {"clutter": -1}, {"density": 0},
        {"volume": ((0, 0, 0), (0, 1, 1))}, {"volume": 3}, {"p_detection": (0.5, 1.5)},
    ):  # fmt: skip
        with pytest.raises(am.ParameterError, match=next(iter(wrong))):
            am.multiview.ImageModel(**wrong)
    with pytest.raises(am.ParameterError, match="sigma_px"):
        am.reconstruct(o, rig, am.multiview.ImageModel(sigma_px=(0.1, 0.2)))
    with pytest.raises(am.ParameterError, match="observations"):
        am.reconstruct(3, rig)
    with pytest.raises(am.ParameterError, match="rig"):
        am.reconstruct(o, [1])
    with pytest.raises(am.ParameterError, match="the truth"):
        am.reconstruct(o, rig).markers(o)


def test_covariances_are_checked():
    d = am.Detections.from_frames([0.0], [[[0, 0, 0], [1, 0, 0]]])
    good = np.broadcast_to(np.eye(3), (2, 3, 3))
    assert dataclasses.replace(d, covariances=good).covariances.shape == (2, 3, 3)
    skew = good + np.array([[0, 1, 0], [0, 0, 0], [0, 0, 0]])
    for wrong in (good[:1], -good, skew, np.full((2, 3, 3), np.nan)):
        with pytest.raises(am.ParameterError, match="covariances"):
            dataclasses.replace(d, covariances=wrong)


def test_a_person_before_eight_cameras():
    truth = am.simulate.SCENES["person"].make(frames=60, seed=4, activity="walk")
    from asterism.simulate.rig_presets import place_preset

    points = truth.detections.points
    rig, _ = place_preset("ring8", points.min(axis=0), points.max(axis=0))
    seeing = am.simulate.Seeing(noise_px=0.3, false=0.5, missing=0.01)
    shot = am.simulate.film(truth, rig, seeing=seeing, seed=4)
    made = am.reconstruct(shot.observations, rig)
    X = truth.positions()
    who = made.markers(shot.observations)
    d = made.detections
    is_right = (who >= 0) & (np.linalg.norm(d.points - X[d.frame_of, who], axis=1) < 0.02)
    is_hit = np.zeros(X.shape[:2], dtype=bool)
    is_hit[d.frame_of[is_right], who[is_right]] = True
    seen = (shot.blob_of >= 0).sum(axis=0) >= 2
    assert is_hit[seen].mean() >= 0.99
    assert (~is_right).mean() <= 0.005
