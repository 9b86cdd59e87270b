"""Sink that publishes the markers of a marker set as a stream of the Lab Streaming Layer."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

import numpy as np

from asterism.errors import SinkError
from asterism.live.sinks.server import served
from asterism.live.sources.lsl import imported

if TYPE_CHECKING:
    from asterism.live.frame import LiveFrame, StreamHeader

__all__ = ["LslSink"]


class LslSink:
    """Sink with three channels a marker, in metres; NaN for a missing marker.

    The channels of a stream cannot change, so the markers must be known at the beginning. The time
    stamps are those of the Lab Streaming Layer's clock at the reception of each frame.

    Parameters
    ----------
    name : str
        The sink, as the user wrote it.
    stream : str
        Name of the stream.
    """

    def __init__(self, name: str, stream: str) -> None:
        self.name, self._stream = name, stream
        self.faults: dict[str, int] = {}
        self._outlet: Any = None
        self._place: dict[str, int] = {}
        self._offset = 0.0

    def open(self, header: StreamHeader) -> None:
        """Publish the stream.

        Raises
        ------
        SinkError
            If pylsl is missing, or no marker set is known.
        """
        pylsl = imported(SinkError)
        if not header.names:
            raise SinkError(f"{self.name}: expected a marker set, whose markers are the channels.")
        self._place = {name: i for i, name in enumerate(header.names)}
        info = pylsl.StreamInfo(
            self._stream, "MoCap", 3 * len(self._place), header.rate, pylsl.cf_float32,
            f"asterism-{self._stream}",
        )  # fmt: skip
        channels = info.desc().append_child("channels")
        for name in self._place:
            for axis in "XYZ":
                channel = channels.append_child("channel")
                channel.append_child_value("label", f"{name}_{axis}")
                channel.append_child_value("marker", name)
                channel.append_child_value("type", f"Position{axis}")
                channel.append_child_value("unit", "m")
        self._outlet = pylsl.StreamOutlet(info)
        self._offset = pylsl.local_clock() - time.perf_counter()

    def send(self, frame: LiveFrame) -> None:
        """Publish a frame."""
        if self._outlet is None:
            return
        markers = served(frame, self._place).markers
        sample = markers.astype(np.float32).ravel().tolist()
        self._outlet.push_sample(sample, self._offset + frame.received)

    def close(self) -> None:
        """End the stream."""
        self._outlet = None
