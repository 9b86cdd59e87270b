"""Scores of the names of tracks, detection by detection."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from asterism.errors import ParameterError
from asterism.metrics.counts import check_labels, ratio
from asterism.model.marker_set import other_side
from asterism.records import record

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

__all__ = ["NameScores", "name_scores"]


@record(eq=False)
class NameScores:
    """Result of `name_scores`. All are NaN if either side has no names.

    Attributes
    ----------
    name_accuracy : float
        Share of the detections with the right name. Clutter is right if it has none.
    name_precision, name_recall, name_f1 : float
        Precision, recall and their harmonic mean for each name, then averaged over all names of
        either side. To have no name counts as one more name.
    swapped_sides_percent : float
        Share of the named detections whose name is that of the marker's partner on the other side
        of the body, as RKNE for LKNE, percent.

    Examples
    --------
    >>> name_scores([0, 1], [0, 1], ["LKNE", "RKNE"], ["RKNE", "LKNE"]).swapped_sides_percent
    100.0
    """

    name_accuracy: float
    name_precision: float
    name_recall: float
    name_f1: float
    swapped_sides_percent: float


def name_scores(
    labels: ArrayLike,
    truth_labels: ArrayLike,
    names: Sequence[str | None],
    truth_names: Sequence[str | None],
) -> NameScores:
    """Compare the names that detections were given with their true names.

    Subjects before a colon (``Ann:LKNE``) are compared only if both sides have them.

    Parameters
    ----------
    labels, truth_labels : array_like of int, shape (N,)
        Track and marker of each detection, -1 for none.
    names, truth_names : sequence of str or None
        Name of each track and of each marker, None for none.

    Returns
    -------
    NameScores

    Raises
    ------
    ParameterError
        If a label has no entry among the names, or the arrays do not fit each other.

    References
    ----------
    N. Ghorbani, M. J. Black: SOMA: solving optical marker-based mocap automatically. ICCV, 2021
    (accuracy and the averages over names).

    Examples
    --------
    >>> scores = name_scores([0, 0, 1, -1], [0, 0, 1, 1], ["LKNE", "C7"], ["LKNE", "T10"])
    >>> scores.name_accuracy, round(scores.name_f1, 4)
    (0.5, 0.25)
    """
    labels, truth_labels = check_labels(labels, truth_labels)
    for what, values, of in (("names", labels, names), ("truth_names", truth_labels, truth_names)):
        if values.size and values.max() >= len(of):
            raise ParameterError(what, f"at least {values.max() + 1} entries", len(of))
    if not any(names) or not any(truth_names):
        return NameScores(**dict.fromkeys(NameScores.__annotations__, math.nan))
    given, true = _comparable(names, truth_names)
    known = sorted(({*given} | {*true}) - {None}, key=str)
    code: dict[str | None, int] = {None: -1} | {name: i for i, name in enumerate(known)}
    found = np.array([code[name] for name in [*given, None]])[labels]
    right = np.array([code[name] for name in [*true, None]])[truth_labels]
    partners = np.array([code.get(other_side(name or "") or "", -2) for name in known] + [-2])
    is_named = found >= 0
    is_swapped = is_named & (partners[found] == right)
    precision, recall, f1 = _by_name(found, right)
    return NameScores(
        name_accuracy=ratio(int((found == right).sum()), len(found)),
        name_precision=precision,
        name_recall=recall,
        name_f1=f1,
        swapped_sides_percent=100 * ratio(int(is_swapped.sum()), int(is_named.sum())),
    )


def _comparable(
    names: Sequence[str | None], truth_names: Sequence[str | None]
) -> tuple[list[str | None], list[str | None]]:
    """Return both lists of names, without subjects unless both sides have them."""
    sides = list(names), list(truth_names)
    if all(any(name and ":" in name for name in side) for side in sides):
        return sides
    given, true = ([name and name.rpartition(":")[2] for name in side] for side in sides)
    return given, true


def _by_name(found: NDArray[np.int64], right: NDArray[np.int64]) -> tuple[float, float, float]:
    """Return precision, recall and F1 averaged over the names; one that is never right has 0."""
    n = int(max(found.max(initial=-1), right.max(initial=-1))) + 2
    hits = np.bincount(found[found == right] + 1, minlength=n)
    n_found, n_right = (np.bincount(values + 1, minlength=n) for values in (found, right))
    occurs = n_found + n_right > 0
    precision, recall = hits / np.maximum(n_found, 1), hits / np.maximum(n_right, 1)
    f1 = 2 * hits / np.maximum(n_found + n_right, 1)
    return float(precision[occurs].mean()), float(recall[occurs].mean()), float(f1[occurs].mean())
