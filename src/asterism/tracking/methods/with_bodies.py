"""What the methods share whose tracks carry each other through gaps: bodies, learnt as they go.

Which tracks keep their distances is learnt while they are seen. One that is hidden is expected
where its neighbours carry it, and neighbours have a say in who takes which point. The loop is in
the engine (tracks/carried_tracks.hpp; over several open frames trees/window_carrier.hpp); none of
it is there where `bodies` is off.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from asterism.checks import check_number
from asterism.errors import ParameterError
from asterism.records import record
from asterism.tracking.methods.frame_by_frame import FrameByFrame

if TYPE_CHECKING:
    from asterism import _engine

__all__ = ["WithBodies"]


@record
class WithBodies(FrameByFrame):
    """Options of the methods whose hidden tracks are carried by their neighbours.

    Parameters
    ----------
    bodies : bool
        Whether markers that keep their distances help each other: a hidden one is expected where
        its neighbours carry it, for as long as they do, beyond d̄ too; and its points are doubted
        that disagree with them.
    max_carried : int
        With `bodies`, so many frames of hiding may be carried, 1 to 100000; then d̄ is left.
    bond_weight : float
        With `bodies`, what bonds say of a pairing that is in doubt lies within ± so many nats, 0 to
        100. 0: they only carry.
    gate_probability, confirm_probability, delete_odds : float
        See `FrameByFrame`.
    """

    bodies: bool = False
    max_carried: int = 60
    bond_weight: float = 2.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if not isinstance(self.bodies, bool):  # pyright: ignore[reportUnnecessaryIsInstance]
            raise ParameterError("bodies", "True or False", repr(self.bodies))
        check_number(
            "max_carried", self.max_carried, above=1, below=100_000, closed=True, integer=True
        )
        check_number("bond_weight", self.bond_weight, above=0, below=100, closed=True)
        for name in ("max_carried", "bond_weight"):
            usual, given = getattr(WithBodies, name), getattr(self, name)
            if not self.bodies and given != usual:
                hint = "it has no effect without bodies"
                raise ParameterError(name, "bodies=True beside it", f"{given} alone", hint)

    def _carry(self) -> _engine.CarryOptions:
        """Make the engine's options."""
        from asterism import _engine

        return _engine.CarryOptions(
            is_on=self.bodies,
            max_carried=int(self.max_carried),
            bond_weight=float(self.bond_weight),
        )

    def _about(self, stats: _engine.FrameStats) -> dict[str, float]:
        told = super()._about(stats)
        if self.bodies:
            told |= {
                "bonds": stats.n_bonds,
                "carried": stats.n_carried,
                "returned": stats.n_returned,
                "refused": stats.n_refused,
            }
        return told
