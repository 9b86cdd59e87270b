"""``asterism camera``: description, conversion and check of calibrations."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from asterism.checks import check_fields
from asterism.cli.calibration_options import (
    CalibrationFile,
    FromFormat,
    LengthUnits,
    read_calibration,
)
from asterism.cli.commands.camera_map import map_
from asterism.cli.console import Json, Overwrite, Quiet, print_json, print_table
from asterism.cli.options import with_option_names

if TYPE_CHECKING:
    from asterism.camera.lens_fit import LensFit
    from asterism.io.calibrations import CalibrationFormat
    from asterism.multiview.rig_check import Check
    from asterism.multiview.rig_info import CameraInfo

__all__ = ["app"]

app = typer.Typer(
    name="camera",
    help="Describe, check and convert calibrations of cameras.",
    no_args_is_help=True,
)

_Out = Annotated[Path, typer.Argument(metavar="OUT", help="File or new folder to write.")]
_Format = Annotated[
    str | None,
    typer.Option(
        "--format", metavar="FORMAT", help="Format to write.", show_default="from the name"
    ),
]
_LensOption = Annotated[
    str,
    typer.Option(
        "--lens",
        metavar="auto|brown|vicon|report|none",
        help="Lens model to write. auto keeps the lens unless the format cannot hold it.",
    ),
]
_Points = Annotated[
    list[str] | None,
    typer.Option(
        metavar="[CAMERA=]FILE",
        help="Known points and their pixels; may be repeated.",
        show_default=False,
    ),
]
_PointUnits = Annotated[
    str | None, typer.Option(metavar="mm|cm|m", help="Unit of the known points.")
]
_Most = Annotated[
    float, typer.Option("--max-px", help="Largest median reprojection error that passes, pixels.")
]


@app.command()
def info(
    calibration: CalibrationFile,
    from_format: FromFormat = None,
    units: LengthUnits = None,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Describe the cameras of a calibration: lens, position, direction and field of view.

    Angles are in degrees, lengths in metres. The shift is the largest displacement of a pixel by
    the lens. The reach is the share of the image for which the lens model is valid.

    For example:

        asterism camera info walk.xcp

        asterism camera info calibration.toml --units mm --json
    """
    from asterism.multiview.rig_info import describe_rig

    rig = read_calibration(calibration, from_format, units)
    cameras, whole = describe_rig(rig)
    if json:
        print_json({"calibration": str(calibration), **whole,
                    "cameras": [dataclasses.asdict(c) for c in cameras],
                    "warnings": list(rig.warnings)})  # fmt: skip
    elif not quiet:
        title = f"{calibration}: {len(rig)} cameras"
        print_table((_row(c) for c in cameras), _COLUMNS, title=title)
        rows = [(key.replace("_", " "), _text(value)) for key, value in whole.items()]
        print_table([*rows, *_warnings(rig.warnings)])


_COLUMNS = ("camera", "size", "focal px", "field °", "position", "looks at", "lens", "shift px",
            "reach %")  # fmt: skip


def _row(c: CameraInfo) -> tuple[str, ...]:
    focal = [f"{f:.1f}" for f in c.focal_px]
    return (
        c.name, f"{c.size_px[0]} × {c.size_px[1]}", " × ".join(dict.fromkeys(focal)),
        " × ".join(f"{a:.1f}" for a in c.field_deg), _text(c.position), _text(c.looks_at),
        c.lens, f"{c.largest_shift_px:.2f}", f"{c.reach_percent:.4g}",
    )  # fmt: skip


def _text(value: Any) -> str:
    if isinstance(value, (list, tuple)):
        return ", ".join(f"{x:.3f}" for x in value)
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _warnings(warnings: tuple[str, ...]) -> list[tuple[str, str]]:
    return [("warning" if i == 0 else "", text) for i, text in enumerate(warnings)]


@app.command()
def convert(
    calibration: CalibrationFile,
    out: _Out,
    to_format: _Format = None,
    lens: _LensOption = "auto",
    from_format: FromFormat = None,
    units: LengthUnits = None,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Write a calibration in another format; lenses that it cannot hold are fitted.

    The table lists the error of each fitted camera over its image in pixels, root mean square and
    maximum. A camera that is written without a fit has no error.

    For example:

        asterism camera convert walk.xcp walk.toml

        asterism camera convert walk.xcp walk.yml --lens brown

        asterism camera convert walk.qca.txt folder --format flydra
    """
    from asterism.camera import Rig
    from asterism.cli.options import as_options
    from asterism.cli.outputs import Folder, check_outputs
    from asterism.io.calibrations import write_rig
    from asterism.io.calibrations.files import format_to_write

    with as_options({"path": "OUT", "format": "--format"}):
        chosen = format_to_write(out, to_format)
    check_fields("--lens", [lens], ("auto", *_LENSES))
    target = Folder(out) if chosen.is_folder else out
    check_outputs({"OUT": target}, [calibration], overwrite=overwrite)
    rig = read_calibration(calibration, from_format, units)
    fits = [_fitted(camera, lens, chosen) for camera in rig]
    cameras = [c if fit is None else fit.camera for c, fit in zip(rig, fits, strict=True)]
    with as_options({"path": "OUT"}):
        if chosen.is_folder:
            out.mkdir(parents=True, exist_ok=True)
        write_rig(Rig(tuple(cameras)), out, format=chosen.name, overwrite=overwrite)
    changes = [
        {
            "name": name,
            "lens": "–" if camera.lens is None else type(camera.lens).__name__,
            "rms_px": None if fit is None else fit.rms_px,
            "max_px": None if fit is None else fit.max_px,
        }
        for name, camera, fit in zip(rig.names, cameras, fits, strict=True)
    ]
    if json:
        print_json({"output": str(out), "format": chosen.name, "cameras": changes,
                    "warnings": list(rig.warnings)})  # fmt: skip
    elif not quiet:
        rows = [
            (c["name"], c["lens"], "not fitted", "") if c["rms_px"] is None
            else (c["name"], c["lens"], f"{c['rms_px']:.3g}", f"{c['max_px']:.3g}")
            for c in changes
        ]  # fmt: skip
        print_table(rows, ("camera", "lens", "rms px", "max px"), title=f"{out}: {chosen.name}")
        if rig.warnings:
            print_table(_warnings(rig.warnings))


_LENSES = ("brown", "vicon", "report", "none")


def _fitted(camera: Any, lens: str, chosen: CalibrationFormat) -> LensFit | None:
    from asterism.camera import BrownConrady, ReportRadial, ViconRadial
    from asterism.io.calibrations.fitting import fit_kind, fit_to_format

    if lens == "auto":
        return fit_to_format(camera, chosen)
    kinds = (BrownConrady, ViconRadial, ReportRadial, None)
    kind = kinds[_LENSES.index(lens)]
    is_there = camera.lens is None if kind is None else isinstance(camera.lens, kind)
    if is_there and fit_to_format(camera, chosen) is None:
        return None
    return fit_kind(camera, kind, chosen)


@app.command()
def check(
    calibration: CalibrationFile,
    points: _Points = None,
    point_units: _PointUnits = None,
    max_px: _Most = 2.0,
    from_format: FromFormat = None,
    units: LengthUnits = None,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Check a calibration for errors; exit code 1 if a check fails.

    With --points, the reprojection errors of known points are checked too. A file of points is a
    CSV with the columns camera, x, y, z, u, v (metres), or it belongs to one camera: "X Y Z 1 u v
    1" as flydra writes it, or "u v X Y Z" as MyPTV writes it (millimetres).

    For example:

        asterism camera check walk.xcp

        asterism camera check rig --points cam1=one.dat --points cam2=two.dat

        asterism camera check rig.toml --points wand.csv --max-px 0.5
    """
    from asterism.checks import check_number
    from asterism.multiview.rig_check import check_points, check_rig

    check_number("--max-px", max_px, above=0)
    rig = read_calibration(calibration, from_format, units)
    checks = check_rig(rig)
    errors: list[dict[str, Any]] = []
    if points:
        more, errors = check_points(rig, _sightings(points, rig.names, point_units), max_px)
        checks += more
    failed = any(c.status == "fails" for c in checks)
    if json:
        print_json({"calibration": str(calibration), "passed": not failed,
                    "checks": [dataclasses.asdict(c) for c in checks], "reprojection": errors,
                    "warnings": list(rig.warnings)})  # fmt: skip
    elif not quiet:
        _print_checks(checks, errors, rig.warnings)
    if failed:
        raise typer.Exit(1)


def _print_checks(
    checks: list[Check], errors: list[dict[str, Any]], warnings: tuple[str, ...]
) -> None:
    print_table([(c.name, c.status, c.detail) for c in checks], ("check", "result", "detail"))
    if errors:
        columns = ("camera", "points", "not seen", "median px", "95 % px", "max px")
        rows = [
            (e["camera"], e["n_points"], e["n_unseen"], *(f"{e[k]:.3f}" for k in (
                "median_px", "percentile_95_px", "worst_px")))
            for e in errors
        ]  # fmt: skip
        print_table(rows, columns, title="\nReprojection errors")
    if warnings:
        print_table(_warnings(warnings))


def _sightings(points: list[str], names: tuple[str, ...], units: str | None) -> list[Any]:
    from asterism.io.calibrations.points import read_sightings

    found: list[Any] = []
    for text in points:
        camera, equals, file = text.partition("=")
        if not equals or camera not in names:
            camera, file = None, text
        found += read_sightings(Path(file), names, camera=camera, units=units)
    return found


app.command("map")(with_option_names(map_))
