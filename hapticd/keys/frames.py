"""Messages of one frame, which is all that our requests are; a longer one is not collected in memory."""

from __future__ import annotations

from typing import NamedTuple

import zmq

MOST_PASSED_OVER = 5000
"""Frames of a message that is too long, of which no more are read in a turn."""


class FirstFrame(NamedTuple):
    """The beginning of a message.

    Attributes:
        identity: of who sent it.
        frame: the first one.
        single: it is the whole message.
    """

    identity: bytes
    frame: zmq.Frame
    single: bool


class FrameReader:
    """Reads the first frame of each message of a ROUTER and passes over all others.

    Args:
        socket: to read from; no other may.
    """

    def __init__(self, socket: zmq.Socket[bytes]) -> None:
        self._socket = socket
        self._within = False

    def read(self) -> FirstFrame | None:
        """The next message; None when there is none, or not before more of a long one has been passed over."""
        if self._within and not self._pass_over():
            return None
        try:
            identity = self._socket.recv(zmq.NOBLOCK, copy=False)
        except zmq.Again:
            return None
        frame = self._socket.recv(zmq.NOBLOCK, copy=False)  # a message is there as a whole
        self._within = frame.more
        return FirstFrame(identity.bytes, frame, not frame.more)

    def _pass_over(self) -> bool:
        for _ in range(MOST_PASSED_OVER):
            if not self._socket.recv(zmq.NOBLOCK, copy=False).more:
                self._within = False
                return True
        return False
