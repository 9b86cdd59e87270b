"""The methods that the tables compare, each with its defaults, by the name in the tables."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

import asterism as am
from report import table

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["METHODS", "LinkConfidence", "links"]

METHODS: dict[str, am.tracking.Method[Any]] = {
    "gnn": am.GNN(),
    "smp": am.SMP(),
    "smp, window=3": am.SMP(window=3),
    "jpda": am.JPDA(),
    "splitting": am.TrackSplitting(),
    "tomht": am.TOMHT(),
    "mht": am.MHT(),
    "mcmcda": am.MCMCDA(),
}


def links(
    tracks: am.Tracks, truth: am.Tracks
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.bool_]]:
    """Give the two detections of every link of the tracks, and whether the link is right."""
    order, _ = tracks.by_track
    is_link = np.diff(tracks.labels[order]) == 0
    a, b = order[:-1][is_link], order[1:][is_link]
    return a, b, (truth.labels[a] == truth.labels[b]) & (truth.labels[b] >= 0)


class LinkConfidence:
    """How sure each method was of its links, and whether they are right.

    The confidence of a detection is that of the link that leads to it.
    """

    def __init__(self) -> None:
        self._parts: dict[str, list[tuple[NDArray[np.float64], NDArray[np.bool_]]]] = {}

    def add(self, name: str, tracks: am.Tracks, truth: am.Tracks) -> None:
        """Take the links of one result, if its method has a confidence."""
        if tracks.confidence is not None:
            _, b, is_right = links(tracks, truth)
            self._parts.setdefault(name, []).append((tracks.confidence[b], is_right))

    def links(self, name: str) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Give the confidence of every link of a method, and whether it is right."""
        sure, right = zip(*self._parts[name], strict=True)
        return np.concatenate(sure), np.concatenate(right)

    def table(self) -> list[str]:
        """Lines of a table with a row for each method."""
        rows: list[list[str]] = []
        for name in self._parts:
            sure, right = self.links(name)
            c = am.metrics.calibration_curve(sure, right)
            wrong = int((~right).sum())
            rows.append([name, f"{len(right):,}", f"{wrong:,}", f"{c.ece:.4f}", f"{c.auc:.3f}"])
        head = ["method", "links", "wrong", "expected calibration error", "AUC for wrong links"]
        return table(head, rows)
