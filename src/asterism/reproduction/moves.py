"""§4.2: the moves, the shares of equation 4.7, and the posterior as the report counts it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

import asterism as am
from asterism.plot.style import CLUTTER, CYCLE, INK, new_panels
from asterism.reproduction.part import Claim, Outcome, Part, Picture, Table
from asterism.reproduction.rules import exact, spread
from asterism.reproduction.walks import clips
from asterism.tracking.methods.mcmc_moves import MOVES, WEIGHTS

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from asterism.reproduction.part import Effort, Tell

# Equation 4.7: the bound, the move and its share in thirtieths, as printed.
EQUATION = (
    (0.033, "birth", 1), (0.066, "death", 1), (0.133, "split", 2), (0.2, "merge", 2),
    (0.5, "extension", 9), (0.666, "reduction", 5), (0.833, "switch", 5), (1.0, "update", 5),
)  # fmt: skip
LAST_DIGIT = 1e-3
PER, COUNT = 8.8, 1000
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


def run(effort: Effort, tell: Tell) -> Outcome:
    """Check the shares and walk with them; count which moves are taken."""
    printed = np.cumsum([share for _, _, share in EQUATION]) / 30
    off = float(max(abs(a - b) for a, (b, _, _) in zip(printed, EQUATION, strict=True)))
    ours = WEIGHTS["report"]
    unlike = sum(ours[name] != share for _, name, share in EQUATION)
    total = sum(share for _, _, share in EQUATION)
    taken: dict[str, list[float]] = {name: [] for _, name, _ in EQUATION}
    some = clips(effort.seeds, max_gap=2)
    method = am.MCMCDA.report_2010(moves=COUNT / PER, acceptance="metropolis")
    for i, clip in enumerate(some):
        tracks = am.track(clip.truth.detections, method, model=clip.model, seed=clip.seed)
        for name, shares in taken.items():
            shares.append(100 * tracks.info[f"accepted_{name}"])
        tell((i + 1) / len(some))
    claims = [
        Claim("the bounds of equation 4.7 are the sums of its shares", "an identity",
              f"off by {off:.1e}",
              exact(off, LAST_DIGIT, "greatest difference", len(EQUATION))),
        Claim("its shares add up to 1", "an identity", f"{total} / 30",
              exact(abs(total - 30), 0, "difference in thirtieths", 1)),
        Claim("`move_weights=\"report\"` has these shares", "equation 4.7", f"{unlike} differ",
              exact(unlike, 0, "number that differ", len(EQUATION))),
    ]  # fmt: skip
    rows = [[name, f"{share} / 30", spread(taken[name])] for _, name, share in EQUATION]
    return Outcome(
        claims=claims,
        tables=[Table(f"The report's cube, d̄ = 2, N_mc = {COUNT}, true Metropolis",
                      ["move", "share of the draws", "accepted, % of those drawn"], rows)],
        pictures=[Picture("report_moves", CAPTION, _draw())],
        notes=(
            f"Beside the report's eight, Asterism has {', '.join(MOVES[len(EQUATION):])}. That the "
            "chain visits partitions as often as the posterior has them is tested against "
            "enumeration (`tests/tools/measure_chain.py`).",
        ),
    )  # fmt: skip


def _draw() -> Figure:
    panels = new_panels(2, len(PANELS), width=12.0, height=3.2)
    for k, (name, (before, after)) in enumerate(PANELS.items()):
        _tracks(panels[k], before)
        _tracks(panels[len(PANELS) + k], after)
        panels[k].set_title(name, fontsize=10, color=INK)
        panels[k].annotate(
            "", (0.5, -0.2), (0.5, 0.0), xycoords="axes fraction",
            arrowprops={"arrowstyle": "->" if name == "update" else "<->", "color": CLUTTER},
        )  # fmt: skip
    return panels[0].figure  # pyright: ignore[reportReturnType]


def _tracks(axes: Axes, tracks: tuple[tuple[tuple[int, int], ...], ...]) -> None:
    dots = np.array([(t, y) for t in range(6) for y in range(3)], dtype=float)
    lift = 0.12 * np.sin(1.3 * dots[:, 0] + dots[:, 1])  # no measurement lies on a ruler
    axes.plot(dots[:, 0], dots[:, 1] + lift, "o", color=CLUTTER, markersize=3, linestyle="none")
    for track, colour in zip(tracks, CYCLE, strict=False):
        path = np.array(track, dtype=float)
        path[:, 1] += 0.12 * np.sin(1.3 * path[:, 0] + path[:, 1])
        axes.plot(*path.T, "o-", color=colour, markersize=4.5, linewidth=1.6)
    axes.set(xlim=(-0.5, 5.5), ylim=(-0.6, 2.6))
    axes.set_axis_off()


CAPTION = (
    "The report's figure 4.1: its moves, before (above) and after (below). Where the arrow has two "
    "heads the second name is the way back; a switch is its own."
)

PART = Part(
    title="MCMCDA: the moves",
    section="§4.2",
    covers="figure 4.1 and equation 4.7",
    did="Eight kinds of moves propose a new partition; their shares are shaped for motion capture.",
    run=run,
    slips=(
        "The list of moves numbers update 7 and switch 8, equation 4.7 the other way round; both "
        "have the same share.",
        "Left as they are, shares that change with the number of tracks have to enter the "
        "acceptance ratio; here a move that is not feasible leaves the chain where it is, and the "
        "shares stay.",
    ),
)
