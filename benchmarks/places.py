"""Places to check: how many are right, and how many switches they list.

Simulated people with seeds that the calibration does not use, and the captures of
``../shared/data`` (or ``--data``) in four conditions. A switch is a run of detections that are not
of the marker that holds most of their track. Precision: share of the first 20 places with a switch
in one of their tracks and frames. Recall: share of the switches in the first 20 places, where there
are at most 15. Where the file's own labels jump and the track does not, the labels are wrong: such
switches are listed and left out. Perfect results have no switch; of these, places a minute.

    python benchmarks/places.py [--data FOLDER] [--markdown FILE]
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

import asterism as am
from asterism.reporting.places import Place, places_of
from calibration import CORRUPTED, SCENES, is_wrong
from captures import captures
from identity import CONDITIONS
from report import conditions, publish, table

if TYPE_CHECKING:
    from numpy.typing import NDArray

LISTED = 20
FEW = 15
SEEDS = (31, 32)
SMOOTH, JUMP = 0.35, 0.01
"""Largest step of a track relative to that of the file's label, and smallest step of that label,
metres a frame, at which the label is wrong."""


class Switch(NamedTuple):
    """Run of detections of a track that are of another marker."""

    track: int
    first: int
    last: int
    is_label_error: bool


def switches(tracks: am.Tracks, truth: am.Tracks) -> list[Switch]:
    """Return the runs of wrong detections, clutter left out."""
    order, offsets = tracks.by_track
    wrong = is_wrong(tracks, truth) & (truth.labels >= 0)
    frame = tracks.detections.frame_of
    found: list[Switch] = []
    for k in range(tracks.n_tracks):
        own = order[offsets[k] : offsets[k + 1]]
        edges = np.flatnonzero(np.diff(np.concatenate([[0], wrong[own].astype(int), [0]])))
        for begin, end in zip(edges[::2], edges[1::2], strict=True):
            error = _is_label_error(own, begin, end, truth)
            found.append(Switch(k, int(frame[own[begin]]), int(frame[own[end - 1]]), error))
    return found


def _is_label_error(own: NDArray[np.int64], begin: int, end: int, truth: am.Tracks) -> bool:
    """Return whether the track is smooth at both edges, where the label of the marker jumps."""
    votes: list[bool] = []
    for before, after, way in ((begin - 1, begin, 1), (end, end - 1, -1)):
        if 0 <= before < len(own):
            right, other = own[before], own[after]
            step = _step(truth, right, other)
            label = _next_of_label(truth, int(right), way)
            if label >= 0:
                jump = _step(truth, right, label)
                votes.append(bool(step < SMOOTH * jump and jump > JUMP))
    return bool(votes) and all(votes)


def _step(truth: am.Tracks, a: int, b: int) -> float:
    d = truth.detections
    frames = abs(int(d.frame_of[a]) - int(d.frame_of[b]))
    return float(np.linalg.norm(d.points[a] - d.points[b])) / max(frames, 1)


def _next_of_label(truth: am.Tracks, detection: int, way: int) -> int:
    """Return the next detection of the same label in a direction of time, -1 for none."""
    order, offsets = truth.by_track
    k = truth.labels[detection]
    own = order[offsets[k] : offsets[k + 1]]
    at = int(np.searchsorted(own, detection)) + way
    return int(own[at]) if 0 <= at < len(own) else -1


def holds(place: Place, switch: Switch) -> bool:
    """Return whether a decision of the place is on the track and the frames of a switch."""
    return any(
        each.track == switch.track and each.first <= switch.last and each.last >= switch.first
        for each in place.decisions
    )


class Group:
    """Figures of several results."""

    def __init__(self) -> None:
        self.precision: list[float] = []
        self.recall: list[float] = []
        self.places, self.minutes, self.errors = 0, 0.0, 0

    def add(self, tracks: am.Tracks, truth: am.Tracks) -> list[str]:
        """Count one result, and return its row of a table."""
        all_of = switches(tracks, truth)
        real = [each for each in all_of if not each.is_label_error]
        places = places_of(tracks)
        first = places[:LISTED]
        self.errors += len(all_of) - len(real)
        row = [str(len(places)), str(len(real)), str(len(all_of) - len(real))]
        if not all_of:
            times = tracks.detections.times
            self.places += len(places)
            self.minutes += float(times[-1] - times[0]) / 60
            return [*row, "–", "–"]
        precision = [any(holds(place, each) for each in all_of) for place in first]
        recall = [any(holds(place, each) for place in first) for each in real]
        if precision:
            self.precision.append(float(np.mean(precision)))
        if 0 < len(real) <= FEW:
            self.recall.append(float(np.mean(recall)))
        return row + [f"{np.mean(each):.2f}" if each else "–" for each in (precision, recall)]

    def row(self, name: str) -> list[str]:
        """Return the row of the means."""
        means = [f"{np.mean(each):.2f}" if each else "–" for each in (self.precision, self.recall)]
        rate = f"{self.places / self.minutes:.1f}" if self.minutes else "–"
        return [name, *means, rate, str(self.errors)]


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
        for condition, corrupt in CONDITIONS.items():
            truth = corrupt(capture.tracks)
            own = groups.setdefault(f"captures, {condition}", Group())
            row = own.add(am.track(truth.detections, marker_set=()), truth)
            each.append([f"{path.name}, {condition}", *row])
            print(*each[-1], sep=" | ", flush=True)
    head = ("results", "precision", "recall", "places a minute, perfect", "label errors left out")
    lines = [*table(head, [group.row(name) for name, group in groups.items()]), ""]
    head = ("capture", "places", "switches", "label errors", "precision", "recall")
    lines += ["Each capture:", "", *table(head, each), "", f"{conditions()}."]
    publish(lines, options.markdown)


if __name__ == "__main__":
    main()
