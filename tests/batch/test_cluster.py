"""Tasks on a Dask cluster: workers and schedulers that die."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import threading
import time

import pytest

import asterism as am
from asterism.batch.cluster import on_cluster
from asterism.errors import ParameterError
from tests.batch.conftest import contents

pytest.importorskip("distributed", reason="needs the extra cluster")


def squared(x, *, progress):
    """Task that takes a moment, and says so."""
    if progress is not None:
        progress("working", x)
    time.sleep(0.05)
    return x * x


def failing(x, *, progress):
    """Task that fails for one argument."""
    del progress
    if x == 2:
        raise RuntimeError("two")
    return x


def deadly(x, *, progress):
    """Task that ends its worker."""
    del progress
    if x == 2:
        os.kill(os.getpid(), signal.SIGKILL)
    return x


def free_port():
    with socket.socket() as found:
        found.bind(("127.0.0.1", 0))
        return found.getsockname()[1]


class Processes:
    """A scheduler and workers, each a process of its own, on a port that stays."""

    def __init__(self):
        self.port = free_port()
        self.address = f"tcp://127.0.0.1:{self.port}"
        self.scheduler = None
        self.workers = []

    def start(self):
        command = [sys.executable, "-m", "distributed.cli.dask_scheduler", "--no-dashboard"]
        self.scheduler = self._process(
            [*command, "--host", "127.0.0.1", "--port", str(self.port), "--no-show"]
        )
        self.workers = [
            self._process(
                [sys.executable, "-m", "distributed.cli.dask_worker", self.address, "--nthreads",
                 "1", "--host", "127.0.0.1", "--no-dashboard", "--nworkers", "1"]
            )
            for _ in range(2)
        ]  # fmt: skip

    def _process(self, line):
        quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        environment = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
        return subprocess.Popen(line, **quiet, env=environment, start_new_session=True)

    def stop(self):
        for process in [self.scheduler, *self.workers]:
            if process is not None and process.poll() is None:
                os.killpg(process.pid, signal.SIGKILL)
                process.wait()


@pytest.fixture
def processes():
    made = Processes()
    made.start()
    yield made
    made.stop()


@pytest.mark.filterwarnings("ignore")
def test_tasks_on_this_machine():
    heard = []
    tasks = {f"{x}": (x,) for x in range(6)}
    found = dict(
        on_cluster(squared, tasks, scheduler=None, workers=2, progress=lambda *m: heard.append(m))
    )
    assert found == {f"{x}": x * x for x in range(6)}
    assert ("3", "working", 3) in heard
    found = dict(on_cluster(failing, tasks, scheduler=None, workers=2))
    assert isinstance(found.pop("2"), RuntimeError)
    assert found == {f"{x}": x for x in range(6) if x != 2}


@pytest.mark.filterwarnings("ignore")
def test_a_task_that_kills_its_workers_fails_alone():
    found = dict(on_cluster(deadly, {f"{x}": (x,) for x in range(6)}, scheduler=None, workers=2))
    assert type(found.pop("2")).__name__ == "KilledWorker"
    assert found == {f"{x}": x for x in range(6) if x != 2}


@pytest.mark.filterwarnings("ignore")
def test_a_batch_outlives_its_workers_and_its_scheduler(made_captures, serial, processes, tmp_path):
    out, events = tmp_path / "out", []

    def harm():
        while not events:
            time.sleep(0.02)
        os.killpg(processes.workers[0].pid, signal.SIGKILL)
        while not any(stage == "done" for _, stage in events):
            time.sleep(0.02)
        processes.stop()
        time.sleep(0.5)
        processes.start()

    thread = threading.Thread(target=harm)
    thread.start()
    batch = am.batch.run(
        [made_captures], out, scheduler=processes.address,
        progress=lambda name, stage, *_: events.append((name, stage)) if name and stage != "failed"
        else None,
    )  # fmt: skip
    thread.join()
    assert set(batch.failed) == {"second/damaged.c3d"}
    assert contents(out) == serial


@pytest.mark.filterwarnings("ignore")
def test_captures_can_be_sent(made_captures, serial, tmp_path):
    batch = am.batch.run([made_captures], tmp_path / "out", workers=2, send=True)
    assert str(made_captures / "second" / "damaged.c3d") in batch.failed["second/damaged.c3d"]
    assert contents(tmp_path / "out") == serial


@pytest.mark.filterwarnings("ignore")
def test_a_scheduler_that_does_not_answer_is_refused():
    with pytest.raises(ParameterError, match="the address of a Dask scheduler that answers"):
        list(
            on_cluster(squared, {"a": (1,)}, scheduler=f"tcp://127.0.0.1:{free_port()}", workers=1)
        )


def test_places_can_be_urls(made_captures, serial, tmp_path):
    out = tmp_path / "out"
    batch = am.batch.run([f"file://{made_captures}/first"], f"file://{out}", workers=1)
    assert not batch.failed
    found = {f"first/{name}": content for name, content in contents(out).items()}
    for name in ("first/walk.tracked.c3d", "first/turn.tracked.csv"):
        assert found[name] == serial[name]
