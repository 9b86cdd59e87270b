"""Correction of results by a person who knows the truth: how many actions until all is right.

The corrector chooses among what the editor offers, by previews, which are looks. First it looks at
the two assignments of all uncertain detections, by `reassign` and at even odds. It leaves out the
groups that make at least three detections wrong, each of which is an action, and confirms the
others, an action too, if each action makes at least three detections right, and a quarter of the
longest wrong stretch. Otherwise it states the marker of a detection: of the uncertain identity with
the most wrong detections that is offered, or of one of the five longest wrong stretches. Each is
previewed as `same` and as `only`, and the statement that raises the IDF1 most an action is made.
An `only` about a first and a last detection counts as two actions. There is one action for three
wrong links, and 420 at most.

The goal is an IDF1 of 0.999, or that of the oracle where occlusions keep it below. Results that
reach the goal before any action are counted and not listed.

The same is done by hand, from the first frame on: each wrong link is mended by an exchange of both
tracks from there on, a join, a cut, or a track for a stretch of detections without one. That is
counted up to four times as many actions. Where fewer than four are enough, as for one wrong place,
the corrector cannot do with a quarter of them: it needs one action too.

Wrong links are those of the result between detections of different markers, and those of the truth
that the result lacks (`am.evaluate`). Captures of ``../shared/data`` (or ``--data``). Captures
without names are left out: they have no truth.

The second table is the processor time of statements about random detections of a simulated person
with 60 markers, in 10 000 frames with bursts of missed detections and ghosts.

    python benchmarks/correction.py [--data FOLDER] [--only NAME] [--condition NAME]
                                    [--seed N] [--markdown FILE]
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.optimize import linear_sum_assignment

import asterism as am
from asterism.errors import ParameterError
from asterism.model import Edit
from asterism.model.edit import REASSIGN
from asterism.simulate import Burst, Ghosts
from calibration import tracked
from captures import captures
from identity import CONDITIONS, SEEDED
from report import conditions, publish, table

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from asterism.model import Decision
    from asterism.model.edit import EditKind
    from asterism.tracking import Change

ENOUGH = 0.999
LINKS_AN_ACTION, MOST_ACTIONS = 3, 420
ORACLE_GAP = 60
"""Longest gap within a track of the oracle, frames."""
MIN_EXPECTED = 3.0
"""Expected wrong detections of an identity below which the corrector does not look at it."""


def overlaps(labels: NDArray[np.int64], truth: am.Tracks) -> NDArray[np.int64]:
    """Return the number of detections of each marker on each track."""
    inside = (labels >= 0) & (truth.labels >= 0)
    counts = np.zeros((truth.n_tracks, int(labels.max(initial=-1)) + 1), dtype=np.int64)
    np.add.at(counts, (truth.labels[inside], labels[inside]), 1)
    return counts


def idf1(labels: NDArray[np.int64], truth: am.Tracks) -> float:
    """Return the IDF1 of labels; the points of result and truth are the same."""
    counts = overlaps(labels, truth)
    rows, columns = linear_sum_assignment(counts, maximize=True)
    n = (labels >= 0).sum() + (truth.labels >= 0).sum()
    return 2 * counts[rows, columns].sum() / n


WORTH = 3
"""Number of detections that an action must mend where an assignment is confirmed."""
SHARE = 4
"""Of the longest wrong stretch, the divisor of the number of detections that it must mend too."""
PREVIEWS = 5
"""Number of stretches of which statements are previewed before one is made."""
NEAR = 25
"""Frames between detections of one stretch at most."""


def n_actions(edit: Sequence[Any]) -> int:
    """Return the number of actions of an edit: two for one with a first and a last detection."""
    return max(len(edit) - 2, 1)


class Corrector:
    """A person who knows the truth and says of one detection after the other what it is."""

    def __init__(self, truth: am.Tracks) -> None:
        self.truth, self.d = truth, truth.detections
        self.start, self.model, self.stitching = tracked(truth)
        self.correction = am.tracking.Correction(self.start, self.model, self.stitching)
        self.stated: dict[int, int] = {}
        self.parted: set[tuple[int, int]] = set()
        self.seen: set[int] = set()
        self.looked: set[tuple[int, int, int]] = set()
        self.actions = self.looks = self.refused = 0
        self.seconds: list[float] = []

    @property
    def labels(self) -> NDArray[np.int64]:
        """Track of each detection now."""
        return self.correction.tracks.labels

    def mains(self) -> NDArray[np.int64]:
        """Return the track of each marker, -1 for none; that of a stated marker does not change."""
        counts = overlaps(self.labels, self.truth).astype(float)
        for marker, detection in self.stated.items():
            counts[marker, self.labels[detection]] = np.inf
        counts = np.minimum(counts, 1e9)
        rows, columns = linear_sum_assignment(counts, maximize=True)
        found = np.full(len(counts), -1)
        found[rows] = np.where(counts[rows, columns] > 0, columns, -1)
        return found

    def run(self, goal: float, limit: int) -> None:
        """Act until the IDF1 is at the goal, nothing is left to do, or the limit is reached."""
        while self.actions < limit and idf1(self.labels, self.truth) < goal:
            if not (self.part() or self.reassign(limit) or self.say(limit)):
                return

    def part(self) -> bool:
        """State that two stated markers, which are on one track, are different."""
        tracks: dict[int, int] = {}
        for detection in self.stated.values():
            other = tracks.setdefault(int(self.labels[detection]), detection)
            if other != detection and (other, detection) not in self.parted:
                self.parted.add((other, detection))
                self.actions += 1
                self.edit("different", other, detection)
                return True
        return False

    def offered(self) -> list[int]:
        """Return a detection of the offered identity that has the most wrong detections."""
        tracks = am.tracking.assess(self.correction.tracks, self.model, self.stitching)
        pinned = self.correction.constraints.pinned
        main = np.append(self.mains(), -1)
        most, found = 0, []
        for each in tracks.decisions:
            if each.kind != "identity" or each.expected_wrong < MIN_EXPECTED:
                continue
            own = self.detections(each)
            key = (each.track, each.first, each.last)
            self.looks += key not in self.looked
            self.looked.add(key)
            markers = self.truth.labels[own]
            marker = int(np.bincount(markers + 1).argmax()) - 1
            of_marker = own[markers == marker]
            middle = int(of_marker[len(of_marker) // 2])
            is_known = pinned & set(own.tolist()) or middle in self.seen
            if main[marker] != each.track and len(of_marker) > most and not is_known:
                most, found = len(of_marker), [middle]
        return found

    def reassign(self, limit: int) -> bool:
        """Look at both assignments of all uncertain detections, and confirm one where it helps.

        Groups of changes that make at least `WORTH` detections wrong are left out.
        """
        wanted = np.append(self.mains(), -1)[self.truth.labels]
        min_gain = max(WORTH, max(n for n, _ in [*self.longest(), (0, 0)]) // SHARE)
        found: tuple[int, EditKind, list[int]] | None = None
        for kind in REASSIGN:
            self.looks += 1
            change = self.edit(kind)
            if change is None:
                continue
            self.correction.undo()
            own, group = change.detections, np.array([each.group for each in change.stretches], int)
            is_right = (change.after == wanted[own]).astype(int) - (change.before == wanted[own])
            gains = np.zeros(len(group), dtype=int)
            np.add.at(gains, group[change.stretch_of], is_right)
            without = np.flatnonzero(gains <= -WORTH)
            n = 1 + len(without)
            gain = (gains.sum() - gains[without].sum()) / n
            if gain >= min_gain and self.actions + n <= limit:
                found = n, kind, change.of_groups(without.tolist()).tolist()
                min_gain = gain
        if found is None:
            return False
        n, kind, left_out = found
        self.edit(kind, *left_out)
        self.actions += n
        return True

    def detections(self, each: Decision) -> NDArray[np.int64]:
        """Return the detections that a decision is about."""
        own = np.flatnonzero(self.labels == each.track)
        frame = self.d.frame_of[own]
        return own[(frame >= each.first) & (frame <= each.last)]

    def longest(self) -> list[tuple[int, int]]:
        """Return lengths and middles of the stretches that are not on their tracks, falling."""
        labels, truth = self.labels, self.truth.labels
        wanted = np.append(self.mains(), -1)[truth]
        order = np.lexsort((self.d.frame_of, labels, truth))
        order = order[labels[order] != wanted[order]]
        steps = np.diff(self.d.frame_of[order]) > NEAR
        edges = np.flatnonzero(np.diff(labels[order]) | np.diff(truth[order]) | steps) + 1
        known = {*self.seen, *self.stated.values()}
        runs = [run[~np.isin(run, list(known))] for run in np.split(order, edges)]
        left = [(len(run), -int(run[len(run) // 2])) for run in runs if len(run)]
        return [(n, -i) for n, i in sorted(left, reverse=True)]

    def say(self, limit: int) -> bool:
        """Make the statement that gains most an action, of those about the largest errors."""
        before, best, found = idf1(self.labels, self.truth), 0.0, None
        places = dict.fromkeys([*self.offered(), *(i for _, i in self.longest()[:PREVIEWS])])
        for detection in places:
            stated = dict(self.stated)
            for edit in self.statements(detection):
                self.looks += 1
                if self.actions + n_actions(edit) <= limit and self.edit(*edit) is not None:
                    gain = (idf1(self.labels, self.truth) - before) / n_actions(edit)
                    self.correction.undo()
                    if gain > best:
                        best, found = gain, (edit, dict(self.stated))
            self.stated = stated
        if found is None:
            self.seen |= places.keys()
            return bool(places)
        edit, self.stated = found
        self.actions += n_actions(edit)
        self.seen.add(edit[-1])
        self.edit(*edit)
        return True

    def statements(self, detection: int) -> list[tuple[Any, ...]]:
        """Return the edits that state of which marker a detection is."""
        marker, labels = int(self.truth.labels[detection]), self.labels
        if marker < 0:
            return [("clutter", detection)]
        if marker not in self.stated:
            own = np.flatnonzero(
                (self.truth.labels == marker) & (labels == self.mains()[marker]) & (labels >= 0)
            )
            own = own[self.d.frame_of[own] != self.d.frame_of[detection]]
            others = np.flatnonzero((self.truth.labels != marker) & (labels == labels[detection]))
            self.stated[marker] = self.correction.anchor(own) if len(own) else detection
            if not len(own):  # it has no track
                if labels[detection] >= 0 and len(others):
                    return [("different", self.correction.anchor(others), detection)]
                return [("name", detection)]
        own = np.flatnonzero(labels == labels[detection]) if labels[detection] >= 0 else [detection]
        is_of = np.concatenate([[False], self.truth.labels[own] == marker, [False]])
        ends, at = np.flatnonzero(~is_of), np.searchsorted(own, detection) + 1
        last = np.searchsorted(ends, at)
        first, end = own[ends[last - 1]], own[ends[last] - 2]
        anchor = self.stated[marker]
        alone = (first, end) if first < end else (first,)
        return [("same", anchor, detection), ("only", anchor, *alone)]

    def edit(self, kind: EditKind, *detections: int) -> Change | None:
        """Apply an edit, and measure how long that takes."""
        frame, offsets = self.d.frame_of, self.d.offsets
        at = tuple((int(frame[i]), int(i - offsets[frame[i]])) for i in detections)
        edit = Edit(kind=kind, at=at, name=f"marker {at[0]}" if kind == "name" else "")
        start = time.perf_counter()
        try:
            return self.correction.apply(edit)
        except ParameterError:
            self.refused += 1
            return None
        finally:
            if kind not in REASSIGN:
                self.seconds.append(time.perf_counter() - start)


def by_hand(tracks: am.Tracks, truth: am.Tracks, goal: float, limit: int) -> int:
    """Count the exchanges, joins, cuts and new labels up to the goal, from the first frame on."""
    labels, frame = tracks.labels.copy(), tracks.detections.frame_of
    of_marker = np.full(truth.n_tracks, -1)
    actions = 0
    for i in range(len(labels)):
        marker, label = truth.labels[i], labels[i]
        if label == (of_marker[marker] if marker >= 0 else -1) and (label >= 0) == (marker >= 0):
            continue
        later = np.arange(len(labels)) >= i
        if marker < 0:
            labels[i] = -1
        elif label < 0:
            own = np.flatnonzero((truth.labels == marker) & later)
            ends = np.flatnonzero(labels[own] >= 0)
            to = of_marker[marker]
            if to < 0:
                to = labels[own[ends[0]]] if len(ends) else -1
                to = labels.max() + 1 if to in of_marker else to
            of_marker[marker] = to
            labels[own[: ends[0]] if len(ends) else own] = to
        elif of_marker[marker] < 0:
            if label in of_marker:
                to = labels.max() + 1
                labels[later & (labels == label)] = of_marker[marker] = to
            else:
                of_marker[marker] = label
                continue
        else:
            a, b = later & (labels == label), later & (labels == of_marker[marker])
            b &= frame >= frame[i]
            labels[a], labels[b] = of_marker[marker], label
        actions += 1
        if actions >= limit or idf1(labels, truth) >= goal:
            break
    return actions


STATEMENTS = 100
"""Number of statements of each kind whose time is measured."""


def latency() -> list[list[str]]:
    """Return the median and the 99th percentile of the processor time of statements, ms."""
    made = am.simulate.person(activity="walk", frames=10_000, n_markers=60, seed=1)
    truth = am.simulate.corrupt(made, burst=Burst(), ghosts=Ghosts(), noise=3e-4, seed=1)
    start, model, stitching = tracked(truth)
    labels, frame = start.labels, start.detections.frame_of
    on_track, free = np.flatnonzero(labels >= 0), np.flatnonzero(labels < 0)
    rows: list[list[str]] = []
    kinds: tuple[tuple[str, EditKind, NDArray[np.int64]], ...] = (
        ("*same*, two detections", "same", on_track),
        ("*same*, a detection without a track", "same", free),
        ("*different*", "different", on_track),
    )
    for name, kind, among in kinds:
        rng = np.random.default_rng(0)
        correction = am.tracking.Correction(start, model, stitching)
        seconds: list[float] = []
        while len(seconds) < STATEMENTS:
            now = correction.tracks.labels
            one = int(rng.choice(among))
            own = np.flatnonzero(now == now[one]) if kind == "different" else on_track
            other = int(rng.choice(own))
            if frame[one] == frame[other] or (kind == "different") != (now[one] == now[other]):
                continue
            at = tuple(
                (int(frame[i]), int(i - start.detections.offsets[frame[i]])) for i in (other, one)
            )
            begin = time.process_time()
            try:
                correction.apply(Edit(kind=kind, at=at))
            except ParameterError:  # it contradicts an earlier statement
                continue
            seconds.append(time.process_time() - begin)
        figures = 1000 * np.quantile(seconds, [0.5, 0.99])
        rows.append([name, *(f"{each:.0f}" for each in figures)])
    return rows


def sums(rows: list[list[str]]) -> str:
    """Return the sum of the actions of all listed results, and the largest share of one."""
    counts = np.array([(int(row[6]), int(row[8])) for row in rows]).reshape(-1, 2)
    (actions, by_hand), large = counts.sum(axis=0), counts[counts[:, 1] >= SHARE]
    share = 100 * (large[:, 0] / large[:, 1]).max(initial=0)
    return (
        f"{actions} actions in all, {by_hand} by hand. Where at least {SHARE} are needed by hand, "
        f"at most {share:.0f} % of them; of fewer, one action is more than a quarter."
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    beside = Path(__file__).resolve().parents[2] / "shared" / "data"
    parser.add_argument("--data", type=Path, default=beside)
    parser.add_argument("--only", default="")
    parser.add_argument("--condition", default="")
    parser.add_argument("--seed", type=int, default=1, help="of the corruption")
    parser.add_argument("--markdown", type=Path)
    args = parser.parse_args()
    rows: list[list[str]] = []
    n_right = 0
    for path in captures(args.data):
        if args.only not in path.name:
            continue
        recorded = am.read(path).tracks
        if not any(recorded.names):
            continue  # unnamed trajectories are pieces of markers, and no truth
        for name, corrupt in CONDITIONS.items():
            truth = SEEDED[name](recorded, args.seed) if name in SEEDED else corrupt(recorded)
            if args.condition not in name or truth.labels.max(initial=-1) < 0:
                continue
            made = Corrector(truth)
            before = idf1(made.labels, truth)
            oracle = idf1(am.metrics.oracle_tracks(truth, ORACLE_GAP).labels, truth)
            goal = min(ENOUGH, oracle)
            if before >= goal:
                n_right += 1
                continue
            found = am.evaluate(made.start, truth)
            links = found.wrong_links + found.broken_links
            limit = min(links // LINKS_AN_ACTION, MOST_ACTIONS)
            hand = by_hand(made.start, truth, goal, 4 * limit)
            made.run(goal, limit)
            rows.append(
                [
                    path.stem, name, f"{oracle:.4f}", f"{before:.4f}",
                    f"{idf1(made.labels, truth):.4f}", str(links), str(made.actions),
                    str(made.looks), str(hand),
                    f"{1000 * np.median(made.seconds):.0f}" if made.seconds else "–",
                ]
            )  # fmt: skip
            print(*rows[-1], f"refused {made.refused}", flush=True)
    header = ["capture", "condition", "oracle", "IDF1", "corrected", "wrong links", "actions",
              "looks", "by hand", "ms an edit"]  # fmt: skip
    times = table(["statement", "median, ms", "99 %, ms"], latency())
    found = table(header, rows)
    right = f"{n_right} more results reach the goal before any action."
    publish([conditions(), "", *found, "", sums(rows), "", right, "", *times], args.markdown)


if __name__ == "__main__":
    main()
