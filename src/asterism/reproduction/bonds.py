"""§4.2: tracks that keep their distances are sure, and are not walked over."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

import asterism as am
from asterism.plot.style import CLUTTER, CYCLE, GRID, INK, new_panels, tidy
from asterism.reproduction.part import Claim, Outcome, Part, Picture, Table
from asterism.reproduction.rules import differs, exact, spread
from asterism.reproduction.walks import HEAD, NOISE, Scores, clips, our_chain, row, walked

if TYPE_CHECKING:
    from collections.abc import Callable

    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from asterism.reproduction.part import Effort, Tell

COUNT, PER, MAX_GAP = 80, 8.8, 4
BONDS = (0, 2, 3, 4)
DATA = {"nothing missing": 0.0, "10 % missing": 0.1}
CHAINS: dict[str, Callable[..., am.MCMCDA]] = {
    "the report's chain": am.MCMCDA.report_2010,
    "Asterism": partial(our_chain, groups="whole"),
}
WINDOW = 10
TOLERANCE = 6 * np.sqrt(2) * NOISE


def run(effort: Effort, tell: Tell) -> Outcome:
    """Walk with and without bonds, with every marker seen and with 10 % missing."""
    rows: list[list[str]] = []
    found: dict[tuple[str, str, int], Scores] = {}
    n_all = len(DATA) * len(CHAINS) * len(BONDS)
    for about, missing in DATA.items():
        some = clips(effort.seeds, max_gap=MAX_GAP, missing=missing)
        for chain, made in CHAINS.items():
            for bonds in BONDS:
                method = made(moves=COUNT / PER, bonds=bonds)
                found[about, chain, bonds] = walked(some, method)
                told = f"{bonds} bonds" if bonds else "no bonds"
                rows.append(row(f"{about}, {chain}, {told}", found[about, chain, bonds]))
                tell(len(found) / n_all)
    claims: list[Claim] = []
    for about in DATA:
        with_bonds, without = (found[about, "Asterism", n] for n in (2, 0))
        claims += [
            Claim(
                f"bonds spare work, {about}", "a speed-up", f"{spread(with_bonds.moves, 1)} moves "
                f"a frame instead of {spread(without.moves, 1)}",
                differs(with_bonds.moves, without.moves, "moves a frame", 1),
            ),
            Claim(
                f"… and cost nothing, {about}", "“correctly detected”",
                f"{spread(with_bonds.correct)} % correct, {spread(without.correct)} % without",
                exact(max(0.0, float((without.correct - with_bonds.correct).mean())), 0.1,
                      "mean loss in percent", effort.seeds),
            ),
        ]  # fmt: skip
    places = _three_tracks()
    kept = {pair: float(np.ptp(d[np.isfinite(d)])) <= TOLERANCE and np.isfinite(d).all()
            for pair, d in _distances(places).items()}  # fmt: skip
    claims.append(
        Claim(
            "figure 4.2: only τ_a and τ_b keep their distance", "τ_a–τ_b alone",
            ", ".join(pair for pair, is_kept in kept.items() if is_kept) or "none",
            exact(float(kept != {"τ_a–τ_b": True, "τ_a–τ_c": False, "τ_b–τ_c": False}), 0,
                  "number of pairs judged otherwise", len(kept)),
        )
    )  # fmt: skip
    return Outcome(
        claims=claims,
        tables=[Table(f"N_mc = {COUNT}, 10 % false alarms, d̄ = {MAX_GAP}", HEAD, rows)],
        pictures=[Picture("report_bonds", CAPTION, _draw(places))],
        notes=NOTES,
    )


def _three_tracks() -> NDArray[np.float64]:
    """Two ends of a stick that turns and travels and a marker of its own, shape (T, 3, 2)."""
    t = np.arange(WINDOW)
    rng = np.random.default_rng(2)
    middle = np.stack([0.06 * t, 0.25 * np.sin(0.35 * t)], axis=1)
    arm = 0.15 * np.stack([np.cos(0.9 + 0.18 * t), np.sin(0.9 + 0.18 * t)], axis=1)
    free = np.stack([0.05 + 0.055 * t, -0.3 + 0.002 * t**2 + 0.05 * np.sin(t)], axis=1)
    places: NDArray[Any] = np.stack([middle + arm, middle - arm, free], axis=1)
    places += rng.normal(0, NOISE, places.shape)
    places[WINDOW // 2, 2] = np.nan  # τ_c misses a measurement
    return places


def _distances(places: NDArray[np.float64]) -> dict[str, NDArray[Any]]:
    """Give the distance of each pair over the window."""
    return {
        f"τ_{'abc'[i]}–τ_{'abc'[j]}": np.sqrt(((places[:, i] - places[:, j]) ** 2).sum(axis=1))
        for i, j in ((0, 1), (0, 2), (1, 2))
    }


def _draw(places: NDArray[np.float64]) -> Figure:
    left, right = new_panels(1, 2, width=10.5, height=3.8)
    for k in range(3):
        left.plot(*places[:, k].T, "o-", color=CYCLE[k], markersize=4, linewidth=1.2)
        left.annotate(f"τ_{'abc'[k]}", places[-1, k], xytext=(7, -3), textcoords="offset points",
                      color=CYCLE[k], parse_math=False)  # fmt: skip
    for now in places:
        left.plot(*now[:2].T, color=CLUTTER, linewidth=0.7)
    left.set_aspect("equal", adjustable="datalim")
    left.set_title("a window of frames", fontsize=10, color=INK, loc="left")
    left.set_axis_off()
    for (pair, d), colour in zip(_distances(places).items(), CYCLE[3:], strict=False):
        kept = np.nanmax(d) - np.nanmin(d) <= TOLERANCE and np.isfinite(d).all()
        right.plot(
            d, "o-", color=colour, markersize=4, label=f"{pair}: {'kept' if kept else 'not'}"
        )
        if kept:
            right.axhspan(d.mean() - TOLERANCE / 2, d.mean() + TOLERANCE / 2, color=GRID)
    right.set_ylim(bottom=0)
    right.set_xlabel("frame", color=INK)
    right.set_title("their distances [m]", fontsize=10, color=INK, loc="left")
    right.legend(frameon=False, fontsize=8, labelcolor=INK)
    tidy(right)
    return right.figure  # pyright: ignore[reportReturnType]


CAPTION = (
    "The report's figure 4.2: τ_a and τ_b keep their distance in every frame of the window, within "
    "6√2 times the noise (grey); τ_c does not, and misses a measurement."
)
NOTES = (
    "The report proposes this and gives no figures. A track must be seen in every one of the "
    f"window's {WINDOW} frames to be sure: with 10 % missing fewer are, and less is spared.",
)

PART = Part(
    title="Bonds: tracks that keep their distances",
    section="§4.2",
    covers="figure 4.2",
    did="Proposes to take tracks that keep their distance throughout the window as sure, two, "
    "three or four bonded ones, and to leave them out of the walk.",
    run=run,
    slips=(
        "Equation 4.8 argues that a distance that was kept in a window is kept almost surely; a "
        "finite window shows no such limit.",
    ),
    chosen=("A window of ten frames; a distance is kept if it varies by no more than 6√2 σ.",),
)
