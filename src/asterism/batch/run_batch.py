"""A batch: many captures with the same settings, resumed after any stop."""

from __future__ import annotations

import logging
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

from asterism.batch.cluster import has_cluster, on_cluster
from asterism.batch.find import plan_batch
from asterism.batch.index import TABLE, write_index
from asterism.batch.job import Settings
from asterism.batch.perform import Outcome, deliver_all, perform
from asterism.batch.storage import inside, is_url, read_bytes
from asterism.checks import check_kind, check_number
from asterism.errors import AsterismError, ParameterError
from asterism.records import record

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from asterism.batch.find import Planned
    from asterism.batch.job import Job

__all__ = ["Batch", "holds_batch", "run"]

_SHARE = 0.8  # of the memory of the machine, for all processes together

log = logging.getLogger(__name__)


@record(eq=False)
class Batch:
    """Result of a batch.

    Parameters
    ----------
    out : str
        Output folder.
    planned : tuple of Planned
        Captures, with their state before the batch.
    outcomes : dict of Outcome
        Outcomes of this run by the name of the capture; finished ones of earlier runs have none.
    """

    out: str
    planned: tuple[Planned, ...]
    outcomes: dict[str, Outcome]

    @property
    def failed(self) -> dict[str, str]:
        """Reasons by the name of each capture that has no result."""
        return {name: each.error for name, each in self.outcomes.items() if each.error}

    @property
    def n_tracked(self) -> int:
        """Number of captures that were tracked in this run."""
        return sum(not each.error for each in self.outcomes.values())

    @property
    def n_done_before(self) -> int:
        """Number of captures with a result of an earlier run."""
        return len(self.planned) - len(self.outcomes)

    def __repr__(self) -> str:
        return (
            f"Batch({self.n_tracked} captures tracked, {self.n_done_before} done before, "
            f"{len(self.failed)} failed)"
        )


def run(
    sources: Sequence[str | Path],
    out: str | Path,
    settings: Settings | None = None,
    *,
    markers: Sequence[str | Path] = (),
    workers: int | None = None,
    scheduler: str | None = None,
    send: bool = False,
    memory: int | None = None,
    overwrite: bool = False,
    progress: Callable[[str, str, int, int], Any] | None = None,
) -> Batch:
    """Track many captures with the same settings, each in a process of its own.

    A result is finished when its summary is written. It holds the hash of the contents of the
    capture, of the marker sets and of the edits, and of the settings and the versions. A run with
    the same output folder repeats only what has no finished result with this hash. A capture that
    fails does not stop the others.

    Parameters
    ----------
    sources : sequence of path or str
        Captures and folders, by path or URL. A file ``markers.toml`` in a folder names the tracks
        of the captures in it and below it; ``trial.edits.toml`` beside ``trial.c3d`` corrects them.
    out : path or str
        Output folder, by path or URL. Results have the names of the captures; ``index.html``
        and ``summary.csv`` list them, and ``runs`` holds the folder of each run.
    settings : Settings, optional
        Settings of all captures.
    markers : sequence of path or str
        Marker sets of all captures, instead of those of the folders.
    workers : int, optional
        Number of captures at the same time. More than one needs the extra ``cluster``, with which
        the number of cores is the default; it is 1 without.
    scheduler : str, optional
        Address of a Dask scheduler whose workers track the captures.
    send : bool
        Whether captures are sent to the workers and the results come back. By default the workers
        read and write the files, at the same paths or URLs.
    memory : int, optional
        Largest memory of the process of a capture, in bytes (Linux). By default 80 % of the memory
        of this machine are shared by the workers; with a `scheduler` there is no bound.
    overwrite : bool
        Whether results of another input, or of other settings, are replaced.
    progress : callable, optional
        Called with the name of a capture, its stage, the number of finished frames and of all. The
        stage is ``done`` or ``failed`` at the end. The name is empty while captures are examined;
        the numbers are then those of captures.

    Returns
    -------
    Batch

    Raises
    ------
    ParameterError
        If no capture is found, an argument is impossible, or the scheduler is not reached.
    FormatError
        If the index cannot be written.

    Examples
    --------
    >>> import asterism as am, pathlib, tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     for seed in (1, 2):
    ...         am.write(am.simulate.cube(frames=20, seed=seed), f"{folder}/cube{seed}.csv")
    ...     batch = am.batch.run([folder], f"{folder}/out", workers=1)
    ...     names = sorted(path.name for path in pathlib.Path(folder, "out").iterdir())
    >>> batch
    Batch(2 captures tracked, 0 done before, 0 failed)
    >>> names[:3]
    ['cube1.tracked.csv', 'cube1.tracked.html', 'cube2.tracked.csv']
    """
    settings = Settings() if settings is None else settings
    check_kind("settings", settings, Settings, "am.batch.Settings(method=...)")
    if workers is None:
        workers = (os.cpu_count() or 1) if has_cluster() and scheduler is None else 1
    check_number("workers", workers, above=0, integer=True)
    if memory is None and scheduler is None:
        memory = _memory_of_machine(workers)
    place = str(out)
    _check_out(place, overwrite=overwrite)
    planned = plan_batch(
        [str(source) for source in sources], place, settings, markers=[str(m) for m in markers],
        progress=None if progress is None else lambda n, of: progress("", "examining", n, of),
    )  # fmt: skip
    outcomes: dict[str, Outcome] = {}
    todo: dict[str, Planned] = {}
    for each in planned:
        if each.state == "failed":
            outcomes[each.job.name] = Outcome(error=each.reason)
        elif each.state == "changed" and not overwrite:
            outcomes[each.job.name] = Outcome(error=_changed(place, each))
        elif each.state != "done":
            todo[each.job.name] = each
    for name, outcome in outcomes.items():
        if progress is not None:
            progress(name, "failed" if outcome.error else "done", 0, 0)
    sent = {"memory": memory, "overwrite": overwrite}
    for name, result in _outcomes(todo, place, sent, send, workers, scheduler, progress):
        outcome = result
        if isinstance(result, BaseException):
            outcome = Outcome(error=f"{todo[name].job.source}: {_reason(result)}")
        elif result.files:
            outcome = _delivered(result, place, overwrite=overwrite)
        outcomes[name] = outcome
        for text in outcome.warnings:
            log.warning("%s", text)
        if progress is not None:
            progress(name, "failed" if outcome.error else "done", 0, 0)
    batch = Batch(out=place, planned=tuple(planned), outcomes=outcomes)
    write_index(place, [each.job for each in planned], batch.failed)
    return batch


def _outcomes(
    todo: dict[str, Planned],
    out: str,
    sent: dict[str, Any],
    send: bool,
    workers: int,
    scheduler: str | None,
    progress: Callable[[str, str, int, int], Any] | None,
) -> Iterator[tuple[str, Any]]:
    """Iterate over the outcomes of the captures as they come."""
    if scheduler is None and (workers == 1 or len(todo) < 2):
        for name, each in todo.items():
            inner = None if progress is None else _of(progress, name)
            inputs = _inputs(each) if send else None
            yield name, perform(each.job, out, inputs=inputs, progress=inner, **sent)
        return
    tasks = {
        name: (each.job, out, _inputs(each) if send else None, sent) for name, each in todo.items()
    }
    yield from on_cluster(
        _performed, tasks, scheduler=scheduler, workers=workers, progress=progress
    )


def _performed(
    job: Job,
    out: str,
    inputs: dict[str, bytes] | None,
    sent: dict[str, Any],
    progress: Callable[[str, int, int], Any] | None,
) -> Outcome:
    """Carry out one job on a worker of a cluster."""
    return perform(job, out, inputs=inputs, progress=progress, **sent)


def _inputs(planned: Planned) -> dict[str, bytes]:
    job = planned.job
    edits = () if job.edits is None else (job.edits,)
    return {place: read_bytes(place) for place in (job.source, *job.markers, *edits)}


def _delivered(outcome: Outcome, out: str, *, overwrite: bool) -> Outcome:
    try:
        deliver_all(outcome.files, out, overwrite=overwrite)
    except AsterismError as error:
        return Outcome(error=str(error))
    return outcome


def _of(progress: Callable[[str, str, int, int], Any], name: str) -> Callable[[str, int, int], Any]:
    return lambda stage, done, total: progress(name, stage, done, total)


def _changed(out: str, planned: Planned) -> str:
    return (
        f"{inside(out, planned.job.output)}: expected a result of the same input, settings and "
        "versions, found another. Give overwrite to replace it."
    )


def _reason(error: BaseException) -> str:
    """Return why a task has no result."""
    if type(error).__name__ == "KilledWorker":
        return "the workers that tracked it were killed, as by a lack of memory"
    return f"{type(error).__name__}: {error}"


def _memory_of_machine(workers: int) -> int | None:
    """Return the share of the memory that each worker may use; None where it is not known."""
    names = os.sysconf_names if hasattr(os, "sysconf") else {}
    if "SC_PHYS_PAGES" not in names or "SC_PAGE_SIZE" not in names:
        return None
    return int(_SHARE * os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE") / workers)


def holds_batch(out: str) -> bool:
    """Return whether an output folder is that of a batch, which is resumed in it."""
    return is_url(out) or Path(out, TABLE).is_file() or Path(out, "runs").is_dir()


def _check_out(out: str, *, overwrite: bool) -> None:
    """Raise unless the output folder is new, empty, or that of a batch."""
    if is_url(out):
        return
    path = Path(out)
    if path.exists() and not path.is_dir():
        raise ParameterError("out", "a folder or a new name", f"the file {path}")
    if path.is_dir() and any(path.iterdir()) and not (overwrite or holds_batch(out)):
        raise ParameterError(
            "out", "a new folder, an empty one, or that of a batch", f"{path}, which holds files",
            "give overwrite to add to it",
        )  # fmt: skip
