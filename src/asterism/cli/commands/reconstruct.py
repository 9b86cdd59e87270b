"""``asterism reconstruct``: 3-D points from the image points of several cameras."""

from __future__ import annotations

import logging
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from asterism.cli.console import Json, Overwrite, Quiet, print_json, print_table, progress
from asterism.errors import ParameterError

if TYPE_CHECKING:
    import asterism as am

log = logging.getLogger(__name__)

_In = Annotated[Path, typer.Argument(metavar="OBS", help="Image points, CSV.")]
_Rig = Annotated[
    Path, typer.Option("--rig", metavar="RIG", help="Calibration of the cameras (file or folder).")
]
_Out = Annotated[Path, typer.Option("--out", "-o", help="File for the 3-D points.")]
_Truth = Annotated[
    Path | None,
    typer.Option(help="File for the points with true names, if OBS has them."),
]
_Sigma = Annotated[
    float | None,
    typer.Option(help="Noise (σ) of an image point, pixels.", show_default="estimated"),
]
_MinViews = Annotated[int, typer.Option(help="Smallest number of cameras for a point.")]
_Gate = Annotated[
    float,
    typer.Option(help="Largest reprojection error of an image point, in units of σ."),
]
_Merge = Annotated[
    float,
    typer.Option("--merge", help="Noise (σ) of merged image points, pixels; 0: none merge."),
]
Prior = Annotated[
    bool,
    typer.Option(
        "--prior",
        help="Reconstruct twice; tracks of the first pass predict the second.",
    ),
]
_Threads = Annotated[int, typer.Option(help="Number of frames processed in parallel.")]


def reconstruct(
    source: _In,
    rig: _Rig,
    out: _Out,
    truth: _Truth = None,
    sigma: _Sigma = None,
    min_views: _MinViews = 2,
    gate: _Gate = 4.0,
    merge: _Merge = 1.0,
    prior: Prior = False,
    threads: _Threads = 1,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Reconstruct 3-D points from the image points of several cameras.

    Cameras of OBS and RIG are matched by name. Noise, detection probability, clutter and the volume
    are estimated from OBS.

    For example:

        asterism reconstruct observations.csv --rig rig.toml -o points.c3d

        asterism reconstruct seen.csv --rig rig.toml -o points.csv --min-views 3

        asterism reconstruct seen.csv --rig rig.toml -o points.csv --prior
    """
    import numpy as np

    import asterism as am
    from asterism.batch.result_file import output_format
    from asterism.cli.options import as_options
    from asterism.cli.outputs import check_outputs

    outputs = {"--out": out, "--truth": truth}
    formats = {p: output_format(p, None, option=name) for name, p in outputs.items() if p}
    check_outputs(outputs, [source, rig], overwrite=overwrite)
    observations = am.io.read_observations(source)
    if truth is not None and observations.markers is None:
        raise ParameterError("--truth", "image points with their markers", f"none in {source}")
    times = observations.times
    empty = am.Detections(
        times=times, offsets=np.zeros(len(times) + 1, dtype=np.int64), points=np.empty((0, 3))
    )
    for format in formats.values():
        am.io.CAPTURE_FORMATS[format].check(empty)
    cameras = am.read_rig(rig)
    for warning in cameras.warnings:
        log.warning("%s: %s", rig, warning)
    names = {"n_threads": "--threads", "merge_px": "--merge", "sigma_px": "--sigma"}
    with as_options(names), progress("estimating noise, detection and clutter"):
        model = am.multiview.estimate_images(observations, cameras, sigma_px=sigma, gate=gate)

    def points(expected: am.Detections | None = None) -> am.multiview.Reconstruction:
        with as_options(names), progress("reconstructing", observations.n_frames) as advance:
            return am.reconstruct(
                observations, cameras, model, min_views=min_views, gate=gate, merge_px=merge,
                prior=expected, n_threads=threads, advance=advance,
            )  # fmt: skip

    made = points()
    if prior:
        made = points(expected_from(made))
    d = made.detections
    unnamed = am.Tracks(detections=d, labels=np.full(d.n_points, -1))
    am.write(unnamed, out, format=formats[out])
    if truth is not None:
        am.write(true_tracks(made, observations), truth, format=formats[truth])
    if not d.n_points:
        log.warning(
            "%s: no points reconstructed. Check that %s belongs to these cameras.",
            source,
            rig,
        )
    if json:
        files = {
            "input": str(source),
            "output": str(out),
            **({"truth": str(truth)} if truth else {}),
        }
        print_json(files | figures(made, observations))
    elif not quiet:
        rows = [(source, f"{observations.n_cameras} cameras, {observations.n_frames} frames")]
        print_table([*rows, *about(made, observations), ("written", out)], title="Reconstructed")


def expected_from(made: am.multiview.Reconstruction) -> am.Detections:
    """Track the points and return the predicted positions."""
    import asterism as am

    model = am.estimate_model(made.detections).model
    tracks = am.track(made.detections, am.SMP(window=3), model=model)
    return am.filter.expected_positions(tracks, model)


def true_tracks(made: am.multiview.Reconstruction, observations: am.Observations) -> am.Tracks:
    """Label each point with the marker of most of its image points."""
    import numpy as np

    import asterism as am

    labels = made.markers(observations)
    # Of two points of one marker in a frame, the one with more views keeps the label.
    order = np.lexsort((-made.views.counts, labels, made.detections.frame_of))
    frames, marks = made.detections.frame_of[order], labels[order]
    is_again = np.zeros(len(order), dtype=bool)
    is_again[1:] = (np.diff(frames) == 0) & (np.diff(marks) == 0)
    labels[order[is_again]] = -1
    names = observations.marker_names or tuple(map(str, range(int(labels.max(initial=-1)) + 1)))
    return am.Tracks(detections=made.detections, labels=labels, names=names)


def figures(made: am.multiview.Reconstruction, observations: am.Observations) -> dict[str, Any]:
    """Return the figures of a reconstruction as plain values."""
    import numpy as np

    used = np.unique(made.views.blobs)
    model = made.model
    return {
        "n_frames": observations.n_frames,
        "n_image_points": observations.n_points,
        "n_image_points_used": len(used),
        "n_points": made.detections.n_points,
        "n_points_by_views": np.bincount(made.views.counts).tolist(),
        "n_shared_views": int(made.views.is_shared.sum()),
        "model": {
            "sigma_px": model.sigma_px,
            "p_detection": model.p_detection,
            "clutter": model.clutter,
            "density": model.density,
        },
        **made.info,
    }


def about(
    made: am.multiview.Reconstruction, observations: am.Observations
) -> list[tuple[object, object]]:
    """Return the figures of a reconstruction as rows of the printed table."""
    import numpy as np

    d, values = made.detections, figures(made, observations)
    by_views = values["n_points_by_views"]
    views = ", ".join(f"{n} of {k}" for k, n in enumerate(by_views) if n)
    share = values["n_image_points_used"] / max(observations.n_points, 1)
    sigma = np.broadcast_to(made.model.sigma_px, observations.n_cameras)
    rows: list[tuple[object, object]] = [
        ("points", d.n_points),
        ("by number of cameras", views or "none"),
        ("image points used", f"{100 * share:.1f} % of {observations.n_points}"),
        ("noise", f"{sigma.min():.3g} to {sigma.max():.3g} px"),
    ]
    if d.stds is not None and d.n_points:
        rows.append(("standard deviation", f"{1e3 * float(np.median(d.stds)):.3g} mm"))
    if made.info["n_cut"]:
        cut = f"{made.info['n_cut']} groups; at most {made.info['gap']:.3g} nats below the optimum"
        rows.append(("search limited in", cut))
    return rows
