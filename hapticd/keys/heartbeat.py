"""Signs of life between computers: one that lost its power, or a cut cable, ends no connection by itself."""

from __future__ import annotations

import zmq

EVERY_MS = 1000
"""How often each side says that it is there [ms]."""

SILENT_MS = 4000
"""After how much silence a connection is given up, and how long one may take to come about [ms]."""


def expect_signs_of_life(socket: zmq.Socket[bytes]) -> None:
    """Have a socket say and expect signs of life on what it binds or connects from now on.

    Clients answer by themselves, whatever they are written in, from ZeroMQ 4.2 on.

    Args:
        socket: before it binds a TCP endpoint or connects to one; one to this computer needs none.
    """
    socket.setsockopt(zmq.HEARTBEAT_IVL, EVERY_MS)
    socket.setsockopt(zmq.HEARTBEAT_TIMEOUT, SILENT_MS)
    socket.setsockopt(zmq.CONNECT_TIMEOUT, SILENT_MS)
