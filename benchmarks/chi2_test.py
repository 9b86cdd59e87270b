"""How many right branches the χ² test of track splitting loses, in a frame and over a life.

λ of a right branch is a faded sum of independent χ² variables; lives are drawn, and each is lost at
the first frame in which λ exceeds its limit.

    python benchmarks/chi2_test.py [--lives N] [--markdown FILE]
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from asterism.associate.track_splitting import chi2_limits
from report import publish

AT = (1, 10, 100, 1000)


def lost(alpha: float, fading: float, lives: int) -> list[list[str]]:
    """Give the share that exceeds the limit in frame k, and the share lost up to it."""
    rng = np.random.default_rng(1)
    limits = chi2_limits(alpha, 3, fading)
    total = np.zeros(lives)
    is_lost = np.zeros(lives, dtype=bool)
    now: list[str] = []
    so_far: list[str] = []
    for k in range(1, max(AT) + 1):
        total = fading * total + rng.chisquare(3, lives)
        exceeds = total > limits[min(k, len(limits)) - 1]
        is_lost |= exceeds
        if k in AT:
            now.append(f"{100 * exceeds.mean():.2f} %")
            so_far.append(f"{100 * is_lost.mean():.2f} %")
    name = f"α = {100 * alpha:g} %, ρ = {fading:g}"
    return [[name, "in this frame", *now], ["", "up to it", *so_far]]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--lives", type=int, default=200_000)
    parser.add_argument("--markdown", type=Path)
    options = parser.parse_args()
    head = ["test", "right branches beyond the limit", *(f"frame {k}" for k in AT)]
    lines = ["| " + " | ".join(head) + " |", "|---|---|" + "---:|" * len(AT)]
    for alpha, fading in ((0.01, 1.0), (0.01, 0.9), (0.01, 0.5), (1e-4, 1.0), (1e-4, 0.5)):
        lines += ["| " + " | ".join(row) + " |" for row in lost(alpha, fading, options.lives)]
    publish(lines, options.markdown)


if __name__ == "__main__":
    main()
