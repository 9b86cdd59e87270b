"""Selection of a method from measured properties of a capture.

GNN tracks the capture once, which takes a fraction of the time of any other method. Its tracks
show whether markers keep their distances; the number of detections in their gates shows how often
the association was ambiguous. The documentation (`Which method when`) measures each rule.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from asterism.checks import check_kind
from asterism.model import Detections, RandomWalk, TrackingModel, Tracks
from asterism.records import record
from asterism.tracking.estimation import fit_body_motion
from asterism.tracking.methods.gnn import GNN
from asterism.tracking.methods.mcmcda import MCMCDA
from asterism.tracking.methods.options import Rigidity
from asterism.tracking.methods.smp import SMP
from asterism.tracking.rigidity.distances import MIN_TOGETHER, distances_from

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from asterism.tracking.estimation import ModelEstimate
    from asterism.tracking.methods.base import Method

__all__ = [
    "AUTO",
    "CONFUSED",
    "Choice",
    "choose_method",
    "quick_tracks",
]

AUTO = "auto"
"""Name on the command line for the automatic selection of a method."""

SAMPLES = 200
"""Number of frames, spread over the capture, in which distances are compared."""
MAX_TRACKS = 60
"""Number of tracks that are compared, the longest ones."""
RIGID = 0.05
"""Largest spread of a bond on a rigid segment, as a share of the spread of its markers' positions.
The relative measure is needed because markers at rest keep their distances too, as do all markers
over a fraction of a second."""
NEAREST = 6
"""Number of nearest neighbours among which partners are searched. Among a thousand independent
markers some pair keeps its distance over a few frames by chance."""
ON_BODIES = 0.2
"""Smallest share of tracks with a rigid partner for a capture of bodies. It is well below 1,
because the wrong tracks after bursts of missed detections have no partner."""
CLEAR = 0.01
"""Largest number of rival detections per link at which the association is unambiguous."""

CONFUSED = 1.0
"""Number of rival detections per link above which the tracks of GNN do not tell whether there are
bodies, so that `fit_body_motion` does, `MCMCDA` searches until two searches agree, and markers
without bodies are tried without the motion in common."""


@record
class Choice:
    """Method selected for a capture, with the reason.

    Parameters
    ----------
    method : Method
        Selected method with all its options, for `track` or `Method.init`.
    stitch : bool
        Whether the tracklets of the method are to be stitched.
    reason : str
        What was measured in the capture and what follows from it, in one line; empty for a method
        that the caller names.
    rivals : float
        Number of rival detections per link.
    estimate : ModelEstimate, optional
        Estimate of the model with which the method is used; None if the model was given.
    common_motion : bool
        Whether the motion that most markers have in common is removed (`without_common_motion`).
        `plan_tracking` decides it.

    Examples
    --------
    >>> import asterism as am
    >>> d = am.simulate.smooth(n_markers=10, frames=40, seed=1).detections
    >>> choice = am.tracking.choose_method(d, am.estimate_model(d).model)
    >>> choice.method
    GNN()
    >>> choice.reason
    '0.0 rival detections in the gates per 100 links, no bodies'
    """

    method: Method[Any]
    stitch: bool
    reason: str
    rivals: float = 0.0
    estimate: ModelEstimate | None = None
    common_motion: bool = False


def choose_method(
    detections: Detections, model: TrackingModel, *, has_start: bool = False
) -> Choice:
    """Select a method from measured properties of a capture.

    - Given initial tracks: `MCMCDA`, the only method that repairs them.
    - Markers that keep their distance to another one, as on bodies: `SMP` over three frames with
      stitching, because neighbours predict where an occluded marker reappears; with bonds where
      they move so far that only bonds hold their tracks together.
    - Markers that move by a random walk, or that enter each other's gates: `MCMCDA`.
    - Any other capture is unambiguous: `GNN`.

    Parameters
    ----------
    detections : Detections
        Capture to measure.
    model : TrackingModel
        Tracking model of the capture, with which GNN tracks it once.
    has_start : bool
        Whether the tracking starts from given tracks; then nothing is measured.

    Returns
    -------
    Choice
        Selection; it is deterministic.

    Raises
    ------
    ParameterError
        If an argument has the wrong type.

    Examples
    --------
    >>> import asterism as am
    >>> truth = am.simulate.cube(frames=40, seed=1)
    >>> model = am.estimate_model(truth.detections).model
    >>> choice = am.tracking.choose_method(truth.detections, model)
    >>> choice.method.name, choice.stitch
    ('smp', True)
    """
    check_kind("detections", detections, Detections)
    check_kind("model", model, TrackingModel, "am.estimate_model(detections).model")
    if has_start:
        return Choice(method=MCMCDA(), stitch=False, reason="initial tracks are given")
    detections = detections.measured()
    tracks, rivals = quick_tracks(detections, model)
    return replace(_choice(tracks, model, rivals), rivals=rivals)


def _choice(tracks: Tracks, model: TrackingModel, rivals: float) -> Choice:
    """Return the choice for tracks of GNN with this number of rival detections per link."""
    if bodies := _bodies(tracks, model):
        return bodies
    if any(isinstance(mode, RandomWalk) for mode in model.motion.modes):
        return Choice(
            method=MCMCDA(), stitch=False, reason="the motion is a random walk, no bodies"
        )
    rate = f"{100 * rivals:.1f} rival detections in the gates per 100 links, no bodies"
    if rivals > CLEAR:
        # Markers that move by more than the distance to their neighbours have no stable distances
        # in tracks of GNN.
        fitted = fit_body_motion(tracks.detections, model) if rivals > CONFUSED else None
        if fitted is not None and (bodies := _bodies(fitted[1], fitted[0])):
            return replace(bodies, method=SMP(window=3, rigid=Rigidity()))
        return Choice(method=MCMCDA(), stitch=False, reason=rate)
    return Choice(method=GNN(), stitch=False, reason=rate)


def quick_tracks(detections: Detections, model: TrackingModel) -> tuple[Tracks, float]:
    """Return tracks of GNN, and the number of rival detections per link.

    The number is per link, not per detection: the first detection of a track is in no gate, and
    short captures consist largely of first detections.

    Parameters
    ----------
    detections : Detections
        Capture.
    model : TrackingModel
        Its model.

    Returns
    -------
    tracks : Tracks
    n_rivals : float
    """
    method = GNN()
    state, labels, _ = method.run(method.init(model, n_axes=detections.n_axes), detections)
    labels.flags.writeable = False  # no other object refers to it: no need to copy
    tracks = Tracks(detections=detections, labels=labels)
    n_links = int(tracks.lengths.sum()) - tracks.n_tracks
    return tracks, max(state.info["candidates"] / max(n_links, 1) - 1, 0.0)


def _bodies(tracks: Tracks, model: TrackingModel) -> Choice | None:
    """Return the choice for markers on bodies, None if too few tracks have a rigid partner."""
    n_rigid, n_compared = partners(tracks, model.sensor.noise_sigma)
    if not n_compared or n_rigid < ON_BODIES * n_compared:
        return None
    reason = f"{n_rigid} of {n_compared} tracks have a stable distance to another: bodies"
    return Choice(method=SMP(window=3), stitch=True, reason=reason)


def partners(tracks: Tracks, noise_sigma: float) -> tuple[int, int]:
    """Count the tracks with a neighbour at a stable distance, and the tracks compared.

    Parameters
    ----------
    tracks : Tracks
        Tracks; the longest `MAX_TRACKS` are compared, in `SAMPLES` frames.
    noise_sigma : float
        Standard deviation of a coordinate, metres; distances vary by it even on rigid bodies.

    Returns
    -------
    n_rigid, n_compared : int
        Number of tracks with a rigid partner, and of tracks with any partner to compare.
    """
    positions = _sampled(tracks)
    n_rigid = n_compared = 0
    for i in range(positions.shape[1]):
        found = distances_from(positions[:, i], positions)
        others = np.flatnonzero(found.n_frames >= MIN_TOGETHER)
        others = others[others != i]
        if not len(others):
            continue
        n_compared += 1
        nearest = others[np.argsort(found.middle[others], kind="stable")[:NEAREST]]
        moved = np.sqrt(np.nanvar(positions[:, i], axis=0).sum())
        is_rigid = found.is_bond & (found.spread < max(RIGID * moved, 3 * noise_sigma))
        n_rigid += bool(is_rigid[nearest].any())
    return n_rigid, n_compared


def _sampled(tracks: Tracks) -> NDArray[np.float64]:
    """Return positions of the longest tracks in frames spread over the capture, (S, K, D)."""
    d = tracks.detections
    frames = np.unique(np.linspace(0, d.n_frames - 1, SAMPLES).astype(np.int64))
    longest = np.argsort(-tracks.lengths, kind="stable")[:MAX_TRACKS]
    column = np.full(tracks.n_tracks + 1, -1)  # the last element is for clutter
    column[longest] = np.arange(len(longest))
    counts = d.counts[frames]
    i = np.repeat(np.arange(len(frames)), counts)
    # Points of the sampled frames: the first of each, and the rank within the frame.
    own = np.repeat(d.offsets[frames] - np.cumsum(counts) + counts, counts) + np.arange(len(i))
    j = column[tracks.labels[own]]
    is_in = j >= 0
    sampled = np.full((len(frames), len(longest), d.n_axes), np.nan)
    sampled[i[is_in], j[is_in]] = d.points[own[is_in]]
    return sampled
