"""Log posterior of the tracks found by default against that of the truth, a piece at a time.

Hard captures and simulated fingers with 10 % missing, 10 % clutter and 0.3 mm of noise, at the full
and at half the rate. `track` without a method tracks each as a whole. Tracks and truth are cut into
pieces of 100 frames, and at gaps that the model excludes; the posterior is that of the model by
which the tracks were made. A track that the model excludes otherwise counts as clutter.

    python benchmarks/found_posterior.py [--data FOLDER] [--only NAME] [--markdown FILE]
"""

from __future__ import annotations

import numpy as np

import asterism as am
from captures import captures, options_of_the_run
from report import conditions, publish, table

NAMES = ("racing", "freeform", "tennis")
PIECE = 100
NEAR = 1.0
"""Log posterior below that of the truth that still counts as reached, nats."""


def log_posterior(tracks: am.Tracks, model: am.TrackingModel) -> float:
    """Return the log posterior of tracks, cut at the gaps that the model excludes."""
    whole = within_gaps(tracks, model)
    scores = am.model.track_scores(whole, model)
    return float(scores[np.isfinite(scores)].sum())


def within_gaps(tracks: am.Tracks, model: am.TrackingModel) -> am.Tracks:
    """Return the pieces of tracks between the gaps that the model excludes."""
    return am.metrics.oracle_tracks(tracks, model.population.max_gap)


def differences(found: am.Tracks, truth: am.Tracks, model: am.TrackingModel) -> list[float]:
    """Return the log posterior of each piece of the found tracks, less that of the truth."""
    n = truth.detections.n_frames
    pieces = [(first, min(first + PIECE, n)) for first in range(0, n - PIECE // 2, PIECE)]
    return [
        log_posterior(found.part(*ends), model) - log_posterior(truth.part(*ends), model)
        for ends in pieces
    ]


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
            found = am.track(truth.detections)
            assert found.recipe is not None
            model = am.tracking.tracklet_model(found.recipe.model)
            again = am.track(
                truth.detections, am.MCMCDA(), model=model, stitch=False,
                start=within_gaps(found, model),
            )  # fmt: skip
            row = [name, rate, found.recipe.label, f"{am.evaluate(found, truth).idf1:.3f}"]
            for tracks in (found, again):
                off = np.array(differences(tracks, truth, model))
                row += [f"{int((off >= -NEAR).sum())} of {len(off)}",
                        str(round(np.median(off))), str(round(off.min()))]  # fmt: skip
            rows.append(row)
            print(*rows[-1], sep=" | ", flush=True)
    head = ["capture", "rate", "method", "IDF1"]
    for prefix in ("", "MCMCDA from there: "):
        head += [f"{prefix}pieces ≥ truth − 1 nat", "median difference, nats", "smallest"]
    publish([*table(head, rows), "", f"{conditions()}."], options.markdown)


if __name__ == "__main__":
    main()
