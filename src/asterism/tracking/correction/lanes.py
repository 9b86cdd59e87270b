"""Lanes of tracks that may be exchanged, by the evidence for each of their detections."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism.tracking.correction.exchange import Lane

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from asterism.model import Detections
    from asterism.tracking.correction.evidence import Evidence

__all__ = ["CLUTTER", "Lanes"]

CLUTTER = -2
"""Label, while an edit is solved, of the detections without a track that one of them begins."""
TRACKED = 3.0
"""Log odds of a detection that continues a track being of its marker instead of clutter."""


class Lanes:
    """Makes the lanes of tracks, nothing stated.

    Parameters
    ----------
    detections : Detections
        Detections of the capture.
    evidence : Evidence
        Parts of the tracks before any edit.
    """

    def __init__(self, detections: Detections, evidence: Evidence) -> None:
        self._frame_of, self._evidence = detections.frame_of, evidence

    def between(
        self, source: int, targets: Sequence[int], labels: NDArray[np.int64]
    ) -> dict[int, tuple[Lane, Lane]]:
        """Return the lanes of a track and of each of several others.

        Parameters
        ----------
        source : int
            Track that is exchanged.
        targets : sequence of int
            The others, by which the lanes are found.
        labels : ndarray of int, shape (N,)
            Track of each detection now.
        """
        out = self.of(source, targets, labels)
        return {
            target: (lane, self.of(target, [source], labels)[0])
            for target, lane in zip(targets, out, strict=True)
        }

    def of(
        self,
        track: int,
        others: Sequence[int],
        labels: NDArray[np.int64],
        mixed: int | None = None,
    ) -> list[Lane]:
        """Return the lane of a track for an exchange with each of several others.

        Parameters
        ----------
        track, others, labels
            As for `between`.
        mixed : int, optional
            Part of which each detection is a part of its own.
        """
        evidence, own = self._evidence, np.flatnonzero(labels == track)
        parts = evidence.part_of[own]
        if mixed is not None:
            inside = np.flatnonzero(parts == mixed)
            parts[inside[1:]] = -1 - np.arange(1, len(inside))
        starts = np.ones(len(own), dtype=bool)
        starts[1:] = parts[1:] != parts[:-1]
        before = np.ones(len(own))
        known = starts & (parts >= 0) & (parts < len(evidence.before))
        before[known] = evidence.before[parts[known]]
        gains = (
            np.full((len(others), len(own)), TRACKED if track == CLUTTER else -TRACKED)
            if CLUTTER in (track, *others)
            else evidence.gains(own, parts, labels, others)
        )
        return [
            Lane(
                detections=own, frames=self._frame_of[own], gains=gain, starts=starts,
                before=before, stated=np.zeros(len(own), dtype=np.int8),
            )
            for gain in gains
        ]  # fmt: skip
