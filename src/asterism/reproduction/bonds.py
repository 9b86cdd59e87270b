"""§4.2: tracks with a bond are sure, and the chain leaves them out."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING, Any

import numpy as np

import asterism as am
from asterism.plot.style import CLUTTER, CYCLE, GRID, INK, tidy
from asterism.reproduction.drawing import titled_panels
from asterism.reproduction.part import Claim, Outcome, Part, Table
from asterism.reproduction.rules import exact, fewer
from asterism.reproduction.scores import NOISE, PER, compare, cubes, own_chain, score_table

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

COUNT, MAX_GAP = 80, 4
BONDS = {"no bonds": 0, "2 bonds": 2, "3 bonds": 3, "4 bonds": 4}
DATA = {"nothing missing": 0.0, "10 % missing": 0.1}
WINDOW = 10
TOLERANCE = 6 * np.sqrt(2) * NOISE


def run(seeds: int) -> Outcome:
    """Track with and without bonds, with every marker seen and with 10 % missing."""
    claims: list[Claim] = []
    tables: list[Table] = []
    moves = COUNT / PER
    methods = {
        "the report's chain, no bonds": am.MCMCDA.report_2010(moves=moves),
        "the report's chain, 2 bonds": am.MCMCDA.report_2010(moves=moves, bonds=2),
        **{f"Asterism, {name}": own_chain(moves=moves, bonds=n) for name, n in BONDS.items()},
    }
    for data, missing in DATA.items():
        found = compare(cubes(seeds, max_gap=MAX_GAP, missing=missing), methods)
        bonded, free = (found[f"Asterism, {name}"] for name in ("2 bonds", "no bonds"))
        loss = max(0.0, float((free.correct - bonded.correct).mean()))
        claims += [
            fewer(f"bonds save moves, {data}", "a speed-up", bonded.moves, free.moves,
                  "moves a frame", 1),
            exact(f"bonds lose no correct association, {data}", "“correctly detected”", loss,
                  "mean loss in percent correct", seeds, 0.1),
        ]  # fmt: skip
        title = f"{data}, N_mc = {COUNT}, 10 % false alarms, d̄ = {MAX_GAP}"
        tables.append(score_table(title, found))
    places = _three_tracks()
    kept = [pair for pair, distance in _distances(places).items() if _is_kept(distance)]
    wrong = len({"τ_a–τ_b"} ^ set(kept))
    claims.append(
        exact("figure 4.2: only τ_a and τ_b have a bond", "τ_a–τ_b alone", wrong,
              "number of pairs judged otherwise", 3)
    )  # fmt: skip
    return Outcome(claims=claims, tables=tables, figure=_draw(places))


def _three_tracks() -> NDArray[np.float64]:
    """Return two ends of a stick that turns and travels, and a third marker, shape (T, 3, 2)."""
    t = np.arange(WINDOW)
    rng = np.random.default_rng(2)
    middle = np.stack([0.06 * t, 0.25 * np.sin(0.35 * t)], axis=1)
    arm = 0.15 * np.stack([np.cos(0.9 + 0.18 * t), np.sin(0.9 + 0.18 * t)], axis=1)
    free = np.stack([0.05 + 0.055 * t, -0.3 + 0.002 * t**2 + 0.05 * np.sin(t)], axis=1)
    places: NDArray[Any] = np.stack([middle + arm, middle - arm, free], axis=1)
    places += rng.normal(0, NOISE, places.shape)
    places[WINDOW // 2, 2] = np.nan  # τ_c misses a measurement
    return places


def _distances(places: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
    """Return the distance of each pair over the window."""
    return {
        f"τ_{'abc'[i]}–τ_{'abc'[j]}": np.linalg.norm(places[:, i] - places[:, j], axis=1)
        for i, j in itertools.combinations(range(3), 2)
    }


def _is_kept(distance: NDArray[np.float64]) -> bool:
    return bool(np.ptp(distance) <= TOLERANCE)  # False with a missing measurement


def _draw(places: NDArray[np.float64]) -> list[Axes]:
    panels = titled_panels("a window of frames", "distances [m]", width=10.5, height=3.8)
    left, right = panels
    for k in range(3):
        left.plot(*places[:, k].T, "o-", color=CYCLE[k], markersize=4, linewidth=1.2)
        left.annotate(f"τ_{'abc'[k]}", places[-1, k], xytext=(7, -3), textcoords="offset points",
                      color=CYCLE[k], parse_math=False)  # fmt: skip
    for now in places:
        left.plot(*now[:2].T, color=CLUTTER, linewidth=0.7)
    left.set_aspect("equal", adjustable="datalim")
    left.set_axis_off()
    for (pair, d), colour in zip(_distances(places).items(), CYCLE[3:], strict=False):
        label = f"{pair}: {'a bond' if _is_kept(d) else 'none'}"
        right.plot(d, "o-", color=colour, markersize=4, label=label)
        if _is_kept(d):
            right.axhspan(d.mean() - TOLERANCE / 2, d.mean() + TOLERANCE / 2, color=GRID)
    right.set_ylim(bottom=0)
    right.set_xlabel("frame", color=INK)
    right.legend(frameon=False, fontsize=8, labelcolor=INK)
    tidy(right)
    return panels


PART = Part(
    name="bonds",
    title="Bonds: tracks that keep their distances",
    section="§4.2",
    covers="figure 4.2",
    summary="Proposes to take tracks that keep their distance throughout the window as sure, two, "
    "three or four bonded ones, and to exclude them from the moves.",
    run=run,
    caption="The report's figure 4.2: τ_a and τ_b keep their distance in every frame of the "
    "window, within 6√2 times the noise (grey); τ_c does not, and misses a measurement.",
    notes=(
        "The report proposes this and gives no figures. A track must be detected in each of the "
        f"window's {WINDOW} frames to be sure. With 10 % missing fewer tracks are, and fewer moves "
        "are saved; with the report's own chain and 80 moves a frame, none.",
    ),
    mistakes=(
        "Equation 4.8 argues that a distance that was kept in a window is kept almost surely; a "
        "finite window shows no such limit.",
    ),
    assumptions=("A window of ten frames; a distance is kept if it varies by no more than 6√2 σ.",),
)
