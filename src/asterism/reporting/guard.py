"""Guard of the server: only the page that it served itself is answered.

The server listens on the loopback interface, where every page of the browser and every program of
the machine could reach it. A request is refused without the token of the address, with the name of
another host (DNS rebinding) or from another origin, and when its message is too long.
"""

from __future__ import annotations

import secrets
from typing import TYPE_CHECKING, Any
from urllib.parse import parse_qs

if TYPE_CHECKING:
    from starlette.types import ASGIApp, Message, Receive, Scope, Send

__all__ = ["MAX_BYTES", "TOKEN_HEADER", "Guard"]

MAX_BYTES = 16_384
"""Longest message; an edit has about a hundred bytes."""
TOKEN_HEADER = "x-asterism-token"
_HEADERS = {
    "cache-control": "no-store",
    "x-content-type-options": "nosniff",
    "referrer-policy": "no-referrer",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
    "content-security-policy": "frame-ancestors 'none'",
}


class Guard:
    """ASGI middleware that refuses all requests but those of the editor's own page.

    Parameters
    ----------
    app : ASGI application
        What the guard protects.
    port : int
        Port of the server.
    token : str
        Secret of the address.
    """

    def __init__(self, app: ASGIApp, port: int, token: str) -> None:
        self._app, self._token = app, token
        self._hosts = {f"127.0.0.1:{port}", f"localhost:{port}"}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request, or refuse it."""
        if scope["type"] != "http":
            return
        headers = [(key.decode("latin-1"), value.decode("latin-1")) for key, value in
                   scope["headers"]]  # fmt: skip
        refusal = self._refusal(scope, headers)
        body = b""
        if refusal is None and scope["method"] == "POST":
            body, refusal = await _body(headers, receive)
        if refusal is not None:
            await _answer(send, *refusal)
            return
        is_sent = False

        async def again() -> Message:
            nonlocal is_sent
            if is_sent or scope["method"] != "POST":
                return await receive()
            is_sent = True
            return {"type": "http.request", "body": body, "more_body": False}

        async def guarded(message: Message) -> None:
            if message["type"] == "http.response.start":
                own = [(key.encode(), value.encode()) for key, value in _HEADERS.items()]
                message["headers"] = [*message.get("headers", []), *own]
            await send(message)

        await self._app(scope, again, guarded)

    def _refusal(self, scope: Scope, headers: list[tuple[str, str]]) -> tuple[int, str] | None:
        def all_of(name: str) -> list[str]:
            return [value for key, value in headers if key == name]

        hosts, origins = all_of("host"), all_of("origin")
        if len(hosts) != 1 or hosts[0] not in self._hosts:
            return 403, "Host: expected the address that the server printed."
        if any(origin not in {f"http://{host}" for host in self._hosts} for origin in origins):
            return 403, "Origin: expected the page of this server."
        given = all_of(TOKEN_HEADER)
        if scope["method"] == "GET" and scope["path"] == "/":
            given = parse_qs(scope["query_string"].decode("latin-1")).get("token", [])
        if len(given) != 1 or not secrets.compare_digest(given[0].encode(), self._token.encode()):
            return 403, "Token: expected that of the address that the server printed."
        if scope["method"] == "POST":
            if not origins:
                return 403, "Origin: expected the page of this server, found none."
            if all_of("content-type") != ["application/json"]:
                return 400, "Content-Type: expected application/json."
        return None


async def _body(
    headers: list[tuple[str, str]], receive: Receive
) -> tuple[bytes, tuple[int, str] | None]:
    """Return the message of a request, or why it is refused."""
    refusal = 413, f"message: expected at most {MAX_BYTES} bytes."
    length = dict(headers).get("content-length", "0")
    if not length.isdecimal() or int(length) > MAX_BYTES:
        return b"", refusal
    body = b""
    while True:
        message = await receive()
        if message["type"] != "http.request":
            return b"", (400, "message: the connection was closed.")
        body += message.get("body", b"")
        if len(body) > MAX_BYTES:
            return b"", refusal
        if not message.get("more_body", False):
            return body, None


async def _answer(send: Send, status: int, text: str) -> None:
    headers: Any = {**_HEADERS, "content-type": "text/plain; charset=utf-8", "connection": "close"}
    lines = [(key.encode(), value.encode()) for key, value in headers.items()]
    await send({"type": "http.response.start", "status": status, "headers": lines})
    await send({"type": "http.response.body", "body": text.encode() + b"\n"})
