"""Ground truth of a scene: tracks, with lines and colours for figures, and surfaces."""

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


def _no_lines() -> NDArray[np.int64]:
    return np.zeros((0, 0), dtype=np.int64)


def _no_colours() -> NDArray[np.int64]:
    return np.zeros(0, dtype=np.int64)


@record(eq=False)
class Truth(Tracks):
    """Ground truth: tracks, with lines and colours for figures and occluding surfaces.

    Parameters
    ----------
    detections : Detections
        Detections of K markers in T frames.
    labels : ndarray of int, shape (N,)
        Marker of each detection, -1 for clutter.
    names : tuple of (str or None), optional
        Names of the markers.
    confidence : ndarray of shape (N,), optional
        Confidence of each label.
    connections : array_like of int, shape (K, K)
        Connection matrix of the 2010 report (§3.3), symmetric: 0 for no line between two markers,
        k for one in the k-th colour. No lines by default.
    colours : array_like of int, shape (K,)
        Colour of each marker, 1 for the first; all 1 by default.
    surfaces : tuple of Surface
        Surfaces that occlude markers, each fixed or with T moments.
    record : dict
        Corruptions that were applied, by name.

    Raises
    ------
    ParameterError
        If a field does not fit the tracks.

    Examples
    --------
    >>> import asterism as am
    >>> truth = am.simulate.corrupt(am.simulate.cube(frames=20), missing=0.1, seed=1)
    >>> truth.record, truth.connections.shape, truth.colours[:3].tolist()
    ({'missing': 0.1, 'seed': 1}, (8, 8), [1, 1, 1])
    >>> cube = am.simulate.cube(frames=40, seed=1)
    >>> am.evaluate(am.track(cube.detections, "gnn"), cube).idf1
    1.0
    >>> am.simulate.Truth.of([0, 1], [[[0, 0, 0]], [[0, 0, 1]]], ["LKNE"])
    Truth(1 tracks, 2 detections in them, 0 clutter, 2 frames)
    """

    connections: NDArray[np.int64] = field(default_factory=_no_lines)
    colours: NDArray[np.int64] = field(default_factory=_no_colours)
    surfaces: tuple[Surface, ...] = ()
    record: dict[str, Any] = field(default_factory=dict[str, Any])

    def __post_init__(self) -> None:
        super().__post_init__()
        K = self.n_tracks
        given = self.connections if np.size(self.connections) else np.zeros((K, K), np.int64)
        connections = keep_array("connections", given, (K, K), dtype=np.int64)
        if (connections != connections.T).any() or (connections < 0).any():
            raise ParameterError("connections", "a symmetric matrix of 0, 1, 2 …", "another matrix")
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
        names: Sequence[str] | None = None,
        *,
        lines: Sequence[tuple[int, int, int]] = (),
        colours: ArrayLike = (),
        surfaces: Sequence[Surface] = (),
    ) -> Self:
        """Make the truth of a scene from dense positions.

        Parameters
        ----------
        times : array_like of shape (T,)
            Times of the frames, seconds.
        positions : array_like of shape (T, K, 3)
            Positions, metres; NaN for an absent marker.
        names : sequence of K str, optional
            Names of the markers; M00, M01 and so on by default.
        lines : sequence of (marker, marker, colour)
            Lines between markers by their numbers; colours count from 1.
        colours, surfaces
            As for the class.

        Returns
        -------
        Truth
        """
        if names is None:
            names = [f"M{i:02d}" for i in range(np.shape(positions)[1])]
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
