"""Prediction errors of markers by own motion and with shared accelerations, and their variance.

The true tracks of captures as recorded, and with every second frame. Each detection is predicted
from the detections of its marker in earlier frames, by the estimated model and by that of
`fit_body_motion`; with shared accelerations by the latter and by the bonded markers before it in
the same frame. How the markers accelerate together is learnt in every other second of the capture,
and all is measured in the seconds between; a capture of less than four seconds has blocks of a
quarter of it. The NIS is the squared error of an axis over its predicted variance, 1 in the mean if
calibrated; the gain is that of the log density of a detection over own motion (`shared_gains`).
Counted are detections whose marker was detected in both frames before, which count as known even
where they are of another block.

    python benchmarks/innovations.py [--data FOLDER] [--only NAME] [--markdown FILE]
"""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any

import numpy as np

import asterism as am
from asterism.model.shared_acceleration import (
    COMPONENTS,
    SharedAcceleration,
    shared_densities,
)
from asterism.tracking.estimation import fit_body_motion
from captures import captures, options_of_the_run
from report import conditions, publish, table

if TYPE_CHECKING:
    from numpy.typing import NDArray

BLOCK = 1.0
"""Length of a block, seconds."""
MIN_BLOCKS = 4
"""Number of blocks of a capture that is too short for as many of `BLOCK`."""
WAYS = ("own motion", "own motion, of bodies", "with shared accelerations")


def is_left_out(d: am.Detections) -> NDArray[np.bool_]:
    """Return which frames are left out of the learning: those of every other block, (T,)."""
    seconds = d.times - d.times[0]
    block = min(BLOCK, (seconds[-1] + d.step) / MIN_BLOCKS)
    # Half a step on both sides: no rounding of a time decides which block a frame is in.
    return np.floor((seconds + d.step / 2) / block).astype(int) % 2 == 1


def learnt_elsewhere(truth: am.Tracks, model: am.TrackingModel) -> SharedAcceleration:
    """Learn shared accelerations from the frames that are not left out."""
    labels = np.where(is_left_out(truth.detections)[truth.detections.frame_of], -1, truth.labels)
    known = am.Tracks(detections=truth.detections, labels=labels, names=truth.names)
    return am.tracking.learn_shared_acceleration(known, model)


def by_own_motion(shared: SharedAcceleration) -> SharedAcceleration:
    """Return the same markers with the weight 1 for own motion."""
    weights = np.zeros_like(shared.weights)
    weights[:, COMPONENTS.index("own")] = 1.0
    return dataclasses.replace(shared, weights=weights)


def innovations(
    truth: am.Tracks, model: am.TrackingModel, shared: SharedAcceleration
) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
    """Return the errors of the predictions, metres, the NIS of an axis, and the gains, nats."""
    d = truth.detections
    _, predicted = shared_densities(truth, model, shared)
    order, _ = truth.by_track
    frame, track = d.frame_of[order], truth.labels[order]
    in_a_row = np.flatnonzero((track[2:] == track[:-2]) & (frame[2:] - frame[:-2] == 2)) + 2
    own = order[in_a_row]
    own = own[is_left_out(d)[d.frame_of[own]] & np.isfinite(predicted[own, 0])]
    squares = ((d.points[own] - predicted[own, :-1]) ** 2).sum(axis=1)
    gains = am.model.shared_gains(truth, model, shared)
    return np.sqrt(squares), squares / d.n_axes / predicted[own, -1], gains[own]


def main() -> None:
    options = options_of_the_run(__doc__)
    rows: list[list[str]] = []
    for path in captures(options.data):
        capture = am.read(path) if options.only in path.name else None
        if capture is None or not any(capture.names):
            continue
        for rate, stride in (("as captured", 1), ("half rate", 2)):
            truth = am.simulate.corrupt(capture.tracks, stride=stride)
            d = truth.detections
            model = am.estimate_model(d).model
            fitted = fit_body_motion(d, model)
            ways = [(model, by_own_motion(learnt_elsewhere(truth, model)))]
            if fitted is not None:
                shared = learnt_elsewhere(truth, fitted[0])
                ways += [(fitted[0], by_own_motion(shared)), (fitted[0], shared)]
            row, gain = [path.name, rate], "–"
            for each in ways:
                errors, nis, gains = innovations(truth, *each)
                size = 1e3 * np.quantile(errors, [0.5, 0.99])
                row += [f"{size[0]:.1f} / {size[1]:.0f}", f"{nis.mean():.2f}"]
                gain = f"{gains.mean():.2f}"
            rows.append(row + ["–"] * (2 + 2 * len(WAYS) - len(row)) + [gain])
            print(*rows[-1], sep=" | ", flush=True)
    head = ["capture", "rate"]
    for way in WAYS:
        head += [f"{way}: median / 99 %, mm", "NIS"]
    head.append("gain over own motion, nats")
    publish([*table(head, rows), "", f"{conditions()}."], options.markdown)


if __name__ == "__main__":
    main()
