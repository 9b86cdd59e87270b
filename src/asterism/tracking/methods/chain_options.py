"""How the chain of Markov chain Monte Carlo data association draws and weighs its moves.

The defaults are what measured best; the other choices are those of the 2010 report.
"""

from __future__ import annotations

from collections.abc import Mapping  # noqa: TC003 - options are read off the annotations
from typing import Literal

from asterism.checks import check_fields, check_number
from asterism.errors import ParameterError
from asterism.records import record
from asterism.tracking.methods.mcmc_moves import checked_weights
from asterism.tracking.methods.options import check_flags

__all__ = ["ChainOptions"]


@record
class ChainOptions:
    """The rules of a walk over partitions.

    Parameters
    ----------
    proposal : {"informed", "uniform"}
        How moves lengthen a track: detections drawn by what they add to the score, or all alike
        with a fixed probability to stop, as in the report.
    move_weights : {"uniform", "report"} or mapping
        How often each kind of move is drawn: all alike, by equation 4.7 of the report (whose eight
        these are), or weights by kind.
    ambiguous_share : float
        Share of the moves that are drawn at the ambiguous links, where two tracks change what they
        have; 0 for none, as in the report.
    ambiguous_within : float
        Nats. A link that is less plausible by more is not ambiguous.
    acceptance : {"metropolis", "ascent"}
        The report draws from the best partition so far and weighs against the last one taken
        ("ascent"): that climbs and does not sample.
    first_rules : bool
        The report's: nothing but births while there is no track, and neither merge nor switch while
        there is one.
    assignment : bool
        Whether the walk begins at the exact assignment of a new frame; otherwise its detections are
        in no track at first, as in the report.
    groups : {"likelihood", "clusters", "cells", "whole"}
        What is walked over apart: tracks and detections that no plausible link joins; that are
        further than `distance` from each other; that are in different cells of space with that
        edge, which are shifted by half a cell in every other frame; or nothing.
    distance : float, optional
        Metres; for "clusters" and "cells" alone.
    bonds : {0, 2, 3, 4}
        Tracks that were seen in every frame of the window, so many of which kept their distances
        two by two, are certain: the walk leaves them as they are. 0 for none.
    bond_tolerance : float, optional
        Metres by which a distance that is kept may vary; by default 6√2 times the noise.
    """

    proposal: Literal["informed", "uniform"] = "informed"
    move_weights: Literal["uniform", "report"] | Mapping[str, float] = "uniform"
    ambiguous_share: float = 0.5
    ambiguous_within: float = 10.0
    acceptance: Literal["metropolis", "ascent"] = "metropolis"
    first_rules: bool = False
    assignment: bool = True
    groups: Literal["likelihood", "clusters", "cells", "whole"] = "likelihood"
    distance: float | None = None
    bonds: Literal[0, 2, 3, 4] = 0
    bond_tolerance: float | None = None

    def __post_init__(self) -> None:
        for name, choices in (
            ("proposal", ("informed", "uniform")),
            ("acceptance", ("metropolis", "ascent")),
            ("groups", ("likelihood", "clusters", "cells", "whole")),
        ):
            check_fields(f"chain.{name}", [getattr(self, name)], choices)
        checked_weights(self.move_weights)
        check_number(
            "chain.ambiguous_share", self.ambiguous_share, above=0, below=0.99, closed=True
        )
        check_number("chain.ambiguous_within", self.ambiguous_within, above=0, closed=True)
        check_flags(self, "first_rules", "assignment")
        if repr(self.bonds) not in ("0", "2", "3", "4"):
            raise ParameterError("chain.bonds", "0, 2, 3 or 4", repr(self.bonds))
        if self.bond_tolerance is not None:
            check_number("chain.bond_tolerance", self.bond_tolerance, above=0)
        is_by_distance = self.groups in ("clusters", "cells")
        if self.distance is not None:
            check_number("chain.distance", self.distance, above=0)
        if is_by_distance != (self.distance is not None):
            expected = "a length in metres" if is_by_distance else "none, or groups by distance"
            raise ParameterError("chain.distance", expected, repr(self.distance))
        if self.acceptance == "ascent" and self.ambiguous_share > 0:
            hint = "only the metropolis chain samples"
            name = "chain.ambiguous_share"
            raise ParameterError(name, "0 with the ascent", self.ambiguous_share, hint)
