"""Streams: identities for points that arrive frame by frame, and servers of captures."""

from asterism.live.frame import LiveFrame, SourceFrame, StreamHeader
from asterism.live.latency import LatencyHistogram
from asterism.live.live_run import LiveRun
from asterism.live.run_live import run
from asterism.live.sinks.base import Sink
from asterism.live.sources.base import EndOfSource, Source

__all__ = [
    "EndOfSource",
    "LatencyHistogram",
    "LiveFrame",
    "LiveRun",
    "Sink",
    "Source",
    "SourceFrame",
    "StreamHeader",
    "run",
]
