"""Rates of a clip from a partition of it: misses, clutter, births and deaths.

A partition does not tell when a track died, nor whether it was there before it was first seen; both
are averaged over under the rates so far.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism.records import record

if TYPE_CHECKING:
    from asterism.model import Tracks

__all__ = ["Counts", "Rates", "count"]

SHORTEST = 4
"""Detections of a track that counts as one. Two or three false points that fit are a track now and
then; believed, they would make the next model readier to believe more of them, and so on."""
MOST_SURE = 0.999
"""P_d at most: where nothing was ever missed, a miss is still possible."""
SURE_OF_RUNS = 10.0
"""Misses come in runs where twice the log likelihood ratio is more: by chance once in 600 clips."""


@record
class Rates:
    """How often things happen.

    Parameters
    ----------
    p_detection, p_redetection : float
        P_d and P_r, the same where misses are independent.
    p_disappear : float
        p_z, a frame.
    births, clutter : float
        New markers and false points a frame, in the whole region.
    """

    p_detection: float
    p_redetection: float
    p_disappear: float
    births: float
    clutter: float

    @property
    def p_seen(self) -> float:
        """Share of the frames in which a marker is seen."""
        return self.p_redetection / (1 - self.p_detection + self.p_redetection)


@record
class Counts:
    """What a partition shows: events, and chances of them.

    Parameters
    ----------
    hits, misses : float
        Frames in which a marker that is there, seen in the frame before, was seen again, and was
        not.
    rehits, remisses : float
        The same of a marker that was missed in the frame before.
    deaths, steps : float
        Disappearances, and steps in which a marker might have.
    births, clutter : float
        Markers that came after the first frame, and false points.
    frames : float
        Frames.
    """

    hits: float = 0.0
    misses: float = 0.0
    rehits: float = 0.0
    remisses: float = 0.0
    deaths: float = 0.0
    steps: float = 0.0
    births: float = 0.0
    clutter: float = 0.0
    frames: float = 0.0

    def __add__(self, other: Counts) -> Counts:
        return Counts(**{name: value + getattr(other, name) for name, value in vars(self).items()})

    def __mul__(self, share: float) -> Counts:
        return Counts(**{name: value * share for name, value in vars(self).items()})

    def rates(self, *, in_runs: bool) -> Rates:
        """Give the rates, each with one event more: nothing is impossible after a finite clip.

        Parameters
        ----------
        in_runs : bool
            Whether P_r may differ from P_d; it does where the counts are sure of it.
        """
        p = q = _share(*self._seen)
        if in_runs and self._sure_of_runs > SURE_OF_RUNS:
            p, q = _share(self.hits, self.misses), _share(self.rehits, self.remisses)
        return Rates(
            p_detection=min(p, MOST_SURE),
            p_redetection=min(q, MOST_SURE),
            p_disappear=(self.deaths + 1) / (self.steps + 2),
            births=(self.births + 1) / self.frames,
            clutter=(self.clutter + 1) / self.frames,
        )

    @property
    def _seen(self) -> tuple[float, float]:
        return self.hits + self.rehits, self.misses + self.remisses

    @property
    def _sure_of_runs(self) -> float:
        """Twice the log likelihood ratio of P_r apart from P_d against one for both."""
        each = _log_likelihood(self.hits, self.misses) + _log_likelihood(self.rehits, self.remisses)
        return 2 * (each - _log_likelihood(*self._seen))

    def stds(self, *, in_runs: bool) -> Rates:
        """Give the standard deviation of each rate: of a beta, and of gamma distributions."""
        rates = self.rates(in_runs=in_runs)
        p, q, z = rates.p_detection, rates.p_redetection, rates.p_disappear
        chances, again = self.hits + self.misses, self.rehits + self.remisses
        if p == q:  # one rate, from all
            chances = again = sum(self._seen)
        return Rates(
            p_detection=float(np.sqrt(p * (1 - p) / (chances + 3))),
            p_redetection=float(np.sqrt(q * (1 - q) / (again + 3))),
            p_disappear=float(np.sqrt(z * (1 - z) / (self.steps + 3))),
            births=float(np.sqrt(self.births + 1)) / self.frames,
            clutter=float(np.sqrt(self.clutter + 1)) / self.frames,
        )


def _share(hits: float, misses: float) -> float:
    return (hits + 1) / (hits + misses + 2)


def _log_likelihood(hits: float, misses: float) -> float:
    """Of a run of chances at the share that fits it best."""
    from scipy.special import xlogy

    n = hits + misses
    return float(xlogy(hits, hits / n) + xlogy(misses, misses / n)) if n else 0.0


def count(tracks: Tracks, rates: Rates) -> Counts:
    """Count events in a partition, and the expectation of what it leaves open.

    Parameters
    ----------
    tracks : Tracks
        The partition.
    rates : Rates
        The rates so far.

    Returns
    -------
    Counts
    """
    d = tracks.detections
    T = d.n_frames
    order, offsets = tracks.by_track
    there = np.flatnonzero(tracks.lengths >= SHORTEST)
    frame = d.frame_of[order]
    first, last = frame[offsets[there]], frame[offsets[there + 1] - 1]
    links = float((tracks.lengths[there] - 1).sum())
    inside = float((last - first).sum())
    is_link = (np.diff(tracks.labels[order]) == 0) & np.isin(tracks.labels[order][:-1], there)
    gaps = float((np.diff(frame)[is_link] > 1).sum())
    # After the last detection, over the r frames that are left: dead in the j-th of them, or alive
    # and unseen in all.
    p, q, z = rates.p_detection, rates.p_redetection, rates.p_disappear
    j = np.arange(T)
    alive = np.power((1 - z) * (1 - q), j)  # and unseen, for j frames
    alive[1:] *= (1 - p) / (1 - q)
    died = np.concatenate([[0.0], np.cumsum(alive[:-1] * z)])  # by the r-th frame
    lived = np.concatenate([[0.0], np.cumsum(j[:-1] * alive[:-1] * z)])  # frames before, times that
    r = T - 1 - last
    total = died[r] + alive[r]
    p_died = died[r] / total
    frames_alive = (lived[r] + r * alive[r]) / total
    first_misses = float((1 - z / total)[r > 0].sum())
    # Before the first detection, over the f frames before it: there from the start, or new.
    n_start = float((first == 0).sum()) / rates.p_seen
    old = n_start * (1 - rates.p_seen) * q * np.power(1 - q, first[first > 0] - 1)
    return Counts(
        hits=links - gaps,
        misses=gaps + first_misses,
        rehits=gaps,
        remisses=inside - links - gaps + float(frames_alive.sum()) - first_misses,
        deaths=float(p_died.sum()),
        steps=inside + float((frames_alive + p_died).sum()),
        births=float((rates.births / (rates.births + old)).sum()),
        clutter=float(d.n_points - tracks.lengths[there].sum()),
        frames=float(T),
    )
