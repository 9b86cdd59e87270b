"""Tracks: a partition of detections, stored as one integer label for each detection.

Every method returns a `Tracks`, and ground truth is a `Tracks` too. It refers to its detections
and holds no copy of the points.
"""

from __future__ import annotations

from dataclasses import field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from asterism.checks import check_kind, keep_array
from asterism.errors import ParameterError
from asterism.model.detections import Detections
from asterism.model.gap import Gap, gaps_of
from asterism.model.labels import check_labels
from asterism.model.tables import data_array, data_frame, html_table
from asterism.records import record

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from numpy.typing import ArrayLike, NDArray

    from asterism.model.decision import Decision
    from asterism.model.recipe import Recipe

__all__ = ["Tracks"]


@record(eq=False)
class Tracks:
    """A partition of detections into tracks and clutter.

    Parameters
    ----------
    detections : Detections
        The N detections.
    labels : array_like of int, shape (N,)
        Track of each detection, 0 … K - 1, or -1 for clutter. A track has at most one detection
        in a frame.
    names : sequence of (str or None), optional
        Marker name of each of the K tracks, None if it is unknown. Without names K is the largest
        label + 1.
    confidence : array_like of shape (N,), optional
        Probability in [0, 1] that the link which leads to each detection is right. For clutter, the
        probability that it is clutter if the method states one, otherwise 0.
    identity_confidence : array_like of shape (N,), optional
        Probability in [0, 1] that each detection is of the marker that holds most of its track, 0
        for clutter.
    decisions : tuple of Decision
        What the tracking decided, with probabilities and alternatives.
    info : mapping, optional
        Numbers reported by the method: sizes of approximations, counts and running time.
    recipe : Recipe, optional
        Settings with which `track` repeats the result.

    Raises
    ------
    ParameterError
        If the arrays do not fit each other, or a track has two detections in one frame.

    Examples
    --------
    >>> d = Detections.from_frames([0, 1], [[[0, 0, 0], [1, 0, 0]], [[1, 0, 0], [0, 0, 0]]])
    >>> tracks = Tracks(detections=d, labels=[0, 1, 1, 0], names=("LASI", None))
    >>> tracks.positions()[1]
    array([[0., 0., 0.],
           [1., 0., 0.]])
    >>> tracks.n_tracks, tracks.display_names, tracks.lengths, tracks.by_track[0]
    (2, ('LASI', 'track 1'), array([2, 2]), array([0, 3, 1, 2]))
    """

    detections: Detections
    labels: NDArray[np.int64]
    names: tuple[str | None, ...] = ()
    confidence: NDArray[np.float64] | None = None
    identity_confidence: NDArray[np.float64] | None = None
    decisions: tuple[Decision, ...] = ()
    info: Mapping[str, float] = field(default_factory=dict[str, float])
    recipe: Recipe | None = None

    def __post_init__(self) -> None:
        check_kind(
            "detections", self.detections, Detections, "am.Detections.from_frames, or am.read"
        )
        n = self.detections.n_points
        labels = keep_array("labels", self.labels, (n,), dtype=np.int64)
        n_tracks = check_labels(labels, self.detections.offsets)
        names = tuple(self.names)
        if names and len(names) < n_tracks:
            raise ParameterError("names", f"a name or None for each of {n_tracks} tracks", names)
        names += (None,) * (n_tracks - len(names))
        object.__setattr__(self, "names", names)
        object.__setattr__(self, "labels", labels)
        for name in ("confidence", "identity_confidence"):
            object.__setattr__(self, name, _probabilities(name, getattr(self, name), n))

    @classmethod
    def from_dense(
        cls, times: ArrayLike, positions: ArrayLike, names: Sequence[str | None] = ()
    ) -> Self:
        """Make tracks, for example a ground truth, from an array of positions by frame and marker.

        Parameters
        ----------
        times : array_like of shape (T,)
            Seconds.
        positions : array_like of shape (T, K, D)
            Metres; NaN where a marker was not detected.
        names : sequence of str, optional
            Names of the K markers; without them the tracks have no names.

        Returns
        -------
        Tracks

        Examples
        --------
        >>> import asterism as am
        >>> am.Tracks.from_dense([0, 0.01], [[[0, 0, 1]], [[0, 0, 2]]], ["LKNE"])
        Tracks(1 tracks, 2 detections in them, 0 clutter, 2 frames)
        """
        detections = Detections.from_dense(times, positions)
        n_frames, n_markers = np.shape(positions)[:2]
        if detections.n_points == n_frames * n_markers:
            labels = np.tile(np.arange(n_markers, dtype=np.int64), n_frames)
        else:
            is_seen = np.isfinite(np.asarray(positions, dtype=np.float64)).all(axis=2)
            labels = np.broadcast_to(np.arange(n_markers), is_seen.shape)[is_seen]
        labels.flags.writeable = False  # no other object refers to it: no need to copy
        own = tuple(names) if names else (None,) * n_markers
        return cls(detections=detections, labels=labels, names=own)

    def __len__(self) -> int:
        """Return the number of tracks."""
        return self.n_tracks

    def __iter__(self) -> Iterator[NDArray[np.float64]]:
        """Iterate over the positions of each track, each of shape (T, D)."""
        return (self[k] for k in range(self.n_tracks))

    def __getitem__(self, track: int | str) -> NDArray[np.float64]:
        """Return the positions of one track, shape (T, D), metres, NaN where it has no detection.

        Parameters
        ----------
        track : int or str
            Number of the track, counted from the end if negative, or its name.

        Raises
        ------
        IndexError, KeyError
            If there is no track of that number or name.

        Examples
        --------
        >>> import asterism as am
        >>> tracks = am.Tracks.from_dense([0, 0.01], [[[0, 0, 1]], [[0, 0, 2]]], ["LKNE"])
        >>> tracks["LKNE"]
        array([[0., 0., 1.],
               [0., 0., 2.]])
        """
        own = self.labels == self._number(track)
        positions = np.full((self.detections.n_frames, self.detections.n_axes), np.nan)
        positions[self.detections.frame_of[own]] = self.detections.points[own]
        return positions

    def _number(self, track: int | str) -> int:
        if not isinstance(track, str):
            return range(self.n_tracks)[track]
        if track not in self.names:
            raise KeyError(f"no track named {track!r}: {', '.join(self.display_names)}")
        return self.names.index(track)

    @property
    def display_names(self) -> tuple[str, ...]:
        """Name of each track: its marker name, or ``track k`` without one."""
        return tuple(name or f"track {k}" for k, name in enumerate(self.names))

    def gaps(self) -> tuple[Gap, ...]:
        """Return the gaps of all tracks, ordered by track and then by time.

        Examples
        --------
        >>> import asterism as am
        >>> at = [[[0, 0, 0]], [[np.nan] * 3], [[0, 0, 0]]]
        >>> am.Tracks.from_dense([0, 0.01, 0.02], at).gaps()
        (Gap(track=0, first=1, last=1, seconds=0.02),)
        """
        order, _ = self.by_track
        d = self.detections
        return gaps_of(self.labels[order], d.frame_of[order], d.times)

    def to_pandas(self) -> Any:
        """Return a pandas ``DataFrame`` with one row a detection (extra ``asterism[tables]``).

        Columns are ``frame``, ``time_s``, ``track`` (-1 for clutter), ``name``, ``x_m``, ``y_m``,
        ``z_m`` and, where they are known, ``confidence`` and ``identity_confidence``.

        Raises
        ------
        ParameterError
            If pandas is not installed.

        Examples
        --------
        >>> import asterism as am
        >>> tracks = am.Tracks.from_dense([0, 0.01], [[[0, 0, 1]], [[0, 0, 2]]], ["LKNE"])
        >>> list(tracks.to_pandas().columns)
        ['frame', 'time_s', 'track', 'name', 'x_m', 'y_m', 'z_m']
        """
        everything = self._confidences(slice(None))
        return data_frame(self.detections, self.labels, self.display_names, everything)

    def to_xarray(self) -> Any:
        """Return an xarray ``DataArray`` of time, marker and axis (extra ``asterism[tables]``).

        Positions are metres, NaN where a track has no detection.

        Raises
        ------
        ParameterError
            If xarray is not installed.

        Examples
        --------
        >>> import asterism as am
        >>> tracks = am.Tracks.from_dense([0, 0.01], [[[0, 0, 1]], [[0, 0, 2]]], ["LKNE"])
        >>> tracks.to_xarray().dims
        ('time', 'marker', 'axis')
        """
        return data_array(self.detections.times, self.positions(), self.display_names)

    def measured(self) -> Self:
        """Return the tracks without filled detections; the object itself if there are none.

        Examples
        --------
        >>> import asterism as am
        >>> truth = am.simulate.cube(frames=20, seed=1)
        >>> truth.measured() is truth
        True
        """
        d = self.detections.measured()
        if d is self.detections or self.detections.filled is None:
            return self
        kept = ~self.detections.filled
        return replace(self, detections=d, labels=self.labels[kept], **self._confidences(kept))

    def _confidences(self, which: Any) -> dict[str, Any]:
        """Return both confidences of some detections, by the name of the field."""
        return {
            "confidence": None if self.confidence is None else self.confidence[which],
            "identity_confidence": (
                None if self.identity_confidence is None else self.identity_confidence[which]
            ),
        }

    def part(self, first: int, end: int) -> Tracks:
        """Return the tracks in the frames from `first` up to but without `end`.

        Parameters
        ----------
        first, end : int
            First frame, and the frame after the last.

        Returns
        -------
        Tracks
            All tracks keep their numbers and names; decisions, info and recipe are left out.

        Examples
        --------
        >>> import asterism as am
        >>> am.simulate.cube(frames=20, seed=1).part(5, 10).positions().shape[0]
        5
        """
        d = self.detections
        own = slice(d.offsets[first], d.offsets[end])
        labels, part = self.labels[own], d.part(first, end)
        return Tracks(detections=part, labels=labels, names=self.names, **self._confidences(own))

    def select(self, tracks: Sequence[int | str]) -> Tracks:
        """Return some of the tracks, in the order given, without other tracks and clutter.

        Parameters
        ----------
        tracks : sequence of int or str
            Numbers or names, each once.

        Returns
        -------
        Tracks
            Decisions, info and recipe, which are of the whole, are left out.

        Raises
        ------
        IndexError, KeyError
            If there is no track of a number or name.

        Examples
        --------
        >>> import asterism as am
        >>> tracks = am.Tracks.from_dense([0], [[[0, 0, 1], [0, 0, 2]]], ["LKNE", "RKNE"])
        >>> tracks.select(["RKNE"]).names
        ('RKNE',)
        """
        chosen = [self._number(track) for track in tracks]
        label_of = np.full(self.n_tracks + 1, -1)  # the last is of clutter
        label_of[chosen] = np.arange(len(chosen))
        labels = label_of[self.labels]
        kept = labels >= 0
        names = tuple(self.names[k] for k in chosen)
        d = self.detections.keep(kept)
        return Tracks(detections=d, labels=labels[kept], names=names, **self._confidences(kept))

    @property
    def n_tracks(self) -> int:
        """Number of tracks K, including tracks without a detection."""
        return len(self.names)

    @cached_property
    def lengths(self) -> NDArray[np.int64]:
        """Number of detections of each track, shape (K,)."""
        return np.bincount(self.labels[self.labels >= 0], minlength=self.n_tracks)

    @cached_property
    def by_track(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Detections grouped by track, in time order.

        Returns
        -------
        order : ndarray of int, shape (M,)
            Indices of the M detections that are in tracks.
        offsets : ndarray of int, shape (K + 1,)
            Track ``k`` holds ``order[offsets[k]:offsets[k + 1]]``.
        """
        members = np.flatnonzero(self.labels >= 0)
        labels = self.labels[members]
        if self.n_tracks <= np.iinfo(np.uint16).max:  # NumPy sorts 16 bits in linear time
            labels = labels.astype(np.uint16)
        order = members[np.argsort(labels, kind="stable")]
        return order, np.concatenate([[0], np.cumsum(self.lengths)]).astype(np.int64)

    def positions(self) -> NDArray[np.float64]:
        """Return positions by frame and track, shape (T, K, D), metres, NaN without a detection.

        Examples
        --------
        >>> import asterism as am
        >>> am.Tracks.from_dense([0, 0.01], [[[0, 0, 1]], [[0, 0, 2]]], ["LKNE"]).positions().shape
        (2, 1, 3)
        """
        d = self.detections
        dense = np.full((d.n_frames, self.n_tracks, d.n_axes), np.nan)
        is_track = self.labels >= 0
        dense[d.frame_of[is_track], self.labels[is_track]] = d.points[is_track]
        return dense

    def _repr_html_(self) -> str:
        """Return an HTML table for notebooks, with one row of figures for each track."""
        order, offsets = self.by_track
        frames = self.detections.frame_of[order]
        return html_table(repr(self), self.display_names, frames, offsets, self.gaps())

    def __repr__(self) -> str:
        n_clutter = int((self.labels < 0).sum())
        return (
            f"{type(self).__name__}({self.n_tracks} tracks, {len(self.labels) - n_clutter} "
            f"detections in them, {n_clutter} clutter, {self.detections.n_frames} frames)"
        )


def _probabilities(name: str, values: ArrayLike | None, n: int) -> NDArray[np.float64] | None:
    if values is None:
        return None
    array = keep_array(name, values, (n,))
    if array.size and (array.min() < 0 or array.max() > 1):
        worst = array[np.argmax(np.abs(array - 0.5))]
        raise ParameterError(name, "probabilities in [0, 1]", worst)
    return array
