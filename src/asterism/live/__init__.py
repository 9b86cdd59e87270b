"""Streams: identities for points that arrive frame by frame, and servers of captures."""

from asterism.live.frame import LiveFrame, SourceFrame, StreamHeader
from asterism.live.latency import LatencyHistogram
from asterism.live.live_run import LiveRun
from asterism.live.run_live import run
from asterism.live.serve_tracks import serve
from asterism.live.servers.natnet import NatNetServer
from asterism.live.servers.qtm import QtmServer
from asterism.live.servers.served_frame import ServedFrame
from asterism.live.sinks.base import Sink
from asterism.live.sinks.recording import recover
from asterism.live.sources.base import EndOfSource, Source

__all__ = [
    "EndOfSource",
    "LatencyHistogram",
    "LiveFrame",
    "LiveRun",
    "NatNetServer",
    "QtmServer",
    "ServedFrame",
    "Sink",
    "Source",
    "SourceFrame",
    "StreamHeader",
    "recover",
    "run",
    "serve",
]
