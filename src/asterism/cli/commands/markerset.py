"""``asterism markerset``: learn, show, check and merge the marker sets of subjects."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from asterism.cli.console import Json, Overwrite, Quiet, print_json, print_table

if TYPE_CHECKING:
    import asterism as am

__all__ = ["app"]

app = typer.Typer(
    name="markerset",
    help="Learn, show, check and merge marker sets: the named markers of a subject.",
    no_args_is_help=True,
)

_Captures = Annotated[
    list[Path], typer.Argument(metavar="IN...", help="Captures of one subject with named tracks.")
]
_Out = Annotated[Path, typer.Option("--out", "-o", help="Marker set to write, TOML.")]
_Subject = Annotated[
    str | None,
    typer.Option(help="Use only this subject's markers, those named SUBJECT:NAME."),
]
_Set = Annotated[Path, typer.Argument(metavar="SET", help="Marker set, TOML, VSK or VST.")]
_SetOrCapture = Annotated[
    Path,
    typer.Argument(metavar="SET", help="Marker set, TOML, VSK or VST, or a labelled capture."),
]
_Sets = Annotated[
    list[Path], typer.Argument(metavar="SET...", help="Marker sets of different subjects.")
]
_Checked = Annotated[list[Path], typer.Argument(metavar="IN...", help="Captures with names.")]


@app.command()
def learn(
    captures: _Captures,
    out: _Out,
    subject: _Subject = None,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Learn the marker set of one subject from labelled captures.

    A static trial or a single labelled frame is enough. A capture of the moving subject also tells
    which distances are rigid.

    For example:

        asterism markerset learn static.c3d -o ann.toml

        asterism markerset learn static.c3d walk.c3d -o ann.toml
    """
    import asterism as am
    from asterism.cli.outputs import check_ending, check_outputs
    from asterism.tracking.naming.from_file import labelled_tracks

    check_ending("--out", out, ".toml")
    check_outputs({"--out": out}, captures, overwrite=overwrite)
    made = am.learn_marker_set(*[labelled_tracks(path, subject) for path in captures])
    made.to_toml(out)
    _print(made, {"inputs": [str(path) for path in captures], "output": str(out)}, quiet, json)


@app.command()
def show(path: _Set, quiet: Quiet = False, json: Json = False) -> None:
    """Show the markers, segments, sides and partners of a marker set.

    For example:

        asterism markerset show ann.toml
    """
    import asterism as am

    _print(am.read_marker_set(path), {"input": str(path)}, quiet, json)


@app.command()
def merge(
    paths: _Sets,
    out: _Out,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Merge the marker sets of several subjects into one for other subjects.

    For example:

        asterism markerset merge ann.toml ben.toml cleo.toml -o protocol.toml
    """
    import asterism as am
    from asterism.cli.outputs import check_ending, check_outputs

    check_ending("--out", out, ".toml")
    check_outputs({"--out": out}, paths, overwrite=overwrite)
    made = am.merge_marker_sets(*[am.read_marker_set(path) for path in paths])
    made.to_toml(out)
    _print(made, {"inputs": [str(path) for path in paths], "output": str(out)}, quiet, json)


@app.command()
def check(
    path: _SetOrCapture, captures: _Checked, quiet: Quiet = False, json: Json = False
) -> None:
    """List the stretches in which names of captures contradict a marker set; exit code 1 if any do.

    SET may be a labelled capture. It should not be IN itself, where labels that are wrong in most
    frames count as right.

    For example:

        asterism markerset check protocol.toml walk.c3d turn.c3d

        asterism markerset check static.c3d walk.c3d
    """
    import asterism as am
    from asterism.reporting.names_found import conflict_figures
    from asterism.tracking.naming.from_file import labelled_tracks, read_markers

    made = read_markers(path, option="SET")
    rows: list[tuple[str, ...]] = []
    plain: list[dict[str, Any]] = []
    for source in captures:
        tracks = labelled_tracks(source, None)
        capture = tracks.detections
        at = capture.first_frame if isinstance(capture, am.Capture) else 0
        conflicts = am.tracking.check_names(tracks, made)
        plain += [{"capture": str(source)} | own for own in conflict_figures(conflicts, at)]
        for conflict in conflicts:
            frames = f"{at + conflict.first} to {at + conflict.last}"
            found = conflict.found or "none"
            rows.append((source.name, conflict.name, frames, found, f"{conflict.probability:.0%}"))
    if json:
        print_json({"marker_set": str(path), "conflicts": plain})
    elif rows and not quiet:
        head = ("capture", "name", "frames", "by the set", "probability")
        print_table(rows, head, title="Names that contradict the marker set")
    elif not quiet:
        print_table([("names that contradict the marker set", "none")])
    if rows:
        raise typer.Exit(1)


def _print(made: am.MarkerSet, files: dict[str, Any], quiet: bool, json: bool) -> None:
    segments: dict[str, list[str]] = {}
    for name, segment in zip(made.names, made.segments, strict=True):
        segments.setdefault(segment or "no segment", []).append(name)
    pairs = [(m, p) for m, p in enumerate(made.partners) if m < p]
    if json:
        markers = [
            {
                "name": name,
                "segment": made.segments[m],
                "side": made.sides[m],
                "partner": made.names[made.partners[m]] if made.partners[m] >= 0 else None,
            }
            for m, name in enumerate(made.names)
        ]
        figures = {"subject": made.subject, "n_subjects": made.n_subjects}
        figures |= {"knows_movement": made.knows_movement, "markers": markers}
        print_json(files | figures)
    elif not quiet:
        rows = [("markers", str(len(made)))]
        rows += [("subject", made.subject)] if made.subject else []
        rows += [
            ("subjects", str(made.n_subjects)),
            ("learnt from", "moving subjects" if made.knows_movement else "one posture"),
            ("left and right", f"{len(pairs)} pairs"),
        ]
        rows += [(segment, " ".join(names)) for segment, names in segments.items()]
        rows += [("written", files["output"])] if "output" in files else []
        print_table(rows, title="Marker set")
