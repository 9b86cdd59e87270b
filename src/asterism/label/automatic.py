"""Tracking as most will call it: the method told by the clip where none is named, stitched or not.

The loop of a method that was named is `asterism.associate.track`.
"""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any

from asterism.associate import Method, choose_method, estimate_model
from asterism.associate.track import check_method, track_with
from asterism.errors import check_kind
from asterism.label.identify import fragment_model
from asterism.label.stitching import stitch
from asterism.model import Detections, TrackingModel, Tracks

if TYPE_CHECKING:
    from collections.abc import Callable

__all__ = ["track"]


def track(
    detections: Detections,
    method: Method[Any] | None = None,
    *,
    model: TrackingModel | None = None,
    seed: int | None = None,
    start: Tracks | None = None,
    progress: Callable[[int], Any] | None = None,
) -> Tracks:
    """Tell which detection is which marker.

    Parameters
    ----------
    detections : Detections
        Unnamed points; names that a `Capture` carries are not used.
    method : Method, optional
        The way of searching. Where none is given the clip chooses (`choose_method`), and markers on
        bodies are stitched as `identify` does.
    model : TrackingModel, optional
        The model that is searched; estimated from the clip where none is given.
    seed : int, optional
        For the methods that draw.
    start : Tracks, optional
        Tracks of the same detections to begin with, the fragments of a file say; `MCMCDA` repairs
        them by merging, splitting and switching.
    progress : callable, optional
        Called now and then with the number of frames done.

    Returns
    -------
    Tracks
        Labels for the same detections, without those that were filled; tracks are numbered in the
        order in which they were believed. ``info["log_posterior"]`` is what every method is
        measured by (`log_posterior`); stitched tracks have none, for the model knows no gap so
        long. ``info["chosen"]`` says which method was chosen and why, where none was given; the
        rest of ``info`` is the method's own.

    Raises
    ------
    ParameterError
        If there is nothing from which to estimate a model, or an argument has the wrong type.

    Examples
    --------
    >>> import asterism as am
    >>> truth = am.simulate.cube(seed=1)
    >>> tracks = am.track(truth.detections)
    >>> tracks.info["chosen"]
    'smp, window=3, then stitched: 8 of 8 markers keep their distance to another: bodies'
    """
    check_kind("detections", detections, Detections, "am.Detections.from_frames, or am.read")
    if method is not None:
        check_method(method)  # before the model is estimated, which takes its time
    if model is None:
        model = estimate_model(detections).model
    check_kind("model", model, TrackingModel, "am.estimate_model(detections).model")
    more: dict[str, Any] = {"seed": seed, "start": start, "progress": progress}
    if method is not None:
        return track_with(method, detections, model, **more)
    choice = choose_method(detections, model, has_start=start is not None)
    if choice.stitch:
        model = fragment_model(model)
    tracks = track_with(choice.method, detections, model, **more)
    if choice.stitch:
        tracks = stitch(tracks, model).tracks
    return dataclasses.replace(tracks, info={**tracks.info, "chosen": choice.text})
