"""``asterism track``: detections in, tracks out."""

from __future__ import annotations

import dataclasses
import logging
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from asterism.app.console import Json, Overwrite, Quiet, print_json, print_table, progress
from asterism.errors import FormatError, ParameterError, check_number

if TYPE_CHECKING:
    import asterism as am
    from asterism.app.run_folder import Job
    from asterism.app.summary import Summary

log = logging.getLogger(__name__)

_In = Annotated[Path | None, typer.Argument(metavar="IN", help="Capture to track.")]
_Out = Annotated[
    Path | None,
    typer.Option(
        "--out",
        "-o",
        help="File to write; by default IN with .tracked in its name.",
    ),
]
_Format = Annotated[
    str | None, typer.Option(help="Format of the result; by default told by its name.")
]
_Method = Annotated[
    str | None,
    typer.Option(
        help="Method, one of `asterism methods`; auto chooses by the capture, and says why.",
        show_default="auto",
    ),
]
_Options = Annotated[
    list[str] | None,
    typer.Option("--option", metavar="NAME=VALUE", help="Option of the method; may be repeated."),
]
_Model = Annotated[
    Path | None,
    typer.Option(help="Model to use, TOML; by default it is estimated from the capture."),
]
_Seed = Annotated[int | None, typer.Option(help="For methods that draw.", show_default="0")]
_Start = Annotated[
    bool,
    typer.Option(
        "--start", help="Begin with the tracks that IN carries, and repair them (mcmcda)."
    ),
]
_Stitch = Annotated[
    bool,
    typer.Option(
        "--stitch",
        help="Give up hidden markers early, and tell by their neighbours which comes back.",
    ),
]
_Run = Annotated[
    Path | None,
    typer.Option(
        metavar="DIR",
        help="Folder for the result and for all that repeats the run.",
    ),
]
_From = Annotated[
    Path | None,
    typer.Option(
        "--from", metavar="RUN.TOML", help="Repeat a run; IN says where its input is now."
    ),
]
_Report = Annotated[
    Path | None, typer.Option("--report", metavar="PAGE", help="Page with a player to write too.")
]


def track(
    source: _In = None,
    out: _Out = None,
    format: _Format = None,
    method: _Method = None,
    option: _Options = None,
    model: _Model = None,
    seed: _Seed = None,
    start: _Start = False,
    stitch: _Stitch = False,
    run: _Run = None,
    overwrite: Overwrite = False,
    repeat: _From = None,
    report: _Report = None,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Tell which detection is which marker, and write the tracks.

    The model is estimated from the capture unless one is given; names in the capture play no part.
    The same input, options and seed give the same bytes.

    For example:

        asterism track trial.c3d

        asterism track trial.c3d --method gnn

        asterism track trial.c3d --method smp --option proposers=detections

        asterism track trial.c3d -o tracks.csv --model model.toml

        asterism track pieces.c3d --method mcmcda --start

        asterism track trial.c3d --stitch

        asterism track trial.c3d --report trial.html

        asterism track trial.c3d --run runs/first

        asterism track --from runs/first/run.toml -o again.c3d
    """
    import asterism as am
    from asterism.app.files import Folder, check_ending, check_outputs, read_model
    from asterism.app.run_folder import FILES, Job, sha256_of
    from asterism.app.tracking import carry_out, default_output, output_format
    from asterism.associate import AUTO
    from asterism.io.files import format_of

    check_ending("--report", report, ".html", ".htm")
    job: Job | None = None
    if repeat is not None:
        settings = {"--method": method, "--option": option, "--model": model, "--seed": seed,
                    "--start": start or None, "--stitch": stitch or None}  # fmt: skip
        job = _job_of(repeat, source, [k for k, v in settings.items() if v not in (None, [])])
        source, format = job.source, format or job.format
    if source is None:
        raise ParameterError("IN", "a capture to track", "nothing", "see asterism track --help")
    chosen_format = output_format(out, format, format_of(source).name)
    if out is None:
        out = default_output(source, chosen_format)
        out = out if run is None else run / out.name
    outputs: dict[str, Path | Folder | None] = {"--out": out, "--report": report}
    if run is not None:
        is_inside = out.resolve().parent == run.resolve()
        outputs["--run"] = Folder(run, (*FILES, out.name) if is_inside else FILES)
        outputs["--out"] = None if is_inside else out
    check_outputs(outputs, [source, model, repeat], overwrite=overwrite)
    estimate: am.ModelEstimate | None = None
    if job is not None:
        assert repeat is not None
        capture = _same_capture(job, repeat)
        job = dataclasses.replace(job, format=chosen_format)
    else:
        name, options = method or AUTO, dict[str, Any]()
        if name != AUTO:
            name, options = resolved_method(name, option or [])
        elif option:
            hint = "name the method: --method smp"
            raise ParameterError("--option", "a method to have it", f"--method {AUTO}", hint)
        check_number("--seed", seed or 0, above=0, closed=True, integer=True)
        given = None if model is None else read_model(model)
        capture = am.read(source)
        if start and name not in (AUTO, am.MCMCDA.name):
            expected = f"--method {am.MCMCDA.name} beside it, or none"
            raise ParameterError("--start", expected, f"--method {name}")
        if start and not (capture.labels >= 0).any():
            raise ParameterError("--start", "a capture with tracks", f"none in {source}")
        if given is None:
            with progress("estimating the model"):
                estimate = am.estimate_model(capture)
            given = estimate.model
        chosen = ""
        if name == AUTO:
            with progress("choosing the method"):
                choice = am.choose_method(capture, given, has_start=start)
            name, options, chosen = choice.method.name, all_options(choice.method), choice.text
            stitch = stitch or choice.stitch
        job = Job(
            source=source, sha256=sha256_of(source), method=name, options=options,
            model=am.fragment_model(given) if stitch else given, seed=seed or 0, start=start,
            stitch=stitch, format=chosen_format, chosen=chosen,
        )  # fmt: skip
    if run is not None:
        run.mkdir(parents=True, exist_ok=True)
    talks = not (quiet or json)
    if talks:
        _print_capture(capture)
        if estimate is not None:
            print_table(estimate.reasons, ("parameter", "value", "why"), title="Model")
        if job.chosen:
            print_table([("method", job.chosen)])
    tracks, summary = carry_out(job, capture, out, run)
    if report is not None:
        _write_report(tracks, report, job, summary, estimate)
    if talks:
        rows = summary.rows() + ([("report", str(report))] if report is not None else [])
        print_table(rows, title=f"\nTracked with {job.method}")
    if json:
        page = {} if report is None else {"report": str(report)}
        told = {"options": job.options, "stitch": job.stitch, "model": job.model.to_dict()}
        told |= {"chosen": job.chosen} if job.chosen else {}
        print_json(summary.to_dict() | told | page)


def all_options(method: am.Method[Any]) -> dict[str, Any]:
    """Give all options of a method."""
    from asterism.app.options import method_options

    return {option: getattr(method, option) for option in method_options(type(method))}


def resolved_method(name: str, texts: list[str]) -> tuple[str, dict[str, Any]]:
    """Check the name of a method and its ``NAME=VALUE`` options; give all, the defaults too."""
    import asterism as am
    from asterism.app.options import as_options, method_options, parsed
    from asterism.errors import check_fields

    check_fields("--method", [name], am.METHODS)
    known = method_options(am.METHODS[name])
    given = parsed("--option", f"method {name}", texts, known)
    with as_options({option: f"--option {option}" for option in given}):
        made = am.method_by_name(name, **given)
    return name, all_options(made)


def _job_of(path: Path, source: Path | None, settings: list[str]) -> Job:
    """Read the job of a run, with its input where it is now."""
    from asterism.app.run_folder import Job

    if settings:
        raise ParameterError("--from", "the settings of the run alone", ", ".join(settings))
    job = Job.from_toml(path)
    job = dataclasses.replace(job, source=source or job.source)
    if not job.source.is_file():
        hint = "say where it is now: asterism track IN --from RUN.TOML"
        raise FormatError(job.source, "the input of the run", "", "no such file", hint)
    return job


def _same_capture(job: Job, path: Path) -> am.Capture:
    """Read the capture of a run, which must be the same byte for byte."""
    import asterism as am
    from asterism.app.run_folder import sha256_of

    found = sha256_of(job.source)
    if found != job.sha256:
        raise FormatError(
            job.source, "its SHA-256", f"{job.sha256}, as {path} says", found,
            "a run can only be repeated with the same input",
        )  # fmt: skip
    return am.read(job.source)


def _write_report(
    tracks: am.Tracks,
    page: Path,
    job: Job,
    summary: Summary,
    estimate: am.ModelEstimate | None,
) -> None:
    """Write the page, with the method, its figures and the model."""
    import asterism as am

    options = ", ".join(f"{name}={value}" for name, value in job.options.items())
    told = [("method", job.method + (", then stitched" if job.stitch else ""))]
    told += [("chosen by the capture", job.chosen)] if job.chosen else []
    told += [("options", options)] if options else []
    told += summary.rows()
    made = f"Tracked with {job.method}{', then stitched,' * job.stitch} in {summary.seconds:.2g} s "
    made += f"({summary.frames_per_second:,.0f} frames a second). The model was "
    if estimate is None:
        told.append(("model", "given, not estimated"))
        made += "given."
    else:
        told += [(f"model: {name}", f"{value}: {why}") for name, value, why in estimate.reasons]
        name, value, _ = estimate.reasons[0]
        made += f"estimated from the capture ({name} {value}; all of it is below)."
    with progress("writing the report"):
        am.report(tracks, page, made=made, summary=told)


def _print_capture(capture: am.Capture) -> None:
    rate = capture.rate or (1 / capture.step if capture.step else 0.0)
    print_table(
        [(capture.path, f"{capture.n_frames} frames, {capture.n_points} points, {rate:g} Hz")]
    )
    for warning in capture.warnings:
        log.warning("%s: %s", capture.path, warning)
