"""Between channels and identities.

A file has channels (columns, trajectories); detections have labels. A named channel is one
identity. A channel without a name is a recorder's own short trajectory, and recorders reuse it
for another marker after a gap, so each unbroken piece of it is an identity of its own.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism.io.captures.marker_names import is_unlabelled

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from asterism.model import Tracks

__all__ = ["identities", "to_channels", "to_dense"]


def identities(
    seen: NDArray[np.bool_], names: Sequence[str | None]
) -> tuple[NDArray[np.int64], tuple[str | None, ...]]:
    """Label detections by the channel that they came in.

    Parameters
    ----------
    seen : ndarray of bool, shape (T, C)
        Which channels hold a detection, frame by frame.
    names : sequence of (str or None)
        Name of each channel; None for one identity without a name.

    Returns
    -------
    labels : ndarray of int, shape (N,)
        Of the N detections, by frame and then by channel.
    names : tuple of str or None
        Of each identity, in the order of the channels. A named channel without any detection
        keeps its name; an unnamed one is no identity.
    """
    table = np.empty(seen.shape, dtype=np.int32)
    found: list[str | None] = []
    for c, name in enumerate(names):
        table[:, c] = len(found)
        if name is None or not is_unlabelled(name):
            found.append(name)
            continue
        begins = seen[:, c].copy()
        begins[1:] &= ~seen[:-1, c]
        table[:, c] += np.cumsum(begins, dtype=np.int32) - 1
        found += [None] * int(begins.sum())
    return table[seen].astype(np.int64), tuple(found)


def to_channels(tracks: Tracks) -> tuple[NDArray[np.int64], list[str], int]:
    """Return every detection a channel of a file: each track its own, clutter as few as hold it.

    Parameters
    ----------
    tracks : Tracks
        K tracks.

    Returns
    -------
    channels : ndarray of int, shape (N,)
    names : list of str
        Of the channels: first the K tracks, ``T007`` where one has no name, then ``*0``, ``*1`` …
        with the clutter.
    n_clutter : int
        How many channels of clutter there are.
    """
    d = tracks.detections
    taken = {name for name in tracks.names if name is not None}
    width = max(3, len(str(tracks.n_tracks - 1)))
    names: list[str] = []
    for k, name in enumerate(tracks.names):
        if name is None:
            name = f"T{k:0{width}d}"
            while name in taken:
                name += "_"
        names.append(name)
    channels = tracks.labels.astype(np.int64)
    clutter = np.flatnonzero(channels < 0)
    frames = d.frame_of[clutter]
    is_first = np.ones(len(frames), dtype=bool)
    is_first[1:] = frames[1:] != frames[:-1]
    starts = np.flatnonzero(is_first)
    rank = np.arange(len(frames)) - np.repeat(starts, np.diff(np.append(starts, len(frames))))
    channels[clutter] = tracks.n_tracks + rank
    n_clutter = int(rank.max()) + 1 if len(rank) else 0
    return channels, names + [f"*{i}" for i in range(n_clutter)], n_clutter


def to_dense(
    tracks: Tracks, channels: NDArray[np.int64], n_channels: int, rows: slice
) -> NDArray[np.float64]:
    """Positions by frame and channel for some frames, shape (T', C, D), metres, NaN where none."""
    d = tracks.detections
    begin, end = int(d.offsets[rows.start]), int(d.offsets[rows.stop])
    dense = np.full((rows.stop - rows.start, n_channels, d.n_axes), np.nan)
    dense[d.frame_of[begin:end] - rows.start, channels[begin:end]] = d.points[begin:end]
    return dense
