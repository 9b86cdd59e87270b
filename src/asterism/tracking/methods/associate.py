"""Association of a capture by one method."""

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

    from asterism.model import Recipe

__all__ = ["associate", "check_method"]


def associate(
    method: Method[Any],
    detections: Detections,
    model: TrackingModel,
    *,
    seed: int | None = None,
    start: Tracks | None = None,
    recipe: Recipe | None = None,
    score: bool = True,
    progress: Callable[[int], Any] | None = None,
) -> Tracks:
    """Associate the detections of a capture by one method.

    Parameters
    ----------
    method : Method
        Method of association, with its options.
    detections : Detections
        Unnamed points; filled points are left out.
    model : TrackingModel
        Model whose posterior is searched.
    seed : int, optional
        Seed of the methods that draw random numbers.
    start : Tracks, optional
        Tracks of the same detections from which `MCMCDA` starts.
    recipe : Recipe, optional
        Settings of the call, which the result carries.
    score : bool
        Whether the log posterior is computed.
    progress : callable, optional
        Called from time to time with the number of finished frames.

    Returns
    -------
    Tracks
        Tracks with ``info["log_posterior"]``, if it is computed, and the method's own counts.

    Raises
    ------
    ParameterError
        If an argument has the wrong type.

    Examples
    --------
    >>> import asterism as am
    >>> from asterism.tracking.methods.associate import associate
    >>> d = am.simulate.cube(frames=20, seed=1).detections
    >>> tracks = associate(am.GNN(), d, am.estimate_model(d).model)
    >>> tracks.n_tracks, tracks.info["log_posterior"] > 0
    (8, True)
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
        hint = "use mcmcda, the only method that starts from given tracks"
        raise ParameterError("start", "none", "tracks", hint)
    state, labels, confidence = method.run(state, detections, progress=progress)
    labels.flags.writeable = False  # the method returns an array of its own: no need to copy
    info = dict(state.info)
    if detections.covariances is not None:
        info["isotropic_noise"] = True  # a track has one variance for all axes
    tracks = Tracks(
        detections=detections, labels=labels, confidence=confidence, info=info, recipe=recipe
    )
    if score:
        info["log_posterior"] = log_posterior(tracks, model)
    return tracks


def check_method(method: object) -> None:
    """Raise `ParameterError` unless the object is a method, and not a name or a class.

    Parameters
    ----------
    method : object
        Object to check.

    Examples
    --------
    >>> check_method("gnn")
    Traceback (most recent call last):
    ...
    asterism.errors.ParameterError: method: expected a Method, found 'gnn'. Try am.GNN(), or
    am.tracking.method_by_name("gnn").
    """
    check_kind("method", method, Method, 'am.GNN(), or am.tracking.method_by_name("gnn")')


def _labels_of(start: Tracks, detections: Detections) -> NDArray[np.int64]:
    check_kind("start", start, Tracks, "am.Tracks(detections=…, labels=…)")
    if len(start.labels) != detections.n_points:
        raise ParameterError(
            "start", f"labels of the same {detections.n_points} detections", len(start.labels)
        )
    return start.labels
