"""A serial line as a link: frames on a port, and what makes kernel and adapter hand bytes over at once."""

from __future__ import annotations

import contextlib
import termios
from pathlib import Path

import serial

from hapticd_drivers.rig.frames import FrameReader, framed
from hapticd_drivers.rig.serial_ports import Port, latency_timer
from hapticd_drivers.serial_port import SerialPort

MOST_BYTES = 4096
"""Most that is read at once: more than a line brings in 10 ms."""


class SerialLink:
    """Frames on a serial line; a `link.Link`.

    Args:
        port: what to open.
        baud: bits a second.
        low_latency: ask the kernel and the adapter not to keep bytes back.

    Raises:
        DriverError: not there, not permitted, or busy.
    """

    def __init__(self, port: Port, baud: int, low_latency: bool) -> None:
        self.where = port.path
        self._reader = FrameReader()
        self._port = SerialPort("serial-rig", port.path, baud, "the rig")
        _keep_up(self._port.descriptor)
        self.notes = _hurry(self._port.port) if low_latency else ()

    @property
    def damaged(self) -> int:
        """Frames so far that were no message."""
        return self._reader.damaged

    @property
    def unsent(self) -> int:
        """Messages so far that were dropped because the line could take no more."""
        return self._port.unsent

    def send(self, message: bytes) -> None:
        """Send a message, or drop it when the line can take no more."""
        self._port.send(framed(message))

    def receive(self) -> list[bytes]:
        """The intact messages that have come."""
        data = self._port.receive(MOST_BYTES)
        return self._reader.feed(data) if data else []

    def wait(self, timeout_s: float) -> None:
        """Return when something may have come, or after this time [s]."""
        self._port.wait(timeout_s)

    def close(self) -> None:
        """Give it back."""
        self._port.close()


def _keep_up(descriptor: int) -> None:
    """Leave DTR up when the port is closed: the next to open it does not reset the board then."""
    with contextlib.suppress(termios.error):
        attributes = termios.tcgetattr(descriptor)
        attributes[2] &= ~termios.HUPCL
        termios.tcsetattr(descriptor, termios.TCSANOW, attributes)


def _hurry(port: serial.Serial) -> tuple[str, ...]:
    """Ask that no bytes are kept back; what to know when that cannot be had."""
    refused = ""
    try:
        port.set_low_latency_mode(True)
    except ValueError as error:
        refused = str(error)
    timer = latency_timer(port.port)
    _flush_at_frames(timer.with_name("event_char"))
    try:
        if timer.read_text().strip() == "1":
            return ()
        timer.write_text("1")
        return ()
    except FileNotFoundError:  # no FTDI adapter
        if refused:
            return (
                f"serial-rig: {port.port} has no low-latency mode: round_trip_us in the status says what that costs",
            )
        return ()
    except OSError:
        return (
            f"serial-rig: the adapter at {port.port} keeps bytes back for {_shown(timer)} ms: "
            f"echo 1 | sudo tee {timer}, or the udev rule in docs/serial-rig.md",
        )


def _flush_at_frames(event_char: Path) -> None:
    """Have an FTDI adapter hand over what it has at each zero, which ends a frame, where this may be set."""
    with contextlib.suppress(OSError):
        if event_char.exists():
            event_char.write_text("0x100")  # bit 8: there is such a byte; the lower ones: which


def _shown(timer: Path) -> str:
    with contextlib.suppress(OSError):
        return timer.read_text().strip()
    return "up to 255"
