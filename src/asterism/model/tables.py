"""Tracks as tables of other libraries: pandas and xarray, which are extras."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

import numpy as np

from asterism.errors import ParameterError

if TYPE_CHECKING:
    from asterism.model.tracks import Tracks

__all__ = ["to_pandas", "to_xarray"]


def to_pandas(tracks: Tracks) -> Any:
    """Make a data frame of one row a detection; `Tracks.to_pandas` describes it."""
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
    return _module("pandas").DataFrame(columns)


def to_xarray(tracks: Tracks) -> Any:
    """Make an array of time, marker and axis; `Tracks.to_xarray` describes it."""
    d = tracks.detections
    return _module("xarray").DataArray(
        tracks.positions(),
        dims=("time", "marker", "axis"),
        coords={
            "time": d.times,
            "marker": list(tracks.display_names),
            "axis": list("xyz"[: d.n_axes]),
        },
        name="position",
        attrs={"units": "m"},
    )


def _module(name: str) -> Any:
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError as error:
        if error.name != name:
            raise
        hint = "run pip install 'asterism[tables]'"
        raise ParameterError(
            name, "the library of that name", "it is not installed", hint
        ) from error
