"""Some damaged files for each reader; `tests/tools/fuzz_readers.py` does the same at length."""

from __future__ import annotations

import subprocess
import sys

import pytest

from tests.paths import ROOT
from tests.tools.fuzz_readers import Bench, readers


@pytest.mark.parametrize("name", readers())
def test_the_seeds_themselves_are_read_and_written(name, tmp_path):
    bench = Bench(name, tmp_path)
    for files, home in zip(bench.reader.seeds, bench.homes, strict=True):
        path = home if len(files) > 1 else home / next(iter(files))
        for is_sniffed in (False, True):
            bench.reader.read(path, is_sniffed)(tmp_path)


@pytest.mark.parametrize("name", readers())
def test_damaged_files_are_read_or_refused(name, tmp_path):
    bench = Bench(name, tmp_path, seed=7)
    outcomes = {bench.feed(*bench.damaged(i)) for i in range(200)}
    # Both happen, or the damage is too gentle or too rough to show anything.
    assert outcomes == {"accepted", "refused"}


def test_inputs_follow_from_their_numbers(tmp_path):
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
    a, b = (Bench("trc", tmp_path / name, seed=1) for name in ("a", "b"))
    assert [a.damaged(i)[:3] for i in range(50)] == [b.damaged(i)[:3] for i in range(50)]
    assert len({a.damaged(i)[2] for i in range(50)}) > 40


def test_a_run_continues_and_survives_what_it_looks_for(tmp_path):
    # A reader that hangs, takes all memory, dies or raises must cost one input each.
    script = tmp_path / "bad.py"
    script.write_text(
        f"""
import os, sys
sys.path.insert(0, {str(ROOT)!r})
from tests.tools import fuzzing

class Bad:
    def __init__(self, name, folder, seed):
        pass

    def prepare(self):
        pass

    def damaged(self, i):
        return (i,)

    def feed(self, i):
        if i == 3:
            os.kill(os.getpid(), 11)
        while i == 5:
            pass
        if i == 7:
            raise AttributeError("no such thing")
        if i == 9:
            bytearray(2 << 30)
        return "refused"

    def kept(self, made):
        return "seed.bin", bytes(made)

fuzzing.SECONDS = 0.2
sys.exit(fuzzing.main("", Bad, ["bad"], [{str(script)!r}]))
"""
    )

    def run(count):
        command = [sys.executable, str(script), "bad", "--state", str(tmp_path / "state")]
        ended = subprocess.run(
            [*command, "--count", count], capture_output=True, text=True, check=False
        )
        assert ended.returncode == 1, ended.stderr
        return ended.stdout

    out = run("8")
    assert "bad: input 3: the process died of signal 11" in out
    assert "bad: input 5: the process died of signal 27" in out
    assert "bad: input 7: AttributeError: no such thing" in out
    assert "failed 1, died 2" in out
    out = run("40")
    assert "input 7" not in out  # continued, not begun again
    assert "bad: input 9: MemoryError" in out
    assert "bad: 40 inputs" in out
    assert "failed 2, died 2" in out
    kept = {path.name for path in (tmp_path / "state").iterdir()}
    assert kept >= {"bad_0_3_seed.bin", "bad_0_5_seed.bin", "bad_0_7_seed.bin", "bad_0_7.txt"}
