"""§4.2: the moves, and the shares of equation 4.7."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from asterism.plot.style import CLUTTER, CYCLE, INK, new_panels
from asterism.reproduction.part import Outcome, Part, Table
from asterism.reproduction.rules import exact
from asterism.tracking.methods.mcmc_moves import MOVES, WEIGHTS

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Equation 4.7: the bound, the move and its share in thirtieths, as printed.
EQUATION = (
    (0.033, "birth", 1), (0.066, "death", 1), (0.133, "split", 2), (0.2, "merge", 2),
    (0.5, "extension", 9), (0.666, "reduction", 5), (0.833, "switch", 5), (1.0, "update", 5),
)  # fmt: skip
LAST_DIGIT = 1e-3
# Figure 4.1: six frames of three rows of dots; tracks as (frame, row), before and after.
_TOP = tuple((t, 2) for t in range(6))
_LOW = tuple((t, 0) for t in range(6))
PANELS: dict[str, tuple[tuple[Any, ...], tuple[Any, ...]]] = {
    "birth / death": ((_TOP,), (_TOP, _LOW)),
    "split / merge": ((_TOP, _LOW), (_TOP[:3], _TOP[3:], _LOW)),
    "extension / reduction": ((_TOP[:3], _LOW), (_TOP, _LOW)),
    "update": ((_TOP,), ((*_TOP[:3], (3, 1), (4, 1), (5, 1)),)),
    "switch": ((_TOP, _LOW), ((*_TOP[:3], *_LOW[3:]), (*_LOW[:3], *_TOP[3:]))),
}


def run(seeds: int) -> Outcome:
    """Check the shares; nothing is drawn at random, so the number of seeds has no effect."""
    del seeds
    bounds, names, shares = zip(*EQUATION, strict=True)
    off = float(np.abs(np.cumsum(shares) / 30 - bounds).max())
    different = sum(WEIGHTS["report"][name] != share for _, name, share in EQUATION)
    claims = [
        exact("the bounds of equation 4.7 are the sums of its shares", "an identity", off,
              "greatest difference", len(EQUATION), LAST_DIGIT),
        exact("the shares of equation 4.7 add up to 1", "an identity", abs(sum(shares) - 30),
              "difference in thirtieths", 1),
        exact('`move_weights="report"` has these shares', "equation 4.7", different,
              "number that differ", len(EQUATION)),
    ]  # fmt: skip
    rows = [[name, f"{share} / 30"] for name, share in zip(names, shares, strict=True)]
    tables = [Table("Equation 4.7", ["move", "share"], rows)]
    return Outcome(claims=claims, tables=tables, figure=_draw())


def _draw() -> list[Axes]:
    panels = new_panels(2, len(PANELS), width=12.0, height=3.2)
    for k, (name, (before, after)) in enumerate(PANELS.items()):
        _draw_tracks(panels[k], before)
        _draw_tracks(panels[len(PANELS) + k], after)
        panels[k].set_title(name, fontsize=10, color=INK)
        panels[k].annotate(
            "", (0.5, -0.2), (0.5, 0.0), xycoords="axes fraction",
            arrowprops={"arrowstyle": "->" if name == "update" else "<->", "color": CLUTTER},
        )  # fmt: skip
    return panels


def _draw_tracks(axes: Axes, tracks: tuple[tuple[tuple[int, int], ...], ...]) -> None:
    dots = [(t, y) for t in range(6) for y in range(3)]
    axes.plot(*_waved(dots), "o", color=CLUTTER, markersize=3, linestyle="none")
    for track, colour in zip(tracks, CYCLE, strict=False):
        axes.plot(*_waved(track), "o-", color=colour, markersize=4.5, linewidth=1.6)
    axes.set(xlim=(-0.5, 5.5), ylim=(-0.6, 2.6))
    axes.set_axis_off()


def _waved(dots: Any) -> Any:
    """Return x and y of dots that deviate a little from straight rows."""
    t, y = np.array(dots, dtype=float).T
    return t, y + 0.12 * np.sin(1.3 * t + y)


PART = Part(
    name="moves",
    title="MCMCDA: the moves",
    section="§4.2",
    covers="figure 4.1 and equation 4.7",
    summary="Eight kinds of moves propose a new partition; their shares are shaped for motion "
    "capture.",
    run=run,
    caption="The report's figure 4.1: its moves, before (above) and after (below). Where the arrow "
    "has two heads the second name is the reverse move; a switch is its own reverse.",
    notes=(
        f"Beside the report's eight, Asterism has {', '.join(MOVES[len(EQUATION) :])}. That the "
        "chain visits partitions with the frequencies of the posterior is tested against "
        "enumeration (`tests/tools/measure_chain.py`).",
    ),
    mistakes=(
        "The list of moves numbers update 7 and switch 8, equation 4.7 the other way round; both "
        "have the same share.",
        "Shares that change with the number of tracks would have to enter the acceptance ratio; "
        "here the shares are constant, and an infeasible move leaves the partition as it is.",
    ),
)
