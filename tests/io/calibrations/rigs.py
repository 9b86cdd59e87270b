"""Rigs with all that a calibration can be asked to hold, one a format."""

from __future__ import annotations

import numpy as np

from asterism.camera import (
    BrownConrady,
    Camera,
    QuadraticCorrection,
    ReportRadial,
    Rig,
    ViconRadial,
)

LENSES = {
    "BrownConrady": BrownConrady(-0.12, 0.05, 0.001, -0.002, -0.01),
    "ReportRadial": ReportRadial(0.1, -0.03),
    "ViconRadial": ViconRadial(4e-8, -3e-14, 1e-21),
    "QuadraticCorrection": QuadraticCorrection(
        ex=(0.003, -0.002, -4e-6, -8e-7, 2.4e-6), ey=(2.6e-4, -3e-6, -4e-8, 2.4e-6, -2.4e-6)
    ),
}


NAMES = {"rig": "a.toml", "caliscope": "a.toml", "anipose": "a.toml", "opencv": "a.yml",
         "qca": "a.qca.txt", "xcp": "a.xcp", "flydra": "fly", "myptv": "ptv"}  # fmt: skip


def target_points(n: int = 200) -> np.ndarray:
    """Places that the cameras of `rig_for` see, metres."""
    return np.random.default_rng(5).uniform([-0.7, -0.7, 0.4], [0.7, 0.7, 1.8], (n, 3))


def rig_for(format: str, *, bent: bool = True) -> Rig:
    """Give three different cameras that look at one place and that a format can hold."""
    cameras: list[Camera] = []
    places = [(3.3, 0.4, 2.2), (-1.5, 2.9, 1.4), (-1.1, -3.0, 3.1)]
    for i, place in enumerate(places):
        f, size = 905.3 + 31.7 * i, (1280, 1000 + 24 * i)
        skew = 1.7 if format in ("rig", "flydra") and not bent else 0.0
        fv = f * (1.0 if format == "myptv" else 1.0213)
        K = np.array([[f, skew, 641.7 - i], [0, fv, 511.3 + i], [0, 0, 1]])
        lens = K_lens = None
        if bent and format == "rig":
            lens = list(LENSES.values())[i]
        elif bent and format == "xcp":
            lens = ViconRadial(4e-8, -3e-14, 0.0 if i else 1e-21)
            if i == 2:
                K_lens = np.array([[1, 0, 630.5], [0, 1, 530.25], [0, 0, 1.0]])
        elif bent and format == "myptv":
            lens, K_lens = LENSES["QuadraticCorrection"], np.eye(3)
        elif bent and format == "flydra":
            lens = BrownConrady(-0.12 + 0.05 * i, 0.05, 0.001, -0.002)
            width, height = size
            K_lens = np.array(
                [[f - 20, 0, (width - 1) / 2], [0, f + 20, (height - 1) / 2], [0, 0, 1]]
            )
        elif bent:
            lens = LENSES["BrownConrady"]
        cameras.append(
            Camera.look_at(
                place, (0.1, 0.0, 1.1), up=(0.1 * i, 0.05, 1), K=K, size_px=size,
                lens=lens, K_lens=K_lens, name=f"cam{i + 1}",
            )
        )  # fmt: skip
    return Rig(tuple(cameras))


def same_pixels(a: Rig, b: Rig, tolerance: float = 1e-9) -> None:
    """Assert that two rigs see the same points at the same pixels."""
    points = target_points()
    ours, theirs = a.project(points), b.project(points)
    assert np.isfinite(ours.pixels).all()
    assert ours.visible.mean() > 0.5
    np.testing.assert_allclose(theirs.pixels, ours.pixels, rtol=0, atol=tolerance)
    assert (ours.reason == theirs.reason).mean() > 0.999
