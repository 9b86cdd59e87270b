"""The methods that the tables compare, each with its defaults, by the name in the tables."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

import asterism as am

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["METHODS", "links"]

METHODS: dict[str, am.Method[Any]] = {
    "gnn": am.GNN(),
    "smp": am.SMP(),
    "smp, window=3": am.SMP(window=3),
    "jpda": am.JPDA(),
    "splitting": am.TrackSplitting(),
    "tomht": am.TOMHT(),
}


def links(tracks: am.Tracks, truth: am.Tracks) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Give the later detection of every link of the tracks, and whether the link is right."""
    order, _ = tracks.by_track
    is_link = np.diff(tracks.labels[order]) == 0
    a, b = order[:-1][is_link], order[1:][is_link]
    return b, (truth.labels[a] == truth.labels[b]) & (truth.labels[b] >= 0)
