"""Rates of a clip from a partition of it: misses, clutter, births and deaths.

A partition does not tell when a track died, nor whether it was there before it was first seen; both
are averaged over under the rates so far.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from asterism.model import Tracks

__all__ = ["Counts", "Rates", "count"]

SHORTEST = 4
"""Detections of a track that counts as one. Two or three false points that fit are a track now and
then; believed, they would make the next model readier to believe more of them, and so on."""
MOST_SURE = 0.999
"""P_d at most: where nothing was ever missed, a miss is still possible."""


@dataclass(frozen=True, kw_only=True)
class Rates:
    """How often things happen.

    Parameters
    ----------
    p_detection : float
        P_d.
    p_disappear : float
        p_z, a frame.
    births, clutter : float
        New markers and false points a frame, in the whole region.
    """

    p_detection: float
    p_disappear: float
    births: float
    clutter: float


@dataclass(frozen=True, kw_only=True)
class Counts:
    """What a partition shows: events, and chances of them.

    Parameters
    ----------
    hits, misses : float
        Frames in which a marker that is there was seen, after the first time, and was not.
    deaths, steps : float
        Disappearances, and steps in which a marker might have.
    births, clutter : float
        Markers that came after the first frame, and false points.
    frames : float
        Frames.
    """

    hits: float = 0.0
    misses: float = 0.0
    deaths: float = 0.0
    steps: float = 0.0
    births: float = 0.0
    clutter: float = 0.0
    frames: float = 0.0

    def __add__(self, other: Counts) -> Counts:
        return Counts(**{name: value + getattr(other, name) for name, value in vars(self).items()})

    def __mul__(self, share: float) -> Counts:
        return Counts(**{name: value * share for name, value in vars(self).items()})

    def rates(self) -> Rates:
        """Give the rates, each with one event more: nothing is impossible after a finite clip."""
        return Rates(
            p_detection=min((self.hits + 1) / (self.hits + self.misses + 2), MOST_SURE),
            p_disappear=(self.deaths + 1) / (self.steps + 2),
            births=(self.births + 1) / self.frames,
            clutter=(self.clutter + 1) / self.frames,
        )

    def stds(self) -> Rates:
        """Give the standard deviation of each rate: of a beta, and of gamma distributions."""
        rates = self.rates()
        p, z = rates.p_detection, rates.p_disappear
        return Rates(
            p_detection=float(np.sqrt(p * (1 - p) / (self.hits + self.misses + 3))),
            p_disappear=float(np.sqrt(z * (1 - z) / (self.steps + 3))),
            births=float(np.sqrt(self.births + 1)) / self.frames,
            clutter=float(np.sqrt(self.clutter + 1)) / self.frames,
        )


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
    hits = float((tracks.lengths[there] - 1).sum())
    inside = float((last - first).sum())
    # After the last detection, over the r frames that are left: dead in the j-th of them, or alive
    # and unseen in all.
    p, z = rates.p_detection, rates.p_disappear
    j = np.arange(T)
    alive = np.power((1 - z) * (1 - p), j)  # and unseen, for j frames
    died = np.concatenate([[0.0], np.cumsum(alive[:-1] * z)])  # by the r-th frame
    lived = np.concatenate([[0.0], np.cumsum(j[:-1] * alive[:-1] * z)])  # frames before, times that
    r = T - 1 - last
    total = died[r] + alive[r]
    p_died = died[r] / total
    frames_alive = (lived[r] + r * alive[r]) / total
    # Before the first detection, over the f frames before it: there from the start, or new.
    n_start = float((first == 0).sum()) / p
    old = n_start * p * np.power(1 - p, first[first > 0])
    return Counts(
        hits=hits,
        misses=inside - hits + float(frames_alive.sum()),
        deaths=float(p_died.sum()),
        steps=inside + float((frames_alive + p_died).sum()),
        births=float((rates.births / (rates.births + old)).sum()),
        clutter=float(d.n_points - tracks.lengths[there].sum()),
        frames=float(T),
    )
