"""Where a rig is sure and where one more camera helps."""

from __future__ import annotations

import numpy as np
import pytest

import asterism as am


def test_the_error_is_what_triangulation_has():
    rig = am.Rig.ring(4, radius=4, height=2.5)
    found = am.multiview.triangulation_map(
        rig, (-0.2, -0.2, 0.8), (0.2, 0.2, 1.2), spacing=0.2, sigma_px=0.5
    )
    X = found.coverage.points.reshape(-1, 3)
    rng = np.random.default_rng(1)
    z = np.repeat(rig.project(X).pixels, 200, axis=1)
    made = am.multiview.triangulate(z + 0.5 * rng.standard_normal(z.shape), rig, sigma_px=0.5)
    off = np.linalg.norm(made.points - np.repeat(X, 200, axis=0), axis=1)
    assert found.error == pytest.approx(np.sqrt((off**2).mean()), rel=0.03)
    assert found.share == 1


def test_the_suggestion_is_the_best_of_those_tried():
    # Two cameras side by side: depth is what they lack, and who stands aside has it.
    rig = am.Rig.wall(2, width=0.5, height=1, distance=4)
    found = am.multiview.triangulation_map(
        rig, (-0.5, -0.5, 0.5), (0.5, 0.5, 1.5), n_suggestions=100
    )
    errors = [s.error for s in found.suggestions]
    assert errors == sorted(errors)
    best = found.suggestions[0].camera.center - (0, 0, 1)
    away = abs(best[0]) / np.linalg.norm(best)
    assert away > 0.7
    assert errors[0] < 0.5 * found.error
    grid = found.coverage.points
    both = am.Rig((*rig.cameras, found.suggestions[0].camera))
    again = am.multiview.triangulation_map(
        both, (-0.5, -0.5, 0.5), (0.5, 0.5, 1.5), n_suggestions=0
    )
    assert again.error == pytest.approx(errors[0])
    assert again.suggestions == ()
    assert am.multiview.suggest_cameras(rig, grid, [])[:1] == []


def test_what_no_camera_sees_counts():
    K = am.camera.intrinsics(focal_length=900, principal_point=(640, 512))
    away = am.Camera.look_at((4, 4, 2), (9, 9, 2), K=K, size_px=(1280, 1024), name="away")
    rig = am.Rig((away, away.replace(name="too")))
    found = am.multiview.triangulation_map(rig, (-1, -1, 0), (1, 1, 2), spacing=1)
    assert found.share == 0
    assert found.error == pytest.approx(np.sqrt(3) * np.sqrt(12))
    assert np.isnan(found.coverage.error).all()


def test_bad_input():
    rig = am.Rig.ring(3, radius=4, height=2)
    for wrong in (
        {"high": (-1, -1, -1)}, {"spacing": 0}, {"sigma_px": 0}, {"n_suggestions": -1},
    ):  # fmt: skip
        with pytest.raises(am.ParameterError, match=next(iter(wrong))):
            am.multiview.triangulation_map(rig, (0, 0, 0), **({"high": (1, 1, 1)} | wrong))
