"""`map` on a Dask cluster, for many small calls in turn."""

from __future__ import annotations

import logging
from contextlib import ExitStack, contextmanager
from typing import TYPE_CHECKING, Any

from asterism.batch.tasks import PATIENCE, connected, lost_errors
from asterism.checks import check_extra

if TYPE_CHECKING:
    from collections.abc import Callable, Generator, Iterable

__all__ = ["cluster_map"]

log = logging.getLogger(__name__)


@contextmanager
def cluster_map(
    scheduler: str, *, patience: float = PATIENCE
) -> Generator[Callable[..., list[Any]], None, None]:
    """Connect to a Dask scheduler, and give a function that works like `map` and calls there.

    A call whose worker is lost is repeated by the scheduler. If the scheduler is lost, it is
    awaited, and all calls of the list are repeated. The functions must therefore have no effect but
    their results.

    Parameters
    ----------
    scheduler : str
        Address of the scheduler.
    patience : float
        Seconds for which a lost scheduler is awaited.

    Yields
    ------
    callable
        Called as ``mapper(function, items)``; returns the results in the order of the items.

    Raises
    ------
    ParameterError
        If the scheduler cannot be reached, or the extra ``cluster`` is missing.

    Examples
    --------
    >>> import asterism as am
    >>> with am.batch.cluster_map("tcp://127.0.0.1:8786") as mapper:       # doctest: +SKIP
    ...     am.large.track("swarm.parquet", "tracked.parquet", mapper=mapper)
    """
    check_extra("scheduler", "cluster", "distributed")
    lost = lost_errors()
    with ExitStack() as opened:
        client: Any = opened.enter_context(connected(scheduler, 1, 0.0))

        def mapper(function: Callable[[Any], Any], items: Iterable[Any]) -> list[Any]:
            nonlocal client
            items = list(items)
            while True:
                try:
                    return client.gather(client.map(function, items, pure=False))
                except lost:
                    log.warning("the scheduler was lost; %d calls are sent again", len(items))
                    opened.close()
                    client = opened.enter_context(connected(scheduler, 1, patience))

        yield mapper
