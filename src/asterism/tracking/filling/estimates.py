"""Three ways of telling where a hidden marker was: its own motion, its body, and the pattern.

Each tells it for the gap and for windows in which the same was hidden on purpose: as many frames,
the same ends known, the same helpers seen.

Symbols: T frames, K tracks, D axes, H windows, W frames of a window, L of them hidden.
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

__all__ = ["Estimate", "Estimates", "Take", "estimate"]

MOST_WINDOWS, LEAST_WINDOWS, MOST_HIDDEN = 40, 16, 1200
"""Windows that are wanted, fewer of long gaps: so many that they hide `MOST_HIDDEN` frames."""
MOST_HELPERS = 14
"""Markers that the pattern looks at; the steadiest `MOST_NEIGHBOURS` of them are the body."""
MOST_NEIGHBOURS = 6
LEAST_SHARE = 0.5
"""Share of the marker's frames in which a helper must have been seen beside it: for a helper seen
rarely, much else would go unused."""
LEAST_PATTERN = 40
"""Frames from which a pattern may be learnt."""
MOST_LEARNT = 500
"""Frames spread over the take, from which body and pattern are learnt beside the windows'."""
MOST_COMPARED = 400
"""Frames in which distances are compared."""
STEADIEST = 1e-4
"""Metres; a neighbour is not believed to be steadier."""
BRIDGED = 3
"""A marker that is missing for so many frames is taken to be where its own motion leads, but where
that is the question: points that go missing at random leave hardly a frame in which all were
seen."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Take:
    """All tracks over time.

    Parameters
    ----------
    times : ndarray, shape (T,)
        Seconds.
    positions : ndarray, shape (T, K, D)
        Metres, NaN where not measured.
    model : TrackingModel
        Its motion and noise are used.
    """

    times: NDArray[np.float64]
    positions: NDArray[np.float64]
    model: TrackingModel

    @cached_property
    def seen(self) -> NDArray[np.bool_]:
        """Where each track was measured, shape (T, K)."""
        return np.isfinite(self.positions[..., 0])

    @cached_property
    def bridged(self) -> NDArray[np.float64]:
        """Positions, and those of gaps of up to `BRIDGED` frames by the smoother."""
        short = [span for span in find_gaps(self.seen) if span.length <= BRIDGED]
        if not short:
            return self.positions
        found = self.positions.copy()
        tracks = Tracks.from_dense(self.times, self.positions)
        states = smooth_states(tracks, self.model)
        at = states.offsets[:-1] - states.first_frames
        H = self.model.motion.modes[0].observation
        for span in short:
            found[span.hidden, span.track] = states.means[at[span.track] + span.hidden] @ H
        return found

    @cached_property
    def known(self) -> NDArray[np.bool_]:
        """Where each track was measured or bridged, shape (T, K)."""
        return np.isfinite(self.bridged[..., 0])


@dataclass(frozen=True, eq=False, kw_only=True)
class Estimate:
    """Where one estimator puts the marker.

    Parameters
    ----------
    name : str
        The estimator.
    values : ndarray, shape (H + 1, L, D)
        In each window and, last, in the gap; metres.
    variances : ndarray, shape (L,)
        Of a coordinate in the gap, as the estimator itself has it, m².
    """

    name: str
    values: NDArray[np.float64]
    variances: NDArray[np.float64]


@dataclass(frozen=True, eq=False, kw_only=True)
class Estimates:
    """What all estimators say of one gap.

    Parameters
    ----------
    each : tuple of Estimate
        One to three.
    truth : ndarray, shape (H, L, D)
        What was hidden in the windows, metres; NaN where the marker was not seen in truth.
    windows : ndarray of int, shape (H, W)
        Their frames.
    n_neighbours : int
        Markers of the body.
    """

    each: tuple[Estimate, ...]
    truth: NDArray[np.float64]
    windows: NDArray[np.int64]
    n_neighbours: int


def estimate(take: Take, span: Span) -> Estimates:
    """Estimate a marker through a gap and through windows like it."""
    k = span.track
    X, own = take.bridged, take.seen[:, k]
    ends = usable_ends(own, span)
    helpers, spreads = _helpers(take, span, ends)
    helped = np.logical_and.reduce(take.known[:, helpers], axis=1)
    known = own & helped
    ends = ends[helped[ends]]
    frames = np.sort(np.concatenate([ends, span.hidden]))
    is_end = (frames < span.first) | (frames > span.last)
    most = max(LEAST_WINDOWS, min(MOST_WINDOWS, MOST_HIDDEN // span.length))
    windows = held_out(own, take.known[:, k], helped, frames, span, most)
    spread = np.flatnonzero(known)
    spread = spread[:: -(-len(spread) // MOST_LEARNT)]
    rows = np.unique(np.concatenate([windows.ravel(), frames, spread]))
    neighbours = helpers[:MOST_NEIGHBOURS]
    weights = 1 / (spreads[:MOST_NEIGHBOURS] ** 2 + max(spreads.min(initial=1.0), STEADIEST) ** 2)
    body = fit_body(X[rows][:, neighbours], weights)
    places = body.to_body(X[rows, k])
    is_known = known[rows]
    believed = np.ones(len(frames), dtype=bool)
    believed[is_end] = is_steady(
        places[np.searchsorted(rows, ends)], ends, span, _usual_jump(places, rows, is_known)
    )
    frames, is_end, windows = frames[believed], is_end[believed], windows[:, believed]
    every = np.concatenate([windows, frames[None]])
    found = [_smoother(take, every, is_end, k)]
    if len(helpers):
        at = np.searchsorted(rows, every)
        mean = places[is_known].mean(axis=0)
        ways = bridges(take.times[every], is_end)
        room = _Room(body=body.of(at[:, ~is_end].ravel()), mean=mean)
        places = places - mean
        rigid = np.full(span.length, (places[is_known] ** 2).mean())
        rigid *= _caution(is_known.sum() / span.length)
        there = places[at]
        there[~own[every] & ~is_end] = np.nan  # what is bridged is no truth to choose a way by
        found.append(
            carried_estimate("body", np.zeros((*every.shape, X.shape[2])), there, is_end, ways,
                     room, rigid)
        )  # fmt: skip
        if is_known.sum() >= LEAST_PATTERN:
            Z = body.to_body(X[rows][:, helpers]).reshape(len(rows), -1)
            pattern = learn_pattern(Z, places, is_known, span.length)
            # A window is predicted as a whole by what was learnt without its middle.
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
        truth=take.positions[windows[:, ~is_end], k],
        windows=windows,
        n_neighbours=len(neighbours),
    )


def _helpers(
    take: Take, span: Span, ends: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Markers that are known throughout, at both ends and often beside this one; steadiest first.

    Also by how much their distance from it varies, metres.
    """
    k, known = span.track, take.known
    before, after = ends[ends < span.first], ends[ends > span.last]
    needed = np.concatenate([before[-NEAREST_ENDS:], span.hidden, after[:NEAREST_ENDS]])
    mine = np.flatnonzero(take.seen[:, k])
    n_together = known[mine].sum(axis=0)
    is_there = known[needed].all(axis=0)
    is_there &= n_together >= max(LEAST_SHARE * len(mine), MIN_TOGETHER)
    is_there[k] = False
    others = np.flatnonzero(is_there)
    compared = mine[:: -(-len(mine) // MOST_COMPARED)]
    theirs = take.bridged[compared][:, others]
    spreads = distances_from(take.positions[compared, k], theirs).spread
    steadiest = np.argsort(spreads, kind="stable")[:MOST_HELPERS]
    others, spreads = others[steadiest], spreads[steadiest]
    # As many as leave most of the frames in which they are all known.
    n_all = np.logical_and.accumulate(known[mine][:, others], axis=1).sum(axis=0)
    n = int((n_all >= LEAST_SHARE * n_all.max(initial=0)).sum())
    return others[:n], spreads[:n]


def _usual_jump(
    places: NDArray[np.float64], rows: NDArray[np.int64], is_known: NDArray[np.bool_]
) -> float:
    """How far a place is off what the two before it foretell, in the worst of ten frames."""
    y = places[is_known]
    is_next = np.diff(rows[is_known]) == 1
    missed = np.linalg.norm(y[2:] - 2 * y[1:-1] + y[:-2], axis=1)[is_next[1:] & is_next[:-1]]
    return float(np.quantile(missed, 0.9)) if len(missed) else np.inf


def _caution(m: float) -> float:
    """Give the factor of a variance learnt from m stretches for another: ``(m + 1) / (m - 1)``.

    As long as the gap, stretches are taken to be independent; of less than one nothing is known,
    and 0.2 in the denominator stands for that.
    """
    return (m + 1) / max(m - 1, 0.2)


def _smoother(
    take: Take, every: NDArray[np.int64], is_end: NDArray[np.bool_], track: int
) -> Estimate:
    """Smooth the ends of each window as a track of its own; one call does them all."""
    ends = every[:, is_end]
    frames, labels = ends.ravel(), np.repeat(np.arange(len(ends)), ends.shape[1])
    order = np.argsort(frames, kind="stable")
    counts = np.bincount(frames, minlength=len(take.times))
    pieces = Detections(
        times=take.times,
        offsets=np.concatenate([[0], np.cumsum(counts)]),
        points=take.bridged[frames[order], track],
    )
    states = smooth_states(Tracks(detections=pieces, labels=labels[order]), take.model)
    at = states.offsets[:-1, None] + every[:, ~is_end] - states.first_frames[:, None]
    H = take.model.motion.modes[0].observation
    return Estimate(
        name="smoother",
        values=states.means[at] @ H,
        variances=H @ states.covariances[at[-1]] @ H,
    )


@dataclass(frozen=True, eq=False, kw_only=True)
class _Room:
    """The way back from places in the body to the room, for the hidden frames of all windows."""

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
    """Add to an estimate what it misses at the ends, by the way that does best in the windows."""
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
