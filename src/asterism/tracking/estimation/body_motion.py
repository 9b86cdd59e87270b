"""The motion of markers on bodies, fitted to tracks that bonds hold together."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from asterism.tracking.estimation.estimate import MIN_NOISE, WIDER
from asterism.tracking.estimation.fit_to_tracks import BOUNDS, start_of, with_fit
from asterism.tracking.estimation.motion_fit import fit_motion
from asterism.tracking.methods.associate import associate
from asterism.tracking.methods.options import Rigidity
from asterism.tracking.methods.smp import SMP

if TYPE_CHECKING:
    from asterism.model import Detections, TrackingModel, Tracks
    from asterism.tracking.methods.base import Method

__all__ = ["OVER_THREE_FRAMES", "fit_body_motion"]

MIN_LENGTH = 3
"""Number of detections of a track that has a motion."""
OVER_THREE_FRAMES = SMP(window=3, rigid=Rigidity())
"""Method by whose tracks the motion is fitted by default."""


def fit_body_motion(
    detections: Detections, model: TrackingModel, method: Method[Any] = OVER_THREE_FRAMES
) -> tuple[TrackingModel, Tracks] | None:
    """Fit noise and motion of a model to tracks of markers on bodies, by a method with `Rigidity`.

    `estimate_model` admits no acceleration by which a marker could reach its neighbour, because it
    could not tell it from a wrong link, and explains faster motion as noise. Bonds between markers
    tell them apart, so that there is no such bound here. The default is `SMP` over three frames: by
    single frames, so many links of fast markers are wrong that the fitted motion grows with each
    fit.

    Parameters
    ----------
    detections : Detections
        Capture.
    model : TrackingModel
        Estimated model.
    method : Method
        Method with bonds.

    Returns
    -------
    model : TrackingModel
        Model with three motions.
    tracks : Tracks
        Tracks to which it was fitted.

    If the markers move in random walks, or no track has three detections, the result is None.

    Examples
    --------
    >>> import asterism as am
    >>> from asterism.tracking.estimation import fit_body_motion
    >>> truth = am.simulate.person(frames=100, seed=1)
    >>> model = am.estimate_model(truth.detections).model
    >>> fitted, tracks = fit_body_motion(truth.detections, model)
    >>> len(fitted.motion.models), tracks.n_tracks
    (3, 53)
    """
    start = start_of(model)
    if start is None:
        return None
    n_axes = detections.n_axes
    levels = (*start.levels[:-1], WIDER * start.levels[-1])
    wide = with_fit(model, replace(start, noise=MIN_NOISE, levels=levels), n_axes)
    rough = associate(method, detections, wide, score=False)
    if rough.lengths.max(initial=0) < MIN_LENGTH:
        return None
    fit = fit_motion(rough, model, start, BOUNDS, refine=True)
    tracks = associate(method, detections, with_fit(model, fit, n_axes), score=False)
    return with_fit(model, fit_motion(tracks, model, fit, BOUNDS, refine=True), n_axes), tracks
