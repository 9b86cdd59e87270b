"""Calibration of confidence: of labels with a confidence of 90 %, nine in ten should be right."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from asterism.checks import check_array, check_number
from asterism.errors import ParameterError
from asterism.records import record

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = ["CalibrationCurve", "calibration_curve"]


@record(eq=False)
class CalibrationCurve:
    """Result of `calibration_curve`: a reliability table, its calibration error and its AUC.

    Attributes
    ----------
    edges : ndarray of shape (B + 1,)
        Edges of the bins of confidence. A bin includes its lower edge, the last bin both edges.
    counts : ndarray of int, shape (B,)
        Number of labels in each bin.
    confidence, right : ndarray of shape (B,)
        Mean confidence and share of right labels of each bin; NaN for an empty bin.
    ece : float
        Expected calibration error: mean of ``|confidence − right|`` over the labels; NaN without
        labels.
    auc : float
        Probability that a right label has a higher confidence than a wrong one, with ties counted
        half; NaN if all labels are right or all are wrong.

    Examples
    --------
    >>> calibration_curve([0.9, 0.2], [True, False], bins=2).counts
    array([1, 1])
    """

    edges: NDArray[np.float64]
    counts: NDArray[np.int64]
    confidence: NDArray[np.float64]
    right: NDArray[np.float64]
    ece: float
    auc: float

    def __str__(self) -> str:
        rows = [
            f"{low:5.2f} to {high:4.2f}  {n:9d}  {c:10.4f}  {r:7.4f}"
            for low, high, n, c, r in zip(
                self.edges[:-1], self.edges[1:], self.counts, self.confidence, self.right,
                strict=True,
            )
            if n
        ]  # fmt: skip
        head = "confidence        labels        mean    right"
        return "\n".join([head, *rows, f"ECE {self.ece:.4f}, AUC {self.auc:.4f}"])


def calibration_curve(
    confidence: ArrayLike, is_right: ArrayLike, bins: int = 10
) -> CalibrationCurve:
    """Compare confidence with the share of right labels, in bins of confidence.

    Parameters
    ----------
    confidence : array_like of shape (N,)
        Probability in [0, 1] that a label (or link) is right.
    is_right : array_like of bool, shape (N,)
        Whether the label (or link) is right.
    bins : int
        Number of bins of equal width. More bins resolve the curve finer, with fewer labels in
        each.

    Returns
    -------
    CalibrationCurve

    Raises
    ------
    ParameterError
        If the arrays do not fit each other, or a confidence is not in [0, 1].

    Examples
    --------
    >>> c = calibration_curve([0.9, 0.9, 0.9, 0.9, 0.2], [True, True, True, False, False])
    >>> round(c.ece, 3), c.auc
    (0.16, 0.75)
    """
    check_number("bins", bins, above=1, closed=True, integer=True)
    p = check_array("confidence", confidence, ("N",))
    if p.size and (p.min() < 0 or p.max() > 1):
        raise ParameterError(
            "confidence", "probabilities in [0, 1]", p.min() if p.min() < 0 else p.max()
        )
    right = check_array("is_right", is_right, (len(p),), dtype=np.bool_)

    edges = np.linspace(0.0, 1.0, bins + 1)
    bin_of = np.clip(np.searchsorted(edges, p, side="right") - 1, 0, bins - 1)
    counts = np.bincount(bin_of, minlength=bins)
    sums = (np.bincount(bin_of, weights=w, minlength=bins) for w in (p, right.astype(np.float64)))
    mean, share = (np.divide(s, counts, out=np.full(bins, np.nan), where=counts > 0) for s in sums)
    used = counts > 0
    ece = float(np.sum(counts[used] * np.abs(mean - share)[used]) / len(p)) if len(p) else math.nan
    return CalibrationCurve(
        edges=edges, counts=counts, confidence=mean, right=share, ece=ece, auc=_auc(p, right)
    )


def _auc(p: NDArray[np.float64], right: NDArray[np.bool_]) -> float:
    n_right = int(np.count_nonzero(right))
    n_wrong = len(right) - n_right
    if not n_right or not n_wrong:
        return math.nan
    _, level = np.unique(p, return_inverse=True)
    wrong_at = np.bincount(level[~right], minlength=level.max() + 1)
    below = np.cumsum(wrong_at) - wrong_at / 2
    return float(below[level[right]].sum() / (n_right * n_wrong))
