"""Places to check: how many are right, and how many switches they list.

Simulated people with seeds that the calibration does not use, and the captures of
``../shared/data`` (or ``--data``) in four conditions, three seeds each. A switch is a run of
detections that are of another marker than most of their track; runs where the labels of the file
are wrong (`wrong.py`, by the capture as recorded) are counted and left out. Precision: share of the
first 20 places with wrong detections, of another marker or of clutter, in one of their tracks
within half a second; places where the labels of the file alone are wrong do not count. Recall:
share of the switches in the first 20 places, where there are at most 15. Both are means over
results. Perfect results have no wrong detection; of these, places a minute.

    python benchmarks/places.py [--data FOLDER] [--markdown FILE]
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

import asterism as am
from asterism.reporting.places import Place, places_of
from calibration import CORRUPTED, SCENES
from captures import captures, corrupted, named_only
from identity import HALF, bursts, half_rate
from report import conditions, publish, table
from wrong import Run, wrong_runs

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

LISTED = 20
FEW = 15
NEAR_SECONDS = 0.5
"""Longest time from a place to a switch that it lists."""
SEEDS = (31, 32)
"""Of simulated people."""
CAPTURE_SEEDS = (1, 2, 3)


def holds(place: Place, run: Run, times: NDArray[np.float64]) -> bool:
    """Return whether a decision of the place is on the track of a run, and near in time."""
    return any(
        each.track == run.track
        and times[each.first] <= times[run.last] + NEAR_SECONDS
        and times[each.last] >= times[run.first] - NEAR_SECONDS
        for each in place.decisions
    )


class Group:
    """Figures of several results."""

    def __init__(self) -> None:
        self.precision: list[float] = []
        self.recall: list[float] = []
        self.places, self.minutes, self.errors = 0, 0.0, 0

    def add(self, tracks: am.Tracks, truth: am.Tracks, file: am.Tracks | None = None) -> list[str]:
        """Count one result, and return its row of a table."""
        runs, times = wrong_runs(tracks, truth, file), tracks.detections.times
        switches = [each for each in runs if each.kind == "switch"]
        wrong = [each for each in runs if each.kind != "label error"]
        places = places_of(tracks)
        first = places[:LISTED]
        self.errors += len(runs) - len(wrong)
        row = [str(len(places)), str(len(switches)), str(len(runs) - len(wrong))]
        if not wrong:
            self.places += len(places)
            self.minutes += float(times[-1] - times[0]) / 60
            return [*row, "–", "–"]
        is_right = [any(holds(place, each, times) for each in wrong) for place in first]
        is_known = [not any(holds(place, each, times) for each in runs) for place in first]
        precision = [
            right for right, known in zip(is_right, is_known, strict=True) if right or known
        ]
        recall = [any(holds(place, each, times) for place in first) for each in switches]
        if precision:
            self.precision.append(float(np.mean(precision)))
        if 0 < len(switches) <= FEW:
            self.recall.append(float(np.mean(recall)))
        return row + [f"{np.mean(each):.2f}" if each else "–" for each in (precision, recall)]

    def row(self, name: str) -> list[str]:
        """Return the row of the means."""
        means = [f"{np.mean(each):.2f}" if each else "–" for each in (self.precision, self.recall)]
        rate = f"{self.places / self.minutes:.1f} of {self.minutes:.1f}" if self.minutes else "–"
        return [name, *means, rate, str(self.errors)]


def conditions_of(tracks: am.Tracks) -> Iterator[tuple[str, str, am.Tracks]]:
    """Yield each condition, the name of the row, and the capture, by seeds where it is random."""
    yield "as captured", "as captured", named_only(tracks)
    for name, corrupt in {"10 %/10 %": corrupted, "bursts": bursts, HALF: half_rate}.items():
        for seed in CAPTURE_SEEDS:
            yield name, f"{name}, seed {seed}", corrupt(tracks, seed)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    beside = Path(__file__).resolve().parents[2] / "shared" / "data"
    parser.add_argument("--data", type=Path, default=beside)
    parser.add_argument("--markdown", type=Path)
    options = parser.parse_args()
    groups: dict[str, Group] = {}
    each: list[list[str]] = []
    for seed in SEEDS:
        for scene, make in SCENES.items():
            made = make(seed)
            for name, corrupt in CORRUPTED.items():
                truth = corrupt(made, seed)
                own = groups.setdefault("simulated people", Group())
                own.add(am.track(truth.detections), truth)
                print(scene, seed, name, flush=True)
    for path in captures(options.data):
        capture = am.read(path)
        if not any(capture.names):
            continue
        file = named_only(capture.tracks)
        for condition, called, truth in conditions_of(capture.tracks):
            tracks = am.track(truth.detections, marker_set=())
            for of in (condition, "all"):
                own = groups.setdefault(f"captures, {of}", Group())
                row = own.add(tracks, truth, file)
            each.append([f"{path.name}, {called}", *row])
            print(*each[-1], sep=" | ", flush=True)
    head = (
        "results",
        "precision",
        "recall",
        "places a minute, of minutes perfect",
        "label errors left out",
    )
    lines = [*table(head, [group.row(name) for name, group in groups.items()]), ""]
    head = ("capture", "places", "switches", "label errors", "precision", "recall")
    lines += ["Each capture:", "", *table(head, each), "", f"{conditions()}."]
    publish(lines, options.markdown)


if __name__ == "__main__":
    main()
