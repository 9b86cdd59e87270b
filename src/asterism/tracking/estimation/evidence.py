"""Counts from tracks of a capture: region, links, missed detections, clutter and speeds."""

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

MIN_LINKS = 10


@record
class Region:
    """Volume of a capture and its points, for densities per volume.

    Parameters
    ----------
    volume : float
        Volume, m³, or area, m² in 2-D.
    points_a_frame : float
        Mean number of points in a frame.
    n_axes : int
        Number of coordinates, 2 or 3.
    """

    volume: float
    points_a_frame: float
    n_axes: int

    @classmethod
    def of(cls, detections: Detections) -> Region:
        """Measure the bounding box of all points, with axes of at least a tenth of the longest.

        The lower bound keeps the clutter density of a flat scene finite.

        Parameters
        ----------
        detections : Detections
            Capture to measure.

        Returns
        -------
        Region
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
    """Counts from tracks, over all pieces of a capture.

    Parameters
    ----------
    tracks : list of Tracks
        Tracks of each piece.
    n_misses : int
        Number of missed detections inside tracks.
    sightings : Sightings
        Counts of detected and missed markers. A lost marker is not a missed one.
    n_clutter : int
        Number of points in no track.
    n_frames : int
        Number of frames of all pieces.
    speeds : ndarray of shape (L,)
        Speed of each link, m/s.
    velocity_rms : float
        Root mean square of a velocity coordinate, m/s.
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
        """Number of missed detections and points in no track."""
        return self.n_misses + self.n_clutter

    @classmethod
    def of(cls, tracks: list[Tracks], reach: float) -> Evidence:
        """Count in the tracks of each piece.

        Parameters
        ----------
        tracks : list of Tracks
            Tracks of each piece.
        reach : float
            As in `count_sightings`, metres.

        Returns
        -------
        Evidence

        Raises
        ------
        ParameterError
            If the tracks have too few links.
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
        if n_links < MIN_LINKS:
            raise ParameterError(
                "detections",
                f"tracks with at least {MIN_LINKS} links in all, to estimate a model from",
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
    """Track the pieces of a capture with GNN and count the events in the tracks.

    Parameters
    ----------
    pieces : list of Detections
        Runs of consecutive frames of the capture.
    model : TrackingModel
        Model for the tracking.
    reach : float
        As in `count_sightings`, metres.

    Returns
    -------
    Evidence

    Raises
    ------
    ParameterError
        If too few points could be linked.
    """
    method = GNN()
    start = method.init(model, n_axes=pieces[0].n_axes)
    found = [Tracks(detections=piece, labels=method.run(start, piece)[1]) for piece in pieces]
    return Evidence.of(found, reach)
