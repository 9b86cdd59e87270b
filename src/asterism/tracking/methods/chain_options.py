"""Options of the Markov chain of MCMCDA: its proposals, its acceptance and its groups."""

from __future__ import annotations

from collections.abc import Mapping  # noqa: TC003 - options are read from the annotations
from typing import Literal

from asterism.checks import check_fields, check_number
from asterism.errors import ParameterError
from asterism.records import record
from asterism.tracking.methods.mcmc_moves import checked_weights
from asterism.tracking.methods.options import check_flags

__all__ = ["ChainOptions"]


@record
class ChainOptions:
    """Options of the Markov chain over partitions.

    The defaults scored best in measurements; `MCMCDA.report_2010` sets those of the 2010 report.

    Parameters
    ----------
    proposal : {"informed", "uniform"}
        Proposal distribution of moves that extend a track. "informed" draws detections by their
        gain in score; "uniform" draws all with equal probability and stops with a fixed
        probability, as in the 2010 report.
    move_weights : {"uniform", "report"} or mapping
        Relative frequency of each kind of move: equal for all kinds, by equation 4.7 of the 2010
        report (its eight kinds), or weights by kind.
    ambiguous_share : float
        Share of the moves drawn at ambiguous links, which exchange detections between two tracks,
        in [0, 0.99]. Larger values search there more often; 0 for none, as in the 2010 report.
    ambiguous_within : float
        Largest log-likelihood ratio between the alternatives of an ambiguous link, nats, ≥ 0. At
        the default of 10 an alternative is at most e¹⁰ times less likely. Larger values make more
        links ambiguous.
    acceptance : {"metropolis", "ascent"}
        Acceptance rule: "metropolis" samples the posterior. "ascent", of the 2010 report, draws
        from the best partition so far and compares with the last accepted one: it maximises and
        does not sample.
    first_rules : bool
        Whether the 2010 report's rules for the first tracks apply: only births without a track,
        and neither merge nor switch with a single track.
    assignment : bool
        Whether the chain starts from the exact assignment of a new frame to which no labels are
        given. Otherwise its detections are initially in no track, as in the 2010 report.
    groups : {"likelihood", "clusters", "cells", "whole"}
        Groups of tracks and detections with separate chains. "likelihood" separates what no
        plausible link joins; "clusters" what is farther apart than `distance`; "cells" uses cells
        of space with that edge, shifted by half a cell in every other frame; "whole" is one group.
    distance : float, optional
        Distance of "clusters", or edge of "cells", metres; None for the other groups.
    bonds : {0, 2, 3, 4}
        Number of tracks with stable mutual distances that fix each other. Tracks detected in every
        frame of the window that form such a group are not changed by the chain. 0 for none.
    bond_tolerance : float, optional
        Largest variation of a stable distance, metres, > 0; by default 6√2 times the noise, which
        is six standard deviations of a difference of two coordinates.

    Examples
    --------
    >>> import asterism as am
    >>> chain = am.tracking.ChainOptions(groups="clusters", distance=0.3)
    >>> am.MCMCDA(chain=chain).chain.groups
    'clusters'
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
            hint = "use metropolis, the only acceptance that samples the posterior"
            name = "chain.ambiguous_share"
            raise ParameterError(name, "0 with the ascent", self.ambiguous_share, hint)
