"""Socket of a server for the browser of this machine."""

from __future__ import annotations

import socket

__all__ = ["listening"]


def listening(port: int) -> socket.socket:
    """Return a socket that listens on the loopback interface.

    Parameters
    ----------
    port : int
        Port; 0 for any that is free.

    Returns
    -------
    socket.socket

    Raises
    ------
    OSError
        If the port is taken.

    Examples
    --------
    >>> with listening(0) as listener:
    ...     listener.getsockname()[0]
    '127.0.0.1'
    """
    # asyncio sends small packets at once only on sockets whose protocol is given; otherwise a
    # message waits up to 40 ms for the acknowledgement of the one before.
    listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM, socket.IPPROTO_TCP)
    try:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.bind(("127.0.0.1", port))
        listener.listen(128)
    except OSError:
        listener.close()
        raise
    return listener
