"""Decision of the tracking that may be wrong, with its probability and its alternatives."""

from __future__ import annotations

from typing import Literal

from asterism.records import record

__all__ = ["Alternative", "Decision", "DecisionKind"]

DecisionKind = Literal["identity", "join", "cut", "ghost", "fill", "name"]


@record
class Alternative:
    """What else may be true.

    Parameters
    ----------
    track : int, optional
        Track whose marker it may be; None for a marker that no other track holds.
    probability : float
        Probability in [0, 1].
    name : str
        Marker name, for a decision about a name.

    Examples
    --------
    >>> Alternative(track=3, probability=0.2)
    Alternative(track=3, probability=0.2)
    """

    track: int | None
    probability: float
    name: str = ""


@record
class Decision:
    """Something that the tracking decided.

    Parameters
    ----------
    kind : {"identity", "join", "cut", "ghost", "fill", "name"}
        ``identity``: the detections from `first` to `last` are of the marker that holds most of
        the track; ``join``: stitching joined the tracklets that end at `first` and begin at
        `last`; ``cut``: stitching parted a track between `first` and `last`; ``ghost``: the
        detections from `first` to `last` are a ghost; ``fill``: a gap was filled; ``name``: the
        track has that name.
    track : int
        Track that it concerns, -1 for a ghost.
    first, last : int
        First and last frame.
    n_detections : int
        Number of detections that are wrong if the decision is; 0 for joins and cuts, whose effect
        is in the identities.
    probability : float, optional
        Probability in [0, 1] that the decision is right; None if it was not estimated.
    alternatives : tuple of Alternative
        The most probable alternatives, by falling probability.
    name : str
        Name of the marker, for a name.

    Examples
    --------
    >>> Decision(kind="identity", track=4, first=10, last=30, n_detections=20, probability=0.5)
    Decision(identity of track 4, frames 10 to 30: 0.500)
    """

    kind: DecisionKind
    track: int
    first: int
    last: int
    n_detections: int
    probability: float | None = None
    alternatives: tuple[Alternative, ...] = ()
    name: str = ""

    @property
    def expected_wrong(self) -> float:
        """Expected number of wrong detections, 0 for an unknown probability."""
        return 0.0 if self.probability is None else (1 - self.probability) * self.n_detections

    def __repr__(self) -> str:
        probability = "" if self.probability is None else f": {self.probability:.3f}"
        frames = f"frames {self.first} to {self.last}"
        return f"Decision({self.kind} of track {self.track}, {frames}{probability})"
