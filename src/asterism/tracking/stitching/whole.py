"""Stitching of the tracklets of a whole capture into tracks of markers.

After a long occlusion a marker's own motion no longer predicts where it reappears. Neighbours at
stable distances do, because body segments move almost rigidly.
"""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from asterism import _engine
from asterism.checks import check_kind, check_number
from asterism.model import TrackingModel, Tracks
from asterism.records import record
from asterism.tracking.rigidity.bonds import Bonds, learn_bonds
from asterism.tracking.stitching.exchanged import exchanged_by_distances
from asterism.tracking.stitching.joined import joined_by_distances
from asterism.tracking.stitching.passes import GHOST, go_through
from asterism.tracking.stitching.recovered import recovered_from_ghosts

if TYPE_CHECKING:
    from numpy.typing import NDArray


__all__ = ["Join", "Stitching", "check_options", "stitch", "stitch_options"]


@record
class Join:
    """Join of two tracklets of one marker.

    Parameters
    ----------
    marker : int
        Track of the result.
    last, first : int
        Last frame before and first frame after the occlusion.
    probability : float
        Probability of the join, against all other occluded markers, a new marker and a ghost.

    Examples
    --------
    >>> import asterism as am
    >>> truth = am.simulate.cube(frames=60, seed=1)
    >>> burst = am.simulate.Burst(n=2, shortest=10, longest=20)
    >>> corrupted = am.simulate.corrupt(truth, burst=burst, seed=1)
    >>> model = am.tracking.tracklet_model(am.estimate_model(corrupted.detections).model)
    >>> stitching = am.stitch(am.track(corrupted.detections, am.GNN(), model=model), model)
    >>> join = stitching.joins[0]
    >>> join.marker, join.last, join.first, join.probability > 0.9
    (3, 26, 43, True)
    """

    marker: int
    last: int
    first: int
    probability: float


@record(eq=False)
class Stitching:
    """Result of `stitch`.

    Parameters
    ----------
    tracks : Tracks
        Tracks of the markers: labels for the same detections, without filled ones.
    tracklets : ndarray of int, shape (N,)
        Tracklet of each detection, -1 for clutter.
    markers : ndarray of int, shape (F,)
        Track of each tracklet; -2 for a ghost, which is clutter in the result.
    after : ndarray of int, shape (F,)
        Preceding tracklet of each tracklet, -1 for the first of a marker.
    probabilities : ndarray of shape (F,)
        Probability of the decision about each tracklet.
    cuts : ndarray of int, shape (C, 2)
        Detections before and after each link of the input tracks that was cut because the
        neighbours contradict it.

    Examples
    --------
    >>> import asterism as am
    >>> truth = am.simulate.cube(frames=60, seed=1)
    >>> burst = am.simulate.Burst(n=2, shortest=10, longest=20)
    >>> corrupted = am.simulate.corrupt(truth, burst=burst, seed=1)
    >>> model = am.tracking.tracklet_model(am.estimate_model(corrupted.detections).model)
    >>> stitching = am.stitch(am.track(corrupted.detections, am.GNN(), model=model), model)
    >>> stitching.tracks.n_tracks, len(stitching.joins), len(stitching.ghosts)
    (8, 2, 0)
    >>> stitching.bonds
    Bonds(8 markers, 28 pairs, 28 rigid, 1 clusters)
    """

    tracks: Tracks
    tracklets: NDArray[np.int32]
    markers: NDArray[np.int32]
    after: NDArray[np.int32]
    probabilities: NDArray[np.float64]
    cuts: NDArray[np.int64]

    @property
    def ghosts(self) -> NDArray[np.int64]:
        """Tracklets that are ghosts."""
        return np.flatnonzero(self.markers == GHOST)

    @cached_property
    def extents(self) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
        """First and last detection of each tracklet, and their number, each of shape (F,)."""
        inside = np.flatnonzero(self.tracklets >= 0)
        own = self.tracklets[inside]
        first, last = np.zeros((2, len(self.markers)), dtype=np.int64)
        first[own[::-1]] = inside[::-1]  # the last assignment is of the first detection
        last[own] = inside
        return first, last, np.bincount(own, minlength=len(self.markers))

    @cached_property
    def joins(self) -> tuple[Join, ...]:
        """All joins, in order of time."""
        frame = self.tracks.detections.frame_of
        first, last = (frame[each] for each in self.extents[:2])
        found = np.flatnonzero((self.after >= 0) & (self.markers >= 0))
        order = found[np.lexsort((found, first[found]))]
        return tuple(
            Join(
                marker=int(self.markers[f]),
                last=int(last[self.after[f]]),
                first=int(first[f]),
                probability=float(self.probabilities[f]),
            )
            for f in order
        )

    @cached_property
    def bonds(self) -> Bonds:
        """Bonds and rigid clusters of the stitched markers."""
        return learn_bonds(self.tracks)

    def __repr__(self) -> str:
        return (
            f"Stitching({self.tracks.n_tracks} tracks, {len(self.joins)} joins, "
            f"{len(self.cuts)} cuts, {len(self.ghosts)} ghosts)"
        )


def stitch(
    tracks: Tracks,
    model: TrackingModel,
    *,
    confirm: int = 15,
    ghost_radius: float = 0.03,
    max_occlusion: int | None = None,
) -> Stitching:
    """Stitch tracklets into tracks of markers, through gaps of any length.

    A tracklet with `confirm` frames, or a terminated one, is compared with every occluded marker
    by two predictions. *Body*: neighbours at stable distances, detected before and now, are fitted
    rigidly and predict the occluded marker; the uncertainty follows from the residuals of the fit
    and from earlier predictions while the marker was detected. *Motion*: the filter of the model
    through the gap. The alternatives are a new marker and a ghost. Tracklets that are open at the
    same time compete for markers. Links inside a track that the neighbours contradict are cut
    first.

    Three passes go through the capture, forward, backward and forward again; the joins of each
    pass are prior information for the next. The ghosts of an input track are a marker if it has
    more than 60 detections of them and hardly any others. At the end two tracks are joined if
    they are in no frame together and keep the same distances to other tracks, bodies that left
    the view and came back are joined by the distances among their markers, and two tracks are
    exchanged where these distances show that they have each other's marker.

    Short pure tracklets give the best result: limit the model's gap by `tracklet_model`, as
    `track` does.

    Parameters
    ----------
    tracks : Tracks
        Tracklets from any method or from a file; filled points are left out.
    model : TrackingModel
        Model of motion and noise, with the longest gap within a tracklet.
    confirm : int
        Number of frames after which a tracklet is assigned to a marker, 2 to 100000. A shorter
        tracklet that continues no marker and is near a marker or among bodies is a ghost. Larger
        values use more evidence and delete more short tracklets.
    ghost_radius : float
        Typical distance of a ghost from its marker, metres, > 0. Larger values take more short
        tracklets near markers for ghosts.
    max_occlusion : int, optional
        Longest occlusion after which a marker can reappear under its old track, frames; unlimited
        by default.

    Returns
    -------
    Stitching
        Tracks of the markers, with the probability of every join.

    Raises
    ------
    ParameterError
        If an argument is out of range.

    Notes
    -----
    Rigid fits are weighted least squares [1]. The prediction error of a body has Student's t
    distribution with three degrees of freedom, whose scale follows from the residuals of the fit.

    References
    ----------
    1. Horn, Closed-form solution of absolute orientation using unit quaternions, 1987.

    Examples
    --------
    >>> import asterism as am
    >>> truth = am.simulate.cube(frames=60, seed=1)
    >>> burst = am.simulate.Burst(n=2, shortest=10, longest=20)
    >>> corrupted = am.simulate.corrupt(truth, burst=burst, seed=1)
    >>> model = am.tracking.tracklet_model(am.estimate_model(corrupted.detections).model)
    >>> tracklets = am.track(corrupted.detections, am.GNN(), model=model)
    >>> tracklets.n_tracks
    10
    >>> am.stitch(tracklets, model)
    Stitching(8 tracks, 2 joins, 0 cuts, 0 ghosts)
    """
    check_kind("tracks", tracks, Tracks, "am.track(detections)")
    check_kind("model", model, TrackingModel, "am.estimate_model(detections).model")
    check_options(confirm, ghost_radius, max_occlusion)
    tracks = tracks.measured()
    d = tracks.detections
    # Bonds found late in the capture help early in it, so each pass informs the next one in the
    # other direction. The last pass does not cut tracklets.
    limits = (model, confirm, ghost_radius, max_occlusion)
    options = stitch_options(*limits)
    found = go_through(d, tracks.labels, model, options)
    found = go_through(d, found.tracklets, model, options, before=found, backward=True)
    options = stitch_options(*limits, may_cut=False)
    found = go_through(d, found.tracklets, model, options, before=found)
    found = recovered_from_ghosts(found, tracks)
    found = joined_by_distances(d, found, model.sensor.noise_sigma, max_occlusion)
    found = exchanged_by_distances(d, found, model)
    tracklets, markers, after = found.tracklets, found.markers, found.after
    # The last element is the label of clutter.
    labels = np.append(np.maximum(markers, -1), -1).astype(np.int64)[tracklets]
    labels.flags.writeable = False  # no other object refers to it: no need to copy
    n_markers = int(markers.max(initial=-1)) + 1
    cuts = _cuts(tracks, tracklets, model.population.max_gap)
    n_joins = int(((after >= 0) & (markers >= 0)).sum())
    result = Tracks(
        detections=d,
        labels=labels,
        names=_names(tracks, tracklets, markers, n_markers),
        confidence=_confidence(tracks, tracklets, after, found.probabilities),
        info={
            # The model excludes gaps of that length, so the tracklets' posterior is not that of
            # the markers.
            **{name: value for name, value in tracks.info.items() if name != "log_posterior"},
            "joins": n_joins,
            "cuts": len(cuts),
            "ghosts": int((markers == GHOST).sum()),
        },
    )
    return Stitching(
        tracks=result, tracklets=tracklets, markers=markers, after=after,
        probabilities=found.probabilities, cuts=cuts,
    )  # fmt: skip


def check_options(confirm: int, ghost_radius: float, max_occlusion: int | None) -> None:
    """Raise `ParameterError` if an option of `stitch` is out of range.

    Parameters
    ----------
    confirm, ghost_radius, max_occlusion
        As for `stitch`.

    Examples
    --------
    >>> check_options(confirm=1, ghost_radius=0.03, max_occlusion=None)
    Traceback (most recent call last):
    ...
    asterism.errors.ParameterError: confirm: expected a whole number in [2, 100000], found 1
    """
    check_number("confirm", confirm, above=2, below=100_000, closed=True, integer=True)
    check_number("ghost_radius", ghost_radius, above=0, below=1e6)
    if max_occlusion is not None:
        check_number("max_occlusion", max_occlusion, above=1, below=1e9, closed=True, integer=True)


def stitch_options(
    model: TrackingModel,
    confirm: int,
    ghost_radius: float,
    max_occlusion: int | None,
    may_cut: bool = True,
) -> _engine.StitchOptions:
    """Return the options of `stitch` as an engine object.

    Parameters
    ----------
    model, confirm, ghost_radius, max_occlusion
        As for `stitch`.
    may_cut : bool
        Whether links that the neighbours contradict are cut.

    Returns
    -------
    StitchOptions

    Examples
    --------
    >>> import asterism as am
    >>> model = am.estimate_model(am.simulate.cube(frames=20, seed=1).detections).model
    >>> type(stitch_options(model, 15, 0.03, None)).__name__
    'StitchOptions'
    """
    return _engine.StitchOptions(
        noise=model.sensor.noise_sigma,
        ghost_radius=ghost_radius,
        confirm=confirm,
        max_gap=model.population.max_gap,
        max_occlusion=max_occlusion or 0,
        may_cut=may_cut,
    )


def _names(
    tracks: Tracks, tracklets: NDArray[np.int32], markers: NDArray[np.int32], n_markers: int
) -> tuple[str | None, ...]:
    """Return for each marker the first name of its tracklets that no other marker has."""
    names: list[str | None] = [None] * n_markers
    if any(tracks.names):
        track = np.full(len(markers), -1)
        inside = tracklets >= 0
        track[tracklets[inside]] = tracks.labels[inside]
        for tracklet in np.flatnonzero(markers >= 0):
            marker, name = markers[tracklet], tracks.names[track[tracklet]]
            if names[marker] is None and name not in names:
                names[marker] = name
    return tuple(names)


def _cuts(tracks: Tracks, tracklets: NDArray[np.int32], max_gap: int) -> NDArray[np.int64]:
    """Return the detections before and after each link that was cut, in order of time.

    Longer gaps end a tracklet without a contradiction.
    """
    order, _ = tracks.by_track
    order = order[tracklets[order] >= 0]
    before, after = order[:-1], order[1:]
    frame = tracks.detections.frame_of
    is_cut = (
        (tracks.labels[before] == tracks.labels[after])
        & (tracklets[before] != tracklets[after])
        & (frame[after] - frame[before] <= max_gap + 1)
    )
    cuts = np.stack([before[is_cut], after[is_cut]], axis=1)
    return cuts[np.argsort(cuts[:, 1], kind="stable")]


def _confidence(
    tracks: Tracks,
    tracklets: NDArray[np.int32],
    after: NDArray[np.int32],
    probabilities: NDArray[np.float64],
) -> NDArray[np.float64] | None:
    """Return the confidence, limited at the first detection of each join to its probability."""
    if tracks.confidence is None:
        return None
    confidence = tracks.confidence.copy()
    inside = np.flatnonzero(tracklets >= 0)
    _, at = np.unique(tracklets[inside], return_index=True)
    first = inside[at]
    joined = first[after[tracklets[first]] >= 0]
    confidence[joined] = np.minimum(confidence[joined], probabilities[tracklets[joined]])
    return confidence
