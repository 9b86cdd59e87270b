"""§3.3: which points a camera sees, and the picture of points and their connections."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

import asterism as am
from asterism.plot import plot_image
from asterism.plot.style import CYCLE, INK, new_panels
from asterism.reproduction.part import Claim, Outcome, Part, Picture, Table
from asterism.reproduction.rules import exact

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from asterism.reproduction.part import Effort, Tell

SIZE = (1024, 1280)
FAR = 6.0
N_POINTS = 2000
REASONS = {
    am.camera.Reason.BEHIND: "behind the image plane",
    am.camera.Reason.FAR: "too far",
    am.camera.Reason.OUTSIDE: "outside the image",
    am.camera.Reason.VISIBLE: "seen",
}


def run(effort: Effort, tell: Tell) -> Outcome:
    """Look at clouds of points from random places, and check each reason by hand."""
    wrong = dict.fromkeys(REASONS, 0)
    counts = dict.fromkeys(REASONS, 0)
    for seed in range(effort.seeds):
        rng = np.random.default_rng(seed)
        camera = _camera(rng.normal((0, -2, 0), 1, 3), rng.normal(0, 0.5, 3))
        points = rng.normal(0, 4, (N_POINTS, 3))
        reason = camera.project(points).reason
        by_hand = _by_hand(camera, points)
        for which in REASONS:
            wrong[which] += int(((reason == which) != (by_hand == which)).sum())
            counts[which] += int((reason == which).sum())
        tell((seed + 1) / effort.seeds)
    n = effort.seeds * N_POINTS
    claims = [
        Claim(f"points {told} are marked", "a rule", f"{wrong[which]} marked otherwise",
              exact(wrong[which], 0, "number marked otherwise", n))
        for which, told in REASONS.items()
    ]  # fmt: skip
    rows = [[told, f"{100 * counts[which] / n:.1f} %"] for which, told in REASONS.items()]
    return Outcome(
        claims=claims,
        tables=[Table(f"{n:,} points about random cameras", ["", "share"], rows)],
        pictures=[Picture("report_visibility", CAPTION, _draw())],
    )


def _camera(place: NDArray[np.float64], target: NDArray[np.float64]) -> am.Camera:
    K = am.camera.intrinsics(focal_length=1100.0, principal_point=(511.5, 639.5))
    return am.Camera.look_at(place, target, K=K, size_px=SIZE, far=FAR)


def _by_hand(camera: am.Camera, points: NDArray[np.float64]) -> NDArray[np.int64]:
    """Decide point by point, with the report's three reasons in its words."""
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


def _draw() -> Figure:
    scene = am.simulate.person(frames=60, seed=1, activity="walk")
    points = scene.positions()[40]
    colours = [CYCLE[(c - 1) % len(CYCLE)] for c in scene.colours]
    middle = points.mean(axis=0)
    panels = new_panels(1, 2, width=9.0, height=5.6)
    for axes, (title, off) in zip(
        panels,
        (("whole", [0.3, -2.1, 0.2]), ("near: some fall outside the image", [1.1, -0.6, 0.3])),
        strict=True,
    ):
        camera = _camera(middle + off, middle)
        seen = camera.project(points)
        plot_image(camera, seen, connections=scene.connections, colours=colours, ax=axes)
        n_seen = int(seen.visible.sum())
        axes.set_title(f"{title}: {n_seen} of {len(points)}", fontsize=10, color=INK, loc="left")
    return panels[0].figure  # pyright: ignore[reportReturnType]


CAPTION = (
    "A cloud of points as the simulator of §3.3 shows it: markers in their colours and the lines "
    "of a connection matrix, from two places."
)

PART = Part(
    title="The camera: visibility and the picture",
    section="§3.3",
    covers="the three reasons, and the plot with a connection matrix",
    did="Marks points as not visible that fall outside the image, lie behind the image plane or "
    "are too far, and plots the rest with the lines and colours of a connection matrix.",
    run=run,
    chosen=(f"“Too far” is {FAR:g} m along the optical axis.",),
)
