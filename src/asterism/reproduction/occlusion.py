"""§3.4: polygons that hide points: curtains, the z-buffer, the painter's algorithm."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

import numpy as np

import asterism as am
from asterism.plot import plot_depth, plot_image
from asterism.plot.style import CYCLE
from asterism.reproduction.drawing import titled, titled_panels
from asterism.reproduction.part import Outcome, Part, Timing
from asterism.reproduction.rules import exact

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

SIZE, DRAWN_SIZE = (1280, 1024), (640, 512)
N_POINTS, N_POLYGONS = 500, 6


def run(seeds: int) -> Outcome:
    """Hide points behind polygons by curtains and by the z-buffer; paint polygons."""
    camera = _camera(SIZE)
    different = painted_wrong = n_occluded = 0
    seconds = {"curtains": 0.0, "z-buffer": 0.0}
    for seed in range(seeds):
        rng = np.random.default_rng(seed)
        polygons = _polygons(rng)
        points = rng.uniform(-1.2, 1.2, (N_POINTS, 3))
        start = time.perf_counter()
        seen = camera.project(points, polygons)
        middle = time.perf_counter()
        hides = camera.depth_image(polygons).hides(seen)
        seconds["curtains"] += middle - start
        seconds["z-buffer"] += time.perf_counter() - middle
        is_occluded = seen.reason == am.camera.Reason.OCCLUDED
        n_occluded += int(is_occluded.sum())
        different += int(((hides != is_occluded) & ~_at_edges(camera, polygons, seen)).sum())
        corners = np.asarray(polygons[0].corners).reshape(-1, 3)
        plain = [polygons[0], am.camera.Polygon(corners=corners + np.array([0.1, 0.6, 0.05]))]
        painted_wrong += _n_painted_wrong(camera, plain)
    ring = _ring()
    n_wrong, n_cycles = _n_painted_wrong(camera, ring), len(camera.paint(ring).cycles)
    n_pixels = SIZE[0] * SIZE[1]
    claims = [
        exact(f"a test at each point alone occludes the same points ({n_occluded:,})",
              "equal to the z-buffer", different, "number that differ away from edges",
              seeds * N_POINTS),
        exact(f"it tests fewer places ({N_POINTS} instead of {n_pixels:,})",
              "a considerable reduction of complexity", float(n_pixels <= N_POINTS),
              "number of images with fewer pixels", 1),
        exact("the painter's algorithm is right without cycles", "a rule", painted_wrong,
              "number of wrong pixels", seeds * n_pixels),
        exact(f"the painter's algorithm fails on a cycle ({n_wrong:,} pixels wrong, {n_cycles} "
              "cycle reported)",
              "a rule", float(n_wrong == 0 or n_cycles == 0),
              "number of cycles painted right or missed", 1),
    ]  # fmt: skip
    about = f"{N_POINTS} points, {{}}, {SIZE[0]} × {SIZE[1]} px"
    timings = [Timing(about.format(way), "–", s / seeds) for way, s in seconds.items()]
    return Outcome(claims=claims, figure=_draw(_camera(DRAWN_SIZE)), timings=timings)


def _n_painted_wrong(camera: am.Camera, polygons: list[am.camera.Polygon]) -> int:
    painted, buffered = camera.paint(polygons), camera.depth_image(polygons)
    return int((painted.surface != buffered.surface).sum())


def _camera(size: tuple[int, int]) -> am.Camera:
    w, h = size
    K = am.camera.intrinsics(focal_length=1.1 * w, principal_point=((w - 1) / 2, (h - 1) / 2))
    return am.Camera.look_at((0, -4, 0), (0, 0, 0), K=K, size_px=size)


def _polygons(rng: np.random.Generator) -> list[am.camera.Polygon]:
    corners = rng.uniform(-1, 1, (N_POLYGONS, 1, 3)) * [1, 0.8, 0.8]
    corners = corners + rng.normal(0, 0.35, (N_POLYGONS, 3, 3))
    return [am.camera.Polygon(corners=c) for c in corners]


def _ring() -> list[am.camera.Polygon]:
    """Return three bars around the optical axis, each in front of the next."""
    bar = np.array(
        [[-0.9, -0.25, -0.55], [0.9, 0.25, -0.55], [0.9, 0.25, -0.2], [-0.9, -0.25, -0.2]]
    )
    bars: list[am.camera.Polygon] = []
    for k in range(3):
        c, s = np.cos(2 * np.pi * k / 3), np.sin(2 * np.pi * k / 3)
        turn = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
        bars.append(am.camera.Polygon(corners=bar @ turn.T))
    return bars


def _at_edges(
    camera: am.Camera, polygons: list[am.camera.Polygon], seen: am.camera.Projection
) -> NDArray[np.bool_]:
    """Return which points have a pixel that, at their depth, is occluded only in part."""
    is_in: NDArray[np.bool_] = np.isfinite(seen.pixels[:, 0])
    steps = np.array([(u, v) for u in (-1, -0.5, 0, 0.5, 1) for v in (-1, -0.5, 0, 0.5, 1)])
    rays = camera.rays(np.where(is_in[:, None], seen.pixels, 0.0)[:, None] + steps)
    beside = camera.center + rays * (seen.depth[:, None] / (rays @ camera.axis))[..., None]
    blocked = camera.project(beside, polygons).occluded_by >= 0
    return is_in & (blocked.any(axis=1) != blocked.all(axis=1))


def _draw(camera: am.Camera) -> list[Axes]:
    from matplotlib.colors import ListedColormap

    rng = np.random.default_rng(4)
    near = np.array([[-1, -0.9, -0.4], [0.1, -0.9, -0.6], [0.0, -0.9, 0.7]])
    far = np.array([[0.4, -0.3, -0.7], [1.2, -0.3, -0.5], [1.1, -0.3, 0.5], [0.5, -0.3, 0.3]])
    curtains = [am.camera.Polygon(corners=near), am.camera.Polygon(corners=far)]
    points = np.column_stack(
        [rng.uniform(-1.3, 1.3, 60), rng.uniform(0.2, 0.8, 60), rng.uniform(-0.9, 0.9, 60)]
    )
    titles = ("curtains: hollow points are occluded", "the same in a z-buffer",
              "three bars in a cycle, z-buffer", "the same, painter's algorithm")  # fmt: skip
    panels = titled_panels(*titles, width=11.5, height=8.2, n_rows=2)
    plot_image(camera, camera.project(points, curtains), colours=CYCLE[0], surfaces=curtains,
               ax=panels[0])  # fmt: skip
    plot_depth(camera.depth_image(curtains), ax=panels[1])
    ring = _ring()
    colours = ListedColormap(["none", *CYCLE[:3]])
    for axes, image in zip(panels[2:], (camera.depth_image(ring), camera.paint(ring)), strict=True):
        axes.imshow(image.surface, cmap=colours, vmin=-1, vmax=2, interpolation="nearest")
        axes.set_axis_off()
    return [titled(axes, title) for axes, title in zip(panels, titles, strict=True)]


PART = Part(
    name="occlusion",
    title="The camera: polygons that hide points",
    section="§3.4",
    covers="figure 3.7, algorithm 1, the painter's algorithm",
    summary="Proposes polygons that hide points: the painter's algorithm, which fails when they "
    "overlap in a cycle; the z-buffer; and the z-test only at the pixels where a point falls, by "
    "which polygons act as invisible curtains.",
    run=run,
    caption="The report's figure 3.7: areas that hide points without being seen; its algorithm 1, "
    "the z-buffer; and where the painter's algorithm fails.",
    notes=(
        "The z-buffer holds the depth at the centre of the nearest pixel, a ray that of the point "
        "itself: where a pixel is occluded in part, at an edge or on a slope, they may differ.",
    ),
)
