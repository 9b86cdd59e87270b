"""The sinks by their addresses."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from asterism.errors import ParameterError
from asterism.live.address import split_address
from asterism.live.servers import natnet, qtm
from asterism.live.sinks.lsl import LslSink
from asterism.live.sinks.osc import OscSink
from asterism.live.sinks.page import PageSink
from asterism.live.sinks.recording import RecordingSink
from asterism.live.sinks.server import ServerSink
from asterism.live.sinks.text import CsvSink, JsonFileSink, JsonUdpSink, StandardOutput

if TYPE_CHECKING:
    from asterism.live.sinks.base import Sink

__all__ = ["parse_sink", "version_of"]

_KNOWN: dict[str, tuple[str, ...]] = {
    "qtm": (),
    "natnet": ("multicast", "version"),
    "lsl": (),
    "osc": (),
    "udp": (),
    "page": (),
    "": (),
}


def parse_sink(text: str) -> Sink:
    """Make a sink of its address; it is not opened.

    Parameters
    ----------
    text : str
        ``qtm://[HOST][:PORT]`` and ``natnet://[HOST][:PORT][?version=…&multicast=…]`` are servers
        on an interface, by default for this machine only. ``osc://HOST:PORT`` and
        ``udp://HOST:PORT`` send datagrams, ``lsl://STREAM`` publishes a stream, ``page://:PORT`` is
        a page in the browser, ``-`` is standard output, and a file ends in ``.jsonl``, ``.csv`` or
        ``.c3d``.

    Returns
    -------
    Sink

    Raises
    ------
    ParameterError
        If it is none of these.

    Examples
    --------
    >>> parse_sink("qtm://:22223").name
    'qtm://:22223'
    """
    if text == "-":
        return StandardOutput()
    address = split_address("--to", text, _KNOWN)
    host, port = address.host or "127.0.0.1", address.port
    if address.scheme in ("osc", "udp") and not (address.host and port):
        raise ParameterError("--to", f"{address.scheme}://HOST:PORT", repr(text))
    match address.scheme:
        case "qtm":
            return ServerSink(text, qtm.QtmServer(host, port or qtm.PORT))
        case "natnet":
            version = version_of("--to", address.options.get("version", "4.1"))
            group = address.options.get("multicast", "")
            server = natnet.NatNetServer(
                host, port or natnet.PORT, version=version, multicast=group
            )
            return ServerSink(text, server)
        case "lsl":
            if not address.host:
                raise ParameterError("--to", "lsl://STREAM", repr(text))
            return LslSink(text, address.host)
        case "osc":
            return OscSink(text, host, port)
        case "udp":
            return JsonUdpSink(text, host, port)
        case "page":
            if address.host:
                raise ParameterError("--to", "page://:PORT, for this machine only", repr(text))
            return PageSink(port)
        case _:
            return _file(text)


def _file(text: str) -> Sink:
    path = Path(text)
    match path.suffix.lower():
        case ".jsonl":
            return JsonFileSink(path)
        case ".csv":
            return CsvSink(path)
        case ".c3d":
            return RecordingSink(path)
        case _:
            raise ParameterError("--to", "a file that ends in .jsonl, .csv or .c3d", repr(text))


def version_of(place: str, text: str) -> tuple[int, int]:
    """Read a version such as ``4.1``.

    Raises
    ------
    ParameterError
        If it is none.
    """
    major, _, minor = text.partition(".")
    if not (major.isdecimal() and minor.isdecimal()):
        raise ParameterError(place, "a version such as 4.1", repr(text))
    return int(major), int(minor)
