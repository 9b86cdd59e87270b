"""Names frame by frame, for streams."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from asterism.checks import check_kind
from asterism.errors import ParameterError
from asterism.model import Detections, MarkerSet, Tracks
from asterism.records import record
from asterism.tracking.methods import Method, TrackStates, Update
from asterism.tracking.naming.first_names import MIN_FOUND, MIN_LENGTH
from asterism.tracking.naming.live_names import LiveNames
from asterism.tracking.naming.name import name_tracks

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import ArrayLike, NDArray

    from asterism.model import TrackingModel
    from asterism.tracking.methods.base import MethodState

__all__ = ["Named", "NamedState"]

FIRST = 0.5
"""Time that the first names take as evidence, seconds."""
MIN_FRAMES = 10
"""Smallest number of frames for first names."""
MAX_WAIT = 8.0
"""Longest time until names are searched again after sets did not fit, seconds."""


@dataclass(frozen=True, eq=False)
class _Frame:
    first: int  # number of its first detection in order of arrival
    time: float
    points: NDArray[np.float64]
    labels: NDArray[np.int64]


@record(eq=False)
class NamedState:
    """State of `Named`: that of its method, and the names of the tracks.

    Parameters
    ----------
    tracks : MethodState
        State of the method that tracks.
    names : mapping of int to str
        Name of each named track, by its label.
    probabilities : mapping of int to float
        Probability of that name.

    Examples
    --------
    >>> import asterism as am
    >>> truth = am.simulate.fingers(frames=80, seed=1)
    >>> method = am.tracking.Named(marker_sets=am.learn_marker_set(truth), method=am.GNN())
    >>> state = method.init(am.estimate_model(truth.detections).model)
    >>> for time, points in truth.detections:
    ...     state, update = method.step(state, time, points)
    >>> state, state.names[update.labels[0]], update.names[:2]
    (NamedState(23 names), 'T1', ('T1', 'T2'))
    """

    tracks: MethodState
    names: Mapping[int, str] = field(default_factory=dict[int, str])
    probabilities: Mapping[int, float] = field(default_factory=dict[int, float])
    recent: tuple[_Frame, ...] = ()
    live: LiveNames | None = None
    next_search: float = float("-inf")
    wait: float = FIRST

    def __repr__(self) -> str:
        return f"NamedState({len(self.names)} names)"

    @property
    def n_seen(self) -> int:
        """Number of detections processed so far."""
        return self.tracks.n_seen

    @property
    def info(self) -> dict[str, float]:
        """Counts of the method, and the number of named tracks."""
        return {**self.tracks.info, "named": len(self.names)}


@record
class Named(Method[NamedState]):
    """Method for streams that names the tracks of another method by marker sets.

    It corresponds to `name_tracks` for a whole capture. The first names come after half a second,
    from any posture and movement; that step takes as long as naming a short capture. Each later
    frame examines one named track, and one that has no name: a track that clearly is another
    marker is renamed, and a marker that comes back as a new track gets its name again. When no
    named track is left, as after a long pause, the names are searched as at first.

    Parameters
    ----------
    marker_sets : MarkerSet or tuple of MarkerSet
        Marker set of the subject, or of each subject; their names must differ.
    method : Method
        Method that tracks, for example `Stitched`.

    Raises
    ------
    ParameterError
        If an argument has the wrong type, or there is no marker set.

    Examples
    --------
    >>> import asterism as am
    >>> made = am.learn_marker_set(am.simulate.fingers(seed=1))
    >>> am.tracking.Named(marker_sets=made, method=am.tracking.Stitched()).name
    'named'
    """

    name: ClassVar[str] = "named"

    marker_sets: MarkerSet | tuple[MarkerSet, ...]
    method: Method[Any]

    def __post_init__(self) -> None:
        check_kind("method", self.method, Method, "am.tracking.Stitched()")
        if not self._sets:
            raise ParameterError("marker_sets", "at least one marker set", "none")
        for made in self._sets:
            check_kind("marker_sets", made, MarkerSet, "am.learn_marker_set(tracks)")

    @property
    def _sets(self) -> tuple[MarkerSet, ...]:
        sets = self.marker_sets
        return (sets,) if isinstance(sets, MarkerSet) else tuple(sets)

    def begin(
        self,
        tracks: MethodState,
        names: Mapping[int, str],
        recent: Sequence[tuple[NDArray[np.float64], NDArray[np.int64]]],
    ) -> NamedState:
        """Return a state in which the tracks have names already, without a search for them.

        Parameters
        ----------
        tracks : MethodState
            State of the method that tracks.
        names : mapping of int to str
            Name of each named track, by its label; their probability is 1.
        recent : sequence of (points, labels)
            The last frames, by which the subjects are measured.

        Returns
        -------
        NamedState

        Examples
        --------
        >>> import asterism as am
        >>> truth = am.simulate.fingers(frames=60, seed=1)
        >>> method = am.tracking.Named(marker_sets=am.learn_marker_set(truth), method=am.GNN())
        >>> state = method.method.init(am.estimate_model(truth.detections).model)
        >>> d = truth.detections
        >>> recent = [(d.frame(t), truth.labels[d.offsets[t] : d.offsets[t + 1]]) for t in range(9)]
        >>> method.begin(state, dict(enumerate(truth.names)), recent)
        NamedState(23 names)
        """
        return NamedState(
            tracks=tracks,
            names=dict(names),
            probabilities=dict.fromkeys(names, 1.0),
            live=LiveNames.of(self._sets, names, recent),
        )

    def init(self, model: TrackingModel, *, n_axes: int = 3, seed: int | None = None) -> NamedState:
        """Return the state before the first frame.

        Parameters
        ----------
        model, n_axes, seed
            As for `Method.init`.

        Returns
        -------
        NamedState
        """
        return NamedState(tracks=self.method.init(model, n_axes=n_axes, seed=seed))

    def step(
        self,
        state: NamedState,
        time: float,
        points: ArrayLike,
        *,
        covariances: ArrayLike | None = None,
    ) -> tuple[NamedState, Update]:
        """Process the next frame.

        Parameters
        ----------
        state, time, points, covariances
            As for `Method.step`.

        Returns
        -------
        state, update
            Next state, and the labels and names of the points.
        """
        check_kind("state", state, NamedState, "method.init(model)")
        first = state.n_seen
        tracks, update = self.method.step(state.tracks, time, points, covariances=covariances)
        frame = _Frame(first, time, np.asarray(points, dtype=np.float64), update.labels)
        recent = (*_revised(state.recent, update), frame)
        while len(recent) > MIN_FRAMES and recent[0].time < time - FIRST:
            recent = recent[1:]
        after = NamedState(
            tracks=tracks, names=state.names, probabilities=state.probabilities, recent=recent,
            live=state.live, next_search=state.next_search, wait=state.wait,
        )  # fmt: skip
        if after.live is not None and _has_lost_all(after):
            after = replace(after, live=None, names={}, probabilities={})
        if after.live is not None:
            after = _followed(after, after.live)
        elif time >= state.next_search:
            after = self._searched(after)
        names = tuple(map(after.names.get, update.labels.tolist()))
        read = partial(_tracks_of, update, after)
        return after, replace(update, names=names, read_tracks=read)

    def prepare(self, state: NamedState) -> None:
        """Prepare the next step of the method; see `Method.prepare`."""
        self.method.prepare(state.tracks)

    def _searched(self, state: NamedState) -> NamedState:
        """Search for the first names as soon as there are enough frames and tracks."""
        recent, now = state.recent, state.recent[-1].time
        enough = MIN_FOUND * min(len(made) for made in self._sets)
        is_early = len(recent) < MIN_FRAMES or now - recent[0].time < 0.9 * FIRST
        if is_early or (recent[-1].labels >= 0).sum() < enough:
            return state
        given, labels = np.unique(np.concatenate([f.labels for f in recent]), return_inverse=True)
        labels = labels - int(given[0] < 0)
        times, frames = [frame.time for frame in recent], [frame.points for frame in recent]
        tracks = Tracks(detections=Detections.from_frames(times, frames), labels=labels)
        found = name_tracks(tracks, *self._sets)
        of_label = given[given >= 0]
        long = tracks.lengths >= MIN_LENGTH
        named = {
            int(of_label[k]): (name, float(p))
            for k, (name, p) in enumerate(zip(found.markers, found.probabilities, strict=True))
            if name is not None and long[k]
        }
        if not named:
            return replace(state, next_search=now + state.wait, wait=min(2 * state.wait, MAX_WAIT))
        names = {label: name for label, (name, _) in named.items()}
        live = LiveNames.of(self._sets, names, [(f.points, f.labels) for f in recent])
        return replace(
            state, live=live, names=names, probabilities={k: p for k, (_, p) in named.items()}
        )


def _followed(state: NamedState, live: LiveNames) -> NamedState:
    """Examine tracks in the last frames."""
    recent = [(f.points, f.labels) for f in state.recent[-live.LENGTH :]]
    live, changed = live.followed(recent)
    names, probabilities = state.names, state.probabilities
    if changed:
        names, probabilities = dict(names), dict(probabilities)
        for label, found in changed.items():
            names.pop(label, None)
            probabilities.pop(label, None)
            if found is not None:
                names[label], probabilities[label] = found
    return NamedState(
        tracks=state.tracks, names=names, probabilities=probabilities, recent=state.recent,
        live=live, next_search=state.next_search, wait=state.wait,
    )  # fmt: skip


def _has_lost_all(state: NamedState) -> bool:
    """Return whether the tracks of half a second are all without a name, as after a long pause.

    Tracks are examined beside named ones. Without any, all names are searched again.
    """
    recent = state.recent
    if len(recent) < MIN_FRAMES or recent[-1].time - recent[0].time < 0.9 * FIRST:
        return False
    if any(label in state.names for label in recent[-1].labels.tolist()):
        return False
    labels = {label for frame in recent for label in frame.labels.tolist()}
    return not labels & state.names.keys()


def _tracks_of(update: Update, state: NamedState) -> TrackStates | None:
    """Return the states of the tracks with their names."""
    if update.tracks is None:
        return None
    ids = update.tracks.ids.tolist()
    return replace(
        update.tracks,
        names=tuple(state.names.get(label) for label in ids),
        identity_confidence=np.array([state.probabilities.get(k, np.nan) for k in ids]),
    )


def _revised(recent: tuple[_Frame, ...], update: Update) -> tuple[_Frame, ...]:
    """Return the frames with the labels that an update revises."""
    if not len(update.revised) or not recent:
        return recent
    oldest, newest = int(update.revised.min()), int(update.revised.max())
    out = list(recent)
    for i, frame in enumerate(recent):
        if newest < frame.first or frame.first + len(frame.labels) <= oldest:
            continue
        own = update.revised - frame.first
        inside = (own >= 0) & (own < len(frame.labels))
        labels = frame.labels.copy()
        labels[own[inside]] = update.revised_labels[inside]
        out[i] = _Frame(frame.first, frame.time, frame.points, labels)
    return tuple(out)
