"""§2.2: the χ² test of the track-splitting filter, and how often it rejects a true track."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism.plot.style import CYCLE, GRID, INK, new_axes, tidy
from asterism.reproduction.part import Claim, Outcome, Part, Picture, Table
from asterism.reproduction.rules import spread, within
from asterism.tracking.methods.track_splitting import chi2_limits

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from asterism.reproduction.part import Effort, Tell

AT = (1, 10, 100, 1000)
N_AXES = 3
SETTINGS = ((0.01, 1.0), (0.01, 0.9), (0.01, 0.5), (1e-4, 1.0), (1e-4, 0.5))
LIVES, QUICK_LIVES = 200_000, 10_000


def run(effort: Effort, tell: Tell) -> Outcome:
    """Draw lives of right branches; each is lost at the first frame beyond its limit."""
    lives = (QUICK_LIVES if effort.is_quick else LIVES) // effort.seeds
    last = AT[-2] if effort.is_quick else AT[-1]
    at = [k for k in AT if k <= last]
    each: list[NDArray[np.float64]] = []
    for seed in range(effort.seeds):
        each.append(_lost(lives, last, seed))
        tell((seed + 1) / effort.seeds)
    found = np.stack(each, axis=2)  # (settings, now or so far, seeds, frames)
    rows: list[list[str]] = []
    for (alpha, fading), both in zip(SETTINGS, found, strict=True):
        for what, shares in zip(("in this frame", "up to it"), both, strict=True):
            cells = [f"{100 * shares[:, k - 1].mean():.2f} %" for k in at]
            rows.append([f"α = {100 * alpha:g} %, ρ = {fading:g}, {what}", *cells])
    now, so_far = 100 * found[0]
    claims = [
        Claim(f"true tracks rejected, {when}", "1 %", f"{spread(shares)} %",
              within(1, shares, step=1))
        for when, shares in (
            ("in frame 1", now[:, 0]), ("in frame 100", now[:, 99]),
            ("up to frame 100", so_far[:, 99]),
        )
    ]  # fmt: skip
    caption = (
        "Right branches that the test of §2.2 has rejected so far, by the frames that they lived; "
        "ρ = 1 is the report's, ρ < 1 lets the past fade."
    )
    head = ["right branches beyond the limit", *(f"frame {k}" for k in at)]
    about = f"{effort.seeds * lives:,} lives in space"
    return Outcome(
        claims=claims,
        tables=[Table(about, head, rows)],
        pictures=[Picture("report_splitting", caption, _draw(found))],
        notes=NOTES,
    )


def _lost(lives: int, last: int, seed: int) -> NDArray[np.float64]:
    """Give the shares beyond the limit in each frame and lost up to it, of every setting.

    Returns
    -------
    ndarray, shape (settings, 2, last)
        All settings are tried on the same lives.
    """
    rng = np.random.default_rng(seed)
    limits = [chi2_limits(alpha, N_AXES, fading) for alpha, fading in SETTINGS]
    total = np.zeros((len(SETTINGS), lives))
    is_lost = np.zeros((len(SETTINGS), lives), dtype=bool)
    shares = np.empty((len(SETTINGS), 2, last))
    for k in range(last):
        drawn = rng.chisquare(N_AXES, lives)
        for i, (_, fading) in enumerate(SETTINGS):
            total[i] = fading * total[i] + drawn
            exceeds = total[i] > limits[i][min(k, len(limits[i]) - 1)]
            is_lost[i] |= exceeds
            shares[i, :, k] = exceeds.mean(), is_lost[i].mean()
    return shares


def _draw(found: NDArray[np.float64]) -> Figure:
    axes = new_axes(height=3.8)
    for (alpha, fading), (_, so_far), colour in zip(SETTINGS, found, CYCLE, strict=False):
        shares = 100 * so_far.mean(axis=0)
        frames = np.arange(1, len(shares) + 1)
        axes.plot(frames, shares, color=colour, label=f"α = {100 * alpha:g} %, ρ = {fading:g}")
    axes.set_xscale("log")
    axes.set_xlabel("frames", color=INK)
    axes.set_ylabel("true tracks lost, %", color=INK)
    axes.grid(color=GRID, linewidth=0.8)
    axes.legend(frameon=False, fontsize=8, labelcolor=INK)
    tidy(axes)
    return axes.figure  # pyright: ignore[reportReturnType]


NOTES = (
    "α is the rate of each test. A track is tested in every frame, so over its life it is lost "
    "more often: which is why `am.TrackSplitting` has α = 1e-9 and lets the past fade.",
)

PART = Part(
    title="Track splitting: the χ² test",
    section="§2.2",
    covers="the test λ(k) ≤ δ with P[χ² > δ] = α",
    did="A branch is kept while its modified log-likelihood stays below the χ² limit at α, “the "
    "probability that a true track will be rejected”, typically 1 %.",
    run=run,
    slips=("α is the probability in each frame, not that of a track.",),
)
