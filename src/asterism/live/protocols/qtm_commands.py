"""Commands of the Qualisys real-time protocol that ask for frames, as a server reads them."""

from __future__ import annotations

import re
from typing import NamedTuple

from asterism.live.protocols.packet_error import PacketError
from asterism.live.protocols.qtm_components import COMPONENTS, Component

__all__ = ["FrameRequest", "read_components", "read_stream_request"]


class FrameRequest(NamedTuple):
    """Frames that a client wants to receive.

    Attributes
    ----------
    components : tuple of Component
        Components of each frame, in the order of the command.
    divisor : int
        Every n-th frame is sent.
    frequency : int
        Frames per second; 0 for all.
    udp : tuple of str and int, or None
        Address, empty for that of the client, and port for UDP; None for TCP.
    """

    components: tuple[Component, ...]
    divisor: int = 1
    frequency: int = 0
    udp: tuple[str, int] | None = None


def read_stream_request(words: list[str]) -> FrameRequest:
    """Read the arguments of ``StreamFrames``.

    Parameters
    ----------
    words : list of str
        Arguments: the rate, the UDP port if any, and the components.

    Raises
    ------
    PacketError
        If they cannot be understood.

    Examples
    --------
    >>> read_stream_request(["Frequency:100", "UDP:4711", "3D"])
    FrameRequest(components=(<Component.MARKERS: 1>,), divisor=1, frequency=100, udp=('', 4711))
    """
    if not words:
        raise PacketError("no rate")
    rate, *rest = words
    kind, _, value = rate.lower().partition(":")
    if kind == "allframes" and not value:
        request = FrameRequest(())
    elif kind == "frequency":
        request = FrameRequest((), frequency=_number(value))
    elif kind == "frequencydivisor":
        request = FrameRequest((), divisor=_number(value))
    else:
        raise PacketError("an unknown rate")
    if rest and rest[0].lower().startswith("udp:"):
        request = request._replace(udp=_udp(rest.pop(0)))
    return request._replace(components=read_components(rest))


def read_components(words: list[str]) -> tuple[Component, ...]:
    """Read names of components; options after a colon belong to components that are empty here.

    Raises
    ------
    PacketError
        If there is none, or one is unknown.
    """
    names = [word.lower().partition(":")[0] for word in words]
    if names == ["all"]:
        return tuple(COMPONENTS.values())
    if not names or not set(names) <= COMPONENTS.keys():
        raise PacketError("no component, or an unknown one")
    return tuple(dict.fromkeys(COMPONENTS[name] for name in names))


def _number(text: str) -> int:
    if not re.fullmatch(r"[0-9]{1,6}", text) or not int(text):
        raise PacketError("no whole number above 0")
    return int(text)


def _udp(word: str) -> tuple[str, int]:
    match = re.fullmatch(r"udp:(?:([0-9.]{7,15}|localhost):)?([0-9]{4,5})", word.lower())
    if match is None or not 1023 <= int(match[2]) <= 0xFFFF:
        raise PacketError("no UDP port")
    return {None: "", "localhost": "127.0.0.1"}.get(match[1], match[1]), int(match[2])
