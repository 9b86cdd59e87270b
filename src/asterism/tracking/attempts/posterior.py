"""Log posterior of tracks of markers, which may have gaps that the model excludes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism.metrics import oracle_tracks
from asterism.model import Tracks, shared_gains, track_scores
from asterism.model.compiled import SPEED_MARGIN_SIGMAS

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from asterism.model import SharedAcceleration, TrackingModel

__all__ = ["gain_of_change", "log_posterior", "within_limits"]

AROUND = 50
"""Number of frames, besides the longest gap, before and after a change in which the log posterior
is compared. By then the filter has forgotten it."""


def log_posterior(
    tracks: Tracks, model: TrackingModel, shared: SharedAcceleration | None = None
) -> float:
    """Return the log posterior of tracks, where track k is of marker k.

    Tracks are cut at the gaps and speeds that the model excludes. A piece that it excludes for
    another reason, such as one of a single detection, adds nothing.

    Parameters
    ----------
    tracks : Tracks
        Tracks.
    model : TrackingModel
        Model of the markers' own motion.
    shared : SharedAcceleration, optional
        Shared accelerations; by default there are none.
    """
    return _log_posterior(tracks, model, shared)


def gain_of_change(
    changed: NDArray[np.int64],
    before: NDArray[np.int64],
    after: NDArray[np.int64],
    tracks: Tracks,
    model: TrackingModel,
    shared: SharedAcceleration,
) -> float:
    """Return by how much the log posterior rises if some detections get other labels.

    Parameters
    ----------
    changed : ndarray of int, shape (n,)
        Detections in time order.
    before, after : ndarray of int, shape (N,)
        Track of each detection, -1 for clutter.
    tracks : Tracks
        Tracks of these detections.
    model, shared
        As for `log_posterior`.
    """
    d, margin = tracks.detections, AROUND + model.population.max_gap
    first = max(int(d.frame_of[changed[0]]) - margin, 0)
    end = min(int(d.frame_of[changed[-1]]) + margin + 1, d.n_frames)
    inside, part = slice(d.offsets[first], d.offsets[end]), d.part(first, end)
    markers = np.concatenate([before[changed], after[changed]])
    is_concerned = shared.concerned(markers[markers >= 0])
    without, with_it = (
        _log_posterior(Tracks(detections=part, labels=labels[inside]), model, shared, is_concerned)
        for labels in (before, after)
    )
    return with_it - without


def _log_posterior(
    tracks: Tracks,
    model: TrackingModel,
    shared: SharedAcceleration | None,
    is_counted: NDArray[np.bool_] | None = None,
) -> float:
    """Return the log posterior of tracks, with the gains of some markers, or of all."""
    pieces = within_limits(tracks, model)
    scores = track_scores(pieces, model)
    own = float(scores[np.isfinite(scores)].sum())
    if shared is None:
        return own
    order, offsets = pieces.by_track
    of = tracks.labels[order[offsets[:-1]]]
    counted = None if is_counted is None else is_counted[of]
    return own + float(shared_gains(pieces, model, shared, of, counted).sum())


def within_limits(tracks: Tracks, model: TrackingModel) -> Tracks:
    """Return the pieces of tracks between the gaps and the speeds that the model excludes.

    Parameters
    ----------
    tracks : Tracks
        Tracks.
    model : TrackingModel
        Model with the longest gap and the largest speed.
    """
    d, limits = tracks.detections, model.population
    order, _ = tracks.by_track
    label, at, time = tracks.labels[order], d.points[order], d.times[d.frame_of[order]]
    reach = limits.max_speed * np.diff(time) + SPEED_MARGIN_SIGMAS * model.sensor.noise_sigma
    begins = (label[1:] != label[:-1]) | (np.linalg.norm(np.diff(at, axis=0), axis=1) > reach)
    labels = np.full(d.n_points, -1)
    labels[order] = np.cumsum(np.append(False, begins))[: len(order)]
    return oracle_tracks(Tracks(detections=d, labels=labels), limits.max_gap)
