"""Exchange of two tracks in intervals of time: the most probable one that moves a detection.

Legend: lane 0 and 1 are the two tracks, with detections in time order. A cut at frame t parts each
lane into a head, before t, and a tail, from t on. An exchange from s to e cuts at s and at e.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism import _engine
from asterism.model.compiled import motion_model, steps_of
from asterism.records import record
from asterism.tracking.confidence.calibration import EXCHANGE, RATIOS, log_odds

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from asterism.model import Detections, TrackingModel

__all__ = ["Exchange", "Lane", "Motion", "best_exchange"]

FARTHEST = 12.0
"""Largest deviation of a link from straight motion that is counted, in log-likelihood units."""
MAX_ODDS = 2.0
"""Largest log odds by straight motion alone, which markers that accelerate do not keep to."""
MIN_EXTENT = 0.01
"""Smallest extent of the volume in which clutter is spread, metres."""
WINDOW = 64
"""Number of frames around a cut in which the filter looks for detections."""
BEGIN = -6.0
"""Log likelihood of a detection that no short link leads to."""
MIN_RATIO = -4.0
"""Log-likelihood ratio below which the log odds of an exchange fall as the ratio does; exchanges
of smaller ratios are not among those on which `EXCHANGE` was fitted."""


@record(eq=False)
class Lane:
    """One of two tracks that may be exchanged.

    Parameters
    ----------
    detections : ndarray of int, shape (n,)
        Detections in time order.
    frames : ndarray of int, shape (n,)
        Their frames.
    gains : ndarray of shape (n,)
        Log odds that each gains in the other lane.
    starts : ndarray of bool, shape (n,)
        Whether a part of the track begins with each; within a part no link is uncertain.
    before : ndarray of shape (n,)
        Probability of the link that leads to each.
    stated : ndarray of int, shape (n,)
        1 for each that must go to the other lane, -1 for each that must stay, 0 for the others.
    """

    detections: NDArray[np.int64]
    frames: NDArray[np.int64]
    gains: NDArray[np.float64]
    starts: NDArray[np.bool_]
    before: NDArray[np.float64]
    stated: NDArray[np.int8]


@record(eq=False)
class Exchange:
    """Exchange of two lanes in intervals of time.

    Parameters
    ----------
    firsts, ends : ndarray of int, shape (n,)
        First frame of each interval, and the frame after its last, rising.
    gain : float
        Change of the log posterior.
    """

    firsts: NDArray[np.int64]
    ends: NDArray[np.int64]
    gain: float

    def inside(self, frames: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Return whether frames are in one of the intervals."""
        return np.searchsorted(self.firsts, frames, "right") > np.searchsorted(
            self.ends, frames, "right"
        )


class Motion:
    """Log likelihoods of links by straight motion.

    Parameters
    ----------
    detections : Detections
        Detections of the capture.
    model : TrackingModel
        Model of motion and noise.
    """

    def __init__(self, detections: Detections, model: TrackingModel) -> None:
        self._d, self._frame = detections, detections.frame_of
        y = detections.points
        self._steps = kind, _, Q = steps_of(model.motion, detections.times)
        usual = np.bincount(kind[1:]).argmax() if len(kind) > 1 else 0
        self._q = float(Q[usual, Q.shape[1] // 2, 0, 0])
        self._r = 6 * model.sensor.noise_sigma**2
        self.max_gap = model.population.max_gap + 1
        self._model = model
        corners = [f(axis=0, initial=s) for f, s in ((y.max, -np.inf), (y.min, np.inf))]
        self.log_volume = float(np.log(np.maximum(corners[0] - corners[1], MIN_EXTENT)).sum())

    def ratios(self, lanes: tuple[Lane, Lane], cuts: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return the log-likelihood ratios of exchanges of both tails, by the filter of the model.

        Parameters
        ----------
        lanes : tuple of two Lane
            Tracks with detections before and after each cut.
        cuts : ndarray of int
            First frames of the tails, rising.
        """
        if not len(cuts):
            return np.empty(0)
        low = max(int(cuts[0]) - WINDOW, 0)
        high = min(int(cuts[-1]) + WINDOW, len(self._d.times))
        kind, F, Q = self._steps
        rows = [
            lane.detections[slice(*np.searchsorted(lane.frames, [low, high]))] for lane in lanes
        ]
        own = np.concatenate(rows)
        return _engine.exchange_ratios(
            motion_model(self._model, self._d.n_axes), self._d.times[low:high], kind[low:high], F,
            Q, np.ascontiguousarray(self._d.points[own]), self._frame[own].astype(np.int64) - low,
            np.cumsum([0, *map(len, rows)]).astype(np.int64), cuts - low,
            p_detection=min(self._model.sensor.p_detection, 0.999),
        )  # fmt: skip

    def is_short(self, head: NDArray[np.int64], tail: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Return whether a link is short enough for the motion to predict it.

        Parameters
        ----------
        head, tail : ndarray of int, shape (n,)
            Detections before and after, -1 for none.
        """
        n = self._frame[tail] - self._frame[head]
        return (head >= 0) & (tail >= 0) & (n <= self.max_gap)

    def continuation(
        self, before: int, head: int, others: NDArray[np.int64]
    ) -> NDArray[np.float64]:
        """Return how well detections of one frame continue two others, forward or backward.

        Parameters
        ----------
        before, head : int
            The two detections to continue; -1 for `before` if there is one alone.
        others : ndarray of int, shape (n,)
            Detections that may come next.
        """
        y, frame = self._d.points, self._frame
        n = float(frame[others[0]] - frame[head])
        velocity, factor = np.zeros(self._d.n_axes), 9.0
        if before >= 0:
            velocity, factor = (y[head] - y[before]) / (frame[head] - frame[before]), 1.0
        off = y[others] - y[head] - n * velocity
        return -(off**2).sum(axis=1) / (2 * factor * (self._r + self._q * abs(n) ** 3))

    def log_odds(
        self, own: NDArray[np.int64], others: NDArray[np.int64], clutter: float
    ) -> NDArray[np.float64]:
        """Return the log odds of detections continuing a track instead of being clutter.

        They are those of the likelier one of the links from before and from after, bounded by
        `MAX_ODDS`, and 0 without a short link.

        Parameters
        ----------
        own : ndarray of int, shape (n,)
            Detections of a track, in time order.
        others : ndarray of int, shape (m,)
            Other detections, in frames in which the track has none.
        clutter : float
            Number of detections of clutter per frame, > 0.

        Returns
        -------
        ndarray of shape (m,)
        """
        y, frame = self._d.points, self._frame
        log_clutter = np.log(clutter) - self.log_volume
        padded = np.concatenate([[-1, -1], own, [-1, -1]])
        at = np.searchsorted(frame[own], frame[others]) + 2
        best = np.full(len(others), -np.inf)
        for before, head in ((padded[at - 2], padded[at - 1]), (padded[at + 1], padded[at])):
            n = np.abs(frame[others] - frame[head])
            step = frame[head] - frame[before]
            straight = (before >= 0) & (np.abs(step) <= self.max_gap) & (step != 0)
            velocity = (y[head] - y[before]) / np.where(straight, step, np.inf)[:, None]
            off = y[others] - y[head] - (frame[others] - frame[head])[:, None] * velocity
            variance = np.where(straight, 1, 9) * (self._r + self._q * n**3.0)
            density = -2 * np.log1p((off**2).sum(axis=1) / (3 * variance))
            density -= self._d.n_axes / 2 * np.log(2 * np.pi * variance)
            is_short = (head >= 0) & (n <= self.max_gap)
            best = np.where(is_short, np.maximum(best, density - log_clutter), best)
        return np.where(np.isinf(best), 0, best.clip(-MAX_ODDS, MAX_ODDS))

    def log_likelihood(
        self, before: NDArray[np.int64], head: NDArray[np.int64], tail: NDArray[np.int64]
    ) -> NDArray[np.float64]:
        """Return the log likelihood of links, `BEGIN` for those that are not short.

        Parameters
        ----------
        before, head, tail : ndarray of int, shape (n,)
            The two detections before each link and the one after it, -1 for none.
        """
        y, frame = self._d.points, self._frame
        n = (frame[tail] - frame[head])[:, None]
        straight = self.is_short(before, head)
        step = np.where(straight, frame[head] - frame[before], 1)[:, None]
        velocity = np.where(straight[:, None], (y[head] - y[before]) / step, 0)
        off = y[tail] - y[head] - n * velocity
        variance = self._r + self._q * n[:, 0].clip(0, self.max_gap) ** 3
        variance = np.where(straight, variance, 9 * variance)
        deviation = np.minimum((off**2).sum(axis=1) / (2 * variance), FARTHEST)
        return np.where(self.is_short(head, tail), -deviation, BEGIN)


def best_exchange(
    lanes: tuple[Lane, Lane], motion: Motion, cut: int | None = None
) -> Exchange | None:
    """Return the most probable exchange of two tracks that moves what must go.

    It is a set of intervals. Every stated detection is respected, and all other places where both
    tracks may have exchanged their later parts are decided with them.

    The score of an exchange is what its detections gain by their distances to other tracks, less
    the log odds of the links that are cut where an interval begins or ends.

    Parameters
    ----------
    lanes : tuple of two Lane
        The tracks.
    motion : Motion
        Log likelihoods of links.
    cut : int, optional
        Frame at which an interval begins or before which it ends; the only one between the
        stated detections on both sides.

    Returns
    -------
    Exchange or None
        None if detections of one frame would have to stay and to go.
    """
    has = [lane.stated != 0 for lane in lanes]
    frames = np.concatenate([lane.frames[own] for lane, own in zip(lanes, has, strict=True)])
    goes = np.concatenate([lane.stated[own] > 0 for lane, own in zip(lanes, has, strict=True)])
    order = np.argsort(frames, kind="stable")
    frames, goes = frames[order], goes[order]
    turns = np.flatnonzero(goes[1:] != goes[:-1])
    if (frames[turns] == frames[turns + 1]).any():
        return None
    cuts = _cuts(lanes, list(zip(frames[turns], frames[turns + 1], strict=True)), cut)
    costs = _costs(lanes, cuts, motion)
    total = np.zeros(len(cuts))
    for lane in lanes:
        total += np.concatenate([[0], np.cumsum(lane.gains)])[np.searchsorted(lane.frames, cuts)]
    odds = np.stack([np.zeros(len(cuts) - 1), np.diff(total)])
    at = np.searchsorted(cuts, frames, side="right") - 1
    odds[1 - goes.astype(np.int64), at] = -np.inf
    is_exchanged, gain = _best_states(odds, costs)
    edges = np.diff(np.concatenate([[0], is_exchanged, [0]]))
    return Exchange(firsts=cuts[edges > 0], ends=cuts[edges < 0], gain=gain)


def _best_states(odds: NDArray[np.float64], costs: NDArray[np.float64]) -> tuple[list[int], float]:
    """Return whether each interval between cuts is exchanged (Viterbi's algorithm), and the gain.

    Of equal solutions that with the latest begins and the earliest ends is taken.

    Parameters
    ----------
    odds : ndarray of shape (2, n)
        Log odds of each interval as it is, and exchanged.
    costs : ndarray of shape (n + 1,)
        Log odds that are lost where an exchange begins or ends.
    """
    keep, swap = 0.0, float("-inf")
    came_from: list[tuple[bool, bool]] = []
    for as_it_is, exchanged, cost in zip(*odds.tolist(), costs[:-1].tolist(), strict=True):
        came_from.append((swap - cost > keep, keep - cost < swap))
        keep, swap = max(keep, swap - cost) + as_it_is, max(swap, keep - cost) + exchanged
    swap -= float(costs[-1])
    state = swap > keep
    states: list[int] = []
    for sources in reversed(came_from):
        states.append(int(state))
        state = sources[state]
    return states[::-1], max(keep, swap)


def _cuts(
    lanes: tuple[Lane, Lane], turns: list[tuple[int, int]], cut: int | None
) -> NDArray[np.int64]:
    """Return the frames in which parts begin or have ended, at least one at each turn."""
    frames = np.concatenate([lane.frames for lane in lanes])
    begins = [lane.frames[lane.starts] for lane in lanes]
    ends = [lane.frames[np.append(lane.starts[1:], True)[: len(lane.frames)]] + 1 for lane in lanes]
    cuts = np.unique(np.concatenate([*begins, *ends]))
    for low, high in turns:
        if cut is not None and low < cut <= high:
            cuts = np.append(cuts[(cuts <= low) | (cuts > high)], cut)
        elif not ((cuts > low) & (cuts <= high)).any():
            cuts = np.concatenate([cuts, frames[(frames > low) & (frames <= high)], [high]])
    return np.unique(cuts)


def _costs(
    lanes: tuple[Lane, Lane], cuts: NDArray[np.int64], motion: Motion
) -> NDArray[np.float64]:
    """Return the log odds that are lost by an exchange of the tails of two lanes at each cut."""
    sides = [_around(lane, cuts) for lane in lanes]
    ratio, links = np.zeros(len(cuts)), np.zeros(len(cuts))
    has_short = np.zeros(len(cuts), dtype=bool)
    for own, other, lane in ((0, 1, lanes[0]), (1, 0, lanes[1])):
        (before, head, tail, at), (before_of_other, head_of_other, _, _) = sides[own], sides[other]
        has_tail, is_kept = tail >= 0, motion.is_short(head, tail)
        kept = motion.log_likelihood(before, head, tail)
        exchanged = motion.log_likelihood(before_of_other, head_of_other, tail)
        ratio += np.where(has_tail, exchanged - kept, 0)
        has_short |= is_kept | motion.is_short(head_of_other, tail)
        is_long = (head >= 0) & has_tail & ~is_kept
        if len(lane.before):
            probability = lane.before[np.minimum(at, len(lane.before) - 1)]
            links += np.where(is_long, log_odds(np.minimum(probability, 0.98)), 0)
    (_, h0, q0, _), (_, h1, q1, _) = sides
    both_short = np.logical_and.reduce([motion.is_short(h, q) for h in (h0, h1) for q in (q0, q1)])
    near = np.flatnonzero(both_short & (ratio > 2 * MIN_RATIO))
    ratio[near] = motion.ratios(lanes, cuts[near])
    is_mutual = np.minimum.reduce([side[i] for side in sides for i in (1, 2)]) >= 0
    found = EXCHANGE[0] + EXCHANGE[1] * np.clip(ratio, MIN_RATIO, RATIOS[1])
    found += EXCHANGE[2] * is_mutual + np.minimum(ratio - MIN_RATIO, 0)
    return links - np.where(has_short, found, 0)


def _around(
    lane: Lane, cuts: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Return the two detections before each cut and the one after, and where that stands."""
    padded = np.concatenate([[-1, -1], lane.detections, [-1]])
    at = np.searchsorted(lane.frames, cuts)
    return padded[at], padded[at + 1], padded[at + 2], at
