"""Assignment of detections once more, given the distances that tracks keep."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism.tracking.confidence.calibration import log_odds
from asterism.tracking.estimation.evidence import Region
from asterism.tracking.rigidity.profiles import learn_profiles

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from asterism.model import Tracks
    from asterism.tracking.stitching import Stitching

__all__ = ["PROBABLE", "UNCERTAIN", "ghost_log_odds", "reassigned"]

UNCERTAIN = 0.8
"""Confidence of an identity below which a correction assigns a detection again."""
PROBABLE = float(np.log(20))
"""Log odds that a detection without a track must have to be taken."""
CHANGE = 0.2
"""Log odds that a change must gain, so that labels of equal odds do not alternate."""
ROUNDS = 3
"""Largest number of times that all frames are assigned, each with the distances learnt anew."""
REACH = 8
"""Number of frames before and after a detection by which its motion is predicted."""


def reassigned(
    tracks: Tracks,
    is_open: NDArray[np.bool_],
    ghost: NDArray[np.float64],
    noise_sigma: float,
) -> NDArray[np.int64]:
    """Assign the open detections to the tracks, frame by frame and pair by pair; all others stay.

    First each frame has the assignment with the largest sum of log odds, given the labels of the
    others. Then each pair of tracks is exchanged in the most probable frames, given the other
    tracks: two tracks that are exchanged over a run of frames fit each other there, so that no
    single frame shows it. The log odds are those of the distances to the other tracks in the frame,
    against an unknown marker, and of smooth motion between the frames around it, against clutter.
    A detection goes to a track only by distances: one of independent markers stays where it is.

    Parameters
    ----------
    tracks : Tracks
        Tracks of a capture.
    is_open : ndarray of bool, shape (N,)
        Detections that may go to another track, or become clutter.
    ghost : ndarray of shape (N,)
        Log odds of each detection without a track being a ghost, as of `ghost_log_odds`.
    noise_sigma : float
        Standard deviation of a coordinate, metres.

    Returns
    -------
    ndarray of int, shape (N,)
        Track of each detection, -1 for clutter.
    """
    d, labels = tracks.detections, tracks.labels.astype(np.int64)
    points, offsets = np.ascontiguousarray(d.points), d.offsets.astype(np.int64)
    n_clutter = max(int((labels < 0).sum()), 1)
    log_clutter = float(np.log(n_clutter / (d.n_frames * Region.of(d).volume)))
    sigma = _roughness(tracks) + noise_sigma
    for _ in range(ROUNDS):
        engine = learn_profiles(d, labels, noise_sigma).engine
        found = engine.assigned(
            points, labels, offsets, is_open, ghost + PROBABLE, sigma[: labels.max(initial=-1) + 1],
            log_clutter=log_clutter, change=CHANGE, max_gap=REACH,
        )  # fmt: skip
        if np.array_equal(found, labels):
            break
        labels = found
    return labels


def ghost_log_odds(tracks: Tracks, stitching: Stitching | None) -> NDArray[np.float64]:
    """Return the log odds of the tracklet of each detection being a ghost, 0 for others, (N,).

    Parameters
    ----------
    tracks : Tracks
        Tracks of a capture.
    stitching : Stitching, optional
        Stitching that made the tracks of the same detections.
    """
    found = np.zeros(len(tracks.labels))
    if stitching is not None:
        is_ghost = (tracks.labels < 0) & (stitching.tracklets >= 0)
        found[is_ghost] = log_odds(stitching.probabilities[stitching.tracklets[is_ghost]])
    return found


def _roughness(tracks: Tracks) -> NDArray[np.float64]:
    """Return the median deviation of each track from a cubic through four neighbours, (K,).

    A track without five successive frames has that of all tracks.
    """
    order, _ = tracks.by_track
    d = tracks.detections
    track, y = tracks.labels[order], d.points[order]
    n = max(len(order) - 4, 0)
    frame = d.frame_of[order].astype(np.int64)
    is_run = (track[4:] == track[:n]) & (frame[4:] - frame[:n] == 4)
    off = y[2 : n + 2] - (4 * (y[1 : n + 1] + y[3 : n + 3]) - y[:n] - y[4:]) / 6
    off = np.sqrt((off[is_run] ** 2).mean(axis=1))
    own = track[:n][is_run]
    found = np.full(tracks.n_tracks, np.median(off) if len(off) else 0.0)
    by = np.argsort(own, kind="stable")
    for part in np.split(by, np.flatnonzero(np.diff(own[by])) + 1):
        if len(part):
            found[own[part[0]]] = np.median(off[part])
    return found
