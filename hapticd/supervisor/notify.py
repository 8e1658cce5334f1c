"""Tell systemd how the service is: one datagram a message, nothing where systemd does not listen."""

from __future__ import annotations

import contextlib
import os
import socket
import time

_ROUND_S = 0.01
"""How often it is fed at most [s]."""


class Notifier:
    """Sends to $NOTIFY_SOCKET.

    Attributes:
        watchdog_s: how often systemd wants to hear that all is well [s]; 0 when it does not.
    """

    def __init__(self) -> None:
        address = os.environ.get("NOTIFY_SOCKET", "")
        self._address = "\0" + address[1:] if address.startswith("@") else address
        self._fed_s = 0.0
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) if address else None
        watched = os.environ.get("WATCHDOG_PID", str(os.getpid())) == str(os.getpid())
        self.watchdog_s = int(os.environ.get("WATCHDOG_USEC", "0")) * 1e-6 if watched else 0.0

    def feed_watchdog(self) -> None:
        """Tell systemd that all is well, at half the interval that it asks for."""
        now_s = time.monotonic()
        if self.watchdog_s and now_s - self._fed_s > 0.5 * self.watchdog_s - _ROUND_S:
            self._fed_s = now_s
            self.send("WATCHDOG=1")

    def send(self, *lines: str) -> None:
        """Send assignments such as READY=1."""
        if self._socket is not None:
            # systemd being away or slow to read is no reason to stop or to wait.
            with contextlib.suppress(OSError):
                self._socket.sendto("\n".join(lines).encode(), socket.MSG_DONTWAIT, self._address)
