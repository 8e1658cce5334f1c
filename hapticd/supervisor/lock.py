"""One daemon an instance: a lock that the kernel drops with the process, so that nothing stale can block a start."""

from __future__ import annotations

import contextlib
import fcntl
import os
import time
from pathlib import Path

from hapticd.errors import InstanceError
from hapticd.own_file import OwnFile
from hapticd.paths import LOCK, make_runtime_directory, open_lock, why_refused

LOOK_S = 0.2
"""How long a client that looks whether a daemon lives may hold the lock, which takes it microseconds [s]."""

TOUCH_S = 3600.0
"""How often the lock is marked as in use, for what removes old files from /tmp [s]."""


class InstanceLock:
    """Holds an instance until closed.

    A second bind would silently take an ipc path over from a running daemon; this lock comes first.

    Args:
        instance: name of the instance.

    Attributes:
        directory: the instance's runtime directory.

    Raises:
        InstanceError: another daemon holds the instance, or the directory cannot be used.
    """

    def __init__(self, instance: str) -> None:
        self.directory: Path = make_runtime_directory(instance)
        path = self.directory / LOCK
        self._descriptor = open_lock(path)
        try:
            _take(self._descriptor)
        except OSError as error:
            holder = os.pread(self._descriptor, 32, 0).decode(errors="replace").strip()
            os.close(self._descriptor)
            raise InstanceError(
                f"instance {instance!r} is already running (process {holder or 'unknown'}); stop it, or choose "
                "another with --instance"
            ) from error
        self._file = OwnFile(path, os.fstat(self._descriptor))
        if not self._file.is_in_place():
            os.close(self._descriptor)
            raise InstanceError(f"instance {instance!r} is just being stopped or started by another daemon; try again")
        self._touch_due_s = 0.0
        try:
            os.ftruncate(self._descriptor, 0)
            os.pwrite(self._descriptor, f"{os.getpid()}\n".encode(), 0)
        except OSError as error:  # a disk that is full
            self.close()
            raise InstanceError(f"{path}: {why_refused(error.errno)}") from error

    def keep(self) -> bool:
        """Whether the lock still lies where others look for it; without, nothing keeps a second daemon away."""
        now_s = time.monotonic()
        if now_s >= self._touch_due_s:
            self._touch_due_s = now_s + TOUCH_S
            with contextlib.suppress(OSError):
                os.utime(self._descriptor)
        return self._file.is_in_place()

    def close(self) -> None:
        """Give the instance back and leave nothing behind; what another has put in its place stays."""
        self._file.unlink()
        os.close(self._descriptor)


def _take(descriptor: int) -> None:
    give_up_s = time.monotonic() + LOOK_S
    while True:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            if time.monotonic() > give_up_s:
                raise
            time.sleep(0.01)
        else:
            return
