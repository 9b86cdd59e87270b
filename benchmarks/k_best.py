"""The k best assignments: time by size, beside nrl-tracker's Murty on the same matrices.

Full matrices of normal gains, every row to have a column; both in the same process, and their
totals must agree.

    python benchmarks/k_best.py [--markdown FILE]
"""

from __future__ import annotations

import argparse
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

import asterism as am
from report import best_of, conditions, publish


def peer() -> Any:
    """Give nrl-tracker's function, or None where it is not installed."""
    try:
        return import_module("pytcl.assignment_algorithms").murty
    except ImportError:
        return None


def row_of(n: int, k: int, murty: Any, seeds: int) -> list[str]:
    ours = theirs = 0.0
    for seed in range(seeds):
        gains = np.random.default_rng(seed).normal(0, 5, (n, n))
        found = am.solve.k_best_assignments(gains, k, complete=True)
        ours += best_of(5, partial(am.solve.k_best_assignments, gains, k, complete=True)) / seeds
        if murty is not None:
            assert np.allclose(np.asarray(murty(-gains, k).costs), -found.totals)
            theirs += best_of(2, partial(murty, -gains, k)) / seeds
    row = [str(n), str(k), f"{1e3 * ours:.2f}"]
    beside = ["–", "–"] if murty is None else [f"{1e3 * theirs:.1f}", f"{theirs / ours:.0f} ×"]
    return row + beside


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--markdown", type=Path)
    options = parser.parse_args()
    murty = peer()
    lines = ["| n | k | ms | nrl-tracker, ms | against it |", "|---:|---:|---:|---:|---:|"]
    for n, k in ((10, 20), (20, 20), (50, 20), (50, 100), (100, 20)):
        lines.append("| " + " | ".join(row_of(n, k, murty, options.seeds)) + " |")
    publish([*lines, "", f"{conditions()}; one core."], options.markdown)


if __name__ == "__main__":
    main()
