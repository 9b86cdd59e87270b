"""What an edit changed, by detections and by stretches of time."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism.records import record

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from asterism.model import Edit

__all__ = ["Change", "Stretch", "change_of", "without_improbable"]


@record
class Stretch:
    """Detections that changed from one track to another, in a stretch of time.

    Parameters
    ----------
    first, last : int
        First and last frame.
    source, target : int
        Track before and after the change, -1 for clutter.
    n_detections : int
        Number of detections.
    is_asked : bool
        Whether a detection of the edit is among them; other stretches follow from it.
    group : int
        Number that is the same for stretches of which one takes the place of another in a frame,
        so that neither is possible alone. It is the number of the first of them.
    """

    first: int
    last: int
    source: int
    target: int
    n_detections: int
    is_asked: bool
    group: int


@record(eq=False)
class Change:
    """What an edit changed.

    Parameters
    ----------
    edit : Edit
        The edit.
    detections : ndarray of int, shape (n,)
        Detections whose track changed, rising.
    before, after : ndarray of int, shape (n,)
        Their tracks before and after the edit, -1 for clutter.
    stretch_of : ndarray of int, shape (n,)
        Stretch of each.
    stretches : tuple of Stretch
        The same by stretches of time.
    names : dict of int to tuple of (str or None)
        Name before and after of each track whose name changed.
    """

    edit: Edit
    detections: NDArray[np.int64]
    before: NDArray[np.int64]
    after: NDArray[np.int64]
    stretch_of: NDArray[np.int64]
    stretches: tuple[Stretch, ...]
    names: dict[int, tuple[str | None, str | None]]

    def __repr__(self) -> str:
        return f"Change({self.edit.kind}: {len(self.detections)} detections)"

    def of_groups(self, groups: Sequence[int]) -> NDArray[np.int64]:
        """Return the detections of all stretches of some groups, rising."""
        group = np.array([each.group for each in self.stretches], dtype=np.int64)
        return self.detections[np.isin(group[self.stretch_of], groups)]


def change_of(
    edit: Edit,
    own: Sequence[int],
    frame_of: NDArray[np.int64],
    labels: tuple[NDArray[np.int64], NDArray[np.int64]],
    names: tuple[list[str | None], list[str | None]],
) -> Change:
    """Return what an edit changed.

    Parameters
    ----------
    edit : Edit
        The edit.
    own : sequence of int
        Its detections.
    frame_of : ndarray of int, shape (N,)
        Frame of each detection.
    labels : tuple of two ndarray of int, shape (N,)
        Track of each detection before and after.
    names : tuple of two list
        Names of the tracks before and after; more tracks may be there after.
    """
    changed = np.flatnonzero(labels[0] != labels[1])
    before, after = labels[0][changed], labels[1][changed]
    frame = frame_of[changed]
    runs, is_asked = _runs(changed, labels), np.isin(changed, own)
    runs.sort(key=lambda run: (not is_asked[run].any(), frame[run[0]], before[run[0]]))
    stretch_of = _stretch_of(runs)
    groups = _groups(stretch_of, frame, before, after)
    old = [*names[0], *[None] * (len(names[1]) - len(names[0]))]
    return Change(
        edit=edit, detections=changed, before=before, after=after, stretch_of=stretch_of,
        stretches=tuple(
            Stretch(
                first=int(frame[run[0]]), last=int(frame[run[-1]]), source=int(before[run[0]]),
                target=int(after[run[0]]), n_detections=len(run),
                is_asked=bool(is_asked[run].any()), group=group,
            )
            for run, group in zip(runs, groups, strict=True)
        ),
        names={
            k: (one, other)
            for k, (one, other) in enumerate(zip(old, names[1], strict=True))
            if one != other
        },
    )  # fmt: skip


def without_improbable(
    before: NDArray[np.int64],
    after: NDArray[np.int64],
    log_odds: NDArray[np.float64],
    frame_of: NDArray[np.int64],
) -> NDArray[np.int64]:
    """Return labels without the groups of changes that are less probable than none.

    Parameters
    ----------
    before, after : ndarray of int, shape (N,)
        Track of each detection before and after.
    log_odds : ndarray of shape (N,)
        Log odds that each gains by its change.
    frame_of : ndarray of int, shape (N,)
        Frame of each.
    """
    changed = np.flatnonzero(before != after)
    stretch_of = _stretch_of(_runs(changed, (before, after)))
    groups = _groups(stretch_of, frame_of[changed], before[changed], after[changed])
    group_of = np.array(groups, dtype=np.int64)[stretch_of]
    is_improbable = np.bincount(group_of, log_odds[changed])[group_of] <= 0
    found = after.copy()
    found[changed[is_improbable]] = before[changed[is_improbable]]
    return found


def _runs(
    changed: NDArray[np.int64], labels: tuple[NDArray[np.int64], NDArray[np.int64]]
) -> list[NDArray[np.int64]]:
    """Return which of the changed detections are of each stretch."""
    before, after = labels[0][changed], labels[1][changed]
    runs: list[NDArray[np.int64]] = []
    for source, target in dict.fromkeys(zip(before.tolist(), after.tolist(), strict=True)):
        which = np.flatnonzero((before == source) & (after == target))
        runs += np.split(which, _breaks(changed[which], source, target, labels))
    return runs


def _stretch_of(runs: list[NDArray[np.int64]]) -> NDArray[np.int64]:
    """Return the stretch of each changed detection."""
    found = np.empty(sum(map(len, runs)), dtype=np.int64)
    for i, run in enumerate(runs):
        found[run] = i
    return found


def _groups(
    stretch_of: NDArray[np.int64],
    frame: NDArray[np.int64],
    before: NDArray[np.int64],
    after: NDArray[np.int64],
) -> list[int]:
    """Return the group of each stretch: those that take the place of each other in a frame."""
    groups = list(range(int(stretch_of.max(initial=-1)) + 1))

    def first(stretch: int) -> int:
        while groups[stretch] != stretch:
            stretch = groups[stretch]
        return stretch

    n_tracks = int(max(before.max(initial=-1), after.max(initial=-1))) + 1
    left, taken = np.flatnonzero(before >= 0), np.flatnonzero(after >= 0)
    places = frame[left] * n_tracks + before[left]
    left = left[np.argsort(places, kind="stable")]
    places = np.sort(places)
    place = frame[taken] * n_tracks + after[taken]
    at = np.searchsorted(places, place)
    is_same = at < len(places)
    is_same[is_same] = places[at[is_same]] == place[is_same]
    pairs = np.stack([stretch_of[taken[is_same]], stretch_of[left[at[is_same]]]], axis=1)
    for one, other in np.unique(pairs, axis=0).tolist():
        low, high = sorted((first(one), first(other)))
        groups[high] = low
    return [first(i) for i in range(len(groups))]


def _breaks(
    moved: NDArray[np.int64],
    source: int,
    target: int,
    labels: tuple[NDArray[np.int64], NDArray[np.int64]],
) -> NDArray[np.int64]:
    """Return where detections that moved do not follow each other in their track.

    It is the track that they had before, or the new one of those that had none.
    """
    own = labels[0] == source if source >= 0 else labels[1] == target
    return np.flatnonzero(np.diff(np.searchsorted(np.flatnonzero(own), moved)) > 1) + 1
