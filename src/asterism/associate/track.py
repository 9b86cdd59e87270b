"""Detections in, tracks out."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from asterism.associate.gnn import GNN
from asterism.associate.method import Method
from asterism.associate.model_from_clip import estimate_model
from asterism.errors import ParameterError
from asterism.model import Detections, TrackingModel, Tracks
from asterism.model.posterior import log_posterior

if TYPE_CHECKING:
    from collections.abc import Callable

    import numpy as np
    from numpy.typing import NDArray

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
        The way of searching; `GNN` where none is given.
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
        measured by (`log_posterior`), the rest of ``info`` is the method's own.

    Raises
    ------
    ParameterError
        If there is nothing from which to estimate a model, or an argument has the wrong type.

    Examples
    --------
    >>> import asterism as am
    >>> truth = am.simulate.cube(seed=1)
    >>> tracks = am.track(truth.detections, am.SMP())
    """
    _check_type(
        "detections", detections, Detections, "tracks.detections, or Detections.from_frames"
    )
    if start is not None:
        labels = _labels_of(start, detections)
        if detections.filled is not None:
            labels = labels[~detections.filled]
    else:
        labels = None
    detections = detections.measured()
    method = GNN() if method is None else method
    _check_type("method", method, Method, "GNN()")
    if model is None:
        model = estimate_model(detections).model
    _check_type("model", model, TrackingModel, "estimate_model(detections).model")
    state = method.init(model, n_axes=detections.n_axes, seed=seed)
    state, labels, confidence = method.run(state, detections, progress=progress, start=labels)
    info = dict(state.info)
    if detections.covariances is not None:
        info["isotropic_noise"] = True  # tracks have one variance for all axes
    tracks = Tracks(detections=detections, labels=labels, confidence=confidence, info=info)
    info["log_posterior"] = log_posterior(tracks, model)
    return tracks


def _labels_of(start: Tracks, detections: Detections) -> NDArray[np.int64]:
    _check_type("start", start, Tracks, "a Capture's tracks")
    if len(start.labels) != detections.n_points:
        raise ParameterError(
            "start", f"labels of the same {detections.n_points} detections", len(start.labels)
        )
    return start.labels


def _check_type(name: str, value: object, kind: type, hint: str) -> None:
    if not isinstance(value, kind):
        raise ParameterError(name, f"{kind.__name__} (try {hint})", type(value).__name__)
