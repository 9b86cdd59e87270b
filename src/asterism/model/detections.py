"""Detections: measured points without names, ordered by frame.

A `Tracks` assigns detections to markers.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np

from asterism.checks import check_array, keep_array
from asterism.errors import ParameterError
from asterism.records import record

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import ArrayLike, NDArray

__all__ = ["FARTHEST", "Detections"]

FARTHEST = 1e9
"""Largest coordinate that is accepted, metres; larger values are refused as mistakes."""


@record(eq=False)
class Detections:
    """Unnamed points over time, kept as one struct of arrays ordered by frame.

    Use `from_frames` or `from_dense` to make one; the constructor expects the arrays in the form
    in which they are kept.

    Parameters
    ----------
    times : array_like of shape (T,)
        Seconds, strictly increasing; the spacing may vary.
    offsets : array_like of int, shape (T + 1,)
        Frame ``t`` holds the points ``offsets[t]:offsets[t + 1]``. Frames may be empty.
    points : array_like of shape (N, D)
        Positions in metres, D = 2 or 3, all finite.
    cameras : array_like of int, shape (N,), optional
        Cameras that saw each point, if known: bit i is set for camera i, i ≤ 62.
    residuals : array_like of shape (N,), optional
        Distance between each point and the rays of its cameras, if known, metres.
    filled : array_like of bool, shape (N,), optional
        True for points that were estimated, not measured (see `asterism.fill_gaps`). All points
        are measured by default.
    stds : array_like of shape (N,), optional
        Standard deviation of each point's coordinates, metres; 0 where it is unknown.
    covariances : array_like of shape (N, D, D), optional
        Covariance of each point, m², if several cameras determine it; all zeros where it is
        unknown. Trackers add it to the sensor's noise.

    Raises
    ------
    ParameterError
        If an array does not fit the others.

    Examples
    --------
    >>> d = Detections.from_frames([0.0, 0.01], [[[0, 0, 0], [1, 0, 0]], [[0, 0, 0]]])
    >>> d
    Detections(2 frames, 3 points, 3-D, 0 to 0.01 s)
    >>> d.n_frames, d.n_points, d.n_axes, d.step
    (2, 3, 3, 0.01)
    >>> d.counts, d.frame_of
    (array([2, 1]), array([0, 0, 1]))
    """

    times: NDArray[np.float64]
    offsets: NDArray[np.int64]
    points: NDArray[np.float64]
    cameras: NDArray[np.int64] | None = None
    residuals: NDArray[np.float64] | None = None
    filled: NDArray[np.bool_] | None = None
    stds: NDArray[np.float64] | None = None
    covariances: NDArray[np.float64] | None = None

    PER_POINT: ClassVar[tuple[str, ...]] = (
        "points",
        "cameras",
        "residuals",
        "filled",
        "stds",
        "covariances",
    )
    """Fields with one entry per point; adding or removing points changes all of them."""

    def __post_init__(self) -> None:
        times = keep_array("times", self.times, ("T",))
        offsets = keep_array("offsets", self.offsets, (len(times) + 1,), dtype=np.int64)
        points = keep_array("points", self.points, ("N", "D"))
        farthest = float(max(points.max(initial=0.0), -points.min(initial=0.0)))
        if farthest > FARTHEST:
            raise ParameterError(
                "points", f"metres, within ±{FARTHEST:g}", f"{farthest:g}", "check the units"
            )
        if points.shape[1] not in (2, 3):
            raise ParameterError("points", "2 or 3 coordinates a point", points.shape[1])
        backward = np.flatnonzero(np.diff(times) <= 0)
        if len(backward):
            i = int(backward[0])
            raise ParameterError(
                "times",
                "strictly increasing seconds",
                f"{times[i]:g} then {times[i + 1]:g} at frames {i} and {i + 1}",
                "sort the frames, and merge or drop those with the same time",
            )
        if offsets[0] != 0 or offsets[-1] != len(points) or (np.diff(offsets) < 0).any():
            raise ParameterError(
                "offsets",
                f"a rising sequence from 0 to {len(points)} (the number of points)",
                f"{offsets[0]} … {offsets[-1]}",
            )
        for name, array in (("times", times), ("offsets", offsets), ("points", points)):
            object.__setattr__(self, name, array)
        kinds = {
            "cameras": np.int64,
            "residuals": np.float64,
            "filled": np.bool_,
            "stds": np.float64,
        }
        for name, kind in kinds.items():
            if getattr(self, name) is not None:
                array = keep_array(name, getattr(self, name), (len(points),), dtype=kind)
                if kind is not np.bool_ and array.size and array.min() < 0:
                    raise ParameterError(name, "numbers ≥ 0", array.min())
                object.__setattr__(self, name, array)
        if self.covariances is not None:
            D = points.shape[1]
            P = keep_array("covariances", self.covariances, (len(points), D, D))
            _check_covariances(P)
            object.__setattr__(self, "covariances", P)

    @classmethod
    def from_frames(cls, times: ArrayLike, frames: Sequence[ArrayLike]) -> Self:
        """Make detections from one array of points for each frame.

        Parameters
        ----------
        times : array_like of shape (T,)
            Seconds.
        frames : sequence of T array_like, each of shape (n_t, D)
            Points of each frame, metres; an empty list for a frame without points.

        Returns
        -------
        Detections

        Raises
        ------
        ParameterError
            If the numbers of times and frames differ, or a frame has the wrong shape.

        Examples
        --------
        >>> import asterism as am
        >>> am.Detections.from_frames([0.0, 0.01], [[[0, 0, 1], [1, 0, 1]], []])
        Detections(2 frames, 2 points, 3-D, 0 to 0.01 s)
        """
        times = check_array("times", times, ("T",))
        if len(frames) != len(times):
            raise ParameterError("frames", f"{len(times)} arrays, one for each time", len(frames))
        arrays: list[NDArray[np.float64]] = []
        n_axes = 0
        for t, frame in enumerate(frames):
            array = np.asarray(frame)
            if array.size == 0:
                arrays.append(np.empty((0, 0)))
                continue
            array = check_array(f"frames[{t}]", array, ("n", n_axes or "D"))
            n_axes = array.shape[1]
            arrays.append(array)
        n_axes = n_axes or 3
        points = np.concatenate(
            [np.empty((0, n_axes)), *(a.reshape(-1, n_axes) for a in arrays if a.size)]
        )
        offsets = np.concatenate([[0], np.cumsum([len(a) for a in arrays])]).astype(np.int64)
        points.flags.writeable = False  # a read-only array is kept without a copy
        return cls(times=times, offsets=offsets, points=points)

    @classmethod
    def from_dense(cls, times: ArrayLike, positions: ArrayLike) -> Self:
        """Make detections from an array of positions by frame and marker, without the names.

        Parameters
        ----------
        times : array_like of shape (T,)
            Seconds.
        positions : array_like of shape (T, K, D)
            Metres; NaN in any coordinate if the marker was not detected.

        Returns
        -------
        Detections
            Points of a frame in the order of the markers. `Tracks.from_dense` keeps the names.

        Examples
        --------
        >>> import asterism as am
        >>> nan = float("nan")
        >>> am.Detections.from_dense([0.0, 0.01], [[[0, 0, 1], [1, 0, 1]], [[0, 0, 1], [nan] * 3]])
        Detections(2 frames, 3 points, 3-D, 0 to 0.01 s)
        """
        times = check_array("times", times, ("T",))
        dense = check_array("positions", positions, (len(times), "K", "D"), finite=False)
        is_seen = np.isfinite(dense).all(axis=2)
        offsets = np.concatenate([[0], np.cumsum(is_seen.sum(axis=1))]).astype(np.int64)
        if is_seen.all():
            points = dense.reshape(-1, dense.shape[2])
        else:
            points = dense[is_seen]
            points.flags.writeable = False  # a read-only array is kept without a copy
        return cls(times=times, offsets=offsets, points=points)

    def measured(self) -> Self:
        """Return the detections without filled points.

        Every function that needs measurements (`estimate_model`, `track`, `stitch`, `fill_gaps`,
        `simulate.corrupt`) calls this method.

        Returns
        -------
        Detections
            Detections of the same class and frames; the object itself if no point is filled.

        Examples
        --------
        >>> import asterism as am
        >>> d = am.Detections(
        ...     times=[0], offsets=[0, 2], points=[[0, 0], [1, 1]], filled=[False, True])
        >>> d.measured().points
        array([[0., 0.]])
        """
        if self.filled is None or not self.filled.any():
            return self
        return replace(self.keep(~self.filled), filled=None)

    def keep(self, is_kept: ArrayLike) -> Self:
        """Return the detections that are marked, in the same frames.

        Parameters
        ----------
        is_kept : array_like of bool, shape (N,)
            Whether each detection stays.

        Returns
        -------
        Detections
            Detections of the same class and frames, with all fields of the points that stay.

        Examples
        --------
        >>> import asterism as am
        >>> d = am.simulate.cube(frames=20, seed=1).detections
        >>> d.keep(d.points[:, 2] > 1).n_frames
        20
        """
        kept = keep_array("is_kept", is_kept, (self.n_points,), dtype=np.bool_)
        changes: dict[str, Any] = {
            name: getattr(self, name)[kept]
            for name in self.PER_POINT
            if getattr(self, name) is not None
        }
        changes["offsets"] = np.concatenate([[0], np.cumsum(kept)])[self.offsets]
        return replace(self, **changes)

    def part(self, first: int, end: int) -> Detections:
        """Return the frames from `first` up to but without `end`, with all fields of their points.

        Parameters
        ----------
        first, end : int
            First frame, and the frame after the last.

        Returns
        -------
        Detections
            Of this class also for a `Capture`; its file and labels are left out.

        Examples
        --------
        >>> import asterism as am
        >>> am.simulate.cube(frames=20, seed=1).detections.part(5, 10).n_frames
        5
        """
        a, b = self.offsets[first], self.offsets[end]
        known: dict[str, Any] = {
            name: getattr(self, name)[a:b]
            for name in Detections.PER_POINT  # without the further fields of a `Capture`
            if getattr(self, name) is not None
        }
        offsets = self.offsets[first : end + 1] - a
        return Detections(times=self.times[first:end], offsets=offsets, **known)

    @property
    def n_frames(self) -> int:
        """Number of frames T."""
        return len(self.times)

    @property
    def n_points(self) -> int:
        """Number of detections N."""
        return len(self.points)

    @property
    def n_axes(self) -> int:
        """Number of coordinates D, 2 or 3."""
        return self.points.shape[1]

    @property
    def counts(self) -> NDArray[np.int64]:
        """Number of points of each frame, shape (T,)."""
        return np.diff(self.offsets)

    @cached_property
    def frame_of(self) -> NDArray[np.int64]:
        """Frame of each detection, shape (N,)."""
        return np.repeat(np.arange(self.n_frames, dtype=np.int64), self.counts)

    @property
    def step(self) -> float:
        """Median time between frames, seconds; 0 with fewer than two frames."""
        return float(np.median(np.diff(self.times))) if self.n_frames > 1 else 0.0

    def frame(self, t: int) -> NDArray[np.float64]:
        """Return the points of frame `t`, shape (n_t, D), metres.

        Examples
        --------
        >>> import asterism as am
        >>> am.Detections.from_frames([0.0], [[[0, 0, 1], [1, 0, 1]]]).frame(0)
        array([[0., 0., 1.],
               [1., 0., 1.]])
        """
        return self.points[self.offsets[t] : self.offsets[t + 1]]

    def __iter__(self) -> Iterator[tuple[float, NDArray[np.float64]]]:
        """Iterate over ``(time, points)`` of each frame."""
        for t in range(self.n_frames):
            yield float(self.times[t]), self.frame(t)

    def __len__(self) -> int:
        return self.n_frames

    def summary(self) -> str:
        """Return a short text with the numbers of frames, points and axes and the time span.

        Examples
        --------
        >>> import asterism as am
        >>> am.Detections.from_frames([0.0, 0.01], [[[0, 0, 1]], [[0, 0, 1]]]).summary()
        '2 frames, 2 points, 3-D, 0 to 0.01 s'
        """
        span = f", {self.times[0]:g} to {self.times[-1]:g} s" if self.n_frames else ""
        return f"{self.n_frames} frames, {self.n_points} points, {self.n_axes}-D{span}"

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.summary()})"


def _check_covariances(P: NDArray[np.float64]) -> None:
    """Raise unless all matrices are symmetric and positive semi-definite up to rounding."""
    if not len(P):
        return
    size = np.abs(P).max(axis=(1, 2))
    is_even = (np.abs(P - np.swapaxes(P, 1, 2)).max(axis=(1, 2)) <= 1e-9 * size).all()
    if not is_even or (np.linalg.eigvalsh(P)[:, 0] < -1e-9 * size).any():
        raise ParameterError("covariances", "symmetric matrices, none negative", "others")
