"""Socket of a server for the browser of this machine."""

import socket

from asterism.reporting.loopback import listening


def test_small_messages_are_sent_at_once():
    with (
        listening(0) as listener,
        socket.create_connection(listener.getsockname()),
        listener.accept()[0] as accepted,
    ):
        assert accepted.proto == socket.IPPROTO_TCP  # for which asyncio sets TCP_NODELAY
