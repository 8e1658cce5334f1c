"""The lines of slcan adapters (CANable and many others), for frames of classic CAN with identifiers of 11 bits.

S8 <CR>  O <CR>  C <CR>             1 Mbit/s, open, close
t00E4 0000003F <CR>                 identifier (3), length (1), data, without spaces; both ways
<CR>, z <CR>                        the adapter has taken it
<BEL>                               it has not; no <CR> follows
"""

from __future__ import annotations

import re

from hapticd_drivers.motors.ascii_link import Dialect
from hapticd_drivers.motors.link import Frame

SPEEDS = {10_000: 0, 20_000: 1, 50_000: 2, 100_000: 3, 125_000: 4, 250_000: 5, 500_000: 6, 800_000: 7, 1_000_000: 8}
"""Bits a second, and what the adapter calls them."""

_FRAME = re.compile(rb"t[0-7][0-9A-Fa-f]{2}[0-8]")
_ANSWERS = (b"", b"z", b"Z")


def line(identifier: int, data: bytes) -> bytes:
    """A frame to send."""
    return b"t%03X%d%s\r" % (identifier, len(data), data.hex().upper().encode())


def frame(text: bytes) -> Frame | None:
    """A frame that came; None for what the adapter says for itself, and for a frame of another kind.

    Raises:
        ValueError: no line of an adapter.
    """
    if _FRAME.match(text):
        size = 2 * (text[4] - 48)
        if len(text) not in (5 + size, 9 + size):  # some adapters add a time of four digits
            raise ValueError("not as long as it says")
        return int(text[1:4], 16), bytes.fromhex(text[5 : 5 + size].decode("ascii"))
    if text in _ANSWERS or text[:1] in (b"T", b"r", b"R", b"V", b"N"):
        return None
    raise ValueError("neither a frame nor an answer")


def dialect(bits_per_s: int) -> Dialect:
    """How an adapter writes frames on a bus of this speed [bit/s], one of `SPEEDS`."""
    opening = b"\rC\rS%d\rO\r" % SPEEDS[bits_per_s]
    return Dialect(name="slcan", end=b"\r", opening=opening, closing=b"C\r", line=line, frame=frame, refusal=b"\a")
