"""Run one method over a capture: detections in, tracks out."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from asterism.checks import check_kind
from asterism.errors import ParameterError
from asterism.model import Detections, TrackingModel, Tracks
from asterism.model.posterior import log_posterior
from asterism.tracking.methods.base import Method
from asterism.tracking.methods.mcmcda import MCMCDA

if TYPE_CHECKING:
    from collections.abc import Callable

    import numpy as np
    from numpy.typing import NDArray

__all__ = ["associate", "check_method"]


def associate(
    method: Method[Any],
    detections: Detections,
    model: TrackingModel,
    *,
    seed: int | None = None,
    start: Tracks | None = None,
    progress: Callable[[int], Any] | None = None,
) -> Tracks:
    """Run a method over a capture.

    Parameters
    ----------
    method : Method
        The way of searching.
    detections : Detections
        Unnamed points; those that were filled are left out.
    model : TrackingModel
        The model that is searched.
    seed : int, optional
        For the methods that draw.
    start : Tracks, optional
        Tracks of the same detections that `MCMCDA` begins with.
    progress : callable, optional
        Called now and then with the number of frames done.

    Returns
    -------
    Tracks
        ``info["log_posterior"]`` and what the method tells.

    Raises
    ------
    ParameterError
        If an argument has the wrong type.
    """
    check_method(method)
    if start is not None:
        labels = _labels_of(start, detections)
        if detections.filled is not None:
            labels = labels[~detections.filled]
    else:
        labels = None
    detections = detections.measured()
    if labels is None:
        state = method.init(model, n_axes=detections.n_axes, seed=seed)
    elif isinstance(method, MCMCDA):
        state = method.init(model, n_axes=detections.n_axes, seed=seed, start=labels)
    else:
        raise ParameterError("start", "none", "tracks", "only mcmcda begins with given tracks")
    state, labels, confidence = method.run(state, detections, progress=progress)
    info = dict(state.info)
    if detections.covariances is not None:
        info["isotropic_noise"] = True  # tracks have one variance for all axes
    tracks = Tracks(detections=detections, labels=labels, confidence=confidence, info=info)
    info["log_posterior"] = log_posterior(tracks, model)
    return tracks


def check_method(method: object) -> None:
    """Raise `ParameterError` unless it is a method; a name and a class are the usual mistakes."""
    check_kind("method", method, Method, 'am.GNN(), or am.tracking.method_by_name("gnn")')


def _labels_of(start: Tracks, detections: Detections) -> NDArray[np.int64]:
    check_kind("start", start, Tracks, "am.Tracks(detections=…, labels=…)")
    if len(start.labels) != detections.n_points:
        raise ParameterError(
            "start", f"labels of the same {detections.n_points} detections", len(start.labels)
        )
    return start.labels
