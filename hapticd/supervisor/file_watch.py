"""See that the configuration file was saved, however an editor or an orchestrator does that.

A file may be written in place, renamed over, or exchanged by turning a link on the way to it; its directory may be
replaced. All of that shows in what the name leads to, which costs a system call to see; notifications of the kernel
would have to watch every directory on the way, and tell nothing of a network's file system.
"""

from __future__ import annotations

import threading
from collections import deque
from pathlib import Path

from hapticd.config.file import read
from hapticd.config.loading import LoadedConfig, parse
from hapticd.errors import ConfigError

QUIET_S = 0.25
"""How often the file is looked at, and so for how long it must not have changed to count as saved [s]."""

CLOSE_S = 1.0
"""How long a disk that does not answer may hold up the end of the daemon [s]."""


class FileWatcher:
    """Looks at a file from a thread of its own, so that a slow disk holds nothing else up.

    Args:
        path: the file.

    Raises:
        RuntimeError: no thread can be started.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._file = path.absolute()
        self._identity: tuple[int, ...] = ()
        self._found: deque[LoadedConfig | ConfigError] = deque(maxlen=1)
        self._closed = threading.Event()
        self._thread = threading.Thread(target=self._run, name="saved files", daemon=True)
        self._thread.start()

    def take(self) -> LoadedConfig | ConfigError | None:
        """What the file says, or why it cannot be used; None when it was not saved since this was asked last.

        What it says when the watch begins comes as well, and what says the same as before: only who asks knows what is
        in force, since others may have the file taken over meanwhile.
        """
        try:
            return self._found.popleft()
        except IndexError:
            return None

    def close(self) -> None:
        """Stop looking; returns at once."""
        self._closed.set()

    def wait_closed(self) -> None:
        """Return when the thread has ended: compiled code must not find the interpreter gone when it comes back."""
        self._thread.join(CLOSE_S)

    def _run(self) -> None:
        before: tuple[int, ...] = ()
        while not self._closed.wait(QUIET_S):
            identity = _identity(self._file)
            # One that has gone is about to be replaced; if not, the daemon goes on with what it has.
            if identity and identity == before and identity != self._identity:
                self._identity = identity
                self._look()
            before = identity

    def _look(self) -> None:
        """Read the file, which is another one than last time and has come to rest."""
        try:
            text = read(self._file, files_only=True)
            if text.strip():  # an empty file is one that is about to be written
                saved = parse(text, str(self._path))
                if _identity(self._file) == self._identity:  # else what was saved since may be in force already
                    self._found.append(saved)
        except ConfigError as error:
            self._found.append(error)
        except Exception as error:  # noqa: BLE001 - whatever a plug-in's checks raise, the next save is to be seen
            self._found.append(ConfigError(f"{self._path}: cannot be checked: {type(error).__name__}: {error}"))


def _identity(path: Path) -> tuple[int, ...]:
    """What changes whenever a file does, which one it is first; empty while there is none."""
    try:
        status = path.stat()
    except OSError:
        return ()
    return (status.st_dev, status.st_ino, status.st_mtime_ns, status.st_size)
