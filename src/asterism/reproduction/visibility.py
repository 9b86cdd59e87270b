"""§3.3: which points a camera sees, and the picture of points and their connections."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

import asterism as am
from asterism.plot import plot_image
from asterism.plot.style import CYCLE
from asterism.reproduction.drawing import titled, titled_panels
from asterism.reproduction.part import Outcome, Part, Table
from asterism.reproduction.rules import exact

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

SIZE = (1024, 1280)
FAR = 6.0
N_POINTS = 2000
REASONS = {
    am.camera.Reason.BEHIND: "behind the image plane",
    am.camera.Reason.FAR: "too far",
    am.camera.Reason.OUTSIDE: "outside the image",
    am.camera.Reason.VISIBLE: "seen",
}


def run(seeds: int) -> Outcome:
    """Project clouds of points from random places, and check each reason separately."""
    found: list[NDArray[np.int64]] = []
    expected: list[NDArray[np.int64]] = []
    for seed in range(seeds):
        rng = np.random.default_rng(seed)
        camera = _camera(rng.normal((0, -2, 0), 1, 3), rng.normal(0, 0.5, 3))
        points = rng.normal(0, 4, (N_POINTS, 3))
        found.append(camera.project(points).reason.astype(np.int64))
        expected.append(_expected(camera, points))
    a, b = np.concatenate(found), np.concatenate(expected)
    claims = [
        exact(f"points {name} are marked", "a rule", ((a == reason) != (b == reason)).sum(),
              "number marked otherwise", len(a))
        for reason, name in REASONS.items()
    ]  # fmt: skip
    rows = [[name, f"{100 * (a == reason).mean():.1f} %"] for reason, name in REASONS.items()]
    table = Table(f"{len(a):,} points about random cameras", ["", "share"], rows)
    return Outcome(claims=claims, tables=[table], figure=_draw())


def _camera(place: NDArray[np.float64], target: NDArray[np.float64]) -> am.Camera:
    K = am.camera.intrinsics(focal_length=1100.0, principal_point=(511.5, 639.5))
    return am.Camera.look_at(place, target, K=K, size_px=SIZE, far=FAR)


def _expected(camera: am.Camera, points: NDArray[np.float64]) -> NDArray[np.int64]:
    """Decide the visibility point by point, by the report's three reasons."""
    w, h = camera.size_px
    found: list[int] = []
    for p in points:
        x, y, z = camera.T_camera_world[:3, :3] @ p + camera.T_camera_world[:3, 3]
        if z <= 0:
            found.append(am.camera.Reason.BEHIND)
            continue
        u, v = camera.K[0, 0] * x / z + camera.K[0, 2], camera.K[1, 1] * y / z + camera.K[1, 2]
        inside = -0.5 <= u <= w - 0.5 and -0.5 <= v <= h - 0.5
        seen = am.camera.Reason.VISIBLE if inside else am.camera.Reason.OUTSIDE
        found.append(am.camera.Reason.FAR if z > FAR else seen)
    return np.array(found)


def _draw() -> list[Axes]:
    scene = am.simulate.person(frames=60, seed=1, activity="walk")
    points = scene.positions()[40]
    colours = [CYCLE[(c - 1) % len(CYCLE)] for c in scene.colours]
    middle = points.mean(axis=0)
    places = {"whole": [0.3, -2.1, 0.2], "near: some fall outside the image": [1.1, -0.6, 0.3]}
    panels = titled_panels(*places, width=9.0, height=5.6)
    for axes, (title, offset) in zip(panels, places.items(), strict=True):
        camera = _camera(middle + offset, middle)
        seen = camera.project(points)
        plot_image(camera, seen, connections=scene.connections, colours=colours, ax=axes)
        titled(axes, f"{title}: {int(seen.visible.sum())} of {len(points)}")
    return panels


PART = Part(
    name="visibility",
    title="The camera: visibility and the picture",
    section="§3.3",
    covers="the three reasons, and the plot with a connection matrix",
    summary="Marks points as not visible that fall outside the image, lie behind the image plane "
    "or are too far, and plots the rest with the lines and colours of a connection matrix.",
    run=run,
    caption="A cloud of points as the simulator of §3.3 shows it: markers in their colours and the "
    "lines of a connection matrix, from two places.",
    assumptions=(f"“Too far” is {FAR:g} m along the optical axis.",),
)
