"""Track one capture in a separate process: ``python -m asterism.batch.child FOLDER``."""

from __future__ import annotations

import dataclasses
import json
import logging
import os
import pickle
import sys
import threading
import time
from pathlib import Path
from tempfile import mkdtemp
from typing import TYPE_CHECKING

from asterism.batch.carry_out import carry_out
from asterism.batch.job import key_of
from asterism.batch.page import write_page
from asterism.batch.run_folder import CONFIG, DECISIONS, SUMMARY, Run
from asterism.batch.storage import fetch
from asterism.errors import AsterismError, ParameterError
from asterism.io import CAPTURE_FORMATS, read, read_edits
from asterism.io.atomic import write_text
from asterism.io.decisions import write_decisions
from asterism.io.json_text import to_json
from asterism.tracking import method_by_name, plan_tracking
from asterism.tracking.naming.from_file import read_markers

if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import IO

    from asterism.batch.job import Job

JOB, RESULT, OUTCOME = "job.pickle", "result", "outcome.json"
_SECONDS = 0.2  # between two messages about the progress


def main(folder: Path) -> None:
    """Track the capture of a job, and write its files and the outcome into a folder."""
    stream = _messages()

    def tell(stage: str, done: int, total: int) -> None:
        stream.write(json.dumps([stage, done, total]) + "\n")
        stream.flush()

    threading.Thread(target=_end_with_parent, daemon=True).start()
    job: Job
    local: dict[str, Path]
    with (folder / JOB).open("rb") as file:
        job, local, memory = pickle.load(file)
    warnings = _collected()
    start = time.monotonic()
    try:
        _limit_memory(memory)
        _track(job, folder, local, tell)
        error = ""
    except AsterismError as failure:
        error = str(failure)
    except MemoryError:
        bound = f"the bound of {memory / 1e9:.2g} GB" if memory else "what is there"
        error = f"{job.source}: needs more memory than {bound}"
    except OSError as failure:
        error = f"{failure.filename or job.source}: {failure.strerror or failure}"

    def public(text: str) -> str:
        for place, path in local.items():
            text = text.replace(str(path), place)
        return text

    outcome = {
        "error": public(error),
        "warnings": [public(text) for text in warnings],
        "seconds": time.monotonic() - start,
        "peak_bytes": _peak_bytes(),
    }
    (folder / OUTCOME).write_text(json.dumps(outcome), encoding="utf-8")


def _track(
    job: Job, folder: Path, local: dict[str, Path], tell: Callable[[str, int, int], None]
) -> None:
    """Track the capture; the files have the names that they have in the output folder."""
    out, run_folder = folder / RESULT / job.output, folder / RESULT / job.run
    for each in (out.parent, run_folder):
        each.mkdir(parents=True, exist_ok=True)
    settings = job.settings

    def at(place: str) -> Path:
        if place not in local:
            local[place] = fetch(place, Path(mkdtemp(dir=folder)))
        return local[place]

    if key_of(job, lambda place: at(place).read_bytes()) != job.key:
        raise ParameterError(
            job.source, "the input and the versions with which the batch began", "others",
            "run the batch again, with the same versions of the software on all machines",
        )  # fmt: skip
    capture = read(at(job.source))
    CAPTURE_FORMATS[job.format].check(capture)
    sets = [read_markers(at(place)) for place in job.markers] or None
    edits = [] if job.edits is None else read_edits(at(job.edits), capture)
    made = None if settings.method is None else method_by_name(settings.method, **settings.options)
    tell("estimating the model", 0, 0)
    plan = plan_tracking(
        capture, made, model=settings.model, stitch=settings.stitch, seed=settings.seed,
        marker_sets=sets, edits=edits, fill=settings.fill,
    )  # fmt: skip
    run = Run(
        recipe=plan.recipe, source=job.source, format=job.format, markers=job.markers,
        edits=() if job.edits is None else (job.edits,),
    )  # fmt: skip
    last = 0.0

    def advance(done: int) -> None:
        nonlocal last
        if time.monotonic() - last > _SECONDS:
            last = time.monotonic()
            tell(f"tracking with {plan.method.name}", done, capture.n_frames)

    result, summary = carry_out(run, capture, out, marker_sets=sets, edits=edits, progress=advance)
    dataclasses.replace(run, recipe=result.recipe).write(run_folder / CONFIG)
    for name in DECISIONS:
        write_decisions(result.tracks, run_folder / name)
    if job.page is not None:
        tell("writing the report", 0, 0)
        named = dataclasses.replace(summary, output=job.output)
        write_page(result, folder / RESULT / job.page, plan.estimate, named, timed=False)
    values = summary.to_dict() | {"input": job.source, "output": job.output}
    for name in ("seconds", "frames_per_second"):  # the same input gives the same bytes
        del values[name]
    write_text(run_folder / SUMMARY, to_json({"key": job.key, **values}) + "\n")


def _messages() -> IO[str]:
    """Return the stream of messages to the parent; what else is printed goes to stderr."""
    stream = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    return stream


def _collected() -> list[str]:
    """Return a list that takes the warnings of the library from now on."""
    texts: list[str] = []

    class Collector(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            texts.append(record.getMessage())

    logging.getLogger("asterism").addHandler(Collector(logging.WARNING))
    return texts


def _limit_memory(memory: int | None) -> None:
    """Limit the memory of this process, in bytes, where the system can."""
    if memory is not None and sys.platform == "linux":
        import resource

        resource.setrlimit(resource.RLIMIT_DATA, (memory, memory))


def _peak_bytes() -> int:
    """Return the largest resident memory of this process; 0 where it is not known.

    The figure of ``getrusage`` is at least that of the parent process when it started this one.
    """
    status = Path("/proc/self/status")
    if not status.is_file():
        return 0
    line = next(each for each in status.read_text().splitlines() if each.startswith("VmHWM"))
    return int(line.split()[1]) * 1024


def _end_with_parent() -> None:
    """End this process when its parent closes the pipe, as it does when it ends in any way."""
    sys.stdin.buffer.read()
    os._exit(1)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
    sys.stderr.flush()
    os._exit(0)  # the thread that waits for the parent would hold the process
