"""What a part of the reproduction is, and what it gives."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.figure import Figure

    from asterism.reproduction.rules import Verdict

__all__ = ["Claim", "Effort", "Made", "Outcome", "Part", "Picture", "Table", "Tell", "Timing"]

Tell = Callable[[float], object]
"""To be told which share of a part is done."""


@dataclass(frozen=True, kw_only=True)
class Effort:
    """How much is done.

    Parameters
    ----------
    seeds : int
        Of everything that is drawn, 0 to `seeds` - 1.
    is_quick : bool
        Whether sizes other than the number of seeds are small too.
    """

    seeds: int
    is_quick: bool


class Claim(NamedTuple):
    """One figure or statement of the report beside ours."""

    about: str
    theirs: str
    ours: str
    verdict: Verdict
    floor: str = "–"
    """The best that is possible with these data, where that is not the perfect answer."""


class Table(NamedTuple):
    """A table; its first column is text, the others are figures."""

    title: str
    head: Sequence[str]
    rows: Sequence[Sequence[str]]


class Picture(NamedTuple):
    """A figure with the name of its files."""

    name: str
    caption: str
    figure: Figure


class Timing(NamedTuple):
    """How long something took; kept apart, as it differs from run to run."""

    about: str
    theirs: str
    seconds: float


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """What a part found.

    Parameters
    ----------
    claims : sequence of Claim
        What the report says, and whether it is so.
    tables : sequence of Table
        What the verdicts come from.
    pictures : sequence of Picture
        The report's figures, made anew.
    notes : sequence of str
        What was found beside that; `code` in backticks.
    timings : sequence of Timing
        For the page of times.
    """

    claims: Sequence[Claim]
    tables: Sequence[Table] = ()
    pictures: Sequence[Picture] = ()
    notes: Sequence[str] = ()
    timings: Sequence[Timing] = ()


@dataclass(frozen=True, kw_only=True)
class Part:
    """A piece of the report.

    Parameters
    ----------
    title : str
        What it is about.
    section : str
        Where it stands in the report, such as "§3.1".
    covers : str
        The report's figures, tables and algorithms that are made anew here.
    did : str
        What the report did.
    run : callable
        Makes it anew; takes the effort and whom to tell how far it is.
    slips : tuple of str
        Where the report is mistaken or contradicts itself.
    chosen : tuple of str
        What was decided here because the report does not say it.
    """

    title: str
    section: str
    covers: str
    did: str
    run: Callable[[Effort, Tell], Outcome]
    slips: tuple[str, ...] = ()
    chosen: tuple[str, ...] = ()


class Made(NamedTuple):
    """A part that is finished."""

    name: str
    part: Part
    outcome: Outcome

    @property
    def counts(self) -> tuple[int, int]:
        """How many claims were reproduced, and how many there are."""
        claims = self.outcome.claims
        return sum(c.verdict.holds for c in claims), len(claims)
