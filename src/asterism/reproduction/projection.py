"""§3.1: the pin-hole, from the world to pixels."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

import asterism as am
from asterism.plot import plot_image
from asterism.plot.style import CLUTTER, CYCLE, INK
from asterism.reproduction.part import Claim, Outcome, Part, Picture, Table
from asterism.reproduction.rules import exact

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from asterism.reproduction.part import Effort, Tell

N_POINTS = 1000
TOLERANCE_PX = 1e-6
SIZE = (1280, 1024)
# A lens of 8 mm before pixels of 5 µm.
FOCAL_M, PIXEL_M = 0.008, 5e-6


def run(effort: Effort, tell: Tell) -> Outcome:
    """Project by the report's matrices and by the camera, and compare."""
    worst = similar = turned = 0.0
    for seed in range(effort.seeds):
        rng = np.random.default_rng(seed)
        camera, points = _drawn(rng)
        theirs = by_matrices(camera, points)
        ours = camera.project(points).pixels
        worst = max(worst, float(np.abs(theirs - ours).max()))
        seen = points @ camera.T_camera_world[:3, :3].T + camera.T_camera_world[:3, 3]
        plane = FOCAL_M * seen[:, :2] / seen[:, 2:]
        rays = _on_plane(seen, FOCAL_M)
        similar = max(similar, float(np.abs(plane - rays).max()))
        turned = max(turned, float(np.abs(plane + _on_plane(seen, -FOCAL_M)).max()))
        tell((seed + 1) / effort.seeds)
    cases = effort.seeds * N_POINTS
    right, wrong = (k * FOCAL_M * 1.0 / 4.0 for k in (1 / PIXEL_M, PIXEL_M))
    claims = [
        Claim("K F [R T] P is what the camera gives", "an identity", f"differ by {worst:.1e} px",
              exact(worst, TOLERANCE_PX, "greatest difference in pixels", cases)),
        Claim("similar triangles: x = f X / Z (figure 3.1)", "an identity",
              f"differ by {similar:.1e} m",
              exact(similar, 1e-12, "greatest difference in metres", cases)),
        Claim("the image behind the centre is upside-down (figure 3.2)", "an identity",
              f"differ by {turned:.1e} m",
              exact(turned, 1e-12, "greatest difference in metres", cases)),
    ]  # fmt: skip
    rows = [["K_u = 1 / pixel width (pixels a metre)", f"{1 / PIXEL_M:g}", f"{right:g} px"],
            ["K_u = pixel width (as the report says)", f"{PIXEL_M:g}",
             f"{wrong:g} px"]]  # fmt: skip
    about = "A point 1 m beside the axis, 4 m away, f = 8 mm, pixels of 5 µm"
    return Outcome(
        claims=claims,
        tables=[Table(about, ["", "K_u", "beside the principal point"], rows)],
        pictures=[Picture("report_projection", CAPTION, _draw())],
    )


def by_matrices(camera: am.Camera, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Project as the report writes it, in homogeneous coordinates.

    Parameters
    ----------
    camera : Camera
        Without a lens.
    points : ndarray, shape (K, 3)
        World metres.

    Returns
    -------
    ndarray, shape (K, 2)
        Pixels.
    """
    f = FOCAL_M
    K = camera.K @ np.diag([1 / f, 1 / f, 1.0])
    F = np.array([[f, 0, 0, 0], [0, f, 0, 0], [0, 0, 1, 0]])
    homogeneous = np.vstack([points.T, np.ones(len(points))])
    su, sv, s = K @ F @ camera.T_camera_world @ homogeneous
    return np.stack([su / s, sv / s], axis=1)


def _on_plane(seen: NDArray[np.float64], z: float) -> NDArray[np.float64]:
    """Cut the line through each point and the centre with the plane at z, shape (K, 2)."""
    share = z / seen[:, 2]
    return (share[:, None] * seen)[:, :2]


def _drawn(rng: np.random.Generator) -> tuple[am.Camera, NDArray[np.float64]]:
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
    figure = Figure(figsize=(11, 4.4), dpi=110)
    axes: Any = figure.add_axes((0.0, -0.1, 0.56, 1.2), projection="3d")
    # The image plane is drawn a metre before the centre, or nothing would be seen of it.
    rays = camera.rays(camera.project(points).pixels)
    on_plane = camera.center + rays / (rays @ camera.axis)[:, None]
    w, h = SIZE
    corners = camera.rays(np.array([[0, 0], [w, 0], [w, h], [0, h], [0, 0]]) - 0.5)
    frame = camera.center + corners / (corners @ camera.axis)[:, None]
    lines = np.argwhere(np.triu(scene.connections))
    for cloud, colour in ((points, CYCLE[0]), (on_plane, CYCLE[5])):
        for i, j in lines:
            axes.plot(*cloud[[i, j]].T, color=colour, linewidth=1.0)
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
    flat = figure.add_axes((0.6, 0.13, 0.38, 0.76))
    plot_image(camera, camera.project(points), connections=scene.connections,
               colours=CYCLE[0], ax=flat)  # fmt: skip
    flat.set_title("the image: origin top left", fontsize=10, color=INK, loc="left")
    return figure


CAPTION = (
    "The report's figures 3.1, 3.3 and 3.4: points, their rays through the image plane into the "
    "optical centre, and the image in pixels."
)

PART = Part(
    title="The camera: the pin-hole",
    section="§3.1",
    covers="figures 3.1, 3.2, 3.3 and 3.4, and the projection equations",
    did="Derives the projection from similar triangles and writes it as the product of intrinsic "
    "matrix, focal matrix, rototranslation and homogeneous points.",
    run=run,
    slips=(
        "K_u and K_v are called “the pixel width and height”; the equations need the reciprocal, "
        "pixels a metre (table).",
    ),
)
