"""A file that this process has made, told by its inode from another one that lies at the same path by now."""

from __future__ import annotations

import contextlib
import os
from pathlib import Path


class OwnFile:
    """A file of this process.

    Args:
        path: where it was made.
        status: of the file itself.
    """

    def __init__(self, path: Path, status: os.stat_result) -> None:
        self._path = path
        self._identity = (status.st_dev, status.st_ino)

    def is_in_place(self) -> bool:
        """Whether it still lies where it was made; what cannot be looked at has not gone."""
        try:
            status = self._path.lstat()
        except (FileNotFoundError, NotADirectoryError):
            return False
        except OSError:
            return True
        return (status.st_dev, status.st_ino) == self._identity

    def unlink(self) -> None:
        """Remove it, and no other; never raises: what is left behind is in nobody's way."""
        if self.is_in_place():
            with contextlib.suppress(OSError):
                self._path.unlink()
