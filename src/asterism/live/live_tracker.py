"""Tracking of a stream whose model is estimated while it runs."""

from __future__ import annotations

import logging
from collections import deque
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from asterism.errors import SolverLimit
from asterism.live.switchable import Switchable, SwitchableState, ids_by_votes
from asterism.model import Detections, Tracks
from asterism.tracking import Named, NamedState, learn_marker_set
from asterism.tracking.methods import Update

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from asterism.live.faults import Faults
    from asterism.live.intake import Accepted
    from asterism.model import MarkerSet, TrackingModel
    from asterism.tracking import Method

__all__ = ["LiveTracker"]

log = logging.getLogger(__name__)

LEARN_SECONDS = 5.0
"""Seconds of tracks from which a marker set is learnt."""
HISTORY = 10.0
"""Seconds of frames from which the model is refined, and which a refined model tracks first."""
FORGET_SECONDS = 60.0
"""Length of a pause after which no track continues; a marker set still finds the names."""
MIN_MARKERS = 4
"""Smallest number of markers of a learnt marker set."""
MAX_EMPTY = 130
"""Largest number of missing frames that are tracked as frames without points, as a recording has
them. By then every motion is too old to predict."""


class _Past:
    """A frame that was tracked, with the identities that were reported."""

    __slots__ = ("covariances", "labels", "points", "time")

    def __init__(
        self,
        time: float,
        points: NDArray[np.float64],
        covariances: NDArray[np.float64] | None,
        labels: NDArray[np.int64],
    ) -> None:
        self.time, self.points, self.covariances, self.labels = time, points, covariances, labels


class _Rehearsal:
    """A method with a new model that tracks the past frames, until it has reached the present."""

    def __init__(self, method: Method[Any], model: TrackingModel, seed: int | None) -> None:
        self.model = model
        self.method, self.state = method, method.init(model, seed=seed)
        self.labels: list[NDArray[np.int64]] = []
        self.n_done = 0  # of the frames of the history, as counted from its begin

    def step(self, past: _Past) -> None:
        labels = np.full(len(past.points), -1, dtype=np.int64)
        try:
            self.state, update = self.method.step(
                self.state, past.time, past.points, covariances=past.covariances
            )
            labels = update.labels
        except SolverLimit:  # as in the stream itself, the frame is left out
            pass
        self.labels.append(labels)
        self.n_done += 1


class LiveTracker:
    """Tracks of a stream, with a model that is given or arrives later, and may be replaced.

    Before the first model, all labels are -1. A new model first tracks the past `HISTORY` seconds,
    a frame at a time whenever there is nothing else to do (`rehearse`), and takes over between two
    frames. Its tracks keep the identities of the detections that both have.

    Parameters
    ----------
    method : Method
        Method that tracks.
    marker_sets : sequence of MarkerSet, or "learn"
        Marker sets that name the tracks; empty for none. A set that is learnt has the names M1,
        M2, … for the markers of the first `LEARN_SECONDS` seconds.
    model : TrackingModel, optional
        Model, if it is known.
    seed : int, optional
        Seed of the methods that draw random numbers.
    faults : Faults
        Receives the frames that cannot be tracked.
    """

    def __init__(
        self,
        method: Method[Any],
        marker_sets: Sequence[MarkerSet] | Literal["learn"],
        model: TrackingModel | None,
        seed: int | None,
        faults: Faults,
    ) -> None:
        self._method, self._seed, self._faults = method, seed, faults
        self._inner = Switchable(method=method)
        self._outer: Method[Any] = self._inner
        self._learns_names = marker_sets == "learn"
        if not isinstance(marker_sets, str) and marker_sets:
            self._outer = Named(marker_sets=tuple(marker_sets), method=self._inner)
        self.model = model
        self._state: Any = None if model is None else self._outer.init(model, seed=seed)
        self._before: Any = None  # is kept until there is time to free it
        self._refines = model is None
        self._history: deque[_Past] = deque()
        self._n_forgotten = 0
        self._rehearsal: _Rehearsal | None = None
        self.n_models = int(model is not None)
        self._last_time: float | None = None

    def step(self, accepted: Accepted, period: float) -> Update:
        """Track a frame.

        Parameters
        ----------
        accepted : Accepted
            The frame.
        period : float
            Time between two frames, seconds; nan if unknown.

        Returns
        -------
        Update
            Labels are identities.
        """
        frame = accepted.frame
        begin = self._last_time
        if begin is not None and frame.time - begin > FORGET_SECONDS:
            self._forget()
        elif begin is not None:
            for k in range(1, min(accepted.n_missing, MAX_EMPTY) + 1):
                self._take(begin + k * period, np.empty((0, frame.points.shape[1])), None)
        return self._take(frame.time, frame.points, frame.covariances)

    def _take(
        self,
        time: float,
        points: NDArray[np.float64],
        covariances: NDArray[np.float64] | None,
    ) -> Update:
        if self._state is None:
            update = _unlabelled(points)
        else:
            self._before = self._state
            try:
                self._state, update = self._outer.step(
                    self._state, time, points, covariances=covariances
                )
            except SolverLimit as error:
                self._faults.add("too_dense", f"a frame cannot be tracked ({error})")
                return _unlabelled(points)
        self._last_time = time
        if self._refines or self._learns_names:
            self._history.append(_Past(time, points, covariances, update.labels))
            # What a rehearsal still has to track is kept.
            n_needed = 0 if self._rehearsal is None else self._rehearsal.n_done
            while self._history[0].time < time - HISTORY and (
                self._rehearsal is None or self._n_forgotten < n_needed
            ):
                self._history.popleft()
                self._n_forgotten += 1
        return update

    def prepare(self) -> None:
        """Do what the next frame would have to wait for, and free the memory of the last one."""
        self._before = None
        if self._state is not None:
            self._outer.prepare(self._state)

    def _forget(self) -> None:
        """Begin without tracks; new ones get identities that were never used."""
        before = self._switchable_state()
        if before is None or self.model is None:
            return
        state = SwitchableState(
            inner=self._method.init(self.model, seed=self._seed),
            ids=np.empty(0, dtype=np.int64), next_id=before.next_id, n_before=before.n_seen,
        )  # fmt: skip
        self._state = NamedState(tracks=state) if isinstance(self._state, NamedState) else state

    def recent(self) -> Detections:
        """Return the frames of the last seconds."""
        times = [past.time for past in self._history]
        made = Detections.from_frames(times, [past.points for past in self._history])
        noise = [past.covariances for past in self._history if past.covariances is not None]
        if len(noise) < len(times) or not noise:
            return made
        return replace(made, covariances=np.concatenate(noise))

    def replace_model(self, model: TrackingModel) -> None:
        """Begin to track with another model."""
        self._rehearsal = _Rehearsal(self._method, model, self._seed)
        self._rehearsal.n_done = self._n_forgotten

    def rehearse(self) -> bool:
        """Track one past frame with the new model; return whether there is more to do."""
        rehearsal = self._rehearsal
        if rehearsal is None:
            return False
        at = rehearsal.n_done - self._n_forgotten
        if at < len(self._history):
            rehearsal.step(self._history[at])
            return True
        self._switch(rehearsal)
        return False

    def learn_names(self) -> bool:
        """Learn a marker set when that is wanted and there are enough frames; return whether."""
        history, state = self._history, self._state
        if not self._learns_names or self._rehearsal is not None or state is None or not history:
            return False
        last = history[-1].time
        recent = [p for p in history if p.time > last - LEARN_SECONDS]
        # Before the first model no frame has labels.
        if last - recent[0].time < 0.95 * LEARN_SECONDS or not (recent[0].labels >= 0).any():
            return False
        labels = np.concatenate([past.labels for past in recent])
        ids, counts = np.unique(labels[labels >= 0], return_counts=True)
        ids = ids[2 * counts > len(recent)]
        if len(ids) < MIN_MARKERS:
            return False
        names = {int(identity): f"M{n}" for n, identity in enumerate(ids, 1)}
        place = np.searchsorted(ids, labels).clip(max=len(ids) - 1)
        made = Detections.from_frames([p.time for p in recent], [p.points for p in recent])
        learnt = learn_marker_set(
            Tracks(
                detections=made,
                labels=np.where(ids[place] == labels, place, -1),
                names=tuple(names.values()),
            )
        )
        self._outer = outer = Named(marker_sets=learnt, method=self._inner)
        self._state = outer.begin(state, names, [(p.points, p.labels) for p in recent])
        self._learns_names = False
        if not self._refines:
            history.clear()
        return True

    def _switch(self, rehearsal: _Rehearsal) -> None:
        """Let the new model take over."""
        n = len(self._history)
        labels = np.concatenate([*rehearsal.labels[-n:], np.empty(0, dtype=np.int64)])
        old = np.concatenate([past.labels for past in self._history] or [labels])
        before = self._switchable_state()
        ids, next_id = None, int(labels.max(initial=-1)) + 1
        if before is not None:
            ids, next_id = ids_by_votes(labels, old, before.next_id)
        n_seen = 0 if before is None else before.n_seen
        state = SwitchableState(
            inner=rehearsal.state, ids=ids, next_id=next_id,
            n_before=n_seen - rehearsal.state.n_seen if before is not None else 0,
        )  # fmt: skip
        if isinstance(self._outer, Switchable):
            self._state = state
        elif self._state is None:
            self._state = NamedState(tracks=state)
        else:
            self._state = replace(self._state, tracks=state)
        self._rehearsal, self.model = None, rehearsal.model
        self.n_models += 1

    def _switchable_state(self) -> SwitchableState | None:
        state = self._state.tracks if isinstance(self._state, NamedState) else self._state
        assert state is None or isinstance(state, SwitchableState)
        return state

    @property
    def n_names(self) -> int:
        """Number of named tracks."""
        return len(self._state.names) if isinstance(self._state, NamedState) else 0


def _unlabelled(points: NDArray[np.float64]) -> Update:
    return Update(labels=np.full(len(points), -1, dtype=np.int64))
