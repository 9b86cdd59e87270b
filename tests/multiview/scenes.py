"""Rigs and points whose images are known: what tests of reconstruction look at."""

from __future__ import annotations

import numpy as np

import asterism as am

LENSES = {
    "none": None,
    "brown": am.camera.BrownConrady(k1=-0.2, k2=0.05, p1=1e-3, p2=-5e-4),
    "report": am.camera.ReportRadial(a1=0.15, a2=0.02),
    "vicon": am.camera.ViconRadial(k1=4e-8, k2=1e-14),
}
MODEL = am.multiview.ImageModel(
    sigma_px=0.3, p_detection=0.9, clutter=0.5, density=5.0, volume=((-2, -2, -2), (2, 2, 2))
)


def random_rig(rng, n: int, lens=None, *, size_px=(1280, 1024)) -> am.Rig:
    """Cameras anywhere around the origin, 3 to 6 m from it, that look nearly there."""
    cameras = []
    for i in range(n):
        way = rng.normal(size=3)
        place = way / np.linalg.norm(way) * rng.uniform(3, 6)
        f = rng.uniform(700, 1500)
        K = am.camera.intrinsics(focal_length=f, principal_point=tuple(rng.normal((640, 512), 20)))
        target = rng.normal(scale=0.2, size=3)
        up = rng.normal(size=3)
        cameras.append(
            am.Camera.look_at(
                place, target, K=K, size_px=size_px, up=up, lens=lens, name=f"c{i + 1}"
            )
        )
    return am.Rig(tuple(cameras))


def filmed(rig, points, *, noise=0.0, seed=0, missing=0.0, false=0.0):
    """Film points (T, K, 3), NaN where there is none; blobs never merge."""
    points = np.asarray(points, dtype=float)
    truth = am.Tracks.from_dense(np.arange(len(points)) / 100, points)
    seeing = am.simulate.Seeing(
        noise_px=noise, missing=missing, false=false, merge=False, marker_radius=0
    )
    return am.simulate.film(truth, rig, seeing=seeing, seed=seed)


def observations(rig, per_camera, times=(0.0,)):
    """Observations of frames of lists of pixels, frames x cameras."""
    frames = [per_camera] if len(times) == 1 else per_camera
    arrays = [np.asarray(p, dtype=float).reshape(-1, 2) for frame in frames for p in frame]
    return am.Observations(
        times=times,
        cameras=rig.names,
        offsets=np.cumsum([0] + [len(a) for a in arrays]),
        pixels=np.concatenate(arrays),
    )
