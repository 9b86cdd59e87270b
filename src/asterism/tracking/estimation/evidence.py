"""Counts from tracks of a capture: region, links, missed detections, clutter and speeds."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from asterism.errors import ParameterError
from asterism.records import record
from asterism.tracking.estimation.occlusions import Sightings, count_sightings
from asterism.tracking.estimation.scales import extents, quantile
from asterism.tracking.methods.gnn import GNN

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from asterism.model import Detections, TrackingModel, Tracks
    from asterism.tracking.estimation.sampling import Runs

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
        extent = extents(detections.points)
        longest = max(float(extent.max()), 1e-3)
        return cls(
            volume=float(np.prod(np.maximum(extent, 0.1 * longest))),
            points_a_frame=detections.n_points / detections.n_frames,
            n_axes=detections.n_axes,
        )


@record(eq=False)
class Evidence:
    """Counts from the tracks of some runs of a capture.

    Parameters
    ----------
    runs : Runs
        Runs of consecutive frames.
    labels : list of ndarray of int
        Tracks of each run.
    tracks : Tracks
        Tracks of all runs.
    n_misses : int
        Number of missed detections inside tracks.
    sightings : Sightings
        Counts of detected and missed markers. A lost marker is not a missed one.
    top_speed : float
        Speed that one in ten thousand links exceeds, m/s.
    velocity_rms : float
        Root mean square of a velocity coordinate, m/s.
    n_links : int
        Number of pairs of consecutive detections in tracks.
    """

    runs: Runs
    labels: list[NDArray[np.int64]]
    tracks: Tracks
    n_misses: int
    sightings: Sightings
    top_speed: float
    velocity_rms: float
    n_links: int

    @property
    def n_clutter(self) -> int:
        """Number of points in no track."""
        return len(self.tracks.labels) - int(self.tracks.lengths.sum())

    @property
    def n_frames(self) -> int:
        """Number of frames of all runs."""
        return self.tracks.detections.n_frames

    @property
    def n_lost(self) -> int:
        """Number of missed detections and points in no track."""
        return self.n_misses + self.n_clutter

    @classmethod
    def of(cls, runs: Runs, labels: list[NDArray[np.int64]], reach: float) -> Evidence:
        """Count in the tracks of each run.

        Parameters
        ----------
        runs : Runs
            Runs of consecutive frames.
        labels : list of ndarray of int
            Tracks of each run.
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
        tracks = runs.tracks(labels)
        d = tracks.detections
        order, _ = tracks.by_track
        frame = d.frame_of[order]
        is_link = np.diff(tracks.labels[order]) == 0
        n_links = int(np.count_nonzero(is_link))
        if n_links < MIN_LINKS:
            raise ParameterError(
                "detections",
                f"tracks with at least {MIN_LINKS} links in all, to estimate a model from",
                f"{n_links}",
                "give a model",
            )
        move = np.diff(d.points[order], axis=0)
        squares = np.einsum("nd,nd->n", move, move)[is_link]
        squares /= np.diff(d.times[frame])[is_link] ** 2
        return cls(
            runs=runs,
            labels=labels,
            tracks=tracks,
            n_misses=int((np.diff(frame)[is_link] - 1).sum()),
            sightings=count_sightings(tracks, reach),
            top_speed=math.sqrt(quantile(squares, 0.9999)),
            velocity_rms=math.sqrt(float(squares.mean()) / d.n_axes),
            n_links=n_links,
        )


def gather_evidence(runs: Runs, model: TrackingModel, reach: float) -> Evidence:
    """Track each run with GNN and count the events in the tracks.

    Parameters
    ----------
    runs : Runs
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
    start = method.init(model, n_axes=runs.pieces[0].n_axes)
    return Evidence.of(runs, [method.run(start, piece)[1] for piece in runs.pieces], reach)
