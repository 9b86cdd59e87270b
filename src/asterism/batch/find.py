"""Captures of a batch, each with its marker sets, its edits and the state of its result."""

from __future__ import annotations

import dataclasses
import json
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Any, Literal, cast

from asterism.batch.index import INDEX, PARQUET, TABLE, holds_batch
from asterism.batch.job import Job, Settings, key_of
from asterism.batch.result_file import output_format
from asterism.batch.run_folder import CONFIG, FILES
from asterism.batch.storage import (
    files_below,
    files_beside,
    inside,
    is_file,
    is_url,
    read_bytes,
    split,
)
from asterism.errors import AsterismError, FormatError, ParameterError
from asterism.io import CAPTURE_FORMATS
from asterism.io.captures.files import HEAD, fitting_formats
from asterism.records import record

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

__all__ = ["MARKER_SET", "Planned", "captures_below", "check_apart", "first_of", "plan_batch"]

MARKER_SET = "markers.toml"
"""Name of the marker set of the captures in a folder and below it."""
_EDITS = ".edits.toml"
_SURE = (".c3d", ".trc")  # suffixes that only captures have
_READERS = 8  # captures that are read and hashed at the same time
_RESULTS = (".tracked", ".corrected")  # before the suffix of a result of this program
_LISTED = 5  # files that a message names


@record
class Planned:
    """State of one capture before a batch runs.

    Parameters
    ----------
    job : Job
        The capture.
    state : str
        ``new``; ``done``, if the output folder holds the result of the same input and settings;
        ``changed``, if it holds that of others; ``failed``, if the input cannot be read.
    reason : str
        Reason of the states ``changed`` and ``failed``.
    """

    job: Job
    state: Literal["new", "done", "changed", "failed"]
    reason: str = ""


def plan_batch(
    sources: Sequence[str],
    out: str,
    settings: Settings,
    *,
    markers: Sequence[str] = (),
    progress: Callable[[int, int], Any] | None = None,
) -> tuple[list[Planned], list[str]]:
    """Find the captures of a batch and the state of each result; nothing is tracked.

    Parameters
    ----------
    sources : sequence of str
        Captures and folders, by path or URL. In folders, files of the known formats are captures,
        but for results such as ``trial.tracked.c3d``.
    out : str
        Output folder, by path or URL; captures inside it are left out.
    settings : Settings
        Settings of the batch.
    markers : sequence of str
        Marker sets of all captures. By default the file `MARKER_SET` in the folder of a capture, or
        in the nearest folder above it, names its tracks.
    progress : callable, optional
        Called with the number of captures that were examined, and the number of all.

    Returns
    -------
    planned : list of Planned
        The captures, in the order of the sources, those of a folder by name.
    left_out : list of str
        Other files of the folders, by path or URL, those with the ending of a capture first. Hidden
        files, results of this program, and marker sets and edits of the batch are not among them.

    Raises
    ------
    ParameterError
        If no capture is found, all sources are in the output folder, or two captures have the same
        result.
    """
    check_apart(sources, out)
    every: dict[str, tuple[Job, str]] = {}
    others: set[str] = set()
    for source in sources:
        jobs, unknown = _jobs(source, out, settings, tuple(markers))
        every |= {job.source: (job, reason) for job, reason in jobs}
        others.update(unknown)
    found = list(every.values())
    used = {_absolute(place) for job, _ in found for place in (*job.inputs, *markers)}
    left_out = [place for place in others if _absolute(place) not in used]
    left_out.sort(key=lambda place: (not _named(place), place))
    if not found:
        got = ", ".join(sources)
        if left_out:
            got += f", where no file is recognised as a capture: {', '.join(first_of(left_out))}"
        raise ParameterError("sources", "captures, or folders with captures", got)
    owners: dict[str, str] = {}
    for job, _ in found:
        for name in (*job.files, job.run):
            if owners.setdefault(name, job.source) != job.source:
                got = f"{name}, the result of both {owners[name]} and {job.source}"
                raise ParameterError("sources", "one result for each capture", got)
    planned: list[Planned] = []

    def examine(one: tuple[Job, str]) -> Planned:
        return _examined(one[0], out, one[1])

    with ThreadPoolExecutor(_READERS) as pool:
        for each in pool.map(examine, found):
            planned.append(each)
            if progress is not None:
                progress(len(planned), len(found))
    return planned, left_out


def check_apart(sources: Sequence[str], out: str) -> None:
    """Raise if all sources are folders in the output folder, whose captures are left out.

    Parameters
    ----------
    sources : sequence of str
        Captures and folders, by path or URL.
    out : str
        Output folder, by path or URL.

    Raises
    ------
    ParameterError
        If they are, or the first of them does not exist.
    """
    if sources and all(_is_in(source, out) and not is_file(source) for source in sources):
        raise ParameterError(
            "out", "another folder than the input, and none that holds it", out,
            "give a new folder, beside the input or inside it",
        )  # fmt: skip


def first_of(names: Sequence[str]) -> list[str]:
    """Return the first names for a message, and the number of the others.

    Parameters
    ----------
    names : sequence of str
        Names of files or captures.

    Examples
    --------
    >>> first_of("abcdefg")
    ['a', 'b', 'c', 'd', 'e', 'and 2 more']
    """
    more = len(names) - _LISTED
    return [*names[:_LISTED], *([f"and {more:,} more"] if more > 0 else [])]


def _examined(job: Job, out: str, reason: str) -> Planned:
    """Return a capture with its key and the state of its result."""
    if reason:
        return Planned(job=job, state="failed", reason=reason)
    try:
        job = dataclasses.replace(job, key=key_of(job))
    except AsterismError as error:
        return Planned(job=job, state="failed", reason=str(error))
    try:
        before = json.loads(read_bytes(inside(out, job.summary)))
    except (FormatError, ValueError):
        return Planned(job=job, state="new")
    before = cast("dict[str, Any]", before) if isinstance(before, dict) else {}
    if before.get("key") == job.key:
        return Planned(job=job, state="done")
    reason = (
        f"{inside(out, before.get('output', job.output))}: expected a result of the same input, "
        "settings and versions, found another. Give overwrite=True (--overwrite) to track the "
        "capture again, or another output folder to keep both."
    )
    return Planned(job=job, state="changed", reason=reason)


def captures_below(folder: str) -> list[str]:
    """Return the names of the captures below a folder or URL, sorted.

    A suffix that only captures have, such as .c3d, decides; other files are examined.
    """
    names = (name for name, reason in files_below(folder) if not reason)
    return sorted(name for name in names if _formats(folder, name))


def _jobs(
    source: str, out: str, settings: Settings, markers: tuple[str, ...]
) -> tuple[list[tuple[Job, str]], list[str]]:
    """Return the captures of one source, each with the reason why it cannot be read.

    The other files of a folder follow, without the results of this program.
    """
    others: list[str] = []
    reasons: dict[str, str] = {}
    if is_file(source):
        folder, name = split(source)
        formats, listed = {name: _formats(folder, name)}, files_beside(source)
    else:
        folder = source
        every = dict(
            each for each in files_below(folder) if not _is_in(inside(folder, each[0]), out)
        )
        reasons = {name: reason for name, reason in every.items() if reason}
        listed = every.keys() - reasons.keys()
        examined = {name: _formats(folder, name) for name in listed - _written(folder, listed)}
        formats = {name: known for name, known in examined.items() if known}
        others = [inside(folder, name) for name in examined.keys() - formats.keys()]
    jobs: list[tuple[Job, str]] = []
    for name in sorted(formats.keys() | reasons.keys()):
        sets = markers or tuple(inside(folder, each) for each in _sets_of(name, listed))
        stem = PurePosixPath(name).with_suffix("")
        edits = f"{stem}{_EDITS}"
        of_input = next(iter(formats.get(name, ())), "c3d")
        format = settings.format or output_format(None, None, of_input)
        job = Job(
            source=inside(folder, name), name=name,
            output=f"{stem}.tracked{_suffix(name, format)}", format=format, settings=settings,
            markers=sets, edits=inside(folder, edits) if edits in listed else None,
        )  # fmt: skip
        jobs.append((job, reasons.get(name, "")))
    return jobs, others


def _is_in(place: str, out: str) -> bool:
    """Return whether a file or folder is the output folder or in it."""
    if is_url(place) != is_url(out):
        return False
    if is_url(out):
        return f"{place.rstrip('/')}/".startswith(f"{out.rstrip('/')}/")
    return Path(place).resolve().is_relative_to(Path(out).resolve())


def _written(folder: str, listed: set[str]) -> set[str]:
    """Return the files that this program wrote: results, run folders, indices of batches."""
    written = {name for name in listed if _is_result(name)}
    for name in listed:
        path = PurePosixPath(name)
        if path.name == CONFIG:
            written.update(str(path.parent / each) for each in FILES)
        elif path.name == TABLE and holds_batch(inside(folder, str(path.parent))):
            written.update(str(path.parent / each) for each in (INDEX, TABLE, PARQUET))
    return written


def _is_result(name: str) -> bool:
    return PurePosixPath(PurePosixPath(name).stem).suffix in _RESULTS


def _formats(folder: str, name: str) -> list[str]:
    """Return the formats that a file may have; none for a file that is no capture.

    A file that cannot be read has the formats of its suffix, so that it is reported later.
    """
    named = _named(name)
    if name.lower().endswith(_SURE) or not named:
        return named
    try:
        head = read_bytes(inside(folder, name), HEAD)
    except FormatError:
        return named
    return [f.name for f in fitting_formats(head) if f.name in named]


def _named(name: str) -> list[str]:
    """Return the formats whose files have the ending of a name."""
    suffix = PurePosixPath(name).suffix.lower()
    return [f.name for f in CAPTURE_FORMATS.values() if suffix and suffix in f.extensions]


def _absolute(place: str) -> str:
    return place if is_url(place) else str(Path(place).absolute())


def _sets_of(name: str, listed: set[str]) -> Iterator[str]:
    """Iterate over the marker set in the nearest folder, if any."""
    for folder in PurePosixPath(name).parents:
        if (path := str(folder / MARKER_SET)) in listed:
            yield path
            return


def _suffix(name: str, format: str) -> str:
    known = CAPTURE_FORMATS[format].extensions
    suffix = PurePosixPath(name).suffix
    return suffix if suffix.lower() in known else known[0]
