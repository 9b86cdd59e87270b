"""When something counts as reproduced: four rules, each decided by numbers alone."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

__all__ = ["RULES", "Verdict", "alike", "differs", "exact", "spread", "within"]

RULES = {
    "spread": "a figure of the report is that of one run. It is reproduced if it lies between the "
    "2.5 % and the 97.5 % quantile of ours over the seeds, give or take half a unit of the last "
    "digit printed if it was rounded; “all correct” was not.",
    "exact": "a statement of mathematics is reproduced if it fails in none of the cases tried, or "
    "if the greatest error stays below the one named.",
    "order": "that one thing does better than another is reproduced if their difference, seed by "
    "seed, is on that side of 0 by more than two standard errors of its mean.",
    "shape": "a distribution is reproduced if it is no farther, in total variation, from the mean "
    "of ours than 95 % of our own runs are.",
}
"""The rules, as the page states them."""

_ALMOST_ALL = (0.025, 0.975)


class Verdict(NamedTuple):
    """Whether something was reproduced, by which rule, and why."""

    holds: bool
    rule: str
    because: str

    def __str__(self) -> str:
        return f"{'reproduced' if self.holds else 'not reproduced'}, because {self.because}"


def spread(values: ArrayLike, digits: int = 2) -> str:
    """Give mean and standard deviation over the seeds as people read them."""
    found = np.asarray(values, dtype=np.float64)
    return f"{_plain(found.mean(), digits)} ± {_plain(found.std(), digits)}"


def within(theirs: float, ours: ArrayLike, *, step: float, digits: int = 2) -> Verdict:
    """Judge a figure of the report by the spread of ours.

    Parameters
    ----------
    theirs : float
        As printed.
    ours : array_like, shape (seeds,)
        Ours, one a seed.
    step : float
        One unit of the last digit printed; 0 for a figure that was not rounded.
    digits : int
        After the point, in the words.
    """
    low, high = np.quantile(np.asarray(ours, dtype=np.float64), _ALMOST_ALL)
    told = f"{_plain(low, digits)} to {_plain(high, digits)}"
    # A hair more than half a unit: 0.05 is not a binary number.
    slack = 0.5 * step * (1 + 1e-9)
    if low - slack <= theirs <= high + slack:
        return Verdict(True, "spread", f"{theirs:g} lies within ours ({told})")
    side = "above" if theirs > high else "below"
    return Verdict(False, "spread", f"{theirs:g} lies {side} ours ({told})")


def exact(error: float, limit: float, what: str, cases: int) -> Verdict:
    """Judge a statement by its greatest error; a count of failures has the limit 0."""
    holds = error <= limit
    noun = "case" if cases == 1 else "cases"
    size = f"{error:.2g}" if limit else f"{error:g}"
    return Verdict(holds, "exact", f"the {what} is {size} in {cases:,} {noun}")


def differs(better: ArrayLike, worse: ArrayLike, what: str, digits: int = 2) -> Verdict:
    """Judge that one thing has less of something than another does, seed by seed."""
    gain = np.asarray(worse, dtype=np.float64) - np.asarray(better, dtype=np.float64)
    error = gain.std(ddof=1) / np.sqrt(len(gain))
    mean = gain.mean()
    sign = "fewer" if mean >= 0 else "more"
    told = f"there are {_plain(abs(mean), digits)} {sign} {what}"
    told += f" (standard error {_plain(error, digits)})"
    return Verdict(bool(mean > 2 * error and mean > 0), "order", told)


def alike(theirs: ArrayLike, runs: ArrayLike) -> Verdict:
    """Judge a distribution by how far single runs of ours are from their mean.

    Parameters
    ----------
    theirs : array_like, shape (n,)
        Shares that add up to 1.
    runs : array_like, shape (seeds, n)
        Ours, each row likewise.
    """
    found = np.asarray(runs, dtype=np.float64)
    mean = found.mean(axis=0)
    own = float(np.quantile(0.5 * np.abs(found - mean).sum(axis=1), 0.95))
    distance = float(0.5 * np.abs(np.asarray(theirs) - mean).sum())
    told = f"it is {100 * distance:.1f} % from our mean, and 95 % of our runs are within "
    return Verdict(distance <= own, "shape", told + f"{100 * own:.1f} %")


def _plain(value: float, digits: int) -> str:
    text = f"{value:.{digits}f}"
    return text.removeprefix("-") if not float(text) else text
