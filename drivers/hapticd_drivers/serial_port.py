"""A serial port opened by pyserial, then read and written directly, since a tick must never wait.

pyserial's own `write` tries again and again while the port takes no more, even when told not to wait.
"""

from __future__ import annotations

import contextlib
import errno
import os
import select
import termios

import serial

from hapticd.errors import (
    DeviceBusyError,
    DeviceDisconnectedError,
    DeviceNotFoundError,
    DevicePermissionError,
    DriverError,
)


class SerialPort:
    """Frames out whole or not at all, bytes in; no call but `wait` waits.

    Args:
        driver: what the configuration calls it.
        path: the device file.
        baud: bits a second.
        what: what should be plugged in there, for people.

    Attributes:
        port: as pyserial has it.
        descriptor: its file descriptor.
        unsent: frames so far that were dropped because the port could take no more.

    Raises:
        DriverError: not there, not permitted, or busy.
    """

    def __init__(self, driver: str, path: str, baud: int, what: str) -> None:
        self.port = _opened(driver, path, baud, what)
        self.descriptor: int = self.port.fileno()
        self.unsent = 0
        self._driver = driver
        self._path = path
        self._rest = b""  # of a frame that has gone out in part

    def send(self, frame: bytes) -> None:
        """Send a frame, after what is left of the one before, or drop it.

        Raises:
            DeviceDisconnectedError: the port is gone.
        """
        if self._rest:
            self._rest = self._rest[self._write(self._rest) :]
            if self._rest:
                self.unsent += 1
                return
        written = self._write(frame)
        if written == 0:
            self.unsent += 1
        elif written < len(frame):
            self._rest = frame[written:]

    def receive(self, most: int) -> bytes:
        """What has come, at most `most` bytes; empty when nothing has.

        Raises:
            DeviceDisconnectedError: the port is gone.
        """
        try:
            return os.read(self.descriptor, most)
        except BlockingIOError:
            return b""
        except OSError as error:
            raise self._gone(error) from None

    def wait(self, timeout_s: float) -> None:
        """Return when something may have come, or after this time [s]."""
        select.select([self.descriptor], [], [], timeout_s)

    def close(self, last: bytes = b"") -> None:
        """Give it back, these bytes sent before where that is still possible."""
        with contextlib.suppress(DeviceDisconnectedError):
            if last:
                self._write(last)
        with contextlib.suppress(OSError, serial.SerialException):
            self.port.close()

    def _write(self, data: bytes) -> int:
        try:
            return os.write(self.descriptor, data)
        except BlockingIOError:
            return 0
        except OSError as error:
            raise self._gone(error) from None

    def _gone(self, error: OSError) -> DeviceDisconnectedError:
        return DeviceDisconnectedError(
            f"{self._driver}: {self._path} is gone, unplugged perhaps ({error.strerror}): plug it in again"
        )


def _opened(driver: str, path: str, baud: int, what: str) -> serial.Serial:
    """Open a port for this program alone; nothing of it waits.

    Args:
        driver: what the configuration calls it.
        path: the device file.
        baud: bits a second.
        what: what should be plugged in there, for people.

    Raises:
        DriverError: not there, not permitted, or busy.
    """
    try:
        return serial.Serial(path, baud, timeout=0, write_timeout=0, exclusive=True)
    except (serial.SerialException, OSError, ValueError, termios.error) as error:
        raise _refusal(driver, path, baud, what, error) from error


def _refusal(driver: str, path: str, baud: int, what: str, error: Exception) -> DriverError:
    number = getattr(error, "errno", None)
    if number in (errno.ENOENT, errno.ENXIO, errno.ENODEV):
        return DeviceNotFoundError(f"{driver}: there is no {path}: is {what} plugged in?")
    if number in (errno.EACCES, errno.EPERM):
        return DevicePermissionError(
            f"{driver}: this user may not open {path}: sudo usermod -aG dialout $USER, then log in again"
        )
    if number in (errno.EAGAIN, errno.EBUSY):
        return DeviceBusyError(
            f"{driver}: another program has {path} open: end it first (sudo fuser -v {path} names it)"
        )
    return DeviceNotFoundError(f"{driver}: {path} cannot be opened at {baud} baud: {error}")
