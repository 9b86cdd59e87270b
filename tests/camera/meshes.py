"""A camera and clouds of triangles before it."""

from __future__ import annotations

import numpy as np

import asterism as am

K = am.camera.intrinsics(focal_length=300.0, principal_point=(159.5, 119.5))
SIZE = (320, 240)


def camera(lens=None, position=(0.0, -4.0, 1.0)):
    return am.Camera.look_at(position, (0.0, 0.0, 1.0), K=K, size_px=SIZE, lens=lens)


def cloud(rng, n):
    return rng.uniform([-1.5, -1.5, -0.5], [1.5, 1.5, 2.5], (n, 3))


def triangles_of(rng, n, size=0.6):
    return cloud(rng, n)[:, None] + rng.normal(0, size, (n, 3, 3))


SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 0, 1], [0, 0, 1.0]])
