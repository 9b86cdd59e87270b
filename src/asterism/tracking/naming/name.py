"""Names for the tracks of a capture, from a marker set."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from asterism.checks import check_kind
from asterism.errors import ParameterError
from asterism.model import MarkerSet, Tracks
from asterism.model.upwards import up_axis
from asterism.records import record
from asterism.tracking.naming.conflicts import KeptNames, codes_of, kept_names
from asterism.tracking.naming.exchanges import without_exchanges
from asterism.tracking.naming.first_names import (
    FIRST_FRAMES,
    MIN_LENGTH,
    First,
    first_names,
    first_own_names,
)
from asterism.tracking.naming.joining import joined
from asterism.tracking.naming.own_names import own_log_odds, own_marker_set, own_tracks
from asterism.tracking.naming.probabilities import marker_odds, probabilities_of, track_odds
from asterism.tracking.naming.search import search
from asterism.tracking.naming.stretches import NameChange, changes_of
from asterism.tracking.naming.windows import (
    WindowNames,
    Windows,
    most_of_each,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from asterism.model.upwards import Axis

__all__ = ["Naming", "name_tracks"]

MIN_DETECTIONS = 10
"""Smallest number of detections of a name in a capture, in tracks of `MIN_LENGTH` and more."""
MIN_SUBJECT = 0.75
"""Probability of a subject below which no name is given, because all of them could be another's."""
MIN_RIGHT = 0.55
"""Expected share of right names below which none is given: the set is of another protocol."""


@record(eq=False)
class Naming:
    """Result of `name_tracks`.

    Parameters
    ----------
    tracks : Tracks
        One track for each name, in the order of the marker sets, then the tracks without a name.
        Tracklets of one marker are one track; a track that changed marker is cut.
    markers : tuple of (str or None), length K
        Name of each input track in most of its frames, None without a name.
    probabilities : ndarray of shape (K,)
        Probability of that name; of no name where it is None.
    alternatives : tuple of (str or None), length K
        Most probable other name of each input track, None for no name.
    alternative_probabilities : ndarray of shape (K,)
        Probability of that alternative.
    changes : tuple of NameChange
        Stretches of frames in which an input track is on another marker than in most of its frames.
    missing : tuple of str
        Names of the sets that no track has.
    own : KeptNames, optional
        Names of the capture itself that are kept, moved or left out, and where they are
        contradicted; None with marker sets.

    Examples
    --------
    >>> import asterism as am
    >>> truth = am.simulate.fingers(frames=60, seed=1)
    >>> naming = am.name_tracks(truth, am.learn_marker_set(truth))
    >>> naming, naming.tracks.names[:3]
    (Naming(23 of 23 tracks), ('T1', 'T2', 'T3'))
    """

    tracks: Tracks
    markers: tuple[str | None, ...]
    probabilities: NDArray[np.float64]
    alternatives: tuple[str | None, ...]
    alternative_probabilities: NDArray[np.float64]
    changes: tuple[NameChange, ...]
    missing: tuple[str, ...]
    own: KeptNames | None = None

    @property
    def n_named(self) -> int:
        """Number of input tracks that have a name."""
        return sum(name is not None for name in self.markers)

    def __repr__(self) -> str:
        return f"Naming({self.n_named} of {len(self.markers)} tracks)"


@dataclass(frozen=True, eq=False, kw_only=True)
class _Named:
    """Names that one marker set gives to some of the tracks."""

    markers: NDArray[np.int64]  # (N,), of each detection, -1 for none
    of_track: NDArray[np.int64]  # (K,)
    probabilities: NDArray[np.float64]  # (K,)
    alternatives: NDArray[np.int64]  # (K,), -1 for none
    alternative_probabilities: NDArray[np.float64]  # (K,)
    is_given: NDArray[np.bool_]  # (K,), whether the name is more probable than none


def name_tracks(tracks: Tracks, *marker_sets: MarkerSet) -> Naming:
    """Name tracks by the marker sets of the subjects in the capture, or by its own names.

    The names that exist together most probably are searched for the tracks of one moment; all other
    tracks and moments follow from these. Names of the input are not used, unless there is no set.
    Then a set is learnt from them, and each is also evidence for the tracks that have it.

    Parameters
    ----------
    tracks : Tracks
        Tracks or tracklets, for example from `track`. Without a set the names are those of the
        tracks or, if they have none, those of their `Capture`.
    *marker_sets : MarkerSet
        One set for each subject in the capture. Names of several sets must differ, for example by
        the subject before a colon (`MarkerSet.of_subject`).

    Returns
    -------
    Naming
        Named tracks, with the probability of each name and its best alternative. A set that does
        not fit gives no name.

    Raises
    ------
    ParameterError
        If there is neither a set nor a name, an argument has the wrong type, or two sets have the
        same name.

    Notes
    -----
    Evidence: distances between tracks against those of the set (Student's t, four kinds of fit),
    and the side of three others on which a track lies, which tells left from right. The search is a
    local one from many starts, so that its result is not proved to be the best. Probabilities
    compare the result with the exchange of two names and with no name.

    Examples
    --------
    >>> import asterism as am
    >>> made = am.learn_marker_set(am.simulate.fingers(frames=60, seed=1))
    >>> later = am.simulate.fingers(frames=60, seed=2).detections
    >>> naming = am.name_tracks(am.track(later, am.GNN()), made)
    >>> naming, naming.tracks.names[:3]
    (Naming(23 of 23 tracks), ('T1', 'T2', 'T3'))
    """
    check_kind("tracks", tracks, Tracks, "am.track(detections)")
    if not marker_sets:
        return _by_own_names(tracks)
    all_names: list[str] = []
    for made in marker_sets:
        check_kind("marker_sets", made, MarkerSet, "am.learn_marker_set(tracks)")
        all_names += made.full_names
    twice = [name for name in all_names if all_names.count(name) > 1]
    if twice:
        hint = "give each set its subject: marker_set.of_subject(name)"
        raise ParameterError("marker_sets", "names that differ", f"{twice[0]} in two sets", hint)
    up, _ = up_axis(tracks.detections)
    whole = without_exchanges(joined(tracks))
    found = first_names(whole, marker_sets, up)
    named = [
        None if own is None else _all(_without(whole, own, found), made, own, up)
        for made, own in zip(marker_sets, found, strict=True)
    ]
    return _result(tracks, whole, marker_sets, named)


def _by_own_names(tracks: Tracks) -> Naming:
    """Name tracks by a set that is learnt from the names of the capture, and by these names."""
    own = own_tracks(tracks)
    if own is None:
        raise ParameterError("marker_sets", "a marker set, or a capture with names", "neither")
    made = own_marker_set(own)
    given = codes_of(own, own.names, made.names)
    up, _ = up_axis(tracks.detections)
    whole = without_exchanges(joined(tracks))
    labelled = own_log_odds(whole.labels, whole.n_tracks, given, len(made))
    first = first_own_names(whole, made, up, labelled)
    named = None if first is None else _all(whole, made, first, up, given)
    naming = _result(tracks, whole, (made,), [named])
    found = codes_of(naming.tracks, naming.tracks.names, made.names)
    probabilities = np.append(naming.probabilities, 1.0)[tracks.labels]
    return replace(naming, own=kept_names(own, given, found, probabilities, made.names))


def _without(tracks: Tracks, own: First, others: list[First | None]) -> Tracks:
    """Return the tracks with those of other bodies as clutter."""
    is_other = np.zeros(tracks.n_tracks + 1, dtype=bool)  # the last element is for clutter
    for other in others:
        if other is not None:
            is_other[other.tracks] = True
    is_other[own.tracks] = False
    return replace(tracks, labels=np.where(is_other[tracks.labels], -1, tracks.labels))


def _all(
    tracks: Tracks,
    made: MarkerSet,
    first: First,
    up: Axis,
    given: NDArray[np.int64] | None = None,
) -> _Named:
    """Name all tracks from the first names; the names of the whole capture are searched again.

    `given` is the marker of each detection by the names of the capture, (N,).
    """
    given = np.full(len(tracks.labels), -1) if given is None else given
    of_track = np.full(tracks.n_tracks, -1)
    of_track[first.tracks] = first.found.names
    refused = np.zeros((tracks.n_tracks, len(made)), dtype=bool)
    refused[first.tracks] = first.found.refused
    windows = Windows(tracks.detections, tracks.labels)
    names = WindowNames(
        windows=windows,
        made=made,
        size=first.found.size,
        is_kept=first.found.weights[0] > first.found.weights[1],
        track_markers=of_track,
        refused=refused,
        given=given,
    )
    start = windows.holding(first.frame)
    names.sweep(start)
    positions = names.positions(FIRST_FRAMES)
    seen = np.flatnonzero(np.isfinite(positions[..., 0]).sum(axis=0) >= MIN_LENGTH)
    labelled = own_log_odds(names.markers, len(made), given, len(made))[seen]
    found = search(made, positions[:, seen], up, start=seen, labelled=labelled)
    assert found is not None
    if not np.array_equal(found.names, seen):
        marker_of, refused = np.arange(len(made)), np.zeros((len(made), len(made)), dtype=bool)
        marker_of[seen], refused[seen] = found.names, found.refused
        names.renamed(marker_of, refused)
        names.sweep(start)
    odds = marker_odds(found, len(made))
    own = names.usual()
    probability, other, other_probability, none = probabilities_of(
        own,
        odds,
        track_odds(names.exchanges, names.counts),
        track_odds(names.without, names.counts),
    )
    is_given = (probability > none) & (first.probability >= MIN_SUBJECT)
    return _Named(
        markers=names.markers,
        of_track=own,
        probabilities=first.probability * probability,
        alternatives=other,
        alternative_probabilities=other_probability,
        is_given=is_given & are_probable(probability[is_given], tracks.lengths[is_given]),
    )


def are_probable(probabilities: NDArray[np.float64], lengths: NDArray[np.int64]) -> bool:
    """Return whether names are worth giving: most of their detections are probably right.

    Parameters
    ----------
    probabilities : ndarray of shape (n,)
        Probability of the name of each named track.
    lengths : ndarray of int, shape (n,)
        Number of detections of each.

    Examples
    --------
    >>> are_probable(np.array([0.4, 0.4, 0.9]), np.array([100, 100, 10]))
    False
    """
    total = int(lengths.sum())
    return total > 0 and float(probabilities @ lengths) >= MIN_RIGHT * total


def _result(
    tracks: Tracks, whole: Tracks, marker_sets: tuple[MarkerSet, ...], named: list[_Named | None]
) -> Naming:
    """Merge the names of all sets: for each track those of the set that is most certain.

    The names are those of the `whole` tracks, which may join or exchange the given ones.
    """
    K, N = whole.n_tracks, tracks.detections.n_points
    all_names = [name for made in marker_sets for name in made.full_names]
    markers, of_whole = np.full(N, -1), np.full(K, -1)
    probability, other_probability, other = np.zeros(K), np.zeros(K), np.full(K, -1)
    at = 0
    for made, own in zip(marker_sets, named, strict=True):
        if own is not None:
            better = own.is_given & (own.probabilities > probability)
            of_whole[better] = at + own.of_track[better]
            probability[better] = own.probabilities[better]
            other_probability[better] = own.alternative_probabilities[better]
            known = own.alternatives >= 0
            other[better] = np.where(known, at + own.alternatives, -1)[better]
            rows = np.flatnonzero(np.append(better, False)[whole.labels] & (own.markers >= 0))
            markers[rows] = at + own.markers[rows]
        at += len(made)
    n_given = np.bincount(markers[markers >= 0], minlength=len(all_names))
    is_long = np.append(whole.lengths >= MIN_LENGTH, False)[whole.labels] & (markers >= 0)
    n_long = np.bincount(markers[is_long], minlength=len(all_names))
    rare = n_long < MIN_DETECTIONS  # false alarms at the place of a marker that is not there
    markers[np.append(rare, False)[markers]] = -1
    of_whole[np.append(rare, False)[of_whole]] = -1
    n_given[rare] = 0
    is_none = of_whole < 0
    probability[is_none] = 1 - other_probability[is_none]
    kept = np.flatnonzero(n_given > 0)
    number = np.full(len(all_names), -1)
    number[kept] = np.arange(len(kept))
    rest = (markers < 0) & (whole.labels >= 0)
    unnamed, column = np.unique(whole.labels[rest], return_inverse=True)
    out = np.full(N, -1)
    out[markers >= 0] = number[markers[markers >= 0]]
    out[rest] = len(kept) + column
    holder = most_of_each(tracks.labels, whole.labels, tracks.n_tracks)
    of_track = most_of_each(tracks.labels, markers, tracks.n_tracks)
    names: list[str | None] = [*all_names, None]  # the last element is for none
    return Naming(
        tracks=replace(
            tracks, labels=out, names=(*(all_names[m] for m in kept), *[None] * len(unnamed))
        ),
        markers=tuple(names[m] for m in of_track),
        probabilities=probability[holder],
        alternatives=tuple(names[m] for m in other[holder]),
        alternative_probabilities=other_probability[holder],
        changes=changes_of(tracks, markers, of_track, all_names),
        missing=tuple(all_names[m] for m in np.flatnonzero(n_given == 0)),
    )
