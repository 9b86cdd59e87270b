"""Identity through occlusion: captures corrupted in four ways, each method alone and stitched.

As captured; 10 % missing, 10 % clutter, 0.3 mm of noise; bursts (up to 5 markers occluded at a time
for 5 to 60 frames, up to 3 ghosts within 5 cm of a marker for 1 to 10 frames, 0.3 mm of noise); the
second at half the rate. The identity of a marker counts across its gaps: the oracles are the truth,
broken at every gap of more than 10, and of more than 60 frames. “By default” is `track` without a
method; with `--methods` and no name, it is all that is measured, with three seeds, and at a quarter
of the rate too.

    python benchmarks/identity.py [--data FOLDER] [--only NAME] [--methods NAME …] [--markdown FILE]
"""

from __future__ import annotations

import argparse
import itertools
import time
from pathlib import Path
from typing import Any

import numpy as np

import asterism as am
from asterism.simulate import Burst, Ghosts
from captures import captures, corrupted, named_only
from methods import METHODS as QUICK
from report import conditions, publish, table


def bursts(truth: am.Tracks, seed: int = 1) -> am.Tracks:
    return am.simulate.corrupt(truth, burst=Burst(), ghosts=Ghosts(), noise=3e-4, seed=seed)


def half_rate(truth: am.Tracks, seed: int = 1) -> am.Tracks:
    return am.simulate.corrupt(truth, missing=0.1, clutter=0.1, noise=3e-4, stride=2, seed=seed)


def quarter_rate(truth: am.Tracks) -> am.Tracks:
    return am.simulate.corrupt(truth, missing=0.1, clutter=0.1, noise=3e-4, stride=4, seed=1)


DEFAULT = "by default"
"""What `track` selects, stitched or not."""
METHODS: dict[str, am.tracking.Method[Any]] = {**QUICK, "mda": am.MDA()}
HALF = "10 %/10 %, half rate"
CONDITIONS = {
    "as captured": named_only,
    "10 %/10 %": corrupted,
    "bursts": bursts,
    HALF: half_rate,
}
DEFAULT_CONDITIONS = {**CONDITIONS, "10 %/10 %, quarter rate": quarter_rate}
"""Conditions where only the default is measured."""
SEEDED = {"10 %/10 %": corrupted, "bursts": bursts, HALF: half_rate}
SEEDS = (1, 2, 3)
"""Seeds of these conditions there."""


class Figures:
    """What is measured of one way over all captures."""

    def __init__(self) -> None:
        self.rows: list[tuple[float, ...]] = []

    def add(self, e: am.metrics.Evaluation, ms: float) -> None:
        """Count one capture, stitched in so many milliseconds a frame."""
        self.rows.append((e.idf1, e.switches_per_1000, e.clutter_labelled_percent, ms))

    def identity(self) -> str:
        """Give mean IDF1 and switches for 1000 detections."""
        idf1, switches = np.array(self.rows).mean(axis=0)[:2]
        return f"{idf1:.4f} ({switches:.2f})"

    def clutter(self) -> str:
        """Give the mean share of clutter that has a label, %."""
        share = np.array(self.rows)[:, 2]
        return "–" if np.isnan(share).all() else f"{np.nanmean(share):.1f}"

    def ms(self) -> str:
        """Give the median time of a frame, milliseconds."""
        return f"{np.median(np.array(self.rows)[:, 3]):.2f}"


class Joins:
    """How often joins are right that were held for so probable."""

    EDGES = (0, 0.5, 0.7, 0.9, 0.97, 0.99, 0.999, 1)

    def __init__(self) -> None:
        self.said: list[float] = []
        self.is_right: list[bool] = []

    def add(self, found: am.tracking.Stitching, truth: am.Tracks) -> None:
        """Count the joins of one capture; right is what the marker was for the most part so far."""
        frame = truth.detections.frame_of
        for join in found.joins:
            own = found.tracks.labels == join.marker
            before = np.bincount(truth.labels[own & (frame <= join.last)] + 1).argmax() - 1
            now = truth.labels[own & (frame == join.first)][0]
            self.said.append(join.probability)
            self.is_right.append(bool(before == now >= 0))

    def rows(self) -> list[list[str]]:
        """Give a row for each range of probability."""
        said, is_right = np.array(self.said), np.array(self.is_right)
        rows: list[list[str]] = []
        for low, high in itertools.pairwise(self.EDGES):
            inside = (said >= low) & (said < high)
            if inside.any():
                rows.append(
                    [f"{100 * low:g} to {100 * high:g} %", str(int(inside.sum())),
                     f"{100 * said[inside].mean():.1f}", f"{100 * is_right[inside].mean():.1f}"]
                )  # fmt: skip
        return rows


def options_of_the_run() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__)
    beside = Path(__file__).resolve().parents[2] / "shared" / "data"
    parser.add_argument("--data", type=Path, default=beside)
    parser.add_argument("--only", default="")
    parser.add_argument("--methods", nargs="*", default=list(METHODS))
    parser.add_argument("--markdown", type=Path)
    return parser.parse_args()


def main() -> None:
    options = options_of_the_run()
    found: dict[tuple[str, str, str], Figures] = {}
    oracles: dict[tuple[str, int], list[float]] = {}
    joins = Joins()
    each: list[list[str]] = []
    chosen = CONDITIONS if options.methods else DEFAULT_CONDITIONS
    for path in captures(options.data):
        capture = am.read(path) if options.only in path.name else None
        if capture is None or not any(capture.names):
            continue
        made = [(name, name, make(capture.tracks)) for name, make in chosen.items()]
        if not options.methods:
            more = [
                (c, f"{c}, seed {k}", make(capture.tracks, k))
                for c, make in SEEDED.items()
                for k in SEEDS
            ]
            made = [one for one in made if one[0] not in SEEDED] + more
        for condition, called, truth in made:
            d = truth.detections
            model = am.estimate_model(d).model
            short = am.tracking.tracklet_model(model)
            row = [path.name, called]
            for gap in (10, 60):
                value = am.evaluate(am.metrics.oracle_tracks(truth, gap), truth).idf1
                oracles.setdefault((condition, gap), []).append(value)
                row.append(f"{value:.3f}")
            for name in options.methods:
                alone = am.evaluate(am.track(d, METHODS[name], model=model, seed=0), truth)
                fragments = am.track(d, METHODS[name], model=short, seed=0)
                start = time.process_time()
                stitching = am.stitch(fragments, short)
                ms = 1e3 * (time.process_time() - start) / d.n_frames
                e = am.evaluate(stitching.tracks, truth)
                if condition == "bursts":
                    joins.add(stitching, truth)
                found.setdefault((condition, name, "alone"), Figures()).add(alone, np.nan)
                found.setdefault((condition, name, "stitched"), Figures()).add(e, ms)
                row.append(f"{alone.idf1:.3f} → {e.idf1:.3f}")
            e = am.evaluate(am.track(d, model=model, seed=0), truth)
            found.setdefault((condition, DEFAULT, ""), Figures()).add(e, np.nan)
            row.append(f"{e.idf1:.3f}")
            each.append(row)
            print(*row, sep=" | ", flush=True)
    means = [
        [f"oracle at {gap} frames", *(f"{np.mean(oracles[c, gap]):.4f}" for c in chosen)]
        for gap in (10, 60)
    ]
    rest: list[list[str]] = []
    for name in options.methods:
        pairs = [(found[c, name, "alone"], found[c, name, "stitched"]) for c in chosen]
        means.append([name, *(f"{a.identity()} → {b.identity()}" for a, b in pairs)])
        rest.append(
            [name, *(f"{a.clutter()} → {b.clutter()}" for a, b in pairs[1:]),
             *(b.ms() for _, b in pairs)]
        )  # fmt: skip
    means.append([DEFAULT, *(found[c, DEFAULT, ""].identity() for c in chosen)])
    publish(page(options.methods, list(chosen), means, rest, joins, each), options.markdown)


def page(
    methods: list[str],
    names: list[str],
    means: list[list[str]],
    rest: list[list[str]],
    joins: Joins,
    each: list[list[str]],
) -> list[str]:
    """Give the lines of the page."""
    lines = ["Means over the captures, IDF1 (switches for 1000 detections), alone → stitched:", ""]
    lines += [*table(["", *names], means), ""]
    if methods:
        lines += [
            "Ghosts and clutter that are labelled, %, and processor time of stitching, ms a frame:"
        ]
        head = [*names[1:], *(f"ms, {c}" for c in names)]
        lines += ["", *table(["", *head], rest), ""]
        lines += ["Joins of all methods in bursts, by how probable they were held:", ""]
        lines += [*table(["held for", "joins", "mean, %", "right, %"], joins.rows()), ""]
    lines += ["IDF1, alone → stitched:", ""]
    lines += table(["capture", "condition", "oracle 10", "oracle 60", *methods, DEFAULT], each)
    return [*lines, "", f"{conditions()}."]


if __name__ == "__main__":
    main()
