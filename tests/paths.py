"""Where the project is, and what lies beside it."""

from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
DATA = ROOT.parent / "shared" / "data"
"""The real captures; tests that need them are skipped where there are none."""
REPRO = ROOT.parent / "shared" / "repro"
STREAMS = ROOT.parent / "shared" / "streams"
"""Recorded network traffic of other makers' systems; tests of it are skipped without."""
