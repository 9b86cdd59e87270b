"""One run in a child process: its labels, its CPU time and what memory it took, or why it failed.

The child is a fork of the benchmark, in which everything is loaded and warm, so that all are timed
alike; a limit of CPU time ends it.
"""

from __future__ import annotations

import ctypes
import gc
import multiprocessing
import os
import resource
import signal
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable

    import numpy as np
    from numpy.typing import NDArray

__all__ = ["Run", "measured"]

STATUS = Path("/proc/self/status")


@dataclass(frozen=True, kw_only=True)
class Run:
    """What came of a run.

    Parameters
    ----------
    labels : ndarray of int, or None
        None where it failed.
    seconds : float
        CPU time.
    megabytes : float
        Most memory resident at a time, less what was when it began; nan where the system does not
        say.
    error : str
        Why it failed, "" where it did not.
    """

    labels: NDArray[np.int64] | None
    seconds: float
    megabytes: float
    error: str = ""


def _memory(name: str) -> float:
    """Read an entry of the process' status, megabytes."""
    if not STATUS.exists():
        return float("nan")
    line = next(line for line in STATUS.read_text().splitlines() if line.startswith(name))
    return int(line.split()[1]) / 1024


def _child(work: Callable[[], NDArray[np.int64]], limit: int, pipe: Any) -> None:
    os.environ["OMP_NUM_THREADS"] = "1"
    gc.freeze()  # the parent's garbage, if it were freed here, would hide what the work takes,
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
    if trim is not None:
        trim(0)  # and so would what it freed and kept: the work would be given that
    resource.setrlimit(resource.RLIMIT_CPU, (limit, limit + 1))
    if STATUS.exists():
        Path("/proc/self/clear_refs").write_text("5")  # the peak so far is the parent's
    before, start = _memory("VmRSS"), time.process_time()
    try:
        labels, error = work(), ""
    except Exception as failed:  # whatever a peer raises is its row
        reason: BaseException = failed
        while reason.__cause__ is not None:
            reason = reason.__cause__
        labels, error = None, f"{type(reason).__name__}: {reason}"
    taken = time.process_time() - start
    pipe.send((labels, taken, _memory("VmHWM") - before, error[:200]))


def measured(work: Callable[[], NDArray[np.int64]], limit: float) -> Run:
    """Run in a child.

    Parameters
    ----------
    work : callable
        Gives labels.
    limit : float
        CPU time after which it is ended, seconds.

    Returns
    -------
    Run
    """
    fork = multiprocessing.get_context("fork")
    ours, theirs = fork.Pipe()
    child = fork.Process(target=_child, args=(work, max(round(limit), 1), theirs))
    child.start()
    theirs.close()
    try:
        labels, seconds, megabytes, error = ours.recv()
    except EOFError:
        child.join()
        slow = child.exitcode in (-signal.SIGXCPU, -signal.SIGKILL)
        error = f"more than {limit:.0f} s" if slow else f"ended by {child.exitcode}"
        return Run(labels=None, seconds=limit, megabytes=float("nan"), error=error)
    child.join()
    return Run(labels=labels, seconds=seconds, megabytes=megabytes, error=error)
