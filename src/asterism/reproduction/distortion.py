"""§3.2: skew, and radial distortion of both kinds."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

import asterism as am
from asterism.plot import plot_lens
from asterism.reproduction.drawing import titled, titled_panels
from asterism.reproduction.part import Outcome, Part, Table
from asterism.reproduction.rules import exact

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

SIZE = (1280, 1024)
FOCAL_PX = 900.0
SKEW_PX = 120.0
BARREL, PINCUSHION = 0.3, -0.12
N_POINTS = 1000
TOLERANCE = 1e-9
RADII = np.linspace(0.05, 0.6, 20)


def run(seeds: int) -> Outcome:
    """Draw lenses; compare the directions of their distortion, and their inverse."""
    kinds = {"barrel": 1, "pincushion": -1}
    # Radii and lines against the kind, by kind; radii at which the magnification falls, by
    # direction of the polynomial and by kind.
    wrong = dict.fromkeys(kinds, 0)
    falls = np.zeros((2, 2), dtype=int)
    inverse = sheared = 0.0
    for seed in range(seeds):
        rng = np.random.default_rng(seed)
        for i, (kind, sign) in enumerate(kinds.items()):
            a1 = sign * rng.uniform(0.05, 0.2)
            lens = am.camera.ReportRadial(a1=a1, a2=sign * rng.uniform(0, 0.02))
            camera = _camera(lens)
            changes = np.diff(_magnification(camera))
            wrong[kind] += int((sign * changes >= 0).sum()) + int(sign * _bow(camera) <= 0)
            other = np.diff(_magnification(_camera(am.camera.BrownConrady(k1=a1))))
            falls[:, i] += (changes < 0).sum(), (other < 0).sum()
            points = rng.uniform(-0.4, 0.4, (N_POINTS, 2))
            bent = (camera.distort(points) - camera.K[:2, 2]) / FOCAL_PX
            r2 = (bent**2).sum(axis=1, keepdims=True)
            back = bent * (1 + lens.a1 * r2 + lens.a2 * r2**2)
            inverse = max(inverse, float(np.abs(back - points).max()))
        points = rng.uniform(-0.4, 0.4, (N_POINTS, 2))
        shift = _camera(None, SKEW_PX).distort(points) - _camera(None).distort(points)
        expected = np.stack([SKEW_PX * points[:, 1], np.zeros(N_POINTS)], axis=1)
        sheared = max(sheared, float(np.abs(shift - expected).max()))
    claims = [
        exact("skew shifts u in proportion to y, v not at all", "an identity", sheared,
              "greatest difference in pixels", seeds * N_POINTS, TOLERANCE),
        *(
            exact(f"a₁ {bound} is {kind}: {what}", "figure 3.6", wrong[kind],
                  "number of radii and lines that bend otherwise", seeds)
            for kind, bound, what in (("barrel", "> 0", "less magnification outwards"),
                                      ("pincushion", "< 0", "lines bow inwards"))
        ),
        exact("x = x_d (1 + a₁ r² + a₂ r⁴), solved for x_d", "an equation", inverse,
              "greatest difference after solving and inserting", 2 * seeds * N_POINTS, TOLERANCE),
    ]  # fmt: skip
    n = seeds * (len(RADII) - 1)
    directions = ("distorted to undistorted (as written: x from x_d)", "undistorted to distorted")
    rows = [
        [direction, *(f"{count} of {n}" for count in counts)]
        for direction, counts in zip(directions, falls, strict=True)
    ]
    head = ["direction of the equation", "a₁ > 0", "a₁ < 0"]
    title = "Steps outwards at which the magnification falls, which is barrel distortion"
    return Outcome(claims=claims, tables=[Table(title, head, rows)], figure=_draw())


def _camera(lens: am.camera.Lens | None, skew: float = 0.0) -> am.Camera:
    K = am.camera.intrinsics(focal_length=FOCAL_PX, principal_point=(639.5, 511.5))
    K[0, 1] = skew
    return am.Camera.look_at((0, -4, 1), (0, 0, 1), K=K, size_px=SIZE, lens=lens)


def _magnification(camera: am.Camera) -> NDArray[np.float64]:
    """Return distorted over undistorted radius, at `RADII`."""
    bent = camera.distort(np.stack([RADII, 0 * RADII], axis=1))[:, 0]
    return (bent - camera.K[0, 2]) / FOCAL_PX / RADII


def _bow(camera: am.Camera) -> float:
    """Return by how many pixels the middle of a line lies farther out than its ends."""
    x = np.array([-0.4, 0.0, 0.4])
    u = camera.distort(np.stack([np.full(3, 0.4), x], axis=1))[:, 0]
    return float(u[1] - 0.5 * (u[0] + u[2]))


def _draw() -> list[Axes]:
    cameras = {
        f"skew: s_w = {SKEW_PX:g} px": _camera(None, SKEW_PX),
        f"barrel: a₁ = {BARREL:g}": _camera(am.camera.ReportRadial(a1=BARREL)),
        f"pincushion: a₁ = {PINCUSHION:g}": _camera(am.camera.ReportRadial(a1=PINCUSHION)),
    }
    panels = titled_panels(*cameras, width=12.0, height=3.6)
    for axes, (title, camera) in zip(panels, cameras.items(), strict=True):
        titled(plot_lens(camera, ax=axes), title)
    return panels


PART = Part(
    name="distortion",
    title="The camera: distortions",
    section="§3.2",
    covers="figures 3.5 and 3.6, the matrix K′ and the radial equation",
    summary="Adds a skew factor to the intrinsic matrix, and radial distortion of fourth order: "
    "barrel for a positive a₁, pincushion for a negative one.",
    run=run,
    caption="The report's figures 3.5 and 3.6: a square grid seen with skew and through the two "
    "kinds of radial distortion. Pale: without.",
    mistakes=(
        "The radius in the equation is that of the distorted point, which the report does not say; "
        "read in the other direction, barrel and pincushion change places (table).",
    ),
)
