"""Prediction errors of markers by own motion and with shared accelerations, and their variance.

The true tracks of captures as recorded, and with every second frame. Each detection is predicted
from the detections of its marker in earlier frames, by the estimated model and by that of
`fit_body_motion`; with shared accelerations by the latter and by the bonded markers before it in
the same frame. How the markers accelerate together is learnt in the first half of the capture, and
all is measured in the second. The NIS is the squared error of an axis over its predicted variance,
1 in the mean if calibrated. Counted are detections whose marker was detected in both frames before.

    python benchmarks/innovations.py [--data FOLDER] [--only NAME] [--markdown FILE]
"""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any

import numpy as np

import asterism as am
from asterism.model.shared_acceleration import SharedAcceleration, shared_densities
from asterism.tracking.estimation import fit_body_motion
from captures import captures, options_of_the_run
from report import conditions, publish, table

if TYPE_CHECKING:
    from numpy.typing import NDArray

WAYS = ("own motion", "own motion, of bodies", "with shared accelerations")


def learnt_before(truth: am.Tracks, model: am.TrackingModel, frame: int) -> SharedAcceleration:
    """Learn shared accelerations from the frames before this one."""
    labels = np.where(truth.detections.frame_of < frame, truth.labels, -1)
    return am.tracking.learn_shared_acceleration(
        am.Tracks(detections=truth.detections, labels=labels), model
    )


def without_neighbours(shared: SharedAcceleration) -> SharedAcceleration:
    """Return the same markers without bonds, which are predicted by own motion alone."""
    return dataclasses.replace(
        shared, offsets=np.zeros_like(shared.offsets), others=shared.others[:0],
        distances=shared.distances[:0], variances=shared.variances[:0], shape=shared.shape[:0],
    )  # fmt: skip


def innovations(
    truth: am.Tracks, model: am.TrackingModel, shared: SharedAcceleration, first: int
) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return the errors of the predictions, metres, and the NIS of an axis, from a frame on."""
    d = truth.detections
    markers = np.arange(truth.n_tracks)
    markers[len(shared.weights) :] = -1
    _, predicted = shared_densities(truth, model, shared, markers)
    order, _ = truth.by_track
    frame, track = d.frame_of[order], truth.labels[order]
    in_a_row = np.flatnonzero((track[2:] == track[:-2]) & (frame[2:] - frame[:-2] == 2)) + 2
    own = order[in_a_row]
    own = own[(d.frame_of[own] >= first) & np.isfinite(predicted[own, 0])]
    squares = ((d.points[own] - predicted[own, :-1]) ** 2).sum(axis=1)
    return np.sqrt(squares), squares / d.n_axes / predicted[own, -1]


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
            half = d.n_frames // 2
            ways = [(model, without_neighbours(learnt_before(truth, model, half)))]
            if fitted is not None:
                shared = learnt_before(truth, fitted[0], half)
                ways += [(fitted[0], without_neighbours(shared)), (fitted[0], shared)]
            row = [path.name, rate]
            for each in ways:
                errors, nis = innovations(truth, *each, half)
                size = 1e3 * np.quantile(errors, [0.5, 0.99])
                row += [f"{size[0]:.1f} / {size[1]:.0f}", f"{nis.mean():.2f}"]
            rows.append(row + ["–"] * (2 + 2 * len(WAYS) - len(row)))
            print(*rows[-1], sep=" | ", flush=True)
    head = ["capture", "rate"]
    for way in WAYS:
        head += [f"{way}: median / 99 %, mm", "NIS"]
    publish([*table(head, rows), "", f"{conditions()}."], options.markdown)


if __name__ == "__main__":
    main()
