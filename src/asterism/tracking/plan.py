"""Plan of a tracking: model, method and stitching, decided before the association."""

from __future__ import annotations

import hashlib
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from asterism.checks import check_kind, check_number
from asterism.errors import ParameterError
from asterism.model import Capture, Detections, Edit, MarkerSet, Recipe, TrackingModel, Tracks
from asterism.model.recipe import InputHash, hash_of_edits, versions
from asterism.records import record
from asterism.tracking.choose import CONFUSED, Choice, choose_method
from asterism.tracking.estimation import estimate_model
from asterism.tracking.methods import MCMCDA, SMP, Method, method_by_name, options_of
from asterism.tracking.motion_in_common import choice_without_common_motion
from asterism.tracking.naming.own_names import has_own_names

if TYPE_CHECKING:
    from collections.abc import Sequence

    from asterism.tracking.estimation import ModelEstimate

__all__ = ["Plan", "hash_of_names", "plan_tracking"]


@record
class Plan:
    """Settings of a tracking before it is run.

    Parameters
    ----------
    recipe : Recipe
        Complete settings; ``am.track(detections, recipe=plan.recipe)`` runs them.
    method : Method
        Method with its options.
    estimate : ModelEstimate, optional
        Estimate of the model; None for a given model.

    Examples
    --------
    >>> import asterism as am
    >>> d = am.simulate.cube(frames=40, seed=1).detections
    >>> plan = am.tracking.plan_tracking(d, "gnn")
    >>> plan.method, plan.recipe.stitch, plan.estimate.model.sensor.noise_sigma
    (GNN(), False, 0.0002)
    """

    recipe: Recipe
    method: Method[Any]
    estimate: ModelEstimate | None = None


def plan_tracking(
    detections: Detections,
    method: Method[Any] | str | None = None,
    *,
    model: TrackingModel | None = None,
    stitch: bool | Literal["auto"] = "auto",
    seed: int | None = None,
    start: Tracks | None = None,
    marker_sets: Sequence[MarkerSet] | None = None,
    edits: Sequence[Edit] = (),
    fill: bool = False,
) -> Plan:
    """Decide the model, the method and the stitching of a tracking, without running it.

    Parameters
    ----------
    detections : Detections
        Unnamed points.
    method : Method or str, optional
        Method of association, or its name; by default `choose_method` selects one. If a model is
        not given either, the motion that most markers have in common may be removed first.
    model : TrackingModel, optional
        Tracking model; by default `estimate_model` estimates it from the capture.
    stitch : bool or "auto", optional
        Whether tracks are joined through gaps of any length, as for `track`.
    seed : int, optional
        Seed of the methods that draw random numbers; 0 by default.
    start : Tracks, optional
        Initial tracks of the same detections, which `MCMCDA` repairs.
    marker_sets : sequence of MarkerSet, optional
        Marker sets by which the tracks are named, as for `track`; by default the own names of a
        `Capture`, if it has any.
    edits : sequence of Edit
        Edits that the tracks respect, as for `track`.
    fill : bool
        Whether gaps are filled.

    Returns
    -------
    Plan
        Settings with which `track` would run, for a look at them before a long run.

    Raises
    ------
    ParameterError
        If no model can be estimated, an argument has the wrong type, or the initial tracks are of
        other detections.

    Examples
    --------
    >>> import asterism as am
    >>> plan = am.tracking.plan_tracking(am.simulate.cube(seed=1).detections)
    >>> plan.recipe.method, plan.recipe.stitch, plan.recipe.reason
    ('smp', True, '8 of 8 tracks have a stable distance to another: bodies')
    """
    check_kind("detections", detections, Detections, "am.Detections.from_frames, or am.read")
    if stitch not in (True, False, "auto"):
        raise ParameterError("stitch", 'True, False or "auto"', repr(stitch))
    requested = None if stitch == "auto" else bool(stitch)
    if seed is not None:
        check_number("seed", seed, above=0, closed=True, integer=True)
    if method is not None:  # checked before the slow estimation of the model
        method = _checked(method)
    if start is not None:
        _check_start(start, detections)
    for each in edits:
        check_kind("edits", each, Edit, "asterism.io.read_edits(path, detections)")
    if method is None:
        choice = _chosen(
            detections, model, has_start=start is not None, must_stitch=requested is True
        )
    else:
        estimate = estimate_model(detections) if model is None else None
        choice = Choice(method=method, stitch=requested is True, reason="", estimate=estimate)
    is_stitched = choice.stitch if requested is None else requested
    is_searched = choice.rivals > CONFUSED and choice.method.name == MCMCDA.name
    model = model if choice.estimate is None else choice.estimate.model
    check_kind("model", model, TrackingModel, "am.estimate_model(detections).model")
    assert model is not None
    recipe = Recipe(
        method=choice.method.name,
        options=options_of(choice.method),
        model=model,
        stitch=is_stitched,
        seed=seed,
        has_start=start is not None,
        reason=choice.reason,
        markers=hash_of_names(detections, marker_sets),
        edits=hash_of_edits(edits),
        fill=fill,
        input_hash=InputHash((detections, None if start is None else start.labels)),
        versions=versions(),
        retry=method is None and start is None and (is_stitched or is_searched),
        common_motion=choice.common_motion,
    )
    return Plan(recipe=recipe, method=choice.method, estimate=choice.estimate)


def _chosen(
    detections: Detections, model: TrackingModel | None, *, has_start: bool, must_stitch: bool
) -> Choice:
    """Return the choice for a capture, with the estimate of its model unless it was given.

    A given model holds for the capture as it is.
    """
    estimate = None
    try:
        if model is None:
            estimate = estimate_model(detections)
            model = estimate.model
    except ParameterError:
        choice = None if has_start else choice_without_common_motion(detections, None)
        if choice is None:
            raise
        if must_stitch and not choice.stitch:
            reason = f"{choice.reason}; stitching is requested"
            return replace(choice, method=SMP(window=3), stitch=True, reason=reason)
        return choice
    check_kind("model", model, TrackingModel, "am.estimate_model(detections).model")
    if must_stitch and not has_start:
        reason = "stitching is requested"
        return Choice(method=SMP(window=3), stitch=True, reason=reason, estimate=estimate)
    choice = replace(choose_method(detections, model, has_start=has_start), estimate=estimate)
    # For bodies, `most_certain` decides by the certainty of identities: they may move apart.
    if estimate is not None and choice.rivals > CONFUSED and not choice.stitch:
        return choice_without_common_motion(detections, model) or choice
    return choice


def _check_start(start: Tracks, detections: Detections) -> None:
    """Raise unless initial tracks have as many detections in each frame."""
    check_kind("start", start, Tracks, "am.Tracks(detections=…, labels=…)")
    own, given = start.detections, detections
    if np.array_equal(own.offsets, given.offsets):
        return
    expected, found = _size_of(given), _size_of(own)
    if (own.n_frames, own.n_points) == (given.n_frames, given.n_points):
        t = int(np.argmax(own.counts != given.counts))
        expected, found = f"{expected}, {given.counts[t]} in frame {t}", f"{found}, {own.counts[t]}"
    hint = "give tracks of the capture that is tracked, as from am.read(path).tracks"
    raise ParameterError("start", f"tracks of the same detections: {expected}", found, hint)


def _size_of(detections: Detections) -> str:
    """Return the number of frames and detections, with the file of a capture."""
    size = f"{detections.n_frames} frames with {detections.n_points} detections"
    return f"{size} in {detections.path}" if isinstance(detections, Capture) else size


def hash_of_names(detections: Detections, marker_sets: Sequence[MarkerSet] | None) -> str:
    """Return the SHA-256 of what names the tracks, in hexadecimal; empty for nothing.

    Parameters
    ----------
    detections : Detections
        Points; their own names count if no sets are given.
    marker_sets : sequence of MarkerSet, optional
        Marker sets; none of them, and no own names, if the sequence is empty.
    """
    if marker_sets is None and isinstance(detections, Capture) and has_own_names(detections):
        own = "\n".join(name or "" for name in detections.names).encode()
        return hashlib.sha256(own + b"\n" + detections.labels.tobytes()).hexdigest()
    if not marker_sets:
        return ""
    for made in marker_sets:
        check_kind("marker_set", made, MarkerSet, "am.read_marker_set(path)")
    return hashlib.sha256("".join(made.to_toml() for made in marker_sets).encode()).hexdigest()


def _checked(method: Method[Any] | str) -> Method[Any]:
    if isinstance(method, str):
        return method_by_name(method)
    check_kind("method", method, Method, 'am.GNN(), or "gnn"')
    return method
