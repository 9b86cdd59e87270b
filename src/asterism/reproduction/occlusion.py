"""§3.4: polygons that hide points: curtains, the z-buffer, the painter's algorithm."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

import numpy as np

import asterism as am
from asterism.plot import plot_depth, plot_image
from asterism.plot.style import CYCLE, INK
from asterism.reproduction.part import Claim, Outcome, Part, Picture, Table, Timing
from asterism.reproduction.rules import exact, spread

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from asterism.reproduction.part import Effort, Tell

SIZE, QUICK_SIZE = (1280, 1024), (640, 512)
N_POINTS, N_POLYGONS = 500, 6

NOTE = (
    "The z-buffer knows the nearest pixel's centre, the ray knows the point itself: where a pixel "
    "about the point is hidden in part, at an edge or on a slope, they may differ."
)


def run(effort: Effort, tell: Tell) -> Outcome:
    """Hide points behind polygons in the three ways."""
    camera = _camera(QUICK_SIZE if effort.is_quick else SIZE)
    differ = at_edges = painted_wrong = n_hidden = 0
    shares: list[float] = []
    seconds = {"curtains": 0.0, "z-buffer": 0.0}
    for seed in range(effort.seeds):
        rng = np.random.default_rng(seed)
        polygons = _polygons(rng)
        points = rng.uniform(-1.2, 1.2, (N_POINTS, 3))
        start = time.perf_counter()
        seen = camera.project(points, polygons)
        seconds["curtains"] += time.perf_counter() - start
        start = time.perf_counter()
        depth = camera.depth_image(polygons)
        hides = depth.hides(seen)
        seconds["z-buffer"] += time.perf_counter() - start
        is_hidden = seen.reason == am.camera.Reason.HIDDEN
        is_edge = _at_edges(camera, polygons, seen)
        differ += int(((hides != is_hidden) & ~is_edge).sum())
        at_edges += int(((hides != is_hidden) & is_edge).sum())
        n_hidden += int(is_hidden.sum())
        shares.append(100 * float(is_hidden.mean()))
        plain = [polygons[0], _moved(polygons[0], 0.6)]
        painted_wrong += int(
            (camera.paint(plain).surface != camera.depth_image(plain).surface).sum()
        )
        tell((seed + 1) / effort.seeds)
    ring = _ring()
    painting, buffered = camera.paint(ring), camera.depth_image(ring)
    n_wrong = int((painting.surface != buffered.surface).sum())
    n = effort.seeds * N_POINTS
    n_pixels = camera.size_px[0] * camera.size_px[1]
    claims = [
        Claim("testing only where a point falls hides the same points", "equal to the z-buffer",
              f"{differ} differ, {at_edges} at edges",
              exact(differ, 0, "number that differ away from edges", n)),
        Claim("… with a considerable reduction of complexity", "fewer pixels",
              f"{N_POINTS} places instead of {n_pixels:,}",
              exact(float(n_pixels <= N_POINTS), 0, "number of images with fewer pixels", 1)),
        Claim("the painter's algorithm is right without cycles", "a rule",
              f"{painted_wrong} pixels wrong",
              exact(painted_wrong, 0, "number of wrong pixels", effort.seeds * n_pixels)),
        Claim("… and fails on polygons that overlap in a circle", "a rule",
              f"{n_wrong:,} pixels wrong, {len(painting.cycles)} circle told",
              exact(float(n_wrong == 0 or not painting.cycles), 0,
                    "number of circles painted right or missed", 1)),
    ]  # fmt: skip
    rows = [["points hidden", f"{spread(shares)} %"], ["of them in all", f"{n_hidden:,}"]]
    about = f"{N_POLYGONS} random triangles before {N_POINTS} points, {effort.seeds} times"
    size = f"{camera.size_px[0]} × {camera.size_px[1]} px"
    timings = [
        Timing(f"{N_POINTS} points, {way}, {size}", "–", s / effort.seeds)
        for way, s in seconds.items()
    ]
    return Outcome(
        claims=claims,
        tables=[Table(about, ["", ""], rows)],
        pictures=[Picture("report_occlusion", CAPTION, _draw(_camera(QUICK_SIZE)))],
        timings=timings,
        notes=(NOTE,),
    )


def _camera(size: tuple[int, int]) -> am.Camera:
    w, h = size
    K = am.camera.intrinsics(focal_length=1.1 * w, principal_point=((w - 1) / 2, (h - 1) / 2))
    return am.Camera.look_at((0, -4, 0), (0, 0, 0), K=K, size_px=size)


def _polygons(rng: np.random.Generator) -> list[am.camera.Polygon]:
    corners = rng.uniform(-1, 1, (N_POLYGONS, 1, 3)) * [1, 0.8, 0.8]
    corners = corners + rng.normal(0, 0.35, (N_POLYGONS, 3, 3))
    return [am.camera.Polygon(corners=c, name=f"triangle {i + 1}") for i, c in enumerate(corners)]


def _moved(polygon: am.camera.Polygon, by: float) -> am.camera.Polygon:
    return am.camera.Polygon(
        corners=np.asarray(polygon.corners).reshape(-1, 3) + np.array([0.1, by, 0.05])
    )


def _ring() -> list[am.camera.Polygon]:
    """Three bars, each in front of the next, about the axis of sight."""
    bar = np.array(
        [[-0.9, -0.25, -0.55], [0.9, 0.25, -0.55], [0.9, 0.25, -0.2], [-0.9, -0.25, -0.2]]
    )
    bars: list[am.camera.Polygon] = []
    for k in range(3):
        c, s = np.cos(2 * np.pi * k / 3), np.sin(2 * np.pi * k / 3)
        turn = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
        bars.append(am.camera.Polygon(corners=bar @ turn.T, name=f"bar {k + 1}"))
    return bars


def _at_edges(
    camera: am.Camera, polygons: list[am.camera.Polygon], seen: am.camera.Projection
) -> NDArray[np.bool_]:
    """Say which points are finer than pixels: at their depth not all of their pixel is hidden."""
    is_in: NDArray[np.bool_] = np.isfinite(seen.pixels[:, 0])
    steps = np.array([(u, v) for u in (-1, -0.5, 0, 0.5, 1) for v in (-1, -0.5, 0, 0.5, 1)])
    rays = camera.rays(np.where(is_in[:, None], seen.pixels, 0.0)[:, None] + steps)
    beside = camera.center + rays * (seen.depth[:, None] / (rays @ camera.axis))[..., None]
    blocked = camera.project(beside, polygons).hidden_by >= 0
    return is_in & (blocked.any(axis=1) != blocked.all(axis=1))


def _draw(camera: am.Camera) -> Figure:
    from matplotlib.colors import ListedColormap
    from matplotlib.figure import Figure

    rng = np.random.default_rng(4)
    curtains = [
        am.camera.Polygon(
            corners=np.array([[-1, -0.9, -0.4], [0.1, -0.9, -0.6], [0.0, -0.9, 0.7]])
        ),
        am.camera.Polygon(
            corners=np.array(
                [[0.4, -0.3, -0.7], [1.2, -0.3, -0.5], [1.1, -0.3, 0.5], [0.5, -0.3, 0.3]]
            )
        ),
    ]
    points = np.column_stack(
        [rng.uniform(-1.3, 1.3, 60), rng.uniform(0.2, 0.8, 60), rng.uniform(-0.9, 0.9, 60)]
    )
    figure = Figure(figsize=(11.5, 8.2), dpi=110, layout="constrained")
    panels: Any = figure.subplots(2, 2).ravel()
    plot_image(camera, camera.project(points, curtains), colours=CYCLE[0], surfaces=curtains,
               ax=panels[0])  # fmt: skip
    plot_depth(camera.depth_image(curtains), ax=panels[1])
    ring = _ring()
    colours = ListedColormap(["none", *CYCLE[:3]])  # clear: paper may be dark
    for axes, image in zip(panels[2:], (camera.depth_image(ring), camera.paint(ring)), strict=True):
        axes.imshow(image.surface, cmap=colours, vmin=-1, vmax=2, interpolation="nearest")
        axes.set_axis_off()
    titles = (
        "curtains: hollow points are hidden", "the same in a z-buffer",
        "three bars in a circle, z-buffer", "… by the painter's algorithm",
    )  # fmt: skip
    for axes, title in zip(panels, titles, strict=True):
        axes.set_title(title, fontsize=10, color=INK, loc="left")
    return figure


CAPTION = (
    "The report's figure 3.7: areas that hide points without being seen; its algorithm 1, the "
    "z-buffer; and where the painter's algorithm fails."
)

PART = Part(
    title="The camera: what hides points",
    section="§3.4",
    covers="figure 3.7, algorithm 1, the painter's algorithm",
    did="Proposes polygons that hide points: the painter's algorithm, which fails when they "
    "overlap in a circle; the z-buffer; and the z-test only at the pixels where a point falls, by "
    "which polygons act as invisible curtains.",
    run=run,
)
