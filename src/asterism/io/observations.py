"""Image points of several cameras as CSV: one row per point, without loss.

Columns ``frame, time, camera, u, v, marker``: seconds, the name of the camera, pixels from the
centre of the top left pixel, and, if the truth is known, the name of the marker, blank for clutter.
The first rows have neither frame nor time: each declares a camera or a marker, in order, so that
cameras and markers without any image point are kept. A row with a frame and a time alone is a frame
without image points. Floats have enough digits to restore the same bits.
"""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING

import numpy as np

from asterism.camera import Observations
from asterism.checks import check_number, check_path
from asterism.errors import FormatError, ParameterError, not_read
from asterism.io import caliscope_xy
from asterism.io.atomic import replacing
from asterism.io.csv_columns import columns_of, quoted, whole
from asterism.io.text_table import cells_of, check_times, read_lines

if TYPE_CHECKING:
    from collections.abc import Generator, Iterable, Iterator, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

__all__ = ["read_observations", "write_observations"]

_COLUMNS = ("frame", "time", "camera", "u", "v", "marker")
_TEXTS = ("camera", "marker")
_CHUNK = 1024  # frames at a time


def write_observations(
    observations: Observations, path: str | Path, *, first_frame: int = 1
) -> None:
    """Write image points to a CSV file, completely or not at all.

    `read_observations` returns the same values bit for bit. Names of markers are written if the
    observations have their true markers.

    Parameters
    ----------
    observations : Observations
        Image points to write.
    path : path
        File to write; an existing one is replaced.
    first_frame : int
        Number of the first frame in the file.

    Raises
    ------
    ParameterError
        If a name is empty, is repeated or contains a line end.
    FormatError
        If the file cannot be written.

    Examples
    --------
    >>> import asterism as am, tempfile
    >>> rig = am.Rig.ring(2, radius=5, height=2)
    >>> film = am.simulate.film(am.simulate.cube(frames=2, seed=1), rig)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_observations(film.observations, f"{folder}/seen.csv")
    ...     read_observations(f"{folder}/seen.csv").cameras
    ('cam1', 'cam2')
    """
    check_number("first_frame", first_frame, integer=True)
    _check_names("cameras", observations.cameras)
    if observations.markers is not None:
        _check_names("marker_names", observations.marker_names)
    with replacing(check_path("path", path)) as file:
        for text in _texts(observations, int(first_frame)):
            file.write(text.encode())


def read_observations(path: str | Path) -> Observations:
    r"""Read image points from a CSV file of `write_observations` or of caliscope.

    The header decides between the two. Cameras of caliscope's ``xy.csv`` are named ``cam_N``, as by
    `read_rig` for its calibration.

    Columns and rows may stand in any order; the points of one camera and frame keep their order.
    Either all cameras are declared or none, and the same holds for markers. Without declarations,
    they are numbered in the order of their first row, and markers that are all whole numbers have
    no names.

    Parameters
    ----------
    path : path
        CSV file.

    Returns
    -------
    Observations
        Image points with the true markers, if the file has them.

    Raises
    ------
    FormatError
        If the file does not exist, or a line is malformed; the error names it.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = pathlib.Path(folder, "seen.csv")
    ...     _ = path.write_text("frame,time,camera,u,v\n1,0.0,left,320.5,240.25\n")
    ...     read_observations(path).pixels.tolist()
    [[320.5, 240.25]]
    """
    path = check_path("path", path)
    try:
        lines = read_lines(path)
    except OSError as error:
        raise not_read(path, error) from error
    while len(lines) > 1 and not lines[-1].strip():
        lines.pop()
    header = cells_of(lines[0])
    if caliscope_xy.is_header(header) and len(set(header)) == len(header):
        with _faults_of(path):
            return caliscope_xy.parse(path, lines, header)
    missing = [name for name in _COLUMNS[:-1] if name not in header]
    if missing or len(set(header)) < len(header) or not set(header) <= set(_COLUMNS):
        got = repr(", ".join(header)[:60])
        raise FormatError(path, "line 1", f"the columns {', '.join(_COLUMNS)}", got)
    numbers, texts = columns_of(path, lines, header, _TEXTS)
    with _faults_of(path):
        return _assemble(path, numbers, texts)


@contextmanager
def _faults_of(path: Path) -> Generator[None, None, None]:
    """Turn a `ParameterError` of `Observations` into an error about the file."""
    try:
        yield
    except ParameterError as error:
        raise FormatError(path, error.name, error.expected, error.got, error.hint) from error


def _texts(observations: Observations, first_frame: int) -> Iterator[str]:
    """Generate the text of the file in parts."""
    o = observations
    has_truth = o.markers is not None
    yield ",".join(_COLUMNS if has_truth else _COLUMNS[:-1]) + "\n"
    cameras = [quoted(name) for name in o.cameras]
    yield "".join(f",,{name},,{',' * has_truth}\n" for name in cameras)
    markers = [quoted(name) for name in o.marker_names]
    if has_truth:
        yield "".join(f",,,,,{name}\n" for name in markers)
    named = [*markers, ""]  # the last one is that of -1
    for begin in range(0, o.n_frames, _CHUNK):
        end = min(begin + _CHUNK, o.n_frames)
        rows = slice(int(o.offsets[begin * o.n_cameras]), int(o.offsets[end * o.n_cameras]))
        times = o.times[begin:end].tolist()
        starts = [f"{t},{time!r}" for t, time in enumerate(times, first_frame + begin)]
        cells = [f"{start},{name}" for start in starts for name in cameras]
        cell = (o.frame_of[rows] - begin) * o.n_cameras + o.camera_of[rows]
        columns: list[Iterable[str]] = [map(cells.__getitem__, cell.tolist())]
        columns += [map(repr, o.pixels[rows, axis].tolist()) for axis in (0, 1)]
        if o.markers is not None:
            numbers = o.markers[rows].tolist()
            columns.append(
                map(named.__getitem__, numbers)
                if markers
                else (str(k) if k >= 0 else "" for k in numbers)
            )
        lines = list(map(",".join, zip(*columns, strict=True)))
        counts = o.counts[begin:end].sum(axis=1)
        places = np.cumsum(counts)
        # Backwards, so that the earlier places stay valid.
        for t in np.flatnonzero(counts == 0)[::-1].tolist():
            lines.insert(int(places[t]), starts[t] + ",,," + "," * has_truth)
        yield "".join(f"{line}\n" for line in lines)


def _check_names(what: str, names: Sequence[str]) -> None:
    for name in names:
        # UTF-8 cannot encode half a surrogate pair.
        if not name or any(c in "\r\n" or "\ud800" <= c <= "\udfff" for c in name):
            raise ParameterError(what, "names of one line, none empty", repr(name))
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise ParameterError(what, "different names", f"{twice!r} more than once")


def _assemble(
    path: Path, numbers: dict[str, NDArray[np.float64]], texts: dict[str, list[str]]
) -> Observations:
    frame, time = numbers["frame"], numbers["time"]
    pixels = np.stack([numbers["u"], numbers["v"]], axis=1)
    has_camera = np.array([bool(name) for name in texts["camera"]], dtype=bool)
    markers = texts.get("marker", [""] * len(frame))
    has_marker = np.array([bool(name) for name in markers], dtype=bool)
    n_given = np.isfinite(pixels).sum(axis=1)
    has_frame, has_time = np.isfinite(frame), np.isfinite(time)
    is_point = has_frame & has_time & has_camera & (n_given == 2)
    is_nothing = has_frame & has_time & ~has_marker & (n_given == 0)
    is_declaration = ~has_frame & ~has_time & (has_camera ^ has_marker) & (n_given == 0)
    bad = np.flatnonzero(~(is_point | is_nothing | is_declaration))
    if len(bad):
        expected = "frame, time, camera, u and v; or frame and time; or a camera or a marker alone"
        raise FormatError(path, f"line {bad[0] + 2}", expected, "another selection of cells")

    cameras, camera_of = _indices(path, "camera", texts["camera"], is_declaration & has_camera)
    names, marker_of = _indices(path, "marker", markers, is_declaration & has_marker)
    rows = np.flatnonzero(~is_declaration)
    numbered = whole(path, "frame", frame[rows], rows + 2)
    order = np.lexsort((camera_of[rows], numbered))
    rows, numbered = rows[order], numbered[order]
    begins = np.flatnonzero(np.diff(numbered, prepend=numbered[:1] - 1))
    index = np.repeat(np.arange(len(begins)), np.diff(np.append(begins, len(rows))))
    times = time[rows[begins]]
    bad = np.flatnonzero(time[rows] != times[index])
    if len(bad):
        i = int(bad[0])
        expected = f"the time of the other rows of frame {numbered[i]}, {times[index[i]]:g} s"
        raise FormatError(path, f"line {rows[i] + 2}", expected, f"{time[rows[i]]:g} s")
    check_times(path, times, rows[begins] + 2)

    kept = is_point[rows]
    cells = index[kept] * max(len(cameras), 1) + camera_of[rows[kept]]
    counts = np.bincount(cells, minlength=len(times) * len(cameras))
    has_truth = "marker" in texts
    return Observations(
        times=times,
        cameras=cameras,
        offsets=np.concatenate([[0], np.cumsum(counts)]).astype(np.int64),
        pixels=pixels[rows[kept]],
        markers=marker_of[rows[kept]] if has_truth else None,
        marker_names=names if has_truth else (),
    )


def _indices(
    path: Path, column: str, texts: list[str], is_declaration: NDArray[np.bool_]
) -> tuple[tuple[str, ...], NDArray[np.int64]]:
    """Return the names of a column and the index of each row's name, -1 for a blank cell."""
    declared = np.flatnonzero(is_declaration).tolist()
    names: dict[str, int] = {}
    for i in declared:
        if texts[i] in names:
            expected = f"each {column} declared once"
            raise FormatError(path, f"line {i + 2}", expected, f"{texts[i]!r} again")
        names[texts[i]] = len(names)
    met = [name for name in dict.fromkeys(texts) if name and name not in names]
    if declared and met:
        line = f"line {texts.index(met[0]) + 2}"
        raise FormatError(path, line, f"a declared {column}", repr(met[0]))
    is_numbered = column == "marker" and not declared and all(map(_is_number, met))
    numbers = names or {name: int(name) if is_numbered else i for i, name in enumerate(met)}
    found = () if is_numbered else tuple(numbers)
    numbers[""] = -1
    return found, np.fromiter(map(numbers.__getitem__, texts), np.int64, len(texts))


def _is_number(text: str) -> bool:
    return text.isascii() and text.isdigit() and len(text) < 10 and str(int(text)) == text
