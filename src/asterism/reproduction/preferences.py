"""§5.5: the lists of preferences, and the effect of “descending order of distance”."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

import asterism as am
from asterism.plot.style import CLUTTER, CYCLE, INK
from asterism.reproduction.drawing import titled_panels
from asterism.reproduction.marriage import marry
from asterism.reproduction.part import Outcome, Part
from asterism.reproduction.rules import exact, fewer

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FRAMES, N_MARKERS = 100, 8
STRIDE, PULL = 0.005, 0.02
NOISE = 0.001


def run(seeds: int) -> Outcome:
    """Match predictions and detections, frame by frame, with both orders of the second lists."""
    wrong = np.zeros((2, seeds))  # percent of the pairs: nearest first, farthest first
    different = 0
    pairs = N_MARKERS * (FRAMES - 2)
    for seed in range(seeds):
        walk = am.simulate.walk(
            n_markers=N_MARKERS, frames=FRAMES, seed=seed, stride=STRIDE, pull=PULL
        )
        places = walk.positions()
        seen = places + np.random.default_rng(seed).normal(0, NOISE, places.shape)
        for t in range(2, FRAMES):
            predicted = 2 * seen[t - 1] - seen[t - 2]
            distance = np.linalg.norm(predicted[:, None] - seen[t][None], axis=2)
            # One covariance for all: the densities fall as the distances rise.
            density = np.exp(-0.5 * (distance / (3 * NOISE)) ** 2)
            targets = np.argsort(distance, axis=1, kind="stable")
            is_dense = density.max(axis=1) > 0
            different += int((density.argmax(axis=1) != targets[:, 0])[is_dense].sum())
            for i, sign in enumerate((1, -1)):
                measurements = np.argsort(sign * distance.T, axis=1, kind="stable")
                found, _ = marry(targets, measurements)
                wrong[i, seed] += 100 * (found != np.arange(N_MARKERS)).sum() / pairs
    claims = [
        exact("a target's list by density begins with the nearest", "figure 5.2", different,
              "number that do not", seeds * pairs),
        fewer("descending order of distance finds the right pairs", "as written", wrong[1],
              wrong[0], "% of the pairs wrong, nearest first"),
    ]  # fmt: skip
    return Outcome(claims=claims, figure=_draw())


def _draw() -> list[Axes]:
    from matplotlib.patches import Circle

    targets = np.array([[0.0, 0.0], [1.0, 0.5], [0.4, 1.2]])
    measurements = np.array([[0.25, 0.3], [1.1, 0.1], [0.8, 1.1]])
    titles = "targets rank measurements by density", "measurements rank targets by distance"
    panels = titled_panels(*titles, width=9.5, height=3.4)
    for axes in panels:
        is_left = axes is panels[0]
        ranking, ranked = (targets, measurements) if is_left else (measurements, targets)
        names, others = ("ABC", "abc") if is_left else ("abc", "ABC")
        for i, place in enumerate(ranking):
            order = np.argsort(np.linalg.norm(ranked - place, axis=1))
            for rank, j in enumerate(order):
                axes.plot(*np.array([place, ranked[j]]).T, color=CLUTTER, alpha=0.7, zorder=0,
                          linewidth=2.2 / (1 + rank) ** 1.5)  # fmt: skip
            label = f"{names[i]}: " + " ".join(others[j] for j in order)
            axes.annotate(label, place, xytext=(8, 5), textcoords="offset points",
                          color=CYCLE[i] if is_left else INK)  # fmt: skip
        axes.plot(*measurements.T, "o", color=INK, fillstyle="none" if is_left else "full")
        axes.plot(*targets.T, "s", color=INK, fillstyle="full" if is_left else "none")
        for (x, y), colour in zip(targets.tolist(), CYCLE, strict=False):
            for radius in (0.2, 0.4):
                axes.add_patch(Circle((x, y), radius, fill=False, edgecolor=colour, alpha=0.35))
        axes.set(xlim=(-0.5, 1.9), ylim=(-0.4, 1.6))
        axes.set_aspect("equal")
        axes.set_axis_off()
    return panels


PART = Part(
    name="preferences",
    title="The stable marriage: the lists of preferences",
    section="§5.5",
    covers="figure 5.2",
    summary="A target ranks the measurements by its predictive density, a measurement “the males "
    "by descending order of distance”.",
    run=run,
    caption="The report's figure 5.2: how the lists arise. Squares are targets with their "
    "densities, dots measurements; the thicker the line, the higher the preference.",
    mistakes=(
        "Taken literally a measurement would prefer the farthest target; descending preference "
        "is meant, the nearest first. With equal numbers and complete lists the targets' "
        "proposals conceal the mistake as long as each target has a favourite of its own.",
    ),
    assumptions=(
        f"{N_MARKERS} markers that walk at random by {1e3 * STRIDE:g} mm a frame, drawn to the "
        f"origin by {100 * PULL:g} %.",
    ),
)
