"""Detections without a track that fit the gap of one, taken into this track."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING

import numpy as np

from asterism.filter import smooth_states
from asterism.tracking.attempts.near_markers import with_clutter_near_markers

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from asterism.model import TrackingModel, Tracks
    from asterism.tracking.stitching import Stitching

__all__ = ["with_detections_in_gaps"]

DEGREES = 3.0
"""Degrees of freedom of Student's t, the distribution of a detection around its expected place."""
JOLT = 4.0
"""Factor of its standard deviation: a detection without a track is one that the motion model did
not expect."""
MIN_LOG_ODDS = 6.0
"""Log odds from which a detection is taken, as those of a lost marker."""
LEAD = 3.0
"""Log odds by which it must exceed those of others for the gap, and of other gaps for it."""
MAX_SHARE = 0.9
"""Largest variance of a smoothed position, in variances of the sensor, with which the error of a
detection counts. Beyond, the position is smoothed almost from this detection alone."""
N_PRIOR = 20
"""Number of detections with the expected error that count besides those of a track."""
BLOCK = 2_000_000
"""Largest number of frames times tracks at once; their states take 0.3 GB."""
MARGIN = 500
"""Number of frames before and after a block that are smoothed with it."""
PAIRS = 1_000_000
"""Number of hypotheses that are compared at once."""


def with_detections_in_gaps(found: Stitching, model: TrackingModel) -> Stitching:
    """Add detections without a track to stitched tracks that have a gap there.

    A track may lose its marker where it moves by more than the model admits. The hypothesis that a
    detection in a gap is of the marker is compared with a missed detection and clutter, as dense as
    near other markers. The marker is expected at the position that is smoothed from its detections,
    with `JOLT` times the usual error of its detections. One is added if its log odds exceed
    `MIN_LOG_ODDS`, so that the link is no uncertain decision, and those of all other hypotheses for
    the gap in this frame, and for the detection, by `LEAD`.

    Parameters
    ----------
    found : Stitching
        Stitched tracks.
    model : TrackingModel
        Model with which they were tracked.

    Returns
    -------
    Stitching
        Each such detection is in the tracklet before it. ``tracks.info["in_gaps"]`` is their
        number.

    Examples
    --------
    >>> import asterism as am
    >>> truth = am.simulate.cube(frames=60, seed=1)
    >>> d = truth.detections
    >>> model = am.estimate_model(d).model
    >>> labels = truth.labels.copy()
    >>> labels[d.offsets[30]] = -1
    >>> missed = am.Tracks(detections=d, labels=labels)
    >>> with_detections_in_gaps(am.stitch(missed, model), model).tracks.info["in_gaps"]
    1
    """
    tracks, tracklets = found.tracks, found.tracklets.copy()
    taken, track, log_odds = _clear(found, model)
    labels = tracks.labels.copy()
    labels[taken], tracklets[taken] = track, tracklets[_before(tracks, taken, track)]
    confidence = None if tracks.confidence is None else tracks.confidence.copy()
    if confidence is not None:
        confidence[taken] = 1 / (1 + np.exp(-log_odds))
    info = {**tracks.info, "in_gaps": int(tracks.info.get("in_gaps", 0)) + len(taken)}
    tracks = dataclasses.replace(tracks, labels=labels, confidence=confidence, info=info)
    return dataclasses.replace(found, tracks=tracks, tracklets=tracklets)


def _clear(
    found: Stitching, model: TrackingModel
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]:
    """Return detections that are clearly in a gap, the tracks of the gaps, and the log odds."""
    tracks, d = found.tracks, found.tracks.detections
    is_free, near = found.tracklets < 0, with_clutter_near_markers(model, tracks)
    n = max(BLOCK // max(tracks.n_tracks, 1), 1)
    blocks = []
    for first in range(0, d.n_frames, n):
        begin, end = max(first - MARGIN, 0), min(first + n + MARGIN, d.n_frames)
        start = int(d.offsets[begin])
        one, track, log_odds = _hypotheses(
            tracks.part(begin, end), is_free[start : d.offsets[end]], model, near
        )
        one += start
        is_own = (d.frame_of[one] >= first) & (d.frame_of[one] < first + n)
        blocks.append((one[is_own], track[is_own], log_odds[is_own]))
    one, track, log_odds = (np.concatenate(each) for each in zip(*blocks, strict=True))
    is_clear = log_odds > MIN_LOG_ODDS
    for key in (one, track * d.n_frames + d.frame_of[one]):
        is_clear &= log_odds > _best_other(key, log_odds) + LEAD
    return one[is_clear], track[is_clear], log_odds[is_clear]


def _hypotheses(
    tracks: Tracks, is_free: NDArray[np.bool_], model: TrackingModel, near: TrackingModel
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]:
    """Return every free detection in a frame of a gap, the track, and the log odds that it is in.

    Those whose log odds are too small to matter are left out.

    Parameters
    ----------
    tracks : Tracks
        Tracks.
    is_free : ndarray of bool, shape (N,)
        True for detections that may be taken.
    model : TrackingModel
        Model of the motion.
    near : TrackingModel
        Model of detections and clutter.
    """
    d, H = tracks.detections, model.motion.modes[0].observation
    states = smooth_states(tracks, model)
    places, variances = states.means @ H, (states.covariances @ H) @ H
    n_of = np.diff(states.offsets)
    track, row_of = np.repeat(np.arange(len(n_of)), n_of), states.offsets[:-1] - states.first_frames
    frame = np.arange(len(track)) - row_of[track]
    own = np.flatnonzero(tracks.labels >= 0)
    label = tracks.labels[own]
    row = row_of[label] + d.frame_of[own]
    error = d.points[own] - places[row]
    usual = _usual_variance(label, error, variances[row], model.sensor.noise_sigma**2, len(n_of))
    is_missed = np.ones(len(track), dtype=bool)
    is_missed[row] = False
    free = np.flatnonzero(is_free)
    found = []
    for gap, n in _pairs(np.flatnonzero(is_missed), frame, d.frame_of[free], d.n_frames):
        one = free[n]
        is_first, is_last = ~is_missed[gap - 1], ~is_missed[gap + 1]
        variance = usual[track[gap]] * (variances[gap] + model.sensor.noise_sigma**2)
        squared = ((d.points[one] - places[gap]) ** 2).sum(axis=1)
        log_odds = (
            _log_density(squared, JOLT**2 * variance, d.n_axes)
            + _log_odds_of_detection(is_first, is_last, near)
            - math.log(near.sensor.clutter_density)
        )
        matters = log_odds > MIN_LOG_ODDS - LEAD
        found.append((one[matters], track[gap][matters], log_odds[matters]))
    one, of, log_odds = (np.concatenate(each) for each in zip(*found, strict=True))
    return one, of, log_odds


def _pairs(
    missed: NDArray[np.int64], frame: NDArray[np.int64], free: NDArray[np.int64], n_frames: int
) -> Iterator[tuple[NDArray[np.int64], NDArray[np.int64]]]:
    """Yield the states and the free detections of the same frame, some pairs at a time.

    Parameters
    ----------
    missed : ndarray of int
        States without a detection.
    frame : ndarray of int, shape (M,)
        Frame of each state.
    free : ndarray of int
        Frame of each free detection, in order.
    n_frames : int
        Number of frames.
    """
    ends = np.cumsum(np.bincount(free, minlength=n_frames))
    n = np.diff(ends, prepend=0)[frame[missed]]
    total = np.cumsum(n)
    cuts = np.searchsorted(total, np.arange(PAIRS, total[-1] if len(n) else 0, PAIRS))
    for some in np.split(np.arange(len(n)), cuts):
        k = n[some]
        last = np.repeat(ends[frame[missed[some]]] - np.cumsum(k), k)
        yield np.repeat(missed[some], k), last + np.arange(len(last))


def _usual_variance(
    track: NDArray[np.int64],
    error: NDArray[np.float64],
    variance: NDArray[np.float64],
    noise: float,
    n_tracks: int,
) -> NDArray[np.float64]:
    """Return the mean squared error of the detections of each track, relative to that expected.

    The error is that against the position smoothed from all others. From the one smoothed from all,
    with the variance P where that of the sensor is r, it follows as error / (1 - P / r), with the
    variance r / (1 - P / r).

    Parameters
    ----------
    track : ndarray of int, shape (n,)
        Track of each detection.
    error : ndarray of shape (n, D)
        Difference from the smoothed position, metres.
    variance : ndarray of shape (n,)
        Variance of a coordinate of the smoothed position, m².
    noise : float
        Variance of the sensor, m².
    n_tracks : int
        Number of tracks K.
    """
    share = variance / noise
    is_known = share <= MAX_SHARE
    squared = (error[is_known] ** 2).mean(axis=1) / ((1 - share[is_known]) * noise)
    of = track[is_known]
    n, total = (np.bincount(of, weights, n_tracks) for weights in (None, squared))
    return (total + N_PRIOR) / (n + N_PRIOR)


def _before(
    tracks: Tracks, detections: NDArray[np.int64], track: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Return the last detection of each track before a detection in one of its gaps."""
    n_frames, frame_of = tracks.detections.n_frames, tracks.detections.frame_of
    order, _ = tracks.by_track
    keys = tracks.labels[order] * n_frames + frame_of[order]
    return order[np.searchsorted(keys, track * n_frames + frame_of[detections]) - 1]


def _best_other(key: NDArray[np.int64], odds: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return for each hypothesis the largest log odds of the others with the same key."""
    order = np.lexsort((-odds, key))
    is_first = np.diff(key[order], prepend=-1) != 0
    starts = np.flatnonzero(is_first)
    ends = np.append(starts[1:], len(order))
    of = np.cumsum(is_first) - 1
    second = np.full(len(starts), -np.inf)
    has = ends - starts > 1
    second[has] = odds[order[starts[has] + 1]]
    found = np.empty(len(odds))
    found[order] = np.where(is_first, second[of], odds[order[starts[of]]])
    return found


def _log_density(
    squared: NDArray[np.float64], variance: NDArray[np.float64], n_axes: int
) -> NDArray[np.float64]:
    """Return the log density of Student's t with this variance of a coordinate."""
    scale2, shape = variance * (DEGREES - 2) / DEGREES, (DEGREES + n_axes) / 2
    constant = math.lgamma(shape) - math.lgamma(DEGREES / 2)
    return (
        constant
        - n_axes / 2 * np.log(math.pi * DEGREES * scale2)
        - shape * np.log1p(squared / (DEGREES * scale2))
    )


def _log_odds_of_detection(
    is_first: NDArray[np.bool_], is_last: NDArray[np.bool_], model: TrackingModel
) -> NDArray[np.float64]:
    """Return the prior log odds of a detection in frames of gaps, by the frames around.

    Parameters
    ----------
    is_first, is_last : ndarray of bool, shape (n,)
        Whether there is a detection in the frame before, and in the one after.
    """
    p, again = model.sensor.p_detection, model.sensor.p_after_miss
    of_before = np.where(is_first, math.log(p / (1 - p)), math.log(again / (1 - again)))
    of_after = np.where(is_last, math.log(p / again), math.log((1 - p) / (1 - again)))
    return of_before + of_after
