"""Fragments of tracks made into markers.

A marker that was hidden comes back as a stranger. Which it is, its neighbours know: bodies move
almost rigidly, so that those that keep their distance carry a hidden marker with them.
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
from asterism.tracking.stitching.passes import go_through

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Join", "Stitching", "check_options", "stitch", "stitch_options"]

GHOST = -2


@record
class Join:
    """Two fragments that are one marker.

    Parameters
    ----------
    marker : int
        The track of the result.
    last, first : int
        Frames in which it was seen last, and first again.
    probability : float
        That it is the same marker, against all others that were hidden, a new one and a ghost.
    """

    marker: int
    last: int
    first: int
    probability: float


@record(eq=False)
class Stitching:
    """What was made of fragments.

    Parameters
    ----------
    tracks : Tracks
        The markers: labels for the same detections, without those that were filled.
    fragments : ndarray of int, shape (N,)
        Fragment of each detection, -1 for clutter.
    markers : ndarray of int, shape (F,)
        Track of each fragment; -2 for a ghost, which is clutter now.
    after : ndarray of int, shape (F,)
        The fragment that each goes on with, -1 where a marker begins.
    probabilities : ndarray, shape (F,)
        Of what was decided of each fragment.
    n_cuts : int
        Links inside the tracks that came in which the neighbours contradict.
    """

    tracks: Tracks
    fragments: NDArray[np.int32]
    markers: NDArray[np.int32]
    after: NDArray[np.int32]
    probabilities: NDArray[np.float64]
    n_cuts: int

    @property
    def n_ghosts(self) -> int:
        """Fragments that were found to be no marker."""
        return int((self.markers == GHOST).sum())

    @cached_property
    def joins(self) -> tuple[Join, ...]:
        """Every join, in order of time."""
        frame = self.tracks.detections.frame_of
        inside = self.fragments >= 0
        n = len(self.markers)
        first = np.full(n, np.iinfo(np.int64).max)
        last = np.full(n, -1)
        np.minimum.at(first, self.fragments[inside], frame[inside])
        np.maximum.at(last, self.fragments[inside], frame[inside])
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
        """Which of the markers keep their distances, and rigid clusters of them."""
        return learn_bonds(self.tracks)

    def __repr__(self) -> str:
        return (
            f"Stitching({self.tracks.n_tracks} tracks, {len(self.joins)} joins, "
            f"{self.n_cuts} cuts, {self.n_ghosts} ghosts)"
        )


def stitch(
    tracks: Tracks,
    model: TrackingModel,
    *,
    confirm: int = 15,
    ghost_radius: float = 0.03,
    max_hidden: int | None = None,
) -> Stitching:
    """Make markers of fragments: tell which track goes on with which, through gaps of any length.

    A track that has been seen for `confirm` frames, or is over, is weighed against every marker
    that is hidden. Its *body*: neighbours that keep their distance, seen before and now, are
    fitted rigidly, and carry the hidden marker to where it must be now, as surely as they fit and
    as they did before while it could be seen. Its *motion*: the filter of the model through the
    gap. Against both stands that it is new, or a ghost beside a marker. Tracks that are open at
    the same time compete. Inside a track, a link that the neighbours contradict is cut first.

    The take is gone through forward, backward and forward again; what one pass finds advises the
    next.

    Short tracks are the better fragments: let the tracker give up early, as `identify` does.

    Parameters
    ----------
    tracks : Tracks
        Fragments, from any method or from a file; points that were filled are left out.
    model : TrackingModel
        Motion, noise, and the longest gap within a fragment.
    confirm : int
        Frames until it is decided what a fragment is. One that is over sooner, goes on with
        nothing, and is beside a marker or among bodies, is a ghost.
    ghost_radius : float
        Ghosts are about so far from their marker, metres.
    max_hidden : int, optional
        Frames after which a hidden marker is forgotten; never by default.

    Returns
    -------
    Stitching

    Raises
    ------
    ParameterError
        If an argument is out of range.

    Notes
    -----
    Rigid fits are weighted least squares [1]_. How far a body carries a marker wrongly is taken as
    Student's t with three degrees of freedom, whose scale is what the fit leaves.

    References
    ----------
    .. [1] Horn, Closed-form solution of absolute orientation using unit quaternions, 1987.

    Examples
    --------
    >>> import asterism as am
    >>> truth = am.simulate.person(seed=1)
    >>> hidden = am.simulate.corrupt(truth, burst=am.simulate.Burst(), seed=1)
    >>> model = am.tracking.tracklet_model(am.estimate_model(hidden.detections).model)
    >>> pieces = am.track(hidden.detections, am.GNN(), model=model)
    >>> am.stitch(pieces, model)  # doctest: +ELLIPSIS
    Stitching(... tracks, ... joins, ... cuts, ... ghosts)
    """
    check_kind("tracks", tracks, Tracks, "am.track(detections)")
    check_kind("model", model, TrackingModel, "am.estimate_model(detections).model")
    check_options(confirm, ghost_radius, max_hidden)
    tracks = tracks.measured()
    d = tracks.detections
    # What is learnt late helps early: each pass advises the next, in the other direction. The last
    # leaves the fragments as they are.
    limits = (model, confirm, ghost_radius, max_hidden)
    options = stitch_options(*limits)
    first = go_through(d, tracks.labels, model, options)
    back = go_through(d, first.fragments, model, options, before=first, backward=True)
    options = stitch_options(*limits, may_cut=False)
    found = go_through(d, back.fragments, model, options, before=back)
    fragments, markers, after = found.fragments, found.markers, found.after
    n_cuts = first.n_cuts + back.n_cuts
    labels = np.full(d.n_points, -1, dtype=np.int64)
    inside = fragments >= 0
    labels[inside] = np.maximum(markers[fragments[inside]], -1)
    n_markers = int(markers.max(initial=-1)) + 1
    n_joins = int(((after >= 0) & (markers >= 0)).sum())
    result = Tracks(
        detections=d,
        labels=labels,
        names=_names(tracks, fragments, markers, n_markers),
        confidence=_confidence(tracks, fragments, after, found.probabilities),
        info={
            # The model knows no gap so long: the fragments' posterior is not that of the markers.
            **{name: value for name, value in tracks.info.items() if name != "log_posterior"},
            "joins": n_joins,
            "cuts": n_cuts,
            "ghosts": int((markers == GHOST).sum()),
        },
    )
    return Stitching(
        tracks=result, fragments=fragments, markers=markers, after=after,
        probabilities=found.probabilities, n_cuts=n_cuts,
    )  # fmt: skip


def check_options(confirm: int, ghost_radius: float, max_hidden: int | None) -> None:
    """Raise `ParameterError` if an option of `stitch` is out of range."""
    check_number("confirm", confirm, above=2, below=100_000, closed=True, integer=True)
    check_number("ghost_radius", ghost_radius, above=0, below=1e6)
    if max_hidden is not None:
        check_number("max_hidden", max_hidden, above=1, below=1e9, closed=True, integer=True)


def stitch_options(
    model: TrackingModel,
    confirm: int,
    ghost_radius: float,
    max_hidden: int | None,
    may_cut: bool = True,
) -> _engine.StitchOptions:
    """Give the options of `stitch` as the engine takes them."""
    return _engine.StitchOptions(
        noise=model.sensor.noise_sigma,
        ghost_radius=ghost_radius,
        confirm=confirm,
        max_gap=model.population.max_gap,
        max_hidden=max_hidden or 0,
        may_cut=may_cut,
    )


def _names(
    tracks: Tracks, fragments: NDArray[np.int32], markers: NDArray[np.int32], n_markers: int
) -> tuple[str | None, ...]:
    """Give each marker the first name that any of its fragments has and no other marker."""
    names: list[str | None] = [None] * n_markers
    if any(tracks.names):
        track = np.full(len(markers), -1)
        inside = fragments >= 0
        track[fragments[inside]] = tracks.labels[inside]
        for fragment in np.flatnonzero(markers >= 0):
            marker, name = markers[fragment], tracks.names[track[fragment]]
            if names[marker] is None and name not in names:
                names[marker] = name
    return tuple(names)


def _confidence(
    tracks: Tracks,
    fragments: NDArray[np.int32],
    after: NDArray[np.int32],
    probabilities: NDArray[np.float64],
) -> NDArray[np.float64] | None:
    """Where the method has any, the first detection of a join is held no surer than the join."""
    if tracks.confidence is None:
        return None
    confidence = tracks.confidence.copy()
    inside = np.flatnonzero(fragments >= 0)
    _, at = np.unique(fragments[inside], return_index=True)
    first = inside[at]
    joined = first[after[fragments[first]] >= 0]
    confidence[joined] = np.minimum(confidence[joined], probabilities[fragments[joined]])
    return confidence
