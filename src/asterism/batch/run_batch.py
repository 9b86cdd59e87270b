"""A batch: many captures with the same settings, resumed after any stop."""

from __future__ import annotations

import logging
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

from asterism.batch.find import check_apart, plan_batch
from asterism.batch.index import holds_batch, write_index
from asterism.batch.job import Settings
from asterism.batch.perform import Outcome, deliver_all, perform
from asterism.batch.result_file import check_folder
from asterism.batch.storage import is_url, read_bytes
from asterism.batch.tasks import number_of_workers, run_tasks
from asterism.checks import check_extra, check_kind
from asterism.errors import AsterismError, ParameterError
from asterism.io.atomic import remove_leftovers
from asterism.records import record

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from asterism.batch.find import Planned
    from asterism.batch.job import Job

__all__ = ["Batch", "run"]

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
        Outcomes of this run by the name of the capture; results of earlier runs have none.
    left_out : tuple of str
        Other files of the folders, which are not recognised as captures.
    """

    out: str
    planned: tuple[Planned, ...]
    outcomes: dict[str, Outcome]
    left_out: tuple[str, ...] = ()

    @property
    def failed(self) -> dict[str, str]:
        """Reasons by the name of each capture that has no result."""
        return {name: each.error for name, each in self.outcomes.items() if each.error}

    @property
    def changed(self) -> dict[str, str]:
        """Reasons by the name of each capture whose result is of another input or settings.

        These results of earlier runs, or of other versions, are kept.
        """
        return {
            each.job.name: each.reason
            for each in self.planned
            if each.state == "changed" and each.job.name not in self.outcomes
        }

    @property
    def n_tracked(self) -> int:
        """Number of captures that were tracked in this run."""
        return sum(not each.error for each in self.outcomes.values())

    @property
    def n_done_before(self) -> int:
        """Number of captures with the same result of an earlier run."""
        return len(self.planned) - len(self.outcomes) - len(self.changed)

    def __repr__(self) -> str:
        changed = f"{len(self.changed)} changed, " if self.changed else ""
        return (
            f"Batch({self.n_tracked} captures tracked, {self.n_done_before} done before, "
            f"{changed}{len(self.failed)} failed)"
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
    parquet: bool = False,
    overwrite: bool = False,
    progress: Callable[[str, str, int, int], Any] | None = None,
) -> Batch:
    """Track many captures with the same settings, each in a process of its own.

    A result is finished when its summary is written. It holds the hash of the contents of the
    capture, of the marker sets and of the edits, and of the settings and the versions. A run with
    the same output folder repeats only what has no finished result with this hash. A capture that
    fails does not stop the others. A result with another hash is kept, and its capture is in
    `Batch.changed`.

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
        Whether captures are sent to the workers of the scheduler and the results come back. By
        default the workers read and write the files, at the same paths or URLs.
    memory : int, optional
        Largest memory of the process of a capture, in bytes (Linux). By default 80 % of the memory
        of this machine are shared by the workers; with a `scheduler` there is no bound.
    parquet : bool
        Whether ``summary.parquet`` is written too, which needs the extra ``parquet``.
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
        If no capture is found, an argument is impossible, the folder holds other files, or the
        scheduler is not reached.
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
    if parquet:
        check_extra("summary.parquet", "parquet", "pyarrow")
    workers = number_of_workers(workers, scheduler)
    if send and scheduler is None:
        raise ParameterError("send", "a scheduler, to whose workers captures are sent", "none")
    if memory is None and scheduler is None:
        memory = _memory_of_machine(workers)
    place, captures = str(out), [str(source) for source in sources]
    check_apart(captures, place)
    if not is_url(place):
        check_folder(place, "a batch", allowed=overwrite or holds_batch(place))
    planned, left_out = plan_batch(
        captures, place, settings, markers=[str(m) for m in markers],
        progress=None if progress is None else lambda n, of: progress("", "examining", n, of),
    )  # fmt: skip
    jobs = [each.job for each in planned]
    outcomes = {
        each.job.name: Outcome(error=each.reason) for each in planned if each.state == "failed"
    }
    batch = Batch(out=place, planned=tuple(planned), outcomes=outcomes, left_out=tuple(left_out))
    write_index(place, jobs, batch.failed, batch.changed, parquet=parquet, overwrite=overwrite)
    todo: dict[str, Job] = {}
    for each in planned:
        job = each.job
        if each.state == "new" or (each.state == "changed" and overwrite):
            todo[job.name] = job
        elif progress is not None:
            progress(job.name, "failed" if each.state == "failed" else "done", 0, 0)

    def arguments(name: str) -> tuple[Any, ...]:
        inputs = {file: read_bytes(file) for file in todo[name].inputs} if send else None
        return todo[name], place, inputs, memory, overwrite

    for name, result in run_tasks(
        perform, list(todo), arguments, scheduler=scheduler, workers=workers, progress=progress
    ):
        outcome = _delivered(result, todo[name], place, overwrite=overwrite)
        outcomes[name] = outcome
        for text in outcome.warnings:
            log.warning("%s", text)
        if progress is not None:
            progress(name, "failed" if outcome.error else "done", 0, 0)
    if not is_url(place):
        remove_leftovers(Path(place))
    write_index(place, jobs, batch.failed, batch.changed, parquet=parquet, overwrite=overwrite)
    return batch


def _delivered(result: Any, job: Job, out: str, *, overwrite: bool) -> Outcome:
    """Return the outcome of a task, after the files that came with it are written."""
    if isinstance(result, AsterismError):
        return Outcome(error=str(result))
    if isinstance(result, BaseException):
        reason = f"{type(result).__name__}: {result}"
        if type(result).__name__ == "KilledWorker":
            reason = "the workers that tracked it were killed, as by a lack of memory"
        return Outcome(error=f"{job.source}: {reason}")
    try:
        deliver_all(result.files, out, overwrite=overwrite)
    except AsterismError as error:
        return Outcome(error=str(error))
    return result


def _memory_of_machine(workers: int) -> int | None:
    """Return the share of the memory that each worker may use; None where it is not known."""
    names = os.sysconf_names if hasattr(os, "sysconf") else {}
    if "SC_PHYS_PAGES" not in names or "SC_PAGE_SIZE" not in names:
        return None
    return int(_SHARE * os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE") / workers)
