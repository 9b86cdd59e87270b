"""``asterism sweep``: Monte Carlo studies."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from asterism.cli.console import Json, Overwrite, Quiet, print_json, print_table, progress

if TYPE_CHECKING:
    import asterism as am

__all__ = ["sweep"]

_Study = Annotated[
    Path,
    typer.Argument(metavar="STUDY.toml", help="Scenes or captures, corruptions, methods, seeds."),
]
_Out = Annotated[Path, typer.Option("--out", "-o", help="Output folder.")]
_Workers = Annotated[
    int | None,
    typer.Option(help="Cases at the same time.", show_default="the number of cores", min=1),
]
_Scheduler = Annotated[
    str | None, typer.Option(metavar="ADDRESS", help="Dask scheduler whose workers score.")
]
_DryRun = Annotated[bool, typer.Option("--dry-run", help="Count the cases, and score none.")]


def sweep(
    study: _Study,
    out: _Out,
    workers: _Workers = None,
    scheduler: _Scheduler = None,
    dry_run: _DryRun = False,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    r"""Score methods on scenes or captures, corrupted with many seeds; a stopped study is resumed.

    Writes table.csv with one row a case, summary.csv with means and 95 % confidence intervals over
    the seeds, and figure.svg. A value of the study that is a list is varied. The same line again
    scores only what has no scores yet. More than one worker needs pip install
    'asterism\[cluster]'. The exit code is 1 if a case failed.

    For example:

        asterism sweep study.toml -o results

        asterism sweep study.toml -o results --workers 4
    """
    import asterism as am
    from asterism.cli.outputs import Folder, check_outputs
    from asterism.sweep.run_sweep import CASES, FILES

    if not dry_run:
        is_sweep = (out / CASES).is_file()
        check_outputs({"--out": Folder(out, FILES)}, [study], overwrite=overwrite or is_sweep)
    made = am.sweep.read_study(study)
    if dry_run:
        n = len(made.cases())
        if json:
            print_json({"n_cases": n})
        elif not quiet:
            print_table([("cases", n)])
        return
    with progress("scoring") as advance:
        found = am.sweep.run(
            made, out, workers=workers, scheduler=scheduler, overwrite=overwrite,
            progress=lambda done, _: advance(done),
        )  # fmt: skip
    if json:
        print_json(
            {
                "output": str(out),
                "n_cases": len(found.rows),
                "n_done_before": found.n_done_before,
                "failed": found.failed,
                "summary": found.summary,
            }
        )
    elif not quiet:
        _print(found, out)
    if found.failed:
        raise typer.Exit(1)


def _print(found: am.sweep.Sweep, out: Path) -> None:
    scores = found.scores
    columns = [
        name
        for name in (found.summary[0] if found.summary else ())
        if not name.endswith(("_low", "_high"))
    ]
    rows: list[list[Any]] = []
    for row in found.summary:
        cells = [str(row[name]) for name in columns if name not in scores]
        for score in scores:
            half = row[f"{score}_high"] - row[score]
            cells.append(f"{row[score]:.4g}" + (f" ± {half:.2g}" if half == half else ""))
        rows.append(cells)
    if rows:
        print_table(rows, columns)
    for what, reason in found.failed.items():
        print_table([("failed", f"{what}: {reason}")])
    print_table([("written", out)])
