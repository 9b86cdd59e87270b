"""§2.2: the χ² test of the track-splitting filter, and how often it rejects a true track."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism.app.reproduce.part import Claim, Outcome, Part, Picture, Table
from asterism.app.reproduce.rules import spread, within
from asterism.associate.track_splitting import chi2_limits
from asterism.view.style import CYCLE, GRID, INK, new_axes, tidy

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from asterism.app.reproduce.part import Effort, Tell

AT = (1, 10, 100, 1000)
N_AXES = 3
SETTINGS = ((0.01, 1.0), (0.01, 0.9), (0.01, 0.5), (1e-4, 1.0), (1e-4, 0.5))
LIVES, QUICK_LIVES = 200_000, 10_000


def run(effort: Effort, tell: Tell) -> Outcome:
    """Draw lives of right branches; each is lost at the first frame beyond its limit."""
    lives = (QUICK_LIVES if effort.is_quick else LIVES) // effort.seeds
    last = AT[-2] if effort.is_quick else AT[-1]
    at = [k for k in AT if k <= last]
    rows: list[list[str]] = []
    found: list[tuple[NDArray[np.float64], NDArray[np.float64]]] = []
    for i, (alpha, fading) in enumerate(SETTINGS):
        each = [_lost(alpha, fading, lives, last, seed) for seed in range(effort.seeds)]
        now, so_far = np.array([a for a, _ in each]), np.array([b for _, b in each])
        found.append((now, so_far))
        for what, shares in (("in this frame", now), ("up to it", so_far)):
            cells = [f"{100 * shares[:, k - 1].mean():.2f} %" for k in at]
            rows.append([f"α = {100 * alpha:g} %, ρ = {fading:g}, {what}", *cells])
        tell((i + 1) / len(SETTINGS))
    now, so_far = (100 * shares for shares in found[0])
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


def _lost(
    alpha: float, fading: float, lives: int, last: int, seed: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Give the share beyond the limit in each frame, and lost up to it, shape (last,) each."""
    rng = np.random.default_rng(seed)
    limits = chi2_limits(alpha, N_AXES, fading)
    total = np.zeros(lives)
    is_lost = np.zeros(lives, dtype=bool)
    now, so_far = np.empty((2, last))
    for k in range(last):
        total = fading * total + rng.chisquare(N_AXES, lives)
        exceeds = total > limits[min(k, len(limits) - 1)]
        is_lost |= exceeds
        now[k], so_far[k] = exceeds.mean(), is_lost.mean()
    return now, so_far


def _draw(found: list[tuple[NDArray[np.float64], NDArray[np.float64]]]) -> Figure:
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
