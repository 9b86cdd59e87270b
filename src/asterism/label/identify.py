"""From detections to markers: fragments that are sure, and stitching."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any

from asterism.associate import SMP, Method, estimate_model
from asterism.associate.track import check_method, track_with
from asterism.errors import check_kind
from asterism.label.stitching import Stitching, stitch
from asterism.model import Detections, TrackingModel

if TYPE_CHECKING:
    from collections.abc import Callable

__all__ = ["FRAGMENT_GAP", "fragment_model", "identify"]

FRAGMENT_GAP = 4
"""A tracker whose tracks are stitched gives up after so many frames: what comes back later is told
by its neighbours better than by its motion."""


def fragment_model(model: TrackingModel) -> TrackingModel:
    """Give the same model, by which tracks end after `FRAGMENT_GAP` frames unseen, or sooner."""
    max_gap = min(model.population.max_gap, FRAGMENT_GAP)
    return dataclasses.replace(
        model, population=dataclasses.replace(model.population, max_gap=max_gap)
    )


def identify(
    detections: Detections,
    method: Method[Any] | None = None,
    *,
    model: TrackingModel | None = None,
    seed: int | None = None,
    progress: Callable[[int], Any] | None = None,
    confirm: int = 15,
    ghost_radius: float = 0.03,
    max_hidden: int | None = None,
) -> Stitching:
    """Tell which detection is which marker, through gaps of any length.

    Tracks of `fragment_model`, made into markers by `stitch`.

    Parameters
    ----------
    detections : Detections
        Unnamed points.
    method : Method, optional
        What makes the fragments; `SMP` over three frames where none is given.
    model : TrackingModel, optional
        Estimated from the clip where none is given.
    seed, progress
        As for `track`.
    confirm, ghost_radius, max_hidden
        As for `stitch`.

    Returns
    -------
    Stitching

    Raises
    ------
    ParameterError
        As `track` and `stitch` do.

    Examples
    --------
    >>> import asterism as am
    >>> truth = am.simulate.person(seed=1)
    >>> hidden = am.simulate.sense(truth, burst=am.simulate.Burst(), seed=1)
    >>> markers = am.identify(hidden.detections)
    >>> am.evaluate(markers.tracks, hidden).idf1 > 0.99
    True
    """
    check_kind("detections", detections, Detections, "am.Detections.from_frames, or am.read")
    method = SMP(window=3) if method is None else method
    check_method(method)  # before the model is estimated, which takes its time
    if model is None:
        model = estimate_model(detections).model
    check_kind("model", model, TrackingModel, "am.estimate_model(detections).model")
    model = fragment_model(model)
    fragments = track_with(method, detections, model, seed=seed, progress=progress)
    return stitch(
        fragments, model, confirm=confirm, ghost_radius=ghost_radius, max_hidden=max_hidden
    )
