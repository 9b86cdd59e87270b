"""Tasks in this process or on a Dask cluster, repeated if a worker or the scheduler is lost."""

from __future__ import annotations

import logging
import os
import secrets
import time
from contextlib import contextmanager, suppress
from functools import partial
from importlib.util import find_spec
from itertools import islice
from typing import TYPE_CHECKING, Any, cast

from asterism.checks import check_extra, check_number
from asterism.errors import AsterismError, ParameterError

if TYPE_CHECKING:
    from collections.abc import Callable, Generator, Iterator, Sequence

    from distributed import Client, Future

__all__ = ["connected", "lost_errors", "number_of_workers", "run_tasks"]

PATIENCE = 600.0
"""Seconds for which a lost scheduler is awaited."""
_AHEAD = 3  # tasks for each thread of the workers that are sent at a time
_STEP = 1.0  # seconds between two attempts to reach it

log = logging.getLogger(__name__)


def number_of_workers(workers: int | None, scheduler: str | None) -> int:
    """Return the checked number of workers; by default the cores, if the extra is installed."""
    if workers is None:
        has_cluster = find_spec("distributed") is not None
        workers = (os.cpu_count() or 1) if has_cluster and scheduler is None else 1
    check_number("workers", workers, above=0, integer=True)
    return workers


def run_tasks(
    function: Callable[..., Any],
    keys: Sequence[str],
    arguments: Callable[[str], tuple[Any, ...]],
    *,
    scheduler: str | None,
    workers: int,
    progress: Callable[..., Any] | None = None,
    patience: float = PATIENCE,
) -> Iterator[tuple[str, Any]]:
    """Call a function once for each task, and yield the results as they come.

    One worker and no scheduler is this process. A few tasks for each worker are sent ahead, so that
    the memory does not grow with their number.

    Parameters
    ----------
    function : callable
        Function whose result depends on its arguments only; it may be called again after a loss.
        Its argument `progress` is None, or a function that sends a message here.
    keys : sequence of str
        Different names of the tasks.
    arguments : callable
        Function from a key to the arguments, called when the task is sent.
    scheduler : str or None
        Address of the scheduler; None starts a cluster on this machine.
    workers : int
        Number of processes of a cluster on this machine.
    progress : callable, optional
        Called with the key of a task and the items of its message, perhaps from another thread.
    patience : float
        Seconds for which a lost scheduler is awaited, and the result of a finished task.

    Yields
    ------
    key : str
    result : object
        Result, or the exception of the call.

    Raises
    ------
    ParameterError
        If the scheduler cannot be reached, or the extra ``cluster`` is missing.
    """
    if scheduler is None and workers == 1:
        for key in keys:
            yield key, _result(function, arguments, key, progress)
        return
    check_extra("workers" if scheduler is None else "scheduler", "cluster", "distributed")
    left, waited = dict.fromkeys(keys), 0.0
    batch = f"asterism-{secrets.token_hex(8)}"  # other clients may use the same scheduler
    suspects: set[str] = set()
    while left:
        with connected(scheduler, workers, waited) as client:
            if progress is not None:
                client.subscribe_topic(batch, partial(_forward, progress))
            topic = None if progress is None else batch
            send = partial(_send, client, batch, function, topic, arguments)
            several = [key for key in left if key not in suspects]
            # A task that kills its workers takes along those that wait there. Each of them is tried
            # again, alone.
            for keys in [several] if several else [[key] for key in left]:
                for key, result in _results(client, iter(keys), send, patience):
                    if several and type(result).__name__ == "KilledWorker":
                        suspects.add(key)
                        continue
                    del left[key]
                    yield key, result
        waited = patience
        if not suspects >= left.keys():
            log.warning("the scheduler or a result was lost; %d tasks are sent again", len(left))


def _result(
    function: Callable[..., Any],
    arguments: Callable[[str], tuple[Any, ...]],
    key: str,
    progress: Callable[..., Any] | None,
) -> Any:
    try:
        return function(
            *arguments(key), progress=None if progress is None else partial(progress, key)
        )
    except Exception as error:  # the others go on, as on a cluster
        return error


def lost_errors() -> tuple[type[BaseException], ...]:
    """Return the errors that say that the scheduler is lost."""
    from concurrent.futures import CancelledError

    from distributed.comm.core import CommClosedError

    return CancelledError, CommClosedError, OSError, TimeoutError


def _results(
    client: Client, keys: Iterator[str], send: Callable[[str], Future[Any]], patience: float
) -> Iterator[tuple[str, Any]]:
    """Iterate over the results until all have come, or the scheduler is lost."""
    from distributed import as_completed

    lost = lost_errors()
    pending: dict[Any, str] = {}
    is_idle = False
    try:
        completed = as_completed(loop=client.loop)
        while True:
            of_workers: dict[str, int] = cast("Any", client).nthreads()
            threads = sum(of_workers.values())
            if not threads and not is_idle:
                log.warning("the scheduler has no worker yet")
                is_idle = True
            drawn = list(islice(keys, max(0, _AHEAD * max(threads, 1) - len(pending))))
            for key in drawn:
                try:
                    future = send(key)
                except AsterismError as error:
                    yield key, error
                    continue
                pending[future] = key
                completed.add(future)
            if not pending:
                if not drawn:
                    return
                continue
            future = next(completed)
            if future.status == "cancelled":
                return
            error = future.exception() if future.status == "error" else None
            if isinstance(error, lost):
                return
            # A worker that dies now takes its results along. They are computed again, unless no
            # worker is left; then the wait ends and the tasks are sent again.
            result = future.result(timeout=patience) if error is None else error
            yield pending.pop(future), result
            future.release()
    except lost:
        return


def _send(
    client: Client,
    batch: str,
    function: Callable[..., Any],
    topic: str | None,
    arguments: Callable[[str], tuple[Any, ...]],
    key: str,
) -> Future[Any]:
    """Send a task to the scheduler."""
    given = arguments(key)
    return client.submit(_called, function, topic, key, given, key=f"{batch}-{key}", pure=False)


def _forward(progress: Callable[..., Any], event: tuple[float, list[Any]]) -> None:
    progress(*event[1])


def _called(
    function: Callable[..., Any], topic: str | None, key: str, given: tuple[Any, ...]
) -> Any:
    """Call the function of a task on a worker."""
    from distributed import get_worker

    if topic is None:
        return function(*given, progress=None)

    def progress(*message: object) -> None:
        get_worker().log_event(topic, [key, *message])

    return function(*given, progress=progress)


@contextmanager
def connected(
    scheduler: str | None, workers: int, patience: float
) -> Generator[Client, None, None]:
    """Connect to a scheduler, or start a cluster on this machine, while the block runs."""
    from distributed import Client, LocalCluster

    quiet = logging.getLogger("distributed")
    level = quiet.level
    quiet.setLevel(logging.CRITICAL)  # losses are reported here, in one line
    cluster = None
    if scheduler is None:
        # Its web server takes any free port, as that of another run may have the usual one.
        local: dict[str, Any] = {"dashboard_address": "127.0.0.1:0", "host": "127.0.0.1"}
        cluster = LocalCluster(
            n_workers=workers, threads_per_worker=1, memory_limit=None,
            silence_logs=logging.CRITICAL, **local,
        )  # fmt: skip
    address = scheduler if cluster is None else cluster.scheduler_address
    client = None
    try:
        client = _client(Client, address, patience)
        yield client
    finally:
        with suppress(Exception):  # whatever is lost already needs no closing
            if client is not None:
                client.close(timeout=2)
        if cluster is not None:
            cluster.close(timeout=10)
        quiet.setLevel(level)


def _client(kind: type[Client], address: Any, patience: float) -> Client:
    """Connect to an address, again and again until the patience ends."""
    end = time.monotonic() + patience
    while True:
        try:
            return kind(address, timeout=5, set_as_default=False)
        except (OSError, TimeoutError, ValueError) as error:
            if time.monotonic() > end:
                raise ParameterError(
                    "scheduler", "the address of a Dask scheduler that answers",
                    f"{address}: {error}",
                ) from error  # fmt: skip
            time.sleep(_STEP)
