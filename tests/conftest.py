"""What holds for all tests: examples of properties, cores not fought over, garbage collection."""

from __future__ import annotations

import gc
import os

from hypothesis import settings

# People try properties on fresh examples, the checks of a change always on the same.
settings.register_profile("ci", derandomize=True)
if os.environ.get("CI"):
    settings.load_profile("ci")

# Tests run beside each other; linear algebra that wants every core for itself slows all of them.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
# Their processes tell how wide a line of theirs is; what our commands print goes into a pipe.
os.environ.pop("COLUMNS", None)

# Collecting the tests makes millions of objects that all stay. The garbage collector would walk
# through them again and again, there and in every test that allocates much.
gc.disable()


def pytest_collection_finish():
    gc.freeze()
    gc.enable()
