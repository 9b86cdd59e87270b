"""Options and bad input of the reconstruction of points."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import asterism as am
from tests.multiview.scenes import MODEL, filmed, observations, random_rig


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
    with pytest.raises(am.ParameterError, match="prior: expected 3-D positions"):
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
    with pytest.raises(am.ParameterError, match="the true markers"):
        am.reconstruct(o, rig).markers(o)


def test_covariances_are_checked():
    d = am.Detections.from_frames([0.0], [[[0, 0, 0], [1, 0, 0]]])
    good = np.broadcast_to(np.eye(3), (2, 3, 3))
    assert dataclasses.replace(d, covariances=good).covariances.shape == (2, 3, 3)
    skew = good + np.array([[0, 1, 0], [0, 0, 0], [0, 0, 0]])
    for wrong in (good[:1], -good, skew, np.full((2, 3, 3), np.nan)):
        with pytest.raises(am.ParameterError, match="covariances"):
            dataclasses.replace(d, covariances=wrong)
