"""From many views to points: against all sets of image points, exact without noise, hard cases."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.stats import chi2

import asterism as am
from tests.multiview.scenes import LENSES, MODEL, filmed, observations, random_rig
from tests.references.reconstruction import every_set, score


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
