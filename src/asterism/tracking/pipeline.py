"""Tracking pipeline: model, method, association, stitching, names, edits, confidence, gaps."""

from __future__ import annotations

import dataclasses
import logging
from typing import TYPE_CHECKING, Any, Literal

from asterism.checks import check_kind
from asterism.errors import ParameterError
from asterism.model import Detections, Edit, MarkerSet, Recipe, TrackingModel, Tracks
from asterism.model.recipe import hash_of_edits, sha256_of, versions
from asterism.records import record
from asterism.tracking.attempts.most_certain import carried_out
from asterism.tracking.correction import correct, settled
from asterism.tracking.decisions import of_filling, of_naming, of_stitching
from asterism.tracking.estimation import model_of
from asterism.tracking.filling import LONGEST, fill_gaps
from asterism.tracking.naming import name_tracks
from asterism.tracking.plan import hash_of_names, plan_tracking

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from asterism.tracking.attempts.uncorrected import Uncorrected
    from asterism.tracking.estimation import ModelEstimate
    from asterism.tracking.filling import Filling
    from asterism.tracking.methods import Method
    from asterism.tracking.naming import Naming

__all__ = ["Tracked", "carry_out", "conclude", "track", "without_edits"]

log = logging.getLogger(__name__)


@record(eq=False)
class Tracked:
    """Result of a recipe, with the reports of its last steps.

    Parameters
    ----------
    tracks : Tracks
        Result of the last step.
    recipe : Recipe
        Recipe as it was carried out; its method is the one that made the tracks.
    naming : Naming, optional
        Names with their probabilities; None without marker sets and own names.
    filling : Filling, optional
        Every gap; None if gaps are not filled.
    estimate : ModelEstimate, optional
        Estimate of the model, if it was estimated after the recipe was planned: without the motion
        that most markers have in common.

    Examples
    --------
    >>> import asterism as am
    >>> d = am.simulate.cube(frames=40, seed=1).detections
    >>> am.tracking.carry_out(am.tracking.plan_tracking(d, "gnn").recipe, d).tracks.n_tracks
    8
    """

    tracks: Tracks
    recipe: Recipe
    naming: Naming | None = None
    filling: Filling | None = None
    estimate: ModelEstimate | None = None

    def __repr__(self) -> str:
        return f"Tracked({self.tracks!r})"


def track(
    detections: Detections,
    method: Method[Any] | str | None = None,
    *,
    model: TrackingModel | None = None,
    stitch: bool | Literal["auto"] = "auto",
    seed: int | None = None,
    start: Tracks | None = None,
    marker_set: MarkerSet | Sequence[MarkerSet] | None = None,
    edits: Sequence[Edit] = (),
    fill: bool = False,
    recipe: Recipe | None = None,
    progress: Callable[[int], Any] | None = None,
) -> Tracks:
    """Track the markers of a capture: assign each detection to a track or to clutter.

    Parameters
    ----------
    detections : Detections
        Points. The labels that a `Capture` carries have no influence on the association.
    method : Method or str, optional
        Method of association, or its name for the default options. By default `choose_method`
        selects one from measured properties of the capture.
    model : TrackingModel, optional
        Tracking model; by default `estimate_model` estimates it from the capture.
    stitch : bool or "auto"
        Whether tracks are joined through gaps of any length. The method then terminates tracklets
        after `MAX_TRACKLET_GAP` missed frames, and `stitch` joins them. "auto", the default,
        stitches if no method is given and markers have stable distances, as on bodies.
    seed : int, optional
        Seed of the methods that draw random numbers; 0 by default.
    start : Tracks, optional
        Initial tracks of the same detections, for example those of a file. `MCMCDA` repairs them
        by merging, splitting and switching.
    marker_set : MarkerSet or sequence of MarkerSet, optional
        Marker set of the subject, or of each subject, by which `name_tracks` names the tracks. By
        default they are named by the names that a `Capture` has itself, if any; ``()`` gives none.
    edits : sequence of Edit
        Statements of a person about detections, as of `asterism.io.read_edits`. The tracks are
        the most probable ones that respect them (`asterism.tracking.correct`).
    fill : bool
        Whether `fill_gaps` fills the gaps of the tracks.
    recipe : Recipe, optional
        ``tracks.recipe`` of an earlier call, which is repeated bit for bit. It replaces `method`,
        `model`, `stitch`, `seed` and `fill`; initial tracks, marker sets and edits are given again.
    progress : callable, optional
        Called from time to time with the number of finished frames. Without a method, each further
        attempt counts as half of what is left.

    Returns
    -------
    Tracks
        Labels for the same detections; filled ones are added with `fill` only. Tracks are numbered
        in the order of confirmation, named tracks in the order of the marker sets. ``recipe``
        repeats the call (None for a method that is not in `METHODS`). If no method was given,
        ``recipe.chosen`` is the selected method and the reason. ``info["log_posterior"]`` is the
        score by which methods are compared (`log_posterior`);
        stitched tracks have none, because the model excludes gaps of that length.
        ``info["refinements"]`` tells how often tracks whose identities were uncertain have been
        named by a marker set learnt from them, ``info["searches"]`` how many searches with shared
        accelerations were kept, and ``info["in_gaps"]`` how often a detection was taken into a gap.
        The rest of ``info`` depends on the method.

    Raises
    ------
    ParameterError
        If no model can be estimated, an argument has the wrong type, or the recipe belongs to
        other detections.

    Examples
    --------
    >>> import asterism as am
    >>> truth = am.simulate.cube(seed=1)
    >>> tracks = am.track(truth.detections)
    >>> tracks.recipe.chosen
    'smp, window=3, then stitched: 8 of 8 tracks have a stable distance to another: bodies'
    >>> again = am.track(truth.detections, recipe=tracks.recipe)
    >>> bool((again.labels == tracks.labels).all())
    True
    """
    sets = (marker_set,) if isinstance(marker_set, MarkerSet) else marker_set
    made = None
    if recipe is None:
        plan = plan_tracking(
            detections, method, model=model, stitch=stitch, seed=seed, start=start,
            marker_sets=sets, edits=edits, fill=fill,
        )  # fmt: skip
        recipe, made = plan.recipe, plan.method
    else:
        given = {"method": method, "model": model, "seed": seed, "fill": fill or None}
        given["stitch"] = None if stitch == "auto" else stitch
        _check_recipe(recipe, given, detections, start, sets, edits)
    return carry_out(
        recipe, detections, made, start=start, marker_sets=sets, edits=edits, progress=progress
    ).tracks


def carry_out(
    recipe: Recipe,
    detections: Detections,
    method: Method[Any] | None = None,
    *,
    start: Tracks | None = None,
    marker_sets: Sequence[MarkerSet] | None = None,
    edits: Sequence[Edit] = (),
    progress: Callable[[int], Any] | None = None,
) -> Tracked:
    """Carry out a recipe: associate, stitch, name, correct, assess and fill.

    Parameters
    ----------
    recipe : Recipe
        Settings, for example of `plan_tracking`; the input is not compared with its hash.
    detections : Detections
        Unnamed points.
    method : Method, optional
        Method of the recipe; needed only if it is not in `METHODS`.
    start : Tracks, optional
        Initial tracks of a recipe that has some.
    marker_sets : sequence of MarkerSet, optional
        Marker sets of a recipe that names tracks; by default the own names of the capture.
    edits : sequence of Edit
        Edits of a recipe that has some.
    progress : callable, optional
        Called from time to time with the number of finished frames of the association.

    Returns
    -------
    Tracked

    Examples
    --------
    >>> import asterism as am
    >>> d = am.simulate.cube(frames=40, seed=1).detections
    >>> am.tracking.carry_out(am.tracking.plan_tracking(d, "gnn").recipe, d).naming is None
    True
    """
    begun = without_edits(
        recipe, detections, method, start=start, marker_sets=marker_sets, progress=progress
    )
    return conclude(begun, edits)


def without_edits(
    recipe: Recipe,
    detections: Detections,
    method: Method[Any] | None = None,
    *,
    start: Tracks | None = None,
    marker_sets: Sequence[MarkerSet] | None = None,
    progress: Callable[[int], Any] | None = None,
) -> Uncorrected:
    """Carry out the steps of a recipe that come before edits: associate, stitch and name.

    Parameters
    ----------
    recipe, detections, method, start, marker_sets, progress
        As for `carry_out`.
    """
    _warn_of_versions(recipe)
    found = carried_out(recipe, detections, method, start=start, progress=progress)
    if not recipe.markers:
        return found
    naming = name_tracks(found.tracks, *(marker_sets or ()))
    return dataclasses.replace(found, tracks=naming.tracks, naming=naming)


def conclude(begun: Uncorrected, edits: Sequence[Edit] = ()) -> Tracked:
    """Carry out the other steps of a recipe: correct, assess and fill.

    Parameters
    ----------
    begun : Uncorrected
        Result of the steps before.
    edits : sequence of Edit
        Edits, in their order.
    """
    model, stitching, naming = begun.model, begun.stitching, begun.naming
    recipe = dataclasses.replace(begun.recipe, edits=hash_of_edits(edits))
    if edits:
        corrected = correct(begun.as_modelled(begun.tracks), edits, model, stitching)
        begun = dataclasses.replace(begun, tracks=begun.as_captured(corrected))
    tracks = settled(begun.assessed, edits)
    decisions = tracks.decisions
    if stitching is not None:
        decisions += of_stitching(stitching, tracks)
    if naming is not None:
        decisions += of_naming(naming, tracks)
    is_filled = recipe.fill or any(each.kind == "fill" for each in edits)
    filling = None
    if is_filled:
        longest = LONGEST if recipe.fill else 0.0  # only the gaps that edits state
        filling = fill_gaps(tracks, model=model_of(tracks, recipe), edits=edits, longest=longest)
        tracks = filling.tracks
        decisions += of_filling(filling)
    carried = None if tracks.recipe is None else recipe
    tracks = dataclasses.replace(tracks, decisions=decisions, recipe=carried)
    return Tracked(
        tracks=tracks, recipe=recipe, naming=naming, filling=filling, estimate=begun.estimate
    )


def _check_recipe(
    recipe: Recipe,
    given: dict[str, Any],
    detections: Detections,
    start: Tracks | None,
    marker_sets: Sequence[MarkerSet] | None,
    edits: Sequence[Edit],
) -> None:
    """Raise `ParameterError` unless the recipe is the only setting and has the same input."""
    check_kind("recipe", recipe, Recipe, "tracks.recipe")
    extra = [name for name, value in given.items() if value is not None]
    if extra:
        raise ParameterError("recipe", "no setting beside it", ", ".join(extra))
    check_kind("detections", detections, Detections, "am.Detections.from_frames, or am.read")
    if recipe.has_start != (start is not None):
        expected = "the initial tracks of that run" if recipe.has_start else "none"
        raise ParameterError("start", expected, "none" if start is None else "tracks")
    if (found := hash_of_names(detections, marker_sets)) != recipe.markers:
        expected = f"the marker sets of that run, or its own names, SHA-256 {recipe.markers}"
        raise ParameterError("marker_set", expected if recipe.markers else "none", found or "none")
    if (found := hash_of_edits(edits)) != recipe.edits:
        expected = f"those of that run, SHA-256 {recipe.edits}" if recipe.edits else "none"
        raise ParameterError("edits", expected, found or "none")
    found = sha256_of(detections, None if start is None else start.labels)
    if found != recipe.sha256:
        hint = "track the same input, or plan a new run"
        raise ParameterError("detections", f"SHA-256 {recipe.sha256}", found, hint)


def _warn_of_versions(recipe: Recipe) -> None:
    for name, version in versions().items():
        before = recipe.versions.get(name)
        if before != version:
            log.warning(
                "the recipe was made with %s %s, and this run uses %s", name, before, version
            )
