"""States of tracks: filtered forward, or smoothed with the whole take.

Symbols: n states an axis, D axes, K tracks. The axes of a track share one covariance.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from asterism import _engine
from asterism.errors import check_kind
from asterism.model import TrackingModel, Tracks
from asterism.model.compiled import motion_model, steps_of, with_noise

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["States", "filter_states", "smooth"]


@dataclass(frozen=True, eq=False, kw_only=True)
class States:
    """States of K tracks, each from its first detection to its last, gaps included.

    Parameters
    ----------
    means : ndarray, shape (M, D, n)
        Of each axis: position, and velocity and acceleration where the motion has them; SI units.
    covariances : ndarray, shape (M, n, n)
        Of each axis, the same on every one.
    offsets : ndarray of int, shape (K + 1,)
        Track ``k`` has the rows ``offsets[k]:offsets[k + 1]``, one a frame.
    first_frames : ndarray of int, shape (K,)
        Frame of each track's first row.
    log_densities : ndarray, shape (N,)
        ``log N(y; ŷ, S)`` of each detection given the track's earlier ones; 0 at a track's first
        detection and for clutter.
    """

    means: NDArray[np.float64]
    covariances: NDArray[np.float64]
    offsets: NDArray[np.int64]
    first_frames: NDArray[np.int64]
    log_densities: NDArray[np.float64]

    def positions(self, n_frames: int) -> NDArray[np.float64]:
        """Positions by frame and track, shape (n_frames, K, D), NaN outside a track's span."""
        K = len(self.first_frames)
        dense = np.full((n_frames, K, self.means.shape[1]), np.nan)
        track = np.repeat(np.arange(K), np.diff(self.offsets))
        row = np.arange(len(self.means))
        dense[self.first_frames[track] + row - self.offsets[track], track] = self.means[:, :, 0]
        return dense


def _states(tracks: Tracks, model: TrackingModel, *, smoothed: bool) -> States:
    check_kind("tracks", tracks, Tracks, "am.track(detections)")
    check_kind("model", model, TrackingModel, "am.estimate_model(detections).model")
    d = tracks.detections
    order, offsets = tracks.by_track
    frames = d.frame_of[order]
    kind, F, Q = steps_of(model.motion, d.times)
    points = with_noise(d.points, d.covariances)[order]
    means, covariances, rows, densities = _engine.filter_tracks(
        motion_model(model, d.n_axes), points, frames, offsets, d.times, kind, F, Q, smoothed
    )  # fmt: skip
    first = np.zeros(tracks.n_tracks, dtype=np.int64)
    has_any = tracks.lengths > 0
    first[has_any] = frames[offsets[:-1][has_any]]
    log_densities = np.zeros(d.n_points)
    log_densities[order] = densities
    return States(
        means=means,
        covariances=covariances,
        offsets=rows,
        first_frames=first,
        log_densities=log_densities,
    )


def filter_states(tracks: Tracks, model: TrackingModel) -> States:
    """Kalman filter of every track: its state given its past and present.

    Parameters
    ----------
    tracks : Tracks
        The tracks.
    model : TrackingModel
        Its motion and its noise are used.

    Returns
    -------
    States
    """
    return _states(tracks, model, smoothed=False)


def smooth(tracks: Tracks, model: TrackingModel) -> States:
    """Rauch-Tung-Striebel smoother of every track: its state given the whole take.

    Rauch, Tung & Striebel 1965, AIAA Journal 3(8).

    Parameters
    ----------
    tracks : Tracks
        The tracks.
    model : TrackingModel
        Its motion and its noise are used.

    Returns
    -------
    States
        The log densities are those of the forward filter.
    """
    return _states(tracks, model, smoothed=True)
