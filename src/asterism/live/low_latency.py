"""Settings of the interpreter that keep the delay of a frame short."""

from __future__ import annotations

import gc
import sys
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Generator

__all__ = ["low_latency"]

SWITCH_SECONDS = 2e-4
"""Longest time for which a thread keeps the interpreter while another one waits; 5 ms by default.
The loop waits that long at most, while a server answers a client."""


@contextmanager
def low_latency() -> Generator[None, None, None]:
    """Switch threads sooner, and let garbage be collected only when the caller asks for it.

    Existing objects are exempt from collection meanwhile, so that a collection inspects only those
    of the stream.
    """
    interval, was_enabled = sys.getswitchinterval(), gc.isenabled()
    gc.collect()
    gc.freeze()
    gc.disable()
    sys.setswitchinterval(SWITCH_SECONDS)
    try:
        yield
    finally:
        sys.setswitchinterval(interval)
        if was_enabled:
            gc.enable()
        gc.unfreeze()
