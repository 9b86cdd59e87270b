"""The stable marriage of tracks and detections (§5 of the report; Gale & Shapley 1962)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal

from asterism.associate.frame_by_frame import FrameByFrame
from asterism.errors import ParameterError

__all__ = ["SMP"]


@dataclass(frozen=True, kw_only=True)
class SMP(FrameByFrame):
    """Stable marriage: no track and detection would both rather have each other.

    Tracks (the report's men) rank the detections by their predictive density N(ŷ, S); detections
    rank the tracks by distance, nearest first. Believed tracks marry before tentative ones.
    Whoever is outside the gate is unacceptable, so numbers may differ: a track left alone is a
    missed detection, a detection left alone a new track or clutter. Ties go to the lower index.

    Parameters
    ----------
    proposers : {"tracks", "detections"}
        Who proposes, and so for whom the matching is best among the stable ones.
    gate_probability, confirm_probability, delete_odds : float
        See `FrameByFrame`.
    """

    proposers: Literal["tracks", "detections"] = "tracks"

    name: ClassVar[str] = "smp"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.proposers not in ("tracks", "detections"):
            raise ParameterError("proposers", "'tracks' or 'detections'", repr(self.proposers))

    def _engine_matcher(self) -> int:
        return 1 if self.proposers == "tracks" else 2
