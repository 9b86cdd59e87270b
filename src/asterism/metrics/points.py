"""How good reconstructed points are: which markers they found, which are ghosts, how far off."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np

from asterism.checks import check_array, check_kind, check_number
from asterism.errors import ParameterError
from asterism.model import Detections, Tracks
from asterism.records import record

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = ["PointScores", "point_scores"]


@record
class PointScores:
    """How points compare with markers, over all frames.

    Attributes
    ----------
    n_markers : int
        Markers that count, frame by frame.
    n_points : int
        Points there are.
    n_found : int
        Markers that count with a point of their own within the radius.
    n_ghosts : int
        Points that are of no marker, whether it counts or not.
    rms_mm : float
        Root mean square distance of those found, mm; NaN without any.
    median_mm, p95_mm : float
        Its median and 95th percentile.
    nees : float
        Mean squared distance in units of the points' own covariance, by axis: 1 where that is
        honest. NaN where points have none.
    """

    n_markers: int
    n_points: int
    n_found: int
    n_ghosts: int
    rms_mm: float
    median_mm: float
    p95_mm: float
    nees: float

    @property
    def recall(self) -> float:
        """Share of the markers that were found; 1 if there is none."""
        return self.n_found / self.n_markers if self.n_markers else 1.0

    @property
    def ghosts(self) -> float:
        """Share of the points that are ghosts; 0 without points."""
        return self.n_ghosts / self.n_points if self.n_points else 0.0

    def to_dict(self) -> dict[str, Any]:
        """Give all scores by name."""
        return asdict(self) | {"recall": self.recall, "ghosts": self.ghosts}


def point_scores(
    points: Detections, truth: Tracks, *, radius: float = 0.02, counted: ArrayLike | None = None
) -> PointScores:
    """Compare points with markers, frame by frame, whoever is whom.

    In each frame points and markers are paired, one to one, as many as are within the radius of
    each other, and so that the distances are least.

    Parameters
    ----------
    points : Detections
        What was found.
    truth : Tracks
        Where the markers are, in the same frames.
    radius : float
        How far a point may be from its marker, metres.
    counted : array_like of bool, shape (T, K), optional
        Which markers of which frames ought to be found; by default all that are there. The others
        may be, and a point of theirs is no ghost.

    Returns
    -------
    PointScores

    Raises
    ------
    ParameterError
        If the frames or dimensions differ.

    References
    ----------
    The pairing is that of CLEAR-MOT: K. Bernardin, R. Stiefelhagen, EURASIP Journal on Image and
    Video Processing (2008).
    """
    from scipy.optimize import linear_sum_assignment

    check_number("radius", radius, above=0)
    check_kind("points", points, Detections)
    check_kind("truth", truth, Tracks)
    if points.n_frames != truth.detections.n_frames or points.n_axes != truth.detections.n_axes:
        expected = f"{points.n_frames} frames, {points.n_axes}-D, as the points have"
        got = f"{truth.detections.n_frames} frames, {truth.detections.n_axes}-D"
        raise ParameterError("truth", expected, got)
    X = truth.positions()
    is_there: NDArray[np.bool_] = np.logical_and.reduce(np.isfinite(X), axis=-1)
    if counted is None:
        ought = is_there
    else:
        ought = check_array("counted", counted, is_there.shape, dtype=np.bool_) & is_there
    off: list[float] = []
    squares: list[float] = []
    n_found = n_paired = 0
    for t in range(points.n_frames):
        here, markers = points.frame(t), np.flatnonzero(is_there[t])
        away = np.linalg.norm(here[:, None] - X[t, markers], axis=-1)
        # Whoever is too far costs so much that no number of good pairs is given up for it.
        cost = np.where(away <= radius, away, radius * (2 + min(away.shape)))
        i, j = linear_sum_assignment(cost)
        near = away[i, j] <= radius
        i, j = i[near], markers[j[near]]
        is_found = ought[t, j]
        n_paired += len(i)
        n_found += int(is_found.sum())
        e = here[i] - X[t, j]
        off += np.linalg.norm(e[is_found], axis=1).tolist()
        if points.covariances is not None and len(i):
            P = points.covariances[points.offsets[t] + i]
            squares += np.einsum("ni,nij,nj->n", e, np.linalg.pinv(P), e)[is_found].tolist()
    distances = 1e3 * np.array(off) if off else np.full(1, np.nan)
    median, high = np.percentile(distances, [50, 95])
    return PointScores(
        n_markers=int(ought.sum()),
        n_points=points.n_points,
        n_found=n_found,
        n_ghosts=points.n_points - n_paired,
        rms_mm=float(np.sqrt((distances**2).mean())),
        median_mm=float(median),
        p95_mm=float(high),
        nees=float(np.mean(squares) / points.n_axes) if squares else float("nan"),
    )
