"""The table of real captures: each method with the estimated model, as captured and corrupted.

Finds the captures in ``../shared/data`` beside the project (or ``--data``); prints Markdown.

    python benchmarks/captures.py [--data FOLDER] [--only NAME] [--markdown FILE]
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import numpy as np

import asterism as am
from report import publish

ENDINGS = (".c3d", ".tsv", "recording_000", "drone2", "marker3")
METHODS = (am.GNN(), am.SMP())


def captures(folder: Path) -> list[Path]:
    return sorted(
        (p for p in folder.rglob("*") if p.is_file() and p.name.endswith(ENDINGS)),
        key=lambda p: p.name.lower(),
    )


def named_only(truth: am.Tracks) -> am.Tracks:
    """Leave out the unnamed points, of which nothing is known; all else stays as recorded."""
    return am.simulate.sense(truth)


def corrupted(truth: am.Tracks) -> am.Tracks:
    """10 % of the detections missing, 10 % clutter, 0.3 mm of noise."""
    return am.simulate.sense(truth, missing=0.1, clutter=0.1, noise=3e-4, seed=1)


def row_of(
    name: str, condition: str, truth: am.Tracks, estimate: am.ModelEstimate, seconds: float
) -> list[list[str]]:
    d = truth.detections
    rows: list[list[str]] = []
    max_gap = estimate.model.population.max_gap
    floors = [am.evaluate(am.floor(truth, gap), truth).idf1 for gap in (10, max_gap)]
    for method in METHODS:
        start = time.perf_counter()
        tracks = am.track(d, method, model=estimate.model)
        taken = time.perf_counter() - start
        e = am.evaluate(tracks, truth)
        rows.append(
            [
                name,
                condition,
                method.name,
                f"{e.idf1:.3f}",
                f"{floors[0]:.3f}",
                f"{floors[1]:.3f} ({max_gap})",
                f"{e.switches_per_1000:.2f}",
                f"{e.wrong_links}, {e.broken_links}",
                str(e.fragments),
                f"{e.n_tracks}/{e.n_markers}",
                "–"
                if np.isnan(e.clutter_labelled_percent)
                else f"{e.clutter_labelled_percent:.1f}",
                f"{d.n_frames / taken:,.0f}",
                f"{seconds:.1f}",
            ]
        )
    return rows


def unlabelled_row(path: Path, capture: am.Capture) -> list[str]:
    """Track a capture without truth, and count where it parts from the recorder's pieces."""
    start = time.perf_counter()
    estimate = am.estimate_model(capture)
    seconds = time.perf_counter() - start
    start = time.perf_counter()
    tracks = am.track(capture, am.GNN(), model=estimate.model)
    taken = time.perf_counter() - start
    pieces = am.Tracks(detections=capture, labels=capture.labels)
    order, _ = pieces.by_track
    inside = np.diff(capture.labels[order]) == 0
    parted = int((np.diff(tracks.labels[order])[inside] != 0).sum()) if len(order) else 0
    return [
        path.name,
        str(capture.n_frames),
        str(capture.n_points),
        str(tracks.n_tracks),
        f"{100 * float((tracks.labels < 0).mean()):.2f}",
        f"{parted} of {int(inside.sum())}" if inside.any() else "–",
        f"{capture.n_frames / taken:,.0f}",
        f"{seconds:.1f}",
    ]


def table(head: list[str], rows: list[list[str]]) -> list[str]:
    return [
        "| " + " | ".join(head) + " |",
        "|" + "---|" * len(head),
        *("| " + " | ".join(row) + " |" for row in rows),
    ]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    beside = Path(__file__).resolve().parents[2] / "shared" / "data"
    parser.add_argument("--data", type=Path, default=beside)
    parser.add_argument("--only", default="")
    parser.add_argument("--markdown", type=Path)
    options = parser.parse_args()
    rows: list[list[str]] = []
    unlabelled: list[list[str]] = []
    for path in captures(options.data):
        if options.only not in path.name:
            continue
        capture = am.read(path)
        if not any(capture.names):
            unlabelled.append(unlabelled_row(path, capture))
            continue
        for condition, truth in (
            ("as captured", named_only(capture.tracks)),
            ("corrupted", corrupted(capture.tracks)),
        ):
            start = time.perf_counter()
            estimate = am.estimate_model(truth.detections)
            new = row_of(path.name, condition, truth, estimate, time.perf_counter() - start)
            rows += new
            print(*(" ".join(r) for r in new), sep="\n", flush=True)
    head = [
        "capture", "condition", "method", "IDF1", "floor 10", "floor d̄ (d̄)", "switches / 1000",
        "links wrong, broken", "fragments", "tracks/true", "clutter labelled %", "frames/s",
        "estimate s",
    ]  # fmt: skip
    lines = [*table(head, rows), ""]
    mean_head = ["condition", "method", "mean IDF1", "mean floor 10", "mean switches / 1000"]
    means: list[list[str]] = []
    for condition in ("as captured", "corrupted"):
        for method in METHODS:
            own = [row for row in rows if row[1] == condition and row[2] == method.name]
            figures = (np.mean([float(row[i]) for row in own]) for i in (3, 4, 6))
            means.append([condition, method.name, *(f"{figure:.3f}" for figure in figures)])
    lines += [*table(mean_head, means), ""]
    lines += table(
        ["unlabelled capture", "frames", "points", "tracks", "clutter %",
         "links parted inside the recorder's pieces", "frames/s", "estimate s"],
        unlabelled,
    )  # fmt: skip
    publish(lines, options.markdown)


if __name__ == "__main__":
    main()
