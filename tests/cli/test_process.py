"""The command line from the outside: exit codes, signals, pipes, and what is left behind."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

import asterism as am
from asterism.cli import main

ASTERISM = (sys.executable, "-m", "asterism.cli")


def run(*arguments, cwd, **options):
    return subprocess.run(
        [*ASTERISM, *arguments], cwd=cwd, capture_output=True, text=True, timeout=60, **options
    )


def start(*arguments, cwd):
    # As a terminal would start it: a shell without job control lets its children ignore SIGINT.
    return subprocess.Popen(
        [*ASTERISM, *arguments], cwd=cwd, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL,
        text=True, preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )  # fmt: skip


def stopped(process, signum):
    """Send a signal; give the exit code and what was said."""
    process.send_signal(signum)
    _, err = process.communicate(timeout=30)
    return process.returncode, err


def wait_for(condition, process, seconds=30):
    end = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > end:
            process.kill()
        if process.poll() is not None:
            pytest.fail(f"exit code {process.returncode}: {process.communicate()[1]}")
        time.sleep(0.002)


@pytest.fixture(scope="module")
def long_capture(tmp_path_factory):
    """A capture that takes seconds to track and to write, and a model for it."""
    folder = tmp_path_factory.mktemp("long")
    truth = am.simulate.smooth(n_markers=30, frames=3_000, rate=100, seed=1)
    am.write(truth, folder / "in.c3d")
    model = am.TrackingModel(
        motion=am.DWNA(acceleration_sigma=20),
        sensor=am.Sensor(noise_sigma=1e-3, p_detection=0.99, clutter_density=1e-3),
        population=am.Population(birth_density=1e-3, p_disappear=1e-3, max_speed=12, max_gap=5),
    )
    model.to_toml(folder / "model.toml")
    return folder


@pytest.fixture
def folder(long_capture, tmp_path):
    for name in ("in.c3d", "model.toml"):
        (tmp_path / name).symlink_to(long_capture / name)
    return tmp_path


@pytest.mark.parametrize(
    ("signum", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)], ids=["SIGINT", "SIGTERM"]
)
def test_stopped_while_tracking(folder, signum, code):
    process = start("track", "in.c3d", "--model", "model.toml", "--run", "run", cwd=folder)
    log = folder / "run" / "log.txt"
    wait_for(lambda: log.exists() and log.stat().st_size > 0, process)
    assert stopped(process, signum) == (code, f"asterism: stopped by {signum.name}\n")
    left = {path.name for path in (folder / "run").iterdir()}
    assert left <= {"log.txt", "run.toml"}  # no result, no summary, no temporary file
    assert f"Stopped: {signum.value}" in (folder / "run/log.txt").read_text()


@pytest.mark.parametrize("signum", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_stopped_while_writing(folder, signum):
    (folder / "out.csv").write_text("the old result")
    line = "track in.c3d --model model.toml --method gnn -o out.csv --overwrite"
    process = start(*line.split(), cwd=folder)
    wait_for(lambda: any(folder.glob(".*.part")), process)
    code, _ = stopped(process, signum)
    assert code == (-signum if signum == signal.SIGKILL else 128 + signum)
    assert (folder / "out.csv").read_text() == "the old result"
    if signum != signal.SIGKILL:  # which leaves no process to tidy up
        assert sorted(p.name for p in folder.iterdir()) == ["in.c3d", "model.toml", "out.csv"]


def catches(process, signum):
    """Whether a process answers a signal itself, which Python does not do with SIGTERM."""
    status = Path(f"/proc/{process.pid}/status")
    if not status.exists():  # no Linux: long enough on an idle machine
        time.sleep(1.0)
        return True
    (caught,) = (line for line in status.read_text().splitlines() if line.startswith("SigCgt"))
    return bool(int(caught.split()[1], 16) >> (signum - 1) & 1)


def test_stopped_early(folder):
    process = start("track", "in.c3d", cwd=folder)
    wait_for(lambda: catches(process, signal.SIGTERM), process)
    assert stopped(process, signal.SIGINT) == (130, "asterism: stopped by SIGINT\n")
    assert sorted(p.name for p in folder.iterdir()) == ["in.c3d", "model.toml"]


@pytest.mark.parametrize(
    "where",
    [
        "class Last:\n    def __del__(self): ask()\nLast()\n",
        "import weakref\nclass Last: pass\nlast = Last()\n"
        "kept = weakref.ref(last, lambda _: ask())\ndel last\n",
    ],
    ids=["finaliser", "weak reference"],
)
@pytest.mark.parametrize("is_loaded", [False, True], ids=["idle", "loaded"])
def test_a_signal_where_exceptions_are_lost(where, is_loaded):
    # Imports hold such callbacks, so that any command may be stopped within one. Where the signal
    # is lost, the command runs to its end. On a loaded machine, the main thread goes on only long
    # after it has started another one: the signal must not be sent again meanwhile.
    load = (
        "import threading\n"
        "begin = threading.Thread.start\n"
        "def start(thread):\n"
        "    begin(thread)\n"
        "    end = time.monotonic() + 0.1\n"
        "    while time.monotonic() < end: time.sleep(0.001)\n"
        "threading.Thread.start = start\n"
    )
    body = "".join(f"    {line}\n" for line in where.splitlines())
    script = (
        "import signal, sys, os, time\n"
        "from asterism.cli.exit_codes import exit_code\n"
        f"{load if is_loaded else ''}"
        "def ask(): os.kill(os.getpid(), signal.SIGTERM)\n"
        f"def run():\n{body}    for _ in range(1000): time.sleep(0.005)\n"
        "sys.exit(exit_code(run))\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], timeout=30, capture_output=True, text=True
    )
    assert (done.returncode, done.stderr) == (143, "asterism: stopped by SIGTERM\n")


@pytest.mark.parametrize("nth", [1, 2])
def test_a_signal_while_handlers_are_set(nth):
    # In the very call that sets the first, or the last, of the handlers; raised, not sent: what is
    # sent to a process may reach it by another thread, later. Neither is ignored, whatever started
    # this process.
    script = (
        "import signal, sys\n"
        "from asterism.cli.exit_codes import exit_code\n"
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        "set_handler, n = signal.signal, 0\n"
        "def at_once(number, handler):\n"
        "    global n\n"
        "    n += 1\n"
        "    before = set_handler(number, handler)\n"
        f"    if n == {nth}: signal.raise_signal(number)\n"
        "    return before\n"
        "signal.signal = at_once\n"
        "sys.exit(exit_code(lambda: None))\n"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert (done.returncode, done.stderr) in (
        (130, "asterism: stopped by SIGINT\n"), (143, "asterism: stopped by SIGTERM\n"),
    )  # fmt: skip


def test_an_ignored_signal_stays_ignored(tmp_path):
    script = (
        "import signal, sys, os\n"
        "signal.signal(signal.SIGINT, signal.SIG_IGN)\n"
        "from asterism.cli.exit_codes import exit_code\n"
        "sys.exit(exit_code(lambda: os.kill(os.getpid(), signal.SIGINT)))\n"
    )
    assert subprocess.run([sys.executable, "-c", script], timeout=30).returncode == 0


def test_exit_codes(tmp_path, monkeypatch, capsys):
    done = run("simulate", "cube", "-o", "a.csv", cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    done = run("typo", cwd=tmp_path)
    assert (done.returncode, done.stdout) == (2, "")
    # The process ends with what `main` returns, so that the others need none.
    monkeypatch.chdir(tmp_path)
    for line in ("track nowhere.c3d", "track a.csv --method gn", "track a.csv --typo", "typo"):
        assert main(line.split()) == 2
        out, err = capsys.readouterr()
        assert out == ""
        assert "Traceback" not in err
    assert main([]) == 2


@pytest.mark.parametrize(
    ("what", "code", "says"),
    [
        ("raise MemoryError", 1, "asterism: not enough memory"),
        ("raise OSError(28, 'No space left on device', 'x')", 2, "x: No space left on device"),
        ("raise ZeroDivisionError('inside')", 1, "ZeroDivisionError: inside"),
    ],
)
def test_failures_inside(what, code, says):
    script = f"""
        import sys
        import asterism.cli.exit_codes as exit_codes
        def command():
            {what}
        sys.exit(exit_codes.exit_code(command))
    """
    import textwrap

    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(script)], capture_output=True, text=True, timeout=30
    )
    assert done.returncode == code
    assert says in done.stderr


@pytest.mark.parametrize("line", ["scenes", "scenes --json", "track --help"])  # each way to print
def test_the_output_is_closed_by_its_reader(line):
    read, write = os.pipe()
    os.close(read)
    done = subprocess.run(
        [*ASTERISM, *line.split()], stdout=write, stderr=subprocess.PIPE, text=True, timeout=30
    )
    os.close(write)
    assert done.stderr == ""
    assert done.returncode in (141, 1)


def test_a_terminal_that_knows_no_greek(tmp_path):
    am.write(am.simulate.cube(seed=1), tmp_path / "a.csv")
    done = run("estimate", "a.csv", cwd=tmp_path, env=os.environ | {"PYTHONIOENCODING": "ascii"})
    assert done.returncode == 0, done.stderr
    assert "noise \\u03c3" in done.stdout


def test_same_bytes_in_every_process(tmp_path):
    truth = am.simulate.crossing(rate=100, seed=1)
    am.write(am.simulate.corrupt(truth, missing=0.1, clutter=0.2, seed=1), tmp_path / "a.c3d")
    results = []
    for seed in ("1", "2"):  # of the hashes of texts, by which sets are ordered
        env = os.environ | {"PYTHONHASHSEED": seed}
        done = run("track", "a.c3d", "-o", f"b{seed}.c3d", cwd=tmp_path, env=env)
        assert done.returncode == 0, done.stderr
        assert done.stderr == ""  # no terminal, no progress
        results.append((tmp_path / f"b{seed}.c3d").read_bytes())
    assert results[0] == results[1]


@pytest.mark.parametrize(
    ("script", "heavy"),
    [
        ("from asterism.cli import main\nmain(['--help'])\n", ("scipy", "asterism._engine")),
        ("import asterism\nfor name in asterism.__all__:\n  getattr(asterism, name)\n", ("scipy",)),
    ],
    ids=["help", "every public name"],
)  # fmt: skip
def test_nothing_heavy_is_imported(script, heavy):
    script += (
        f"import sys\nheavy = {(*heavy, 'ezc3d', 'matplotlib', 'pandas')}\n"
        "sys.exit(','.join(name for name in heavy if name in sys.modules) or 0)"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
