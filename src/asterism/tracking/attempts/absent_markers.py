"""The most probable marker of some detections, among those that are absent in their frames."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism.tracking.attempts.posterior import gain_of_change

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from asterism.model import SharedAcceleration, TrackingModel, Tracks

__all__ = ["AbsentMarkers"]

MAX_DEVIATION = 3.5
"""Largest mean squared error, in variances, of the distances to the neighbours of a marker, with
which detections may be of this marker."""
MAX_TERM = 4.0
"""Largest squared error of one distance that counts. Most distances of a wrong marker reach it."""
N_COMPARED = 10
"""Number of detections whose distances are compared."""


class AbsentMarkers:
    """The markers of tracks with bonds, and where they are absent.

    Parameters
    ----------
    tracks : Tracks
        Tracks of markers.
    labels : ndarray of int, shape (N,)
        Marker of each detection, -1 for clutter.
    model : TrackingModel
        Model of the markers' own motion.
    shared : SharedAcceleration
        Shared accelerations of the markers.

    Attributes
    ----------
    labels : ndarray of int, shape (N,)
        Marker of each detection after all calls of `move`.
    """

    def __init__(
        self,
        tracks: Tracks,
        labels: NDArray[np.int64],
        model: TrackingModel,
        shared: SharedAcceleration,
    ) -> None:
        self.labels = labels.copy()
        self._tracks, self._model, self._shared = tracks, model, shared
        d, K = tracks.detections, len(shared.weights)
        self._positions = np.full((d.n_frames, K, d.n_axes), np.nan)
        has = np.flatnonzero(labels >= 0)
        self._positions[d.frame_of[has], labels[has]] = d.points[has]
        later = np.repeat(np.arange(K), np.diff(shared.offsets))
        marker = np.concatenate([later, shared.others])
        self._bonds = [np.flatnonzero(marker == k) for k in range(K)]
        self._other = np.concatenate([shared.others, later])
        self._distance, self._variance = np.tile(shared.distances, 2), np.tile(shared.variances, 2)

    def best(self, detections: NDArray[np.int64]) -> tuple[float, int]:
        """Return the log odds of the most probable marker, and the marker.

        They are the log posterior with the detections as this marker less that with their present
        label. They are minus infinity, and the marker is -1, if no marker is possible or the labels
        differ.

        Parameters
        ----------
        detections : ndarray of int, shape (n,)
            Detections in time order.
        """
        own = self.labels[detections]
        if (own != own[0]).any():
            return -np.inf, -1
        frames = self._tracks.detections.frame_of[detections]
        is_absent = np.isnan(self._positions[frames, :, 0]).all(axis=0)
        candidates = [
            k for k in np.flatnonzero(is_absent).tolist()
            if self._deviation(k, detections) <= MAX_DEVIATION
        ]  # fmt: skip
        if not candidates:
            return -np.inf, -1
        return max((self._log_odds(detections, k), k) for k in candidates)

    def move(self, detections: NDArray[np.int64], marker: int) -> None:
        """Give detections with the same label to a marker that is absent in their frames.

        Parameters
        ----------
        detections : ndarray of int, shape (n,)
            Detections.
        marker : int
            Marker.
        """
        d, own = self._tracks.detections, self.labels[detections[0]]
        frames = d.frame_of[detections]
        if own >= 0:
            self._positions[frames, own] = np.nan
        self._positions[frames, marker] = d.points[detections]
        self.labels[detections] = marker

    def _deviation(self, marker: int, detections: NDArray[np.int64]) -> float:
        """Return the mean squared error of distances, in variances; infinity if none is known."""
        some = detections[np.linspace(0, len(detections) - 1, N_COMPARED).astype(int)]
        bonds, d = self._bonds[marker], self._tracks.detections
        bonds = bonds[self._other[bonds] != self.labels[detections[0]]]  # itself
        others = self._positions[d.frame_of[some]][:, self._other[bonds]]
        apart = np.linalg.norm(others - d.points[some, None], axis=2)
        squares = (apart - self._distance[bonds]) ** 2 / self._variance[bonds]
        known = squares[np.isfinite(squares)]
        return float(np.minimum(known, MAX_TERM).mean()) if len(known) else np.inf

    def _log_odds(self, detections: NDArray[np.int64], marker: int) -> float:
        after = self.labels.copy()
        after[detections] = marker
        return gain_of_change(
            detections, self.labels, after, self._tracks, self._model, self._shared
        )
