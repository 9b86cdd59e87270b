"""Assignment of detections once more, given the distances that tracks keep."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism.tracking.confidence.calibration import log_odds
from asterism.tracking.estimation.evidence import Region
from asterism.tracking.rigidity.profiles import learn_profiles

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from asterism.model import Tracks
    from asterism.tracking.stitching import Stitching

__all__ = [
    "EVEN_ODDS",
    "PROBABLE",
    "ROUNDS",
    "UNCERTAIN",
    "gains",
    "ghost_log_odds",
    "reassigned",
]

UNCERTAIN = 0.8
"""Confidence of an identity below which a correction assigns a detection again."""
PROBABLE = float(np.log(20))
"""Log odds that a detection without a track must have to be taken."""
CHANGE = 0.2
"""Log odds that a change must gain, so that labels of equal odds do not alternate."""
ROUNDS = (PROBABLE,) * 3
"""Log odds of each time that all frames are assigned, with the distances learnt anew."""
EVEN_ODDS = (-PROBABLE, 0.0, 0.0)
"""The same at even odds, where a person confirms the result. The first round finds runs of
detections that support each other, of which no single one is probable."""
REACH = 8
"""Number of frames before and after a detection by which its motion is predicted."""


def reassigned(
    tracks: Tracks,
    is_open: NDArray[np.bool_],
    ghost: NDArray[np.float64],
    noise_sigma: float,
    rounds: Sequence[float] = ROUNDS,
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
    rounds : sequence of float
        Log odds that a detection without a track must have to be taken, of each round; the last
        rounds are left out if nothing changes.

    Returns
    -------
    ndarray of int, shape (N,)
        Track of each detection, -1 for clutter.
    """
    d, labels = tracks.detections, tracks.labels.astype(np.int64)
    points, offsets = np.ascontiguousarray(d.points), d.offsets.astype(np.int64)
    log_clutter, sigma = _log_clutter(tracks), _roughness(tracks) + noise_sigma
    for i, odds in enumerate(rounds):
        engine = learn_profiles(d, labels, noise_sigma).engine
        found = engine.assigned(
            points, labels, offsets, is_open, ghost + odds, sigma[: labels.max(initial=-1) + 1],
            log_clutter=log_clutter, change=CHANGE, max_gap=REACH,
        )  # fmt: skip
        if np.array_equal(found, labels) and len(set(rounds[i:])) == 1:
            break
        labels = found
    return labels


def gains(
    tracks: Tracks, after: NDArray[np.int64], ghost: NDArray[np.float64], noise_sigma: float
) -> NDArray[np.float64]:
    """Return the log odds that each detection gains by other labels, 0 where they are equal, (N,).

    They are those of the distances and the motion, as in `reassigned`.

    Parameters
    ----------
    tracks : Tracks
        Tracks of a capture.
    after : ndarray of int, shape (N,)
        Other labels, by which the distances are learnt.
    ghost, noise_sigma
        As for `reassigned`.
    """
    d, is_asked = tracks.detections, tracks.labels != after
    engine = learn_profiles(d, after, noise_sigma).engine
    sigma = (_roughness(tracks) + noise_sigma)[: after.max(initial=-1) + 1]
    before = np.where(tracks.labels < len(sigma), tracks.labels, -1).astype(np.int64)
    of_before, of_after = (
        engine.supports(
            np.ascontiguousarray(d.points), labels, d.offsets.astype(np.int64), is_asked, ghost,
            sigma, log_clutter=_log_clutter(tracks), max_gap=REACH,
        ) - np.where(labels < 0, 0.0, ghost) * is_asked
        for labels in (before, after)
    )  # fmt: skip
    return of_after - of_before


def _log_clutter(tracks: Tracks) -> float:
    """Return the log density of clutter."""
    d, n = tracks.detections, max(int((tracks.labels < 0).sum()), 1)
    return float(np.log(n / (d.n_frames * Region.of(d).volume)))


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
