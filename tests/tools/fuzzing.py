"""Feed many random inputs to one target in a child process, and keep each input that fails.

A crash, a hang, a huge allocation, a warning of Python and any exception that the target does not
expect are failures. An input follows from the name of the target, the seed and its number, so that
a run can be repeated. With ``--state`` a stopped run continues where it was, and a finished run can
be made longer.
"""

# ruff: noqa: T201
from __future__ import annotations

import argparse
import logging
import os
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import traceback
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

MEMORY = 512 << 20  # bytes beyond what the modules themselves take
SECONDS = 2  # of processor time
OUTCOMES = ("refused", "accepted", "failed", "died")


class Target(Protocol):
    """What is fuzzed."""

    def prepare(self) -> None:
        """Load all modules, before the memory is limited."""

    def damaged(self, i: int) -> Any:
        """Make input `i`."""

    def feed(self, *made: Any) -> str:
        """Run one input; "refused" or "accepted". Any exception is a failure."""
        ...

    def kept(self, made: Any) -> tuple[str, bytes]:
        """Name and content of a file that repeats the input."""
        ...


def _state(path: Path) -> np.memmap:
    """Open the numbers that outlive a process: the next input, then the count of each outcome."""
    shape = (1 + len(OUTCOMES),)
    mode = "r+" if path.exists() else "w+"
    return np.memmap(path, dtype=np.int64, mode=mode, shape=shape)


def _run(target: Target, name: str, seed: int, count: int, state: Path) -> None:
    warnings.simplefilter("error")
    logging.disable()
    target.prepare()
    if "libasan" not in os.environ.get("LD_PRELOAD", ""):  # which reserves all addresses
        pages = int(Path("/proc/self/statm").read_text().split()[0])
        limit = pages * resource.getpagesize() + MEMORY
        resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
    numbers = _state(state / f"{name}.state")
    for i in range(int(numbers[0]), count):
        numbers[0] = i
        made = target.damaged(i)
        # Unhandled on purpose: the signal kills even where no Python runs.
        signal.setitimer(signal.ITIMER_PROF, SECONDS)
        try:
            outcome = target.feed(*made)
        except BaseException:
            outcome = "failed"
            report = traceback.format_exc()
            (state / f"{name}_{seed}_{i}.txt").write_text(report)
            file, content = target.kept(made)
            (state / f"{name}_{seed}_{i}_{file}").write_bytes(content)
            print(f"{name}: input {i}: {report.splitlines()[-1]}", flush=True)
        signal.setitimer(signal.ITIMER_PROF, 0)
        numbers[1 + OUTCOMES.index(outcome)] += 1
    numbers[0] = count


def fuzz(
    make: Callable[[str, Path, int], Target],
    script: Sequence[str],
    name: str,
    *,
    count: int,
    seed: int,
    state: Path,
) -> int:
    """Feed a target until it has had `count` inputs; return the number of failures."""
    numbers = _state(state / f"{name}.state")
    began, first = time.perf_counter(), int(numbers[0])
    while numbers[0] < count:
        shm = Path("/dev/shm")
        folder = Path(tempfile.mkdtemp(prefix="fuzz_", dir=shm if shm.is_dir() else None))
        command = [sys.executable, *script, "--child", str(folder), name]
        command += ["--count", str(count), "--seed", str(seed), "--state", str(state)]
        environment = os.environ | {"OPENBLAS_NUM_THREADS": "1"}
        code = subprocess.run(command, check=False, env=environment).returncode
        if code < 0:
            i = int(numbers[0])
            target = make(name, Path(tempfile.mkdtemp(dir=folder)), seed)
            file, content = target.kept(target.damaged(i))
            (state / f"{name}_{seed}_{i}_{file}").write_bytes(content)
            print(f"{name}: input {i}: the process died of signal {-code}", flush=True)
            numbers[1 + OUTCOMES.index("died")] += 1
            numbers[0] += 1
        shutil.rmtree(folder)
        if code > 0:
            raise RuntimeError(f"{name}: the child ended with {code}")
    n = int(numbers[0]) - first
    rate = n / max(time.perf_counter() - began, 1e-9)
    outcomes = ", ".join(f"{o} {c}" for o, c in zip(OUTCOMES, numbers[1:].tolist(), strict=True))
    print(f"{name}: {int(numbers[0])} inputs, {outcomes}; {rate:.0f} a second", flush=True)
    return int(numbers[3:].sum())


def main(
    purpose: str,
    make: Callable[[str, Path, int], Target],
    names: Sequence[str],
    script: Sequence[str],
) -> int:
    """Run the command line of a script that fuzzes targets; return the exit code.

    `script` is what Python is given to run the script again, for the child processes.
    """
    parser = argparse.ArgumentParser(description=purpose.partition("\n")[0])
    parser.add_argument("names", nargs="*", help=f"of {', '.join(names)}; all by default")
    parser.add_argument("--count", type=int, default=20_000, help="inputs for each of them")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--state", type=Path, help="folder to continue in; a new one by default")
    parser.add_argument("--child", type=Path, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.child is not None:
        (name,) = given.names
        target = make(name, given.child, given.seed)
        _run(target, name, given.seed, given.count, given.state)
        return 0
    state = given.state or Path(tempfile.mkdtemp(prefix="fuzz_"))
    state.mkdir(exist_ok=True)
    print(f"state and failures in {state}", flush=True)
    failures = [
        fuzz(make, script, name, count=given.count, seed=given.seed, state=state)
        for name in given.names or names
    ]
    return int(sum(failures) > 0)
