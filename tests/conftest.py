"""What holds for all tests: the examples of properties, and cores that are not fought over."""

from __future__ import annotations

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
