"""§2.2: the χ² test of the track-splitting filter, and how often it rejects a true track."""

from __future__ import annotations

import numpy as np

from asterism.reproduction.part import Outcome, Part, Table
from asterism.reproduction.rules import within
from asterism.tracking.methods.track_splitting import chi2_limits

AT = (1, 10, 100, 1000)
ALPHA, N_AXES, N_TRACKS = 0.01, 3, 4000  # true tracks a seed


def run(seeds: int) -> Outcome:
    """Draw true tracks; each is rejected at the first frame beyond its limit."""
    limits = chi2_limits(ALPHA, N_AXES, 1.0)
    shares = np.empty((2, seeds, AT[-1]))  # in this frame, up to this frame
    for seed in range(seeds):
        rng = np.random.default_rng(seed)
        total, is_rejected = np.zeros(N_TRACKS), np.zeros(N_TRACKS, dtype=bool)
        for k in range(AT[-1]):
            total += rng.chisquare(N_AXES, N_TRACKS)
            exceeds = total > limits[min(k, len(limits) - 1)]
            is_rejected |= exceeds
            shares[:, seed, k] = 100 * exceeds.mean(), 100 * is_rejected.mean()
    single, so_far = shares
    rows = [
        [name, *(f"{of[:, k - 1].mean():.2f} %" for k in AT)]
        for name, of in (("in this frame", single), ("up to this frame", so_far))
    ]
    head = ["true tracks rejected", *(f"frame {k}" for k in AT)]
    return Outcome(
        claims=[
            within(f"true tracks rejected, {when}", 1, measured, step=1, unit=" %")
            for when, measured in (("in frame 1", single[:, 0]), ("in frame 100", single[:, 99]),
                                   ("up to frame 100", so_far[:, 99]))
        ],
        tables=[Table(f"{seeds * N_TRACKS:,} true tracks in space, α = 1 %", head, rows)],
    )  # fmt: skip


PART = Part(
    name="splitting",
    title="Track splitting: the χ² test",
    section="§2.2",
    covers="the test λ(k) ≤ δ with P[χ² > δ] = α",
    summary="A branch is kept while its modified log-likelihood stays below the χ² limit at α, "
    "“the probability that a true track will be rejected”, typically 1 %.",
    run=run,
    mistakes=(
        "α is the probability in each frame, not that of a track, which is tested in every frame.",
    ),
)
