"""Tracking of a stream, from a source to sinks."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING, Any, Literal

from asterism.checks import check_kind
from asterism.errors import ParameterError
from asterism.live.loop import LiveLoop
from asterism.live.sinks.parse import parse_sink
from asterism.live.sources.parse import parse_source
from asterism.model import MarkerSet, TrackingModel
from asterism.tracking import Stitched, method_by_name
from asterism.tracking.methods import MCMCDA, Method

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from asterism.live.live_run import LiveRun
    from asterism.live.sinks.base import Sink
    from asterism.live.sources.base import Source

__all__ = ["run"]


def run(
    source: Source | str,
    sinks: Sequence[Sink | str] = (),
    *,
    method: Method[Any] | str | None = None,
    model: TrackingModel | None = None,
    marker_set: MarkerSet | Sequence[MarkerSet] | Literal["learn"] = (),
    seed: int | None = None,
    stop: threading.Event | None = None,
    status: Callable[[LiveRun], Any] | None = None,
) -> LiveRun:
    """Track a stream frame by frame, and pass every frame on with its identities.

    This call receives, tracks and sends; it returns when the source ends or `stop` is set. Without
    a model, one is estimated from the first two seconds, whose frames have no identities yet. It is
    refined after 10, 30 and 60 s and then every minute, in a process of its own; tracks keep their
    identities. A frame that arrives out of order, twice or too late is dropped and counted. A lost
    connection is tried again after 0.25 s, with doubled waits up to 8 s.

    Parameters
    ----------
    source : Source or str
        Source, such as ``"qtm://192.168.0.10"``, ``"natnet://192.168.0.10"``, ``"lsl://markers"``,
        ``"udp://:5000"``, ``"-"`` or a capture to replay, ``"trial.c3d?speed=2"``.
    sinks : sequence of Sink or str
        Sinks, such as ``"qtm://:22223"``, ``"udp://127.0.0.1:5001"``, ``"out.c3d"`` or
        ``"page://:8000"``.
    method : Method or str, optional
        Method as it is, or the name of one that is stitched, because only then identities outlast
        occlusions; ``Stitched()`` by default. ``"gnn"`` takes half of its time.
    model : TrackingModel, optional
        Tracking model. It is not refined.
    marker_set : MarkerSet, sequence of MarkerSet, or "learn"
        Marker set of the subject, or of each subject, by which tracks are named. "learn" learns one
        from the first five seconds of tracks, with the names M1, M2, …, by which a marker that
        comes back as a new track is found again.
    seed : int, optional
        Seed of the methods that draw random numbers.
    stop : threading.Event, optional
        Ends the call after the present frame, from another thread or a handler of a signal.
    status : callable, optional
        Called twice a second with the counts so far.

    Returns
    -------
    LiveRun
        Counts, latencies and the last model.

    Raises
    ------
    ParameterError
        If an argument is wrong.
    SourceError, SinkError
        If the source or a sink is not available at the start.

    Examples
    --------
    >>> import threading
    >>> import asterism as am
    >>> stop = threading.Event()  # stop.set() in another thread ends the call
    >>> am.live.run("qtm://192.168.0.10", ["page://:8000"], stop=stop)  # doctest: +SKIP
    """
    chosen: Method[Any]
    if method is None:
        chosen = Stitched()
    elif isinstance(method, str):
        chosen = Stitched(method=method_by_name(method))
    else:
        chosen = method
    check_kind("method", chosen, Method, 'am.GNN(), or "gnn"')
    if isinstance(chosen, MCMCDA) and chosen.window is None:
        raise ParameterError("method", "a method for streams", "mcmcda with window=None")
    if model is not None:
        check_kind("model", model, TrackingModel, "am.estimate_model(detections).model")
    sets = (marker_set,) if isinstance(marker_set, MarkerSet) else marker_set
    if not isinstance(sets, str):
        for made in sets:
            check_kind("marker_set", made, MarkerSet, "am.read_marker_set(path)")
    elif sets != "learn":
        raise ParameterError("marker_set", 'a marker set, or "learn"', repr(sets))
    loop = LiveLoop(
        parse_source(source) if isinstance(source, str) else source,
        [parse_sink(sink) if isinstance(sink, str) else sink for sink in sinks],
        method=chosen, model=model, marker_sets=sets, seed=seed,
    )  # fmt: skip
    return loop.run(threading.Event() if stop is None else stop, status)
