"""``asterism track``: tracks from the detections of a capture."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from asterism.checks import check_number
from asterism.cli.console import Json, Overwrite, Quiet, print_json, print_table, progress
from asterism.errors import FormatError, ParameterError

if TYPE_CHECKING:
    import asterism as am
    from asterism.batch.run_folder import Run
    from asterism.cli.outputs import Folder
    from asterism.model import Recipe


_In = Annotated[Path | None, typer.Argument(metavar="IN", help="Capture to track.")]
_Out = Annotated[
    Path | None,
    typer.Option(
        "--out",
        "-o",
        help="File to write.",
        show_default="IN with .tracked in its name",
    ),
]
_Format = Annotated[
    str | None, typer.Option(help="Format of the result.", show_default="from its name")
]
_Method = Annotated[
    str | None,
    typer.Option(
        help="Method, one of `asterism methods`; auto selects one from the capture.",
        show_default="auto",
    ),
]
_Options = Annotated[
    list[str] | None,
    typer.Option("--option", metavar="NAME=VALUE", help="Option of the method; may be repeated."),
]
_Model = Annotated[
    Path | None,
    typer.Option(help="Model, TOML.", show_default="estimated from the capture"),
]
_Seed = Annotated[int | None, typer.Option(help="Random seed, for mcmcda.", show_default="0")]
_Start = Annotated[
    bool,
    typer.Option("--start", help="Start from the tracks in IN and correct them, with mcmcda."),
]
_Stitch = Annotated[
    bool,
    typer.Option(
        "--stitch",
        help="Make short tracklets and stitch them through occlusions, whatever auto selects.",
    ),
]
_Markers = Annotated[
    list[Path] | None,
    typer.Option(
        "--markers",
        metavar="SET",
        help="Marker set that names the tracks (TOML, VSK, VST), or a labelled capture; "
        "one for each subject.",
    ),
]
_Edits = Annotated[
    list[Path] | None,
    typer.Option(
        "--edits",
        metavar="FILE",
        help="Edits that the tracks respect, as `asterism edit` writes them; may be repeated.",
    ),
]
_Fill = Annotated[bool, typer.Option("--fill", help="Fill the gaps of the tracks.")]
_Run = Annotated[
    Path | None,
    typer.Option(
        metavar="DIR",
        help="Folder for the result, the settings and the log of the run.",
    ),
]
_From = Annotated[
    Path | None,
    typer.Option(
        "--from", metavar="RUN.TOML", help="Repeat a run. IN is needed only if its input has moved."
    ),
]
_Report = Annotated[
    Path | None,
    typer.Option("--report", metavar="PAGE", help="HTML page to write, with a player."),
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
    markers: _Markers = None,
    edits: _Edits = None,
    fill: _Fill = False,
    run: _Run = None,
    overwrite: Overwrite = False,
    repeat: _From = None,
    report: _Report = None,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Track the detections of a capture, and write the tracks.

    Model and method are estimated from the capture unless they are given. Without marker sets,
    tracks take the names that the capture has itself, where its distances do not contradict them.
    The same input, options and seed give the same bytes.

    For example:

        asterism track trial.c3d

        asterism track trial.c3d --method gnn

        asterism track trial.c3d --method smp --option proposers=detections

        asterism track trial.c3d -o tracks.csv --model model.toml

        asterism track tracklets.c3d --method mcmcda --start

        asterism track trial.c3d --stitch

        asterism track trial.c3d --report trial.html

        asterism track trial.c3d --markers subject.toml --fill

        asterism track trial.c3d --edits trial.edits.toml

        asterism track trial.c3d --run runs/first

        asterism track --from runs/first/run.toml -o again.c3d
    """
    import asterism as am
    from asterism.batch.carry_out import carry_out
    from asterism.batch.page import write_page
    from asterism.batch.result_file import default_output, output_format
    from asterism.batch.run_folder import Run
    from asterism.cli.outputs import check_ending, check_outputs, read_model
    from asterism.io.captures.files import format_of
    from asterism.tracking.naming.from_file import read_markers

    check_ending("--report", report, ".html", ".htm")
    job: Run | None = None
    if repeat is not None:
        settings = {"--method": method, "--option": option, "--model": model, "--seed": seed,
                    "--start": start or None, "--stitch": stitch or None,
                    "--fill": fill or None}  # fmt: skip
        job = _run_of(repeat, source, [k for k, v in settings.items() if v not in (None, [])])
        source, format = Path(job.source), format or job.format
        markers = markers or list(map(Path, job.markers))
        edits = edits or list(map(Path, job.edits))
    if source is None:
        raise ParameterError("IN", "a capture to track", "nothing", "see asterism track --help")
    chosen_format = output_format(out, format, format_of(source).name)
    if out is None:
        out = default_output(source, chosen_format)
        out = out if run is None else run / out.name
    outputs = _outputs(out, run) | {"--report": report}
    check_outputs(
        outputs, [source, model, repeat, *(markers or []), *(edits or [])], overwrite=overwrite
    )
    sets = [read_markers(path) for path in markers] if markers else None
    chosen_method = made_method(method, option or [])
    check_number("--seed", seed or 0, above=0, closed=True, integer=True)
    given = None if model is None else read_model(model)
    capture = am.read(source)
    am.io.CAPTURE_FORMATS[chosen_format].check(capture)
    stated = [edit for path in edits or [] for edit in am.io.read_edits(path, capture)]
    if job is not None:
        assert repeat is not None
        recipe, estimate = _checked(job, capture, sets, stated, repeat), None
    else:
        if start:
            _check_start(method, capture, source)
        with progress("estimating the model"):
            plan = am.tracking.plan_tracking(
                capture, chosen_method, model=given, stitch=True if stitch else "auto",
                seed=seed or 0, start=capture.tracks if start else None,
                marker_sets=sets, edits=stated, fill=fill,
            )  # fmt: skip
        recipe, estimate = plan.recipe, plan.estimate
    if run is not None:
        run.mkdir(parents=True, exist_ok=True)
    prints = not (quiet or json)
    if prints:
        _print_capture(capture)
        if estimate is not None:
            _print_model(estimate, recipe)
        if recipe.chosen:
            print_table([("method", recipe.chosen)])
    job = Run(
        recipe=recipe, source=str(source), format=chosen_format,
        markers=tuple(map(str, markers or [])), edits=tuple(map(str, edits or [])),
    )  # fmt: skip
    with progress(f"tracking with {recipe.method}", capture.n_frames) as advance:
        result, summary = carry_out(
            job, capture, out, folder=run, marker_sets=sets, edits=stated, progress=advance
        )
    if report is not None:
        with progress("writing the report"):
            write_page(result, report, estimate, summary)
    if prints:
        if result.estimate is not None:
            _print_model(result.estimate, result.recipe, above="\n")
        if result.recipe.chosen != recipe.chosen:
            print_table([("method", result.recipe.chosen)])
        rows = summary.rows()
        rows += [("report", str(report))] if report is not None else []
        print_table(rows, title=f"\nTracked with {result.recipe.method}")
    if json:
        page = {} if report is None else {"report": str(report)}
        print_json(summary.to_dict() | _settings_of(result.recipe) | page)


def _print_model(
    estimate: am.tracking.ModelEstimate, recipe: am.model.Recipe, above: str = ""
) -> None:
    rest = ", without the motion in common" if recipe.common_motion else ""
    print_table(estimate.reasons, ("parameter", "value", "why"), title=f"{above}Model{rest}")


def _check_start(method: str | None, capture: am.Capture, source: Path) -> None:
    """Raise unless the capture has tracks from which the method can start."""
    import asterism as am

    if method not in (None, am.tracking.AUTO, am.MCMCDA.name):
        expected = f"--method {am.MCMCDA.name}, or no --method"
        raise ParameterError("--start", expected, f"--method {method}")
    if not (capture.labels >= 0).any():
        raise ParameterError("--start", "a capture with tracks", f"none in {source}")


def _settings_of(recipe: Recipe) -> dict[str, Any]:
    """Return the settings of a recipe as plain values."""
    settings = {
        "options": recipe.options,
        "stitch": recipe.stitch,
        "model": recipe.model.to_dict(),
    }
    return settings | ({"chosen": recipe.chosen} if recipe.chosen else {})


def _outputs(out: Path, run: Path | None) -> dict[str, Path | Folder | None]:
    """Return the outputs by option; the tracks may be in the folder of the run."""
    from asterism.batch.run_folder import FILES
    from asterism.cli.outputs import Folder

    if run is None:
        return {"--out": out}
    is_inside = out.resolve().parent == run.resolve()
    folder = Folder(run, (*FILES, out.name) if is_inside else FILES)
    return {"--run": folder, "--out": None if is_inside else out}


def made_method(name: str | None, texts: list[str]) -> am.tracking.Method[Any] | None:
    """Make a method from its name and its ``NAME=VALUE`` options; None for ``auto``."""
    import asterism as am
    from asterism.checks import check_fields
    from asterism.cli.options import as_options, nested, parsed, record_options

    if name in (None, am.tracking.AUTO):
        if texts:
            expected = "a method that has it"
            hint = "give the method, such as --method smp"
            raise ParameterError("--option", expected, f"--method {am.tracking.AUTO}", hint)
        return None
    check_fields("--method", [name], [am.tracking.AUTO, *am.tracking.METHODS])
    known = record_options(am.tracking.METHODS[name])
    given = parsed("--option", f"method {name}", texts, known)
    with as_options({option: f"--option {option}" for option in given}):
        return am.tracking.method_by_name(name, **nested(given, known))


def _run_of(path: Path, source: Path | None, settings: list[str]) -> Run:
    """Read a run, with the present path of its input."""
    from asterism.batch.run_folder import Run

    if settings:
        raise ParameterError("--from", "no settings beside those of the run", ", ".join(settings))
    job = Run.read(path)
    job = dataclasses.replace(job, source=job.source if source is None else str(source))
    if not Path(job.source).is_file():
        hint = "give its new path: asterism track IN --from RUN.TOML"
        raise FormatError(Path(job.source), "the input of the run", "", "no such file", hint)
    return job


def _checked(
    job: Run,
    capture: am.Capture,
    sets: list[am.MarkerSet] | None,
    edits: list[am.model.Edit],
    path: Path,
) -> Recipe:
    """Return the recipe of a run, if the capture, the marker sets and the edits are its input."""
    from asterism.model.recipe import hash_of_edits, sha256_of
    from asterism.tracking.plan import hash_of_names

    recipe = job.recipe
    if (found := hash_of_names(capture, sets)) != recipe.markers:
        expected = f"those of {path}, SHA-256 {recipe.markers}" if recipe.markers else "none"
        raise ParameterError("--markers", expected, found or "none")
    if (found := hash_of_edits(edits)) != recipe.edits:
        expected = f"those of {path}, SHA-256 {recipe.edits}" if recipe.edits else "none"
        raise ParameterError("--edits", expected, found or "none")
    found = sha256_of(capture, capture.labels if recipe.has_start else None)
    if found != recipe.sha256:
        raise FormatError(
            Path(job.source), "SHA-256 of its points", f"{recipe.sha256} of {path}", found,
            "repeat the run with the same input",
        )  # fmt: skip
    return recipe


def _print_capture(capture: am.Capture) -> None:
    rate = capture.rate or (1 / capture.step if capture.step else 0.0)
    print_table(
        [(capture.path, f"{capture.n_frames} frames, {capture.n_points} points, {rate:g} Hz")]
    )
