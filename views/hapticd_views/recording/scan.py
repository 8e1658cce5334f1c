"""Go through an MCAP file from its start to its end, or to where it was cut: what was whole before is read.

The index at the end is not needed. A chunk whose checksum is wrong ends the file, as a cut does.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, cast

import zstandard
from mcap.exceptions import InvalidMagic, McapError
from mcap.records import Channel, Chunk, DataEnd, McapRecord, Message, Metadata, Schema
from mcap.stream_reader import StreamReader, breakup_chunk

from hapticd.errors import ConfigError, HapticdError

_LARGEST_RECORD = 1 << 28
_BROKEN = (McapError, EOFError, struct.error, ValueError, zstandard.ZstdError, MemoryError, OverflowError, RuntimeError)

_NO_END = "it has no end, as where the recorder was killed"


class Scan:
    """One way through a file.

    Args:
        path: the file.

    Attributes:
        cut: why it ends before its proper end; "" when it does not, once it was gone through.
        intact_bytes: how far it is whole.

    Raises:
        HapticdError: it cannot be read, or is no MCAP file.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.cut = "it was not gone through"
        self.intact_bytes = 0

    def pieces(self) -> Iterator[list[Schema | Channel | Message] | Metadata]:
        """The records of each chunk, and each metadata record, in the order of the file."""
        with _opened(self.path) as file:
            stream = _WholeReads(file)
            reader = StreamReader(cast("IO[bytes]", stream), emit_chunks=True, record_size_limit=_LARGEST_RECORD)
            try:
                for record in reader.records:
                    piece = _piece(record)
                    self.intact_bytes = file.tell()
                    if piece is not None:
                        yield piece
                    if isinstance(record, DataEnd):
                        self.cut = ""
                        return
                self.cut = _NO_END
            except InvalidMagic as error:
                if not self.intact_bytes:
                    raise HapticdError(f"{self.path}: is no MCAP file") from error
                self.cut = "its end is damaged"
            except _BROKEN as error:
                if not self.intact_bytes and not stream.began:
                    raise HapticdError(f"{self.path}: is no MCAP file: it is too short for one") from error
                left = file.seek(0, 2) - self.intact_bytes
                why = str(error) or type(error).__name__
                self.cut = f"cut or damaged: the last {left} bytes cannot be read ({why})" if left else _NO_END
            except OSError as error:
                raise HapticdError(f"{self.path}: cannot be read: {error.strerror}") from error


class _WholeReads:
    """A file that gives as many bytes as it is asked for, or none: half a text is not a shorter text."""

    def __init__(self, file: IO[bytes]) -> None:
        self._file = file
        self.began = False

    def read(self, count: int) -> bytes:
        found = self._file.read(count)
        if len(found) < count:
            raise EOFError(f"{count - len(found)} bytes are missing")
        self.began = True
        return found


@contextmanager
def _opened(path: Path) -> Iterator[IO[bytes]]:
    try:
        file = path.open("rb")
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror}") from error
    with file:
        yield file


def _piece(record: McapRecord) -> list[Schema | Channel | Message] | Metadata | None:
    if isinstance(record, Chunk):
        inside = breakup_chunk(record, validate_crc=True)
        return [one for one in inside if isinstance(one, Schema | Channel | Message)]
    if isinstance(record, Schema | Channel | Message):
        return [record]
    return record if isinstance(record, Metadata) else None
