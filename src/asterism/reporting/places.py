"""Places of a result that need a look: uncertain identities and names, one entry a cause."""

from __future__ import annotations

from typing import TYPE_CHECKING

from asterism.records import record

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from asterism.model import Decision, Tracks

__all__ = ["Place", "places_of"]

UNCERTAIN = 0.8
"""Probability of an identity or a name from which no look is needed."""
MIN_EXPECTED = 1.0
"""Smallest expected number of wrong detections of a place."""
MAX_SECONDS = 5.0
"""Longest time from the first to the last frame of a place of several decisions."""
NEAR_SECONDS = 0.5
"""Time within which uncertain parts of a track, or of two that may be exchanged, are one place."""


@record(eq=False)
class Place:
    """Uncertain decisions of one cause.

    Parameters
    ----------
    decisions : tuple of Decision
        Decisions, by falling expected number of wrong detections.

    Examples
    --------
    >>> from asterism.model import Decision
    >>> part = Decision(
    ...     kind="identity", track=4, first=10, last=30, n_detections=20, probability=0.5
    ... )
    >>> Place(decisions=(part,))
    Place(track 4, frames 10 to 30, 10.0 wrong detections expected)
    """

    decisions: tuple[Decision, ...]

    @property
    def first(self) -> int:
        """First frame."""
        return min(each.first for each in self.decisions)

    @property
    def last(self) -> int:
        """Last frame."""
        return max(each.last for each in self.decisions)

    @property
    def tracks(self) -> tuple[int, ...]:
        """Tracks with uncertain decisions, those with the most expected wrong detections first."""
        return tuple(dict.fromkeys(each.track for each in self.decisions))

    @property
    def expected_wrong(self) -> float:
        """Expected number of wrong detections."""
        return sum(each.expected_wrong for each in self.decisions)

    def __repr__(self) -> str:
        tracks = "tracks " * (len(self.tracks) > 1) or "track "
        return (
            f"Place({tracks}{', '.join(map(str, self.tracks))}, frames {self.first} to {self.last},"
            f" {self.expected_wrong:.1f} wrong detections expected)"
        )


def places_of(tracks: Tracks) -> tuple[Place, ...]:
    """Return the places to check, by falling expected number of wrong detections.

    Parameters
    ----------
    tracks : Tracks
        Tracks with decisions, as of `track`.

    Returns
    -------
    tuple of Place
        Identities and names of a probability below `UNCERTAIN`. Parts of one track that follow
        each other, and parts of two tracks that may be exchanged, are one place.

    Examples
    --------
    >>> import asterism as am
    >>> places_of(am.track(am.simulate.cube(frames=60, seed=1).detections))
    ()
    """
    uncertain = [
        each
        for each in tracks.decisions
        if each.probability is not None and each.probability < UNCERTAIN and each.track >= 0
    ]
    times = tracks.detections.times
    groups: list[list[Decision]] = []
    for each in sorted(uncertain, key=lambda one: (one.first, one.track)):
        for group in reversed(groups):
            span = times[each.last] - times[min(one.first for one in group)]
            if span <= MAX_SECONDS and any(_have_one_cause(one, each, times) for one in group):
                group.append(each)
                break
        else:
            groups.append([each])
    places = [
        Place(decisions=tuple(sorted(own, key=lambda each: (-each.expected_wrong, each.track))))
        for own in groups
    ]
    places = [each for each in places if each.expected_wrong >= MIN_EXPECTED]
    return tuple(sorted(places, key=lambda each: (-each.expected_wrong, each.first)))


def _have_one_cause(one: Decision, other: Decision, times: NDArray[np.float64]) -> bool:
    if times[other.first] - times[one.last] > NEAR_SECONDS:
        return False
    if one.track == other.track:
        return True
    return _may_be(one, other.track) or _may_be(other, one.track)


def _may_be(one: Decision, track: int) -> bool:
    return any(other.track == track for other in one.alternatives)
