"""Scores of reconstructed points: markers found, ghosts, and position errors."""

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
    """Result of `point_scores`, over all frames.

    Attributes
    ----------
    n_markers : int
        Number of counted markers, summed over the frames.
    n_points : int
        Number of points.
    n_found : int
        Number of counted markers that are paired with a point within the radius.
    n_ghosts : int
        Number of points that are paired with no marker, counted or not.
    rms_mm : float
        Root mean square distance of the found markers from their points, mm; NaN without any.
    median_mm, p95_mm : float
        Median and 95th percentile of these distances, mm.
    nees : float
        Normalised estimation error squared (NEES) per axis: mean squared distance in units of the
        points' covariances. It is 1 if the covariances are right, and NaN if points have none.

    Examples
    --------
    >>> import asterism as am
    >>> truth = am.simulate.cube(frames=20, seed=1)
    >>> scores = point_scores(truth.detections, truth)
    >>> scores.recall, scores.ghosts
    (1.0, 0.0)
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
        """Share of the counted markers that were found; 1 without markers."""
        return self.n_found / self.n_markers if self.n_markers else 1.0

    @property
    def ghosts(self) -> float:
        """Share of the points that are ghosts; 0 without points."""
        return self.n_ghosts / self.n_points if self.n_points else 0.0

    def to_dict(self) -> dict[str, Any]:
        """Return all scores by name.

        Examples
        --------
        >>> import asterism as am
        >>> truth = am.simulate.cube(frames=20, seed=1)
        >>> point_scores(truth.detections, truth).to_dict()["n_ghosts"]
        0
        """
        return asdict(self) | {"recall": self.recall, "ghosts": self.ghosts}


def point_scores(
    points: Detections, truth: Tracks, *, radius: float = 0.02, counted: ArrayLike | None = None
) -> PointScores:
    """Score reconstructed points against markers, frame by frame, regardless of identity.

    In each frame points and markers are paired one to one: as many pairs within the radius as
    possible, with the smallest sum of distances.

    Parameters
    ----------
    points : Detections
        Reconstructed points.
    truth : Tracks
        True positions of the markers in the same frames.
    radius : float
        Largest distance between a point and its marker, metres.
    counted : array_like of bool, shape (T, K), optional
        Markers that should be found in each frame; by default all with a position. Points of
        other markers are not ghosts.

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

    Examples
    --------
    >>> import asterism as am
    >>> truth = am.simulate.cube(frames=20, seed=1)
    >>> scores = point_scores(truth.detections, truth)
    >>> scores.n_found, scores.rms_mm
    (160, 0.0)
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
        # A pair beyond the radius costs more than all valid pairs together.
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
