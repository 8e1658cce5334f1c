"""The lines of mjbots' fdcanusb and mjcanfd-usb-1x adapters, in the mode in which they start.

can send 8001 01000A... BF          B: fast data phase, F: CAN-FD
OK                                  the adapter has taken it
rcv 100 2100... E B F               a frame that came; flags in capitals are set
ERR text                            a line that it could not read
"""

from __future__ import annotations

from hapticd_drivers.motors.ascii_link import Dialect
from hapticd_drivers.motors.link import Frame

USB = ("0483:5740", "1209:2323")
"""Vendor and product of the older and the newer adapters; the first is what many an ST board says as well."""

MOST_IDENTIFIER = 0x1FFFFFFF
MOST_DATA = 64


def line(identifier: int, data: bytes) -> bytes:
    """A frame to send."""
    return b"can send %04x %s BF\n" % (identifier, data.hex().upper().encode())


def frame(text: bytes) -> Frame | None:
    """A frame that came; None for what the adapter says for itself.

    Raises:
        ValueError: no line of an adapter.
    """
    words = text.split()
    if not words or words[0] == b"OK":
        return None
    if words[0] != b"rcv" or len(words) < 3:
        raise ValueError("neither a frame nor an answer")
    identifier = int(words[1], 16)
    data = bytes.fromhex(words[2].decode("ascii"))
    if not 0 <= identifier <= MOST_IDENTIFIER or len(data) > MOST_DATA:
        raise ValueError("no frame of CAN")
    return identifier, data


DIALECT = Dialect(name="fdcanusb", end=b"\n", opening=b"\n", closing=b"", line=line, frame=frame)
