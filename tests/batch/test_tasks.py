"""Tasks here and on a Dask cluster: workers and schedulers that die."""

from __future__ import annotations

import contextlib
import os
import secrets
import signal
import socket
import subprocess
import sys
import time

import pytest

import asterism as am
from asterism.batch.tasks import connected, run_tasks
from asterism.errors import FormatError, ParameterError
from tests.batch.conftest import contents
from tests.large.scenes import dense, labels_of

pytest.importorskip("distributed", reason="needs the extra cluster")
dask = pytest.importorskip("dask", reason="needs the extra cluster")


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
    """A port below those that the system gives away, so that no other program takes it."""
    for port in secrets.SystemRandom().sample(range(20_000, 30_000), 100):
        with socket.socket() as found, contextlib.suppress(OSError):
            found.bind(("127.0.0.1", port))
            return port
    raise AssertionError("no free port")


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
    # A batch waits only some seconds for a scheduler that it has not reached before.
    with connected(made.address, 1, 120.0):
        pass
    yield made
    made.stop()


def found(function, xs, **given):
    """Results by key of a function of each number."""
    keys = [f"{x}" for x in xs]
    return dict(run_tasks(function, keys, lambda key: (int(key),), **given))


@pytest.mark.parametrize("workers", [1, 2])
@pytest.mark.filterwarnings("ignore")
def test_tasks_on_this_machine(workers):
    heard = []
    here = {"scheduler": None, "workers": workers}
    results = found(squared, range(12), progress=lambda *m: heard.append(m), **here)
    assert results == {f"{x}": x * x for x in range(12)}
    assert ("3", "working", 3) in heard


@pytest.mark.parametrize("workers", [1, 2])
@pytest.mark.filterwarnings("ignore")
def test_a_task_that_fails_stops_no_other(workers):
    def arguments(key):
        if key == "3":
            raise FormatError("walk.c3d", "", "", "no such file")
        return (int(key),)

    keys = [f"{x}" for x in range(6)]
    results = dict(run_tasks(failing, keys, arguments, scheduler=None, workers=workers))
    assert isinstance(results.pop("2"), RuntimeError)
    assert isinstance(results.pop("3"), FormatError)
    assert results == {f"{x}": x for x in (0, 1, 4, 5)}


@pytest.mark.filterwarnings("ignore")
def test_arguments_are_made_when_they_are_sent():
    """The captures of a long batch would not fit into memory together."""
    made, come, most = 0, 0, 0

    def arguments(key):
        nonlocal made, most
        made += 1
        most = max(most, made - come)
        return (int(key),)

    keys = [f"{x}" for x in range(40)]
    for _ in run_tasks(squared, keys, arguments, scheduler=None, workers=2):
        come += 1
    assert (made, come) == (40, 40)
    assert 2 <= most <= 7


@pytest.mark.filterwarnings("ignore")
def test_a_task_that_kills_its_workers_fails_alone():
    # Dask tries it on four workers otherwise, and each one that dies is started again.
    with dask.config.set({"distributed.scheduler.allowed-failures": 0}):
        results = found(deadly, range(6), scheduler=None, workers=2, patience=20.0)
    assert type(results.pop("2")).__name__ == "KilledWorker"
    assert results == {f"{x}": x for x in range(6) if x != 2}


def test_a_task_that_waited_at_a_killed_worker_is_tried_alone(monkeypatch):
    """Which tasks wait there depends on the moment, so the rounds of the cluster are given."""

    class KilledWorker(Exception):
        pass

    rounds = []

    @contextlib.contextmanager
    def connected(scheduler, workers, patience):
        del scheduler, workers, patience
        yield None

    def results(client, keys, send, patience):
        del client, send, patience
        rounds.append(list(keys))
        for key in rounds[-1]:
            dies = key == "2" or (key == "3" and len(rounds[-1]) > 1)
            yield key, KilledWorker() if dies else int(key)

    monkeypatch.setattr("asterism.batch.tasks.connected", connected)
    monkeypatch.setattr("asterism.batch.tasks._results", results)
    got = found(squared, range(5), scheduler=None, workers=2)
    assert rounds == [["0", "1", "2", "3", "4"], ["2"], ["3"]]
    assert isinstance(got.pop("2"), KilledWorker)
    assert got == {"0": 0, "1": 1, "3": 3, "4": 4}


@pytest.mark.filterwarnings("ignore")
def test_a_batch_outlives_its_workers_and_its_scheduler(made_captures, serial, processes, tmp_path):
    out, events, harmed = tmp_path / "out", [], []

    def heard(name, stage, *_):
        # The batch waits meanwhile, so that two captures have no result when the scheduler is lost.
        if not name or stage == "failed":
            return
        events.append((name, stage))
        if not harmed:
            os.killpg(processes.workers[0].pid, signal.SIGKILL)
            harmed.append("worker")
        elif stage == "done" and "scheduler" not in harmed:
            processes.stop()
            harmed.append("scheduler")
            time.sleep(0.5)
            processes.start()

    batch = am.batch.run(
        [made_captures], out, scheduler=processes.address, send=True, progress=heard
    )
    n_done = len([stage for _, stage in events if stage == "done"])
    assert harmed == ["worker", "scheduler"]
    assert n_done == 3
    assert str(made_captures / "second" / "damaged.c3d") in batch.failed["second/damaged.c3d"]
    assert contents(out) == serial


@pytest.mark.filterwarnings("ignore")
def test_workers_that_share_the_files_write_them(made_captures, serial, tmp_path):
    batch = am.batch.run([made_captures], tmp_path / "out", workers=2)
    assert set(batch.failed) == {"second/damaged.c3d"}
    assert contents(tmp_path / "out") == serial


@pytest.mark.filterwarnings("ignore")
def test_a_scheduler_that_does_not_answer_is_refused():
    with pytest.raises(ParameterError, match="the address of a Dask scheduler that answers"):
        found(squared, [1], scheduler=f"tcp://127.0.0.1:{free_port()}", workers=1)


def test_captures_are_sent_to_a_scheduler_only(made_captures, tmp_path):
    with pytest.raises(ParameterError, match="send: expected a scheduler"):
        am.batch.run([made_captures], tmp_path / "out", send=True)


def test_places_can_be_urls(made_captures, serial, tmp_path):
    out = tmp_path / "out"
    batch = am.batch.run([f"file://{made_captures}/first"], f"file://{out}", workers=1)
    assert not batch.failed
    names = {f"first/{name}": content for name, content in contents(out).items()}
    for name in ("first/walk.tracked.c3d", "first/turn.tracked.csv"):
        assert names[name] == serial[name]
    again = am.batch.run([f"file://{made_captures}/first"], f"file://{out}", workers=1)
    assert (again.n_tracked, again.n_done_before) == (0, 2)
    with pytest.raises(ParameterError, match="nowhere"):
        am.batch.run([f"file://{made_captures}/nowhere"], f"file://{out}", workers=1)


def test_the_index_of_another_is_not_replaced_at_a_url(made_captures, tmp_path):
    (tmp_path / "index.html").write_text("precious")
    with pytest.raises(FormatError, match="another one"):
        am.batch.run([f"file://{made_captures}/first"], f"file://{tmp_path}", workers=1)
    assert (tmp_path / "index.html").read_text() == "precious"


@pytest.mark.filterwarnings("ignore")
def test_tiles_on_a_cluster_outlive_its_scheduler(processes):
    d = dense(n=160, frames=13).detections
    n_calls = 0
    with am.batch.cluster_map(processes.address) as on_cluster:

        def mapper(function, items):
            nonlocal n_calls
            n_calls += 1
            if n_calls == 4:
                processes.stop()
                processes.start()
            return on_cluster(function, items)

        there = labels_of(d, tile=0.37, mapper=mapper)
    assert n_calls > 4
    assert [own.tolist() for own in there] == [own.tolist() for own in labels_of(d)]
