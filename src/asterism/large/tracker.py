"""Tracking of large scenes frame by frame: exact assignment in tiles, starts over several frames.

The life cycle of a track is that of the other methods: log odds of marker against clutter,
confirmation, deletion. Two things differ. Confirmed and tentative tracks are assigned together. A
track starts with a chain of detections through four frames instead of one detection, because in a
dense scene the nearest detection of the next frame is often another marker's.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from asterism.checks import check_kind, check_number
from asterism.errors import ParameterError
from asterism.large.assignment import Frames, assign
from asterism.large.state import DecidedFrame, LargeState, OpenFrame
from asterism.large.tiles import tile_side
from asterism.large.tracks import LiveTracks
from asterism.model import TrackingModel
from asterism.records import record
from asterism.tracking.methods.base import checked_frame
from asterism.tracking.methods.options import Gate, Lifecycle

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from asterism.large.assignment import Mapper

__all__ = ["LAG", "LOOK_AHEAD", "START_FRAMES", "LargeTracker"]

START_FRAMES = 4
"""Frames through which a new track is sought. It has a detection in at least three of them."""
LAG = 8
"""Frames after which a frame is decided. Until then a tentative track can be confirmed."""
LOOK_AHEAD = 1
"""Later frames that are seen before a frame is assigned."""
_START_GATE = 1e-4  # probability that a link of a true chain lies outside its gate
_MAX_CHAINS = 16  # that begin at one detection
_FREE = -1  # owner of a detection that no track has; -2 - key is a tentative track


@record
class LargeTracker:
    """Tracker for up to millions of detections in a frame.

    In each frame the exact assignment of the largest total gain is computed, in spatial tiles whose
    groups are joined across the seams. The labels are the same to the last bit for every tiling,
    number of threads and executor.

    Parameters
    ----------
    model : TrackingModel
        Model of motion, sensor and population.
    n_axes : int
        Number of coordinates, 2 or 3.
    tile : float, optional
        Side of a tile, metres, > 0. Without it a tile has 25 000 detections. It does not change
        the result.
    threads : int
        Threads of the prediction, the update and the starts, ≥ 1. The tiles run through the
        `mapper` of `step`.
    look_ahead : int
        Later frames that are seen before a frame is assigned, 0 to 4. Larger values resolve more
        crossings and need more time.
    gate : Gate
        Gate, the region in which a track can be assigned a detection.
    lifecycle : Lifecycle
        Confirmation and deletion of tentative tracks.

    Raises
    ------
    ParameterError
        If an option is out of range.

    Examples
    --------
    >>> import asterism as am
    >>> d = am.simulate.cube(frames=40, seed=1).detections
    >>> tracker = LargeTracker(model=am.estimate_model(d).model)
    >>> state, labels = tracker.init(), []
    >>> for time, points in d:
    ...     state, decided = tracker.step(state, time, points)
    ...     labels += [frame.labels for frame in decided]
    >>> state, decided = tracker.finish(state)
    >>> labels += [frame.labels for frame in decided]
    >>> len(labels), labels[0].tolist()
    (40, [0, 1, 2, 3, 4, 5, 6, 7])
    """

    model: TrackingModel
    n_axes: int = 3
    tile: float | None = None
    threads: int = 1
    look_ahead: int = LOOK_AHEAD
    gate: Gate = Gate()
    lifecycle: Lifecycle = Lifecycle()

    def __post_init__(self) -> None:
        check_kind("model", self.model, TrackingModel, "am.estimate_model(detections).model")
        if self.n_axes not in (2, 3):
            raise ParameterError("n_axes", "2 or 3", repr(self.n_axes))
        if self.tile is not None and self.tile != math.inf:
            check_number("tile", self.tile, above=0)
        check_number("threads", self.threads, above=1, below=1024, closed=True, integer=True)
        check_number("look_ahead", self.look_ahead, above=0, below=4, closed=True, integer=True)
        check_kind("gate", self.gate, Gate, "am.tracking.Gate()")
        check_kind("lifecycle", self.lifecycle, Lifecycle, "am.tracking.Lifecycle()")

    def init(self) -> LargeState:
        """Return the state before the first frame."""
        from asterism import _engine
        from asterism.model.compiled import motion_model

        width = _engine.packed_width(motion_model(self.model, self.n_axes))
        return LargeState(tracks=LiveTracks.none(n_axes=self.n_axes, width=width))

    def step(
        self,
        state: LargeState,
        time: float,
        points: NDArray[np.float64],
        *,
        mapper: Mapper | Any = map,
    ) -> tuple[LargeState, list[DecidedFrame]]:
        """Process the next frame.

        Parameters
        ----------
        state : LargeState
            State after the frame before; it is left unchanged.
        time : float
            Time, seconds, later than that of the frame before.
        points : ndarray of shape (N, D)
            Detections, metres; N may be 0.
        mapper : callable
            Called as ``mapper(function, tasks)`` with a picklable function and picklable tasks, one
            for each tile; returns the results in the same order. `map`, the `map` of a
            `concurrent.futures` executor, or a function around Dask's ``client.map``.

        Returns
        -------
        state : LargeState
            State after the frame.
        decided : list of DecidedFrame
            Frames that are decided now.

        Raises
        ------
        ParameterError
            If the time does not increase or a coordinate is not finite.
        SolverLimit
            If the gates contain too many detections.
        """
        from asterism.model.compiled import no_transition, transition

        before = state.frames[-1].time if state.frames else -math.inf
        points = np.ascontiguousarray(checked_frame(time, before, points, self.n_axes))
        motion = self.model.motion
        dt = time - before
        F, Q = transition(motion, dt) if state.frames else no_transition(motion)
        frame = OpenFrame(
            number=state.n_frames, time=float(time), F=F, Q=Q, points=points,
            owners=np.full(len(points), _FREE, np.int64),
        )  # fmt: skip
        state = replace(
            state, frames=(*state.frames, frame), n_frames=state.n_frames + 1,
            n_ahead=state.n_ahead + 1,
        )  # fmt: skip
        if state.n_ahead > self.look_ahead:
            state = self._advanced(state, mapper)
        decided: list[DecidedFrame] = []
        if len(state.frames) - state.n_ahead > LAG:
            decided = [_decided(state.frames[0])]
            state = replace(state, frames=state.frames[1:])
        return state, decided

    def finish(
        self, state: LargeState, *, mapper: Mapper | Any = map
    ) -> tuple[LargeState, list[DecidedFrame]]:
        """Decide all remaining frames.

        Parameters
        ----------
        state : LargeState
            State after the last frame; it is left unchanged.
        mapper : callable
            As for `step`.

        Returns
        -------
        state : LargeState
            State at the end, without undecided frames.
        decided : list of DecidedFrame
            Remaining frames in order.
        """
        while state.n_ahead:
            state = self._advanced(state, mapper)
        state = self._confirmed(self._started(state, START_FRAMES - 1))
        return replace(state, frames=()), [_decided(frame) for frame in state.frames]

    def _advanced(self, state: LargeState, mapper: Any) -> LargeState:
        """Assign the oldest frame that is not yet assigned, and update the life cycles."""
        state = self._confirmed(self._assigned(state, mapper))
        return self._confirmed(self._started(self._ended(state), START_FRAMES))

    def _assigned(self, state: LargeState, mapper: Any) -> LargeState:
        """Predict all tracks, assign the detections of a frame and update."""
        from asterism import _engine
        from asterism.model.compiled import motion_model, score_model

        tracks, ahead = state.tracks, state.frames[len(state.frames) - state.n_ahead :]
        frames = Frames(
            times=np.array([f.time for f in ahead]), F=np.stack([f.F for f in ahead]),
            Q=np.stack([f.Q for f in ahead]), points=tuple(f.points for f in ahead),
        )  # fmt: skip
        frame = replace(ahead[0], owners=ahead[0].owners.copy())
        points = frame.points
        motion, score = motion_model(self.model, self.n_axes), score_model(self.model)
        gate = _chi2(self.n_axes, self.gate.probability)
        states, regions = _engine.predict_tracks(
            motion, gate=gate, F=frames.F, Q=frames.Q, states=tracks.states,
            n_threads=self.threads,
        )  # fmt: skip
        found = assign(
            tracks, states, regions, frames, model=self.model, gate=gate, mapper=mapper,
            side=tile_side(points) if self.tile is None else self.tile,
        )  # fmt: skip
        states, scores = _engine.update_tracks(
            motion, score, states=states, scores=tracks.scores, gaps=tracks.gaps,
            match=found.match, points=points, n_threads=self.threads,
        )  # fmt: skip
        has = found.match >= 0
        own = found.match[has]
        frame.owners[own] = np.where(tracks.is_confirmed, tracks.ids, -2 - tracks.keys)[has]
        last, last_times = tracks.last.copy(), tracks.last_times.copy()
        last[has], last_times[has] = points[own], frame.time
        tracks = replace(
            tracks, states=states, scores=scores, last=last, last_times=last_times,
            best_scores=np.maximum(tracks.best_scores, scores),
            gaps=np.where(has, 0, tracks.gaps + 1).astype(np.int32),
        )  # fmt: skip
        done = len(state.frames) - state.n_ahead
        together = (*state.frames[:done], frame, *state.frames[done + 1 :])
        return replace(state, tracks=tracks, frames=together, n_ahead=state.n_ahead - 1, last=found)

    def _confirmed(self, state: LargeState) -> LargeState:
        """Confirm the tentative tracks whose odds are high enough."""
        tracks, p = state.tracks, self.lifecycle.confirm_probability
        new = ~tracks.is_confirmed & (tracks.scores >= math.log(p / (1 - p)))
        if not new.any():
            return state
        ids = tracks.ids.copy()
        ids[new] = state.n_ids + np.arange(new.sum())
        frames = _renamed(state.frames, tracks.keys[new], ids[new])
        n_ids = state.n_ids + int(new.sum())
        return replace(state, tracks=replace(tracks, ids=ids), frames=frames, n_ids=n_ids)

    def _ended(self, state: LargeState) -> LargeState:
        """Terminate tracks, and release the detections of deleted tentative tracks."""
        tracks = state.tracks
        has_fallen = tracks.best_scores - tracks.scores > math.log(self.lifecycle.delete_odds)
        is_overdue = tracks.firsts <= state.n_frames - state.n_ahead - 1 - LAG
        is_lost = tracks.gaps >= self.model.population.max_gap
        is_out = is_lost | (~tracks.is_confirmed & (has_fallen | is_overdue))
        if not is_out.any():
            return state
        keys = tracks.keys[is_out & ~tracks.is_confirmed]
        frames = _renamed(state.frames, keys, np.full(len(keys), _FREE))
        return replace(state, tracks=tracks.keep(~is_out), frames=frames)

    def _started(self, state: LargeState, n_frames: int) -> LargeState:
        """Initiate tracks with the detections of the last frames that no track has."""
        from asterism import _engine
        from asterism.model.compiled import motion_model, score_model

        n_done = len(state.frames) - state.n_ahead
        first = n_done - n_frames
        if first < 0:
            return state
        frames = state.frames[first:n_done]
        free = [np.flatnonzero(frame.owners == _FREE) for frame in frames]
        if not len(free[0]):
            return state
        points = np.concatenate([f.points[i] for f, i in zip(frames, free, strict=True)])
        options = _engine.StartOptions(
            gate=_chi2(self.n_axes, _START_GATE), min_detections=START_FRAMES - 1,
            max_missed=n_frames - START_FRAMES + 1, min_score=0.0, max_chains=_MAX_CHAINS,
        )  # fmt: skip
        paths, states, scores, gaps = _engine.find_starts(
            motion_model(self.model, self.n_axes), score_model(self.model), options,
            times=np.array([frame.time for frame in frames]),
            F=np.stack([frame.F for frame in frames]), Q=np.stack([frame.Q for frame in frames]),
            offsets=np.cumsum([0, *map(len, free)]), points=points, n_threads=self.threads,
        )  # fmt: skip
        K = len(paths)
        if not K:
            return state
        keys = state.n_keys + np.arange(K)
        last, last_times = np.zeros((K, self.n_axes)), np.zeros(K)
        marked: list[OpenFrame] = []
        for f, (frame, places) in enumerate(zip(frames, free, strict=True)):
            has = paths[:, f] >= 0
            own = places[paths[has, f]]
            owners = frame.owners.copy()
            owners[own] = -2 - keys[has]
            last[has], last_times[has] = frame.points[own], frame.time
            marked.append(replace(frame, owners=owners))
        new = LiveTracks(
            keys=keys, ids=np.full(K, -1), firsts=np.full(K, frames[0].number), states=states,
            last=last, last_times=last_times, scores=scores, best_scores=scores, gaps=gaps,
        )  # fmt: skip
        return replace(
            state, tracks=state.tracks.and_also(new), n_keys=state.n_keys + K,
            frames=(*state.frames[:first], *marked, *state.frames[n_done:]),
        )  # fmt: skip


def _chi2(n_axes: int, probability: float) -> float:
    """Return the χ² value that is exceeded with some probability."""
    from scipy.special import chdtri

    return float(chdtri(n_axes, probability))


def _renamed(
    frames: Sequence[OpenFrame], keys: NDArray[np.int64], owners: NDArray[np.int64]
) -> tuple[OpenFrame, ...]:
    """Return frames in which the detections of tentative tracks have new owners.

    `keys` are increasing.
    """
    if not len(keys):
        return tuple(frames)
    out: list[OpenFrame] = []
    for frame in frames:
        tentative = np.flatnonzero(frame.owners < _FREE)
        own = -2 - frame.owners[tentative]
        at = np.minimum(np.searchsorted(keys, own), len(keys) - 1)
        is_named = keys[at] == own
        new = frame.owners.copy()
        new[tentative[is_named]] = owners[at[is_named]]
        out.append(replace(frame, owners=new))
    return tuple(out)


def _decided(frame: OpenFrame) -> DecidedFrame:
    return DecidedFrame(number=frame.number, labels=np.maximum(frame.owners, _FREE))
