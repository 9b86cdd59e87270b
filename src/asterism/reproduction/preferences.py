"""§5.5: the lists of preferences, and what “descending order of distance” would do."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

import asterism as am
from asterism.plot.style import CLUTTER, CYCLE, INK, new_panels
from asterism.reproduction.marriage import marry
from asterism.reproduction.part import Claim, Outcome, Part, Picture, Table
from asterism.reproduction.rules import differs, exact, spread

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from asterism.reproduction.part import Effort, Tell

FRAMES, N_MARKERS = 100, 8
STRIDE, PULL = 0.005, 0.02
NOISE = 0.001
WAYS = {"nearest first": 1, "farthest first": -1}


def run(effort: Effort, tell: Tell) -> Outcome:
    """Marry predictions and detections, frame by frame, with both orders of the women's lists."""
    shares: dict[str, list[float]] = {way: [] for way in WAYS}
    same = 0
    for seed in range(effort.seeds):
        places = _walk(seed).positions()
        rng = np.random.default_rng(seed)
        seen = places + rng.normal(0, NOISE, places.shape)
        right = dict.fromkeys(WAYS, 0)
        for t in range(2, FRAMES):
            predicted = 2 * seen[t - 1] - seen[t - 2]
            distance = np.linalg.norm(predicted[:, None] - seen[t][None], axis=2)
            # One covariance for all: the densities fall as the distances rise.
            density = np.exp(-0.5 * (distance / (3 * NOISE)) ** 2)
            men = np.argsort(-density, axis=1, kind="stable")
            by_distance = np.argsort(distance, axis=1, kind="stable")
            same += int((men != by_distance)[density[np.arange(len(men)), men[:, 0]] > 0, 0].sum())
            for way, sign in WAYS.items():
                women = np.argsort(sign * distance.T, axis=1, kind="stable")
                wives, _ = marry(by_distance, women)
                right[way] += int((wives == np.arange(N_MARKERS)).sum())
        for way in WAYS:
            shares[way].append(100 * right[way] / (N_MARKERS * (FRAMES - 2)))
        tell((seed + 1) / effort.seeds)
    near, far = (np.array(shares[way]) for way in WAYS)
    cases = effort.seeds * (FRAMES - 2) * N_MARKERS
    claims = [
        Claim("a man's list by density begins with his nearest", "figure 5.2",
              f"{same} do not", exact(same, 0, "number that do not", cases)),
        Claim("women that rank by descending distance find the right men", "as written",
              f"{spread(far)} % right, {spread(near)} % nearest first",
              differs(-far, -near, "points of right pairs lost")),
    ]  # fmt: skip
    rows = [[way, spread(shares[way]), f"{min(shares[way]):.2f}"] for way in WAYS]
    head = ["the women's lists", "% of the pairs right", "worst seed"]
    return Outcome(
        claims=claims,
        tables=[Table(f"{N_MARKERS} markers that walk at random, drawn to the origin", head, rows)],
        pictures=[Picture("report_preferences", CAPTION, _draw())],
    )


def _walk(seed: int) -> am.Tracks:
    return am.simulate.walk(n_markers=N_MARKERS, frames=FRAMES, seed=seed, stride=STRIDE, pull=PULL)


def _draw() -> Figure:
    tracks = np.array([[0.0, 0.0], [1.0, 0.5], [0.4, 1.2]])
    seen = np.array([[0.25, 0.3], [1.1, 0.1], [0.8, 1.1]])
    distance = np.linalg.norm(tracks[:, None] - seen[None], axis=2)
    left, right = new_panels(1, 2, width=9.5, height=3.4)
    _side(left, tracks, seen, distance, "ABC", "abc", "targets rank measurements by density")
    _side(right, seen, tracks, distance.T, "abc", "ABC", "measurements rank targets by distance")
    for axes in (left, right):
        for k in range(3):
            _circles(axes, tracks[k], CYCLE[k])
    return left.figure  # pyright: ignore[reportReturnType]


def _side(
    axes: Axes,
    who: NDArray[np.float64],
    whom: NDArray[np.float64],
    distance: NDArray[np.float64],
    names: str,
    others: str,
    title: str,
) -> None:
    """Draw who ranks whom: lines, the likest thickest, and the list beside each."""
    for i, place in enumerate(who):
        order = np.argsort(distance[i])
        colour = CYCLE[i] if names.isupper() else INK
        for rank, j in enumerate(order):
            width = 2.2 / (1 + rank) ** 1.5
            line = np.array([place, whom[j]]).T
            axes.plot(*line, color=CLUTTER, linewidth=width, alpha=0.7, zorder=0)
        axes.plot(*place, "o" if names.islower() else "s", color=colour)
        told = f"{names[i]}: " + " ".join(others[j] for j in order)
        axes.annotate(told, place, xytext=(8, 5), textcoords="offset points", color=colour)
    marker: Any = "s" if names.islower() else "o"
    axes.plot(*whom.T, marker, color=INK, linestyle="none", fillstyle="none")
    axes.set_title(title, fontsize=10, color=INK, loc="left")
    axes.set(xlim=(-0.5, 1.9), ylim=(-0.4, 1.6))
    axes.set_aspect("equal")
    axes.set_axis_off()


def _circles(axes: Axes, place: NDArray[np.float64], colour: str) -> None:
    from matplotlib.patches import Circle

    for radius in (0.2, 0.4):
        circle = Circle((float(place[0]), float(place[1])), radius, fill=False, edgecolor=colour,
                        alpha=0.35)  # fmt: skip
        axes.add_patch(circle)


CAPTION = (
    "The report's figure 5.2: how the lists arise. Squares are targets with their densities, dots "
    "measurements; the thicker the line, the better liked."
)

PART = Part(
    title="The stable marriage: the lists of preferences",
    section="§5.5",
    covers="figure 5.2",
    did="A target ranks the measurements by its predictive density, a measurement “the males by "
    "descending order of distance”.",
    run=run,
    slips=(
        "Taken literally a measurement would like the farthest target best; descending preference "
        "is meant, the nearest first. With equal numbers and complete lists the targets' "
        "proposals hide the slip as long as each target has a favourite of its own.",
    ),
)
