"""The sources by their addresses."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

from asterism.errors import ParameterError
from asterism.io.calibrations import read_rig
from asterism.live.address import split_address
from asterism.live.servers import natnet, qtm
from asterism.live.sources.json_lines import StandardInput, UdpSource
from asterism.live.sources.lsl import LslSource
from asterism.live.sources.natnet import NatNetSource
from asterism.live.sources.qtm import QtmSource
from asterism.live.sources.replay import ReplaySource

if TYPE_CHECKING:
    from asterism.live.sources.base import Source

__all__ = ["parse_source"]

_KNOWN: dict[str, tuple[str, ...]] = {
    "qtm": ("2d",),
    "natnet": ("local", "multicast"),
    "lsl": (),
    "udp": (),
    "": ("speed",),
}


def parse_source(text: str) -> Source:
    """Make a source of its address; it is not opened.

    Parameters
    ----------
    text : str
        ``qtm://HOST[:PORT]``, with ``?2d`` for points that are reconstructed from the image points
        of the cameras, by the calibration of the system or that of ``?2d=FILE``;
        ``natnet://HOST[:PORT][?local=…&multicast=…]``, ``lsl://STREAM``, ``udp://[HOST]:PORT``,
        ``-`` for standard input, or a capture with ``?speed=2`` or ``?speed=max``.

    Returns
    -------
    Source

    Raises
    ------
    ParameterError
        If it is none of these.
    FormatError
        If the calibration cannot be read.

    Examples
    --------
    >>> parse_source("qtm://192.168.0.10").name
    'qtm://192.168.0.10'
    """
    if text == "-":
        return StandardInput()
    address = split_address("FROM", text, _KNOWN)
    host, port, options = address.host, address.port, address.options
    if address.scheme in ("qtm", "natnet", "lsl") and not host:
        word = "STREAM" if address.scheme == "lsl" else "HOST"
        raise ParameterError("FROM", f"{address.scheme}://{word}", repr(text))
    match address.scheme:
        case "qtm":
            calibration = options.get("2d")
            rig = read_rig(calibration) if calibration else None
            images = calibration is not None
            return QtmSource(text, host, port or qtm.PORT, images=images, rig=rig)
        case "natnet":
            return NatNetSource(text, host, port or natnet.PORT, **options)
        case "lsl":
            return LslSource(text, host)
        case "udp":
            if not port:
                raise ParameterError("FROM", "udp://HOST:PORT", repr(text))
            return UdpSource(text, host or "127.0.0.1", port)
        case _:
            return ReplaySource(text, Path(host), _speed(options.get("speed", "1")))


def _speed(text: str) -> float:
    if text == "max":
        return math.inf
    try:
        speed = float(text)
    except ValueError:
        speed = math.nan
    if not 0 < speed < math.inf:
        raise ParameterError("FROM", "speed=max, or a number above 0", f"speed={text}")
    return speed
