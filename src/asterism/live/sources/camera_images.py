"""Points in space from the image points of a running camera system, by `asterism.multiview`."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from asterism.camera import Observations
from asterism.live.frame import SourceFrame
from asterism.multiview import estimate_images, reconstruct

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from asterism.camera import Rig
    from asterism.multiview import ImageModel

__all__ = ["FIRST", "CameraImages", "ImageFrame"]

FIRST = 24
"""Number of frames from which the image model is estimated."""


@dataclass(frozen=True)
class ImageFrame:
    """One frame of image points.

    Parameters
    ----------
    number, time, received
        As in `SourceFrame`.
    images : list of ndarray, each of shape (n, 2)
        Image points of each camera, pixels.
    """

    number: int
    time: float
    received: float
    images: list[NDArray[np.float64]]


class CameraImages:
    """Reconstruction of a stream.

    The image model is estimated from the first `FIRST` frames, which are delivered together. They
    count from the first frame in which two cameras have image points. The volume of the model is
    not that of the first frames, because markers leave it later.

    Parameters
    ----------
    rig : Rig
        Calibrated cameras.
    cameras : tuple of str
        Name of each camera of a frame. Those that are not in the rig are not used.
    """

    def __init__(self, rig: Rig, cameras: tuple[str, ...]) -> None:
        self._rig = rig
        self._used = [i for i, name in enumerate(cameras) if name in rig.names]
        self._names = tuple(cameras[i] for i in self._used)
        self._model: ImageModel | None = None
        self._first: list[ImageFrame] = []

    def add(self, frames: Sequence[ImageFrame]) -> list[SourceFrame]:
        """Reconstruct frames together, which takes less time than one by one.

        Parameters
        ----------
        frames : sequence of ImageFrame
            Frames in the order of their arrival.

        Returns
        -------
        list of SourceFrame
            Frames with their points and covariances; none while the model is being estimated.
        """
        if self._model is not None:
            return self._points(frames, self._model)
        empty: list[SourceFrame] = []
        for frame in frames:
            if self._first or sum(len(frame.images[i]) > 0 for i in self._used) >= 2:
                self._first.append(frame)
            else:
                empty.append(
                    SourceFrame(
                        number=frame.number, time=frame.time, points=np.empty((0, 3)),
                        received=frame.received, covariances=np.empty((0, 3, 3)),
                    )
                )  # fmt: skip
        if len(self._first) < FIRST:
            return empty
        first, self._first = self._first, []
        model = estimate_images(self._observations(first[:FIRST]), self._rig, n_frames=FIRST)
        self._model = replace(model, volume=None)
        return empty + self._points(first, self._model)

    def _observations(self, frames: Sequence[ImageFrame]) -> Observations:
        images = [frame.images[i] for frame in frames for i in self._used]
        return Observations(
            times=np.arange(len(frames), dtype=np.float64),  # those of a source may repeat
            cameras=self._names,
            offsets=np.cumsum([0, *map(len, images)]),
            pixels=np.concatenate(images),
        )

    def _points(self, frames: Sequence[ImageFrame], model: ImageModel) -> list[SourceFrame]:
        if not frames:
            return []
        d = reconstruct(self._observations(frames), self._rig, model).detections
        assert d.covariances is not None
        return [
            SourceFrame(
                number=frame.number, time=frame.time, received=frame.received,
                points=d.points[begin:end], covariances=d.covariances[begin:end],
            )
            for frame, begin, end in zip(frames, d.offsets[:-1], d.offsets[1:], strict=True)
        ]  # fmt: skip
