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


def report_radial(lens: am.ReportRadial, x: float, y: float) -> tuple[float, float]:
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
    best, nearest = -1, 1 - clearance / np.linalg.norm(d)
    for i, (a, b, c) in enumerate(triangles):
        p = np.cross(d, c - a)
        det = (b - a) @ p
        if abs(det) < 1e-300:
            continue
        u = (center - a) @ p / det
        q = np.cross(center - a, b - a)
        v, s = d @ q / det, (c - a) @ q / det
        if u >= 0 and v >= 0 and u + v <= 1 and 0 < s < nearest:
            best, nearest = i, s
    return best


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
