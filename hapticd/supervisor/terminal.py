"""The terminal that a daemon was started at: when it is closed, the person at it is gone."""

from __future__ import annotations

import errno
import os
import signal

_GONE = (errno.ENXIO, errno.EIO, errno.ENOENT)


class Terminal:
    """Where this process was started. Made before anything handles SIGHUP: `nohup` means that it is to outlive it."""

    def __init__(self) -> None:
        self._matters = _is_there() and signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN

    def closed(self) -> bool:
        """Whether there was one that mattered, and it is gone."""
        return self._matters and not _is_there()


def _is_there() -> bool:
    try:
        os.close(os.open("/dev/tty", os.O_RDWR | os.O_NOCTTY | os.O_CLOEXEC))
    except OSError as error:  # also where no descriptor is left, which says nothing of a terminal
        return error.errno not in _GONE
    return True
