"""Tables of tracks: HTML for notebooks, pandas and xarray by the extra ``tables``."""

from __future__ import annotations

import importlib
from html import escape
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from asterism.errors import ParameterError

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from asterism.model.detections import Detections
    from asterism.model.gap import Gap

__all__ = ["data_array", "data_frame", "html_table"]

_MAX_ROWS = 100


def html_table(
    title: str,
    names: Sequence[str],
    frames: NDArray[np.int64],
    offsets: NDArray[np.int64],
    gaps: Sequence[Gap],
) -> str:
    """Return an HTML table with one row of figures for each track that has detections.

    Parameters
    ----------
    title : str
        Line above the table.
    names : sequence of str
        Name of each of the K tracks.
    frames : ndarray of int, shape (M,)
        Frame of each detection, ordered by track and then by time.
    offsets : ndarray of int, shape (K + 1,)
        Track ``k`` holds ``frames[offsets[k]:offsets[k + 1]]``.
    gaps : sequence of Gap
        Gaps of all tracks.
    """
    n_gaps = np.bincount([gap.track for gap in gaps], minlength=len(names))
    rows = [
        f"<tr><th>{escape(names[k])}</th><td>{b - a}</td>"
        f"<td>{n_gaps[k]}</td><td>{frames[a]}</td><td>{frames[b - 1]}</td></tr>"
        for k, (a, b) in enumerate(pairwise(offsets.tolist()))
        if b > a
    ]
    heads = "".join(f"<th>{h}</th>" for h in ("track", "detections", "gaps", "first", "last"))
    more = f"<p>… and {len(rows) - _MAX_ROWS} more</p>" * (len(rows) > _MAX_ROWS)
    body = "".join(rows[:_MAX_ROWS])
    return f"<p>{escape(title)}</p><table><tr>{heads}</tr>{body}</table>{more}"


def data_frame(
    d: Detections,
    labels: NDArray[np.int64],
    names: Sequence[str],
    confidences: Mapping[str, NDArray[np.float64] | None],
) -> Any:
    """Return a pandas ``DataFrame`` with one row a detection; see `Tracks.to_pandas`."""
    columns = {
        "frame": d.frame_of,
        "time_s": d.times[d.frame_of],
        "track": labels,
        "name": np.array([*names, ""], dtype=object)[labels],
        **{f"{axis}_m": d.points[:, k] for k, axis in enumerate("xyz"[: d.n_axes])},
    }
    columns |= {name: values for name, values in confidences.items() if values is not None}
    return _library("pandas").DataFrame(columns)


def data_array(
    times: NDArray[np.float64], positions: NDArray[np.float64], names: Sequence[str]
) -> Any:
    """Return an xarray ``DataArray`` of time, marker and axis; see `Tracks.to_xarray`."""
    return _library("xarray").DataArray(
        positions,
        dims=("time", "marker", "axis"),
        coords={"time": times, "marker": list(names), "axis": list("xyz"[: positions.shape[2]])},
        name="position",
        attrs={"units": "m"},
    )


def _library(name: str) -> Any:
    """Import pandas or xarray and return the module.

    Raises
    ------
    ParameterError
        If the library is not installed.
    """
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError as error:
        if error.name != name:
            raise
        hint = "run pip install 'asterism[tables]'"
        raise ParameterError(
            name, "the library of that name", "it is not installed", hint
        ) from error
