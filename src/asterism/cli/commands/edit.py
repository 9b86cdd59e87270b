"""``asterism edit``: correct the tracks of a capture in the browser, or by a file of edits."""

from __future__ import annotations

import getpass
import webbrowser
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from asterism.checks import check_extra, check_number
from asterism.cli.console import Json, Overwrite, Quiet, print_json, print_table, progress
from asterism.errors import ParameterError

if TYPE_CHECKING:
    import asterism as am
    from asterism.model import Recipe

__all__ = ["edit"]

_In = Annotated[
    Path, typer.Argument(metavar="IN", help="Capture, or the folder of a run of `asterism track`.")
]
_Edits = Annotated[
    Path | None,
    typer.Option(
        "--edits",
        metavar="FILE",
        help="File of the edits, continued if it exists.",
        show_default="IN.edits.toml beside IN",
    ),
]
_Out = Annotated[
    Path | None,
    typer.Option(
        "--out", "-o", help="File that is saved.", show_default="IN with .corrected in its name"
    ),
]
_Script = Annotated[
    Path | None,
    typer.Option("--script", metavar="FILE", help="Apply these edits, save, and serve no page."),
]
_Markers = Annotated[
    list[Path] | None,
    typer.Option(
        "--markers", metavar="SET", help="Marker set that names the tracks; may be repeated."
    ),
]
_Method = Annotated[
    str | None, typer.Option(help="Method, one of `asterism methods`.", show_default="auto")
]
_Seed = Annotated[int | None, typer.Option(help="Random seed, for mcmcda.", show_default="0")]
_Port = Annotated[
    int | None,
    typer.Option(help="Port of the page.", show_default="a free one", min=1, max=65535),
]
_NoBrowser = Annotated[
    bool, typer.Option("--no-browser", help="Print the address and open no browser.")
]


def edit(
    source: _In,
    edits: _Edits = None,
    out: _Out = None,
    script: _Script = None,
    markers: _Markers = None,
    method: _Method = None,
    seed: _Seed = None,
    port: _Port = None,
    no_browser: _NoBrowser = False,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    r"""Correct the tracks of a capture in the browser; every edit is on disk when it is confirmed.

    The capture is tracked first, as by `asterism track`. The page leads from one uncertain decision
    to the next. It is served on this machine only and needs pip install 'asterism\[edit]'; Ctrl-C
    stops it. The edits also work without it: asterism track IN --edits FILE.

    For example:

        asterism edit trial.c3d

        asterism edit trial.c3d --markers subject.toml -o named.c3d

        asterism edit runs/first

        asterism edit trial.c3d --script trial.edits.toml -o corrected.c3d
    """
    import asterism as am
    from asterism.batch.result_file import output_format
    from asterism.cli.outputs import check_outputs
    from asterism.edit.server import serve
    from asterism.io.captures.files import format_of

    if script is None:
        check_extra("edit", "edit", "starlette", "uvicorn")
    elif given := [n for n, v in {"--edits": edits, "--port": port}.items() if v is not None]:
        raise ParameterError("--script", "no option of the page", ", ".join(given))
    elif no_browser:
        raise ParameterError("--script", "no option of the page", "--no-browser")
    recipe: Recipe | None = None
    folder = source if source.is_dir() else None
    if folder is not None:
        source, recipe, markers = _run_in(folder, markers, method, seed)
    if out is None:
        name = output_format(None, None, format_of(source).name)
        ending = am.io.CAPTURE_FORMATS[name].extensions[0]
        out = source.with_name(f"{source.stem}.corrected{ending}")
    format = output_format(out, None)
    inputs = [source, script, *(markers or [])]
    path = edits or script or source.with_name(f"{source.stem}.edits.toml")
    if script is None and path.is_file() and out.is_file() and not overwrite:
        hint = f"give --overwrite to go on with the edits in {path} and to save there again"
        raise ParameterError("--out", "a new file", str(out), hint)
    check_outputs({"--out": out}, inputs, overwrite=overwrite)
    if script is not None and not script.is_file():
        raise ParameterError("--script", "a file of edits", f"{script}, which does not exist")
    if edits is not None:
        check_outputs({"--edits": edits}, [source, out, *(markers or [])], overwrite=True)
    session, sets = _session(source, path, format, recipe, markers, method, seed)
    if script is not None:
        with progress("writing the result"):
            session.save(out, overwrite=overwrite)
        _print(session, source, path, out, quiet=quiet, json=json)
        return

    from asterism.edit.hub import Hub

    names = [name for each in sets or [] for name in each.full_names]

    def made() -> Hub:
        with progress("assessing the tracks"):
            return Hub(session, out, overwrite=overwrite, names=names)

    def begin(address: str) -> None:
        if json:
            print_json({"address": address, "edits": str(path), "output": str(out)})
        else:
            print_table([("edit at", address), ("edits", path), ("stop with", "Ctrl-C")])
        if not no_browser:
            webbrowser.open(address)

    serve(made, port=port or 0, begin=begin)
    if not (quiet or json):
        n = len(session.edits)
        print_table([("edits on disk", f"{n}, {path}" if n else "none")])


def _session(
    source: Path,
    path: Path,
    format: str,
    recipe: Recipe | None,
    markers: list[Path] | None,
    method: str | None,
    seed: int | None,
) -> tuple[am.edit.Session, list[am.MarkerSet] | None]:
    """Track a capture and take up its edits."""
    import asterism as am
    from asterism.cli.commands.track import made_method
    from asterism.tracking.naming.from_file import read_markers

    check_number("--seed", seed or 0, above=0, closed=True, integer=True)
    chosen = made_method(method, [])
    sets = [read_markers(each) for each in markers] if markers else None
    capture = am.read(source)
    am.io.CAPTURE_FORMATS[format].check(capture)
    if path.exists():
        am.io.read_edits(path, capture)  # an error comes before the tracking
    if recipe is None:
        with progress("estimating the model"):
            recipe = am.tracking.plan_tracking(
                capture, chosen, seed=seed or 0, marker_sets=sets
            ).recipe
    with progress(f"tracking with {recipe.method}", capture.n_frames) as advance:
        session = am.edit.Session.open(
            capture, path, recipe, marker_sets=sets, who=_user(), progress=advance
        )
    return session, sets


def _run_in(
    folder: Path, markers: list[Path] | None, method: str | None, seed: int | None
) -> tuple[Path, Recipe, list[Path]]:
    """Return the input, the recipe and the marker sets of a run."""
    from asterism.batch.run_folder import CONFIG, Run

    given = {"--markers": markers, "--method": method, "--seed": seed}
    if found := [name for name, value in given.items() if value not in (None, [])]:
        raise ParameterError("IN", "no settings beside those of the run", ", ".join(found))
    run = Run.read(folder / CONFIG)
    return Path(run.source), run.recipe, list(map(Path, run.markers))


def _user() -> str:
    """Return the name of the user of the machine, empty if it has none."""
    try:
        return getpass.getuser()
    except (KeyError, OSError):
        return ""


def _print(
    session: am.edit.Session, source: Path, path: Path, out: Path, *, quiet: bool, json: bool
) -> None:
    n = len(session.edits)
    if json:
        print_json({"input": str(source), "edits": str(path), "n_edits": n, "output": str(out)})
    elif not quiet:
        print_table([("edits", f"{n}, {path}"), ("written", out)], title="Corrected")
