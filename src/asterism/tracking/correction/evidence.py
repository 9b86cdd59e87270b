"""Evidence for a correction: how well the distances of parts of tracks fit other tracks."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism.tracking.confidence.calibration import MARGINS, PART
from asterism.tracking.confidence.identity import examine
from asterism.tracking.confidence.parts import PART_FRAMES
from asterism.tracking.confidence.reassign import ghost_log_odds
from asterism.tracking.rigidity.profiles import candidate_margins, learn_profiles

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from asterism.model import TrackingModel, Tracks
    from asterism.tracking.stitching import Stitching

__all__ = ["Evidence"]


class Evidence:
    """Parts of the tracks before any edit, and how well each fits the other tracks.

    Parameters
    ----------
    tracks, model, stitching
        As for `Correction`.

    Attributes
    ----------
    part_of : ndarray of int, shape (N,)
        Part of each detection, -1 for clutter without a tracklet.
    before : ndarray of shape (P,)
        Probability of the link that leads to each part.
    ghost : ndarray of shape (N,)
        Log odds of the tracklet of each detection being a ghost, 0 for other detections.
    """

    def __init__(
        self, tracks: Tracks, model: TrackingModel, stitching: Stitching | None = None
    ) -> None:
        parts = examine(tracks, model, stitching).parts
        self._detections, self._noise = tracks.detections, model.sensor.noise_sigma
        self.before = parts.before
        n = len(parts.track)
        self.part_of = np.full(len(tracks.labels), -1)
        self.ghost = ghost_log_odds(tracks, stitching)
        self.part_of[tracks.by_track[0]] = np.repeat(np.arange(n), parts.n_detections)
        if stitching is not None:  # ghosts are parts too, which a person can take back
            is_ghost = (tracks.labels < 0) & (stitching.tracklets >= 0)
            _, numbers = np.unique(stitching.tracklets[is_ghost], return_inverse=True)
            self.part_of[is_ghost] = n + numbers

    def gains(
        self,
        detections: NDArray[np.int64],
        parts: NDArray[np.int64],
        labels: NDArray[np.int64],
        others: Sequence[int],
    ) -> NDArray[np.float64]:
        """Return the log odds that each detection of a track gains in other tracks.

        Those of a part are shared by its detections.

        Parameters
        ----------
        detections : ndarray of int, shape (n,)
            Detections of one track, in time order.
        parts : ndarray of int, shape (n,)
            Their parts.
        labels : ndarray of int, shape (N,)
            Track of each detection now.
        others : sequence of int
            K other tracks; one without detections is an unknown marker.

        Returns
        -------
        ndarray of shape (K, n)
        """
        if not len(detections):
            return np.empty((len(others), 0))
        is_known = np.array([(labels == k).any() for k in others])
        known = np.array(others, dtype=np.int64)[is_known]
        found, counts = self._densities(detections, parts, labels, known)
        column = np.where(is_known, np.cumsum(is_known) - 1, len(known))
        factor = np.where(is_known, PART[2], PART[1])[:, None]
        gain = factor * np.clip(found.T[column], -MARGINS[1], -MARGINS[0])
        return np.repeat(gain / counts, counts, axis=1)

    def best(self, detection: int, labels: NDArray[np.int64], n: int) -> list[int]:
        """Return the `n` other tracks that the part of a detection fits best.

        Parameters
        ----------
        detection : int
            Detection of a track.
        labels : ndarray of int, shape (N,)
            Track of each detection now.
        n : int
            Largest number of tracks.
        """
        own = np.flatnonzero(
            (self.part_of == self.part_of[detection]) & (labels == labels[detection])
        )
        others = np.flatnonzero(np.bincount(labels + 1)[1:])
        others = others[others != labels[detection]]
        found = self._densities(own, self.part_of[own], labels, others)[0][0, :-1]
        order = np.argsort(-found, kind="stable")
        return [int(others[i]) for i in order if found[i] != 0][:n]

    def log_odds(
        self, detections: NDArray[np.int64], labels: NDArray[np.int64], track: int
    ) -> NDArray[np.float64]:
        """Return the log odds that single detections are of the marker of a track.

        They are those of a part of one detection, whose alternatives are the tracks without a
        detection in its frame.

        Parameters
        ----------
        detections : ndarray of int, shape (n,)
            Detections without a track, in frames in which the track has none.
        labels : ndarray of int, shape (N,)
            Track of each detection now.
        track : int
            The track.

        Returns
        -------
        ndarray of shape (n,)
            Log odds, 0 for a track that keeps no distances.
        """
        margins = candidate_margins(self._detections, labels, self._noise, detections, track)
        found = PART[0] + np.clip(margins, *MARGINS) @ PART[1:3]
        return np.where(margins[:, 0] == 0, 0.0, found)

    def _densities(
        self,
        detections: NDArray[np.int64],
        parts: NDArray[np.int64],
        labels: NDArray[np.int64],
        others: NDArray[np.int64],
    ) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Return the log densities of the parts of a track, and the lengths of the parts."""
        d = self._detections
        starts = np.flatnonzero(np.concatenate([[True], parts[1:] != parts[:-1]]))
        lengths = np.diff(np.append(starts, len(parts)))
        counts = np.minimum(lengths, PART_FRAMES)
        offsets = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
        rank = np.arange(offsets[-1]) - np.repeat(offsets[:-1], counts)
        spacing = (lengths - 1) / np.maximum(counts - 1, 1)
        chosen = np.repeat(starts, counts) + (rank * np.repeat(spacing, counts)).astype(np.int64)
        frames = d.frame_of[detections[chosen]].astype(np.int64)
        profiles = learn_profiles(d, labels, self._noise, frames)
        found = profiles.engine.densities(
            np.full(len(starts), labels[detections[0]]),
            np.searchsorted(profiles.frames, frames).astype(np.int64),
            offsets,
            others,
        )
        return found, lengths
