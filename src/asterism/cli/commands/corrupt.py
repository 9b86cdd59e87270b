"""``asterism corrupt``: an experiment with a known truth, from a labelled capture."""

from __future__ import annotations

import logging
from pathlib import Path
from typing import Annotated, Any

import typer

from asterism.cli.console import Json, Overwrite, Quiet, print_json, print_table
from asterism.errors import ParameterError

log = logging.getLogger(__name__)

_In = Annotated[Path, typer.Argument(metavar="IN", help="Labelled capture.")]
_Out = Annotated[Path, typer.Option("--out", "-o", help="File for the points, without names.")]
_Truth = Annotated[Path, typer.Option(help="File for the same points with their true names.")]
_Missing = Annotated[float, typer.Option(help="Probability that a detection is missed.")]
_Clutter = Annotated[float, typer.Option(help="False alarms per frame, as a share of the markers.")]
_Noise = Annotated[float, typer.Option(help="Standard deviation of added noise, metres.")]
_Burst = Annotated[
    str | None,
    typer.Option(
        metavar="N[:MIN-MAX]",
        help="Occlude up to N markers at a time, for MIN to MAX frames.",
        show_default=False,
    ),
]
_Ghosts = Annotated[
    str | None,
    typer.Option(
        metavar="N[:MIN-MAX]",
        help="Add up to N ghosts at a time beside markers, for MIN to MAX frames.",
        show_default=False,
    ),
]
_Stride = Annotated[int, typer.Option(help="Keep every STRIDE-th frame.")]
_Corruption = Annotated[
    list[str] | None,
    typer.Option(
        "--corrupt",
        metavar="NAME=VALUE",
        help="Other corruption (missing_run, noise_spread, visits, nearby, doubled, merged, "
        "dropped, jitter …); may be repeated.",
    ),
]
_Seed = Annotated[int, typer.Option(help="Random seed.")]


def corrupt(
    source: _In,
    out: _Out,
    truth: _Truth,
    missing: _Missing = 0.0,
    clutter: _Clutter = 0.0,
    noise: _Noise = 0.0,
    burst: _Burst = None,
    ghosts: _Ghosts = None,
    stride: _Stride = 1,
    corruption: _Corruption = None,
    seed: _Seed = 0,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Corrupt a labelled capture; write its points without labels, and the truth.

    Points without a named marker are left out, because their truth is unknown.

    For example:

        asterism corrupt walk.c3d -o corrupted.c3d --truth truth.c3d

        asterism corrupt walk.c3d -o a.csv --truth t.csv --missing 0.1

        asterism corrupt walk.c3d -o a.csv --truth t.csv --burst 5:5-60
    """
    import numpy as np

    import asterism as am
    from asterism.cli.options import as_options
    from asterism.cli.outputs import check_outputs
    from asterism.cli.recording import episode, switches_from
    from asterism.io.captures.files import format_to_write
    from asterism.simulate import Burst, Ghosts

    formats: list[am.io.CaptureFormat] = []
    for name, path in {"--out": out, "--truth": truth}.items():
        with as_options({"path": name}):
            formats.append(format_to_write(path, None))
    check_outputs({"--out": out, "--truth": truth}, [source], overwrite=overwrite)
    occlusions = None if burst is None else episode("--burst", Burst, burst)
    ghost_episodes = None if ghosts is None else episode("--ghosts", Ghosts, ghosts)
    more = switches_from(corruption or [])
    known = am.io.read_tracks(source)
    if not known.n_tracks:
        expected = "a capture whose markers are labelled"
        raise ParameterError("IN", expected, f"{source}, which has no labels")
    for each in formats:
        each.check(known.detections)
    switches: dict[str, Any] = {
        "missing": missing,
        "clutter": clutter,
        "noise": noise,
        "burst": occlusions,
        "ghosts": ghost_episodes,
        "stride": stride,
    }
    extent = float(np.ptp(known.detections.points, axis=0).max(initial=0.0))
    if noise > extent / 10:
        log.warning(
            "--noise: expected metres, found %g; the markers span only %.3g m",
            noise, extent,
        )  # fmt: skip
    options = {name: f"--{name}" for name in ("seed", *switches)}
    with as_options(options | {name: f"--corrupt {name}" for name in more}):
        corrupted = am.simulate.corrupt(known, **switches | more, seed=seed)
    unnamed = am.Tracks(
        detections=corrupted.detections, labels=np.full(corrupted.detections.n_points, -1)
    )
    am.write(corrupted, truth)
    am.write(unnamed, out)
    measured = known.measured()
    is_marker = np.array([name is not None for name in measured.names], dtype=bool)
    n_of_markers = int(measured.lengths[is_marker if is_marker.any() else slice(None)].sum())
    figures = {
        "n_frames": corrupted.detections.n_frames,
        "n_markers": corrupted.n_tracks,
        "n_detections": corrupted.detections.n_points,
        "n_dropped": n_of_markers - int((corrupted.labels >= 0).sum()),
        "n_unnamed": measured.detections.n_points - n_of_markers,
        "n_clutter": int((corrupted.labels < 0).sum()),
    }
    if json:
        record = corrupted.record
        print_json({"output": str(out), "truth": str(truth), "corruption": record, **figures})
    elif not quiet:
        about = {
            "n_dropped": "missed detections",
            "n_unnamed": "unnamed points left out",
            "n_clutter": "false alarms",
        }
        rows = [(about.get(name, name.removeprefix("n_")), n) for name, n in figures.items()]
        print_table([*rows, ("without names", out), ("truth", truth)])
