"""Serving a capture or a scene in real time, as the systems of Qualisys or OptiTrack would."""

from __future__ import annotations

import re
import time
from typing import TYPE_CHECKING

import numpy as np

from asterism.camera import Observations
from asterism.checks import check_kind
from asterism.errors import ParameterError
from asterism.live.servers.qtm import QtmServer
from asterism.live.servers.served_frame import ServedFrame
from asterism.model import Tracks

if TYPE_CHECKING:
    from collections.abc import Callable
    from threading import Event

    from numpy.typing import NDArray

    from asterism.live.servers.base import Server

__all__ = ["serve"]

_WAIT = 0.2  # seconds between looks at `stop`


def serve(
    tracks: Tracks,
    server: Server,
    *,
    labelled: bool = False,
    observations: Observations | None = None,
    loop: bool = False,
    begin: Callable[[], None] | None = None,
    stop: Event | None = None,
) -> int:
    """Serve tracks in real time to the clients of a server, and return the number of frames sent.

    The first frame is sent when a client asks for frames. Every frame is due at its time after the
    first, by a monotonic clock, so that delays do not add up.

    Parameters
    ----------
    tracks : Tracks
        Capture or scene, corrupted as wished (see `asterism.simulate.corrupt`); 3-D.
    server : QtmServer or NatNetServer
        Server that does not listen yet. Its names and its rate are set.
    labelled : bool
        Whether named tracks are sent as labelled markers; without any name, all tracks. By default
        every point is sent without a label and with an identity that is new in each frame, so that
        clients see nothing of the tracks.
    observations : Observations, optional
        Image points of the cameras of a `QtmServer` in each frame of the tracks, such as
        `asterism.simulate.film` makes. They are sent without their markers, from the top of the
        image to the bottom.
    loop : bool
        Whether the capture is repeated until `stop`; numbers and times of the frames go on.
    begin : callable, optional
        Called when the server listens.
    stop : threading.Event, optional
        Ends the serving when it is set.

    Returns
    -------
    int

    Raises
    ------
    ParameterError
        If the tracks are 2-D or empty, or the image points are of other frames or cameras.
    SinkError
        If a port is in use.

    Examples
    --------
    >>> import asterism as am, threading
    >>> truth = am.simulate.cube(frames=20, rate=30, seed=1)
    >>> server = am.live.QtmServer(port=0, discovery_port=0)
    >>> stop = threading.Event()
    >>> am.live.serve(truth, server, labelled=True, begin=stop.set, stop=stop)  # before a client
    0
    >>> server.names[:2], server.rate
    (('M00', 'M01'), 30.0)
    """
    check_kind("tracks", tracks, Tracks)
    d = tracks.detections
    if d.n_axes != 3 or not d.n_points:
        got = f"{d.n_axes}-D" if d.n_points else "no point"
        raise ParameterError("tracks", "3-D points", got)
    if observations is not None:
        check_kind("observations", observations, Observations)
        rig = server.rig if isinstance(server, QtmServer) else None
        if rig is None or observations.cameras != rig.names:
            expected = "image points of the cameras of the server, a QtmServer with a rig"
            raise ParameterError("observations", expected, ", ".join(observations.cameras))
        if observations.n_frames != d.n_frames:
            raise ParameterError("observations", f"{d.n_frames} frames", observations.n_frames)
    place = _places(tracks) if labelled else np.full(tracks.n_tracks + 1, -1)
    chosen = [k for k in range(tracks.n_tracks) if place[k] >= 0]
    server.names = tuple(re.sub(r"\s+", "_", tracks.display_names[k]) for k in chosen)
    server.rate = round(1 / d.step, 6) if d.step else 0.0
    server.start()
    try:
        if begin is not None:
            begin()
        while not server.wait_for_client(_WAIT):
            if stop is not None and stop.is_set():
                return 0
        return _send_all(tracks, place, observations, server, loop=loop, stop=stop)
    finally:
        server.finish()
        server.close()


def _places(tracks: Tracks) -> NDArray[np.int64]:
    """Return the place of each track among the markers, -1 for none; the last is of clutter."""
    is_marker = np.array([name is not None for name in tracks.names], dtype=bool)
    if not is_marker.any():
        is_marker[:] = True
    return np.append(np.where(is_marker, np.cumsum(is_marker) - 1, -1), -1)


def _send_all(
    tracks: Tracks,
    place: NDArray[np.int64],
    seen: Observations | None,
    server: Server,
    *,
    loop: bool,
    stop: Event | None,
) -> int:
    d = tracks.detections
    at = place[tracks.labels]
    n_markers = int(place.max()) + 1
    elapsed = d.times - d.times[0]
    period = float(elapsed[-1]) + (d.step or 1.0)
    begun = time.perf_counter()
    n_sent, n_points = 0, 0
    while True:
        for t in range(d.n_frames):
            seconds = n_sent // d.n_frames * period + float(elapsed[t])
            while (wait := begun + seconds - time.perf_counter()) > 0:
                time.sleep(min(wait, _WAIT))
                if stop is not None and stop.is_set():
                    return n_sent
            rows = slice(int(d.offsets[t]), int(d.offsets[t + 1]))
            points, is_marker = d.points[rows], at[rows] >= 0
            markers = np.full((n_markers, 3), np.nan)
            markers[at[rows][is_marker]] = points[is_marker]
            others = points[~is_marker]
            ids = n_points + 1 + np.arange(len(others), dtype=np.int64)
            n_points += len(others)
            images: list[NDArray[np.float64]] | None = None
            if seen is not None:
                # The order of the image points would show their markers.
                every = [seen.points(t, c) for c in range(seen.n_cameras)]
                images = [pixels[np.lexsort(pixels.T)] for pixels in every]
            n_sent += 1
            server.send(
                ServedFrame(
                    number=n_sent, time=seconds, markers=markers, points=others, ids=ids,
                    images=images,
                )
            )  # fmt: skip
        if not loop:
            return n_sent
        if stop is not None and stop.is_set():
            return n_sent
