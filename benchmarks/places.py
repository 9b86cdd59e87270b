"""Places to check: how many are right, and how many switches they list.

Simulated people with seeds that the calibration does not use, and the captures of
``../shared/data`` (or ``--data``) in four conditions, nine seeds each. A switch is a run of
detections that are of another marker than most of their track; runs where the labels of the file
are wrong (`wrong.py`, by the capture as recorded) are counted and left out. Precision: share of the
first 20 places with wrong detections, of another marker or of clutter, in one of their tracks
within half a second; places where the labels of the file alone are wrong do not count. Recall:
share of the switches in the first 20 places, where there are at most 15. Both are means over
results, and beside them the sums over all results. Perfect results have no wrong detection; of
these, places a minute.

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
PEOPLE, SEEDS = "simulated people", (31, 32)
CAPTURE_SEEDS = range(1, 10)


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
        self.right, self.known, self.listed, self.switches = 0, 0, 0, 0
        self.places, self.minutes, self.errors = 0, 0.0, 0

    def add(self, tracks: am.Tracks, runs: list[Run]) -> None:
        """Count one result with its wrong runs."""
        times = tracks.detections.times
        switches = [each for each in runs if each.kind == "switch"]
        wrong = [each for each in runs if each.kind != "label error"]
        places = places_of(tracks)
        first = places[:LISTED]
        self.errors += len(runs) - len(wrong)
        if not wrong:
            self.places += len(places)
            self.minutes += float(times[-1] - times[0]) / 60
            return
        is_right = [any(holds(place, each, times) for each in wrong) for place in first]
        is_known = [not any(holds(place, each, times) for each in runs) for place in first]
        n_right, n_known = sum(is_right), sum(np.logical_or(is_right, is_known))
        if n_known:
            self.precision.append(n_right / n_known)
            self.right, self.known = self.right + n_right, self.known + n_known
        if 0 < len(switches) <= FEW:
            n_listed = sum(any(holds(place, each, times) for place in first) for each in switches)
            self.recall.append(n_listed / len(switches))
            self.listed, self.switches = self.listed + n_listed, self.switches + len(switches)

    def row(self, name: str) -> list[str]:
        """Return the row of a table."""
        means = [f"{np.mean(each):.2f}" if each else "–" for each in (self.precision, self.recall)]
        sums = [f"{self.right} of {self.known}", f"{self.listed} of {self.switches}"]
        rate = f"{self.places / self.minutes:.1f} of {self.minutes:.1f}" if self.minutes else "–"
        return [name, means[0], sums[0], means[1], sums[1], rate, str(self.errors)]


def conditions_of(tracks: am.Tracks) -> Iterator[tuple[str, am.Tracks]]:
    """Yield each condition and the capture, by seeds where it is random."""
    yield "as captured", named_only(tracks)
    for name, corrupt in {"10 %/10 %": corrupted, "bursts": bursts, HALF: half_rate}.items():
        for seed in CAPTURE_SEEDS:
            yield name, corrupt(tracks, seed)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    beside = Path(__file__).resolve().parents[2] / "shared" / "data"
    parser.add_argument("--data", type=Path, default=beside)
    parser.add_argument("--markdown", type=Path)
    options = parser.parse_args()
    groups: dict[str, Group] = {}
    each: dict[str, Group] = {}
    for seed in SEEDS:
        for scene, make in SCENES.items():
            made = make(seed)
            for name, corrupt in CORRUPTED.items():
                truth = corrupt(made, seed)
                tracks, own = am.track(truth.detections), groups.setdefault(PEOPLE, Group())
                own.add(tracks, wrong_runs(tracks, truth))
                print(scene, seed, name, flush=True)
    for path in captures(options.data):
        capture = am.read(path)
        if not any(capture.names):
            continue
        file = named_only(capture.tracks)
        for condition, truth in conditions_of(capture.tracks):
            tracks = am.track(truth.detections, marker_set=())
            called, runs = f"{path.name}, {condition}", wrong_runs(tracks, truth, file)
            for own, of in ((groups, f"captures, {condition}"), (groups, "captures, all"),
                            (each, called)):  # fmt: skip
                own.setdefault(of, Group()).add(tracks, runs)
            print(*each[called].row(called), sep=" | ", flush=True)
    head = (
        "results", "precision", "right places", "recall", "listed switches",
        "places a minute, of minutes perfect", "label errors left out",
    )  # fmt: skip
    rows = [[group.row(name) for name, group in of.items()] for of in (groups, each)]
    lines = [*table(head, rows[0]), "", "Each capture:", "", *table(head, rows[1]), ""]
    publish([*lines, f"{conditions()}."], options.markdown)


if __name__ == "__main__":
    main()
