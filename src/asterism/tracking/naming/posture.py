"""Places of tracks as evidence: a marker set's posture laid over the tracks that have names.

Where distances and sides do not tell two markers apart, the posture does: a thumb is in front of
the other side of the wrist, toes are in front of heels. Postures differ, so that it counts little.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism.tracking.naming.starts import z_up

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from asterism.model import MarkerSet
    from asterism.model.upwards import Axis

__all__ = ["posture_log_odds"]

SIGMA = 0.12
"""Standard deviation of a marker's place in another posture, metres."""
FAR = 0.1
"""Share of markers that are anywhere: its inverse is the largest odds."""
MIN_NAMED = 4
"""Smallest number of named tracks over which a posture is laid."""


def posture_log_odds(
    made: MarkerSet, positions: NDArray[np.float64], names: NDArray[np.int64], up: Axis, size: float
) -> NDArray[np.float64]:
    """Return the log odds of each marker for each track by their places, (n, M), at least 0.

    Parameters
    ----------
    made : MarkerSet
        Markers with places; those without are everywhere alike.
    positions : ndarray of shape (F, n, 3)
        Positions of the tracks in a few frames, metres, NaN without a detection.
    names : ndarray of int, shape (n,)
        Names by which the posture is laid, -1 for none.
    up : {"x", "y", "z"}
        Axis of the capture that points up; the posture is turned about it.
    size : float
        Size of the subject relative to the marker set.
    """
    place = size * z_up(made.places, made.up)
    named = (names >= 0) & np.isfinite(place[names, 0])
    sums, counts = np.zeros((len(names), len(made))), np.zeros((len(names), 1))
    for frame in positions:
        point = z_up(frame, up)
        is_seen = np.isfinite(point[:, 0])
        used = np.flatnonzero(named & is_seen)
        if len(used) < MIN_NAMED:
            continue
        own, there = place[names[used]], point[used]
        middle, middle_there = own.mean(axis=0), there.mean(axis=0)
        a, b = (own - middle)[:, :2], (there - middle_there)[:, :2]
        cosine, sine = (a * b).sum(), (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum()
        c, s = np.array([cosine, sine]) / max(float(np.hypot(cosine, sine)), 1e-12)
        laid = (place - middle) @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]) + middle_there
        squared = ((point[:, None] - laid) ** 2).sum(axis=2)
        near = np.exp(-np.nan_to_num(squared, nan=0.0) / (2 * SIGMA**2))
        sums += np.where(is_seen[:, None], np.log1p((1 / FAR - 1) * near), 0.0)
        counts += is_seen[:, None]
    return sums / np.maximum(counts, 1)
