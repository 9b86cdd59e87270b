"""Tasks on a Dask cluster: a worker or a scheduler that is lost costs time, and no result."""

from __future__ import annotations

import logging
import secrets
import time
from contextlib import contextmanager, suppress
from functools import partial
from typing import TYPE_CHECKING, Any

from asterism.checks import check_number
from asterism.errors import ParameterError

if TYPE_CHECKING:
    from collections.abc import Callable, Generator, Iterator, Mapping

    from distributed import Client

__all__ = ["check_installed", "has_cluster", "on_cluster"]

PATIENCE = 600.0
"""Seconds for which a lost scheduler is awaited."""
_STEP = 1.0  # seconds between two attempts to reach it

log = logging.getLogger(__name__)


def has_cluster() -> bool:
    """Return whether the packages of the extra ``cluster`` are installed."""
    try:
        import distributed
    except ImportError:
        return False
    del distributed
    return True


def check_installed(name: str) -> None:
    """Raise if the extra ``cluster`` is missing; the error has the `name` of what needs it.

    Raises
    ------
    ParameterError
        If it is missing.
    """
    if not has_cluster():
        hint = "run pip install 'asterism[cluster]'"
        raise ParameterError(name, "dask.distributed, which is optional", "not installed", hint)


def on_cluster(
    function: Callable[..., Any],
    tasks: Mapping[str, tuple[Any, ...]],
    *,
    scheduler: str | None,
    workers: int,
    progress: Callable[..., Any] | None = None,
    patience: float = PATIENCE,
) -> Iterator[tuple[str, Any]]:
    """Call a function once for each task, and yield the results as they come.

    Parameters
    ----------
    function : callable
        Function whose result depends on its arguments only; it may be called again after a loss.
        Its argument `progress` is None, or a function that sends a message here.
    tasks : mapping of tuple
        Arguments by key.
    scheduler : str or None
        Address of the scheduler; None starts a cluster on this machine.
    workers : int
        Number of processes of a cluster on this machine.
    progress : callable, optional
        Called with the key of a task and the items of its message, from another thread.
    patience : float
        Seconds for which a lost scheduler is awaited.

    Yields
    ------
    key : str
    result : object
        Result, or the exception of the call.

    Raises
    ------
    ParameterError
        If the scheduler cannot be reached.
    """
    check_installed("scheduler")
    check_number("workers", workers, above=0, integer=True)
    left, waited = dict(tasks), 0.0
    batch = f"asterism-{secrets.token_hex(8)}"  # other clients may use the same scheduler
    topic = None if progress is None else batch
    while left:
        with _connected(scheduler, workers, waited) as client:
            if progress is not None:
                client.subscribe_topic(batch, partial(_forward, progress))
            calls = {f"{batch}-{key}": (function, topic, key, given) for key, given in left.items()}
            for key, result in _results(client, calls):
                del left[key]
                yield key, result
        if left:
            waited = patience
            log.warning("the scheduler was lost; %d tasks are sent again", len(left))


def _results(client: Client, calls: Mapping[str, tuple[Any, ...]]) -> Iterator[tuple[str, Any]]:
    """Iterate over the results until all have come, or the scheduler is lost."""
    from concurrent.futures import CancelledError

    from distributed import as_completed
    from distributed.comm.core import CommClosedError

    lost = (CancelledError, CommClosedError, OSError, TimeoutError)
    try:
        futures = {
            client.submit(_called, *call, key=name, pure=False): call[2]
            for name, call in calls.items()
        }
        for future in as_completed(list(futures), loop=client.loop):
            if future.status == "cancelled":
                return
            error = future.exception() if future.status == "error" else None
            if isinstance(error, lost):
                return
            yield futures[future], future.result() if error is None else error
            future.release()
    except lost:
        return


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
def _connected(
    scheduler: str | None, workers: int, patience: float
) -> Generator[Client, None, None]:
    """Connect to a scheduler, or start a cluster on this machine, while the block runs."""
    from distributed import Client, LocalCluster

    quiet = logging.getLogger("distributed")
    level = quiet.level
    quiet.setLevel(logging.CRITICAL)  # losses are reported here, in one line
    cluster = None
    if scheduler is None:
        local: dict[str, Any] = {"dashboard_address": None, "host": "127.0.0.1"}
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
