"""Ground truth of a scene: who is whom, and what pictures and cameras need to know besides."""

from __future__ import annotations

from dataclasses import field
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from asterism.camera import Capsule, Mesh, Polygon
from asterism.checks import keep_array
from asterism.errors import ParameterError
from asterism.model import Tracks
from asterism.records import record

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

    from asterism.camera import Surface

__all__ = ["Truth"]


def _none() -> NDArray[np.int64]:
    return np.zeros((0, 0), dtype=np.int64)


def _nobody() -> NDArray[np.int64]:
    return np.zeros(0, dtype=np.int64)


@record(eq=False)
class Truth(Tracks):
    """Ground truth: tracks, with the lines and colours of pictures and the surfaces that hide.

    Parameters
    ----------
    detections, labels, names, confidence
        As for `Tracks`; K markers in T frames.
    connections : array_like of int, shape (K, K)
        Connection matrix of the 2010 report (§3.3), symmetric: 0 for no line between two markers,
        k for one in the k-th colour. No lines by default.
    colours : array_like of int, shape (K,)
        Colour of each marker, 1 for the first; all 1 by default.
    surfaces : tuple of Surface
        What hides markers: of one moment, or of T.
    record : dict
        How it was made, in words and numbers.

    Raises
    ------
    ParameterError
        If something does not fit the tracks.
    """

    connections: NDArray[np.int64] = field(default_factory=_none)
    colours: NDArray[np.int64] = field(default_factory=_nobody)
    surfaces: tuple[Surface, ...] = ()
    record: dict[str, Any] = field(default_factory=dict[str, Any])

    def __post_init__(self) -> None:
        super().__post_init__()
        K = self.n_tracks
        given = self.connections if np.size(self.connections) else np.zeros((K, K), np.int64)
        connections = keep_array("connections", given, (K, K), dtype=np.int64)
        if (connections != connections.T).any() or (connections < 0).any():
            raise ParameterError("connections", "a symmetric matrix of 0, 1, 2 …", "another")
        given = self.colours if np.size(self.colours) else np.ones(K, np.int64)
        colours = keep_array("colours", given, (K,), dtype=np.int64)
        if (colours < 1).any():
            raise ParameterError("colours", "numbers from 1", int(colours.min()))
        surfaces = tuple(self.surfaces)
        for i, surface in enumerate(surfaces):
            if not isinstance(surface, (Polygon, Mesh, Capsule)):
                expected = "a Polygon, Mesh or Capsule"
                raise ParameterError(f"surfaces[{i}]", expected, type(surface).__name__)
            if surface.n_moments not in (1, self.detections.n_frames):
                expected = f"1 or {self.detections.n_frames} moments"
                raise ParameterError(f"surfaces[{i}]", expected, surface.n_moments)
        object.__setattr__(self, "connections", connections)
        object.__setattr__(self, "colours", colours)
        object.__setattr__(self, "surfaces", surfaces)

    @classmethod
    def of(
        cls,
        times: ArrayLike,
        positions: ArrayLike,
        names: Sequence[str],
        *,
        lines: Sequence[tuple[int, int, int]] = (),
        colours: ArrayLike = (),
        surfaces: Sequence[Surface] = (),
    ) -> Self:
        """Make the truth of a scene from positions.

        Parameters
        ----------
        times : array_like, shape (T,)
            Seconds.
        positions : array_like, shape (T, K, 3)
            Metres; NaN where a marker is not there.
        names : sequence of K str
            Of the markers.
        lines : sequence of (marker, marker, colour)
            Lines between markers by their numbers; colours from 1.
        colours, surfaces
            As for the class.
        """
        tracks = Tracks.from_dense(times, positions, names)
        connections = np.zeros((len(names), len(names)), dtype=np.int64)
        for i, j, colour in lines:
            connections[i, j] = connections[j, i] = colour
        return cls(
            detections=tracks.detections,
            labels=tracks.labels,
            names=tracks.names,
            connections=connections,
            colours=np.asarray(colours, dtype=np.int64),
            surfaces=tuple(surfaces),
        )
