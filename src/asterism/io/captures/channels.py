"""Conversion between the channels of a file and the labels of detections.

A file has channels (columns, trajectories); detections have labels. A named channel is one
identity. A recording system reuses an unnamed channel for another marker after a gap, so each of
its tracklets is a separate identity.
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
    """Label detections by their channels.

    Parameters
    ----------
    seen : ndarray of bool, shape (T, C)
        True for channels with a detection in the frame.
    names : sequence of (str or None)
        Name of each channel; None for one identity without a name.

    Returns
    -------
    labels : ndarray of int, shape (N,)
        Labels of the N detections, by frame and then by channel.
    names : tuple of str or None
        Names of the identities, in the order of the channels. A named channel without detections
        keeps its name; an unnamed one has no identity.
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
    """Assign detections to channels: one for each track, and the smallest number for clutter.

    Parameters
    ----------
    tracks : Tracks
        K tracks.

    Returns
    -------
    channels : ndarray of int, shape (N,)
        Channel of each detection.
    names : list of str
        Names of the channels: the K tracks, with ``T007`` for an unnamed one, then ``*0``, ``*1``
        and so on for clutter.
    n_clutter : int
        Number of channels of clutter.
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
    """Return positions by frame and channel for a range of frames.

    Parameters
    ----------
    tracks : Tracks
        Tracks of D axes.
    channels : ndarray of int, shape (N,)
        Channel of each detection, as by `to_channels`.
    n_channels : int
        Number of channels, C.
    rows : slice
        Range of T' frames.

    Returns
    -------
    ndarray of shape (T', C, D)
        Metres; NaN for a missed detection.
    """
    d = tracks.detections
    begin, end = int(d.offsets[rows.start]), int(d.offsets[rows.stop])
    dense = np.full((rows.stop - rows.start, n_channels, d.n_axes), np.nan)
    dense[d.frame_of[begin:end] - rows.start, channels[begin:end]] = d.points[begin:end]
    return dense
