"""Parts of the engine that Python does not reach by themselves: a program of checks is compiled."""

from __future__ import annotations

import shutil
import subprocess

import pytest

from tests.paths import ROOT

COMPILER = shutil.which("g++") or shutil.which("clang++")


@pytest.mark.skipif(COMPILER is None, reason="no C++ compiler on the path")
def test_checks_of_the_engine_s_parts_hold(tmp_path):
    assert COMPILER is not None
    program = tmp_path / "checks"
    subprocess.run(
        [COMPILER, "-std=c++20", "-O1", "-pthread", "-fsanitize=undefined",
         "-fno-sanitize-recover=undefined", "-fsanitize=float-cast-overflow",
         "-D_GLIBCXX_ASSERTIONS", "-I", str(ROOT / "engine"),
         str(ROOT / "tests" / "engine" / "checks.cpp"),
         str(ROOT / "engine" / "filter" / "kalman.cpp"),
         str(ROOT / "engine" / "filter" / "imm.cpp"), "-o", str(program)],
        check=True,
    )  # fmt: skip
    done = subprocess.run([program], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
