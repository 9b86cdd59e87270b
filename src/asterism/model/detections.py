"""What the cameras saw: points without names, frame by frame.

Nothing here says which point is which marker; that is a `Tracks`.
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
"""Metres from the origin beyond which a coordinate is taken for a mistake."""


@record(eq=False)
class Detections:
    """Unnamed points over time: one struct of arrays, ordered by frame.

    Make one with `from_frames` or `from_dense`; the constructor takes the arrays as they are kept.

    Parameters
    ----------
    times : array_like, shape (T,)
        Seconds, strictly increasing; the spacing may vary.
    offsets : array_like of int, shape (T + 1,)
        Frame ``t`` holds the points ``offsets[t]:offsets[t + 1]``. Frames may be empty.
    points : array_like, shape (N, D)
        Positions in metres, D = 2 or 3, all finite.
    cameras : array_like of int, shape (N,), optional
        Which cameras saw each point, where known: bit i for camera i, up to 62.
    residuals : array_like, shape (N,), optional
        How far their rays pass by each point, where known, metres.
    filled : array_like of bool, shape (N,), optional
        Which points were not measured but estimated, as `asterism.fill_gaps` does; none by default.
    stds : array_like, shape (N,), optional
        Standard deviation of each coordinate where it is known, metres; 0 where it is not.
    covariances : array_like, shape (N, D, D), optional
        Covariance of each point, m², where several cameras tell it; all zeros where not. Trackers
        add it to the sensor's noise.

    Raises
    ------
    ParameterError
        If an array does not fit the others.

    Examples
    --------
    >>> d = Detections.from_frames([0.0, 0.01], [[[0, 0, 0], [1, 0, 0]], [[0, 0, 0]]])
    >>> d
    Detections(2 frames, 3 points, 3-D, 0 to 0.01 s)
    >>> d.frame(1)
    array([[0., 0., 0.]])
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
    """Fields with an entry for each point: whoever adds or drops points does so in all of them."""

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
        """Make detections from one array of points a frame.

        Parameters
        ----------
        times : array_like, shape (T,)
            Seconds.
        frames : sequence of T array_like, each of shape (n_t, D)
            The points of each frame in metres; an empty list for a frame without points.

        Returns
        -------
        Detections

        Raises
        ------
        ParameterError
            If the numbers of times and frames differ, or a frame has the wrong shape.
        """
        times = check_array("times", times, ("T",))
        if len(frames) != len(times):
            raise ParameterError("frames", f"{len(times)} arrays, one a time", len(frames))
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
        points.flags.writeable = False  # nobody else has it: no need to copy
        return cls(times=times, offsets=offsets, points=points)

    @classmethod
    def from_dense(cls, times: ArrayLike, positions: ArrayLike) -> Self:
        """Make detections from named positions, forgetting the names.

        Parameters
        ----------
        times : array_like, shape (T,)
            Seconds.
        positions : array_like, shape (T, K, D)
            Metres; NaN in any coordinate where a marker was not seen.

        Returns
        -------
        Detections
            The points of a frame in the order of the markers. `Tracks.from_dense` keeps the names.
        """
        times = check_array("times", times, ("T",))
        dense = check_array("positions", positions, (len(times), "K", "D"), finite=False)
        is_seen = np.isfinite(dense).all(axis=2)
        offsets = np.concatenate([[0], np.cumsum(is_seen.sum(axis=1))]).astype(np.int64)
        if is_seen.all():
            points = dense.reshape(-1, dense.shape[2])
        else:
            points = dense[is_seen]
            points.flags.writeable = False  # nobody else has it: no need to copy
        return cls(times=times, offsets=offsets, points=points)

    def measured(self) -> Self:
        """Leave out what was filled.

        The one place where it is: whoever takes points for measurements (`estimate_model`,
        `track`, `stitch`, `fill`, `simulate.corrupt`) asks for these.

        Returns
        -------
        Detections
            Of the same kind and frames; itself where nothing was filled.
        """
        if self.filled is None or not self.filled.any():
            return self
        kept = ~self.filled
        changes: dict[str, Any] = {
            name: getattr(self, name)[kept]
            for name in self.PER_POINT
            if getattr(self, name) is not None
        }
        changes["offsets"] = np.concatenate([[0], np.cumsum(kept)])[self.offsets]
        return replace(self, **changes | {"filled": None})

    def part(self, first: int, end: int) -> Detections:
        """Give the frames from `first` to before `end`, with all that is known of their points."""
        a, b = self.offsets[first], self.offsets[end]
        known: dict[str, Any] = {
            name: getattr(self, name)[a:b]
            for name in Detections.PER_POINT  # those of a capture are more
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
        """Usual time from frame to frame: the median spacing, seconds; 0 with under two frames."""
        return float(np.median(np.diff(self.times))) if self.n_frames > 1 else 0.0

    def frame(self, t: int) -> NDArray[np.float64]:
        """Points of frame `t`, shape (n_t, D), metres."""
        return self.points[self.offsets[t] : self.offsets[t + 1]]

    def __iter__(self) -> Iterator[tuple[float, NDArray[np.float64]]]:
        """Give ``(time, points)`` frame by frame, as a live source would."""
        for t in range(self.n_frames):
            yield float(self.times[t]), self.frame(t)

    def __len__(self) -> int:
        return self.n_frames

    def summary(self) -> str:
        """Say in a few words how much there is."""
        span = f", {self.times[0]:g} to {self.times[-1]:g} s" if self.n_frames else ""
        return f"{self.n_frames} frames, {self.n_points} points, {self.n_axes}-D{span}"

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.summary()})"


def _check_covariances(P: NDArray[np.float64]) -> None:
    """Raise unless all matrices are symmetric and none is negative, but for rounding."""
    if not len(P):
        return
    size = np.abs(P).max(axis=(1, 2))
    is_even = (np.abs(P - np.swapaxes(P, 1, 2)).max(axis=(1, 2)) <= 1e-9 * size).all()
    if not is_even or (np.linalg.eigvalsh(P)[:, 0] < -1e-9 * size).any():
        raise ParameterError("covariances", "symmetric matrices, none negative", "others")
