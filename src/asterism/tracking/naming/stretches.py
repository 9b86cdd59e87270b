"""Stretches of frames in which a track stays on one marker."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from asterism.records import record

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from asterism.model import Tracks

__all__ = ["NameChange", "Stretch", "changes_of", "stretches_of"]


class Stretch(NamedTuple):
    """Successive detections of a track that have one value."""

    track: int
    first: int  # frame
    last: int  # frame
    value: int
    rows: NDArray[np.int64]  # the detections


def stretches_of(tracks: Tracks, values: NDArray[np.int64]) -> list[Stretch]:
    """Return the stretches of all tracks, by track and then by time.

    Parameters
    ----------
    tracks : Tracks
        Tracks of N detections.
    values : ndarray of int, shape (N,)
        Value of each detection, such as its marker; -1 or above.
    """
    order, _ = tracks.by_track
    label, value = tracks.labels[order], values[order]
    frame = tracks.detections.frame_of[order]
    starts = np.flatnonzero(np.diff(label, prepend=-1) | np.diff(value, prepend=-2))
    ends = np.append(starts, len(order))[1:] - 1
    return [
        Stretch(int(label[a]), int(frame[a]), int(frame[b]), int(value[a]), order[a : b + 1])
        for a, b in zip(starts.tolist(), ends.tolist(), strict=True)
    ]


@record
class NameChange:
    """Stretch of frames in which a track is on another marker than in most of its frames.

    Parameters
    ----------
    track : int
        Number of the input track.
    first, last : int
        First and last frame of the stretch.
    usual : str or None
        Name of the track in most of its frames, None for none.
    name : str or None
        Name in the stretch.

    Examples
    --------
    >>> change = NameChange(track=3, first=320, last=399, usual="LTOE", name="LMT5")
    >>> change.name
    'LMT5'
    """

    track: int
    first: int
    last: int
    usual: str | None
    name: str | None


def changes_of(
    tracks: Tracks,
    markers: NDArray[np.int64],
    usual: NDArray[np.int64],
    names: Sequence[str],
) -> tuple[NameChange, ...]:
    """Return the stretches in which tracks are on other markers, by track and then by time.

    Parameters
    ----------
    tracks : Tracks
        Input tracks.
    markers : ndarray of int, shape (N,)
        Marker of each detection, -1 for none.
    usual : ndarray of int, shape (K,)
        Marker of each track.
    names : sequence of str
        Names of the markers.
    """

    def name_of(own: int) -> str | None:
        return names[own] if own >= 0 else None

    return tuple(
        NameChange(
            track=own.track,
            first=own.first,
            last=own.last,
            usual=name_of(int(usual[own.track])),
            name=name_of(own.value),
        )
        for own in stretches_of(tracks, markers)
        if own.value != usual[own.track]
    )
