"""What tracking a clip with a model shows: where the points are, links, misses, clutter, speeds."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from asterism.errors import ParameterError
from asterism.model import Detections, TrackingModel, Tracks
from asterism.records import record
from asterism.tracking.estimation.occlusions import Sightings, count_sightings
from asterism.tracking.methods.gnn import GNN

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Evidence", "Region", "gather_evidence"]

LEAST_LINKS = 10


@record
class Region:
    """Where the points are, for the densities per volume.

    Parameters
    ----------
    volume : float
        m³, or m² in the plane.
    points_a_frame : float
        Their mean number.
    n_axes : int
        2 or 3.
    """

    volume: float
    points_a_frame: float
    n_axes: int

    @classmethod
    def of(cls, detections: Detections) -> Region:
        """Take the bounding box of all points, no axis thinner than a tenth of the longest.

        A flat volume would make every density of clutter enormous.
        """
        extent = np.ptp(detections.points, axis=0)
        longest = max(float(extent.max()), 1e-3)
        return cls(
            volume=float(np.prod(np.maximum(extent, 0.1 * longest))),
            points_a_frame=detections.n_points / detections.n_frames,
            n_axes=detections.n_axes,
        )


@record
class Evidence:
    """What tracking found, over all pieces of a clip.

    Parameters
    ----------
    tracks : list of Tracks
        Those of each piece.
    n_misses : int
        Frames without a detection inside tracks.
    sightings : Sightings
        How often markers were seen and missed; what was lost is no miss.
    n_clutter : int
        Points in no track.
    n_frames : int
        Of all pieces.
    speeds : ndarray, shape (L,)
        Of each link, m/s.
    velocity_rms : float
        Of a velocity coordinate, m/s.
    """

    tracks: list[Tracks]
    n_misses: int
    sightings: Sightings
    n_clutter: int
    n_frames: int
    speeds: NDArray[np.float64]
    velocity_rms: float

    @property
    def n_lost(self) -> int:
        """Misses and points in no track: what is left unexplained."""
        return self.n_misses + self.n_clutter

    @classmethod
    def of(cls, tracks: list[Tracks], reach: float) -> Evidence:
        """Count in the tracks of each piece; `reach` as in `count_sightings`.

        Raises
        ------
        ParameterError
            If they have hardly any links.
        """
        misses = clutter = 0
        speeds: list[NDArray[np.float64]] = []
        squares: list[NDArray[np.float64]] = []
        for found in tracks:
            d = found.detections
            order, _ = found.by_track
            frame = d.frame_of[order]
            is_link = np.diff(found.labels[order]) == 0
            dt = np.diff(d.times[frame])[is_link]
            moves = np.diff(d.points[order], axis=0)[is_link]
            misses += int((np.diff(frame)[is_link] - 1).sum())
            clutter += int((found.labels < 0).sum())
            speeds.append(np.linalg.norm(moves, axis=1) / dt)
            squares.append(((moves / dt[:, None]) ** 2).mean(axis=1))
        seen = [count_sightings(found, reach) for found in tracks]
        n_links = sum(map(len, speeds))
        if n_links < LEAST_LINKS:
            raise ParameterError(
                "detections",
                f"tracks with at least {LEAST_LINKS} links in all, to estimate a model from",
                f"{n_links}",
                "give a model",
            )
        return cls(
            tracks=tracks,
            n_misses=misses,
            sightings=Sightings(*map(sum, zip(*seen, strict=True))),
            n_clutter=clutter,
            n_frames=sum(found.detections.n_frames for found in tracks),
            speeds=np.concatenate(speeds),
            velocity_rms=math.sqrt(float(np.concatenate(squares).mean())),
        )

    @property
    def n_links(self) -> int:
        """Number of pairs of consecutive detections in tracks."""
        return len(self.speeds)


def gather_evidence(pieces: list[Detections], model: TrackingModel, reach: float) -> Evidence:
    """Track the pieces of a clip and count.

    Raises
    ------
    ParameterError
        If hardly anything could be followed.
    """
    method = GNN()
    found: list[Tracks] = []
    for piece in pieces:
        state = method.init(model, n_axes=piece.n_axes)
        found.append(Tracks(detections=piece, labels=method.run(state, piece)[1]))
    return Evidence.of(found, reach)
