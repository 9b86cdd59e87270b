"""What two threads or processes gain where captures, groups or chains are independent.

Wall time of two cores against one. The machine may be shared, so a loop that neither allocates nor
holds the interpreter's lock (PBKDF2 of the standard library) is measured in the same rounds. Its
ratio is what the machine allows. Times are the least of the rounds, because others disturb two
threads more than one, and the share is that of the machine's ratio. Each row checks that both ways
give the same bytes. Groups are those of the scene `simulate.dense`; their rows measure the
association alone.

    python benchmarks/threads.py [--rounds N] [--markdown FILE]
"""

from __future__ import annotations

import argparse
import hashlib
import time
from concurrent.futures import Executor, ProcessPoolExecutor, ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

import asterism as am
from asterism.tracking.methods.associate import associate
from report import conditions, publish, table

if TYPE_CHECKING:
    from collections.abc import Callable

    Work = Callable[[], list[bytes]]
    """A computation, and the bytes of its results."""

SPIN = 1_000_000
"""Iterations of PBKDF2, a few tenths of a second."""


EXPECTED = 1.7
"""Ratio of the loop on a machine whose two cores are free, at least."""
BUSY = (
    f"The loop itself stays below {EXPECTED}: other processes used the cores during the "
    "measurement, so the ratios do not show what two free cores gain."
)


def spin(_: object) -> bytes:
    return hashlib.pbkdf2_hmac("sha256", b"spin", b"salt", SPIN)


def track(capture: am.Detections) -> bytes:
    return am.track(capture).labels.tobytes()


def estimate(capture: am.Detections) -> bytes:
    return repr(am.estimate_model(capture)).encode()


def one_after_the_other(task: Callable[..., bytes], items: list[object]) -> list[bytes]:
    return [task(item) for item in items]


def side_by_side(pool: Executor, task: Callable[..., bytes], items: list[object]) -> list[bytes]:
    return list(pool.map(task, items))


def sampled(d: am.Detections, model: am.TrackingModel, threads: int, chains: int) -> list[bytes]:
    method = am.MCMCDA(threads=threads, chains=chains)
    found = associate(method, d, model, seed=1, score=False)
    assert found.confidence is not None
    return [found.labels.tobytes(), found.confidence.tobytes()]


def timed(work: Work) -> tuple[float, list[bytes]]:
    start = time.perf_counter()
    result = work()
    return time.perf_counter() - start, result


def people() -> list[object]:
    """Four captures of 53 markers, 1000 frames each."""
    found: list[object] = []
    for seed in range(4):
        person = am.simulate.person(seed=seed, frames=1000)
        noisy = am.simulate.corrupt(person, missing=0.1, clutter=0.1, noise=3e-4, seed=seed)
        found.append(noisy.detections)
    return found


def rows_of(pairs: dict[str, tuple[Work, Work]], rounds: int) -> list[list[str]]:
    """Measure all pairs in each round, and each pair beside the loop."""
    taken = {name: np.zeros((rounds, 2)) for name in pairs}
    for n in range(rounds):
        for name, pair in pairs.items():
            # The order alternates, because the load by others drifts.
            order = (0, 1) if n % 2 == 0 else (1, 0)
            results: dict[int, list[bytes]] = {}
            for k in order:
                taken[name][n, k], results[k] = timed(pair[k])
            assert results[0] == results[1], f"{name}: other bytes"
    least = {name: each.min(axis=0) for name, each in taken.items()}
    machine = float(np.divide(*next(iter(least.values()))))
    rows: list[list[str]] = []
    for name, (one, two) in least.items():
        ratio = one / two
        rows.append(
            [name, f"{one:.2f}", f"{two:.2f}", f"{ratio:.2f}", f"{100 * ratio / machine:.0f} %"]
        )
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--markdown", type=Path)
    options = parser.parse_args()
    captures = people()
    scene = am.simulate.dense(n_markers=1000, frames=40, seed=1)
    dense = am.simulate.corrupt(scene, missing=0.1, clutter=0.1, noise=0.005, seed=2).detections
    model = am.estimate_model(dense).model
    with ThreadPoolExecutor(2) as threads, ProcessPoolExecutor(2) as processes:
        list(processes.map(track, captures[:2]))  # the processes have imported all by now

        def pair(
            pool: Executor, task: Callable[..., bytes], items: list[object]
        ) -> tuple[Work, Work]:
            return partial(one_after_the_other, task, items), partial(
                side_by_side, pool, task, items
            )

        pairs = {
            "loop without the interpreter, threads": pair(threads, spin, [1, 2]),
            "`am.track` of 4 captures, threads": pair(threads, track, captures),
            "`am.track` of 4 captures, processes": pair(processes, track, captures),
            "`am.estimate_model` of 4 captures, threads": pair(threads, estimate, captures),
            "MCMCDA, 1000 markers, groups": (
                partial(sampled, dense, model, 1, 1), partial(sampled, dense, model, 2, 1)
            ),
            "MCMCDA, 1000 markers, groups of 2 chains": (
                partial(sampled, dense, model, 1, 2), partial(sampled, dense, model, 2, 2)
            ),
        }  # fmt: skip
        rows = rows_of(pairs, options.rounds)
    head = ["work", "one, s", "two, s", "ratio", "share of the loop's ratio"]
    lines = [*table(head, rows), "", f"Least of {options.rounds} rounds. {conditions()}."]
    if float(rows[0][3]) < EXPECTED:
        lines[-1] += f" {BUSY}"
    publish(lines, options.markdown)


if __name__ == "__main__":
    main()
