"""Captures of a batch, each with its marker sets, its edits and the state of its result."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Literal

from asterism.batch.job import Job, Settings, key_of
from asterism.batch.result_file import output_format
from asterism.batch.storage import files_below, inside, is_url, read_bytes
from asterism.errors import AsterismError, FormatError, ParameterError
from asterism.io import CAPTURE_FORMATS
from asterism.records import record

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence
    from typing import Any

__all__ = ["MARKER_SET", "Planned", "plan_batch"]

MARKER_SET = "markers.toml"
"""Name of the marker set of the captures in a folder and below it."""
_EDITS = ".edits.toml"
_SURE = (".c3d", ".trc")  # no other kind of file has these suffixes
_HEAD = 4096


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
        Reason of the state ``failed``.
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
) -> list[Planned]:
    """Find the captures of a batch and the state of each result; nothing is tracked.

    Parameters
    ----------
    sources : sequence of str
        Captures and folders, by path or URL. In folders, files of the known formats are captures.
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
    list of Planned
        In the order of the sources, those of a folder by name.

    Raises
    ------
    ParameterError
        If no capture is found, or two have the same result.
    """
    found = [job for source in sources for job in _jobs(source, out, settings, tuple(markers))]
    if not found:
        raise ParameterError("sources", "captures, or folders with captures", ", ".join(sources))
    owners: dict[str, str] = {}
    for job, _ in found:
        for name in (*job.files, job.run):
            if owners.setdefault(name, job.source) != job.source:
                got = f"{name}, the result of both {owners[name]} and {job.source}"
                raise ParameterError("sources", "one result for each capture", got)
    planned: list[Planned] = []
    for n, (job, reason) in enumerate(found):
        planned.append(_examined(job, out, reason))
        if progress is not None:
            progress(n + 1, len(found))
    return planned


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
    same = isinstance(before, dict) and before.get("key") == job.key
    return Planned(job=job, state="done" if same else "changed")


def _jobs(
    source: str, out: str, settings: Settings, markers: tuple[str, ...]
) -> Iterator[tuple[Job, str]]:
    """Iterate over the captures of one source, each with the reason why it cannot be read."""
    if _is_file(source):
        folder, _, name = source.rpartition("/") if is_url(source) else _parted(source)
        names, failed = [name], {}
        listed = {each for each, _ in _beside(folder)}
    else:
        folder = source
        every = list(_listed(folder, out))
        listed = {name for name, error in every if error is None}
        failed = {name: error for name, error in every if error is not None}
        names = [name for name in listed | set(failed) if name in failed or _is_one(folder, name)]
    for name in sorted(names):
        error = failed.get(name)
        reason = "" if error is None else f"{inside(folder, name)}: {error.strerror or error}"
        sets = markers or tuple(inside(folder, each) for each in _sets_of(name, listed))
        stem = PurePosixPath(name).with_suffix("")
        edits = f"{stem}{_EDITS}"
        format = settings.format or _format_of(folder, name)
        ending = _ending(name, format)
        yield (
            Job(
                source=inside(folder, name), name=name, output=f"{stem}.tracked{ending}",
                format=format, settings=settings, markers=sets,
                edits=inside(folder, edits) if edits in listed else None,
            ),
            reason,
        )  # fmt: skip


def _parted(source: str) -> tuple[str, str, str]:
    return str(Path(source).parent), "/", Path(source).name


def _is_file(source: str) -> bool:
    if not is_url(source):
        if not Path(source).exists():
            raise ParameterError("sources", "captures or folders that exist", source)
        return Path(source).is_file()
    return bool(PurePosixPath(source).suffix)


def _beside(folder: str) -> Iterator[tuple[str, OSError | None]]:
    if is_url(folder):
        return files_below(folder)
    return iter([(path.name, None) for path in Path(folder).iterdir() if path.is_file()])


def _listed(folder: str, out: str) -> Iterator[tuple[str, OSError | None]]:
    """Iterate over the files below a folder that are not results."""
    results = "" if is_url(folder) or is_url(out) else Path(out).resolve()
    for name, error in files_below(folder):
        if results and Path(folder, name).resolve().is_relative_to(results):
            continue
        yield name, error


def _is_one(folder: str, name: str) -> bool:
    """Return whether a file of a folder is a capture: by its ending, or by its first bytes."""
    ending = PurePosixPath(name).suffix.lower()
    if ending in _SURE:
        return True
    if not ending or ending not in {e for f in CAPTURE_FORMATS.values() for e in f.extensions}:
        return False
    try:
        head = read_bytes(inside(folder, name))[:_HEAD]
    except FormatError:
        return True  # it is reported as one that cannot be read
    return any(f.sniff(head) for f in CAPTURE_FORMATS.values() if ending in f.extensions)


def _sets_of(name: str, listed: set[str]) -> Iterator[str]:
    """Iterate over the marker set in the nearest folder, if any."""
    for folder in PurePosixPath(name).parents:
        if (path := str(folder / MARKER_SET)) in listed:
            yield path
            return


def _format_of(folder: str, name: str) -> str:
    """Return the format of the result: that of the capture, or one that holds tracks."""
    ending = PurePosixPath(name).suffix.lower()
    fitting = [f for f in CAPTURE_FORMATS.values() if ending and ending in f.extensions]
    if len(fitting) > 1:
        head = read_bytes(inside(folder, name))[:_HEAD]
        fitting = [f for f in fitting if f.sniff(head)] or fitting
    return output_format(None, None, fitting[0].name if fitting else "c3d")


def _ending(name: str, format: str) -> str:
    known = CAPTURE_FORMATS[format].extensions
    ending = PurePosixPath(name).suffix
    return ending if ending.lower() in known else known[0]
