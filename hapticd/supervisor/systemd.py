"""Tell systemd how the service is: one datagram a message, nothing where systemd does not listen."""

from __future__ import annotations

import contextlib
import logging
import os
import socket
import sys
import threading
import time
from collections.abc import Callable

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

    def feed_during(self, work: Callable[[], str]) -> str:
        """Do what has an end by itself and may take a while, in a thread, and tell systemd until then that all is well.

        Args:
            work: raises nothing.

        Returns:
            What it returned.
        """
        said: list[str] = []
        thread = threading.Thread(target=lambda: said.append(work()), daemon=True)
        try:
            thread.start()
        except RuntimeError:  # there are no more threads
            return work()
        while thread.is_alive():
            self.feed_watchdog()
            thread.join(2.0 * _ROUND_S)
        return said[0]

    def send(self, *lines: str) -> None:
        """Send assignments such as READY=1; of several lines one is made, since a line is an assignment."""
        if self._socket is not None:
            said = "\n".join("; ".join(map(str.strip, line.splitlines())) for line in lines)
            # systemd being away or slow to read is no reason to stop or to wait.
            with contextlib.suppress(OSError):
                self._socket.sendto(said.encode(errors="replace"), socket.MSG_DONTWAIT, self._address)


SOCKET = "/run/systemd/journal/socket"

FIELDS = {"instance": "HAPTICD_INSTANCE", "code": "HAPTICD_CODE", "tick": "HAPTICD_TICK", "law": "HAPTICD_LAW"}
"""Attributes of a log record, and the journal's fields that they become."""

_PRIORITIES = ((logging.ERROR, 3), (logging.WARNING, 4), (logging.INFO, 6))


def log_handler(path: str = SOCKET) -> logging.Handler:
    """A handler for where standard error goes.

    Args:
        path: the journal's socket.
    """
    plain = logging.StreamHandler(sys.stderr)
    plain.setFormatter(logging.Formatter("%(levelname)-7s %(message)s"))
    return JournalHandler(path, plain) if _goes_to_journal() else plain


class JournalHandler(logging.Handler):
    """Sends records to the journal in its native protocol: one datagram a record, `FIELD=value` a line.

    A journal that is away or busy is not waited for: the thread that logs also drains the ring.

    Args:
        path: the journal's socket.
        instead: gets what the journal does not take.
    """

    def __init__(self, path: str, instead: logging.Handler) -> None:
        super().__init__()
        self.setFormatter(logging.Formatter("%(message)s"))
        self._path = path
        self._instead = instead
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK | socket.SOCK_CLOEXEC)

    def emit(self, record: logging.LogRecord) -> None:
        """Send a record."""
        try:
            self._socket.sendto(datagram(self.format(record), record), self._path)
        except OSError:
            self._instead.handle(record)

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()
        super().close()


def datagram(message: str, record: logging.LogRecord) -> bytes:
    """A record as the journal takes it.

    Args:
        message: the text.
        record: its level, and its attributes of `FIELDS` where it has them.
    """
    priority = next((number for level, number in _PRIORITIES if record.levelno >= level), 7)
    fields = {"MESSAGE": message, "PRIORITY": priority, "SYSLOG_IDENTIFIER": "hapticd"}
    fields |= {field: getattr(record, name) for name, field in FIELDS.items() if hasattr(record, name)}
    return b"".join(_field(name, str(value).encode(errors="replace")) for name, value in fields.items())


def _field(name: str, value: bytes) -> bytes:
    if b"\n" in value:  # then its length comes first, 64 bits
        return name.encode() + b"\n" + len(value).to_bytes(8, "little") + value + b"\n"
    return name.encode() + b"=" + value + b"\n"


def _goes_to_journal() -> bool:
    """Whether standard error is the stream that systemd made to the journal."""
    try:
        status = os.fstat(2)
    except OSError:
        return False
    return os.environ.get("JOURNAL_STREAM") == f"{status.st_dev}:{status.st_ino}"
