"""``asterism batch``: track many captures with the same settings."""

from __future__ import annotations

from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from asterism.cli.console import Json, Overwrite, Quiet, console, print_json, print_table

if TYPE_CHECKING:
    from collections.abc import Callable, Generator, Sequence

    import asterism as am

__all__ = ["batch"]

_In = Annotated[
    list[str], typer.Argument(metavar="IN", help="Captures and folders, by path or URL.")
]
_Out = Annotated[str, typer.Option("--out", "-o", help="Output folder, by path or URL.")]
_Method = Annotated[
    str | None, typer.Option(help="Method, one of `asterism methods`.", show_default="auto")
]
_Option = Annotated[
    list[str] | None,
    typer.Option("--option", metavar="NAME=VALUE", help="Option of the method; may be repeated."),
]
_Model = Annotated[
    Path | None,
    typer.Option(metavar="FILE.toml", help="Tracking model.", show_default="of each capture"),
]
_Markers = Annotated[
    list[str] | None,
    typer.Option(
        "--markers", metavar="SET", help="Marker set of all captures; may be repeated.",
        show_default="the nearest markers.toml",
    ),
]  # fmt: skip
_Stitch = Annotated[bool, typer.Option("--stitch", help="Join tracks through gaps.")]
_Seed = Annotated[int, typer.Option(help="Random seed, for mcmcda.")]
_Fill = Annotated[bool, typer.Option("--fill", help="Fill the gaps.")]
_NoReport = Annotated[bool, typer.Option("--no-report", help="Write no page for each capture.")]
_Format = Annotated[
    str | None, typer.Option(help="Format of the results.", show_default="of each capture")
]
_Workers = Annotated[
    int | None,
    typer.Option(help="Captures at the same time.", show_default="the number of cores", min=1),
]
_Scheduler = Annotated[
    str | None, typer.Option(metavar="ADDRESS", help="Dask scheduler whose workers track.")
]
_Send = Annotated[
    bool, typer.Option("--send", help="Send captures to workers that do not share the files.")
]
_Memory = Annotated[
    float | None,
    typer.Option(metavar="GB", help="Memory of each capture.", show_default="80 % / workers"),
]
_Parquet = Annotated[bool, typer.Option("--parquet", help="Write summary.parquet too.")]
_DryRun = Annotated[bool, typer.Option("--dry-run", help="List the captures, and track none.")]


def batch(
    sources: _In,
    out: _Out,
    method: _Method = None,
    option: _Option = None,
    model: _Model = None,
    markers: _Markers = None,
    stitch: _Stitch = False,
    seed: _Seed = 0,
    fill: _Fill = False,
    no_report: _NoReport = False,
    format: _Format = None,
    workers: _Workers = None,
    scheduler: _Scheduler = None,
    send: _Send = False,
    memory: _Memory = None,
    parquet: _Parquet = False,
    dry_run: _DryRun = False,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    r"""Track many captures, each in a process of its own; a stopped batch is resumed.

    The same line again tracks only what has no finished result of the same input and settings. A
    file markers.toml in a folder names the tracks of its captures, and trial.edits.toml corrects
    those of trial.c3d. The results, index.html and summary.csv are in the output folder. More than
    one worker needs pip install 'asterism\[cluster]'. The exit code is 1 if a capture failed, or
    has a result of another input or other settings, which is kept without --overwrite.

    For example:

        asterism batch captures -o tracked

        asterism batch captures -o tracked --fill --workers 4

        asterism batch captures -o tracked --dry-run

        asterism batch captures -o tracked --scheduler tcp://node1:8786
    """
    import asterism as am
    from asterism.batch.find import check_apart
    from asterism.batch.index import holds_batch
    from asterism.batch.storage import is_url
    from asterism.checks import check_number
    from asterism.cli.commands.track import made_method
    from asterism.cli.outputs import Folder, check_outputs, read_model
    from asterism.tracking.methods import options_of

    if memory is not None:
        check_number("--memory", memory, above=0)
    check_apart(sources, out)
    if not (dry_run or is_url(out)):
        folder = Folder(Path(out))
        check_outputs({"--out": folder}, [], overwrite=overwrite or holds_batch(out))
    made = made_method(method, option or [])
    settings = am.batch.Settings(
        method=None if made is None else made.name,
        options={} if made is None else options_of(made),
        model=None if model is None else read_model(model),
        stitch=True if stitch else "auto",
        seed=seed, fill=fill, report=not no_report, format=format,
    )  # fmt: skip
    if dry_run:
        planned, left_out = am.batch.plan_batch(sources, out, settings, markers=markers or [])
        _print_plan(planned, left_out, quiet=quiet, json=json)
        return
    with _shown() as show:
        done = am.batch.run(
            sources, out, settings, markers=markers or [], workers=workers, scheduler=scheduler,
            send=send, memory=None if memory is None else int(memory * 1e9), parquet=parquet,
            overwrite=overwrite, progress=show,
        )  # fmt: skip
    if json:
        values = {
            "output": out, "n_captures": len(done.planned), "n_tracked": done.n_tracked,
            "n_done_before": done.n_done_before, "changed": done.changed, "failed": done.failed,
            "left_out": list(done.left_out),
        }  # fmt: skip
        print_json(values)
    elif not quiet:
        _print(done)
    if done.failed or done.changed:
        raise typer.Exit(1)


@contextmanager
def _shown() -> Generator[Callable[[str, str, int, int], None], None, None]:
    """Show the progress of all captures and of each on stderr, if it is a terminal."""
    from rich.progress import Progress, TaskID

    screen = console(stderr=True)
    with Progress(console=screen, transient=True, disable=not screen.is_terminal) as bars:
        whole = bars.add_task("captures", total=None)
        rows: dict[str, TaskID] = {}

        def show(name: str, stage: str, done: int, total: int) -> None:
            if not name:
                bars.update(whole, description=stage, completed=done, total=total)
            elif stage in ("done", "failed"):
                if name in rows:
                    bars.remove_task(rows.pop(name))
                if bars.tasks[0].description != "captures":  # the examination has ended
                    bars.update(whole, description="captures", completed=0)
                bars.advance(whole)
            else:
                if name not in rows:
                    rows[name] = bars.add_task(name)
                bars.update(
                    rows[name], description=f"{name}: {stage}", completed=done, total=total or None
                )

        yield show


def _print_plan(
    planned: Sequence[am.batch.Planned], left_out: Sequence[str], *, quiet: bool, json: bool
) -> None:
    if json:
        rows = [
            {
                "capture": each.job.source,
                "state": each.state,
                "reason": each.reason,
                "output": each.job.output,
                "markers": list(each.job.markers),
                "edits": each.job.edits,
            }
            for each in planned
        ]
        print_json({"captures": rows, "left_out": left_out})
    elif not quiet:
        header = ("capture", "state", "result", "markers", "edits")
        table = [
            (
                each.job.source, each.reason if each.state == "failed" else each.state,
                each.job.output, ", ".join(each.job.markers) or "–", each.job.edits or "–",
            )
            for each in planned
        ]  # fmt: skip
        print_table(table, header)
        if left_out:
            print_table(_left_out(left_out))


def _left_out(files: Sequence[str]) -> list[tuple[str, str]]:
    """Return the files that are not recognised as captures as rows of a printed table."""
    from asterism.batch.find import first_of

    if not files:
        return []
    rows = [("left out", f"{len(files):,}, not recognised as captures")]
    return rows + [("", name) for name in first_of(files)]


def _print(done: am.batch.Batch) -> None:
    from asterism.batch.find import first_of
    from asterism.batch.index import INDEX
    from asterism.batch.storage import inside

    rows: list[tuple[str, Any]] = [("tracked", done.n_tracked)]
    rows += [("done before", done.n_done_before)] if done.n_done_before else []
    if done.changed:
        rows.append(
            ("changed", f"{len(done.changed)}, of another input, settings or versions: kept")
        )
        rows += [("", line) for line in first_of(list(done.changed))]
        rows.append(("", "Give --overwrite to track them again, or another --out to keep both."))
    rows += [("failed", len(done.failed))] if done.failed else []
    rows += [("", why if key in why else f"{key}: {why}") for key, why in done.failed.items()]
    rows += _left_out(done.left_out)
    took = [each for each in done.outcomes.values() if not each.error]
    if took:
        slowest = max(each.seconds for each in took)
        rows.append(("time", f"{sum(e.seconds for e in took):.3g} s, at most {slowest:.3g} s"))
        if peak := max(each.peak_bytes for each in took):
            rows.append(("memory", f"at most {peak / 1e6:,.0f} MB for a capture"))
    print_table([*rows, ("index", inside(done.out, INDEX))], title="Batch")
