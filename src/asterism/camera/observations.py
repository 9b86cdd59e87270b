"""Observations: unnamed image points of several cameras over time."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from asterism.checks import keep_array
from asterism.errors import ParameterError
from asterism.records import record

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Observations"]


@record(eq=False)
class Observations:
    """Image points of every camera in every frame: one struct of arrays.

    Parameters
    ----------
    times : array_like of shape (T,)
        Seconds, strictly increasing.
    cameras : tuple of str
        Names of the C cameras, all different, in the order of the rig.
    offsets : array_like of int, shape (T * C + 1,)
        Camera c has in frame t the points ``offsets[t * C + c]:offsets[t * C + c + 1]``.
    pixels : array_like of shape (N, 2)
        Pixels (u, v) from the centre of the top left pixel, all finite.
    markers : array_like of int, shape (N,), optional
        True marker of each point, -1 for clutter, if it is known.
    marker_names : tuple of str
        Names of the markers, if they are known.

    Raises
    ------
    ParameterError
        If an array does not fit the others.

    Examples
    --------
    >>> seen = Observations(
    ...     times=[0.0], cameras=("a", "b"), offsets=[0, 2, 3], pixels=[[1, 2], [3, 4], [5, 6]]
    ... )
    >>> seen
    Observations(2 cameras, 1 frames, 3 points)
    >>> seen.points(0, 1)
    array([[5., 6.]])
    >>> seen.n_frames, seen.n_cameras, seen.n_points, seen.counts.tolist()
    (1, 2, 3, [[2, 1]])
    >>> seen.frame_of.tolist(), seen.camera_of.tolist()
    ([0, 0, 0], [0, 0, 1])
    """

    times: NDArray[np.float64]
    cameras: tuple[str, ...]
    offsets: NDArray[np.int64]
    pixels: NDArray[np.float64]
    markers: NDArray[np.int64] | None = None
    marker_names: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        times = keep_array("times", self.times, ("T",))
        cameras = tuple(self.cameras)
        if not cameras or len(set(cameras)) < len(cameras):
            raise ParameterError("cameras", "different names, at least one", cameras)
        n_cells = len(times) * len(cameras)
        offsets = keep_array("offsets", self.offsets, (n_cells + 1,), dtype=np.int64)
        pixels = keep_array("pixels", self.pixels, ("N", 2))
        if (np.diff(times) <= 0).any():
            raise ParameterError("times", "strictly increasing seconds", "equal or decreasing ones")
        if offsets[0] != 0 or offsets[-1] != len(pixels) or (np.diff(offsets) < 0).any():
            expected = f"a rising sequence from 0 to {len(pixels)} (the number of points)"
            raise ParameterError("offsets", expected, f"{offsets[0]} … {offsets[-1]}")
        names = tuple(self.marker_names)
        if self.markers is not None:
            markers = keep_array("markers", self.markers, (len(pixels),), dtype=np.int64)
            if len(markers) and (markers.min() < -1 or (names and markers.max() >= len(names))):
                expected = f"-1 to {len(names) - 1}" if names else "-1 or more"
                raise ParameterError("markers", expected, f"{markers.min()} … {markers.max()}")
            object.__setattr__(self, "markers", markers)
        object.__setattr__(self, "times", times)
        object.__setattr__(self, "cameras", cameras)
        object.__setattr__(self, "offsets", offsets)
        object.__setattr__(self, "pixels", pixels)
        object.__setattr__(self, "marker_names", names)

    @property
    def n_frames(self) -> int:
        """Number of frames T."""
        return len(self.times)

    @property
    def n_cameras(self) -> int:
        """Number of cameras C."""
        return len(self.cameras)

    @property
    def n_points(self) -> int:
        """Number of image points N."""
        return len(self.pixels)

    @property
    def counts(self) -> NDArray[np.int64]:
        """Number of points of each frame and camera, shape (T, C)."""
        return np.diff(self.offsets).reshape(self.n_frames, self.n_cameras)

    @cached_property
    def frame_of(self) -> NDArray[np.int64]:
        """Frame of each point, shape (N,)."""
        return np.repeat(np.arange(self.n_frames), self.counts.sum(axis=1))

    @cached_property
    def camera_of(self) -> NDArray[np.int64]:
        """Camera of each point, shape (N,)."""
        return np.repeat(np.tile(np.arange(self.n_cameras), self.n_frames), self.counts.ravel())

    def points(self, t: int, camera: int) -> NDArray[np.float64]:
        """Return the image points of one camera in one frame.

        Parameters
        ----------
        t, camera : int
            Numbers of the frame and of the camera.

        Returns
        -------
        ndarray of shape (n, 2)
            Pixels.
        """
        cell = t * self.n_cameras + camera
        return self.pixels[self.offsets[cell] : self.offsets[cell + 1]]

    def __repr__(self) -> str:
        return (
            f"Observations({self.n_cameras} cameras, {self.n_frames} frames, "
            f"{self.n_points} points)"
        )
