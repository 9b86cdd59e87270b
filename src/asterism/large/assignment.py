"""The assignment of one frame of a large scene, tile by tile.

The assignment with the largest total gain is computed exactly, as by GNN. It separates into groups
of tracks and detections that are connected by candidates. A tile solves the groups that no other
tile can reach; the groups that cross a seam are joined and solved afterwards. Every group is solved
as a whole from the same candidates in the same order, so the result is the same to the last bit for
every tiling.

`solve` is a pure function of a picklable `TileTask`, so it runs in a thread, in another process or
on another machine.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from asterism.errors import SolverLimit
from asterism.large.tiles import cut
from asterism.records import record
from asterism.tracking.methods.options import MAX_CANDIDATES

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable
    from typing import Protocol

    from numpy.typing import NDArray

    from asterism.large.tracks import LiveTracks
    from asterism.model import TrackingModel

    T = TypeVar("T")
    R = TypeVar("R")

    class Mapper(Protocol):
        """Call a function on every item, and return the results in the same order."""

        def __call__(self, function: Callable[[T], R], items: Iterable[T], /) -> Iterable[R]: ...


__all__ = ["Assigned", "Frames", "TileAnswer", "TileTask", "assign", "solve"]


@record(eq=False)
class Frames:
    """The frame that is assigned, and those of the look-ahead after it.

    Attributes
    ----------
    times : ndarray of shape (W,)
        Times, seconds, increasing.
    F, Q : ndarray of shape (W, modes, n, n)
        Transition and process noise of the step that leads to each frame.
    points : tuple of ndarray, each of shape (N, D)
        Detections of each frame, metres.

    Examples
    --------
    >>> one = np.ones((1, 1, 1, 1))
    >>> Frames(times=np.zeros(1), F=one, Q=one, points=(np.zeros((4, 3)),))
    Frames(times=[0], F=array (1, 1, 1, 1), Q=array (1, 1, 1, 1), points=(array (4, 3)))
    """

    times: NDArray[np.float64]
    F: NDArray[np.float64]
    Q: NDArray[np.float64]
    points: tuple[NDArray[np.float64], ...]


@record(eq=False)
class TileTask:
    """All that one tile needs to solve a frame: a model and plain arrays.

    Attributes
    ----------
    model : TrackingModel
        Model of motion, sensor and population.
    gate : float
        χ² gate of a pairing.
    times, F, Q : ndarray of length W
        Frames and their steps, as in `Frames`.
    states, regions, last, last_times, scores, gaps, is_confirmed : ndarray of length k
        The tile's tracks: predicted states, regions (W, D + 1) in which each may be assigned a
        detection, last detection and its time, log odds, frames since the last detection, and
        whether the track is confirmed (0 or 1).
    offsets : ndarray of int64, shape (W + 1,)
        First detection of each frame.
    points : ndarray of shape (m, D)
        Detections of all frames, metres.
    is_shared : ndarray of uint8
        1 for a detection of the first frame that another tile has too.

    Examples
    --------
    >>> import asterism as am
    >>> d = am.simulate.cube(frames=20, seed=1).detections
    >>> tracker = am.large.LargeTracker(model=am.estimate_model(d).model)
    >>> state, tasks = tracker.init(), []
    >>> def mapper(solve, items):
    ...     tasks.extend(items)
    ...     return map(solve, tasks)
    >>> for time, points in d.part(0, 8):
    ...     tasks.clear()
    ...     state, _ = tracker.step(state, time, points, mapper=mapper)
    >>> tasks
    [TileTask(8 tracks, 8 detections, 0 shared)]
    """

    model: TrackingModel
    gate: float
    times: NDArray[np.float64]
    F: NDArray[np.float64]
    Q: NDArray[np.float64]
    states: NDArray[np.float64]
    regions: NDArray[np.float64]
    last: NDArray[np.float64]
    last_times: NDArray[np.float64]
    scores: NDArray[np.float64]
    gaps: NDArray[np.int32]
    is_confirmed: NDArray[np.uint8]
    offsets: NDArray[np.int64]
    points: NDArray[np.float64]
    is_shared: NDArray[np.uint8]

    def __repr__(self) -> str:
        return (
            f"TileTask({len(self.gaps)} tracks, {len(self.is_shared)} detections, "
            f"{int(self.is_shared.sum())} shared)"
        )


@record(eq=False)
class TileAnswer:
    """Assignment of the groups that are complete in a tile, and the candidates of the others.

    Attributes
    ----------
    match : ndarray of int32, shape (k,)
        Detection of each of the tile's tracks, -1 for none, numbered within the tile.
    rows, columns : ndarray of int32, shape (c,)
        Track and detection of each candidate of a group that crosses a seam.
    gains : ndarray of shape (c,)
        Gain of each candidate in log likelihood.
    counts : tuple of int
        Candidates, groups that were solved, and candidates of the largest of them.

    Examples
    --------
    >>> none = np.zeros(0, np.int32)
    >>> TileAnswer(match=none, rows=none, columns=none, gains=np.zeros(0), counts=(0, 0, 0))
    TileAnswer(match=array (0,), rows=array (0,), columns=array (0,), gains=array (0,), ...
    """

    match: NDArray[np.int32]
    rows: NDArray[np.int32]
    columns: NDArray[np.int32]
    gains: NDArray[np.float64]
    counts: tuple[int, int, int]


@record(eq=False)
class Assigned:
    """Assignment of a whole frame.

    Attributes
    ----------
    match : ndarray of int32, shape (K,)
        Detection of each track, -1 for none.
    n_tiles, n_candidates, n_joined, largest_group : int
        Tiles; candidates; candidates of groups that cross a seam; candidates of the largest group.

    Examples
    --------
    >>> Assigned(match=np.array([0, -1]), n_tiles=1, n_candidates=1, n_joined=0, largest_group=1)
    Assigned(match=[0, -1], n_tiles=1, n_candidates=1, n_joined=0, largest_group=1)
    """

    match: NDArray[np.int32]
    n_tiles: int
    n_candidates: int
    n_joined: int
    largest_group: int


def solve(task: TileTask) -> TileAnswer:
    """Solve the groups of candidates that are complete in one tile.

    Parameters
    ----------
    task : TileTask
        The tile.

    Returns
    -------
    TileAnswer

    Raises
    ------
    SolverLimit
        If the gates contain too many detections.
    """
    from asterism import _engine
    from asterism.model.compiled import motion_model, score_model

    try:
        match, rows, columns, gains, counts = _engine.solve_tile(
            motion_model(task.model, task.points.shape[1]),
            score_model(task.model),
            gate=task.gate,
            max_candidates=MAX_CANDIDATES,
            times=task.times,
            F=task.F,
            Q=task.Q,
            states=task.states,
            regions=task.regions,
            last=task.last,
            last_times=task.last_times,
            scores=task.scores,
            gaps=task.gaps,
            is_confirmed=task.is_confirmed,
            offsets=task.offsets,
            points=task.points,
            is_shared=task.is_shared,
        )
    except _engine.CandidateLimit as error:
        what = "pairs of track and detection within the gates of one tile"
        hint = "reduce the model's max_speed or noise_sigma, which is too large for points so dense"
        raise SolverLimit(what, MAX_CANDIDATES + 1, MAX_CANDIDATES, hint) from error
    return TileAnswer(match=match, rows=rows, columns=columns, gains=gains, counts=counts)


def assign(
    tracks: LiveTracks,
    states: NDArray[np.float64],
    regions: NDArray[np.float64],
    frames: Frames,
    *,
    model: TrackingModel,
    gate: float,
    side: float,
    mapper: Mapper | Any = map,
) -> Assigned:
    """Assign the detections of a frame to the tracks with the largest total gain.

    Parameters
    ----------
    tracks : LiveTracks
        Tracks before the frame.
    states : ndarray of shape (K, width)
        Their states, predicted to the frame.
    regions : ndarray of shape (K, W, D + 1)
        Predicted position and gate radius of each track in each frame, metres.
    frames : Frames
        The frame, and those of the look-ahead.
    model : TrackingModel
        Model of motion, sensor and population.
    gate : float
        χ² gate of a pairing.
    side : float
        Side of a tile, metres. It does not change the result.
    mapper : callable
        As `map`: calls a function on every item and returns the results in the same order.

    Returns
    -------
    Assigned
    """
    from asterism import _engine

    points = frames.points[0]
    tiles = cut(regions, frames.points, side)
    n_tiles_of = np.zeros(len(points), np.int32)
    for tile in tiles:
        n_tiles_of[tile.points[0]] += 1
    is_shared = (n_tiles_of > 1).astype(np.uint8)
    is_confirmed = tracks.is_confirmed.astype(np.uint8)
    tasks = [
        TileTask(
            model=model,
            gate=gate,
            times=frames.times,
            F=frames.F,
            Q=frames.Q,
            states=states[tile.tracks],
            regions=regions[tile.tracks],
            last=tracks.last[tile.tracks],
            last_times=tracks.last_times[tile.tracks],
            scores=tracks.scores[tile.tracks],
            gaps=tracks.gaps[tile.tracks],
            is_confirmed=is_confirmed[tile.tracks],
            offsets=np.cumsum([0, *map(len, tile.points)]),
            points=np.concatenate([p[i] for p, i in zip(frames.points, tile.points, strict=True)]),
            is_shared=is_shared[tile.points[0]],
        )
        for tile in tiles
    ]
    match = np.full(len(tracks), -1, np.int32)
    rows: list[NDArray[np.int32]] = [np.zeros(0, np.int32)]
    columns, gains, counts = [rows[0]], [np.zeros(0)], [(0, 0, 0)]
    for tile, answer in zip(tiles, mapper(solve, tasks), strict=True):
        has = answer.match >= 0
        match[tile.tracks[has]] = tile.points[0][answer.match[has]]
        rows.append(tile.tracks[answer.rows].astype(np.int32))
        columns.append(tile.points[0][answer.columns].astype(np.int32))
        gains.append(answer.gains)
        counts.append(answer.counts)
    n_joined = sum(map(len, rows))
    if n_joined:
        joined, count = _engine.solve_joined(
            rows=np.concatenate(rows),
            columns=np.concatenate(columns),
            gains=np.concatenate(gains),
            n_tracks=len(tracks),
            n_points=len(points),
        )
        match = np.where(joined >= 0, joined, match)
        counts.append((0, *count[1:]))
    return Assigned(
        match=match,
        n_tiles=len(tiles),
        n_candidates=sum(c[0] for c in counts),
        n_joined=n_joined,
        largest_group=max(c[2] for c in counts),
    )
