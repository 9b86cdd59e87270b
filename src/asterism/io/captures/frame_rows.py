"""Captures as tables of one row per frame, the layout of TRC, TSV and wide CSV."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism.io.captures.channels import identities, to_channels, to_dense
from asterism.io.units import PER_METRE, check_size, from_metres
from asterism.model import Capture

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from asterism.model import Tracks

__all__ = ["capture_of", "rows_of"]

_CHUNK = 4096  # frames at a time, to bound the memory of the texts


def capture_of(
    path: Path,
    format: str,
    times: NDArray[np.float64],
    coordinates: NDArray[np.float64],
    names: Sequence[str],
    *,
    unit: str,
    rate: float = 0.0,
    first_frame: int = 1,
    zero_is_gap: bool,
    is_stated: bool = True,
    modelled: Sequence[str] = (),
    warnings: Sequence[str] = (),
) -> Capture:
    """Build a capture from coordinates with one row per frame.

    Parameters
    ----------
    path, format, unit, rate, first_frame, modelled, warnings
        As in `Capture`.
    times : ndarray of shape (T,)
        Times of the frames, seconds.
    coordinates : ndarray of shape (T, C, D)
        Coordinates in `unit`; NaN for a missed detection.
    names : sequence of str
        Names of the C channels.
    zero_is_gap : bool
        Whether all zeros are a missed detection, as in files of recording systems.
    is_stated : bool
        Whether the file states its unit. If so, a contradicting size adds a warning.

    Returns
    -------
    Capture
        Detections in metres with the identities of the channels.
    """
    seen: NDArray[np.bool_] = np.all(np.isfinite(coordinates), axis=2)
    notes = list(warnings)
    n_partial = int((np.isfinite(coordinates).any(axis=2) & ~seen).sum())
    if n_partial:
        notes.append(f"{n_partial} points with missing coordinates are taken as missed detections")
    if zero_is_gap:
        at_origin: NDArray[np.bool_] = np.all(coordinates == 0, axis=2)
        if at_origin.any():
            n_origin = at_origin.sum()
            notes.append(f"{n_origin} points at exactly the origin are taken as missed detections")
        seen &= ~at_origin
    labels, identity_names = identities(seen, names)
    points = coordinates[seen].reshape(-1, coordinates.shape[2]) / PER_METRE[unit]
    if is_stated:
        notes += check_size(points, unit)
    return Capture(
        times=times,
        offsets=np.concatenate([[0], np.cumsum(seen.sum(axis=1))]),
        points=points,
        path=path,
        format=format,
        rate=rate,
        first_frame=first_frame,
        units=unit,
        channels=np.nonzero(seen)[1],
        labels=labels,
        names=identity_names,
        modelled=tuple(modelled),
        warnings=tuple(notes),
    )


def rows_of(
    tracks: Tracks, unit: str, *, zero_is_gap: bool
) -> tuple[list[str], Iterator[list[str]]]:
    """Return the channel names of tracks, and their coordinates as shortest exact texts.

    Parameters
    ----------
    tracks : Tracks
        Tracks to write.
    unit : str
        Unit of the texts.
    zero_is_gap : bool
        Move a point at the origin by 1e-30 of a unit, so that it is not read as a gap.

    Returns
    -------
    names : list of str
        Names of the C channels: the tracks, then clutter as ``*0``, ``*1`` and so on.
    rows : iterator of list of str
        C·D texts per frame, blank for a missed detection.
    """
    channels, names, _ = to_channels(tracks)

    def rows() -> Iterator[list[str]]:
        for begin in range(0, tracks.detections.n_frames, _CHUNK):
            end = min(begin + _CHUNK, tracks.detections.n_frames)
            dense = to_dense(tracks, channels, len(names), slice(begin, end))
            values = from_metres(dense, unit)
            if zero_is_gap:
                values[(values == 0).all(axis=2), 0] = 1e-30
            for row in values.reshape(end - begin, -1).tolist():
                yield ["" if x != x else repr(x) for x in row]

    return names, rows()
