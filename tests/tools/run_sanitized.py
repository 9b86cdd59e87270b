"""Run the tests of the engine with the sanitizer build of it: ``run_sanitized.py BUILD_FOLDER``.

Python itself is not built with the sanitizers, so their runtime is loaded before it. Leaks are not
looked for: the interpreter keeps what it allocates.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

TESTS = (
    "filter/test_kalman.py",
    "model/test_posterior.py",
    "solve/test_solvers.py",
    "contracts/test_methods.py",
    "camera/test_camera.py",
    "camera/test_lens.py",
    "camera/test_surfaces.py",
    "camera/test_painter.py",
    "solve/test_joint_events.py",
    "solve/test_k_best.py",
    "solve/test_set_packing.py",
    "multiview/test_reconstruct.py",
    "multiview/test_reconstruct_options.py",
    "methods/test_mht.py",
    "methods/test_chain.py",
    "methods/test_mcmcda.py",
    "methods/test_mcmcda_whole.py",
    "contracts/test_own_noise.py",
    "methods/test_bodies.py",
    "stitching/test_parts.py",
    "stitching/test_links.py",
    "stitching/test_stream.py",
    "engine/test_sweep.py",
)
LEFT_OUT = (
    "many_points or reference_implementation or partitions or beside_birth or unequal_shares or "
    "several_motions or known_mistakes or changed_lens or stable_and_best or exact_solver or "
    "best_of_all_choices or too_many_rivals or used_twice or eight_cameras or harm[1e-310 or "
    "clusters_apart or share_of_the_posterior or no_worse or window_s_best or "
    "guessed_soon or as_good_as_the_whole or endless_run or calibrated_where or interrupted or "
    "too_long_to_be_read or blurred_helps or chains_disagree or model_of_a_capture or "
    "wrong_links or deadline_stops or keep_their_distances or no_harm_where or "
    "of_a_person_come_back or carrying_ends or hand[0.004 or "
    "without_noise[1 or without_noise[2 or without_noise[3 or without_noise[4 or without_noise[5"
)
"""Too slow (a reference implementation is Python, a posterior is sampled for millions of moves,
numbers below the normal range take a hundred cycles each), more seeds of what stays, or measuring
memory or time, which the sanitizers inflate."""

PLUGIN = """
import sys
from pathlib import Path

sys.meta_path[:] = [f for f in sys.meta_path
                    if "editable" not in type(f).__module__ + type(f).__name__.lower()]
import asterism._engine as engine

assert Path(engine.__file__).is_relative_to(Path(__file__).parent), engine.__file__
"""
"""What every process of pytest does first: forget the engine that is installed."""


def main() -> int:
    build = Path(sys.argv[1]).resolve()
    root = Path(__file__).resolve().parents[2]
    engine = next(build.glob("_engine*"))
    runtimes = [
        subprocess.run(
            ["g++", f"-print-file-name={name}"], check=True, capture_output=True, text=True
        ).stdout.strip()
        for name in ("libasan.so", "libubsan.so", "libstdc++.so")
    ]
    with tempfile.TemporaryDirectory() as folder:
        package = Path(folder) / "asterism"
        shutil.copytree(root / "src" / "asterism", package)
        for built in package.glob("_engine*.so"):
            built.unlink()
        shutil.copy(engine, package)
        (Path(folder) / "sanitized.py").write_text(PLUGIN)
        environment = {
            **os.environ,
            "PYTHONPATH": folder,
            "LD_PRELOAD": ":".join(runtimes),
            "ASAN_OPTIONS": "detect_leaks=0:abort_on_error=1",
            "UBSAN_OPTIONS": "print_stacktrace=1:halt_on_error=1",
            "PYTHONMALLOC": "malloc",
            "ASTERISM_SANITIZED": "1",
        }
        arguments = [str(root / "tests" / name) for name in TESTS]
        return subprocess.run(
            [sys.executable, "-m", "pytest", "-q", "-p", "sanitized", "-p", "no:cacheprovider",
             "-n", "auto", "--dist", "worksteal", "-k", f"not ({LEFT_OUT})",
             "--capture=sys", *arguments],  # a report of the sanitizers gets past pytest
            cwd=root, env=environment, check=False,
        ).returncode  # fmt: skip


if __name__ == "__main__":
    sys.exit(main())
