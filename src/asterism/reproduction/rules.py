"""Four rules that decide by numbers whether a claim of the report is reproduced."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism.reproduction.part import Claim

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

__all__ = ["RULES", "alike", "exact", "fewer", "spread", "within"]

RULES = {
    "spread": "a figure of the report is that of one run. It is reproduced if it lies between the "
    "2.5 % and the 97.5 % quantile of the measured values over the seeds, with a tolerance of half "
    "a unit of the last digit printed if it was rounded; “all correct” was not rounded.",
    "exact": "a mathematical statement is reproduced if it fails in none of the cases tried, or "
    "if the greatest error stays below the tolerance.",
    "order": "an improvement is reproduced if the difference, seed by seed, has that sign and its "
    "mean exceeds two standard errors.",
    "shape": "a distribution is reproduced if its distance from the mean measured one, in total "
    "variation, is at most that of 95 % of the single runs.",
}
"""Text of each rule on the page."""

_QUANTILES = (0.025, 0.975)


def spread(values: ArrayLike, digits: int = 2) -> str:
    """Return mean and standard deviation over the seeds as text."""
    found = np.asarray(values, dtype=np.float64)
    return f"{_plain(found.mean(), digits)} ± {_plain(found.std(), digits)}"


def within(
    about: str,
    reported: float,
    measured: ArrayLike,
    *,
    step: float,
    sign: str = "",
    unit: str = "",
    digits: int = 2,
    oracle: ArrayLike | None = None,
) -> Claim:
    """Judge a figure of the report by the spread of the measured values.

    Parameters
    ----------
    about : str
        Subject of the figure.
    reported : float
        Printed figure.
    measured, oracle : array_like of shape (seeds,)
        One value per seed; those of the oracle are the best that the data allow.
    step : float
        One unit of the last printed digit; 0 for a figure that was not rounded.
    sign : str
        Text before the report's figure, such as "~".
    unit : str
        Text after each figure.
    digits : int
        Decimals in the text.

    Returns
    -------
    Claim
        Claim with the verdict of the rule "spread".
    """
    low, high = np.quantile(np.asarray(measured, dtype=np.float64), _QUANTILES)
    # Slightly more than half a unit: 0.05 has no exact binary form.
    slack = 0.5 * step * (1 + 1e-9)
    is_within = bool(low - slack <= reported <= high + slack)
    side = "within" if is_within else "above" if reported > high else "below"
    because = f"{reported:g} lies {side} {_plain(low, digits)} to {_plain(high, digits)}"
    best = "–" if oracle is None else spread(oracle, digits) + unit
    return Claim(about, f"{sign}{reported:g}{unit}", spread(measured, digits) + unit, best,
                 is_within, "spread", because)  # fmt: skip


def exact(
    about: str, reported: str, error: float, what: str, cases: int, limit: float = 0.0
) -> Claim:
    """Judge a statement by its greatest error; a count of failures has the limit 0."""
    size = f"{error:.2g}" if limit else f"{error:g}"
    because = f"the {what} is {size} in {cases:,} {'case' if cases == 1 else 'cases'}"
    return Claim(about, reported, size, "–", bool(error <= limit), "exact", because)


def fewer(
    about: str, reported: str, few: ArrayLike, many: ArrayLike, what: str, digits: int = 2
) -> Claim:
    """Judge that one variant has less of something than another, seed by seed."""
    change = np.asarray(few, dtype=np.float64) - np.asarray(many, dtype=np.float64)
    mean, error = change.mean(), change.std(ddof=1) / np.sqrt(len(change))
    measured = f"{spread(few, digits)} instead of {spread(many, digits)} {what}"
    because = f"the mean difference is {_plain(mean, digits)} "
    because += f"(standard error {_plain(error, digits)})"
    return Claim(about, reported, measured, "–", bool(mean < -2 * error and mean < 0), "order",
                 because.replace(" -", " −"))  # fmt: skip


def alike(about: str, reported: ArrayLike, runs: ArrayLike) -> Claim:
    """Judge a distribution by the distance of single runs from their mean.

    Parameters
    ----------
    about : str
        Subject of the distribution.
    reported : array_like of shape (n,)
        Printed shares, which sum to 1.
    runs : array_like of shape (seeds, n)
        Measured shares, one row per seed.

    Returns
    -------
    Claim
        Claim with the verdict of the rule "shape".
    """
    printed, found = np.asarray(reported), np.asarray(runs, dtype=np.float64)
    mean = found.mean(axis=0)
    limit = float(np.quantile(0.5 * np.abs(found - mean).sum(axis=1), 0.95))
    distance = float(0.5 * np.abs(printed - mean).sum())
    because = f"the distance is {100 * distance:.1f} %, that of 95 % of the runs at most "
    because += f"{100 * limit:.1f} %"
    before = ", ".join(f"{100 * x:g}" for x in printed) + " %"
    measured = ", ".join(f"{100 * x:.1f}" for x in mean) + " %"
    return Claim(about, before, measured, "–", distance <= limit, "shape", because)


def _plain(value: float, digits: int) -> str:
    text = f"{value:.{digits}f}"
    return text.removeprefix("-") if not float(text) else text
