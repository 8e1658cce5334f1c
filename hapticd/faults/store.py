"""The fault records of an instance: a directory that never holds more than it may."""

from __future__ import annotations

import contextlib
import os
import time
from functools import partial
from pathlib import Path

from hapticd.errors import HapticdError
from hapticd.faults.record import SUFFIX
from hapticd.paths import make_directory
from hapticd.replacing import put

_UNFINISHED = ".part"


class FaultStore:
    """A directory of fault records; their names sort by time.

    Args:
        directory: where they lie; made when the first is written.
    """

    def __init__(self, directory: Path) -> None:
        self.directory = directory

    def paths(self) -> list[Path]:
        """The records, newest first.

        Raises:
            HapticdError: this user may not look.
        """
        try:
            return sorted((path for path in self.directory.iterdir() if path.suffix == SUFFIX), reverse=True)
        except FileNotFoundError:
            return []
        except OSError as error:
            advice = "; join the group hapticd, or use sudo" if isinstance(error, PermissionError) else ""
            raise HapticdError(f"{self.directory}: {error.strerror}{advice}") from error

    def write(self, epoch_s: float, code: int, content: bytes, keep: int) -> Path:
        """Add a record, whole or not at all, and remove the oldest of those that are too many.

        Args:
            epoch_s: when the fault happened, which names the record [s].
            code: its event code.
            content: the record.
            keep: most records to keep.

        Raises:
            OSError: it could not be written; the directory is as it was.
        """
        make_directory(self.directory, 0o750)
        milliseconds = int(epoch_s * 1e3)
        stamp = time.strftime("%Y%m%dT%H%M%S", time.gmtime(milliseconds // 1000))
        path = self.directory / f"{stamp}.{milliseconds % 1000:03d}Z-{code}{SUFFIX}"
        unfinished = path.with_suffix(_UNFINISHED)
        try:
            # Under any umask: it holds the configuration and what people did with the device.
            with open(unfinished, "wb", opener=partial(os.open, mode=0o640)) as file:
                file.write(content)
                file.flush()
                os.fsync(file.fileno())
            put(unfinished, path)
        except BaseException:
            with contextlib.suppress(OSError):
                unfinished.unlink()
            raise
        for stale in self.directory.glob(f"*{_UNFINISHED}"):  # of a daemon that was killed while it wrote
            stale.unlink(missing_ok=True)
        # A clock that was set back names this one as the oldest, and it is the one that is wanted.
        for old in [other for other in self.paths() if other != path][max(0, keep - 1) :]:
            old.unlink(missing_ok=True)
        return path
