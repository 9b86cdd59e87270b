"""Slow, obvious answers about cameras and surfaces, written from the definitions."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.optimize import brentq

if TYPE_CHECKING:
    import asterism as am


def matrix_product(K: Any, T: Any, points: Any) -> tuple[Any, Any]:
    """The 2010 report's product K F [R T; 0 1] P, column by column: pixels and scale."""
    F = np.hstack([np.eye(3), np.zeros((3, 1))])
    product = K @ F @ T @ np.vstack([np.asarray(points).T, np.ones(len(points))])
    return (product[:2] / product[2]).T, product[2]


def report_radial(lens: am.camera.ReportRadial, x: float, y: float) -> tuple[float, float]:
    """Solve r_d (1 + a1 r_d² + a2 r_d⁴) = r by bisection on the rising branch."""
    r = float(np.hypot(x, y))
    if r == 0:
        return x, y
    end = min(lens.radius, 1e6)

    def excess(rd: float) -> float:
        return rd * (1 + lens.a1 * rd**2 + lens.a2 * rd**4) - r

    if excess(end) < 0:
        return np.nan, np.nan
    rd = brentq(excess, 0.0, end, xtol=1e-15, rtol=1e-15)
    return x * rd / r, y * rd / r


def first_triangle(center: Any, point: Any, triangles: Any, clearance: float = 1e-6) -> int:
    """The nearest triangle between a camera and a point (Möller and Trumbore), or -1."""
    d = point - center
    a, b, c = np.moveaxis(np.asarray(triangles), 1, 0)
    p, q = np.cross(d, c - a), np.cross(center - a, b - a)
    det = ((b - a) * p).sum(axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):  # a ray along a triangle does not meet it
        u = ((center - a) * p).sum(axis=1) / det
        v, s = q @ d / det, ((c - a) * q).sum(axis=1) / det
    before = 1 - clearance / np.linalg.norm(d)
    is_within = (np.abs(det) >= 1e-300) & (u >= 0) & (v >= 0) & (u + v <= 1)
    is_hit = is_within & (s > 0) & (s < before)
    return int(np.argmin(np.where(is_hit, s, np.inf))) if is_hit.any() else -1


def capsule_entry(center: Any, direction: Any, ends: Any, radius: float, until: float) -> float:
    """Where a ray first comes within the radius of a segment: small safe steps from outside."""
    axis = ends[1] - ends[0]
    s = 0.0
    for _ in range(100_000):
        p = center + s * direction
        along = np.clip((p - ends[0]) @ axis / max(axis @ axis, 1e-300), 0, 1)
        gap = np.linalg.norm(p - ends[0] - along * axis) - radius
        if gap < 1e-9:
            return s
        s += gap / np.linalg.norm(direction)
        if s > until:
            break
    return np.inf


def random_pose(rng: np.random.Generator) -> Any:
    """A random rotation and shift, 4 × 4."""
    Q, R = np.linalg.qr(rng.normal(size=(3, 3)))
    Q *= np.sign(np.diag(R))
    Q[:, 0] *= np.linalg.det(Q)
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = Q, rng.normal(size=3)
    return T
