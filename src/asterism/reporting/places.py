"""Places of a result that need a look: uncertain identities and names, one entry a cause."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism.model import Decision
from asterism.records import record

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from asterism.model import Tracks

__all__ = ["Place", "places_of"]

UNCERTAIN, UNCERTAIN_NAME = 0.9, 0.8
"""Probabilities of an identity or a join, and of a name, from which they are not listed."""
MIN_EXPECTED = 0.8
"""Smallest expected number of wrong detections of a place: less than one, so that a single
detection that is almost surely wrong is one."""
OWN_PLACE = 0.7
"""Probability below which an identity or a join is a place of its own. Other uncertain ones are
added to the nearest place."""
NEAR_SECONDS = 0.5
"""Time within which uncertain parts of a track, or of two that may be exchanged, are one place, and
within which less uncertain ones are added to a place."""
MAX_SECONDS = 5.0
"""Longest time from the first to the last frame of a place whose parts follow each other."""
SHARED = 0.5
"""Smallest shared time of two long parts of one place, relative to the time of both together."""


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
        Tracks with decisions, as of `track`. Without decisions about identities, as of a file, the
        identity confidence is used, and the places have no alternatives.

    Returns
    -------
    tuple of Place
        Identities and joins of a probability below 0.9, and names below 0.8. One place are parts of
        one track that follow each other, parts of two tracks that may be exchanged, and long parts
        of several tracks at one time, as of a subject that walks out and in again. A place has a
        name, or a part or join with a probability below 0.7, and at least 0.8 expected wrong
        detections. Other uncertain parts are in the nearest place within half a second.

    Examples
    --------
    >>> import asterism as am
    >>> places_of(am.track(am.simulate.cube(frames=60, seed=1).detections))
    ()
    """
    decisions = tracks.decisions
    if all(each.kind != "identity" for each in decisions):
        decisions += tuple(_of_confidence(tracks))
    uncertain = [
        each
        for each in decisions
        if each.probability is not None
        and each.probability < (UNCERTAIN_NAME if each.kind == "name" else UNCERTAIN)
        and each.track >= 0
    ]
    times = tracks.detections.times
    groups: list[list[Decision]] = []
    near: list[list[Decision]] = []
    for each in sorted(uncertain, key=lambda one: (_begin(one), one.track)):
        begin = times[_begin(each)]
        near = [
            group for group in near if begin - times[max(one.last for one in group)] <= NEAR_SECONDS
        ]
        for group in reversed(near):
            span = times[each.last] - times[min(_begin(one) for one in group)]
            if (span <= MAX_SECONDS or _are_together(group[0], each, times)) and any(
                _have_one_cause(one, each, times) for one in group
            ):
                group.append(each)
                break
        else:
            groups.append([each])
            near.append(groups[-1])
    places = _with_rest([Place(decisions=tuple(own)) for own in groups], times)
    return tuple(sorted(places, key=lambda each: (-each.expected_wrong, each.first)))


def _with_rest(places: list[Place], times: NDArray[np.float64]) -> Iterator[Place]:
    """Add the places that need no look of their own to the nearest others, if these are near."""
    own = [each for each in places if _needs_look(each)]
    decisions = [list(each.decisions) for each in own]
    begins, ends = (times[[getattr(each, at) for each in own]] for at in ("first", "last"))
    for each in places if own else ():
        away = np.maximum(times[each.first] - ends, begins - times[each.last])
        nearest = int(np.argmin(away))
        if not _needs_look(each) and away[nearest] <= NEAR_SECONDS:
            decisions[nearest] += each.decisions
    for all_of in decisions:
        all_of.sort(key=lambda each: (-each.expected_wrong, each.track))
        yield Place(decisions=tuple(all_of))


def _needs_look(place: Place) -> bool:
    return place.expected_wrong >= MIN_EXPECTED and any(
        each.kind == "name" or (each.probability is not None and each.probability < OWN_PLACE)
        for each in place.decisions
    )


def _of_confidence(tracks: Tracks) -> Iterator[Decision]:
    """Return the runs of detections with an uncertain identity, as decisions."""
    if tracks.identity_confidence is None:
        return
    order, _ = tracks.by_track
    c, frame = tracks.identity_confidence[order], tracks.detections.frame_of[order]
    is_uncertain, label = c < UNCERTAIN, tracks.labels[order]
    cuts = np.flatnonzero((np.diff(is_uncertain) != 0) | (np.diff(label) != 0)) + 1
    for run in np.split(np.arange(len(order)), cuts):
        if len(run) and is_uncertain[run[0]]:
            yield Decision(
                kind="identity", track=int(label[run[0]]), first=int(frame[run[0]]),
                last=int(frame[run[-1]]), n_detections=len(run), probability=float(c[run].mean()),
            )  # fmt: skip


def _have_one_cause(one: Decision, other: Decision, times: NDArray[np.float64]) -> bool:
    if times[_begin(other)] - times[one.last] > NEAR_SECONDS:
        return False
    if one.track == other.track:
        return True
    if _may_be(one, other.track) or _may_be(other, one.track):
        return True
    return one.kind == other.kind == "identity" and _are_together(one, other, times)


def _begin(decision: Decision) -> int:
    """Return the first frame, for a join that after its gap."""
    return decision.last if decision.kind == "join" else decision.first


def _are_together(one: Decision, other: Decision, times: NDArray[np.float64]) -> bool:
    """Return whether two parts are long and share most of their time."""
    first, last = times[[one.first, other.first]], times[[one.last, other.last]]
    shared = last.min() - first.max()
    return bool(
        (last - first).min() >= NEAR_SECONDS and shared >= SHARED * (last.max() - first.min())
    )


def _may_be(one: Decision, track: int) -> bool:
    return any(other.track == track for other in one.alternatives)
