"""``asterism film``: image points of markers in each camera, with their truth."""

from __future__ import annotations

import dataclasses
import difflib
import logging
import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from asterism.checks import check_number
from asterism.cli.console import Json, Overwrite, Quiet, print_json, print_table, progress
from asterism.errors import ParameterError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    import asterism as am
    from asterism.cli.filming import Footage

log = logging.getLogger(__name__)

_Source = Annotated[
    str, typer.Argument(metavar="CAPTURE", help="Capture, or a scene of `asterism scenes`.")
]
_Rig = Annotated[
    str,
    typer.Option(
        "--rig",
        metavar="RIG",
        help="Calibration (file or folder), or a layout such as ring8 or wall4: that number of "
        "cameras, which together cover all markers.",
    ),
]
_Out = Annotated[Path, typer.Option("--out", "-o", metavar="DIR", help="Folder for the files.")]
_Pictures = Annotated[int, typer.Option(help="Number of frames that are drawn, evenly spaced.")]
_Frames = Annotated[
    int | None, typer.Option(help="Number of frames of a scene.", show_default="the scene's")
]
_Rate = Annotated[
    float | None, typer.Option(help="Frame rate of a scene, Hz.", show_default="the scene's")
]
_Seed = Annotated[
    int | None,
    typer.Option(help="Random seed of the scene and of --seeing.", show_default="0"),
]
_Options = Annotated[
    list[str] | None,
    typer.Option("--option", metavar="NAME=VALUE", help="Option of a scene; may be repeated."),
]
_Seeing = Annotated[
    list[str] | None,
    typer.Option(
        "--seeing",
        metavar="NAME=VALUE",
        help="Property of the camera images (marker_radius, smallest_share, merge, noise_px, "
        "missing, false, quantum_px, timing); may be repeated. Ideal images without it.",
    ),
]

POINTS, RIG, SUMMARY, PICTURES = "observations.csv", "rig.toml", "film.json", "pictures"
RIG_PICTURE, COVERAGE_PICTURE = "rig.png", "coverage.png"
_MIN_SHARE = 0.05  # of the samples that are seen; below it units or axes probably differ


def film(
    source: _Source,
    rig: _Rig,
    out: _Out,
    pictures: _Pictures = 4,
    frames: _Frames = None,
    rate: _Rate = None,
    seed: _Seed = None,
    option: _Options = None,
    seeing: _Seeing = None,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Film a capture or a scene: image points of its markers in each camera.

    Ideal cameras report one image point for each visible tracked point; with --seeing, images have
    noise, missing and false points. In scenes the limbs of people occlude markers; a file has no
    limbs.

    DIR receives the image points with their truth (observations.csv), the cameras (rig.toml),
    figures of the images, the rig and its coverage, and a summary (film.json).

    For example:

        asterism film walk.c3d --rig walk.xcp -o film

        asterism film person --rig ring8 -o film --option activity=jump

        asterism film crossing --rig wall4 -o film --seeing noise_px=0.2
    """
    from asterism.cli.filming import film_all, frames_between
    from asterism.cli.outputs import Folder, check_outputs
    from asterism.cli.recording import rig_from, seeing_from
    from asterism.io.atomic import write_text
    from asterism.io.calibrations import write_rig
    from asterism.io.json_text import to_json
    from asterism.io.observations import write_observations
    from asterism.model.recipe import versions

    check_number("--pictures", pictures, above=0, below=10_000, closed=True, integer=True)
    names = (POINTS, RIG, SUMMARY, RIG_PICTURE, COVERAGE_PICTURE)
    inputs = [Path(text) for text in (source, rig) if Path(text).exists()]
    check_outputs({"--out": Folder(out, names)}, inputs, overwrite=overwrite)
    eyes = seeing_from(seeing or [])
    given = {"frames": frames, "rate": rate, "seed": seed}
    given = {name: value for name, value in given.items() if value is not None}
    truth, first_frame = _truth(source, given, option or [], is_seeing=bool(seeing))
    points = truth.detections.points[truth.labels >= 0]
    _check_points(source, points)
    cameras, about = rig_from(rig, points)

    out.mkdir(parents=True, exist_ok=True)
    with progress("filming", truth.detections.n_frames) as advance:
        footage = film_all(truth, cameras, advance, eyes, seed or 0)
    write_observations(footage.observations, out / POINTS, first_frame=first_frame)
    write_rig(cameras, out / RIG)

    drawn = frames_between(truth.detections.n_frames, pictures)
    files = {t: f"{PICTURES}/frame_{first_frame + t:06d}.png" for t in drawn}
    times = {t: f"frame {first_frame + t}, {truth.detections.times[t]:.3f} s" for t in drawn}
    _draw(out, truth, cameras, {t: (files[t], f"{Path(source).name}, {times[t]}") for t in drawn})

    options = [f"--{name}={value}" for name, value in given.items()]
    options += [f"--option={text}" for text in option or []]
    options += [f"--seeing={text}" for text in seeing or []]
    command = ["asterism", "film", source, "--rig", rig, "-o", out, f"--pictures={pictures}"]
    summary = {
        "command": shlex.join(map(str, [*command, *options])),
        "capture": source,
        "rig": rig,
        "about_rig": about,
        "seed": given.get("seed", 0),
        "seeing": None if eyes is None else dataclasses.asdict(eyes),
        "first_frame": first_frame,
        "n_frames": truth.detections.n_frames,
        "n_tracks": truth.n_tracks,
        "n_surfaces": len(getattr(truth, "surfaces", ())),
        "n_named": sum(name is not None for name in truth.names),
        **_figures(footage),
        "pictures": list(files.values()),
        "versions": versions(),
    }
    write_text(out / SUMMARY, to_json(summary) + "\n")
    if footage.share_seen_by(1) < _MIN_SHARE:
        log.warning(
            "%s: only %.3g %% of the points are seen by a camera. Compare its units and axes with "
            "those of %s.", source, 100 * footage.share_seen_by(1), rig,
        )  # fmt: skip
    if json:
        print_json({"folder": str(out), **summary})
    elif not quiet:
        _print(out, summary)


def _check_points(source: str, points: NDArray[np.float64]) -> None:
    if not len(points):
        hint = "run asterism track first"
        raise ParameterError("CAPTURE", "points in tracks", f"{source}, which has none", hint)
    if points.shape[1] != 3:
        raise ParameterError("CAPTURE", "points in 3-D", f"{source}, in {points.shape[1]}-D")


def _draw(out: Path, truth: am.Tracks, cameras: am.Rig, sheets: dict[int, tuple[str, str]]) -> None:
    """Draw the rig, its coverage and the images; `sheets` has a file and a title by frame."""
    from asterism.cli.film_pictures import contact_sheet, coverage_picture, rig_picture
    from asterism.plot.export import write_figure

    with progress("drawing", len(sheets) + 2) as advance:
        if sheets:
            (out / PICTURES).mkdir(exist_ok=True)
        for i, (t, (file, title)) in enumerate(sheets.items()):
            write_figure(contact_sheet(truth, cameras, t, title), out / file)
            advance(i + 1)
        write_figure(rig_picture(truth, cameras), out / RIG_PICTURE)
        advance(len(sheets) + 1)
        write_figure(coverage_picture(truth, cameras), out / COVERAGE_PICTURE)


def _truth(
    source: str, given: dict[str, Any], texts: list[str], *, is_seeing: bool
) -> tuple[am.Tracks, int]:
    """Make the scene or read the capture; return its tracks and the number of its first frame."""
    import asterism as am
    from asterism.cli.recording import made_scene

    path = Path(source)
    if source in am.simulate.SCENES and not path.exists():
        return made_scene(source, given, texts)[0], 1
    if not path.exists():
        expected = f"a capture, or a scene: {', '.join(am.simulate.SCENES)}"
        near = difflib.get_close_matches(source, am.simulate.SCENES, n=1)
        hint = f"did you mean {near[0]!r}?" if near else ""
        raise ParameterError("CAPTURE", expected, f"{source!r}, which is neither", hint)
    idle = [f"--{name}" for name in given if not (name == "seed" and is_seeing)]
    idle += ["--option"] * bool(texts)
    if idle:
        options = ", ".join(idle)
        raise ParameterError("CAPTURE", f"a scene, as {options} is given", f"the file {source}")
    tracks = am.io.read_tracks(path)
    capture = tracks.detections
    assert isinstance(capture, am.Capture)
    n_clutter = int((tracks.labels < 0).sum())
    if n_clutter and tracks.n_tracks:
        log.warning("%s: %d points without a track are not filmed", path, n_clutter)
    return tracks, capture.first_frame


def _figures(footage: Footage) -> dict[str, Any]:
    from asterism.camera import Reason

    observations = footage.observations
    kinds = [reason for reason in Reason if reason != Reason.ABSENT]
    return {
        "n_samples": footage.n_samples,
        "n_image_points": observations.n_points,
        "n_false": int((observations.markers < 0).sum()) if observations.markers is not None else 0,
        "seen_by_one_percent": 100 * footage.share_seen_by(1),
        "seen_by_two_percent": 100 * footage.share_seen_by(2),
        "cameras": {
            name: {reason.name.lower(): int(counts[reason]) for reason in kinds}
            for name, counts in zip(observations.cameras, footage.counts, strict=True)
        },
    }


def _image_points(summary: dict[str, Any]) -> str:
    n, n_false = summary["n_image_points"], summary["n_false"]
    return f"{n}, {n_false} of them false" if n_false else str(n)


def _print(out: Path, summary: dict[str, Any]) -> None:
    tracks = f"{summary['n_tracks']} tracks, {summary['n_named']} of them named"
    size = f"{tracks}, {summary['n_frames']} frames"
    occluders = f"{summary['n_surfaces']} surfaces" if summary["n_surfaces"] else "none"
    print_table(
        [(summary["capture"], size), ("rig", summary["about_rig"]), ("occluders", occluders)]
    )
    cameras: dict[str, dict[str, int]] = summary["cameras"]
    met = [kind for kind in next(iter(cameras.values())) if any(c[kind] for c in cameras.values())]
    kinds = ["visible", *(kind for kind in met if kind != "visible")]
    n = max(summary["n_samples"], 1)
    rows = [
        (name, *(str(counts[kind]) for kind in kinds), f"{100 * counts['visible'] / n:.1f} %")
        for name, counts in cameras.items()
    ]
    title = "\nMarkers in the images"
    if summary["seeing"] is not None:
        title += " (ideal cameras)"
    print_table(rows, ("camera", *kinds, "share seen"), title=title)
    pictures = summary["pictures"]
    print_table(
        [
            ("points seen by one or more", f"{summary['seen_by_one_percent']:.1f} %"),
            (
                "points seen by two or more",
                f"{summary['seen_by_two_percent']:.1f} %",
            ),
            ("image points", _image_points(summary)),
        ],
        title="\nAll cameras",
    )
    files = [
        (out / POINTS, "image points, with their truth"),
        (out / RIG, "cameras"),
        (out / RIG_PICTURE, "cameras and paths of the markers"),
        (out / COVERAGE_PICTURE, "number of cameras and error by place"),
        (out / SUMMARY, "these figures"),
    ]
    if pictures:
        what = f"images of all cameras, {len(pictures)} frames"
        files.insert(2, (out / PICTURES / "frame_*.png", what))
    print_table(files, title="\nFiles")
