"""What is done of a study: one line of JSON a block, beside the output, good for going on after a kill."""

from __future__ import annotations

import contextlib
import fcntl
import json
from pathlib import Path
from typing import Any

from hapticd.errors import ConfigError, HapticdError, InstanceError

Row = list[float]


class Journal:
    """The finished blocks of one study.

    A line that was cut off by a kill is dropped when the file is opened again; those before it count.

    Args:
        path: the file; it is locked as long as this is open.
        fingerprint: tells one study from another, code included.
        fresh: forget what is there.

    Attributes:
        path: the file.
        done: rows of every finished block.

    Raises:
        ConfigError: the file cannot be written, or it belongs to another study.
        HapticdError: the disk is full.
        InstanceError: another process is at work on it.
    """

    def __init__(self, path: Path, fingerprint: str, fresh: bool = False) -> None:
        self.path = path
        self.done: dict[int, list[Row]] = {}
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._file = path.open("a+b")
        except OSError as error:
            raise ConfigError(f"{path.parent}: cannot be written: {error.strerror}") from None
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            self._file.close()
            raise InstanceError(f"{path.parent}: another study is writing here; wait for it or stop it") from None
        try:
            if fresh:
                self._file.truncate(0)
            self._read(fingerprint)
        except BaseException:
            self._let_go()
            raise

    def keep(self, block: int, rows: list[Row]) -> None:
        """Enter a finished block.

        Raises:
            HapticdError: the disk is full; the blocks before this one count.
        """
        self.done[block] = rows
        self._write({"block": block, "rows": rows})

    def close(self) -> None:
        """Leave the file for another time if there is something in it; twice is as good as once."""
        if not self.done and not self._file.closed:
            self.path.unlink(missing_ok=True)
        self._let_go()

    def remove(self) -> None:
        """The study is complete and its output written."""
        self.path.unlink(missing_ok=True)
        self._let_go()

    def _read(self, fingerprint: str) -> None:
        self._file.seek(0)
        good = 0
        ours = False
        for number, line in enumerate(self._file):
            try:
                entry = json.loads(line) if line.endswith(b"\n") else None
            except ValueError:
                entry = None
            if not isinstance(entry, dict):
                break
            if number == 0:
                ours = entry.get("study") == fingerprint
            elif ours:
                self.done[entry["block"]] = entry["rows"]
            else:
                raise ConfigError(
                    f"{self.path}: unfinished work of another study, other settings or another version; finish that "
                    "one, choose another --output, or give --fresh to forget it"
                )
            good += len(line)
        if not ours:
            good = 0
        self._file.truncate(good)
        if good == 0:
            self._write({"study": fingerprint})

    def _write(self, entry: dict[str, Any]) -> None:
        try:
            self._file.write(json.dumps(entry, separators=(",", ":")).encode() + b"\n")
            self._file.flush()
        except OSError as error:
            raise HapticdError(
                f"{self.path}: cannot be written: {error.strerror}; finished cells are kept, the same command goes on "
                "from there"
            ) from error

    def _let_go(self) -> None:
        with contextlib.suppress(OSError):  # what the disk did not take is tried once more, and was told
            self._file.close()
