"""A serial port opened by pyserial, then read and written directly, since a tick must never wait.

pyserial's own `write` tries again and again while the port takes no more, even when told not to wait. And what has come
is brought by a worker of the kernel that is no real-time task: where there is nothing to read yet, `read`, `select` and
`poll` wait until it has done what it has to do (`n_tty.c`), up to 0.2 s on a busy computer. Asking how many bytes are
there does not wait, so only what is there is read.
"""

from __future__ import annotations

import contextlib
import errno
import fcntl
import os
import termios
import time
from array import array

import serial

from hapticd.errors import (
    DeviceBusyError,
    DeviceDisconnectedError,
    DeviceNotFoundError,
    DevicePermissionError,
    DriverError,
)

NAP_S = 5e-5
"""Least time between two looks while something is waited for [s]."""

NAP_SHARE = 0.1
"""Of what has been waited for, the time until the next look: what comes late is seen little later."""


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
        self._there = array("i", [0])  # bytes that can be read

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
        if not self._can_read():
            return b""
        try:
            return os.read(self.descriptor, most)
        except BlockingIOError:
            return b""
        except OSError as error:
            raise self._gone(error) from None

    def wait(self, timeout_s: float) -> None:
        """Return when something has come, or after this time [s].

        Raises:
            DeviceDisconnectedError: the port is gone.
        """
        begin_s = time.monotonic()
        while not self._can_read():
            waited_s = time.monotonic() - begin_s
            if waited_s >= timeout_s:
                return
            time.sleep(min(max(NAP_S, NAP_SHARE * waited_s), timeout_s - waited_s))

    def close(self, last: bytes = b"") -> None:
        """Give it back, these bytes sent before where that is still possible."""
        with contextlib.suppress(DeviceDisconnectedError):
            if last:
                self._write(last)
        with contextlib.suppress(OSError, serial.SerialException):
            self.port.close()

    def _can_read(self) -> bool:
        try:
            fcntl.ioctl(self.descriptor, termios.FIONREAD, self._there)
        except OSError as error:
            raise self._gone(error) from None
        return self._there[0] > 0

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
