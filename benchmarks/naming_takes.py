"""Gait trials of six subjects with their marker sets, and takes of them without names.

A take is what a program would name: clean, corrupted as in SOMA, or occluded and tracked again.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

import asterism as am
from asterism.simulate import Burst, Ghosts

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

SHARED = Path(__file__).resolve().parents[2] / "shared"
SUBJECTS = Path("mcgillmotionlab__biomechzoo")
TRIALS = ("Static", "Straight", "Turn")
SEEDS = (1, 2, 3)
SETS = ("own static trial", "one frame", "own other gait trial", "five other subjects")
CONDITIONS = ("clean", "corrupted", "bursts, tracked")
MAX_OCCLUDED, MAX_GHOSTS, PIECE = 4, 3, (10, 50)

WRONG = {
    ("HC032A", "Turn"): {"RNAV": (153, 336), "RHLX": (153, 336)},
    ("HC033A", "Turn"): {"LFIN": (0, 29)},
}
"""First and last frame of each stretch in which a label of a file is wrong."""
EXCHANGED = "HC030A", ("LWRA", "LWRB")
"""Subject who wears two markers exchanged, in every trial."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Trial:
    """One gait trial or static trial, labelled markers only."""

    subject: str
    kind: str
    tracks: am.Tracks

    @cached_property
    def is_wrong(self) -> NDArray[np.bool_]:
        """Whether the label of a marker is wrong in a frame, (F, M)."""
        wrong = np.zeros((self.tracks.detections.n_frames, self.tracks.n_tracks), dtype=bool)
        for name, (first, last) in WRONG.get((self.subject, self.kind), {}).items():
            wrong[first : last + 1, self.tracks.names.index(name)] = True
        return wrong

    def learnt_from(self) -> am.Tracks:
        """Return the tracks without labels that are wrong."""
        t = self.tracks
        wrong = self.is_wrong[t.detections.frame_of, t.labels] & (t.labels >= 0)
        return replace(t, labels=np.where(wrong, -1, t.labels))


@dataclass(frozen=True, eq=False, kw_only=True)
class Take:
    """Tracks without names, and the true marker of each detection (-1: none)."""

    tracks: am.Tracks
    truth: NDArray[np.int64]
    names: tuple[str | None, ...]


def read_trials(sets: Path, data: Path) -> dict[tuple[str, str], Trial]:
    """Read the three trials of each subject."""
    trials: dict[tuple[str, str], Trial] = {}
    for folder in sorted(p for p in (sets / SUBJECTS).iterdir() if p.is_dir()):
        for kind in TRIALS:
            paths = [*(folder / kind).glob("*.c3d")]
            paths = paths or [
                p for p in data.rglob("*.c3d") if p.parts[-3:-1] == (folder.name, kind)
            ]
            tracks = am.read(paths[0]).tracks
            labelled = [k for k, n in enumerate(tracks.names) if n and not n.startswith("*")]
            trials[folder.name, kind] = Trial(
                subject=folder.name, kind=kind, tracks=tracks.select(labelled)
            )
    return trials


class Sets:
    """Marker sets by subject."""

    def __init__(self, trials: dict[tuple[str, str], Trial]) -> None:
        self.trials = trials
        self.subjects = tuple(dict.fromkeys(subject for subject, _ in trials))
        self._whole = {subject: self._learn_whole(subject) for subject in self.subjects}

    def _learn_whole(self, subject: str) -> am.MarkerSet:
        own = [self.trials[subject, kind].learnt_from() for kind in TRIALS]
        if subject == EXCHANGED[0]:
            own = [t.select([n for n in t.names if n not in EXCHANGED[1]]) for t in own]
        return am.learn_marker_set(*own)

    def static(self, subject: str) -> am.MarkerSet:
        """Learn the static trial."""
        return am.learn_marker_set(self.trials[subject, "Static"].tracks)

    def one_frame(self, subject: str) -> am.MarkerSet:
        """Learn the frame of the straight trial with the most markers."""
        tracks = self.trials[subject, "Straight"].tracks
        frame = int(np.argmax(np.isfinite(tracks.positions()[..., 0]).sum(axis=1)))
        return am.learn_marker_set(tracks.part(frame, frame + 1))

    def others(self, subject: str) -> am.MarkerSet:
        """Merge the sets of all other subjects."""
        return am.merge_marker_sets(*(s for own, s in self._whole.items() if own != subject))

    def everyone(self) -> am.MarkerSet:
        """Merge the sets of all subjects."""
        return am.merge_marker_sets(*self._whole.values())

    def of(self, which: str, subject: str, kind: str) -> am.MarkerSet:
        """Return one of the four sets for a gait trial."""
        if which == SETS[0]:
            return self.static(subject)
        if which == SETS[1]:
            return self.one_frame(subject)
        if which == SETS[2]:
            other = "Turn" if kind == "Straight" else "Straight"
            return am.learn_marker_set(self.trials[subject, other].learnt_from())
        return self.others(subject)


def back_and_forth(tracks: am.Tracks, n_frames: int) -> am.Tracks:
    """Repeat a capture, each time in the other direction, up to a number of frames."""
    d = tracks.detections
    period = 2 * (d.n_frames - 1)
    frames = (d.n_frames - 1) - np.abs(np.arange(n_frames) % period - (d.n_frames - 1))
    labels = [tracks.labels[d.offsets[t] : d.offsets[t + 1]] for t in frames]
    detections = am.Detections.from_frames(
        np.arange(n_frames) * d.step, [d.frame(int(t)) for t in frames]
    )
    return am.Tracks(detections=detections, labels=np.concatenate(labels), names=tracks.names)


def made_of(
    tracks: am.Tracks,
    frames: NDArray[np.int64],
    points: NDArray[np.float64],
    labels: NDArray[np.int64],
    truth: NDArray[np.int64],
    rng: np.random.Generator,
) -> Take:
    """Order points by frame, and number their tracks at random."""
    order = np.argsort(frames, kind="stable")
    d = tracks.detections
    counts = np.bincount(frames, minlength=d.n_frames)
    number = rng.permutation(int(labels.max()) + 1)
    detections = am.Detections(
        times=d.times, offsets=np.concatenate([[0], np.cumsum(counts)]), points=points[order]
    )
    return Take(
        tracks=am.Tracks(detections=detections, labels=number[labels[order]]),
        truth=truth[order],
        names=tracks.names,
    )


def clean(tracks: am.Tracks, seed: int = 0) -> Take:
    own = tracks.labels >= 0
    d, labels = tracks.detections, tracks.labels[own]
    rng = np.random.default_rng(seed)
    return made_of(tracks, d.frame_of[own], d.points[own], labels, labels, rng)


def corrupted(tracks: am.Tracks, seed: int) -> Take:
    """Occlude markers, cut their tracks into pieces, and add ghosts, as SOMA is trained."""
    rng = np.random.default_rng(seed)
    positions = tracks.positions()
    n_frames, n_markers, _ = positions.shape
    for pose in positions:
        n = int(rng.integers(0, MAX_OCCLUDED + 1))
        pose[rng.choice(n_markers, min(n, n_markers), replace=False)] = np.nan
    piece = np.zeros((n_frames, n_markers), dtype=np.int64)
    n_pieces = 0
    for m in range(n_markers):
        first = 0
        while first < n_frames:
            last = first + int(rng.integers(PIECE[0], PIECE[1] + 1))
            piece[first:last, m] = n_pieces
            first, n_pieces = last, n_pieces + 1
    frames, markers = np.nonzero(np.isfinite(positions[..., 0]))
    ghost_frames: list[int] = []
    ghosts: list[NDArray[np.float64]] = []
    for t, pose in enumerate(positions):
        seen = pose[np.isfinite(pose[:, 0])]
        for _ in range(int(rng.integers(0, MAX_GHOSTS + 1)) if len(seen) else 0):
            ghost_frames.append(t)
            ghosts.append(rng.normal(np.median(seen, axis=0), seen.std(axis=0)))
    n = len(ghosts)
    return made_of(
        tracks,
        np.concatenate([frames, np.array(ghost_frames, dtype=np.int64)]),
        np.concatenate([positions[frames, markers], np.reshape(ghosts, (n, 3))]),
        np.concatenate([piece[frames, markers], n_pieces + np.arange(n)]),
        np.concatenate([markers, np.full(n, -1)]),
        rng,
    )


def tracked(tracks: am.Tracks, seed: int) -> Take:
    """Occlude markers in bursts, add ghosts and 0.3 mm of noise, and track all detections."""
    truth = am.simulate.corrupt(tracks, burst=Burst(), ghosts=Ghosts(), noise=3e-4, seed=seed)
    return Take(tracks=am.track(truth.detections), truth=truth.labels, names=truth.names)


def takes(trial: Trial) -> Iterator[tuple[str, Take]]:
    """Give the takes of a trial under each condition."""
    yield CONDITIONS[0], clean(trial.tracks)
    for seed in SEEDS:
        yield CONDITIONS[1], corrupted(trial.tracks, seed)
    for seed in SEEDS:
        yield CONDITIONS[2], tracked(trial.tracks, seed)
