"""See that the configuration file was saved, however an editor or an orchestrator does that.

A file may be written in place, renamed over, or exchanged by turning a link on the way to it; its directory may be
replaced. So each directory is watched in which something on the way to the file could change, and what counts in the
end is whether the file says something else.
"""

from __future__ import annotations

import logging
import threading
from collections import deque
from pathlib import Path

from watchfiles import watch

from hapticd.config.file import read
from hapticd.config.loading import LoadedConfig, parse
from hapticd.errors import ConfigError

QUIET_S = 0.25
"""A file counts as saved when it has not changed for this long [s]."""

LOOK_S = 1.0
"""How often the file is looked at in any case [s]: no directory tells what happened before it was watched."""

CLOSE_S = 1.0
"""How long a disk that does not answer may hold up the end of the daemon [s]."""

_MOST_LINKS = 40

log = logging.getLogger("hapticd")
logging.getLogger("watchfiles").setLevel(logging.WARNING)  # else it tells of every change that it has seen


class FileWatcher:
    """Looks at a file from a thread of its own, so that a slow disk holds nothing else up.

    Args:
        path: the file.
        text: what it said when it was read last.
    """

    def __init__(self, path: Path, text: str) -> None:
        self._path = path
        self._file = path.absolute()
        self._text = text
        self._identity: tuple[int, ...] = ()
        self._found: deque[LoadedConfig | ConfigError] = deque(maxlen=1)
        self._closed = threading.Event()
        self._thread = threading.Thread(target=self._run, name="saved files", daemon=True)
        self._thread.start()

    def take(self) -> LoadedConfig | ConfigError | None:
        """What the file says, or why it cannot be used; None when it says nothing new since it was asked last."""
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
        told = False
        while not self._closed.is_set():
            try:
                self._watch(steps_to(self._file))
            except (OSError, RuntimeError) as error:  # no watches left, or a directory that has just gone
                if not told:
                    told = True
                    log.warning("%s: looked at every %g s only: %s", self._path, LOOK_S, error)
                self._look()
                self._closed.wait(LOOK_S)

    def _watch(self, steps: list[Path]) -> None:
        """Look whenever something has changed, until the way to the file is another one."""
        directories = {step.parent for step in steps}
        names = {str(step) for step in steps}
        before = _identities(directories)
        changes = watch(
            *directories,
            watch_filter=lambda _, at: at in names,
            stop_event=self._closed,
            rust_timeout=int(LOOK_S * 1e3),
            yield_on_timeout=True,
            recursive=False,
            raise_interrupt=False,
            ignore_permission_denied=True,
        )
        for _ in changes:
            self._look()
            if steps_to(self._file) != steps or _identities(directories) != before:
                return

    def _look(self) -> None:
        """Read the file when it is another one than last time and has come to rest."""
        identity = _identity(self._file)
        if identity == self._identity:
            return
        before: tuple[int, ...] = (0,)
        while identity != before:
            if self._closed.wait(QUIET_S):
                return
            identity, before = _identity(self._file), identity
        if not identity:
            return  # about to be replaced; if not, the daemon goes on with what it has
        self._identity = identity
        try:
            text = read(self._file)
            if text == self._text or not text.strip():  # an empty file is one that is about to be written
                return
            self._text = text
            self._found.append(parse(text, str(self._path)))
        except ConfigError as error:
            self._found.append(error)


def steps_to(path: Path) -> list[Path]:
    """Every name on the way to a file, those that links lead over included: what may be exchanged."""
    steps: list[Path] = []
    links = 0
    here = Path("/")
    ahead = list(path.absolute().parts[1:])
    while ahead:
        name = ahead.pop(0)
        if name == "..":
            here = here.parent
            continue
        step = here / name
        steps.append(step)
        try:
            target = step.readlink()
        except OSError:  # no link
            here = step
            continue
        links += 1
        if links > _MOST_LINKS:
            break
        if target.is_absolute():
            here = Path("/")
        ahead = [part for part in target.parts if part != "/"] + ahead
    return steps


def _identities(paths: set[Path]) -> dict[Path, object]:
    return {path: _identity(path)[:2] for path in paths}


def _identity(path: Path) -> tuple[int, ...]:
    """What changes whenever a file does, which one it is first; empty while there is none."""
    try:
        status = path.stat()
    except OSError:
        return ()
    return (status.st_dev, status.st_ino, status.st_mtime_ns, status.st_size)
