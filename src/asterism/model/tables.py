"""Tables of tracks: HTML for notebooks, pandas and xarray by the extra ``tables``."""

from __future__ import annotations

import importlib
from html import escape
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from asterism.errors import ParameterError

if TYPE_CHECKING:
    from asterism.model.tracks import Tracks

__all__ = ["data_array", "data_frame", "html_table"]

_MAX_ROWS = 100


def html_table(tracks: Tracks) -> str:
    """Return an HTML table with one row of figures for each track that has detections."""
    order, offsets = tracks.by_track
    frames = tracks.detections.frame_of[order]
    n_gaps = np.bincount([gap.track for gap in tracks.gaps()], minlength=tracks.n_tracks)
    rows = [
        f"<tr><th>{escape(tracks.display_names[k])}</th><td>{tracks.lengths[k]}</td>"
        f"<td>{n_gaps[k]}</td><td>{frames[a]}</td><td>{frames[b - 1]}</td></tr>"
        for k, (a, b) in enumerate(pairwise(offsets.tolist()))
        if b > a
    ]
    heads = "".join(f"<th>{h}</th>" for h in ("track", "detections", "gaps", "first", "last"))
    more = f"<p>… and {len(rows) - _MAX_ROWS} more</p>" * (len(rows) > _MAX_ROWS)
    body = "".join(rows[:_MAX_ROWS])
    return f"<p>{escape(repr(tracks))}</p><table><tr>{heads}</tr>{body}</table>{more}"


def data_frame(tracks: Tracks) -> Any:
    """Return a pandas ``DataFrame`` with one row a detection."""
    d = tracks.detections
    names = np.array([*tracks.display_names, ""], dtype=object)
    columns = {
        "frame": d.frame_of,
        "time_s": d.times[d.frame_of],
        "track": tracks.labels,
        "name": names[tracks.labels],
        **{f"{axis}_m": d.points[:, k] for k, axis in enumerate("xyz"[: d.n_axes])},
    }
    if tracks.confidence is not None:
        columns["confidence"] = tracks.confidence
    return _library("pandas").DataFrame(columns)


def data_array(tracks: Tracks) -> Any:
    """Return an xarray ``DataArray`` of time, marker and axis."""
    d, axes = tracks.detections, list("xyz"[: tracks.detections.n_axes])
    return _library("xarray").DataArray(
        tracks.positions(),
        dims=("time", "marker", "axis"),
        coords={"time": d.times, "marker": list(tracks.display_names), "axis": axes},
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
