"""Rates of missed detections, clutter, births and deaths from a partition of a capture.

A partition does not determine when a marker disappeared, nor whether it was present before its
first detection. Both are replaced by their expectations under the current rates.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism.records import record

if TYPE_CHECKING:
    from asterism.model import Tracks

__all__ = ["Counts", "Rates", "count"]

MIN_LENGTH = 4
"""Smallest number of detections of a counted track. Two or three false alarms can form a track by
chance; counting them would make the next model accept more of them."""
MAX_P_DETECTION = 0.999
"""Upper bound of P_d: a missed detection stays possible even if the capture has none."""
SURE_OF_RUNS = 10.0
"""Twice the log-likelihood ratio above which missed detections come in bursts; one of 600 captures
exceeds it by chance."""


@record
class Rates:
    """Detection, clutter, birth and death rates of a capture.

    Parameters
    ----------
    p_detection, p_redetection : float
        P_d and P_r; equal if missed detections are independent.
    p_disappear : float
        p_z, probability per frame.
    births, clutter : float
        Numbers of new markers and false alarms per frame in the whole region.
    """

    p_detection: float
    p_redetection: float
    p_disappear: float
    births: float
    clutter: float

    @property
    def p_seen(self) -> float:
        """Share of the frames in which a marker is detected."""
        return self.p_redetection / (1 - self.p_detection + self.p_redetection)


@record
class Counts:
    """Counts of events in a partition, and of the opportunities for them.

    Parameters
    ----------
    hits, misses : float
        Numbers of frames in which a present marker, detected in the frame before, was detected
        and missed.
    rehits, remisses : float
        The same numbers for markers that were missed in the frame before.
    deaths, steps : float
        Numbers of disappearances, and of steps in which a marker could disappear.
    births, clutter : float
        Numbers of markers that appeared after the first frame, and of false alarms.
    frames : float
        Number of frames.
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

    def rates(self, *, in_bursts: bool) -> Rates:
        """Estimate the rates with one pseudo-event each, so that none is 0 after a finite capture.

        Parameters
        ----------
        in_bursts : bool
            Whether P_r may differ from P_d; it does if the difference is significant.
        """
        p = q = _share(*self._seen)
        if in_bursts and self._sure_of_runs > SURE_OF_RUNS:
            p, q = _share(self.hits, self.misses), _share(self.rehits, self.remisses)
        return Rates(
            p_detection=min(p, MAX_P_DETECTION),
            p_redetection=min(q, MAX_P_DETECTION),
            p_disappear=(self.deaths + 1) / (self.steps + 2),
            births=(self.births + 1) / self.frames,
            clutter=(self.clutter + 1) / self.frames,
        )

    @property
    def _seen(self) -> tuple[float, float]:
        return self.hits + self.rehits, self.misses + self.remisses

    @property
    def _sure_of_runs(self) -> float:
        """Return twice the log-likelihood ratio of separate P_r and P_d against a common one."""
        each = _log_likelihood(self.hits, self.misses) + _log_likelihood(self.rehits, self.remisses)
        return 2 * (each - _log_likelihood(*self._seen))

    def stds(self, *, in_bursts: bool) -> Rates:
        """Return the standard deviation of each rate, of a beta or a gamma distribution.

        Parameters
        ----------
        in_bursts : bool
            As for `rates`.

        Returns
        -------
        Rates
        """
        rates = self.rates(in_bursts=in_bursts)
        p, q, z = rates.p_detection, rates.p_redetection, rates.p_disappear
        chances, again = self.hits + self.misses, self.rehits + self.remisses
        if p == q:  # one rate from all counts
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
    """Return the maximum log likelihood of Bernoulli trials."""
    from scipy.special import xlogy

    n = hits + misses
    return float(xlogy(hits, hits / n) + xlogy(misses, misses / n)) if n else 0.0


def count(tracks: Tracks, rates: Rates) -> Counts:
    """Count the events in a partition, with expectations for events that it leaves open.

    Parameters
    ----------
    tracks : Tracks
        Partition to count in.
    rates : Rates
        Current rates, for the expectations.

    Returns
    -------
    Counts
    """
    d = tracks.detections
    T = d.n_frames
    order, offsets = tracks.by_track
    there = np.flatnonzero(tracks.lengths >= MIN_LENGTH)
    frame = d.frame_of[order]
    first, last = frame[offsets[there]], frame[offsets[there + 1] - 1]
    links = float((tracks.lengths[there] - 1).sum())
    inside = float((last - first).sum())
    is_link = (np.diff(tracks.labels[order]) == 0) & np.isin(tracks.labels[order][:-1], there)
    gaps = float((np.diff(frame)[is_link] > 1).sum())
    # After the last detection, over the r remaining frames: the marker disappears in the j-th, or
    # is present and missed in all of them.
    p, q, z = rates.p_detection, rates.p_redetection, rates.p_disappear
    j = np.arange(T)
    alive = np.power((1 - z) * (1 - q), j)  # present and missed for j frames
    alive[1:] *= (1 - p) / (1 - q)
    died = np.concatenate([[0.0], np.cumsum(alive[:-1] * z)])  # disappeared by the r-th frame
    lived = np.concatenate([[0.0], np.cumsum(j[:-1] * alive[:-1] * z)])  # expected frames before
    r = T - 1 - last
    total = died[r] + alive[r]
    p_died = died[r] / total
    frames_alive = (lived[r] + r * alive[r]) / total
    first_misses = float((1 - z / total)[r > 0].sum())
    # Before the first detection, over the f frames before it: present from the start, or new.
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
