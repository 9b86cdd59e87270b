"""Detections without a track that fit the gap of one, taken into this track."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING

import numpy as np

from asterism.tracking.attempts.near_markers import with_clutter_near_markers
from asterism.tracking.filling.estimates import DenseTracks, estimate
from asterism.tracking.filling.gaps import LONGEST
from asterism.tracking.filling.scores import settle
from asterism.tracking.filling.spans import Span, find_gaps

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from asterism.model import TrackingModel, Tracks
    from asterism.tracking.stitching import Stitching

__all__ = ["MAX_CELLS", "with_detections_in_gaps"]

DEGREES = 3.0
"""Degrees of freedom of Student's t, the distribution of a detection around the fill of a gap.
Jolts that the motion model excludes are in its tails."""
ENOUGH = 6.0
"""Log odds from which a detection is taken, as those of a lost marker."""
LEAD = 3.0
"""Log odds by which it must exceed those of others for the gap, and of other gaps for it."""
MARGIN = 2.0
"""Factor of the largest deviation of a track from straight lines of the length of a gap, within
which detections are compared with its fill; but at least the distance of `_reach`."""
MAX_GAPS = 3000
"""Largest number of gaps that are filled; each takes some milliseconds."""
MAX_LINES = 400
"""Number of such lines, spread over the capture."""
MAX_CELLS = 30_000_000
"""Largest product of frames and tracks; positions of so many take 0.7 GB."""


def with_detections_in_gaps(found: Stitching, model: TrackingModel) -> Stitching:
    """Add detections without a track to stitched tracks that have a gap there.

    A track may lose its marker where it moves by more than the model admits. A gap is filled as by
    `fill_gaps`, with a standard deviation. The hypothesis that a detection in it is of the marker
    is compared with a missed detection and clutter, as dense as near other markers. It is added if
    its log odds exceed `ENOUGH`, so that the link is no uncertain decision, and those of all other
    hypotheses for the gap in this frame, and for the detection, by `LEAD`.

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
    tracks = found.tracks
    if tracks.detections.n_frames * tracks.n_tracks > MAX_CELLS:
        return found
    taken, before, log_odds = _clear(found, model)
    labels, tracklets = tracks.labels.copy(), found.tracklets.copy()
    labels[taken], tracklets[taken] = labels[before], tracklets[before]
    confidence = None if tracks.confidence is None else tracks.confidence.copy()
    if confidence is not None:
        confidence[taken] = 1 / (1 + np.exp(-log_odds))
    info = {**tracks.info, "in_gaps": int(tracks.info.get("in_gaps", 0)) + len(taken)}
    tracks = dataclasses.replace(tracks, labels=labels, confidence=confidence, info=info)
    return dataclasses.replace(found, tracks=tracks, tracklets=tracklets)


def _clear(
    found: Stitching, model: TrackingModel
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]:
    """Return detections that are clearly in a gap, those before the gap, and the log odds."""
    tracks, d = found.tracks, found.tracks.detections
    free = np.flatnonzero(found.tracklets < 0)
    if not len(free):
        return free, free, np.empty(0)
    dense = DenseTracks(times=d.times, positions=tracks.positions(), model=model)
    model = with_clutter_near_markers(model, tracks)
    at, track, log_odds, before = [free[:0]], [free[:0]], [np.empty(0)], [free[:0]]
    for span, inside in _compared(dense, free, d.points, d.frame_of, _reach(model, d.n_axes)):
        fill, frame = settle(estimate(dense, span)), d.frame_of[inside]
        n = frame - span.first
        squared = ((d.points[inside] - fill.points[n]) ** 2).sum(axis=1)
        at.append(inside)
        track.append(np.full(len(inside), span.track))
        log_odds.append(
            _log_density(squared, fill.stds[n] ** 2 + model.sensor.noise_sigma**2, d.n_axes)
            + _log_odds_of_detection(frame == span.first, frame == span.last, model)
            - math.log(model.sensor.clutter_density)
        )
        before.append(np.full(len(inside), _last(tracks, span)))
    one, other, odds = np.concatenate(at), np.concatenate(track), np.concatenate(log_odds)
    gap = other * d.n_frames + d.frame_of[one]
    is_clear = odds > ENOUGH
    for key in (one, gap):
        is_clear &= odds > _best_other(key, odds) + LEAD
    return one[is_clear], np.concatenate(before)[is_clear], odds[is_clear]


def _compared(
    dense: DenseTracks,
    free: NDArray[np.int64],
    points: NDArray[np.float64],
    frame_of: NDArray[np.int64],
    min_reach: float,
) -> list[tuple[Span, NDArray[np.int64]]]:
    """Find gaps of one frame, or of at most `LONGEST`, with the free detections near a line.

    Near is within `MARGIN` times the largest deviation of the track from such lines elsewhere, and
    within the given distance, metres. Of more than `MAX_GAPS` those with the nearest are returned.
    """
    reach: dict[tuple[int, int], float] = {}
    spans, frame = find_gaps(dense.seen), frame_of[free]
    firsts = np.searchsorted(frame, [span.first for span in spans])
    ends = np.searchsorted(frame, [span.last + 1 for span in spans])
    found: list[tuple[Span, NDArray[np.int64]]] = []
    nearest: list[float] = []
    for span, first, end in zip(spans, firsts.tolist(), ends.tolist(), strict=True):
        # Rounded to nanoseconds, because times such as k / 120 differ in their last bits.
        seconds = round(float(dense.times[span.last + 1] - dense.times[span.first - 1]), 9)
        if first == end or (seconds > LONGEST and span.length > 1):
            continue
        y, key = dense.positions[:, span.track], (span.track, span.length)
        if key not in reach:
            reach[key] = max(MARGIN * _largest_deviation(y, span.length), min_reach)
        inside = free[first:end]
        share = (frame[first:end] - span.first + 1)[:, None] / (span.length + 1)
        line = (1 - share) * y[span.first - 1] + share * y[span.last + 1]
        off = np.linalg.norm(points[inside] - line, axis=1)
        if (near := off <= reach[key]).any():
            found.append((span, inside[near]))
            nearest.append(off.min())
    order = np.sort(np.argsort(nearest, kind="stable")[:MAX_GAPS])
    return [found[n] for n in order]


def _reach(model: TrackingModel, n_axes: int) -> float:
    """Return the distance at which a detection and clutter are equal if a fill has only noise."""
    sensor, shape = model.sensor, (DEGREES + n_axes) / 2
    peak = _log_density(np.zeros(1), np.full(1, sensor.noise_sigma**2), n_axes)[0]
    n = (peak - math.log(sensor.clutter_density)) / shape
    return sensor.noise_sigma * math.sqrt((DEGREES - 2) * math.expm1(max(n, 0.0)))


def _largest_deviation(y: NDArray[np.float64], length: int) -> float:
    """Return the largest distance from lines between detections with so many frames between.

    Parameters
    ----------
    y : ndarray of shape (T, D)
        Positions, metres, NaN where not measured.
    length : int
        Number of frames between.
    """
    starts = np.arange(len(y) - length - 1)
    starts = starts[np.isfinite(y[starts, 0] + y[starts + length + 1, 0])]
    starts = starts[:: -(-len(starts) // MAX_LINES) or 1]
    largest = 0.0
    for n in range(1, length + 1):
        share = n / (length + 1)
        off = y[starts + n] - (1 - share) * y[starts] - share * y[starts + length + 1]
        largest = np.fmax(largest, np.nanmax((off**2).sum(axis=1), initial=0.0))
    return math.sqrt(largest)


def _last(tracks: Tracks, span: Span) -> int:
    """Return the last detection of a track before a gap."""
    order, offsets = tracks.by_track
    own = order[offsets[span.track] : offsets[span.track + 1]]
    return int(own[np.searchsorted(tracks.detections.frame_of[own], span.first) - 1])


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
