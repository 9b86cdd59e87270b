"""Tables of a study: one row a case, and one row a condition with confidence intervals."""

from __future__ import annotations

import csv
import io
import math
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from asterism.sweep.study import Case

__all__ = ["as_csv", "rows_of", "summarize"]

LEVEL = 0.95
"""Confidence level of the intervals."""


def rows_of(
    cases: Sequence[Case], found: Mapping[str, Mapping[str, float]], scores: Sequence[str]
) -> list[dict[str, Any]]:
    """Return one row for each case with scores: its names, the varied values, and the scores."""
    axes = dict.fromkeys(name for case in cases for name in case.varied)
    return [
        {
            "scene": case.scene, "corruption": case.corruption, "method": case.method,
            **{name: case.varied.get(name, "") for name in axes}, "seed": case.seed,
            **{score: found[case.key][score] for score in scores},
        }
        for case in cases
        if case.key in found
    ]  # fmt: skip


def summarize(rows: Sequence[Mapping[str, Any]], scores: Sequence[str]) -> list[dict[str, Any]]:
    """Return the mean of each score over the seeds of a condition, with its confidence interval.

    The interval is that of Student's t at the level `LEVEL`, NaN for a single seed. A score that is
    not finite for a seed makes mean and interval NaN.

    Parameters
    ----------
    rows : sequence of mapping
        Rows of `rows_of`.
    scores : sequence of str
        Names of the scores.

    Returns
    -------
    list of dict
        Columns of the condition, number of seeds ``n``, and for each score ``score``,
        ``score_low`` and ``score_high``.

    Examples
    --------
    >>> rows = [{"method": "gnn", "seed": k, "idf1": x} for k, x in enumerate((0.8, 0.9, 1.0))]
    >>> [round(summarize(rows, ["idf1"])[0][name], 3) for name in ("idf1", "idf1_low")]
    [0.9, 0.652]
    """
    from scipy.stats import t

    groups: dict[tuple[Any, ...], list[Mapping[str, Any]]] = {}
    names = [name for name in (rows[0] if rows else ()) if name not in ("seed", *scores)]
    for row in rows:
        groups.setdefault(tuple(row[name] for name in names), []).append(row)
    summary: list[dict[str, Any]] = []
    for condition, members in groups.items():
        made = dict(zip(names, condition, strict=True)) | {"n": len(members)}
        for score in scores:
            values = np.array([row[score] for row in members])
            n, mean = len(values), float(values.mean())
            half = math.nan
            if n > 1:
                half = float(t.ppf((1 + LEVEL) / 2, n - 1) * values.std(ddof=1) / math.sqrt(n))
            made |= {score: mean, f"{score}_low": mean - half, f"{score}_high": mean + half}
        summary.append(made)
    return summary


def as_csv(rows: Sequence[Mapping[str, Any]]) -> bytes:
    """Return rows of the same columns as CSV; numbers are written in full."""
    text = io.StringIO()
    if rows:
        writer = csv.DictWriter(text, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    return text.getvalue().encode()
