"""Names by marker sets: six subjects, each named by four sets under three conditions.

The sets are those of the subject's static trial, of one labelled frame, of the subject's other
gait trial, and of the other five subjects merged. The tracks of the gait trials come without
names: as in the file, corrupted as in SOMA, and occluded in bursts and tracked again. Then trials
that lack markers of the set and hold others, two subjects in one volume, and captures of other
protocols.

    python benchmarks/names.py [--sets FOLDER] [--data FOLDER] [--only SUBJECT] [--markdown FILE]
"""

from __future__ import annotations

import argparse
import sys
import time
from collections import Counter
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

import asterism as am
from asterism.model.marker_set import other_side
from asterism.simulate import Burst, Ghosts
from captures import captures, named_only
from naming_takes import (
    CONDITIONS,
    EXCHANGED,
    SETS,
    SHARED,
    SUBJECTS,
    Sets,
    Take,
    Trial,
    back_and_forth,
    clean,
    corrupted,
    read_trials,
    takes,
)
from report import conditions, publish, table

if TYPE_CHECKING:
    from numpy.typing import NDArray

CERTAIN = 0.99
LABELLING_TEMPLATE = "pyCGM2-FullBody_CGM1_medial.vst"
EXCHANGED_WRIST = "59993_Frame", ("LWRA", "LWRB")
"""Folder of a subject whose file has two labels exchanged."""
N_LONG = 1000
"""Number of frames of a long capture."""
N_MISSING, N_EXTRA, APART = 4, 3, 0.5  # markers, markers, metres

EVIDENCE = (
    "Labels of the files that are wrong, neither learnt nor scored: "
    "(1) HC032A, turn, RNAV and RHLX, frames 153 to 336. The median distances of RNAV from RANK "
    "and RHEE are 93 and 107 mm in the static trial, 92 and 106 mm in the straight trial, 92 and "
    "107 mm up to frame 152, and 173 and 201 mm from frame 169 on. Those of RHLX are 176 and 206, "
    "173 and 204, 172 and 204 mm, and then 93 and 106 mm. From frame 153 to 168 both labels slide "
    "across. (2) HC033A, turn, LFIN, frames 0 to 29. LFIN lies 62 to 63 mm from LWRB up to frame "
    "19 and 76 to 80 mm after frame 29 (77 to 78 mm in the straight trial); LWRA lies 63 mm from "
    "LWRB. LWRA is absent up to frame 18, and the label of LFIN slides from there to the finger. "
    "(3) HC030A wears LWRA and LWRB exchanged: LWRA is 60 mm behind LWRB in walking direction in "
    "both gait trials, 29 to 60 mm in front of it in those of all other subjects. The static "
    "trial agrees with the gait trials (LFIN is 78 mm from LWRA and 66 mm from LWRB, 81 and 64 mm "
    "in gait). The two names are therefore scored with the subject's own sets; with those of the "
    "other subjects they are not, and they are not learnt from this subject."
)


@dataclass(frozen=True, kw_only=True)
class Result:
    """Scores of one take."""

    target: str
    scores: am.metrics.NameScores
    n_named: int
    n_certain: int
    n_certain_right: int
    n_exchanged: int
    seconds: float
    wrong: Counter[tuple[str, str]]


def measure(target: str, take: Take, left_out: NDArray[np.bool_], *sets: am.MarkerSet) -> Result:
    """Name a take and score it, but for the detections of markers that are left out, (F, M)."""
    start = time.process_time()
    naming = am.name_tracks(take.tracks, *sets)
    seconds = time.process_time() - start
    d = take.tracks.detections
    scored = (take.truth < 0) | ~left_out[d.frame_of, take.truth]
    given = np.array([*naming.tracks.names, None], dtype=object)[naming.tracks.labels]
    gone = {name for m, name in enumerate(take.names) if left_out[:, m].all()}
    scored &= (take.truth >= 0) | ~np.array([name in gone for name in given])
    scores = am.metrics.name_scores(
        naming.tracks.labels[scored], take.truth[scored], naming.tracks.names, take.names
    )
    given = given[scored]
    true = np.array([*take.names, None], dtype=object)[take.truth][scored]
    is_named = np.array([name is not None for name in given])
    certain = np.append(naming.probabilities >= CERTAIN, False)[take.tracks.labels][scored]
    certain &= is_named
    off = given != true
    pairs = Counter(
        (str(a or "none"), str(b or "none")) for a, b in zip(true[off], given[off], strict=True)
    )
    result = Result(
        target=target,
        scores=scores,
        n_named=int(is_named.sum()),
        n_certain=int(certain.sum()),
        n_certain_right=int((certain & ~off).sum()),
        n_exchanged=sum(n for pair, n in pairs.items() if _are_partners(*pair)),
        seconds=1000 * seconds / d.n_frames,
        wrong=pairs,
    )
    print(target, f"{scores.name_f1:.4f} {result.seconds:.2f} s", pairs.most_common(5),
          f"{result.n_certain - result.n_certain_right} certain and wrong",
          file=sys.stderr, flush=True)  # fmt: skip
    return result


def _are_partners(true: str, given: str) -> bool:
    """Whether a name is that of the same place on the other side, of any subject."""
    return other_side(given.rpartition(":")[2]) == true.rpartition(":")[2]


def cells(results: list[Result]) -> list[str]:
    """Return the columns of the table for the takes of one row."""
    # Scores are NaN if nothing was named.
    f1 = np.nan_to_num([r.scores.name_f1 for r in results])
    worst = results[int(np.argmin(f1))]
    named, certain, right, exchanged = (
        sum(getattr(r, name) for r in results)
        for name in ("n_named", "n_certain", "n_certain_right", "n_exchanged")
    )
    most = ", ".join(f"{true} as {given} {n}" for (true, given), n in worst.wrong.most_common(2))
    return [
        str(len(results)),
        f"{f1.mean():.4f}",
        f"{f1.min():.4f}",
        f"{np.nan_to_num([r.scores.name_accuracy for r in results]).mean():.4f}",
        f"{100 * exchanged / max(named, 1):.3f}",
        f"{100 * certain / max(named, 1):.1f}",
        f"{100 * right / max(certain, 1):.2f}",
        f"{np.mean([r.seconds for r in results]):.1f}",
        f"{worst.target}: {most}" if most else "–",
    ]


HEAD = (
    "takes",
    "mean F1",
    "smallest F1",
    "accuracy",
    "exchanged sides, %",
    "of probability ≥ 0.99, %",
    "of these right, %",
    "s / 1000 frames",
    "take of smallest F1, and its wrong detections",
)


def by_sets(trials: list[Trial], sets: Sets) -> list[list[str]]:
    """Name each trial by each set under each condition."""
    results: dict[tuple[str, str], list[Result]] = {(s, c): [] for s in SETS for c in CONDITIONS}
    for trial in trials:
        made = {which: sets.of(which, trial.subject, trial.kind) for which in SETS}
        for condition, take in takes(trial):
            for which, own in made.items():
                left_out = trial.is_wrong.copy()
                if which == SETS[3] and trial.subject == EXCHANGED[0]:
                    left_out |= np.array([name in EXCHANGED[1] for name in trial.tracks.names])
                target = f"{trial.subject} {trial.kind.lower()}"
                print(which, condition, end=" ", file=sys.stderr)
                results[which, condition].append(measure(target, take, left_out, own))
    return [[f"{which}, {condition}", *cells(r)] for (which, condition), r in results.items()]


def missing_and_extra(trials: list[Trial], sets: Sets) -> list[list[str]]:
    """Take markers out of the trial, and others out of the static set."""
    results: dict[str, list[Result]] = {f"{N_MISSING} markers missing": [], f"{N_EXTRA} extra": []}
    for n, trial in enumerate(trials):
        rng = np.random.default_rng([n, 7])
        made, names = sets.static(trial.subject), trial.tracks.names
        draw = rng.permutation(len(names))
        kept = np.sort(draw[N_MISSING:])
        take = clean(trial.tracks.select(kept.tolist()))
        target = f"{trial.subject} {trial.kind.lower()}"
        first, second = results.values()
        first.append(measure(target, take, trial.is_wrong[:, kept], made))
        extra = {names[k] for k in draw[:N_EXTRA]}
        less = made.select([k for k, name in enumerate(made.names) if name not in extra])
        take = clean(trial.tracks)
        known = tuple(None if name in extra else name for name in names)
        second.append(measure(target, replace(take, names=known), trial.is_wrong, less))
    return [[f"own static trial, {what}", *cells(r)] for what, r in results.items()]


def long_captures(trials: list[Trial], sets: Sets) -> list[list[str]]:
    """Name captures of many frames: the gait trials, repeated in both directions."""
    rows: list[list[str]] = []
    for which in (SETS[0], SETS[3]):
        for condition in CONDITIONS[:2]:
            seconds: list[float] = []
            for trial in trials:
                own = sets.of(which, trial.subject, trial.kind)
                whole = back_and_forth(trial.tracks, N_LONG)
                take = clean(whole) if condition == CONDITIONS[0] else corrupted(whole, 1)
                begin = time.process_time()
                am.name_tracks(take.tracks, own)
                seconds.append(time.process_time() - begin)
            rows.append(
                [
                    f"{which}, {condition}",
                    str(len(seconds)),
                    *(f"{f(seconds):.2f}" for f in (np.median, np.max)),
                ]
            )
    return rows


def two_subjects(sets: Sets) -> list[list[str]]:
    """Put the straight trials of two subjects side by side in one volume."""
    results: dict[str, list[Result]] = {c: [] for c in CONDITIONS[:2]}
    for one, other in zip(sets.subjects, (*sets.subjects[1:], sets.subjects[0]), strict=True):
        pair = [sets.trials[subject, "Straight"].tracks for subject in (one, other)]
        places = [t.positions() for t in pair]
        path = np.nanmean(places[0], axis=1)
        ahead = path[-1, :2] - path[0, :2]
        places[1][..., :2] += APART * np.array([-ahead[1], ahead[0]]) / np.linalg.norm(ahead)
        n_frames = min(len(p) for p in places)
        both = np.concatenate([p[:n_frames] for p in places], axis=1)
        names = [f"{s}:{n}" for s, t in zip((one, other), pair, strict=True) for n in t.names]
        merged = am.Tracks.from_dense(pair[0].detections.times[:n_frames], both, names)
        own = [sets.static(subject).of_subject(subject) for subject in (one, other)]
        nothing = np.zeros((n_frames, merged.n_tracks), dtype=bool)
        for condition, take in (
            (CONDITIONS[0], clean(merged)),
            (CONDITIONS[1], corrupted(merged, 1)),
        ):
            results[condition].append(measure(f"{one} and {other}", take, nothing, *own))
    return [[f"two own static trials, {condition}", *cells(r)] for condition, r in results.items()]


def templates(folder: Path, trials: list[Trial]) -> list[list[str]]:
    """Name static trials by the template of the subject, and gait by a labelling template."""
    rows: list[list[str]] = []
    results: list[Result] = []
    for path in sorted(folder.rglob("*.vsk")):
        for static in sorted(path.parent.glob("*.c3d")):
            tracks = named_only(am.read(static).tracks)
            take = clean(tracks)
            names = [name.rpartition(":")[2] for name in tracks.names if name]
            left_out = np.zeros((tracks.detections.n_frames, len(names)), dtype=bool)
            if path.parent.name == EXCHANGED_WRIST[0]:
                left_out[:, [names.index(name) for name in EXCHANGED_WRIST[1]]] = True
            take = replace(take, names=tuple(names))
            results.append(measure(path.name, take, left_out, am.read_marker_set(path)))
    rows.append(["subject template (.vsk), static trial", *cells(results)])
    made = am.read_marker_set(next(folder.rglob(LABELLING_TEMPLATE)))
    results = []
    for trial in trials:
        kept = [k for k, name in enumerate(trial.tracks.names) if name in made.names]
        own = trial.tracks.select(kept)
        left_out = trial.is_wrong[:, kept]
        if trial.subject == EXCHANGED[0]:
            left_out = left_out | np.array([name in EXCHANGED[1] for name in own.names])
        results.append(measure(f"{trial.subject} {trial.kind}", clean(own), left_out, made))
    rows.append(["labelling template (.vst), gait", *cells(results)])
    return rows


def streams(trials: list[Trial], sets: Sets) -> list[list[str]]:
    """Name the gait trials frame by frame: shares of the detections after the first names."""
    rows: list[list[str]] = []
    for which in (SETS[0], SETS[3]):
        for condition in (CONDITIONS[0], "bursts"):
            is_clean = condition == CONDITIONS[0]
            burst, ghosts = (None, None) if is_clean else (Burst(), Ghosts())
            right = wrong = none = 0
            first: list[float] = []
            taken: list[float] = []
            for trial in trials:
                truth = am.simulate.corrupt(
                    trial.tracks, burst=burst, ghosts=ghosts, noise=3e-4, seed=1
                )
                d, own = truth.detections, sets.of(which, trial.subject, trial.kind)
                inner = am.tracking.Stitched()
                method = am.tracking.Named(marker_sets=own, method=inner)
                model = am.estimate_model(d).model
                state, alone = method.init(model), inner.init(model)
                since = None
                for t, (time_of, points) in enumerate(d):
                    begin = time.thread_time()
                    alone, _ = inner.step(alone, time_of, points)
                    middle = time.thread_time()
                    state, update = method.step(state, time_of, points)
                    end = time.thread_time()
                    if since is None:
                        since = time_of if state.names else None
                        continue
                    taken.append(1000 * (end - middle - (middle - begin)))
                    labels = truth.labels[slice(*d.offsets[[t, t + 1]])]
                    for m, name in zip(labels.tolist(), update.names or (), strict=True):
                        if m >= 0 and trial.is_wrong[t, m]:
                            continue
                        if trial.subject == EXCHANGED[0] and truth.names[m] in EXCHANGED[1]:
                            continue
                        none += m >= 0 and name is None
                        right += m >= 0 and name == truth.names[m]
                        wrong += name is not None and (m < 0 or name != truth.names[m])
                first.append(float("inf") if since is None else since)
            total = right + wrong + none
            rows.append(
                [
                    f"{which}, {condition}",
                    f"{max(first):.2f}",
                    *(f"{100 * n / total:.2f}" for n in (right, wrong, none)),
                    *(f"{value:.2f}" for value in (np.mean(taken), np.quantile(taken, 0.99))),
                ]
            )
    return rows


def other_protocols(data: Path, sets: Sets) -> list[list[str]]:
    """Name captures of other protocols by one subject's static trial and by all six, merged."""
    rows: list[list[str]] = []
    own, merged = sets.static(sets.subjects[0]), sets.everyone()
    for path in captures(data):
        capture = am.read(path)
        if SUBJECTS.name in path.parts or not any(capture.names):
            continue
        tracks = named_only(capture.tracks)
        names = tuple(n and n.rpartition(":")[2] for n in tracks.names)
        take = replace(clean(tracks), names=names)
        nothing = np.zeros((tracks.detections.n_frames, tracks.n_tracks), dtype=bool)
        row = [path.name, str(tracks.n_tracks), str(len({*names} & {*merged.names}))]
        for made in (own, merged):
            found = measure(path.name, take, nothing, made)
            n_wrong = sum(n for (_, given), n in found.wrong.items() if given != "none")
            counts = found.n_named, n_wrong, found.n_certain - found.n_certain_right
            row.append(" / ".join(f"{100 * n / len(take.truth):.1f}" for n in counts))
        rows.append(row)
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sets", type=Path, default=SHARED / "markersets")
    parser.add_argument("--data", type=Path, default=SHARED / "data")
    parser.add_argument("--only", default="", help="part of the subject's name")
    parser.add_argument("--markdown", type=Path)
    options = parser.parse_args()
    sets = Sets(read_trials(options.sets, options.data))
    gait = [
        trial
        for (subject, kind), trial in sets.trials.items()
        if kind != "Static" and options.only in subject
    ]
    lines = [
        "Straight and turning gait of six subjects (59 markers), named by a set of the subject's "
        "static trial, of the one frame of the straight trial with the most markers, of the "
        "subject's other gait trial, or of the five other subjects (three trials each, merged). "
        "Clean: the tracks of the file. Corrupted as in SOMA: 0 to 4 markers occluded and 0 to 3 "
        "ghosts in each frame, tracks cut into pieces of 10 to 50 frames. Bursts: up to 5 markers "
        "occluded at a time for 5 to 60 frames, ghosts and 0.3 mm of noise, tracked by "
        "`am.track`. Seeds 1 to 3 for the last two. F1 is the mean over names, with no name as "
        "one more. Probabilities are those of the track's name; their shares are of the named "
        "detections. Time is of one processor, for naming alone.",
        "",
        *table(("set, condition", *HEAD), by_sets(gait, sets)),
        "",
        f"Captures of {N_LONG} frames: the same trials, repeated in both directions. Seconds for "
        "one capture.",
        "",
        *table(("set, condition", "captures", "median", "largest"), long_captures(gait, sets)),
        "",
        EVIDENCE,
        "",
        f"Clean tracks again: {N_MISSING} random markers missing from the trial; {N_EXTRA} random "
        "markers of the trial that the set does not hold, whose right name is none; and the "
        f"straight trials of two subjects in one volume, one shifted by {APART:g} m sideways, six "
        "pairs, with a set of each subject's static trial (of corrupted ones, seed 1).",
        "",
        *table(("set, condition", *HEAD), [*missing_and_extra(gait, sets), *two_subjects(sets)]),
        "",
        "Templates of Vicon: three subjects' templates on their static trials, and the labelling "
        f"template `{LABELLING_TEMPLATE}` on those of its markers that the gait trials hold. The "
        f"left wrist of {EXCHANGED_WRIST[0]} is left out: its LWRA is 62 mm behind LWRB, the right "
        "one 70 mm in front, and in the template both are in front. The template of Sample_SM has "
        "LWRA in front and RWRA behind, whereas the subject holds both inwards. In the template "
        "elbow and finger are equally far from RWRA and RWRB (266 and 101 mm), so that distances "
        "do not tell them apart; each of the two names has a probability of 0.6.",
        "",
        *table(("template, captures", *HEAD), templates(options.sets, gait)),
        "",
        "Streams: the gait trials with 0.3 mm of noise, frame by frame, tracked by `Stitched`. "
        "Time of the last first name, seconds; shares of the detections after it, %; and "
        "milliseconds of a frame beyond those of `Stitched`, mean and 99th percentile.",
        "",
        *table(
            ("set, condition", "named from", "right", "wrong", "no name", "mean", "99 %"),
            streams(gait, sets),
        ),
        "",
        "Captures of other protocols, named by the static trial of one subject and by the sets of "
        "all six, merged. Share of the detections that are named, wrong (the file has another "
        "name), and wrong with a probability of 0.99 or more, %. Files with many names of the set "
        "use the same protocol in part.",
        "",
        *table(
            ("capture", "markers", "names of the set", "one static trial", "six subjects"),
            other_protocols(options.data, sets),
        ),
        "",
        f"{conditions()}.",
    ]
    publish(lines, options.markdown)


if __name__ == "__main__":
    main()
