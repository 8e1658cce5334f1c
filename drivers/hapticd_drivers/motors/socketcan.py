"""CAN frames through the kernel's own CAN interfaces (can0), classic and CAN-FD."""

from __future__ import annotations

import contextlib
import errno
import select
import socket
import struct

from hapticd.errors import DeviceDisconnectedError, DeviceNotFoundError, DevicePermissionError, DriverError
from hapticd_drivers.motors.link import Frame

EXTENDED = 0x80000000
REMOTE = 0x40000000
ERROR = 0x20000000
MOST_STANDARD = 0x7FF
_IDENTIFIER = 0x1FFFFFFF

BRS = 0x01
"""CANFD_BRS: the data phase is the fast one."""

CLASSIC = struct.Struct("=IB3x8s")
FD = struct.Struct("=IBB2x64s")
"""struct can_frame and struct canfd_frame of <linux/can.h>."""

MOST_FRAMES = 512
"""Most that are taken at once, more than the kernel keeps: of what is left over a tick would believe an older place."""


class SocketCanLink:
    """A `link.BusLink` on a CAN interface.

    Args:
        driver: what the configuration calls it.
        interface: its name.
        fd: whether frames are sent as CAN-FD.
        opened: a socket that carries such frames, whichever it is; it is closed with the link.
    """

    def __init__(self, driver: str, interface: str, fd: bool, opened: socket.socket) -> None:
        self.where = interface
        self.damaged = 0
        self.unsent = 0
        self._driver = driver
        self._socket = opened
        self._socket.setblocking(False)
        self._fd = fd

    def send(self, identifier: int, data: bytes) -> None:
        """Send a frame, or drop it when the interface can take no more."""
        tagged = identifier if identifier <= MOST_STANDARD else identifier | EXTENDED
        size = len(data)
        frame = FD.pack(tagged, size, BRS, data) if self._fd else CLASSIC.pack(tagged, size, data)
        try:
            self._socket.send(frame)
        except BlockingIOError:
            self.unsent += 1
        except OSError as error:
            if error.errno != errno.ENOBUFS:
                raise self._gone(error) from None
            self.unsent += 1

    def receive(self) -> list[Frame]:
        """The frames that have come; what is no data frame is left out."""
        frames = []
        for _ in range(MOST_FRAMES):
            try:
                raw = self._socket.recv(FD.size)
            except BlockingIOError:
                break
            except OSError as error:
                raise self._gone(error) from None
            if not raw:
                raise self._gone(OSError(errno.ENODEV, "closed"))
            if len(raw) == FD.size:
                tagged, size, _flags, data = FD.unpack(raw)
            elif len(raw) == CLASSIC.size:
                tagged, size, data = CLASSIC.unpack(raw)
            else:
                self.damaged += 1
                continue
            if tagged & ERROR or size > len(data):
                self.damaged += 1
            elif not tagged & REMOTE:
                frames.append((tagged & _IDENTIFIER, data[:size]))
        return frames

    def wait(self, timeout_s: float) -> None:
        """Return when something may have come, or after this time [s]."""
        select.select([self._socket], [], [], timeout_s)

    def close(self) -> None:
        """Give it back."""
        with contextlib.suppress(OSError):
            self._socket.close()

    def _gone(self, error: OSError) -> DriverError:
        look = f"`hapticd devices {self._driver}` has the lines that bring it up"
        if self._fd and error.errno == errno.EINVAL:
            return DeviceNotFoundError(f"{self._driver}: the CAN interface {self.where} is up without CAN-FD: {look}")
        return DeviceDisconnectedError(
            f"{self._driver}: the CAN interface {self.where} is gone or down ({error.strerror}): plug the adapter in "
            f"again; {look}"
        )


def open_can(driver: str, interface: str, fd: bool, up: str) -> SocketCanLink:
    """Open an interface.

    Args:
        driver: what the configuration calls it.
        interface: its name.
        fd: whether frames are sent as CAN-FD.
        up: the line for a shell that brings it up, which only root may.

    Raises:
        DriverError: not there, not up, or not permitted.
    """
    try:
        opened = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
    except OSError as error:
        raise DeviceNotFoundError(
            f"{driver}: this kernel has no CAN ({error.strerror}): sudo modprobe can-raw"
        ) from error
    try:
        if fd:
            opened.setsockopt(socket.SOL_CAN_RAW, socket.CAN_RAW_FD_FRAMES, 1)
        opened.bind((interface,))
        link = SocketCanLink(driver, interface, fd, opened)
        link.receive()  # an interface that is down says so here
    except (OSError, DriverError) as error:
        opened.close()
        raise _refusal(driver, interface, up, error) from error
    return link


def _refusal(driver: str, interface: str, up: str, error: Exception) -> DriverError:
    number = getattr(error, "errno", None)
    if number == errno.ENODEV:
        return DeviceNotFoundError(f"{driver}: there is no CAN interface {interface}: ip -br link show type can")
    if number in (errno.EACCES, errno.EPERM):
        return DevicePermissionError(f"{driver}: this user may not open {interface} ({error})")
    return DeviceNotFoundError(f"{driver}: {interface} is there and is not up: {up}")
