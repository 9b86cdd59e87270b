"""What a part of the reproduction states, and what its run returns."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["Claim", "Outcome", "Part", "Table", "Timing"]


class Claim(NamedTuple):
    """A figure or statement of the report, the measurement and the verdict of a rule."""

    about: str
    reported: str
    measured: str
    oracle: str
    reproduced: bool
    rule: str
    because: str


class Table(NamedTuple):
    """A table; its first column is text, the others are figures."""

    title: str
    head: Sequence[str]
    rows: Sequence[Sequence[str]]


class Timing(NamedTuple):
    """A duration; kept apart from the tables because it differs from run to run."""

    about: str
    reported: str
    seconds: float


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """Results of a part: its claims, tables, figure and timings."""

    claims: Sequence[Claim]
    tables: Sequence[Table] = ()
    figure: Figure | Axes | Sequence[Axes] | None = None
    timings: Sequence[Timing] = ()

    @property
    def n_reproduced(self) -> str:
        """Return how many of the claims were reproduced, as "2 of 3"."""
        return f"{sum(c.reproduced for c in self.claims)} of {len(self.claims)}"


@dataclass(frozen=True, kw_only=True)
class Part:
    """A piece of the report; text in backticks is code.

    Parameters
    ----------
    name : str
        Of the module, the files and the anchor.
    title, section : str
        Heading, and the place in the report, such as "§3.1".
    covers : str
        The report's figures, tables and algorithms that are reproduced.
    summary : str
        What the report did.
    run : callable
        Takes the number of seeds, which are 0, 1, …
    caption : str
        Of the figure, if there is one.
    notes, mistakes, assumptions : tuple of str
        Remarks; errors of the report; choices that the report leaves open.
    """

    name: str
    title: str
    section: str
    covers: str
    summary: str
    run: Callable[[int], Outcome]
    caption: str = ""
    notes: tuple[str, ...] = ()
    mistakes: tuple[str, ...] = ()
    assumptions: tuple[str, ...] = ()
