"""Does noise by region pay? Eight parts of the room, each with its own noise, against one for all.

The room is cut at the medians of the three coordinates. On the first half of a capture, with its
truth, the noise of each part is searched that makes the true tracks most probable, and, for a fair
comparison, one noise for all in the same way. The second half is then tracked with either, the
noise of a part as the detections' own covariances. That is more than a clip without labels could
teach: where even this gains nothing, estimating it cannot. Prints Markdown.

    python benchmarks/regions.py [--data FOLDER] [--only NAME] [--most POINTS] [--markdown FILE]
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

import asterism as am
from captures import captures, corrupted, named_only
from methods import METHODS
from report import conditions, publish, table
from tuned import half

if TYPE_CHECKING:
    from numpy.typing import NDArray

BASES = (0.35, 0.5, 0.7, 1.0, 1.4)
"""Noise of the sensor that is tried, in that of the estimated model."""
EXTRAS = (0.0, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0)
"""Variance beyond it that is tried for each part, in that of the estimated model."""
ROUNDS = 2
WAYS = ("gnn", "smp, window=3")


def parts(points: NDArray[np.float64], middle: NDArray[np.float64]) -> NDArray[np.int64]:
    """Tell in which of the eight parts each point lies."""
    return ((points > middle) @ (2 ** np.arange(points.shape[1]))).astype(np.int64)


def with_noise(truth: am.Tracks, extra: NDArray[np.float64]) -> am.Tracks:
    """Give each detection a variance of its own beyond the sensor's, m²."""
    d = truth.detections
    own = extra[:, None, None] * np.eye(d.n_axes)
    return replace(truth, detections=replace(d, covariances=own))


def density(truth: am.Tracks, model: am.TrackingModel, extra: NDArray[np.float64]) -> float:
    """Log density of the true tracks, nats."""
    return float(am.filter.filter_states(with_noise(truth, extra), model).log_densities.sum())


def searched(
    truth: am.Tracks, model: am.TrackingModel, region: NDArray[np.int64], n: int
) -> tuple[am.TrackingModel, NDArray[np.float64]]:
    """Find the sensor's noise and each region's extra variance, m², coordinate by coordinate."""
    unit = model.sensor.noise_sigma**2
    found: list[tuple[float, am.TrackingModel, NDArray[np.float64]]] = []
    for base in BASES:
        sensor = replace(model.sensor, noise_sigma=base * model.sensor.noise_sigma)
        one = replace(model, sensor=sensor)
        extra = np.zeros(n)
        for _ in range(ROUNDS):
            for r in range(n):
                tried = []
                for value in EXTRAS:
                    extra[r] = value * unit
                    tried.append(density(truth, one, extra[region]))
                extra[r] = EXTRAS[int(np.argmax(tried))] * unit
        found.append((density(truth, one, extra[region]), one, extra))
    best = max(found, key=lambda each: each[0])
    return best[1], best[2]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    beside = Path(__file__).resolve().parents[2] / "shared" / "data"
    parser.add_argument("--data", type=Path, default=beside)
    parser.add_argument("--only", default="")
    parser.add_argument("--most", type=int, default=130_000, help="points of a capture")
    parser.add_argument("--markdown", type=Path)
    options = parser.parse_args()
    rows: list[list[str]] = []
    gains: dict[str, list[list[float]]] = {}
    for path in captures(options.data):
        capture = am.read(path) if options.only in path.name else None
        if capture is None or not any(capture.names) or capture.n_points > options.most:
            continue
        for condition, make in {"as captured": named_only, "10 %/10 %": corrupted}.items():
            truth = make(capture.tracks)
            model = am.estimate_model(truth.detections).model
            middle = np.median(truth.detections.points, axis=0)
            first, second = half(truth, 0), half(truth, 1)
            scores: dict[str, list[float]] = {}
            ratio = 1.0
            for name, n in (("one", 1), ("parts", 2**truth.detections.n_axes)):
                regions = [parts(h.detections.points, middle) % n for h in (first, second)]
                fitted, extra = searched(first, model, regions[0], n)
                variances = extra + fitted.sensor.noise_sigma**2
                ratio = float(np.sqrt(variances.max() / variances.min()))
                noisy = with_noise(second, extra[regions[1]])
                scores[name] = [density(second, fitted, extra[regions[1]])]
                for way in WAYS:
                    tracks = am.track(noisy.detections, METHODS[way], model=fitted, seed=1)
                    scores[name].append(am.evaluate(tracks, second).idf1)
            nats = 1e3 * (scores["parts"][0] - scores["one"][0]) / second.detections.n_points
            change = [b - a for a, b in zip(scores["one"][1:], scores["parts"][1:], strict=True)]
            gains.setdefault(condition, []).append(change)
            row = [path.name, condition, f"{ratio:.1f}", f"{nats:+.0f}"]
            for a, b in zip(scores["one"][1:], scores["parts"][1:], strict=True):
                row += [f"{a:.4f}", f"{b:.4f}"]
            rows.append(row)
            print(*row, flush=True)
    for condition, each in gains.items():
        mean = np.mean(each, axis=0)
        cells = [cell for value in mean for cell in ("", f"**{value:+.4f}**")]
        rows.append(["**parts less one, mean**", condition, "", "", *cells])
    head = ["capture", "condition", "largest σ / smallest", "nats gained for 1000 points"]
    head += [f"{way}, {kind}" for way in WAYS for kind in ("one noise", "by part")]
    lines = ["IDF1 of the second half, noise learnt from the truth of the first:", ""]
    publish([*lines, *table(head, rows), "", f"{conditions()}."], options.markdown)


if __name__ == "__main__":
    main()
