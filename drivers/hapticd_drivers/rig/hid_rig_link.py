"""A rig's messages in 64-byte raw HID reports (docs/rig-protocol.md)."""

from __future__ import annotations

import threading
import time

from hapticd.errors import DeviceDisconnectedError
from hapticd_drivers.rig.hid_rig_discovery import OpenHid
from hapticd_drivers.rig.hid_rig_outbox import Outbox
from hapticd_drivers.rig.messages import FORCE, LONGEST, PING, POLL, SHORTEST, is_intact

REPORT_SIZE = 64
_REPORT_NUMBER = b"\0"
"""Goes before a report that is sent: the rig's reports have no numbers."""

MOST_READ = 2 * REPORT_SIZE
"""Reports that one look takes at most, twice of what the kernel keeps: a rig that floods may not hold the loop."""

NAP_S = 1e-4
"""Time between two looks where less than a millisecond is left to wait [s]."""


class HidLink:
    """A HID device as a link: reading never waits, and writing is the outbox's.

    Two threads use one hidapi handle, this one to read and the outbox's to write, and each leaves it alone after its
    first error: more hidapi does not allow. Closing frees the handle, so it waits for the end of a read: a pulled plug
    fails a write while this thread still reads.

    Args:
        hid: the device; closed with the link.

    Attributes:
        where: the device's path.
        damaged: reports so far that held no message.
        notes: what is to be known about the link, a line each.
    """

    def __init__(self, hid: OpenHid) -> None:
        self.where = hid.found.where
        self.damaged = 0
        self.notes: tuple[str, ...] = ()
        if hid.found.backend == "libusb":
            self.notes = (
                "hid-rig: through libusb, which is slower than hidraw and takes the rig from the kernel's driver",
            )
        self._hid = hid
        self._read = hid.device.read
        self._reading = threading.Lock()
        self._lost = False
        self._outbox = Outbox(hid.device.write, self._release)
        self._waited_for: list[list[int]] = []

    @property
    def unsent(self) -> int:
        """Messages so far that never went out, since the device took too long over those before."""
        return self._outbox.dropped

    def send(self, message: bytes) -> None:
        """Send a message; a FORCE or POLL that has not gone out yet is replaced by it.

        Raises:
            DeviceDisconnectedError: a write has failed.
        """
        outbox = self._outbox
        if outbox.failed:
            raise self._gone()
        report = _REPORT_NUMBER + bytes((len(message),)) + message.ljust(LONGEST, b"\0")
        kind = message[1]
        if kind in (FORCE, POLL):
            outbox.send_tick(report)
        elif kind == PING:
            outbox.send_question(report)
        else:
            outbox.send_order(report)

    def receive(self) -> list[bytes]:
        """The intact messages that have come, in the order in which they came.

        Raises:
            DeviceDisconnectedError: the device is gone.
        """
        messages: list[bytes] = []
        for _ in range(MOST_READ):
            report = self._waited_for.pop() if self._waited_for else self._next_report(0)
            if not report:
                break
            message = _message(report)
            if message is None:
                self.damaged += 1
            else:
                messages.append(message)
        return messages

    def wait(self, timeout_s: float) -> None:
        """Return when something may have come, and not after so long [s]: hidapi itself knows whole milliseconds only.

        Raises:
            DeviceDisconnectedError: the device is gone.
        """
        if self._waited_for:
            return
        if timeout_s < 1e-3:
            time.sleep(min(timeout_s, NAP_S))
            return
        report = self._next_report(int(timeout_s * 1e3))
        if report:
            self._waited_for.append(report)

    def close(self) -> None:
        """Send what waits, then give the device back."""
        self._outbox.end()

    def _next_report(self, timeout_ms: int) -> list[int]:
        with self._reading:
            if self._lost:
                raise self._gone()
            try:
                report: list[int] = self._read(REPORT_SIZE, timeout_ms)
            except (OSError, ValueError) as error:  # hidapi gives no reason
                self._lost = True
                raise self._gone() from error
            return report

    def _release(self) -> None:
        """Give the device back, on the outbox's thread: a calibration may still read when its driver is closed."""
        with self._reading:
            self._lost = True
            self._hid.close()

    def _gone(self) -> DeviceDisconnectedError:
        return DeviceDisconnectedError(f"hid-rig: {self.where} is gone: the rig was unplugged or lost its power")


def _message(report: list[int]) -> bytes | None:
    length = report[0]
    if len(report) != REPORT_SIZE or not SHORTEST <= length <= LONGEST:
        return None
    message = bytes(report[1 : length + 1])
    return message if is_intact(message) else None
