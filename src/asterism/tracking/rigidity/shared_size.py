"""Size of the acceleration that bonded markers have in common.

The acceleration of a marker over three frames,

    a(t) = ((x(t+1) - x(t)) / Δ₂ - (x(t) - x(t-1)) / Δ₁) / ((Δ₁ + Δ₂) / 2),

has noise of its own. The product of those of two markers of a bond has none: its mean is the
variance that they have in common. In `DWNA` a(t) is the mean of two accelerations, so that
σ² = 2 E[a_i a_j] for each axis.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism.checks import check_array, check_kind
from asterism.errors import ParameterError
from asterism.model import Tracks
from asterism.tracking.rigidity.sampled import positions_in, sampled_frames

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = ["shared_size"]

MAX_FRAMES = 2000
"""Number of evenly spread frames in which accelerations are compared."""
BATCHES = 50
"""Number of batches of consecutive frames, whose means differ by the error of the whole mean."""


def shared_size(tracks: Tracks, first: ArrayLike, second: ArrayLike) -> tuple[float, float]:
    """Measure the standard deviation of the acceleration that bonded markers have in common.

    Parameters
    ----------
    tracks : Tracks
        Tracks of a capture.
    first, second : array_like of int, shape (B,)
        Both tracks of each bond.

    Returns
    -------
    size, std : float
        As the σ of `DWNA`, m/s², and its standard error; 0 and NaN without a common acceleration.

    Raises
    ------
    ParameterError
        If a bond is of a track that there is not.

    Examples
    --------
    >>> import asterism as am
    >>> truth = am.simulate.person(frames=600, seed=1)
    >>> bonds = am.tracking.learn_bonds(truth)
    >>> size, std = am.tracking.shared_size(truth, *bonds.pairs[bonds.rigid].T)
    >>> f"{size:.1f} ± {std:.1f} m/s²"
    '7.1 ± 0.3 m/s²'
    """
    check_kind("tracks", tracks, Tracks, "am.track(detections)")
    first = check_array("first", first, ("B",), dtype=np.int64)
    second = check_array("second", second, (len(first),), dtype=np.int64)
    every = np.concatenate([first, second])
    if len(every) and not 0 <= every.min() <= every.max() < tracks.n_tracks:
        expected = f"numbers of {tracks.n_tracks} tracks"
        raise ParameterError("first, second", expected, f"{every.min()} to {every.max()}")
    accelerations = _accelerations(tracks)
    products = (accelerations[:, first] * accelerations[:, second]).mean(axis=2)
    n = np.isfinite(products).sum(axis=1)
    used = np.flatnonzero(n)
    if len(used) < 2:
        return 0.0, np.nan
    sums = np.nansum(products[used], axis=1)
    batch = np.arange(len(used)) * min(BATCHES, len(used)) // len(used)
    weight, total = np.bincount(batch, n[used]), np.bincount(batch, sums)
    mean = total.sum() / weight.sum()
    # Standard error of a ratio of sums.
    k = len(weight)
    std = np.sqrt(k / (k - 1) * ((total - mean * weight) ** 2).sum()) / weight.sum()
    if mean <= 0:
        return 0.0, np.nan
    size = np.sqrt(2 * mean)
    return float(size), float(std / size)


def _accelerations(tracks: Tracks) -> NDArray[np.float64]:
    """Return the accelerations in some frames, (F, K, D), NaN if not detected in three frames."""
    d = tracks.detections
    middle = 1 + sampled_frames(max(d.n_frames - 2, 0), MAX_FRAMES)
    x = [positions_in(d, tracks.labels, tracks.n_tracks, middle + step) for step in (-1, 0, 1)]
    before, after = ((d.times[middle + i] - d.times[middle + i - 1])[:, None, None] for i in (0, 1))
    return ((x[2] - x[1]) / after - (x[1] - x[0]) / before) / ((before + after) / 2)
