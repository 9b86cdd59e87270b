"""Carry out one job: track the capture in a process of its own, and deliver its files."""

from __future__ import annotations

import dataclasses
import json
import pickle
import signal
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

from asterism.batch.child import JOB, OUTCOME, RESULT
from asterism.batch.storage import deliver, inside
from asterism.errors import AsterismError
from asterism.records import record

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from asterism.batch.job import Job

__all__ = ["Outcome", "deliver_all", "perform"]

_LINES = 3  # of what a failed process wrote, in the reason


@record(eq=False)
class Outcome:
    """Outcome of one job.

    Parameters
    ----------
    error : str
        Reason of a failure; empty after success.
    warnings : tuple of str
        Warnings of the tracking.
    seconds : float
        Running time.
    peak_bytes : int
        Largest memory of the process; 0 where it is not known.
    files : dict of bytes
        Files that are still to be delivered, by name.
    """

    error: str = ""
    warnings: tuple[str, ...] = ()
    seconds: float = 0.0
    peak_bytes: int = 0
    files: dict[str, bytes] = dataclasses.field(default_factory=dict[str, bytes])


def perform(
    job: Job,
    out: str,
    inputs: Mapping[str, bytes] | None = None,
    memory: int | None = None,
    overwrite: bool = False,
    *,
    progress: Callable[[str, int, int], Any] | None = None,
) -> Outcome:
    """Track one capture in a process of its own, and write its files.

    Parameters
    ----------
    job : Job
        The capture.
    out : str
        Output folder, by path or URL.
    inputs : mapping of bytes, optional
        Content of the input files by their place. The files of the result are then returned, not
        written. By default input and output are read and written here.
    memory : int, optional
        Largest memory of the process, in bytes.
    overwrite : bool
        Whether files of other results may be replaced.
    progress : callable, optional
        Called with stage, number of finished frames and of all.

    Returns
    -------
    Outcome
        A failure is an outcome with its reason.
    """
    try:
        with tempfile.TemporaryDirectory(prefix="asterism-") as name:
            folder = Path(name)
            local = _laid_out(inputs or {}, folder)
            (folder / JOB).write_bytes(pickle.dumps((job, local, memory)))
            error = _run(folder, progress)
            path = folder / OUTCOME
            if not path.is_file():
                return Outcome(error=f"{job.source}: {error}")
            values: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
            done = Outcome(
                error=values["error"],
                warnings=tuple(_public(text, job, folder, out) for text in values["warnings"]),
                seconds=values["seconds"], peak_bytes=values["peak_bytes"],
            )  # fmt: skip
            if done.error:
                return done
            files = {each: (folder / RESULT / each).read_bytes() for each in job.files}
            if inputs is not None:
                return dataclasses.replace(done, files=files)
            deliver_all(files, out, overwrite=overwrite)
            return done
    except AsterismError as failure:
        return Outcome(error=str(failure))
    except OSError as failure:
        return Outcome(error=f"{failure.filename or job.source}: {failure.strerror or failure}")


def deliver_all(files: Mapping[str, bytes], out: str, *, overwrite: bool) -> None:
    """Write the files of a result; the last one, the summary, makes it a finished one.

    Raises
    ------
    FormatError
        If a file cannot be written, or exists with other bytes and `overwrite` is false.
    """
    for name, content in files.items():
        deliver(inside(out, name), content, overwrite=overwrite)


def _public(text: str, job: Job, folder: Path, out: str) -> str:
    """Return a message that names the files of a result where they are delivered."""
    for name in job.files:
        text = text.replace(str(folder / RESULT / name), inside(out, name))
    return text


def _laid_out(inputs: Mapping[str, bytes], folder: Path) -> dict[str, Path]:
    """Write inputs into a folder, each in one of its own, and return their paths by place."""
    paths: dict[str, Path] = {}
    for n, (place, content) in enumerate(inputs.items()):
        paths[place] = folder / f"in{n}" / Path(place).name
        paths[place].parent.mkdir()
        paths[place].write_bytes(content)
    return paths


def _run(folder: Path, progress: Callable[[str, int, int], Any] | None) -> str:
    """Run the process, and return the reason why it ended without an outcome."""
    with (folder / "errors").open("w+", encoding="utf-8", errors="replace") as errors:
        process = subprocess.Popen(
            [sys.executable, "-m", "asterism.batch.child", str(folder)],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=errors, text=True,
        )  # fmt: skip
        assert process.stdin is not None
        assert process.stdout is not None
        try:
            for line in process.stdout:
                if progress is not None:
                    progress(*json.loads(line))
            code = process.wait()
        finally:
            process.kill()
            process.wait()
            process.stdin.close()
            process.stdout.close()
        errors.seek(0)
        last = "; ".join(errors.read().strip().splitlines()[-_LINES:])
    if code < 0:
        return f"its process was ended by {signal.Signals(-code).name}, as by a lack of memory"
    return f"its process ended with exit code {code}: {last}"
