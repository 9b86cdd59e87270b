"""Image points of caliscope: ``xy.csv``, one row per point.

Columns ``sync_index``, ``cam_id`` (in older files ``port``), ``point_id``, ``img_loc_x`` and
``img_loc_y`` in pixels from the centre of the top left pixel, and optionally ``frame_time`` in
seconds. Other columns, such as the position of a point on a calibration board, are not read.
"""

from __future__ import annotations

import logging
from typing import TYPE_CHECKING

import numpy as np

from asterism.camera import Observations
from asterism.errors import FormatError
from asterism.io.csv_columns import columns_of, whole
from asterism.io.text_table import check_times

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from numpy.typing import NDArray

__all__ = ["is_header", "parse"]

log = logging.getLogger(__name__)

_REQUIRED = ("sync_index", "point_id", "img_loc_x", "img_loc_y")
_CAMERAS = ("cam_id", "port")
_TIME = "frame_time"
_LARGEST = 10**9  # a larger number of a camera or a point is an error


def is_header(header: Sequence[str]) -> bool:
    """Return whether a header has the columns of caliscope's ``xy.csv``."""
    return set(header) >= set(_REQUIRED) and any(name in header for name in _CAMERAS)


def parse(path: Path, lines: Sequence[str], header: Sequence[str]) -> Observations:
    """Parse the lines of caliscope's ``xy.csv``.

    Parameters
    ----------
    path : Path
        File for messages.
    lines : sequence of str
        All lines of the file, the header first.
    header : sequence of str
        Names of the columns.

    Returns
    -------
    Observations
        Camera N is called ``cam_N``, as by `read_rig`. Markers are the numbers of the points. The
        time of a frame is the mean over its cameras.

    Raises
    ------
    FormatError
        If a line is malformed; the error names it.
    """
    camera_column = next(name for name in _CAMERAS if name in header)
    wanted = (*_REQUIRED, camera_column, _TIME)
    numbers, _ = columns_of(path, lines, header, [name for name in header if name not in wanted])
    for name in (*_REQUIRED, camera_column):
        missing = np.flatnonzero(np.isnan(numbers[name]))
        if len(missing):
            place = f"line {missing[0] + 2}, column {name}"
            raise FormatError(path, place, "a number", "nothing")
    at = np.arange(len(lines) - 1) + 2
    frame, camera, marker = (
        _counts(path, name, numbers[name], at) for name in ("sync_index", camera_column, "point_id")
    )
    order = np.lexsort((camera, frame))
    frame, camera, at = frame[order], camera[order], at[order]
    begins = np.flatnonzero(np.diff(frame, prepend=frame[:1] - 1))
    index = np.repeat(np.arange(len(begins)), np.diff(np.append(begins, len(frame))))
    cameras, camera_of = np.unique(camera, return_inverse=True)
    if not len(cameras):
        raise FormatError(path, "line 2", "a row of an image point", "nothing")
    cells = index * len(cameras) + camera_of
    counts = np.bincount(cells, minlength=len(begins) * len(cameras))
    times = _times(path, numbers.get(_TIME), order, cells, index, frame[begins])
    check_times(path, times, at[begins])
    return Observations(
        times=times,
        cameras=tuple(f"cam_{number}" for number in cameras),
        offsets=np.concatenate([[0], np.cumsum(counts)]).astype(np.int64),
        pixels=np.stack([numbers["img_loc_x"], numbers["img_loc_y"]], axis=1)[order],
        markers=marker[order],
    )


def _counts(
    path: Path, column: str, values: NDArray[np.float64], lines: NDArray[np.int64]
) -> NDArray[np.int64]:
    result = whole(path, column, values, lines)
    bad = np.flatnonzero((result < 0) | (result > _LARGEST))
    if len(bad):
        place = f"line {lines[bad[0]]}, column {column}"
        raise FormatError(path, place, f"a number from 0 to {_LARGEST}", result[bad[0]])
    return result


def _times(
    path: Path,
    stated: NDArray[np.float64] | None,
    order: NDArray[np.int64],
    cells: NDArray[np.int64],
    index: NDArray[np.int64],
    frames: NDArray[np.int64],
) -> NDArray[np.float64]:
    """Return the time of each frame: the mean over its cameras, or its number without times."""
    if stated is None or np.isnan(stated).all():
        log.warning("%s: no frame_time is given: times are frame numbers, one per second", path)
        return frames.astype(np.float64)
    stated = stated[order]
    # One row for each camera of a frame, so that a camera with many points has no more weight.
    first = np.flatnonzero((np.diff(cells, prepend=-1) > 0) & np.isfinite(stated))
    n_cameras = np.bincount(index[first], minlength=len(frames))
    with np.errstate(invalid="ignore"):
        return np.bincount(index[first], stated[first], minlength=len(frames)) / n_cameras
