"""What the engine's face refuses, and what it keeps alive."""

from __future__ import annotations

import gc

import numpy as np
import pytest

import asterism as am
from asterism import _engine
from asterism.camera.surfaces import compile_surfaces
from asterism.model.compiled import motion_model
from tests.scenes import small_model


def rig():
    return am.Rig.ring(3, radius=3.0, height=2.0, target=(0.0, 0.0, 1.0))


def test_a_moment_that_moving_surfaces_do_not_have_is_refused():
    corners = np.array([[-1.0, -1, 1], [1, -1, 1], [1, 1, 1]])
    moving = am.camera.Polygon(corners=np.stack([corners, corners + 0.1]))
    surfaces = compile_surfaces([moving], 2)
    camera = rig().cameras[0].engine
    grid = _engine.RayGrid(camera)
    grid.depth_image(camera, surfaces, 1)
    with pytest.raises(ValueError, match="moment"):
        grid.depth_image(camera, surfaces, 2)


def test_a_kind_of_step_that_is_not_there_is_refused():
    model = motion_model(small_model(), 3)
    F = np.eye(2)[None, None]
    points = np.zeros((2, 3))
    frames = np.array([0, 1])
    for kind in ([1, 0], [0, 1], [-2, 0], [0, -1]):
        with pytest.raises(ValueError, match="kind"):
            _engine.filter_tracks(
                model, points, frames, np.array([0, 2]), np.array([0.0, 0.1]),
                np.array(kind, dtype=np.int32), F, 0 * F, False,
            )  # fmt: skip


def test_a_solver_of_views_keeps_its_cameras():
    cameras = [camera.engine for camera in rig().cameras]
    solver = _engine.ViewSolver(
        cameras=cameras, sigma=np.full(3, 0.5), p_detection=np.full(3, 0.95),
        clutter=np.full(3, 1e-6), log_density=0.0, gate=20.0, min_views=2,
        low=(-5.0, -5.0, -5.0), high=(5.0, 5.0, 5.0),
    )  # fmt: skip
    del cameras
    gc.collect()
    ballast = [np.ones(2000) for _ in range(200)]  # what was freed would be overwritten
    points, *_ = solver.reconstruct(
        np.empty((0, 2)), np.zeros(4, dtype=np.int64), np.empty((0, 4)),
        np.zeros(2, dtype=np.int64), 0.0, 1000, 1,
    )  # fmt: skip
    assert len(points) == 0
    assert len(ballast) == 200
