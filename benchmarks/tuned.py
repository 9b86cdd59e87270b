"""Parameters from the clip against parameters tuned on the truth, capture by capture.

The tuned ones are the best of a random search about the estimated ones: noise, accelerations,
detection, clutter, births, deaths, greatest speed and greatest gap, each mostly within a factor of
ten either way. They are chosen by the IDF1 of the first half of a capture and measured, as the
estimated ones are, on the second, whose truth neither has seen. Prints Markdown.

    python benchmarks/tuned.py [--trials N] [--methods NAME …] [--data FOLDER] [--only NAME]
                               [--most POINTS] [--markdown FILE]
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np

import asterism as am
from captures import captures, corrupted, named_only
from methods import METHODS
from report import publish, table

LONGEST_GAP = 120
STITCHED = ", stitched"


def half(truth: am.Tracks, which: int) -> am.Tracks:
    """Give the first or the second half of the frames."""
    d = truth.detections
    middle = d.n_frames // 2
    first, end = (0, middle) if which == 0 else (middle, d.n_frames)
    part, points = d.part(first, end), slice(d.offsets[first], d.offsets[end])
    return am.Tracks(detections=part, labels=truth.labels[points], names=truth.names)


def drawn(model: am.TrackingModel, rng: np.random.Generator) -> am.TrackingModel:
    """Draw a model about another."""
    factor = lambda: float(np.exp(rng.normal(0, np.log(10) / 2)))  # noqa: E731
    motion = model.motion
    if isinstance(motion, am.InteractingMotions):
        levels = [factor() for _ in motion.models]
        models = tuple(
            replace(m, acceleration_sigma=m.acceleration_sigma * f)
            for m, f in zip(motion.models, levels, strict=True)
            if isinstance(m, am.DWNA)
        )
        motion = replace(motion, models=models)
    elif isinstance(motion, am.DWNA):
        motion = replace(motion, acceleration_sigma=motion.acceleration_sigma * factor())
    elif isinstance(motion, am.RandomWalk):
        motion = replace(motion, walk_sigma=motion.walk_sigma * factor())
    s, p = model.sensor, model.population
    odds = s.p_detection / (1 - s.p_detection) * factor()
    return am.TrackingModel(
        motion=motion,
        sensor=am.Sensor(
            noise_sigma=s.noise_sigma * factor(),
            p_detection=min(max(odds / (1 + odds), 0.01), 0.9999),
            clutter_density=s.clutter_density * factor(),
        ),
        population=replace(
            p,
            birth_density=p.birth_density * factor(),
            p_disappear=min(p.p_disappear * factor(), 0.5),
            max_speed=p.max_speed * factor(),
            max_gap=int(np.clip(round(p.max_gap * factor()), 1, LONGEST_GAP)),
        ),
    )


def idf1(truth: am.Tracks, model: am.TrackingModel, name: str) -> float:
    method = METHODS[name.removesuffix(STITCHED)]
    if name.endswith(STITCHED):
        found = am.track(truth.detections, method, model=model, seed=1, stitch=True)
    else:
        found = am.track(truth.detections, method, model=model, seed=1)
    return am.evaluate(found, truth).idf1


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    beside = Path(__file__).resolve().parents[2] / "shared" / "data"
    parser.add_argument("--data", type=Path, default=beside)
    parser.add_argument("--only", default="")
    parser.add_argument("--trials", type=int, default=40)
    parser.add_argument("--most", type=int, default=130_000, help="points of a capture")
    known = [name + how for name in METHODS for how in ("", STITCHED)]
    usual = ["gnn", "smp, window=3", f"smp, window=3{STITCHED}"]
    parser.add_argument("--methods", nargs="+", choices=known, default=usual)
    parser.add_argument("--markdown", type=Path)
    options = parser.parse_args()
    rows: list[list[str]] = []
    gaps: dict[tuple[str, str], list[float]] = {}
    for path in captures(options.data):
        capture = am.read(path)
        if options.only not in path.name or not any(capture.names):
            continue
        if capture.n_points > options.most:
            continue
        for condition, make in {"as captured": named_only, "10 %/10 %": corrupted}.items():
            truth = make(capture.tracks)
            model = am.estimate_model(truth.detections).model
            first, second = half(truth, 0), half(truth, 1)
            row = [path.name, condition]
            for name in options.methods:
                rng = np.random.default_rng(1)
                trials = [model, *(drawn(model, rng) for _ in range(options.trials))]
                scores = [idf1(first, trial, name) for trial in trials]
                best = trials[int(np.argmax(scores))]
                ours, tuned = idf1(second, model, name), idf1(second, best, name)
                gaps.setdefault((condition, name), []).append(ours - tuned)
                row += [f"{ours:.4f}", f"{tuned:.4f}"]
            rows.append(row)
            print(*row, flush=True)
    for condition in ("as captured", "10 %/10 %"):
        row = [f"**estimated less tuned, mean of {len(rows) // 2}**", condition]
        for name in options.methods:
            row += [f"**{np.mean(gaps[condition, name]):+.4f}**", ""]
        rows.append(row)
    head = ["capture", "condition"]
    head += [f"{name}, {kind}" for name in options.methods for kind in ("estimated", "tuned")]
    lines = [f"IDF1 of the second half; tuned: the best of {options.trials + 1} on the first:", ""]
    publish([*lines, *table(head, rows)], options.markdown)


if __name__ == "__main__":
    main()
