"""Fit the constants of the confidence on simulated people, and check them on real captures.

People walk, run, turn and jump, two walk through each other, and fingers move; for every second
seed markers wobble, slip and move with posture; corrupted in six ways. Each part of a track between
uncertain links, and each track without one, is right if most of its detections are of the marker
that holds most of the track; each exchange is right if the later part of one track belongs to the
other. The logistic
functions of ``tracking/confidence/calibration.py`` are fitted by maximum likelihood. The check is
of the captures of ``../shared/data`` (or ``--data``) in four conditions, without the detections
with a wrong label in the file (`wrong.py`).

    python benchmarks/calibration.py [--seeds N] [--data FOLDER] [--markdown FILE]
"""

from __future__ import annotations

import argparse
import itertools
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

import asterism as am
from asterism.simulate import Burst, Ghosts, Visits
from asterism.tracking.confidence import calibration
from asterism.tracking.confidence.identity import Examined, examine
from asterism.tracking.pipeline import without_edits
from captures import captures, named_only
from identity import CONDITIONS
from report import conditions, publish, table
from wrong import is_wrong, wrong_runs

Array = NDArray[np.float64]
Corrupt = Callable[[am.Tracks, int], am.Tracks]

FIRST_SEED = 11
SCENES: dict[str, Callable[[int], am.Tracks]] = {
    **{
        activity: lambda seed, activity=activity: am.simulate.person(
            activity=activity, frames=600, seed=seed
        )
        for activity in ("walk", "run", "turn", "jump")
    },
    "two people": lambda seed: am.simulate.two_people(frames=400, seed=seed),
    "fingers": lambda seed: am.simulate.fingers(seed=seed),
}


def loosened(truth: am.Tracks, seed: int) -> am.Tracks:
    """Let markers wobble on soft tissue by millimetres to centimetres, and a fifth of them slip.

    A fifth, as those above a shoulder blade, is shifted for seconds by centimetres, with posture.
    """
    rng = np.random.default_rng(seed)
    positions, t = truth.positions(), truth.detections.times
    for k in range(truth.n_tracks):
        wobble = rng.exponential(0.005) * np.sin(
            2 * np.pi * (rng.uniform(0.5, 3) * t + rng.uniform())
        )
        positions[:, k] += wobble[:, None] * rng.standard_normal(3) / np.sqrt(3)
        if rng.uniform() < 0.2:
            when = rng.uniform(t[0], t[-1])
            slip = 1 / (1 + np.exp(-(t - when) / 0.1))
            positions[:, k] += slip[:, None] * rng.normal(0, 0.03, 3)
        if rng.uniform() < 0.2:
            phase = 2 * np.pi * (rng.uniform(0.1, 0.5) * t + rng.uniform())
            shift = np.clip(2 * np.sin(phase) - 1, 0, 1)
            positions[:, k] += shift[:, None] * rng.normal(0, 0.03, 3)
    return am.Tracks.from_dense(t, positions, truth.names)


def missing(truth: am.Tracks, seed: int, stride: int) -> am.Tracks:
    return am.simulate.corrupt(
        truth, missing=0.1, clutter=0.1, noise=3e-4, stride=stride, seed=seed
    )


def bursts(truth: am.Tracks, seed: int, stride: int) -> am.Tracks:
    return am.simulate.corrupt(
        truth, burst=Burst(), ghosts=Ghosts(), noise=3e-4, stride=stride, seed=seed
    )


VISITS = "bursts, visits"
"""Markers that leave, which makes short tracks. One that returns counts as another one, which no
join can know: only tracks without an uncertain link, and so without a join, are taken from it."""


def visits(truth: am.Tracks, seed: int) -> am.Tracks:
    return am.simulate.corrupt(
        truth, burst=Burst(), ghosts=Ghosts(), visits=Visits(), noise=3e-4, seed=seed
    )


CORRUPTED: dict[str, Corrupt] = {
    "10 %/10 %": lambda truth, seed: missing(truth, seed, 1),
    "10 %/10 %, half rate": lambda truth, seed: missing(truth, seed, 2),
    "10 %/10 %, third of the rate": lambda truth, seed: missing(truth, seed, 3),
    "bursts": lambda truth, seed: bursts(truth, seed, 1),
    "bursts, half rate": lambda truth, seed: bursts(truth, seed, 2),
}


def tracked(
    truth: am.Tracks, *, retry: bool = True
) -> tuple[am.Tracks, am.TrackingModel, am.tracking.Stitching | None]:
    """Track by the default path, up to the confidence; `retry` is that of the recipe."""
    recipe = am.tracking.plan_tracking(truth.detections).recipe
    recipe = replace(recipe, retry=recipe.retry and retry)
    begun = without_edits(recipe, truth.detections)
    return begun.tracks, begun.model, begun.stitching


def parts_of(
    found: Examined, tracks: am.Tracks, truth: am.Tracks
) -> tuple[tuple[Array, Array], tuple[Array, Array], tuple[Array, Array]]:
    """Return features, and whether each is right, of the parts, in ranges, and of whole tracks."""
    parts, evidence = found.parts, found.evidence
    is_whole = parts.is_whole(tracks.n_tracks)
    used = evidence.is_known & ~is_whole
    wrong = is_wrong(tracks, truth)[tracks.by_track[0]]
    share = 1 - np.add.reduceat(wrong, parts.offsets[:-1]) / parts.n_detections
    right = (share > 0.5).astype(float)
    features, in_range = (
        calibration.part_features(evidence, parts.weakest, parts.n_detections, in_range=each)[used]
        for each in (False, True)
    )
    whole = calibration.track_features(parts.n_detections[is_whole])
    return (features, right[used]), (in_range, right[used]), (whole, right[is_whole])


def exchanges_of(found: Examined, truth: am.Tracks) -> tuple[Array, Array]:
    """Return features of the exchanges between tracks, and whether each is right."""
    ex = found.exchanges
    marker = np.append(truth.labels, -2)  # the last is of no detection
    (a, b), (c, d) = marker[ex.before].T, marker[ex.after].T  # c follows a, and d follows b
    crossed = ((a == d) & (a >= 0)) | ((b == c) & (b >= 0))
    features = calibration.exchange_features(ex.ratios, ex.is_mutual)
    return features, (crossed & ((a != c) | (b != d))).astype(float)


def fit(features: Array, right: Array, weights: Array) -> Array:
    """Return the maximum-likelihood factors of a logistic function."""
    weights = weights / weights.sum()

    def loss(factors: Array) -> tuple[float, Array]:
        z = features @ factors
        error = 1 / (1 + np.exp(-z)) - right
        return float(weights @ (np.logaddexp(0, z) - right * z)), features.T @ (weights * error)

    return minimize(loss, np.zeros(features.shape[1]), jac=True, method="BFGS").x


def simulated(seeds: int) -> Iterator[tuple[str, am.Tracks]]:
    for seed, (scene, make) in itertools.product(
        range(FIRST_SEED, FIRST_SEED + seeds), SCENES.items()
    ):
        truth = make(seed) if seed % 2 else loosened(make(seed), seed)
        for name, corrupt in {**CORRUPTED, VISITS: visits}.items():
            yield f"{scene}, seed {seed}, {name}", corrupt(truth, seed)


class Reliability:
    """Confidence of identities, and whether they are right, over several captures."""

    def __init__(self) -> None:
        self.parts: list[tuple[Array, NDArray[np.bool_]]] = []

    def add(self, tracks: am.Tracks, truth: am.Tracks, file: am.Tracks | None = None) -> None:
        """Count the detections of one result, those with a wrong label in the file left out."""
        assert tracks.identity_confidence is not None
        inside = tracks.labels >= 0
        for run in wrong_runs(tracks, truth, file):
            inside[run.detections] &= run.kind != "label error"
        self.parts.append((tracks.identity_confidence[inside], ~is_wrong(tracks, truth)[inside]))

    def row(self, name: str) -> list[str]:
        """Return the row of a table."""
        sure, right = (np.concatenate(each) for each in zip(*self.parts, strict=True))
        c = am.metrics.calibration_curve(sure, right)
        return [
            name, f"{len(right):,}", f"{int((~right).sum()):,}", f"{sure.mean():.4f}",
            f"{right.mean():.4f}", f"{c.ece:.4f}", f"{c.auc:.3f}", f"{(sure >= 0.99).mean():.3f}",
        ]  # fmt: skip


HEAD = (
    "detections", "in tracks", "wrong", "mean confidence", "right", "ECE",
    "AUC for wrong identities", "confidence ≥ 0.99",
)  # fmt: skip


def _together(pairs: list[tuple[Array, Array]]) -> tuple[Array, Array]:
    return np.concatenate([x for x, _ in pairs]), np.concatenate([y for _, y in pairs])


def _rounded(values: Array) -> tuple[float, ...]:
    return tuple(round(float(value), 2) for value in values)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    beside = Path(__file__).resolve().parents[2] / "shared" / "data"
    parser.add_argument("--seeds", type=int, default=4)
    parser.add_argument("--data", type=Path, default=beside)
    parser.add_argument("--markdown", type=Path)
    options = parser.parse_args()
    parts: list[tuple[Array, Array]] = []
    identities: list[tuple[Array, Array]] = []
    whole: list[tuple[Array, Array]] = []
    exchanges: list[tuple[Array, Array]] = []
    reliability: dict[str, Reliability] = {}
    for name, truth in simulated(options.seeds):
        # Further attempts are chosen by the confidence that is fitted here.
        tracks, model, stitching = tracked(truth, retry=False)
        found = examine(tracks, model, stitching)
        of_parts, in_range, of_tracks = parts_of(found, tracks, truth)
        whole.append(of_tracks)
        if name.endswith(VISITS):
            continue
        parts.append(of_parts)
        identities.append(in_range)
        exchanges.append(exchanges_of(found, truth))
        own = reliability.setdefault("simulated people", Reliability())
        own.add(am.tracking.assess(tracks, model, stitching), truth)
        print(name, flush=True)
    # All exchanges and tracks count the same. Parts count for less where a capture has more of
    # them: one that is wrong throughout has a third of all.
    counts = np.concatenate([np.full(len(right), len(right)) for _, right in parts])
    fitted = {
        "EXCHANGE": fit(*_together(exchanges), np.ones(sum(len(right) for _, right in exchanges))),
        "PART": fit(*_together(parts), 1 / counts),
        "IDENTITY": fit(*_together(identities), 1 / counts),
        "TRACK": fit(*_together(whole), np.ones(sum(len(right) for _, right in whole))),
    }
    for name, values in fitted.items():
        print(name, "=", _rounded(values), flush=True)
    each: list[list[str]] = []
    for path in captures(options.data):
        capture = am.read(path)
        if not any(capture.names):
            continue
        file = named_only(capture.tracks)
        for condition, corrupt in CONDITIONS.items():
            truth = corrupt(capture.tracks)
            tracks = am.tracking.assess(*tracked(truth))
            reliability.setdefault(f"captures, {condition}", Reliability()).add(tracks, truth, file)
            own = Reliability()
            own.add(tracks, truth, file)
            each.append(own.row(f"{path.name}, {condition}"))
            print(*each[-1], sep=" | ", flush=True)
    lines = [*table(HEAD, [r.row(name) for name, r in reliability.items()]), ""]
    constants = ", ".join(f"{name} {_rounded(values)}" for name, values in fitted.items())
    lines += [f"Fitted on simulated people: {constants}.", ""]
    lines += ["Each capture:", "", *table(HEAD, each), "", f"{conditions()}."]
    publish(lines, options.markdown)


if __name__ == "__main__":
    main()
