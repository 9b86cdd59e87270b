"""The examples run, so that they cannot rot."""

from __future__ import annotations

import runpy
import sys

import pytest

from tests.paths import ROOT

# The one for SLURM needs a cluster: tests/batch/test_slurm.py.
EXAMPLES = sorted(set((ROOT / "examples").glob("*.py")) - {ROOT / "examples" / "batch_on_slurm.py"})


@pytest.mark.parametrize("path", EXAMPLES, ids=[p.stem for p in EXAMPLES])
def test_it_runs_and_says_something(path, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", [str(path), str(tmp_path)])
    runpy.run_path(str(path), run_name="__main__")
    assert len(capsys.readouterr().out.splitlines()) > 5
