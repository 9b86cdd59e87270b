"""``asterism demo``: simulate, corrupt, track with every method, score, and draw."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from asterism.cli.console import Json, Overwrite, Quiet, print_json, print_table

if TYPE_CHECKING:
    from collections.abc import Sequence

    import asterism as am

_Out = Annotated[Path, typer.Option("--out", "-o", metavar="DIR", help="Folder for the files.")]
_Seed = Annotated[int, typer.Option(help="Random seed.")]

_N_MARKERS, _N_FRAMES, _RATE = 20, 300, 100.0
_ABOUT = (
    f"{_N_MARKERS} simulated markers, {_N_FRAMES} frames at {_RATE:g} Hz; 10 % of the detections "
    "missing, 10 % clutter, noise of 0.3 mm, up to two markers at a time occluded for 3 to "
    "10 frames"
)
_WHY_ALL = (
    "auto selects a method from measured properties of the capture; it is what `asterism track` "
    "uses. The other methods run on the same model for comparison. Selected here: "
)
_SCORES = ("idf1", "mota", "hota", "switches", "wrong_percent", "missing_percent", "n_tracks")


def demo(
    out: _Out = Path("demo"),
    seed: _Seed = 1,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Simulate a capture, corrupt it, track it with each method, score and draw the results.

    The method `auto` selects one of the others from the capture. All of them use the same model.
    The files of each method are in a folder of its own.

    For example:

        asterism demo

        asterism demo -o /tmp/demo --seed 7
    """
    import asterism as am
    from asterism.batch.carry_out import carry_out
    from asterism.batch.run_folder import Run
    from asterism.checks import check_number
    from asterism.cli.outputs import Folder, check_outputs
    from asterism.io.atomic import write_text

    check_number("--seed", seed, above=0, closed=True, integer=True)
    check_outputs({"--out": Folder(out)}, [], overwrite=overwrite)
    out.mkdir(parents=True, exist_ok=True)
    truth = _experiment(out, seed)
    capture = am.read(out / "capture.c3d")
    estimate = am.estimate_model(capture)
    write_text(out / "model.toml", estimate.model.to_toml())
    scores: dict[str, dict[str, Any]] = {}
    paces: dict[str, float] = {}
    why_all = _WHY_ALL
    for name in ("auto", *am.tracking.METHODS):
        folder = out / name
        folder.mkdir(exist_ok=True)
        method, stitch = (None, "auto") if name == "auto" else (name, False)
        plan = am.tracking.plan_tracking(
            capture, method, model=estimate.model, stitch=stitch, seed=seed
        )
        run = Run(recipe=plan.recipe, source=str(out / "capture.c3d"), format="c3d")
        result, summary = carry_out(run, capture, folder / "tracked.c3d", folder=folder)
        tracks = result.tracks
        why_all += result.recipe.chosen
        am.write(tracks, folder / "tracked.csv")
        _draw(tracks, truth, folder)
        found = am.evaluate(tracks, truth).to_dict()
        scores[name] = {score: found[score] for score in _SCORES}
        paces[name] = summary.frames_per_second
    write_text(out / "summary.md", _markdown(scores, estimate, why_all, seed))
    if json:
        print_json({"folder": str(out), "seed": seed, "scores": scores})
    elif not quiet:
        _print(out, scores, paces, why_all)


def _experiment(out: Path, seed: int) -> am.Tracks:
    """Write the capture and its truth, and return the truth."""
    import numpy as np

    import asterism as am
    from asterism.simulate import Burst, corrupt, smooth

    scene = smooth(n_markers=_N_MARKERS, frames=_N_FRAMES, rate=_RATE, seed=seed)
    truth = corrupt(
        scene, missing=0.1, clutter=0.1, noise=3e-4, burst=Burst(n=2, shortest=3, longest=10),
        seed=seed,
    )  # fmt: skip
    clutter = np.full(truth.detections.n_points, -1)
    unnamed = am.Tracks(detections=truth.detections, labels=clutter)
    for ending in ("c3d", "csv"):
        am.write(truth, out / f"truth.{ending}")
        am.write(unnamed, out / f"capture.{ending}")
    return truth


def _draw(tracks: am.Tracks, truth: am.Tracks, folder: Path) -> None:
    from asterism.cli.outputs import truth_of_each
    from asterism.plot import plot_errors, plot_presence, plot_trajectories
    from asterism.plot.export import write_figure

    same = truth_of_each(tracks, truth)
    for name, axes in (
        ("trajectories", plot_trajectories(tracks)),
        ("presence", plot_presence(tracks)),
        ("errors", plot_errors(tracks, same)),
    ):
        write_figure(axes, folder / f"{name}.png")


def _table(scores: dict[str, dict[str, Any]]) -> list[Sequence[str]]:
    return [
        (name, *(f"{v:.4g}" if isinstance(v, float) else str(v) for v in values.values()))
        for name, values in scores.items()
    ]


def _markdown(
    scores: dict[str, dict[str, Any]],
    estimate: am.tracking.ModelEstimate,
    why_all: str,
    seed: int,
) -> str:
    def table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
        return [f"| {' | '.join(row)} |" for row in (header, ["---"] * len(header), *rows)]

    lines = [
        "# Asterism demo",
        "",
        f"{_ABOUT} (seed {seed}). The model was estimated from the capture.",
        "",
        why_all,
        "",
        "## Scores",
        "",
        *table(("method", *_SCORES), _table(scores)),
        "",
        "## Model",
        "",
        *table(("parameter", "value", "why"), estimate.reasons),
        "",
    ]
    for name in scores:
        lines += [f"## {name}", ""]
        lines += [f"![{what}]({name}/{what}.png)" for what in ("errors", "presence")]
        lines += [f"![trajectories]({name}/trajectories.png)", ""]
    lines += ["Repeat a run: `asterism track --from gnn/run.toml -o again.c3d`.", ""]
    return "\n".join(lines)


def _print(
    out: Path, scores: dict[str, dict[str, Any]], paces: dict[str, float], why_all: str
) -> None:
    print_table([(_ABOUT,), ("",), (why_all,)])
    rows = [(*row, f"{paces[row[0]]:,.0f}") for row in _table(scores)]
    print_table(rows, ("method", *_SCORES, "frames/s"), title="\nScores")
    each = "{" + ",".join(scores) + "}"
    print_table(
        [
            (out / "summary.md", "scores, model and figures on one page"),
            (out / "capture.c3d", "the detections, without names (and capture.csv)"),
            (out / "truth.c3d", "the same points with their true names (and truth.csv)"),
            (out / "model.toml", "the model that was estimated"),
            (out / each / "tracked.c3d", "the results (and tracked.csv)"),
            (out / each / "*.png", "figures of trajectories, presence and errors"),
            (out / each / "run.toml", "everything that repeats the run"),
        ],
        title="\nFiles",
    )
