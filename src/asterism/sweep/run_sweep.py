"""A sweep: all cases of a study, resumed after any stop."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

from asterism.batch.result_file import check_folder
from asterism.batch.tasks import number_of_workers, run_tasks
from asterism.checks import check_kind
from asterism.errors import not_written
from asterism.io.atomic import replacing
from asterism.plot.export import write_figure
from asterism.plot.sweep import plot_sweep
from asterism.records import record
from asterism.sweep.score import score_case
from asterism.sweep.study import Study
from asterism.sweep.table import as_csv, rows_of, summarize

if TYPE_CHECKING:
    from collections.abc import Callable

    from asterism.sweep.study import Case

__all__ = ["CASES", "FILES", "Sweep", "run"]

CASES = "cases.jsonl"
FILES = CASES, "table.csv", "summary.csv", "figure.svg"


@record(eq=False)
class Sweep:
    """Result of a sweep.

    Parameters
    ----------
    rows : list of dict
        One row a case: names, varied values, seed and scores.
    summary : list of dict
        One row a condition: the mean over the seeds, and a 95 % confidence interval.
    scores : tuple of str
        Names of the scores.
    n_done_before : int
        Number of cases with scores of an earlier run.
    failed : dict of str
        Reasons by the description of each case without scores.
    """

    rows: list[dict[str, Any]]
    summary: list[dict[str, Any]]
    scores: tuple[str, ...]
    n_done_before: int
    failed: dict[str, str]

    def __repr__(self) -> str:
        return f"Sweep({len(self.rows)} cases, {len(self.failed)} failed)"


def run(
    study: Study,
    out: str | Path,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    overwrite: bool = False,
    progress: Callable[[int, int], Any] | None = None,
) -> Sweep:
    """Score all cases of a study, and write the tables and a figure.

    The scores of each case are on disk before the next is awaited, with a hash of its settings, of
    its capture and of the versions; a later run with the same folder scores only the others.

    Parameters
    ----------
    study : Study
        Scenes or captures, corruptions, methods and seeds.
    out : path
        Folder for ``cases.jsonl``, ``table.csv``, ``summary.csv`` and ``figure.svg``.
    workers : int, optional
        Number of cases at the same time. More than one needs the extra ``cluster``, with which the
        number of cores is the default; it is 1 without.
    scheduler : str, optional
        Address of a Dask scheduler whose workers score the cases.
    overwrite : bool
        Whether the folder may hold other files.
    progress : callable, optional
        Called with the number of finished cases, and of all.

    Returns
    -------
    Sweep

    Raises
    ------
    ParameterError
        If an argument is impossible, or the scheduler is not reached.
    FormatError
        If a capture cannot be read, or a file cannot be written.

    Examples
    --------
    >>> import asterism as am, tempfile
    >>> study = am.sweep.Study(
    ...     scenes={"cube": {"scene": "cube", "frames": 30}},
    ...     methods={"gnn": {"method": "gnn"}},
    ...     seeds=(1, 2),
    ... )
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     sweep = am.sweep.run(study, folder, workers=1)
    >>> sweep.summary[0]["idf1"]
    1.0
    """
    check_kind("study", study, Study, "am.sweep.read_study(path)")
    folder = Path(out)
    workers = number_of_workers(workers, scheduler)
    check_folder(str(folder), "a sweep", allowed=overwrite or (folder / CASES).is_file())
    cases = study.cases()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        known = _read(folder / CASES)
        todo = {case.key: case for case in cases if case.key not in known}
        n_before, failed = len(cases) - len(todo), dict[str, str]()
        with (folder / CASES).open("a", encoding="utf-8") as file:
            if file.tell() and not (folder / CASES).read_bytes().endswith(b"\n"):
                file.write("\n")  # the line of a run that was stopped while it wrote
            results = run_tasks(
                score_case, list(todo), lambda key: (todo[key], study.scores),
                scheduler=scheduler, workers=workers,
            )  # fmt: skip
            for n, (key, found) in enumerate(results):
                if isinstance(found, BaseException):
                    failed[_described(todo[key])] = str(found) or type(found).__name__
                else:
                    known[key] = found
                    file.write(json.dumps({"key": key, "scores": found}) + "\n")
                    file.flush()
                    os.fsync(file.fileno())
                if progress is not None:
                    progress(n_before + n + 1, len(cases))
    except OSError as error:
        raise not_written(folder, error) from error
    rows = rows_of(cases, known, study.scores)
    summary = summarize(rows, study.scores)
    for name, content in (("table.csv", rows), ("summary.csv", summary)):
        with replacing(folder / name) as table:
            table.write(as_csv(content))
    if summary:
        write_figure(plot_sweep(summary, study.scores), folder / "figure.svg")
    return Sweep(
        rows=rows, summary=summary, scores=study.scores, n_done_before=n_before, failed=failed
    )


def _read(path: Path) -> dict[str, dict[str, float]]:
    """Return the scores of earlier runs by key; an unfinished line is left out."""
    known: dict[str, dict[str, float]] = {}
    if not path.is_file():
        return known
    for line in path.read_text(encoding="utf-8").splitlines():
        try:
            values = json.loads(line)
        except ValueError:
            continue
        known[values["key"]] = values["scores"]
    return known


def _described(case: Case) -> str:
    varied = "".join(f", {name}={value}" for name, value in case.varied.items())
    return f"{case.scene}, {case.corruption}, {case.method}{varied}, seed {case.seed}"
