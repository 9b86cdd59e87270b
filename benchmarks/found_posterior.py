"""Log posterior of the tracks found by default against that of the truth, a piece at a time.

Hard captures and simulated fingers with 10 % missing, 10 % clutter and 0.3 mm of noise, at the full
and at half the rate. `track` without a method tracks each as a whole, and MCMCDA searches from
there. Tracks and truth are cut into pieces of 100 frames, and at the gaps and speeds that the model
excludes; the posterior is that of the model by which the tracks were made, alone and with the
shared accelerations that are learnt from the found tracks, with which MCMCDA searches over the
whole capture. A track that the model excludes otherwise counts as clutter.

    python benchmarks/found_posterior.py [--data FOLDER] [--only NAME] [--markdown FILE]
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.optimize import linear_sum_assignment

import asterism as am
from asterism.tracking.attempts.posterior import log_posterior, within_limits
from captures import captures, options_of_the_run
from report import conditions, publish, table

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from asterism.model import SharedAcceleration

NAMES = ("racing", "freeform", "tennis")
PIECE = 100
NEAR = 1.0
"""Log posterior below that of the truth that still counts as reached, nats."""
SHARED_MOVES = 20
"""Moves of MCMCDA with shared accelerations, each of which takes twenty times as long."""


def differences(found: am.Tracks, truth: am.Tracks, model: am.TrackingModel) -> NDArray[Any]:
    """Return the log posterior of each piece of the found tracks, less that of the truth."""
    return np.array([
        log_posterior(found.part(*ends), model) - log_posterior(truth.part(*ends), model)
        for ends in pieces(truth)
    ])  # fmt: skip


def pieces(truth: am.Tracks) -> list[tuple[int, int]]:
    """Return the first frame of each piece, and the one after its last."""
    n = truth.detections.n_frames
    return [(first, min(first + PIECE, n)) for first in range(0, n - PIECE // 2, PIECE)]


def shared_gains(
    tracks: am.Tracks, model: am.TrackingModel, shared: SharedAcceleration, given: NDArray[Any]
) -> NDArray[Any]:
    """Return what shared accelerations add to each piece; a track is of its first given label."""
    cut = within_limits(tracks, model)
    both = np.flatnonzero((cut.labels >= 0) & (given >= 0))
    labelled, firsts = np.unique(cut.labels[both], return_index=True)
    markers = np.full(cut.n_tracks, -1)
    markers[labelled] = given[both[firsts]]
    gains = am.model.shared_gains(cut, model, shared, markers)
    frame_of = tracks.detections.frame_of
    return np.array([gains[(frame_of >= a) & (frame_of < b)].sum() for a, b in pieces(tracks)])


def labels_of(truth: am.Tracks, found: am.Tracks) -> NDArray[Any]:
    """Return the labels of the truth, each track with that of the found one it shares most with."""
    both = (truth.labels >= 0) & (found.labels >= 0)
    shared = np.zeros((truth.n_tracks, found.n_tracks))
    np.add.at(shared, (truth.labels[both], found.labels[both]), 1)
    rows, columns = linear_sum_assignment(-shared)
    label = np.full(truth.n_tracks + 1, -1)
    label[rows] = columns
    return label[truth.labels]


def main() -> None:
    options = options_of_the_run(__doc__)
    takes = {
        path.name: am.read(path).tracks
        for path in captures(options.data)
        if any(name in path.name for name in NAMES)
    }
    takes["fingers"] = am.simulate.fingers(seed=1)
    rows: list[list[str]] = []
    for name, take in takes.items():
        if options.only not in name:
            continue
        for rate, stride in (("full", 1), ("half", 2)):
            truth = am.simulate.corrupt(
                take, missing=0.1, clutter=0.1, noise=3e-4, stride=stride, seed=1
            )
            d, found = truth.detections, am.track(truth.detections)
            assert found.recipe is not None
            model = am.tracking.tracklet_model(found.recipe.model)
            alone = am.track(
                d, am.MCMCDA(), model=model, stitch=False, start=within_limits(found, model)
            )
            shared = am.tracking.learn_shared_acceleration(found, model)
            method = am.MCMCDA(window=None, moves=SHARED_MOVES, end_odds=1.0, confidence=0)
            state = method.init(model, n_axes=d.n_axes, start=found.labels, shared=shared)
            _, labels, _ = method.run(state, d)
            together = am.Tracks(detections=d, labels=labels)
            row = [name, rate, found.recipe.label, f"{am.evaluate(found, truth).idf1:.3f}"]
            for tracks in (found, alone):
                row += summary(differences(tracks, truth, model))
            of_truth = shared_gains(truth, model, shared, labels_of(truth, found))
            for tracks in (found, alone, together):
                gains = shared_gains(tracks, model, shared, found.labels)
                row += summary(differences(tracks, truth, model) + gains - of_truth)
            rows.append(row)
            print(*rows[-1], sep=" | ", flush=True)
    head = ["capture", "rate", "method", "IDF1"]
    for which in ("found", "MCMCDA", "shared: found", "MCMCDA", "MCMCDA with shared"):
        head += [f"{which}: ≥ truth − 1", "median difference"]
    publish([*table(head, rows), "", f"{conditions()}."], options.markdown)


def summary(differences: NDArray[Any]) -> list[str]:
    """Return how many pieces reach the truth, and the median of the differences."""
    n = int((differences >= -NEAR).sum())
    return [f"{n} of {len(differences)}", str(round(np.median(differences)))]


if __name__ == "__main__":
    main()
