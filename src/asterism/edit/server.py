"""Server of the editor: one page, its actions and its events, for this machine only."""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import secrets
import signal
import threading
from typing import TYPE_CHECKING, Any

from asterism.checks import check_extra
from asterism.edit.messages import parsed
from asterism.errors import AsterismError, ParameterError
from asterism.reporting.guard import Guard
from asterism.reporting.loopback import listening

if TYPE_CHECKING:
    import socket
    from collections.abc import AsyncGenerator, Callable, Generator

    from starlette.requests import Request
    from starlette.responses import Response
    from starlette.types import ASGIApp

    from asterism.edit.hub import Hub

__all__ = ["made_app", "serve"]

_ALIVE_SECONDS = 15.0  # after which a line is sent, by which a lost page is noticed


def made_app(hub: Hub, port: int, token: str) -> ASGIApp:
    """Return the application behind its guard.

    Parameters
    ----------
    hub : Hub
        State of the session.
    port : int
        Port of the server.
    token : str
        Secret of the address.
    """
    from starlette.applications import Starlette
    from starlette.responses import (
        HTMLResponse,
        JSONResponse,
        PlainTextResponse,
        StreamingResponse,
    )
    from starlette.routing import Route

    async def page(_: Request) -> Response:
        return HTMLResponse(await hub.page())

    async def act(request: Request) -> Response:
        action = request.path_params["action"]
        try:
            message = parsed(action, await request.body())
        except ParameterError as error:
            return PlainTextResponse(f"{error}\n", status_code=400)
        try:
            # Carried out to its end, even if the page goes away meanwhile.
            answer = await asyncio.shield(hub.act(action, message))
        except AsterismError as error:
            return PlainTextResponse(f"{error}\n", status_code=409)
        return JSONResponse(answer)

    async def events(request: Request) -> Response:
        since = request.query_params.get("since", "0")
        if not since.isdecimal() or len(since) > 12:
            return PlainTextResponse("since: expected a whole number.\n", status_code=400)
        return StreamingResponse(_lines(hub, int(since)), media_type="text/event-stream")

    app = Starlette(
        routes=[
            Route("/", page),
            Route("/events", events),
            Route("/do/{action}", act, methods=["POST"]),
        ]
    )
    return Guard(app, port, token)


async def _lines(hub: Hub, since: int) -> AsyncGenerator[str, None]:
    """Return the events as text, with a comment where nothing happens for a while."""
    source = hub.events(since)
    waiting: asyncio.Task[Any] | None = None
    try:
        while True:
            if waiting is None:
                waiting = asyncio.ensure_future(anext(source, None))
            done, _ = await asyncio.wait([waiting], timeout=_ALIVE_SECONDS)
            if not done:
                yield ": alive\n\n"
                continue
            event = waiting.result()
            waiting = None
            if event is None:
                return
            kind, value = event
            yield f"event: {kind}\ndata: {json.dumps(value)}\n\n"
    finally:
        if waiting is not None:
            waiting.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await waiting
        await source.aclose()


def serve(
    make_hub: Callable[[], Hub], *, port: int = 0, begin: Callable[[str], None] | None = None
) -> None:
    """Serve the editor on the loopback interface until SIGINT or SIGTERM.

    Parameters
    ----------
    make_hub : callable
        Makes the state of the session, inside the event loop.
    port : int
        Port; 0 for any free one.
    begin : callable, optional
        Called with the address once the server listens.

    Raises
    ------
    ParameterError
        If the port is taken, or the packages of the server are missing.
    """
    check_extra("edit", "edit", "starlette", "uvicorn")
    try:
        listener = listening(port)
    except OSError as error:
        raise ParameterError("--port", "a free port", f"{port}: {error.strerror}") from error
    with listener:
        asyncio.run(_serve(make_hub, listener, begin))


async def _serve(
    make_hub: Callable[[], Hub], listener: socket.socket, begin: Callable[[str], None] | None
) -> None:
    import uvicorn

    hub, token, port = make_hub(), secrets.token_urlsafe(24), listener.getsockname()[1]

    class Server(uvicorn.Server):
        @contextlib.contextmanager
        def capture_signals(self) -> Generator[None, None, None]:
            """Leave the signals to this module."""
            yield

        async def startup(self, sockets: list[socket.socket] | None = None) -> None:
            """Start, then report the address."""
            await super().startup(sockets)
            if begin is not None:
                begin(f"http://127.0.0.1:{port}/?token={token}")

    server = Server(
        uvicorn.Config(
            made_app(hub, port, token), log_config=None, log_level="error", access_log=False,
            ws="none", lifespan="off", timeout_graceful_shutdown=5, date_header=False,
            server_header=False,
            h11_max_incomplete_event_size=16_384, proxy_headers=False,
        )
    )  # fmt: skip

    def stop() -> None:
        server.should_exit = True
        hub.close()

    # Only the main thread has signals, and the event loop of Windows has no handlers of them. Then
    # uvicorn stops the server by its own handlers.
    if os.name == "posix" and threading.current_thread() is threading.main_thread():
        for number in (signal.SIGINT, signal.SIGTERM):
            asyncio.get_running_loop().add_signal_handler(number, stop)
    await server.serve(sockets=[listener])
