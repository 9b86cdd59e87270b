"""The example for SLURM, with an `sbatch` that starts its jobs on this machine."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from tests.batch.conftest import contents
from tests.paths import ROOT

pytest.importorskip("dask_jobqueue", reason="needs dask-jobqueue")
if not (ROOT / "examples").is_dir():
    pytest.skip("the examples are not in a source distribution", allow_module_level=True)

# A job runs in the background with its number as the name of its file of process ids.
SBATCH = """#!/bin/sh
number=$$
setsid sh "$1" > "$JOBS/$number.log" 2>&1 &
echo $! > "$JOBS/$number.pid"
cp "$1" "$JOBS/$number.sh"
echo "Submitted batch job $number"
"""
SCANCEL = """#!/bin/sh
for number; do kill -TERM -- "-$(cat "$JOBS/$number.pid")" 2>/dev/null; done
exit 0
"""


def test_jobs_of_slurm_track_a_batch(made_captures, serial, tmp_path):
    jobs = tmp_path / "jobs"
    programs = tmp_path / "bin"
    for folder in (jobs, programs):
        folder.mkdir()
    for name, text in (("sbatch", SBATCH), ("scancel", SCANCEL)):
        (programs / name).write_text(text)
        (programs / name).chmod(0o755)
    environment = os.environ | {
        "PATH": f"{programs}{os.pathsep}{os.environ['PATH']}",
        "JOBS": str(jobs),
        "PYTHONPATH": os.pathsep.join(filter(None, sys.path)),
    }
    out = tmp_path / "out"
    done = subprocess.run(
        [sys.executable, ROOT / "examples" / "batch_on_slurm.py", made_captures, out,
         "--jobs", "2", "--queue", "short", "--interface", "lo"],
        env=environment, cwd=tmp_path, capture_output=True, text=True, timeout=300,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "Batch(3 captures tracked, 0 done before, 1 failed)" in done.stdout
    scripts = [path.read_text() for path in jobs.glob("*.sh")]
    assert len(scripts) == 2
    for wanted in ("#SBATCH -p short", "#SBATCH -t 08:00:00", "#SBATCH --mem=4G", "dask_worker"):
        assert all(wanted in script for script in scripts), scripts[0]
    assert contents(out) == serial
