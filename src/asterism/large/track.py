"""Tracking of a plain table into another one, frame by frame."""

from __future__ import annotations

import time as clock
from collections import deque
from concurrent.futures import ThreadPoolExecutor
from contextlib import nullcontext
from typing import TYPE_CHECKING, Any

import numpy as np

from asterism.checks import check_file, check_kind, check_path
from asterism.errors import FormatError, ParameterError
from asterism.large.columns import Columns
from asterism.large.csv_table import CsvTable
from asterism.large.parquet_table import ParquetTable
from asterism.large.rows import frames_of
from asterism.large.sample import estimate_from_start
from asterism.large.tracker import LAG, LOOK_AHEAD, LargeTracker
from asterism.records import record
from asterism.tracking.methods.options import Gate, Lifecycle

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from asterism.large.assignment import Mapper
    from asterism.large.rows import Table, TableFrame
    from asterism.large.state import DecidedFrame
    from asterism.model import TrackingModel

__all__ = ["SUFFIXES", "LargeRun", "check_form", "open_table", "track"]

SUFFIXES = {".parquet": ParquetTable, ".pq": ParquetTable, ".csv": CsvTable, ".tsv": CsvTable,
           ".txt": CsvTable}  # fmt: skip
"""Kinds of table by the suffix of their files."""


@record
class LargeRun:
    """Figures of one tracked table.

    Attributes
    ----------
    output : Path
        File that was written.
    n_frames, n_points, n_tracks, n_labelled : int
        Frames with rows, rows, confirmed tracks, rows with a track.
    n_tiles, largest_group, n_joined : int
        Largest number of tiles of a frame; of candidates in a group; and, summed over all frames,
        candidates of groups that crossed a seam.
    seconds : float
        Wall time of reading, tracking and writing, without the estimation of the model.
    frame_seconds : float
        Median wall time of the tracking of a frame.
    model : TrackingModel
        Model that was given or estimated.

    Examples
    --------
    >>> from pathlib import Path
    >>> import asterism as am
    >>> model = am.estimate_model(am.simulate.cube(frames=20, seed=1).detections).model
    >>> LargeRun(
    ...     output=Path("swarm.parquet"), n_frames=100, n_points=1000, n_tracks=10,
    ...     n_labelled=950, n_tiles=1, largest_group=2, n_joined=0, seconds=1.0,
    ...     frame_seconds=0.01, model=model)
    LargeRun(swarm.parquet: 100 frames, 1000 points, 10 tracks, 950 labelled)
    """

    output: Path
    n_frames: int
    n_points: int
    n_tracks: int
    n_labelled: int
    n_tiles: int
    largest_group: int
    n_joined: int
    seconds: float
    frame_seconds: float
    model: TrackingModel

    def __repr__(self) -> str:
        return (
            f"LargeRun({self.output}: {self.n_frames} frames, {self.n_points} points, "
            f"{self.n_tracks} tracks, {self.n_labelled} labelled)"
        )


def open_table(path: str | Path, columns: Columns | None = None) -> Table:
    """Open a table by the suffix of its file.

    Parameters
    ----------
    path : path
        Parquet (.parquet, .pq) or text with a header (.csv, .tsv, .txt).
    columns : Columns, optional
        Names of its columns.

    Returns
    -------
    Table

    Raises
    ------
    ParameterError
        If the suffix is none of these, or pyarrow is needed and not installed.

    Examples
    --------
    >>> type(open_table("swarm.csv")).__name__
    'CsvTable'
    """
    path = check_path("source", path)
    if columns is not None:
        check_kind("columns", columns, Columns, "am.large.Columns()")
    kind = SUFFIXES.get(path.suffix.lower())
    if kind is None:
        raise ParameterError("source", f"a name ending in {', '.join(SUFFIXES)}", str(path))
    return kind(path=path, columns=columns or Columns())


def check_form(source: Path, out: Path) -> None:
    """Raise unless both are tables of the same form, because the rows are copied.

    Parameters
    ----------
    source, out : Path
        Input and output.

    Raises
    ------
    ParameterError
        If a suffix is not that of a table, or the output has another form.

    Examples
    --------
    >>> from pathlib import Path
    >>> check_form(Path("swarm.csv"), Path("tracked.parquet"))
    Traceback (most recent call last):
    ...
    asterism.errors.ParameterError: out: expected a name ending in .csv, .tsv, .txt, found ...
    """
    kind = SUFFIXES.get(source.suffix.lower())
    if kind is None:
        raise ParameterError("source", f"a name ending in {', '.join(SUFFIXES)}", str(source))
    if SUFFIXES.get(out.suffix.lower()) is not kind:
        able = ", ".join(suffix for suffix, other in SUFFIXES.items() if other is kind)
        hint = "the rows are copied in the form of the input"
        raise ParameterError("out", f"a name ending in {able}", str(out), hint)


def track(
    source: str | Path,
    out: str | Path,
    *,
    model: TrackingModel | None = None,
    columns: Columns | None = None,
    tile: float | None = None,
    threads: int = 1,
    mapper: Mapper | Any = None,
    look_ahead: int = LOOK_AHEAD,
    gate: Gate | None = None,
    lifecycle: Lifecycle | None = None,
    progress: Callable[[int], Any] | None = None,
) -> LargeRun:
    r"""Track a table of detections into the same table with a column of track labels.

    The table is read and written a part at a time, so the memory does not depend on the number of
    frames. The output has the rows of the input in the same order; -1 is no track. It appears under
    its name when it is complete. After an error or an interrupt nothing is left.

    Parameters
    ----------
    source : path
        Table with a row for each detection, in the order of frames: .parquet, .csv, .tsv or .txt.
    out : path
        Table to write, in the same form as the input. An existing file is replaced.
    model : TrackingModel, optional
        By default it is estimated from a crop of the first frames.
    columns : Columns, optional
        Names of the columns, unit and frame rate.
    tile : float, optional
        Side of a spatial tile, metres, > 0. It does not change the result.
    threads : int
        Threads, ≥ 1. They do not change the result.
    mapper : callable, optional
        Where the tiles are solved: called as ``mapper(function, tasks)``, returns the results in
        the same order. By default this process.
    look_ahead : int
        Later frames that are seen before a frame is assigned, 0 to 4.
    gate : Gate, optional
        Region in which a track can be assigned a detection.
    lifecycle : Lifecycle, optional
        Confirmation and deletion of tentative tracks.
    progress : callable, optional
        Called with the number of frames that are read.

    Returns
    -------
    LargeRun
        Figures of the run.

    Raises
    ------
    FormatError
        If the input is malformed or the output cannot be written.
    ParameterError
        If an option is out of range.
    SolverLimit
        If the gates contain too many detections.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> import asterism as am
    >>> d = am.simulate.cube(frames=40, seed=1).detections
    >>> rows = [f"{t},{x},{y},{z}" for t, p in d for x, y, z in p.tolist()]
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     source, out = (pathlib.Path(folder, f"{name}.csv") for name in ("cube", "tracked"))
    ...     _ = source.write_text("\n".join(["t,x,y,z", *rows]))
    ...     run = track(source, out)
    ...     run.n_tracks, run.n_labelled, out.read_text().splitlines()[0]
    (8, 320, 't,x,y,z,track')
    """
    table, out = open_table(source, columns), check_path("out", out)
    check_form(table.path, out)
    check_file(table.path, "a table")
    if out.exists() and out.samefile(table.path):
        raise ParameterError("out", "a path of its own", f"{out}, the input")
    if model is None:
        model = estimate_from_start(_paced(table, None))
    tracker = LargeTracker(
        model=model, n_axes=len(table.layout.axes), tile=tile, threads=threads,
        look_ahead=look_ahead, gate=gate or Gate(), lifecycle=lifecycle or Lifecycle(),
    )  # fmt: skip
    pool = ThreadPoolExecutor(threads) if mapper is None and threads > 1 else nullcontext()
    with pool as own:
        chosen = mapper or (own.map if own is not None else map)
        return _run(table, out, tracker, chosen, progress)


def _run(table: Table, out: Path, tracker: LargeTracker, mapper: Any, progress: Any) -> LargeRun:
    start = clock.perf_counter()
    empty = tracker.model.population.max_gap + tracker.look_ahead + LAG
    state, waiting = tracker.init(), deque["TableFrame | None"]()
    counts = {"n_frames": 0, "n_points": 0, "n_labelled": 0}
    sizes = {"n_tiles": 0, "largest_group": 0, "n_joined": 0}
    taken: list[float] = []
    with table.writing(out) as writer:

        def write(decided: list[DecidedFrame]) -> None:
            for frame in decided:
                rows = waiting.popleft()
                if rows is not None:
                    writer.write(rows.rows, frame.labels)
                    counts["n_labelled"] += int((frame.labels >= 0).sum())

        for time, points, frame in _filled(table, empty):
            waiting.append(frame)
            begin = clock.perf_counter()
            state, decided = tracker.step(state, time, points, mapper=mapper)
            taken.append(clock.perf_counter() - begin)
            write(decided)
            if state.last is not None:
                sizes["n_tiles"] = max(sizes["n_tiles"], state.last.n_tiles)
                sizes["largest_group"] = max(sizes["largest_group"], state.last.largest_group)
                sizes["n_joined"] += state.last.n_joined
            if frame is not None:
                counts["n_frames"] += 1
                counts["n_points"] += len(points)
                if progress is not None:
                    progress(counts["n_frames"])
        state, decided = tracker.finish(state, mapper=mapper)
        write(decided)
    if not counts["n_frames"]:
        out.unlink(missing_ok=True)
        raise FormatError(table.path, "", "rows of detections", "none")
    return LargeRun(
        output=out, n_tracks=state.n_ids, seconds=clock.perf_counter() - start,
        frame_seconds=float(np.median(taken)), model=tracker.model, **counts, **sizes,
    )  # fmt: skip


def _paced(table: Table, empty: int | None) -> Iterator[tuple[float, Any]]:
    """Yield the time and the detections of each frame."""
    for time, points, _ in _filled(table, empty):
        yield time, points


def _filled(table: Table, empty: int | None) -> Iterator[tuple[float, Any, TableFrame | None]]:
    """Yield time, detections and rows of each frame, and frames without rows between them.

    After `empty` frames without detections no track is left, so further ones change nothing.
    """
    layout = table.layout
    last: TableFrame | None = None
    for frame in frames_of(table.path, table.chunks()):
        if last is not None and layout.frame is not None:
            missing = round(frame.key - last.key) - 1
            for k in range(1, min(missing, 100 if empty is None else empty) + 1):
                share = k / (missing + 1)
                time = last.time + share * (frame.time - last.time)
                yield time, np.zeros((0, len(layout.axes))), None
        yield frame.time, frame.points, frame
        last = frame
