"""``asterism camera map``: error of triangulation over a volume, and places for one more camera."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from asterism.cli.calibration_options import (
    CalibrationFile,
    FromFormat,
    LengthUnits,
    read_calibration,
)
from asterism.cli.console import Json, Overwrite, Quiet, print_json, print_table
from asterism.errors import ParameterError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.figure import Figure

    from asterism.camera import Rig
    from asterism.multiview import TriangulationMap

__all__ = ["map_"]

_Picture = Annotated[
    Path | None, typer.Option("--out", "-o", metavar="FILE.png", help="Figure to write.")
]
_Low = Annotated[
    str | None,
    typer.Option(
        metavar="X,Y,Z", help="Lower corner of the volume, m.", show_default="from the rig"
    ),
]
_High = Annotated[
    str | None,
    typer.Option(
        metavar="X,Y,Z", help="Upper corner of the volume, m.", show_default="from the rig"
    ),
]
_Spacing = Annotated[
    float | None,
    typer.Option(help="Spacing of the grid, metres.", show_default="a twelfth of the longest edge"),
]
_Sigma = Annotated[float, typer.Option(help="Standard deviation of an image point, pixels.")]
_Suggest = Annotated[int, typer.Option(help="Number of suggested places for one more camera.")]


def map_(
    calibration: CalibrationFile,
    out: _Picture = None,
    low: _Low = None,
    high: _High = None,
    spacing: _Spacing = None,
    sigma: _Sigma = 0.3,
    suggest: _Suggest = 3,
    overwrite: Overwrite = False,
    from_format: FromFormat = None,
    units: LengthUnits = None,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Map the error of triangulation over a volume, and suggest places for one more camera.

    The figure shows the middle level of the volume from above; the z axis points up.

    For example:

        asterism camera map rig.toml -o map.png

        asterism camera map walk.xcp --low -1,-1,0 --high 1,1,2 --suggest 5
    """
    import numpy as np

    from asterism.cli.options import as_options
    from asterism.cli.outputs import check_ending, check_outputs
    from asterism.multiview import triangulation_map

    check_ending("--out", out, ".png")
    check_outputs({"--out": out}, [calibration], overwrite=overwrite)
    if (low is None) != (high is None):
        raise ParameterError("--low", "both --low and --high, or neither", "one of them")
    rig = read_calibration(calibration, from_format, units)
    if low is None or high is None:
        corners = _default_box(rig)
    else:
        corners = _corner("--low", low), _corner("--high", high)
    options = {"low": "--low", "high": "--high", "spacing": "--spacing", "sigma_px": "--sigma",
               "n_suggestions": "--suggest"}  # fmt: skip
    with as_options(options):
        found = triangulation_map(
            rig, *corners, spacing=spacing, sigma_px=sigma, n_suggestions=suggest
        )
    if out is not None:
        from asterism.plot.export import write_figure

        write_figure(_map_picture(found, rig), out)
    error = found.coverage.error
    known = 1e3 * error[np.isfinite(error)]
    median, high_error = np.percentile(known, [50, 95]) if known.size else (np.nan, np.nan)
    values: dict[str, Any] = {
        "calibration": str(calibration),
        "low": list(corners[0]),
        "high": list(corners[1]),
        "seen_by_two_percent": 100 * found.share,
        "median_error_mm": float(median),
        "percentile_95_error_mm": float(high_error),
        "rms_error_mm": 1e3 * found.error,
        "suggestions": [
            {
                "position": s.camera.center.tolist(),
                "rms_error_mm": 1e3 * s.error,
                "seen_by_two_percent": 100 * s.share,
            }
            for s in found.suggestions
        ],
    }
    if json:
        print_json(values | {"output": None if out is None else str(out)})
    elif not quiet:
        title = f"{calibration}: {len(rig)} cameras, {sigma:g} px"
        _print_map(values, title)
        if out is not None:
            print_table([("written", out)])


def _print_map(values: dict[str, Any], title: str) -> None:
    print_table(
        [
            ("volume", f"{_listed(values['low'])} to {_listed(values['high'])}"),
            ("seen by two cameras or more", f"{values['seen_by_two_percent']:.1f} %"),
            ("error where seen", f"{values['median_error_mm']:.3g} mm median, "
                f"{values['percentile_95_error_mm']:.3g} mm in 95 %"),
            ("over the volume", f"{values['rms_error_mm']:.3g} mm root mean square; a place "
                "without two cameras counts with the width of the volume"),
        ],
        title=title,
    )  # fmt: skip
    if values["suggestions"]:
        rows = [
            (_listed(s["position"]), f"{s['rms_error_mm']:.3g}", f"{s['seen_by_two_percent']:.1f}")
            for s in values["suggestions"]
        ]
        columns = ("position", "root mean square, mm", "seen by two, %")
        print_table(rows, columns, title="\nOne more camera")


def _listed(values: Sequence[float]) -> str:
    return ", ".join(f"{x:.3f}" for x in values)


def _corner(option: str, text: str) -> tuple[float, float, float]:
    """Read ``X,Y,Z`` in metres."""
    import math

    try:
        x, y, z = (float(word) for word in text.split(","))
    except ValueError:
        raise ParameterError(option, "X,Y,Z in metres", repr(text)) from None
    if not all(map(math.isfinite, (x, y, z))):
        raise ParameterError(option, "finite metres", repr(text))
    return x, y, z


def _default_box(rig: Rig) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return a box around the point at which the cameras look, as wide as their median distance."""
    import numpy as np

    from asterism.multiview.rig_info import meeting_point

    middle = meeting_point(rig)
    if middle is None:
        hint = "the cameras look nowhere in common"
        raise ParameterError("--low", "a volume: --low and --high", "none", hint)
    away = np.linalg.norm(np.stack([camera.center for camera in rig]) - middle, axis=1)
    half = float(np.median(away)) / 2
    return tuple((middle - half).tolist()), tuple((middle + half).tolist())


def _map_picture(found: TriangulationMap, rig: Rig) -> Figure:
    """Draw the middle level of a map: how many cameras see a place, and how exactly."""
    import numpy as np
    from matplotlib.figure import Figure

    from asterism.plot import plot_coverage
    from asterism.plot.style import INK, WRONG

    figure = Figure(figsize=(14, 6), layout="constrained", dpi=110)
    places = np.stack([camera.center for camera in rig])
    for axes, what in zip(figure.subplots(1, 2), ("cameras", "error"), strict=True):
        plot_coverage(found.coverage, what=what, ax=axes)
        axes.scatter(*places[:, :2].T, s=24, c=INK, edgecolors="white", label="cameras")
        if found.suggestions:
            more = np.stack([s.camera.center for s in found.suggestions])
            axes.scatter(*more[:, :2].T, s=60, c=WRONG, marker="*", label="suggested camera")
        axes.legend(
            loc="upper left", bbox_to_anchor=(0, -0.1), ncols=2, fontsize=8, frameon=False,
            labelcolor=INK,
        )  # fmt: skip
    return figure
