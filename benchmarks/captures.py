"""The table of real captures: each method with the estimated model, as captured and corrupted.

Finds the captures in ``../shared/data`` beside the project (or ``--data``); prints Markdown.
Frames a second are of processor time.

    python benchmarks/captures.py [--data FOLDER] [--only NAME] [--markdown FILE]
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import numpy as np

import asterism as am
from methods import METHODS, LinkConfidence
from report import publish, table

SUFFIXES = (".c3d", ".tsv", "recording_000", "drone2", "marker3")


def captures(folder: Path) -> list[Path]:
    return sorted(
        (p for p in folder.rglob("*") if p.is_file() and p.name.endswith(SUFFIXES)),
        key=lambda p: p.name.lower(),
    )


def named_only(truth: am.Tracks) -> am.Tracks:
    """Leave out the unnamed points, of which nothing is known; all else stays as recorded."""
    return am.simulate.corrupt(truth)


def corrupted(truth: am.Tracks, seed: int = 1) -> am.Tracks:
    """10 % of the detections missing, 10 % clutter, 0.3 mm of noise."""
    return am.simulate.corrupt(truth, missing=0.1, clutter=0.1, noise=3e-4, seed=seed)


def score(
    truth: am.Tracks, model: am.TrackingModel
) -> tuple[dict[str, am.metrics.Evaluation], dict[str, float], dict[str, am.Tracks]]:
    """Track by every method: how well, and how many frames a second."""
    found: dict[str, am.metrics.Evaluation] = {}
    speed: dict[str, float] = {}
    results: dict[str, am.Tracks] = {}
    for name, method in METHODS.items():
        start = time.process_time()
        results[name] = am.track(truth.detections, method, model=model)
        speed[name] = truth.detections.n_frames / (time.process_time() - start)
        found[name] = am.evaluate(results[name], truth)
    return found, speed, results


def details(e: am.metrics.Evaluation) -> list[str]:
    clutter = e.clutter_labelled_percent
    return [
        f"{e.wrong_links}, {e.broken_links}",
        str(e.fragments),
        f"{e.n_tracks}/{e.n_markers}",
        "–" if np.isnan(clutter) else f"{clutter:.1f}",
    ]


def unlabelled_row(path: Path, capture: am.Capture) -> list[str]:
    """Track a capture without truth, and count where it parts from the recorder's pieces."""
    start = time.process_time()
    estimate = am.estimate_model(capture)
    seconds = time.process_time() - start
    start = time.process_time()
    tracks = am.track(capture, am.GNN(), model=estimate.model)
    taken = time.process_time() - start
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


def oracle_idf1(truth: am.Tracks, max_gap: int) -> float:
    """IDF1 of the true tracks, cut at gaps that no track bridges."""
    return am.evaluate(am.metrics.oracle_tracks(truth, max_gap), truth).idf1


def options_of_the_run(description: str | None) -> argparse.Namespace:
    """Read the options of a benchmark of captures: `data`, `only` and `markdown`."""
    parser = argparse.ArgumentParser(description=description)
    beside = Path(__file__).resolve().parents[2] / "shared" / "data"
    parser.add_argument("--data", type=Path, default=beside)
    parser.add_argument("--only", default="")
    parser.add_argument("--markdown", type=Path)
    return parser.parse_args()


def main() -> None:
    options = options_of_the_run(__doc__)
    conditions = {"as captured": named_only, "corrupted": corrupted}
    scores: list[list[str]] = []
    more: list[list[str]] = []
    unlabelled: list[list[str]] = []
    idf1: dict[tuple[str, str], list[float]] = {}
    switches: dict[tuple[str, str], list[float]] = {}
    confidence = LinkConfidence()
    for path in captures(options.data):
        if options.only not in path.name:
            continue
        capture = am.read(path)
        if not any(capture.names):
            unlabelled.append(unlabelled_row(path, capture))
            continue
        for condition, make in conditions.items():
            truth = make(capture.tracks)
            start = time.process_time()
            model = am.estimate_model(truth.detections).model
            seconds = time.process_time() - start
            gap = model.population.max_gap
            oracles = [oracle_idf1(truth, g) for g in (10, gap)]
            found, speed, results = score(truth, model)
            row = [path.name, condition, f"{oracles[0]:.3f}", f"{oracles[1]:.3f} ({gap})"]
            for name, e in found.items():
                row.append(f"{e.idf1:.3f} ({e.switches_per_1000:.2f})")
                idf1.setdefault((condition, name), []).append(e.idf1)
                switches.setdefault((condition, name), []).append(e.switches_per_1000)
                rates = f"{speed[name]:,.0f}", f"{seconds:.1f}"
                more.append([path.name, condition, name, *details(e), *rates])
                confidence.add(name, results[name], truth)
            scores.append(row)
            print(*row, flush=True)
    for condition in conditions:
        row = ["**mean**", condition, "", ""]
        for name in METHODS:
            key = (condition, name)
            row.append(f"**{np.mean(idf1[key]):.3f}** ({np.mean(switches[key]):.2f})")
        scores.append(row)
    lines = ["IDF1, and switches for 1000 detections:", ""]
    head = ["capture", "condition", "oracle 10", "oracle d̄ (d̄)", *METHODS]
    lines += [*table(head, scores), ""]
    lines += ["Confidence of the links of all captures, where a method has any:", ""]
    lines += [*confidence.table(), ""]
    lines += ["Captures without truth:", ""]
    lines += table(
        ["capture", "frames", "points", "tracks", "clutter %",
         "links parted inside the recorder's pieces", "frames/s", "estimate s"],
        unlabelled,
    )  # fmt: skip
    lines += ["", "All that was counted:", ""]
    head = [
        "capture", "condition", "method", "links wrong, broken", "fragments", "tracks/true",
        "clutter labelled %", "frames/s", "estimate s",
    ]  # fmt: skip
    lines += table(head, more)
    publish(lines, options.markdown)


if __name__ == "__main__":
    main()
