"""Sessions that are killed lose no confirmed edit."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path


def test_killed_sessions_lose_no_confirmed_edit():
    done = subprocess.run(
        [sys.executable, "-m", "tests.tools.kill_sessions", "--count", "40"],
        cwd=Path(__file__).parents[2], capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("40 sessions killed after ")
    assert int(done.stdout.split()[4]) > 100
