"""Temperature of the probabilities of names, fitted to simulated people.

A marker set is learnt from one frame of a take, or from a second of it, and names a take of another
activity, corrupted as in SOMA. Some markers of the set are not worn, and some tracks are no marker
of it. The temperature with the smallest log loss is the fitted one; no real subject has a part.

    python benchmarks/naming_temperature.py [--people N] [--markdown FILE]
"""

from __future__ import annotations

import argparse
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

import asterism as am
from asterism.tracking.naming import probabilities
from naming_takes import corrupted
from report import conditions, publish, table

if TYPE_CHECKING:
    from numpy.typing import NDArray

TEMPERATURES = (1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0)
ACTIVITIES = ("walk", "turn", "jump")
GONE, ATTACHED = 4, 0.004  # markers that either lacks; metres by which markers are attached again
EDGES = (0.0, 0.5, 0.7, 0.9, 0.99, 1.0)


def results(seed: int) -> list[tuple[NDArray[np.float64], NDArray[np.bool_]]]:
    """Name the takes of one person; return probability and rightness of each name, by temperature.

    The probability is counted once a detection, so that short pieces count little.
    """
    rng = np.random.default_rng(seed)
    found: list[tuple[NDArray[np.float64], NDArray[np.bool_]]] = []
    first = am.simulate.person(activity=ACTIVITIES[seed % 3], frames=100, seed=seed)
    later = am.simulate.person(activity=ACTIVITIES[(seed + 1) % 3], frames=150, seed=seed)
    places = later.positions() + rng.normal(scale=ATTACHED, size=(1, later.n_tracks, 3))
    later = am.Tracks.from_dense(later.detections.times, places, later.names)
    draw = rng.permutation(later.n_tracks)
    worn = later.select(np.sort(draw[GONE:]).tolist())
    take = corrupted(worn, seed)
    for learnt in (first.part(0, 1), first):
        made = am.learn_marker_set(learnt.select(np.sort(draw[:-GONE]).tolist()))
        known = np.array([n if n in made.names else None for n in [*take.names, None]], object)
        rows = np.flatnonzero(take.tracks.labels >= 0)
        label, true = take.tracks.labels[rows], known[take.truth[rows]]
        namings: list[am.tracking.Naming] = []
        for temperature in TEMPERATURES:
            probabilities.TEMPERATURE = temperature
            namings.append(am.name_tracks(take.tracks, made))
        given = np.array(namings[0].markers, dtype=object)[label]  # names are the same for all
        named = np.array([name is not None for name in given])
        p = np.stack([naming.probabilities[label] for naming in namings])
        found.append((p[:, named], (given == true)[named]))
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--people", type=int, default=12)
    parser.add_argument("--markdown", type=Path)
    options = parser.parse_args()
    all_found = [own for seed in range(options.people) for own in results(seed)]
    p = np.concatenate([own for own, _ in all_found], axis=1)
    right = np.concatenate([own for _, own in all_found])
    bounded = np.clip(p, 1e-6, 1 - 1e-6)
    loss = -np.where(right, np.log(bounded), np.log(1 - bounded)).mean(axis=1)
    best = int(np.argmin(loss))
    losses = [[f"{t:g}", f"{1000 * own:.2f}"] for t, own in zip(TEMPERATURES, loss, strict=True)]
    bins: list[list[str]] = []
    for low, high in pairwise(EDGES):
        inside = (p[best] >= low) & ((p[best] < high) | (high == 1))
        if inside.any():
            stated, share = p[best, inside].mean(), right[inside].mean()
            bins.append([f"{low:g} to {high:g}", str(int(inside.sum())), f"{100 * stated:.2f}",
                         f"{100 * share:.2f}"])  # fmt: skip
    lines = [
        f"Names of {options.people} simulated people, {len(right)} named detections. Each set is "
        f"learnt from one frame or from 100 frames, and names another activity: markers attached "
        f"again ({1000 * ATTACHED:g} mm), {GONE} markers of the set not worn, {GONE} others worn, "
        "corrupted as in SOMA.",
        "",
        *table(("temperature", "log loss, 1/1000 nats"), losses),
        "",
        f"Reliability at the temperature {TEMPERATURES[best]:g}:",
        "",
        *table(("probability", "detections", "stated, %", "right, %"), bins),
        "",
        f"{conditions()}.",
    ]
    publish(lines, options.markdown)


if __name__ == "__main__":
    main()
