"""Sockets of the servers, and the error when an address is not free."""

from __future__ import annotations

import ipaddress
import socket

from asterism.errors import ParameterError, SinkError

__all__ = ["check_host", "is_loopback", "tcp_listener", "udp_socket"]


def check_host(host: str) -> str:
    """Return the address of an interface, or raise.

    Raises
    ------
    ParameterError
        If it is not an IPv4 address.

    Examples
    --------
    >>> check_host("localhost")
    '127.0.0.1'
    """
    try:
        return str(ipaddress.IPv4Address("127.0.0.1" if host == "localhost" else host))
    except ValueError:
        hint = "127.0.0.1 serves this machine only, 0.0.0.0 every interface"
        raise ParameterError("host", "an IPv4 address", repr(host), hint) from None


def is_loopback(address: str) -> bool:
    """Return whether an IPv4 address is one of this machine's loopback interface."""
    return address.startswith("127.")


def tcp_listener(host: str, port: int) -> socket.socket:
    """Open a socket that listens; port 0 takes any free port.

    Raises
    ------
    SinkError
        If the port is in use, or may not be opened.
    """
    listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((host, port))
        listener.listen(16)
    except OSError as error:
        listener.close()
        raise _not_free("TCP", host, port, error) from error
    listener.setblocking(False)
    return listener


def udp_socket(host: str, port: int) -> socket.socket:
    """Open a UDP socket; port 0 takes any free port.

    Raises
    ------
    SinkError
        If the port is in use, or may not be opened.
    """
    opened = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    try:
        opened.bind((host, port))
    except OSError as error:
        opened.close()
        raise _not_free("UDP", host, port, error) from error
    opened.setblocking(False)
    return opened


def _not_free(kind: str, host: str, port: int, error: OSError) -> SinkError:
    reason = (error.strerror or str(error)).lower()
    return SinkError(f"{host}:{port}: cannot listen ({kind}): {reason}. Choose another port.")
