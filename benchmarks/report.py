"""What the benchmarks share: a clock, a word on the machine, and where the pages go."""

from __future__ import annotations

import hashlib
import platform
import time
from typing import TYPE_CHECKING

import numpy as np

import asterism as am

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence
    from pathlib import Path

__all__ = ["best_of", "conditions", "publish", "table"]


def best_of(runs: int, work: Callable[[], object]) -> float:
    """Least time of several runs, seconds."""
    times: list[float] = []
    for _ in range(runs):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return min(times)


def conditions() -> str:
    """Machine and versions, for the foot of a page.

    The speed of a core, which varies with what shares the machine, is given by a loop of the
    standard library.
    """
    loop = best_of(3, _loop)
    return (
        f"{platform.processor() or platform.machine()}, 10⁶ iterations of PBKDF2 in {loop:.2f} s, "
        f"Python {platform.python_version()}, NumPy {np.__version__}, asterism {am.__version__}"
    )


def _loop() -> bytes:
    return hashlib.pbkdf2_hmac("sha256", b"loop", b"salt", 1_000_000)


def publish(lines: Iterable[str], markdown: Path | None) -> None:
    """Print a page, and write it where a file is given."""
    text = "\n".join(lines)
    print(text)
    if markdown:
        markdown.write_text(text + "\n", encoding="utf-8")


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    """Lines of a table in Markdown, all but the first column to the right."""
    return [
        "| " + " | ".join(head) + " |",
        "|---|" + "---:|" * (len(head) - 1),
        *("| " + " | ".join(row) + " |" for row in rows),
    ]
