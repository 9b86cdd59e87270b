"""Sinks that are servers: clients of Qualisys or OptiTrack connect to them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism.live.servers.served_frame import ServedFrame

if TYPE_CHECKING:
    from asterism.live.frame import LiveFrame, StreamHeader
    from asterism.live.servers.base import Server

__all__ = ["ServerSink", "served"]


class ServerSink:
    """Sink that serves labelled markers, and points without a name beside them.

    The markers of the marker set come first, in its order. A name that occurs later is added at
    the end, and clients are notified; no marker ever changes its place. A point without a name has
    the identity of its track plus 1, and 0 if it is clutter.

    Parameters
    ----------
    name : str
        The sink, as the user wrote it.
    server : Server
        The server, which does not listen yet.
    """

    def __init__(self, name: str, server: Server) -> None:
        self.name, self.server = name, server
        self.faults = server.faults
        self._place: dict[str, int] = {}

    def open(self, header: StreamHeader) -> None:
        """Listen, with names and rate of the stream."""
        self._place = {name: i for i, name in enumerate(header.names)}
        self.server.names, self.server.rate = header.names, header.rate
        self.server.start()

    def send(self, frame: LiveFrame) -> None:
        """Send a frame to all clients."""
        new = [n for n in frame.names or () if n is not None and n not in self._place]
        if new:
            for name in new:
                self._place.setdefault(name, len(self._place))
            self.server.rename(tuple(self._place))
        self.server.send(served(frame, self._place))

    def close(self) -> None:
        """Disconnect all clients."""
        self.server.finish()
        self.server.close()


def served(frame: LiveFrame, place: dict[str, int]) -> ServedFrame:
    """Sort the points of a frame into markers and other points.

    Parameters
    ----------
    frame : LiveFrame
        The frame.
    place : dict of str to int
        Place of each name among the markers; a point of another name is one of the other points.
    """
    markers = np.empty((len(place), 3))
    markers.fill(np.nan)
    points, labels = frame.points, frame.labels
    if frame.names is not None:
        at = np.array([-1 if n is None else place.get(n, -1) for n in frame.names], dtype=np.int64)
        is_named = at >= 0
        markers[at[is_named]] = points[is_named]
        points, labels = points[~is_named], labels[~is_named]
    return ServedFrame(
        number=frame.number, time=frame.time, markers=markers, points=points, ids=labels + 1,
        images=None,
    )  # fmt: skip
