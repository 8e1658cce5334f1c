"""Messages on a serial line: each in a COBS frame that ends with a zero byte (docs/rig-protocol.md)."""

from __future__ import annotations

from cobs import cobs

from hapticd_drivers.rig.messages import LONGEST, is_intact

LONGEST_FRAME = LONGEST + 1
"""Bytes of a frame without the zero at its end."""


def framed(message: bytes) -> bytes:
    """A message as it goes onto the line."""
    frame: bytes = cobs.encode(message) + b"\0"
    return frame


class FrameReader:
    """Finds the messages in the bytes of a line, whatever is between them.

    Attributes:
        damaged: frames so far that were no message: too long, too short, no COBS or a wrong CRC.
    """

    def __init__(self) -> None:
        self.damaged = 0
        self._begun = b""

    def feed(self, data: bytes) -> list[bytes]:
        """The intact messages that end in these bytes, oldest first; what has only begun is kept for the next call."""
        *frames, begun = (self._begun + data).split(b"\0")
        self._begun = begun[: LONGEST_FRAME + 1]  # one too many stands for any number of them
        messages = []
        for frame in frames:
            if frame:
                message = _decoded(frame)
                if message is None:
                    self.damaged += 1
                else:
                    messages.append(message)
        return messages


def _decoded(frame: bytes) -> bytes | None:
    if len(frame) > LONGEST_FRAME:
        return None
    try:
        message: bytes = cobs.decode(frame)
    except cobs.DecodeError:
        return None
    return message if is_intact(message) else None
