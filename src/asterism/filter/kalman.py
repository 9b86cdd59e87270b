"""States of tracks: filtered forward, or smoothed over the whole capture.

Symbols: n states an axis, D axes, K tracks. The axes of a track share one covariance.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from asterism import _engine
from asterism.checks import check_kind
from asterism.model import TrackingModel, Tracks
from asterism.model.compiled import motion_model, steps_of, with_noise
from asterism.records import record

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["States", "filter_states", "smooth_states"]


@record(eq=False)
class States:
    """States of K tracks, each from its first detection to its last, gaps included.

    Parameters
    ----------
    means : ndarray of shape (M, D, n)
        State of each axis: position, and velocity and acceleration if the motion has them; SI
        units.
    covariances : ndarray of shape (M, n, n)
        Covariance of the state, equal on every axis.
    offsets : ndarray of int, shape (K + 1,)
        Track ``k`` has the rows ``offsets[k]:offsets[k + 1]``, one for each frame.
    first_frames : ndarray of int, shape (K,)
        Frame of each track's first row.
    log_densities : ndarray of shape (N,)
        ``log N(y; ŷ, S)`` of each detection given the track's earlier detections; 0 for the first
        detection of a track and for clutter.

    Examples
    --------
    >>> import asterism as am
    >>> truth = am.simulate.cube(frames=20, seed=1)
    >>> states = filter_states(truth, am.estimate_model(truth.detections).model)
    >>> states
    States(8 tracks, 160 states of 3 × 2)
    >>> first = slice(states.offsets[0], states.offsets[1])  # the rows of track 0
    >>> states.means[first].shape
    (20, 3, 2)
    """

    means: NDArray[np.float64]
    covariances: NDArray[np.float64]
    offsets: NDArray[np.int64]
    first_frames: NDArray[np.int64]
    log_densities: NDArray[np.float64]

    def __repr__(self) -> str:
        _, D, n = self.means.shape
        return f"States({len(self.first_frames)} tracks, {len(self.means)} states of {D} × {n})"

    def positions(self, n_frames: int) -> NDArray[np.float64]:
        """Return positions by frame and track, NaN outside a track's span.

        Parameters
        ----------
        n_frames : int
            Number of frames of the capture.

        Returns
        -------
        ndarray of shape (n_frames, K, D)
            Positions, metres; gaps inside a track hold the estimated position.

        Examples
        --------
        >>> import asterism as am
        >>> truth = am.simulate.cube(frames=20, seed=1)
        >>> states = filter_states(truth, am.estimate_model(truth.detections).model)
        >>> states.positions(20).shape
        (20, 8, 3)
        """
        K = len(self.first_frames)
        dense = np.full((n_frames, K, self.means.shape[1]), np.nan)
        track = np.repeat(np.arange(K), np.diff(self.offsets))
        row = np.arange(len(self.means))
        dense[self.first_frames[track] + row - self.offsets[track], track] = self.means[:, :, 0]
        return dense


def _for_engine(tracks: Tracks, model: TrackingModel) -> tuple[Any, ...]:
    check_kind("tracks", tracks, Tracks, "am.track(detections)")
    check_kind("model", model, TrackingModel, "am.estimate_model(detections).model")
    d = tracks.detections
    order, offsets = tracks.by_track
    points = with_noise(d.points, d.covariances)[order]
    motion, steps = motion_model(model, d.n_axes), steps_of(model.motion, d.times)
    return motion, points, d.frame_of[order], offsets, d.times, *steps


def _of_detections(tracks: Tracks, values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Reorder values of tracked detections from track order to input order; 0 for clutter."""
    out = np.zeros(tracks.detections.n_points)
    out[tracks.by_track[0]] = values
    return out


def _states(tracks: Tracks, model: TrackingModel, *, smoothed: bool) -> States:
    means, covariances, rows, densities = _engine.filter_tracks(
        *_for_engine(tracks, model), smooth=smoothed
    )
    order, offsets = tracks.by_track
    first = np.zeros(tracks.n_tracks, dtype=np.int64)
    has_any = tracks.lengths > 0
    first[has_any] = tracks.detections.frame_of[order[offsets[:-1][has_any]]]
    return States(
        means=means,
        covariances=covariances,
        offsets=rows,
        first_frames=first,
        log_densities=_of_detections(tracks, densities),
    )


def filter_states(tracks: Tracks, model: TrackingModel) -> States:
    """Estimate the state of every track from its past and present by a Kalman filter.

    Parameters
    ----------
    tracks : Tracks
        Tracks to filter, each from its first detection to its last.
    model : TrackingModel
        Model whose motion and noise are used.

    Returns
    -------
    States
        Filtered states.

    Examples
    --------
    >>> import asterism as am
    >>> truth = am.simulate.cube(frames=20, seed=1)
    >>> states = filter_states(truth, am.estimate_model(truth.detections).model)
    >>> position, velocity = states.means[19].T  # of the first track in the last frame
    >>> velocity.shape
    (3,)
    """
    return _states(tracks, model, smoothed=False)


def smooth_states(tracks: Tracks, model: TrackingModel) -> States:
    """Estimate the state of every track from the whole capture by a Rauch-Tung-Striebel smoother.

    Rauch, Tung & Striebel 1965, AIAA Journal 3(8).

    Parameters
    ----------
    tracks : Tracks
        Tracks to smooth.
    model : TrackingModel
        Model whose motion and noise are used.

    Returns
    -------
    States
        Smoothed states, with the log densities of the forward filter.

    Examples
    --------
    >>> import asterism as am
    >>> truth = am.simulate.cube(frames=20, seed=1)
    >>> model = am.estimate_model(truth.detections).model
    >>> smoothed, filtered = smooth_states(truth, model), filter_states(truth, model)
    >>> bool((smoothed.covariances[10] <= filtered.covariances[10]).all())
    True
    """
    return _states(tracks, model, smoothed=True)
