"""``asterism chain``: simulation, filming, reconstruction and tracking, scored at each stage."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from asterism.cli.commands.reconstruct import Prior, about, expected_from, figures, true_tracks
from asterism.cli.console import Json, Overwrite, Quiet, print_json, print_table, progress

if TYPE_CHECKING:
    import asterism as am

_Scene = Annotated[str, typer.Argument(metavar="SCENE", help="One of `asterism scenes`.")]
_Rig = Annotated[
    str,
    typer.Option("--rig", metavar="RIG", help="Calibration, or a layout such as ring8 or wall4."),
]
_Out = Annotated[
    Path | None,
    typer.Option("--out", "-o", metavar="DIR", help="Folder for the results of each stage."),
]
_Methods = Annotated[
    list[str] | None,
    typer.Option("--method", help="Tracking method; may be repeated.", show_default="auto"),
]
_Frames = Annotated[int | None, typer.Option(help="Number of frames.", show_default="the scene's")]
_Rate = Annotated[float | None, typer.Option(help="Frame rate, Hz.", show_default="the scene's")]
_Seed = Annotated[int, typer.Option(help="Random seed.")]
_Options = Annotated[
    list[str] | None,
    typer.Option("--option", metavar="NAME=VALUE", help="Option of the scene; may be repeated."),
]
_Seeing = Annotated[
    list[str] | None,
    typer.Option(
        "--seeing",
        metavar="NAME=VALUE",
        help="Property of the camera images, as in `asterism film`; may be repeated.",
        show_default="noise_px=0.3",
    ),
]

OBSERVATIONS, RIG, TRUTH, POINTS = "observations.csv", "rig.toml", "truth.csv", "points.csv"


def chain(
    scene: _Scene,
    rig: _Rig = "ring8",
    out: _Out = None,
    method: _Methods = None,
    frames: _Frames = None,
    rate: _Rate = None,
    seed: _Seed = 0,
    option: _Options = None,
    seeing: _Seeing = None,
    prior: Prior = False,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Simulate, film, reconstruct and track a scene, and score each stage.

    2-D: share of the markers that the cameras see. 3-D: share of the visible markers that are
    reconstructed, ghosts, errors and consistency of the covariance. Identity: scores of each
    tracking method.

    For example:

        asterism chain person --rig ring8 --method gnn --method mcmcda

        asterism chain person --rig ring4 --prior

        asterism chain two_people --rig ring8 --seeing false=0.5 -o chain
    """
    import asterism as am
    from asterism.checks import check_fields
    from asterism.cli.outputs import Folder, check_outputs
    from asterism.cli.recording import made_scene, rig_from, seeing_from
    from asterism.tracking.choose import AUTO

    names = method or [AUTO]
    check_fields("--method", names, (AUTO, *am.tracking.METHODS))
    eyes = seeing_from(seeing or ["noise_px=0.3"])
    if out is not None:
        files = (OBSERVATIONS, RIG, TRUTH, POINTS, *(f"tracks_{name}.csv" for name in names))
        check_outputs({"--out": Folder(out, files)}, [Path(rig)], overwrite=overwrite)
    truth, values = made_scene(scene, {"frames": frames, "rate": rate, "seed": seed}, option or [])
    cameras, about_rig = rig_from(rig, truth.detections.points)
    shot = am.simulate.film(truth, cameras, seeing=eyes, seed=seed)
    o = shot.observations
    start = time.perf_counter()
    with progress("reconstructing", o.n_frames) as advance:
        made = am.reconstruct(o, cameras, advance=advance)
    if prior:
        with progress("reconstructing again", o.n_frames) as advance:
            made = am.reconstruct(o, cameras, prior=expected_from(made), advance=advance)
    seconds = time.perf_counter() - start
    seen = (shot.blob_of >= 0).sum(axis=0)
    scores = am.metrics.point_scores(made.detections, truth, counted=seen >= 2)
    who = true_tracks(made, o)
    tracks = _tracked(made.detections, names, seed)
    identity = {name: am.evaluate(found, who).to_dict() for name, found in tracks.items()}
    two_d = _image_figures(shot)
    if out is not None:
        _write(out, o, cameras, who, tracks)
    if json:
        print_json({
            "scene": scene, "options": values, "rig": about_rig, "2d": two_d,
            "3d": figures(made, o) | scores.to_dict() | {"frames_per_second": o.n_frames / seconds},
            "identity": identity, "folder": None if out is None else str(out),
        })  # fmt: skip
    elif not quiet:
        n_markers = f"{truth.n_tracks} markers, {o.n_frames} frames, {about_rig}"
        print_table([
            (scene, n_markers),
            ("seen by one camera or more", f"{two_d['seen_by_one_percent']:.2f} %"),
            ("seen by two or more", f"{two_d['seen_by_two_percent']:.2f} %"),
            ("image points", f"{o.n_points}, {two_d['n_false']} of them false"),
        ], title="2-D")  # fmt: skip
        print_table([
            *about(made, o),
            ("recall, of those seen by two", f"{100 * scores.recall:.2f} %"),
            ("ghosts", f"{100 * scores.ghosts:.2f} % of the points"),
            ("error", f"{scores.median_mm:.3g} mm median, {scores.p95_mm:.3g} mm in 95 %"),
            ("NEES per coordinate", f"{scores.nees:.3g} (1 if the covariance is right)"),
            ("speed", f"{o.n_frames / seconds:.0f} frames/s"),
        ], title="\n3-D")  # fmt: skip
        print_table([
            (name, f"{s['idf1']:.4f}", s["switches"], f"{s['mota']:.4f}", s["n_tracks"])
            for name, s in identity.items()
        ], ("method", "IDF1", "switches", "MOTA", "tracks"), title="\nIdentity")  # fmt: skip
        if AUTO in tracks and (recipe := tracks[AUTO].recipe) is not None:
            print_table([("auto", recipe.chosen)])
        if out is not None:
            print_table([("written", out)])


def _tracked(detections: am.Detections, names: list[str], seed: int) -> dict[str, am.Tracks]:
    """Track with every method, on one model."""
    import asterism as am

    model = am.estimate_model(detections).model
    tracks: dict[str, am.Tracks] = {}
    for name in names:
        method = None if name == am.tracking.AUTO else name
        with progress(f"tracking with {name}", detections.n_frames) as advance:
            tracks[name] = am.track(detections, method, model=model, seed=seed, progress=advance)
    return tracks


def _image_figures(shot: am.simulate.Film) -> dict[str, float]:
    """Count image points and the share of the markers that are seen."""
    import asterism as am

    markers = shot.observations.markers
    seen = (shot.blob_of >= 0).sum(axis=0)
    n_there = max(int((shot.projection.reason[0] != am.camera.Reason.ABSENT).sum()), 1)
    return {
        "n_image_points": shot.observations.n_points,
        "n_false": 0 if markers is None else int((markers < 0).sum()),
        "seen_by_one_percent": 100 * float((seen >= 1).sum()) / n_there,
        "seen_by_two_percent": 100 * float((seen >= 2).sum()) / n_there,
    }


def _write(out: Path, observations: Any, rig: Any, who: Any, tracks: dict[str, Any]) -> None:
    """Write the results of each stage."""
    import numpy as np

    import asterism as am

    out.mkdir(parents=True, exist_ok=True)
    am.io.write_observations(observations, out / OBSERVATIONS)
    am.io.write_rig(rig, out / RIG)
    am.write(who, out / TRUTH)
    d = who.detections
    am.write(am.Tracks(detections=d, labels=np.full(d.n_points, -1)), out / POINTS)
    for name, found in tracks.items():
        am.write(found, out / f"tracks_{name}.csv")
