"""§3.1: the pin-hole camera, from the world to pixels."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

import asterism as am
from asterism.plot import plot_image
from asterism.plot.style import CLUTTER, CYCLE, INK
from asterism.reproduction.drawing import titled
from asterism.reproduction.part import Outcome, Part
from asterism.reproduction.rules import exact

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

N_POINTS = 1000
TOLERANCE_PX, TOLERANCE_M = 1e-6, 1e-12
SIZE = (1280, 1024)
# A lens of 8 mm before pixels of 5 µm.
FOCAL_M, PIXEL_M = 0.008, 5e-6


def run(seeds: int) -> Outcome:
    """Project by the report's matrices and by the camera, and compare."""
    worst = similar = turned = 0.0
    for seed in range(seeds):
        camera, points = _draw_case(np.random.default_rng(seed))
        difference = by_matrices(camera, points) - camera.project(points).pixels
        worst = max(worst, float(np.abs(difference).max()))
        seen = points @ camera.T_camera_world[:3, :3].T + camera.T_camera_world[:3, 3]
        plane = FOCAL_M * seen[:, :2] / seen[:, 2:]
        # The line through a point and the centre meets the planes before and behind the centre.
        front, back = (((z / seen[:, 2:]) * seen)[:, :2] for z in (FOCAL_M, -FOCAL_M))
        similar = max(similar, float(np.abs(plane - front).max()))
        turned = max(turned, float(np.abs(plane + back).max()))
    cases = seeds * N_POINTS
    metres = "greatest difference in metres"
    claims = [
        exact("the camera projects P to K F [R T] P", "an identity", worst,
              "greatest difference in pixels", cases, TOLERANCE_PX),
        exact("similar triangles: x = f X / Z (figure 3.1)", "an identity", similar, metres, cases,
              TOLERANCE_M),
        exact("the image behind the centre is upside-down (figure 3.2)", "an identity", turned,
              metres, cases, TOLERANCE_M),
    ]  # fmt: skip
    return Outcome(claims=claims, figure=_draw())


def by_matrices(camera: am.Camera, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Project as the report writes it, in homogeneous coordinates.

    Parameters
    ----------
    camera : Camera
        Camera without a lens.
    points : ndarray of shape (K, 3)
        World coordinates, metres.

    Returns
    -------
    ndarray of shape (K, 2)
        Pixels (u, v).
    """
    f = FOCAL_M
    K = camera.K @ np.diag([1 / f, 1 / f, 1.0])
    F = np.array([[f, 0, 0, 0], [0, f, 0, 0], [0, 0, 1, 0]])
    homogeneous = np.vstack([points.T, np.ones(len(points))])
    su, sv, s = K @ F @ camera.T_camera_world @ homogeneous
    return np.stack([su / s, sv / s], axis=1)


def _draw_case(rng: np.random.Generator) -> tuple[am.Camera, NDArray[np.float64]]:
    """Draw a camera and points before it."""
    f_px = FOCAL_M / PIXEL_M * rng.uniform(0.5, 2)
    K = am.camera.intrinsics(focal_length=f_px, principal_point=tuple(rng.uniform(400, 600, 2)))
    K[0, 1] = rng.normal(0, 5)
    target = rng.normal(0, 1, 3)
    place = target + rng.normal(0, 1, 3) * [3, 3, 1] + [0, 4, 0]
    camera = am.Camera.look_at(place, target, K=K, size_px=SIZE)
    points = rng.normal(0, 1.5, (4 * N_POINTS, 3))
    depth = points @ camera.axis - camera.center @ camera.axis
    return camera, points[depth > 0.2][:N_POINTS]


def _draw() -> Figure:
    from matplotlib.figure import Figure

    scene = am.simulate.cube(frames=1, seed=3, side=0.8)
    points = scene.positions()[0] - scene.positions()[0].mean(axis=0)
    K = am.camera.intrinsics(focal_length=FOCAL_M / PIXEL_M, principal_point=(639.5, 511.5))
    camera = am.Camera.look_at((2.2, -2.6, 1.2), (0, 0, 0), K=K, size_px=SIZE)
    w, h = SIZE
    corners = np.array([[0, 0], [w, 0], [w, h], [0, h], [0, 0]]) - 0.5
    # The image plane is drawn a metre before the centre: at its true place it would be invisible.
    on_plane, frame = (
        camera.center + rays / (rays @ camera.axis)[:, None]
        for rays in (camera.rays(camera.project(points).pixels), camera.rays(corners))
    )
    figure = Figure(figsize=(11, 4.4), dpi=110)
    axes: Any = figure.add_axes((0.0, -0.1, 0.56, 1.2), projection="3d")
    for cloud, colour in ((points, CYCLE[0]), (on_plane, CYCLE[5])):
        for pair in np.argwhere(np.triu(scene.connections)):
            axes.plot(*cloud[pair].T, color=colour, linewidth=1.0)
        axes.scatter(*cloud.T, color=colour, s=10, depthshade=False)
    for p in points:
        axes.plot(*np.array([camera.center, p]).T, color=CLUTTER, linewidth=0.5)
    axes.plot(*frame.T, color=INK, linewidth=1.0)
    axes.scatter(*camera.center, color=INK, s=18)
    axes.text(*(camera.center + np.array([0, 0, 0.16])), "optical centre", color=INK, fontsize=9)
    everything = np.vstack([points, frame, camera.center])
    low, high = everything.min(axis=0), everything.max(axis=0)
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
    axes.set_box_aspect(high - low, zoom=0.95)
    axes.view_init(elev=18, azim=-95)
    axes.set_axis_off()
    flat = titled(figure.add_axes((0.6, 0.13, 0.38, 0.76)), "the image: origin top left")
    plot_image(camera, camera.project(points), connections=scene.connections,
               colours=CYCLE[0], ax=flat)  # fmt: skip
    return figure


PART = Part(
    name="projection",
    title="The camera: the pin-hole",
    section="§3.1",
    covers="figures 3.1, 3.2, 3.3 and 3.4, and the projection equations",
    summary="Derives the projection from similar triangles and writes it as the product of "
    "intrinsic matrix, focal matrix, rototranslation and homogeneous points.",
    run=run,
    caption="The report's figures 3.1, 3.3 and 3.4: points, their rays through the image plane "
    "into the optical centre, and the image in pixels.",
    mistakes=(
        "K_u and K_v are called “the pixel width and height”; the equations need the reciprocal, "
        "pixels a metre. A point 1 m beside the axis and 4 m away, with f = 8 mm and pixels of "
        "5 µm, lies 400 px beside the principal point; the report's words put it 1e-8 px beside.",
    ),
)
