"""Sink that shows the stream in a browser on this machine."""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging
import math
import secrets
import threading
from typing import TYPE_CHECKING, Any

import numpy as np

from asterism.checks import check_extra
from asterism.errors import SinkError
from asterism.reporting.guard import Guard
from asterism.reporting.loopback import listening
from asterism.reporting.page.stream import stream_page

if TYPE_CHECKING:
    from collections.abc import AsyncGenerator, Callable, Generator

    from starlette.requests import Request
    from starlette.responses import Response
    from starlette.types import ASGIApp

    from asterism.live.frame import LiveFrame, StreamHeader
    from asterism.live.live_run import LiveRun

__all__ = ["PageSink"]

log = logging.getLogger(__name__)

_PERIOD = 1 / 90  # seconds, between two looks for a new frame
_HEALTH = 0.5  # seconds, between two reports of the counts
_UNIT = 1e4  # positions are whole tenths of a millimetre


class PageSink:
    """Sink that serves a page with the player of the report, on the loopback interface.

    The page receives the newest frame, up to 90 times a second, however fast the source is. The
    address holds a secret, without which nothing is answered.

    Parameters
    ----------
    port : int
        Port; 0 for any free one.
    on_address : callable, optional
        Receives the address of the page once the server listens; by default it is logged.

    Raises
    ------
    ParameterError
        If the extra ``live`` is not installed.

    Examples
    --------
    >>> PageSink().name
    'page://:0'
    """

    def __init__(self, port: int = 0, *, on_address: Callable[[str], Any] | None = None) -> None:
        check_extra("page://", "live", "starlette", "uvicorn")
        self.name, self.faults = f"page://:{port}", dict[str, int]()
        self.on_address = on_address
        self._port = port
        self._page = b""
        self._frame: LiveFrame | None = None
        self._run: LiveRun | None = None
        self._is_closed = False
        self._server: Any = None
        self._thread: threading.Thread | None = None
        self._line: tuple[LiveFrame | None, str] = (None, "")

    def open(self, header: StreamHeader) -> None:
        """Listen.

        Raises
        ------
        SinkError
            If the port is taken.
        """
        import uvicorn

        class Server(uvicorn.Server):
            @contextlib.contextmanager
            def capture_signals(self) -> Generator[None, None, None]:
                """Leave the signals to the program."""
                yield

        self._page = stream_page(header.source)
        try:
            listener = listening(self._port)
        except OSError as error:
            message = f"{self.name}: expected a free port, found {error.strerror}."
            raise SinkError(message) from error
        port, token = listener.getsockname()[1], secrets.token_urlsafe(24)
        self._server = server = Server(
            uvicorn.Config(
                self._app(port, token), log_config=None, log_level="error", access_log=False,
                ws="none", lifespan="off", timeout_graceful_shutdown=1, date_header=False,
                server_header=False, proxy_headers=False,
            )
        )  # fmt: skip

        def serve() -> None:
            with contextlib.closing(listener):
                asyncio.run(server.serve(sockets=[listener]))

        self._is_closed = False
        self._thread = threading.Thread(target=serve, name="page", daemon=True)
        self._thread.start()
        address = f"http://127.0.0.1:{port}/?token={token}"
        if self.on_address is None:
            log.info("%s: %s", self.name, address)
        else:
            self.on_address(address)

    def send(self, frame: LiveFrame) -> None:
        """Keep the frame for the pages, with its tracks."""
        _ = frame.tracks  # computed in the thread of the loop
        self._frame = frame

    def show(self, run: LiveRun) -> None:
        """Keep the counts for the pages.

        Parameters
        ----------
        run : LiveRun
            Counts so far.
        """
        self._run = run

    def close(self) -> None:
        """Stop the server."""
        self._is_closed = True
        if self._thread is not None:
            self._server.should_exit = True
            self._thread.join(5.0)
            self._thread = None

    def _app(self, port: int, token: str) -> ASGIApp:
        from starlette.applications import Starlette
        from starlette.responses import HTMLResponse, StreamingResponse
        from starlette.routing import Route

        async def page(_: Request) -> Response:
            return HTMLResponse(self._page)

        async def frames(_: Request) -> Response:
            return StreamingResponse(self._lines(), media_type="application/x-ndjson")

        return Guard(Starlette(routes=[Route("/", page), Route("/frames", frames)]), port, token)

    async def _lines(self) -> AsyncGenerator[str, None]:
        """Return new frames, and from time to time the names and the counts, as lines of JSON."""
        loop = asyncio.get_running_loop()
        shown: LiveFrame | None = None
        names: dict[int, str] = {}
        next_health = 0.0
        while not self._is_closed:
            frame, now = self._frame, loop.time()
            if frame is not None and frame is not shown:
                shown = frame
                if self._line[0] is not frame:  # encoded once for all pages
                    self._line = frame, _line_of(frame)
                if (present := _names_of(frame)) != names:
                    names = present
                    yield json.dumps({"names": names}) + "\n"
                yield self._line[1]
            if now >= next_health and (run := self._run) is not None:
                next_health = now + _HEALTH
                yield json.dumps({"health": _health_of(run)}) + "\n"
            await asyncio.sleep(_PERIOD)


def _line_of(frame: LiveFrame) -> str:
    """Return a frame as a line: the tracks, and the points without one."""
    clutter = frame.points[frame.labels < 0]
    tracks = frame.tracks
    ids: list[int] = []
    seen: list[int] = []
    at: list[float | None] = []
    if tracks is not None:
        ids, seen = tracks.ids.tolist(), tracks.is_seen.astype(int).tolist()
        places = np.rint(_UNIT * tracks.positions).ravel().tolist()
        at = [int(x) if math.isfinite(x) else None for x in places]
    line = {
        "frame": frame.number, "time": frame.time, "ids": ids, "seen": seen, "at": at,
        "clutter": np.rint(_UNIT * clutter).astype(np.int64).ravel().tolist(),
    }  # fmt: skip
    return json.dumps(line, separators=(",", ":")) + "\n"


def _names_of(frame: LiveFrame) -> dict[int, str]:
    tracks = frame.tracks
    if tracks is None:
        return {}
    return {i: name for i, name in zip(tracks.ids.tolist(), tracks.names, strict=True) if name}


def _health_of(run: LiveRun) -> dict[str, Any]:
    info = {name: value if math.isfinite(value) else None for name, value in run.info.items()}
    faults = sorted((run.faults or {}).items(), key=lambda fault: -fault[1])
    classes = [] if run.latency is None else run.latency.classes()
    return {"info": info, "faults": faults, "classes": classes}
