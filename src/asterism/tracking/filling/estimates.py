"""Three estimators of an occluded marker: its own motion, its rigid body, and the pattern.

Each estimates the marker in the gap and in held-out windows of the same length, with the same
frames known at the ends and the same helper markers detected.

Symbols: T frames, K tracks, D axes, H windows, W frames of a window, L of them missing.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from asterism.filter import smooth_states
from asterism.model import Detections, Tracks
from asterism.tracking.filling.ends import CAREFUL, Bridges, bridges, is_steady
from asterism.tracking.filling.neighbours import Body, fit_body
from asterism.tracking.filling.patterns import learn_pattern
from asterism.tracking.filling.spans import NEAREST_ENDS, find_gaps, held_out, usable_ends
from asterism.tracking.rigidity.distances import MIN_TOGETHER, distances_from

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from asterism.model import TrackingModel
    from asterism.tracking.filling.spans import Span

__all__ = ["DenseTracks", "Estimate", "Estimates", "estimate"]

MAX_WINDOWS, MIN_WINDOWS, MAX_WITHHELD = 40, 16, 1200
"""Largest and smallest number of windows, and largest number of frames withheld in all of them."""
MAX_HELPERS = 14
"""Number of helper markers of the pattern; the `MAX_NEIGHBOURS` steadiest ones form the body."""
MAX_NEIGHBOURS = 6
MIN_SHARE = 0.5
"""Smallest share of the marker's frames in which a helper was detected too, because a rarely
detected helper would exclude many frames."""
MIN_PATTERN = 40
"""Smallest number of frames from which a pattern is estimated."""
MAX_SPREAD = 500
"""Number of frames, spread over the capture, from which body and pattern are estimated, besides
the frames of the windows."""
MAX_COMPARED = 400
"""Number of frames in which distances are compared."""
MIN_SPREAD = 1e-4
"""Lower bound of the spread of a neighbour's distance, metres."""
MAX_SMOOTHED_GAP = 3
"""Longest gap of a helper, frames, that is filled by the smoother before the estimation. With
independent missed detections there is hardly a frame with detections of all helpers."""


@dataclass(frozen=True, eq=False, kw_only=True)
class DenseTracks:
    """Positions of all tracks in all frames, with the tracking model.

    Parameters
    ----------
    times : ndarray of shape (T,)
        Times of the frames, seconds.
    positions : ndarray of shape (T, K, D)
        Positions, metres, NaN where not measured.
    model : TrackingModel
        Model whose motion and noise are used.
    """

    times: NDArray[np.float64]
    positions: NDArray[np.float64]
    model: TrackingModel

    @cached_property
    def seen(self) -> NDArray[np.bool_]:
        """True where each track was measured, shape (T, K)."""
        return np.isfinite(self.positions[..., 0])

    @cached_property
    def smoothed(self) -> NDArray[np.float64]:
        """Positions with gaps of up to `MAX_SMOOTHED_GAP` frames smoothed, shape (T, K, D)."""
        short = [span for span in find_gaps(self.seen) if span.length <= MAX_SMOOTHED_GAP]
        if not short:
            return self.positions
        found = self.positions.copy()
        tracks = Tracks.from_dense(self.times, self.positions)
        states = smooth_states(tracks, self.model)
        at = states.offsets[:-1] - states.first_frames
        H = self.model.motion.modes[0].observation
        for span in short:
            found[span.frames, span.track] = states.means[at[span.track] + span.frames] @ H
        return found

    def steadiest(self, track: int) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Return the tracks often detected with a track, and the spreads of their distances to it.

        The steadiest one is the first; spreads are metres. What is found is kept for the next gap.
        """
        if track not in self._steadiest:
            mine = np.flatnonzero(self.seen[:, track])
            is_often = self.known[mine].sum(axis=0) >= max(MIN_SHARE * len(mine), MIN_TOGETHER)
            is_often[track] = False
            others = np.flatnonzero(is_often)
            compared = mine[:: -(-len(mine) // MAX_COMPARED)]
            theirs = self.smoothed[compared][:, others]
            spreads = distances_from(self.positions[compared, track], theirs).spread
            order = np.argsort(spreads, kind="stable")
            self._steadiest[track] = others[order], spreads[order]
        return self._steadiest[track]

    @cached_property
    def _steadiest(self) -> dict[int, tuple[NDArray[np.int64], NDArray[np.float64]]]:
        return {}

    @cached_property
    def known(self) -> NDArray[np.bool_]:
        """True where each track was measured or smoothed, shape (T, K)."""
        return np.isfinite(self.smoothed[..., 0])


@dataclass(frozen=True, eq=False, kw_only=True)
class Estimate:
    """Positions of the marker by one estimator.

    Parameters
    ----------
    name : str
        Name of the estimator.
    values : ndarray of shape (H + 1, L, D)
        Estimated positions in each window and, last, in the gap, metres.
    variances : ndarray of shape (L,)
        Variance of a coordinate in the gap according to the estimator itself, m².
    """

    name: str
    values: NDArray[np.float64]
    variances: NDArray[np.float64]


@dataclass(frozen=True, eq=False, kw_only=True)
class Estimates:
    """Estimates of one gap by all estimators.

    Parameters
    ----------
    each : tuple of Estimate
        One to three estimates.
    truth : ndarray of shape (H, L, D)
        Withheld positions in the windows, metres; NaN where the marker was not detected.
    windows : ndarray of int, shape (H, W)
        Frames of the windows.
    n_neighbours : int
        Number of markers of the body.
    """

    each: tuple[Estimate, ...]
    truth: NDArray[np.float64]
    windows: NDArray[np.int64]
    n_neighbours: int


def estimate(dense: DenseTracks, span: Span) -> Estimates:
    """Estimate a marker in a gap and in held-out windows of the same length.

    Parameters
    ----------
    dense : DenseTracks
        Positions of all tracks.
    span : Span
        Gap of one of them.

    Returns
    -------
    Estimates
    """
    k = span.track
    X, own = dense.smoothed, dense.seen[:, k]
    ends = usable_ends(own, span)
    helpers, spreads = _helpers(dense, span, ends)
    helped = np.logical_and.reduce(dense.known[:, helpers], axis=1)
    known = own & helped
    ends = ends[helped[ends]]
    frames = np.sort(np.concatenate([ends, span.frames]))
    is_end = (frames < span.first) | (frames > span.last)
    max_windows = max(MIN_WINDOWS, min(MAX_WINDOWS, MAX_WITHHELD // span.length))
    windows = held_out(own, dense.known[:, k], helped, frames, span, max_windows)
    spread = np.flatnonzero(known)
    spread = spread[:: -(-len(spread) // MAX_SPREAD)]
    rows = np.unique(np.concatenate([windows.ravel(), frames, spread]))
    neighbours = helpers[:MAX_NEIGHBOURS]
    weights = 1 / (spreads[:MAX_NEIGHBOURS] ** 2 + max(spreads.min(initial=1.0), MIN_SPREAD) ** 2)
    body = fit_body(X[rows][:, neighbours], weights)
    places = body.to_body(X[rows, k])
    is_known = known[rows]
    is_reliable = np.ones(len(frames), dtype=bool)
    is_reliable[is_end] = is_steady(
        places[np.searchsorted(rows, ends)], ends, span, _usual_jump(places, rows, is_known)
    )
    frames, is_end, windows = frames[is_reliable], is_end[is_reliable], windows[:, is_reliable]
    every = np.concatenate([windows, frames[None]])
    found = [_smoother(dense, every, is_end, k)]
    if len(helpers):
        at = np.searchsorted(rows, every)
        mean = places[is_known].mean(axis=0)
        ways = bridges(dense.times[every], is_end)
        room = _Room(body=body.of(at[:, ~is_end].ravel()), mean=mean)
        places = places - mean
        rigid = np.full(span.length, (places[is_known] ** 2).mean())
        rigid *= _caution(is_known.sum() / span.length)
        there = places[at]
        there[~own[every] & ~is_end] = np.nan  # smoothed positions are no ground truth
        found.append(
            carried_estimate("body", np.zeros((*every.shape, X.shape[2])), there, is_end, ways,
                     room, rigid)
        )  # fmt: skip
        if is_known.sum() >= MIN_PATTERN:
            Z = body.to_body(X[rows][:, helpers]).reshape(len(rows), -1)
            pattern = learn_pattern(Z, places, is_known, span.length)
            # A window is predicted as a whole from the fold that excludes its middle.
            fold = pattern.fold[at[:-1, at.shape[1] // 2]]
            base = [pattern.by_fold[fold[:, None], at[:-1]], pattern.by_all[at[-1:]]]
            variances = pattern.variances[at[-1, ~is_end]]
            found.append(
                carried_estimate(
                    "pattern", np.concatenate(base), there, is_end, ways, room, variances
                )
            )
    return Estimates(
        each=tuple(found),
        truth=dense.positions[windows[:, ~is_end], k],
        windows=windows,
        n_neighbours=len(neighbours),
    )


def _helpers(
    dense: DenseTracks, span: Span, ends: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Find the helpers of a gap, steadiest first, and the spread of their distances, metres.

    Helpers are known throughout the gap and at both ends, and often detected together with the
    marker.
    """
    k, known = span.track, dense.known
    before, after = ends[ends < span.first], ends[ends > span.last]
    needed = np.concatenate([before[-NEAREST_ENDS:], span.frames, after[:NEAREST_ENDS]])
    mine = np.flatnonzero(dense.seen[:, k])
    candidates, spreads = dense.steadiest(k)
    is_there = known[needed][:, candidates].all(axis=0)
    others, spreads = candidates[is_there][:MAX_HELPERS], spreads[is_there][:MAX_HELPERS]
    # The number of helpers is limited so that most frames in which all are known remain.
    n_all = np.logical_and.accumulate(known[mine][:, others], axis=1).sum(axis=0)
    n = int((n_all >= MIN_SHARE * n_all.max(initial=0)).sum())
    return others[:n], spreads[:n]


def _usual_jump(
    places: NDArray[np.float64], rows: NDArray[np.int64], is_known: NDArray[np.bool_]
) -> float:
    """Return the 90th percentile of the error of a linear extrapolation of the position."""
    y = places[is_known]
    is_next = np.diff(rows[is_known]) == 1
    missed = np.linalg.norm(y[2:] - 2 * y[1:-1] + y[:-2], axis=1)[is_next[1:] & is_next[:-1]]
    return float(np.quantile(missed, 0.9)) if len(missed) else np.inf


def _caution(m: float) -> float:
    """Return the factor of a variance estimated from m stretches: ``(m + 1) / (m - 1)``.

    Stretches as long as the gap are assumed to be independent. For m near 1 and below, the
    denominator is limited to 0.2.
    """
    return (m + 1) / max(m - 1, 0.2)


def _smoother(
    dense: DenseTracks, every: NDArray[np.int64], is_end: NDArray[np.bool_], track: int
) -> Estimate:
    """Smooth the ends of all windows in one call, each as a track of its own."""
    ends = every[:, is_end]
    frames, labels = ends.ravel(), np.repeat(np.arange(len(ends)), ends.shape[1])
    order = np.argsort(frames, kind="stable")
    counts = np.bincount(frames, minlength=len(dense.times))
    pieces = Detections(
        times=dense.times,
        offsets=np.concatenate([[0], np.cumsum(counts)]),
        points=dense.smoothed[frames[order], track],
    )
    states = smooth_states(Tracks(detections=pieces, labels=labels[order]), dense.model)
    at = states.offsets[:-1, None] + every[:, ~is_end] - states.first_frames[:, None]
    H = dense.model.motion.modes[0].observation
    return Estimate(
        name="smoother",
        values=states.means[at] @ H,
        variances=H @ states.covariances[at[-1]] @ H,
    )


@dataclass(frozen=True, eq=False, kw_only=True)
class _Room:
    """Transformation from body to room coordinates for the missing frames of all windows."""

    body: Body
    mean: NDArray[np.float64]

    def __call__(self, places: NDArray[np.float64]) -> NDArray[np.float64]:
        flat = places.reshape(-1, places.shape[-1])
        return self.body.to_room(flat + self.mean).reshape(places.shape)


def carried_estimate(
    name: str,
    base: NDArray[np.float64],
    places: NDArray[np.float64],
    is_end: NDArray[np.bool_],
    ways: Bridges,
    room: _Room,
    variances: NDArray[np.float64],
) -> Estimate:
    """Correct an estimate by its residuals at the ends, with the best interpolator."""
    missed = places - base
    carried = ways.carry(missed[:, is_end])
    way = CAREFUL
    if len(base) > 1:
        off = carried[:, :-1] - missed[:-1, ~is_end]
        way = int(np.argmin(np.nanmean(off**2, axis=(1, 2, 3))))
    return Estimate(
        name=name,
        values=room(base[:, ~is_end] + carried[way]),
        variances=variances * ways.left,
    )
