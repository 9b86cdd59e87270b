"""§3.2: skew, and radial distortion of both kinds."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

import asterism as am
from asterism.plot import plot_lens
from asterism.plot.style import INK, new_panels
from asterism.reproduction.part import Claim, Outcome, Part, Picture, Table
from asterism.reproduction.rules import exact

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from asterism.reproduction.part import Effort, Tell

SIZE = (1280, 1024)
FOCAL_PX = 900.0
SKEW_PX = 120.0
BARREL, PINCUSHION = 0.3, -0.12
N_POINTS = 1000
TOLERANCE = 1e-9


def run(effort: Effort, tell: Tell) -> Outcome:
    """Draw lenses; look which way they bend, and back."""
    wrong = {"barrel": 0, "pincushion": 0}
    other_way = n_other = 0
    inverse = sheared = 0.0
    cases = 0
    for seed in range(effort.seeds):
        rng = np.random.default_rng(seed)
        for kind, sign in (("barrel", 1), ("pincushion", -1)):
            a1 = sign * rng.uniform(0.05, 0.2)
            camera = _camera(am.camera.ReportRadial(a1=a1, a2=sign * rng.uniform(0, 0.02)))
            wrong[kind] += int(np.count_nonzero(sign * np.diff(_magnification(camera)) >= 0))
            wrong[kind] += int(sign * _bow(camera) <= 0)
            # The same sign in the other direction, undistorted to distorted.
            bent = _magnification(_camera(am.camera.BrownConrady(k1=a1)))
            other_way += np.count_nonzero(sign * np.diff(bent) < 0)
            n_other += len(bent) - 1
            points = rng.uniform(-0.4, 0.4, (N_POINTS, 2))
            r2 = ((camera.distort(points) - camera.K[:2, 2]) / FOCAL_PX) ** 2
            r2 = r2.sum(axis=1, keepdims=True)
            forward = (camera.distort(points) - camera.K[:2, 2]) / FOCAL_PX
            lens = camera.lens
            assert isinstance(lens, am.camera.ReportRadial)
            back = forward * (1 + lens.a1 * r2 + lens.a2 * r2**2)
            inverse = max(inverse, float(np.abs(back - points).max()))
            cases += 1
        skewed, straight = _camera(None, SKEW_PX), _camera(None)
        points = rng.uniform(-0.4, 0.4, (N_POINTS, 2))
        shift = skewed.distort(points) - straight.distort(points)
        wanted = np.stack([SKEW_PX * points[:, 1], np.zeros(N_POINTS)], axis=1)
        sheared = max(sheared, float(np.abs(shift - wanted).max()))
        tell((seed + 1) / effort.seeds)
    n_each = cases // 2
    claims = [
        Claim("skew shifts u in proportion to y, v not at all", "an identity",
              f"differ by {sheared:.1e} px",
              exact(sheared, TOLERANCE, "greatest difference in pixels",
                    effort.seeds * N_POINTS)),
        Claim("a₁ > 0 is barrel: less magnification outwards", "figure 3.6",
              f"{wrong['barrel']} exceptions",
              exact(wrong["barrel"], 0, "number of radii and lines that bend otherwise", n_each)),
        Claim("a₁ < 0 is pincushion: lines bow inwards", "figure 3.6",
              f"{wrong['pincushion']} exceptions",
              exact(wrong["pincushion"], 0, "number of radii and lines that bend otherwise",
                    n_each)),
        Claim("x = x_d (1 + a₁ r² + a₂ r⁴), solved for x_d", "an equation",
              f"differ by {inverse:.1e}",
              exact(inverse, TOLERANCE, "greatest difference after solving and inserting",
                    cases * N_POINTS)),
    ]  # fmt: skip
    rows = [["distorted to undistorted (as written: x from x_d)", "barrel", "pincushion"],
            ["undistorted to distorted", "pincushion" if not other_way else "both",
             "barrel" if not other_way else "both"]]  # fmt: skip
    return Outcome(
        claims=claims,
        tables=[Table("The same coefficients in both directions",
                      ["direction", "a₁ > 0", "a₁ < 0"], rows)],
        pictures=[Picture("report_distortion", CAPTION, _draw())],
        notes=(f"In the other direction the signs change their meaning at all {n_other:,} radii "
               "tried.",) if not other_way else (),
    )  # fmt: skip


def _camera(lens: am.camera.Lens | None, skew: float = 0.0) -> am.Camera:
    K = am.camera.intrinsics(focal_length=FOCAL_PX, principal_point=(639.5, 511.5))
    K[0, 1] = skew
    return am.Camera.look_at((0, -4, 1), (0, 0, 1), K=K, size_px=SIZE, lens=lens)


def _magnification(camera: am.Camera) -> NDArray[np.float64]:
    """Give how much longer radii become, from near the centre outwards, shape (20,)."""
    r = np.linspace(0.05, 0.6, 20)
    bent = (camera.distort(np.stack([r, 0 * r], axis=1))[:, 0] - camera.K[0, 2]) / FOCAL_PX
    return bent / r


def _bow(camera: am.Camera) -> float:
    """Give by how many pixels the middle of a line beside the centre lies outside its ends."""
    x = np.array([-0.4, 0.0, 0.4])
    u = camera.distort(np.stack([np.full(3, 0.4), x], axis=1))[:, 0]
    return float(u[1] - 0.5 * (u[0] + u[2]))


def _draw() -> Figure:
    panels = new_panels(1, 3, width=12.0, height=3.6)
    for axes, title, camera in zip(
        panels,
        (f"skew: s_w = {SKEW_PX:g} px", f"barrel: a₁ = {BARREL:g}",
         f"pincushion: a₁ = {PINCUSHION:g}"),
        (_camera(None, SKEW_PX), _camera(am.camera.ReportRadial(a1=BARREL)),
         _camera(am.camera.ReportRadial(a1=PINCUSHION))),
        strict=True,
    ):  # fmt: skip
        plot_lens(camera, ax=axes)
        axes.set_title(title, fontsize=10, color=INK, loc="left")
    return panels[0].figure  # pyright: ignore[reportReturnType]


CAPTION = (
    "The report's figures 3.5 and 3.6: a square grid seen with skew and through the two kinds of "
    "radial distortion. Pale: without."
)

PART = Part(
    title="The camera: distortions",
    section="§3.2",
    covers="figures 3.5 and 3.6, the matrix K′ and the radial equation",
    did="Adds a skew factor to the intrinsic matrix, and radial distortion of fourth order: barrel "
    "for a positive a₁, pincushion for a negative one.",
    run=run,
    slips=(
        "The radius in the equation is that of the distorted point, which the report does not say; "
        "read in the other direction, barrel and pincushion change places (table).",
    ),
)
