"""CAN frames as lines of text on a serial port: fdcanusb and slcan adapters."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from hapticd_drivers.motors.link import Frame
from hapticd_drivers.serial_port import SerialPort

BAUD = 921_600
"""Of no meaning to an adapter that is USB itself."""

MOST_BYTES = 16384
"""Most that is read at once."""

LONGEST_LINE = 512
"""Bytes without an end of line that are no line any more."""


@dataclass(frozen=True, slots=True)
class Dialect:
    """How an adapter writes frames.

    Attributes:
        name: of the adapter.
        end: the byte that ends a line.
        opening: what is sent when the port has been opened.
        closing: what is sent before it is closed.
        line: a frame as a line, its end included.
        frame: a line without its end as a frame; None for one that is no frame and no damage either.
        refusal: what stands alone, without an end, for a line that the adapter has not taken; b"" where it ends as all.
    """

    name: str
    end: bytes
    opening: bytes
    closing: bytes
    line: Callable[[int, bytes], bytes]
    frame: Callable[[bytes], Frame | None]
    """Raises ValueError for a line that makes no sense."""
    refusal: bytes = b""


class AsciiLink:
    """A `link.BusLink` on a serial port.

    Args:
        driver: what the configuration calls it.
        path: of the port.
        dialect: of the adapter.

    Raises:
        DriverError: not there, not permitted, or busy.
    """

    def __init__(self, driver: str, path: str, dialect: Dialect) -> None:
        self.where = path
        self.damaged = 0
        self._dialect = dialect
        self._came = b""  # of a line that has not come whole
        self._port = SerialPort(driver, path, BAUD, f"the {dialect.name} adapter")
        self._port.send(dialect.opening)

    @property
    def unsent(self) -> int:
        """Frames so far that were dropped because the port could take no more."""
        return self._port.unsent

    def send(self, identifier: int, data: bytes) -> None:
        """Send a frame, or drop it when the port can take no more."""
        self._port.send(self._dialect.line(identifier, data))

    def receive(self) -> list[Frame]:
        """The frames that have come."""
        data = self._port.receive(MOST_BYTES)
        if not data:
            return []
        dialect = self._dialect
        if dialect.refusal:
            data = data.replace(dialect.refusal, dialect.refusal + dialect.end)  # or it would spoil the frame behind it
        *lines, rest = (self._came + data).split(dialect.end)
        if len(rest) > LONGEST_LINE:
            self.damaged += 1
            rest = b""
        self._came = rest
        frames = []
        for line in lines:
            try:
                frame = dialect.frame(line)
            except ValueError:
                self.damaged += 1
                continue
            if frame is not None:
                frames.append(frame)
        return frames

    def wait(self, timeout_s: float) -> None:
        """Return when something may have come, or after this time [s]."""
        self._port.wait(timeout_s)

    def close(self) -> None:
        """Give it back."""
        self._port.close(self._dialect.closing)
