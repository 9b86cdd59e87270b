"""Speed of the camera simulator beside OpenCV, in one process, on one core; best of several runs.

python benchmarks/cameras.py [--markdown FILE]
"""

from __future__ import annotations

import argparse
from functools import partial
from pathlib import Path
from typing import Any

import cv2  # pyright: ignore[reportMissingImports]  # an extra of the benchmarks
import numpy as np

import asterism as am
from report import best_of, conditions, publish

BROWN = am.camera.BrownConrady(k1=-0.3, k2=0.1, p1=0.001, p2=-0.002, k3=0.02)
LENSES: tuple[tuple[str, am.camera.Lens | None], ...] = (
    ("none", None),
    ("Brown–Conrady", BROWN),
    ("report's radial, barrel", am.camera.ReportRadial(a1=0.3, a2=0.1)),
    ("report's radial, pincushion", am.camera.ReportRadial(a1=-0.05, a2=-0.01)),
    ("Vicon's radial", am.camera.ViconRadial(k1=3.5e-8, k2=-2e-14)),
)


def points_a_second() -> list[str]:
    """Project the same points by OpenCV and by every lens of ours."""
    points = np.random.default_rng(1).uniform(-1, 1, (200_000, 3))
    rig = am.Rig.ring(1, radius=4, height=2, target=(0, 0, 0), lens=BROWN)
    camera = rig[0]
    T = camera.T_camera_world
    rotation = cv2.Rodrigues(np.ascontiguousarray(T[:3, :3]))[0]
    k = np.array([BROWN.k1, BROWN.k2, BROWN.p1, BROWN.p2, BROWN.k3])

    def theirs() -> Any:
        return cv2.projectPoints(points, rotation, np.ascontiguousarray(T[:3, 3]), camera.K, k)[0]

    apart = float(np.abs(theirs()[:, 0] - camera.project(points).pixels).max())
    pace = len(points) / best_of(7, theirs)
    lines = ["| lens | million points/s | against OpenCV |", "|---|---:|---:|"]
    lines.append(
        f"| OpenCV {cv2.__version__} `projectPoints`, Brown–Conrady | {pace / 1e6:.1f} | 1 |"
    )
    for name, lens in LENSES:
        c = camera.replace(lens=lens)
        ours = len(points) / best_of(9, lambda c=c: c.project(points))
        lines.append(f"| {name} | {ours / 1e6:.0f} | {ours / pace:.0f} × |")
    return [*lines, "", f"Greatest difference to OpenCV over these points: {apart:.1g} px."]


def ball(n: int = 71) -> am.camera.Mesh:
    """Make a sphere of about 2 n² triangles in the middle of the volume."""
    u, v = np.meshgrid(np.linspace(0, 2 * np.pi, n), np.linspace(0.03, np.pi - 0.03, n))
    ball = np.stack([np.cos(u) * np.sin(v), np.sin(u) * np.sin(v), np.cos(v)], axis=-1)
    i = np.arange(n * n).reshape(n, n)
    quads = np.stack([i[:-1, :-1], i[1:, :-1], i[1:, 1:], i[:-1, 1:]], axis=-1).reshape(-1, 4)
    faces = np.concatenate([quads[:, :3], quads[:, [0, 2, 3]]])
    return am.camera.Mesh(
        vertices=0.6 * ball.reshape(-1, 3) + [0, 0, 1], faces=faces.astype(np.int32)
    )


def occlusion() -> list[str]:
    """Time what hides: curtains, a mesh, depth images."""
    rng = np.random.default_rng(2)
    rig = am.Rig.ring(8, radius=4, height=2.5)
    T = 10_000
    points = rng.uniform([-1, -1, 0], [1, 1, 2], (T, 60, 3))
    corners = rng.uniform([-1, -1, 0], [1, 1, 2], (200, 1, 3)) + rng.normal(0, 0.15, (200, 3, 3))
    drift = rng.normal(0, 0.01, (T, 1, 3)).cumsum(axis=0)
    standing = [am.camera.Polygon(corners=c) for c in corners]
    moving = [am.camera.Polygon(corners=c + drift) for c in corners]
    lines = ["| what | time | share occluded |", "|---|---:|---:|"]
    cases: dict[str, list[am.camera.Polygon]] = {"none": [], "standing": standing, "moving": moving}
    for name, surfaces in cases.items():
        seconds = best_of(3, partial(rig.project, points, surfaces))
        occluded = float((rig.project(points, surfaces).reason == am.camera.Reason.OCCLUDED).mean())
        what = f"8 cameras × 60 markers × {T} frames, 200 triangles {name}"
        if name == "none":
            what = f"8 cameras × 60 markers × {T} frames, no surface"
        lines.append(f"| {what} | {seconds:.2f} s | {100 * occluded:.0f} % |")
    mesh = ball()
    one = points[0]
    seconds = best_of(20, lambda: rig.project(one, [mesh]))
    occluded = float((rig.project(one, [mesh]).reason == am.camera.Reason.OCCLUDED).mean())
    what = (
        f"8 cameras × 60 markers, one frame, mesh of {len(mesh.faces)} triangles, tree built anew"
    )
    lines.append(f"| {what} | {1e3 * seconds:.1f} ms | {100 * occluded:.0f} % |")
    for name, where in (("from 4 m", rig[0].center), ("from 0.8 m", np.array([0.8, 0, 1.0]))):
        camera = am.Camera.look_at(where, (0, 0, 1), K=rig[0].K, size_px=(1280, 1024))
        first = best_of(1, lambda c=camera: c.depth_image([mesh]))
        seconds = best_of(20, lambda c=camera: c.depth_image([mesh]))
        covered = float((camera.depth_image([mesh]).surface >= 0).mean())
        what = f"depth image of that mesh, 1280 × 1024, {name} (the first: {1e3 * first:.0f} ms)"
        lines.append(f"| {what} | {1e3 * seconds:.1f} ms | {100 * covered:.0f} % of the pixels |")
    return lines


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--markdown", type=Path)
    options = parser.parse_args()
    cv2.setNumThreads(1)
    lines = [*points_a_second(), "", *occlusion(), ""]
    lines.append(f"{conditions()}; one core.")
    publish(lines, options.markdown)


if __name__ == "__main__":
    main()
