"""Addresses of sources and sinks, as they are typed: ``scheme://host:port?option=value``."""

from __future__ import annotations

from typing import NamedTuple
from urllib.parse import parse_qsl, urlsplit

from asterism.checks import check_fields
from asterism.errors import ParameterError

__all__ = ["Address", "split_address"]


class Address(NamedTuple):
    """Parts of an address.

    Attributes
    ----------
    scheme : str
        Kind of source or sink; empty for a file.
    host : str
        Host, or name of a stream; path of a file.
    port : int
        Port; 0 without one.
    options : dict of str to str
        Options after the question mark.
    """

    scheme: str
    host: str
    port: int
    options: dict[str, str]


def split_address(place: str, text: str, known: dict[str, tuple[str, ...]]) -> Address:
    """Take an address apart.

    Parameters
    ----------
    place : str
        Argument or option, for messages.
    text : str
        The address, or a file.
    known : dict of str to tuple of str
        Options of each scheme; the empty scheme stands for files.

    Raises
    ------
    ParameterError
        If the scheme, an option or the port is unknown.

    Examples
    --------
    >>> split_address("FROM", "natnet://10.0.0.2:1510?local=10.0.0.9", {"natnet": ("local",)})
    Address(scheme='natnet', host='10.0.0.2', port=1510, options={'local': '10.0.0.9'})
    """
    scheme, mark, rest = text.partition("://")
    if not mark:
        path, _, query = text.partition("?")
        return Address("", path, 0, _options(place, query, known[""]))
    if scheme not in known or not scheme:
        schemes = ", ".join(f"{each}://" for each in known if each)
        raise ParameterError(place, f"{schemes} or a file", repr(text))
    if scheme == "lsl":  # the name of a stream may hold anything
        return Address(scheme, rest, 0, {})
    try:
        parts = urlsplit(f"//{rest}")
        port = parts.port or 0
    except ValueError:
        raise ParameterError(place, f"{scheme}://HOST:PORT", repr(text)) from None
    if parts.path.strip("/") or parts.username is not None or parts.fragment:
        raise ParameterError(place, f"{scheme}://HOST:PORT", repr(text))
    return Address(scheme, parts.hostname or "", port, _options(place, parts.query, known[scheme]))


def _options(place: str, query: str, known: tuple[str, ...]) -> dict[str, str]:
    pairs = parse_qsl(query, keep_blank_values=True) if query else []
    if pairs and not known:
        raise ParameterError(place, "no options after the address", repr(query))
    check_fields(place, [name for name, _ in pairs], known)
    return dict(pairs)
