"""Data types of a part of the reproduction and of its results."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["Claim", "Outcome", "Part", "Table", "Timing"]


class Claim(NamedTuple):
    """Figure or statement of the report, with the measurement and the verdict of a rule.

    Attributes
    ----------
    about : str
        Subject of the claim.
    reported, measured, oracle : str
        Value of the report, measured value, and the best value that the data allow.
    reproduced : bool
        Verdict of the rule.
    rule, because : str
        Key of `RULES`, and the numbers that decided.
    """

    about: str
    reported: str
    measured: str
    oracle: str
    reproduced: bool
    rule: str
    because: str


class Table(NamedTuple):
    """Table whose first column is text and whose other columns are figures.

    Attributes
    ----------
    title : str
        Heading.
    head : sequence of str
        Names of the columns.
    rows : sequence of sequence of str
        Cells of each row.
    """

    title: str
    head: Sequence[str]
    rows: Sequence[Sequence[str]]


class Timing(NamedTuple):
    """Duration, not part of the tables because it differs from run to run.

    Attributes
    ----------
    about, reported : str
        Subject, and the value of the report.
    seconds : float
        Measured duration.
    """

    about: str
    reported: str
    seconds: float


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """Results of a part.

    Parameters
    ----------
    claims : sequence of Claim
        Claims with their verdicts.
    tables : sequence of Table
        Further tables.
    figure : Figure, Axes, sequence of Axes or None
        Figure of the part.
    timings : sequence of Timing
        Measured durations.
    """

    claims: Sequence[Claim]
    tables: Sequence[Table] = ()
    figure: Figure | Axes | Sequence[Axes] | None = None
    timings: Sequence[Timing] = ()

    @property
    def n_reproduced(self) -> str:
        """Number of reproduced claims, as "2 of 3"."""
        return f"{sum(c.reproduced for c in self.claims)} of {len(self.claims)}"


@dataclass(frozen=True, kw_only=True)
class Part:
    """Section of the report that is reproduced; text in backticks is code.

    Parameters
    ----------
    name : str
        Name of the module, of the files and of the anchor.
    title, section : str
        Heading, and the place in the report, such as "§3.1".
    covers : str
        The report's figures, tables and algorithms that are reproduced.
    summary : str
        Content of this section of the report.
    run : callable
        Function from the number of seeds, which are 0, 1, …, to an `Outcome`.
    caption : str
        Caption of the figure, if there is one.
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
