"""Log posterior of the tracks found by default, against those of the truth and of other methods.

Hard captures and simulated fingers with 10 % missing, 10 % clutter and 0.3 mm of noise, at the full
and at half the rate. `track` without a method tracks each as a whole; so do other methods, with the
same model and stitching, and MCMCDA searches from the default. Tracks and truth are cut into pieces
of 100 frames, and at the gaps and speeds that the model excludes; the posterior is that of the
model by which the tracks were made, alone and with the shared accelerations that are learnt from
the found tracks, with which MCMCDA searches over the whole capture. A track of a single detection
adds nothing.

    python benchmarks/found_posterior.py [--data FOLDER] [--only NAME] [--markdown FILE]
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.optimize import linear_sum_assignment

import asterism as am
from asterism.tracking.attempts.posterior import within_limits
from captures import captures, options_of_the_run
from report import conditions, publish, table

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from asterism.model import SharedAcceleration

NAMES = ("racing", "freeform", "tennis")
OTHERS = (am.GNN(), am.SMP(window=3), am.TOMHT(), am.MCMCDA())
PIECE = 100
NEAR = 1.0
"""Log posterior below that of the truth that still counts as reached, nats."""
SHARED_MOVES = 20
"""Moves of MCMCDA with shared accelerations, which take seven times as long."""


def pieces(truth: am.Tracks) -> list[tuple[int, int]]:
    """Return the first frame of each piece, and the one after its last."""
    n = truth.detections.n_frames
    return [(first, min(first + PIECE, n)) for first in range(0, n - PIECE // 2, PIECE)]


def log_posteriors(
    tracks: am.Tracks,
    model: am.TrackingModel,
    shared: SharedAcceleration | None = None,
    markers: NDArray[Any] | None = None,
) -> NDArray[Any]:
    """Return the log posterior of each piece, with shared accelerations if markers are given.

    `markers` has that of each detection; a track is of the marker of its first detection.
    """
    found = []
    for first, end in pieces(tracks):
        part = within_limits(tracks.part(first, end), model)
        scores = am.model.track_scores(part, model)
        total = float(scores[np.isfinite(scores)].sum())
        if shared is not None and markers is not None:
            order, offsets = part.by_track
            begin = tracks.detections.offsets[first]
            of_track = markers[begin + order[offsets[:-1]]]
            total += float(am.model.shared_gains(part, model, shared, of_track).sum())
        found.append(total)
    return np.array(found)


def first_labels(tracks: am.Tracks, given: NDArray[Any]) -> NDArray[Any]:
    """Return for each detection the first label given to its track, -1 for none."""
    both = np.flatnonzero((tracks.labels >= 0) & (given >= 0))
    labelled, firsts = np.unique(tracks.labels[both], return_index=True)
    markers = np.full(tracks.n_tracks + 1, -1)
    markers[labelled] = given[both[firsts]]
    return markers[tracks.labels]


def labels_of(tracks: am.Tracks, found: am.Tracks) -> NDArray[Any]:
    """Return the found track of each detection's track, one to one, with most in common."""
    both = (tracks.labels >= 0) & (found.labels >= 0)
    shared = np.zeros((tracks.n_tracks, found.n_tracks))
    np.add.at(shared, (tracks.labels[both], found.labels[both]), 1)
    rows, columns = linear_sum_assignment(-shared)
    label = np.full(tracks.n_tracks + 1, -1)
    label[rows] = columns
    return label[tracks.labels]


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
            of_truth = log_posteriors(truth, model)
            for tracks in (found, alone):
                row += summary(log_posteriors(tracks, model) - of_truth)
            of_truth = log_posteriors(truth, model, shared, labels_of(truth, found))
            of_found = log_posteriors(found, model, shared, found.labels)
            row += summary(of_found - of_truth)
            for tracks in (alone, together):
                markers = first_labels(tracks, found.labels)
                row += summary(log_posteriors(tracks, model, shared, markers) - of_truth)
            others = [
                am.track(d, other, model=found.recipe.model, stitch=found.recipe.stitch)
                for other in OTHERS
            ]
            of_others = [
                log_posteriors(each, model, shared, first_labels(each, found.labels))
                for each in others
            ]
            row += summary(of_found - np.max(of_others, axis=0))
            rows.append(row)
            print(*rows[-1], sep=" | ", flush=True)
    head = ["capture", "rate", "method", "IDF1"]
    for which in ("found", "MCMCDA", "shared: found", "MCMCDA", "MCMCDA with shared"):
        head += [f"{which}: ≥ truth − 1", "median difference"]
    head += ["shared: found: ≥ other methods − 1", "median difference"]
    publish([*table(head, rows), "", f"{conditions()}."], options.markdown)


def summary(differences: NDArray[Any]) -> list[str]:
    """Return how many pieces reach the truth, and the median of the differences."""
    n = int((differences >= -NEAR).sum())
    return [f"{n} of {len(differences)}", str(round(np.median(differences)))]


if __name__ == "__main__":
    main()
