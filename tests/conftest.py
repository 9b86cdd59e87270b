"""What holds for all tests: examples of properties, cores not fought over, garbage collection."""

from __future__ import annotations

import gc
import os

import pytest
from hypothesis import settings

# People try properties on fresh examples, the checks of a change always on the same.
settings.register_profile("ci", derandomize=True)
if os.environ.get("CI"):
    settings.load_profile("ci")

# Tests run beside each other; linear algebra that wants every core for itself slows all of them.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
# Their processes tell how wide a line of theirs is; what our commands print goes into a pipe.
os.environ.pop("COLUMNS", None)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers():
    """One worker more than cores, because many tests wait for sockets, browsers and processes."""
    return len(os.sched_getaffinity(0)) + 1 if hasattr(os, "sched_getaffinity") else None


# Collecting the tests makes millions of objects that all stay. The garbage collector would walk
# through them again and again, there and in every test that allocates much.
gc.disable()


def pytest_collection_finish():
    gc.freeze()
    gc.enable()
